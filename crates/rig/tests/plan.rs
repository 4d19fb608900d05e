//! The description, the plan, its cost, and the directory that is laid out.

#![allow(clippy::unwrap_used)] // in helpers of tests too

mod support;

use std::fs;
use std::path::Path;

use relumine_capture::{Capture, ShownPattern};
use relumine_radiometry::files::{Picture, read_picture};
use relumine_rig::{Estimate, Hands, Plan, PlanWarning, Rig, RigError, lay_out, pattern_picture};
use support::{RIG, rig};

fn error(from: &str, to: &str) -> String {
    assert!(RIG.contains(from));
    Rig::parse(Path::new("rig.toml"), &RIG.replace(from, to)).err().expect(to).to_string()
}

#[test]
fn the_papers_rig_takes_21728_photographs_and_41_hours() {
    let rig = Rig::read(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/paper-rig.toml"))).unwrap();
    let plan = Plan::of(&rig);
    assert_eq!((plan.positions(), plan.per_position(), plan.len()), (224, 97, 21_728));
    let estimate = Estimate::of(&rig, &plan);
    assert!(estimate.hours.is_some_and(|hours| (40.5..41.5).contains(&hours)), "{:?} h", estimate.hours);
    assert_eq!((estimate.reckoned_bits, estimate.bytes), (Some(16), 21_728 * 1440 * 960 * 6));
    assert_eq!(PlanWarning::all(&rig, &estimate, None, 0), []);
}

#[test]
fn the_example_of_the_format_is_read_with_every_key() {
    let text = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../FORMAT.md")).unwrap();
    let section = &text[text.find("## 5. Rig description").unwrap()..];
    let example = section.split("```toml\n").nth(1).unwrap().split("```").next().unwrap();
    let rig = Rig::parse(Path::new("rig.toml"), example).unwrap();
    assert_eq!(Plan::of(&rig).len(), 48 * 50 * 2);
    // Where a default is given, it is the default.
    let bare = RIG.replace("watched-folder", "watched-folder\"\n[simulated]\nscene = \"chess.toml");
    let bare = Rig::parse(Path::new("rig.toml"), &bare).unwrap();
    assert_eq!((rig.manual(), rig.timing(), rig.simulated()), (bare.manual(), bare.timing(), bare.simulated()));
    assert!(rig.white() && bare.white());
}

#[test]
fn photographs_go_by_position_then_pattern_then_exposure() {
    let plan = Plan::of(&rig());
    let names: Vec<String> = plan.photographs().map(|planned| planned.stem()).collect();
    assert_eq!(names.len(), 4 * 18 * 2);
    let start = ["black_e0", "black_e1", "white_e0", "white_e1", "row-0-0_e0", "row-0-0_e1", "row-0-1_e0"];
    assert_eq!(names[..7], start.map(|name| format!("photographs/p000/{name}")));
    assert_eq!(names[35], "photographs/p000/column-3-1_e1");
    assert_eq!(names[36], "photographs/p001/black_e0");
    // Written longest first, taken shortest first.
    assert_eq!([0, 1].map(|number| plan.photograph(number).exposure.exposure_s), [0.25, 1.0]);
}

#[test]
fn what_cannot_be_says_where_and_why() {
    for (from, to, said) in [
        ("relumine-rig/1", "relumine-capture/1", "format: expected \"relumine-rig/1\""),
        ("exposures_s", "exposure_s", "rig.toml:20: unknown key `exposure_s`: did you mean `exposures_s`?"),
        ("spacing = 2", "spacing = 2\nwhit = false", "did you mean `white`?"),
        ("radius_m = 2.0", "radius_m = 0", "radius_m"),
        ("squares = 4", "squares = 4.5", "rig.toml:10: invalid type"),
        ("\"combs\"", "\"grid\"", "scheme must be \"combs\" or \"squares\""),
        ("[1.0, 0.25]", "[]", "1 to 64 times, found 0"),
        ("[1.0, 0.25]", "[1.0, 1]", "found 1 twice"),
        ("[1.0, 0.25]", "[1.0, -1]", "found -1"),
        ("[1.0, 0.25]", "[1.0, nan]", "found NaN"),
        ("[1.0, 0.25]", "[1.0]\niso = 100", "both be given"),
        ("[1.0, 0.25]", "[1.0]\niso = 100\nf_number = 0", "f_number must be"),
        ("\"watched-folder\"", "\"simulated\"", "must all be \"simulated\" or none"),
        ("\"watched-folder\"", "\"folder\"", "unknown variant `folder`"),
        ("\"watched-folder\"", "\"watched-folder\"\n[timing]\nmove_s = -1", "timing: move_s must be 0 to"),
        ("\"watched-folder\"", "\"watched-folder\"\n[manual]\nsettle_s = inf", "manual: settle_s must be 0 to"),
        ("tilts = 2", "tilts = 2\nobject_radius_m = 0", "object_radius_m must be"),
    ] {
        let error = error(from, to);
        assert!(error.starts_with("rig.toml:") && error.contains(said), "{to}: {error}");
    }
    let simulated = RIG.replace("manual", "simulated").replace("watched-folder", "simulated");
    let error = Rig::parse(Path::new("rig.toml"), &simulated).err().unwrap().to_string();
    assert!(error.contains("the section [simulated], which is missing"), "{error}");
}

#[test]
fn a_plan_warns_of_disk_memory_and_object() {
    let text = RIG.replace("tilts = 2", "tilts = 2\nobject_radius_m = 0.6");
    let rig = Rig::parse(
        Path::new("rig.toml"),
        &text.replace("height = 16", "height = 16\nbytes_per_photograph = 9000000000000000000"),
    )
    .unwrap();
    let estimate = Estimate::of(&rig, &Plan::of(&rig));
    assert_eq!(estimate.bytes, u64::MAX, "saturates");
    let warnings = PlanWarning::all(&rig, &estimate, Some(Path::new("a/new/name")), u64::MAX);
    let said = warnings.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n");
    assert!(said.contains("are free on this disk") && said.contains("half_width = 0.314 would cover it"), "{said}");
    assert_eq!(said.contains("of memory a position"), Path::new("/proc/meminfo").exists());
}

#[test]
fn a_capture_is_laid_out_once() {
    let folder = tempfile::tempdir().unwrap();
    let capture = folder.path().join("capture");
    lay_out(&rig(), &capture, false).unwrap();
    let open = Capture::open(&capture).unwrap();
    assert_eq!((open.setup().title(), open.photographs().len()), (Some("fake"), 0));
    // The description goes there and back, and the watched folder is ready.
    assert_eq!(fs::read_to_string(capture.join("rig.toml")).unwrap(), RIG);
    assert!(capture.join("incoming").is_dir());
    assert_eq!(fs::read_dir(capture.join("patterns")).unwrap().count(), 18);
    let names: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(names, ["capture"], "nothing temporary is left");

    assert!(matches!(lay_out(&rig(), &capture, false), Err(RigError::Exists { .. })));
    lay_out(&rig(), &capture, true).unwrap();
    // A picture that the camera left is somebody's work.
    fs::write(capture.join("incoming/IMG_1.JPG"), "light").unwrap();
    let error = lay_out(&rig(), &capture, true).unwrap_err().to_string();
    assert!(error.contains("it has the file incoming/IMG_1.JPG"), "{error}");
    fs::remove_file(capture.join("incoming/IMG_1.JPG")).unwrap();
    let table = fs::read_to_string(capture.join("photographs.csv")).unwrap();
    fs::write(capture.join("photographs.csv"), table + "0,black,1,,,a.png,\n").unwrap();
    let error = lay_out(&rig(), &capture, true).unwrap_err().to_string();
    assert!(error.contains("lists 1 photographs"), "{error}");

    let other = folder.path().join("other");
    fs::create_dir(&other).unwrap();
    lay_out(&rig(), &other, false).unwrap();
    fs::create_dir(folder.path().join("home")).unwrap();
    fs::write(folder.path().join("home/letter.txt"), "dear").unwrap();
    let error = lay_out(&rig(), &folder.path().join("home"), true).unwrap_err().to_string();
    assert!(error.contains("is not replaced: it is not a capture"), "{error}");
}

#[test]
fn what_a_description_names_is_found_from_the_capture_too() {
    let folder = tempfile::tempdir().unwrap();
    let text = RIG
        .replace("manual", "simulated")
        .replace("watched-folder", "simulated")
        .replace("height = 16", "height = 16\nresponse = \"curves/old \\\"one\\\".csv\"\ncolour = \"chart.toml\"")
        + "\n[simulated]\nsamples = 2\nscene = \"scenes/../ball.toml\"   # a ball\nseed = 3\n";
    fs::write(folder.path().join("rig.toml"), text).unwrap();
    fs::create_dir_all(folder.path().join("curves")).unwrap();
    fs::create_dir_all(folder.path().join("scenes")).unwrap();
    let curve = "relative_exposure,red,green,blue\n0,0,0,0\n1,1,1,1\n";
    fs::write(folder.path().join("curves/old \"one\".csv"), curve).unwrap();
    let colour =
        "format = \"relumine-colour/1\"\nmodel = \"matrix\"\ncoefficients = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\n";
    fs::write(folder.path().join("chart.toml"), colour).unwrap();
    let capture = folder.path().join("capture");
    let rig = Rig::read(&folder.path().join("rig.toml")).unwrap();
    assert_eq!(rig.hands(), Hands::Simulated);
    let error = lay_out(&rig, &capture, false).unwrap_err();
    assert!(matches!(&error, RigError::Read { path, .. } if path.ends_with("scenes/../ball.toml")), "{error}");
    assert!(!capture.exists());
    fs::write(folder.path().join("ball.toml"), "").unwrap();
    lay_out(&rig, &capture, false).unwrap();
    let again = Rig::read(&capture.join("rig.toml")).unwrap();
    let scene = &again.simulated().unwrap().scene;
    assert!(scene.is_absolute() && scene.is_file(), "{}", scene.display());
    assert_eq!(again.simulated().unwrap().seed, 3);
    assert!(fs::read_to_string(capture.join("rig.toml")).unwrap().contains("# a ball"));
    assert_eq!(fs::read_to_string(capture.join("curves/old \"one\".csv")).unwrap(), curve);
    assert_eq!(fs::read_to_string(capture.join("chart.toml")).unwrap(), colour);
    assert_eq!(Capture::open(&capture).unwrap().setup().colour_name(), Some("chart.toml"));
    assert!(!capture.join("patterns").exists());
    // What was laid out is nobody's work: it may be laid out again.
    lay_out(&rig, &capture, true).unwrap();
}

#[test]
fn the_picture_of_a_pattern_lights_its_squares() {
    let rig = rig();
    let pattern = ShownPattern::Row { v: 1, k: 1 };
    let picture = pattern_picture(rig.setup(), pattern);
    assert_eq!(picture.size(), (1024, 1024));
    for (u, v) in (0..4).flat_map(|u| (0..4).map(move |v| (u, v))) {
        let lit = pattern.lit(4, 2).contains(&(u, v));
        let corners = [(0, 0), (255, 0), (0, 255), (255, 255)];
        for pixel in corners.map(|(x, y)| picture.pixel(u * 256 + x, v * 256 + y)) {
            assert_eq!(pixel, if lit { [255; 3] } else { [0; 3] }, "square ({u}, {v})");
        }
    }
    let folder = tempfile::tempdir().unwrap();
    lay_out(&rig, &folder.path().join("capture"), false).unwrap();
    let read = read_picture(&folder.path().join("capture/patterns/row-1-1.png")).unwrap();
    assert_eq!(read, Picture::Integer { image: picture, bits: 8 });
}
