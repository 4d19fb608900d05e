//! A sound rig passes the exam; each broken one fails it, and the exam says where.

#![allow(clippy::unwrap_used)] // in helpers of tests too

mod support;

use relumine_rig::exam;
use support::{Fault, fake, rig};

fn examined(fault: Fault) -> Result<(), String> {
    exam::rig(&mut fake(fault).0, &rig())
}

#[test]
fn a_sound_rig_passes() {
    examined(Fault::None).unwrap();
}

#[test]
fn broken_rigs_fail() {
    for (fault, said) in [
        (Fault::Size, "camera: capture.toml promises pictures of 24 × 16"),
        (Fault::Torn, "not a whole PNG"),
        (Fault::Shutter, "darker than that of 0.25 s"),
        (Fault::LongShutter, "camera: exposures of 0.25 s and 1 s say different radiances"),
        (Fault::Response, "camera: exposures of 0.25 s and 1 s say different radiances"),
        (Fault::Flicker, "camera: two photographs of 1 s differ by"),
        (Fault::StuckProjector, "projector: black is as bright as white"),
        (Fault::WarmingProjector, "projector: white shown again"),
        (Fault::WrongColumns, "projector: the combs of rows add up to"),
        (Fault::StuckStage, "stage: the pictures from positions 0 and"),
        (Fault::LooseStage, "stage: position 0 is another place after"),
    ] {
        let reason = examined(fault).expect_err(&format!("{fault:?}"));
        assert!(reason.contains(said), "{fault:?}: {reason}");
    }
}

#[test]
fn one_exposure_is_examined_with_half_of_it() {
    let text = support::RIG.replace("[1.0, 0.25]", "[1.0]");
    let rig = relumine_rig::Rig::parse("rig.toml".as_ref(), &text).unwrap();
    exam::rig(&mut fake(Fault::None).0, &rig).unwrap();
    assert!(exam::rig(&mut fake(Fault::Shutter).0, &rig).is_err());
}

const SCENE: &str = r#"format = "relumine-scene/1"
[camera]
position = [0, -2, 1.6]
target = [0, 0, 0.05]
horizontal_fov_deg = 20
width = 24
height = 16
[[material]]
name = "board"
diffuse.reflectance = { checkerboard = [[0.2, 0.1, 0.1], [0.7, 0.7, 0.6]], fields = [4, 4] }
[[material]]
name = "ball"
diffuse.reflectance = [0.6, 0.5, 0.3]
[[object]]
material = "board"
plane.size_m = [0.8, 0.8]
[[object]]
material = "ball"
sphere.radius_m = 0.12
translate_m = [0, 0, 0.12]
"#;

#[test]
fn the_virtual_rig_passes_with_all_its_faults() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("ball.toml"), SCENE).unwrap();
    let text = support::RIG
        .replace("manual", "simulated")
        .replace("watched-folder", "simulated")
        .replace("half_width = 0.25", "half_width = 0.25\nintensity_w_sr = 10")
        + "[simulated]\nscene = \"ball.toml\"\nsamples = 16\nprojector_black = 0.01\nprojector_vignetting = 0.2\n\
           misplaced_deg = 0.5\n";
    let rig = relumine_rig::Rig::parse(&folder.path().join("rig.toml"), &text).unwrap();
    let mut drivers = relumine_rig::drivers::open(&rig, folder.path()).unwrap();
    exam::rig(&mut drivers, &rig).unwrap();
}
