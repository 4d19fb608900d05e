//! Any text gives a rig that can be planned, or an error that names the file: never a panic.

#![allow(clippy::unwrap_used)] // in helpers of tests too

use std::path::Path;

use proptest::prelude::*;
use relumine_rig::{Estimate, Plan, PlanWarning, Rig};

#[path = "../../../fuzz/spoil.rs"]
mod spoil;
use spoil::{seeded, spoiled_text};

const RIGS: [&str; 2] = [
    include_str!("../../../examples/paper-rig.toml"),
    r#"format = "relumine-rig/1"
[hemisphere]
radius_m = 2.5
positions_deg = [[15.0, 11.25], [45.0, 60], [200, 89.5], [310, 0]]
[projector]
squares = 2
half_width = 0.3
[patterns]
scheme = "squares"
white = true
[camera]
width = 16
height = 8
exposures_s = [8, 0.5, 0.03125]
iso = 100
f_number = 8
bytes_per_photograph = 1000
[drivers]
stage = "simulated"
projector = "simulated"
camera = "simulated"
[timing]
move_s = 1
[simulated]
scene = "balls.toml"
samples = 16
seed = 7
projector_black = 0.01
sensor = { bits = 12, read_noise_e = 3.5 }
"#,
];

fn try_rig(text: &str) -> Result<(), String> {
    let rig = Rig::parse(Path::new("no/such/rig.toml"), text).map_err(|error| error.to_string())?;
    let plan = Plan::of(&rig);
    assert!(!plan.is_empty() && plan.len() == plan.positions() * plan.per_position());
    let last = plan.photograph(plan.len() - 1);
    assert_eq!((last.position, last.exposure_index), (plan.positions() - 1, plan.exposures().len() - 1));
    assert!(plan.exposures().is_sorted_by(|a, b| a.relative() < b.relative()));
    let estimate = Estimate::of(&rig, &plan);
    assert!(estimate.hours.is_none_or(|hours| hours >= 0.0 && hours.is_finite()), "{:?} h", estimate.hours);
    PlanWarning::all(&rig, &estimate, None, 0).iter().for_each(|warning| assert!(!warning.to_string().is_empty()));
    // The capture that it is laid out as reads back.
    let setup = relumine_capture::Setup::parse(rig.path(), rig.capture_toml()).expect("what was read once");
    assert_eq!(setup.picture_size(), rig.setup().picture_size());
    Ok(())
}

proptest! {
    #![proptest_config(seeded(400))]

    #[test]
    fn a_spoiled_description_is_used_or_refused(text in spoiled_text(&RIGS)) {
        if let Err(error) = try_rig(&text) {
            // A response file that is named and not there: the error is about that file.
            prop_assert!(error.starts_with("no/such/rig.toml") || error.starts_with("cannot read no/such"), "{error}");
        }
    }

    #[test]
    fn any_text_is_no_rig(text in any::<String>()) {
        let error = try_rig(&text).expect_err("no rig has only a few letters");
        prop_assert!(error.starts_with("no/such/rig.toml"), "{error}");
    }
}

#[test]
fn the_valid_texts_are_read() {
    RIGS.into_iter().try_for_each(try_rig).unwrap();
}
