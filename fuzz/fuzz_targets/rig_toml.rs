//! `rig.toml`: any text gives a rig that can be planned and laid out, or an error that names the file.
#![no_main]

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use relumine_capture::Setup;
use relumine_rig::{Estimate, Plan, PlanWarning, Rig};

/// A response file, `response.csv`, lies beside it.
const PATH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/beside/rig.toml");

fuzz_target!(|text: &str| {
    match Rig::parse(Path::new(PATH), text) {
        Ok(rig) => {
            let plan = Plan::of(&rig);
            let last = plan.photograph(plan.len() - 1);
            assert_eq!((last.position, last.exposure_index), (plan.positions() - 1, plan.exposures().len() - 1));
            let estimate = Estimate::of(&rig, &plan);
            assert!(estimate.hours.is_none_or(|hours| hours >= 0.0 && hours.is_finite()));
            for warning in PlanWarning::all(&rig, &estimate, None, 0) {
                assert!(!warning.to_string().is_empty());
            }
            assert!(Setup::parse(rig.path(), rig.capture_toml()).is_ok());
            if rig.simulated().is_none() {
                assert!(rig.text_for_elsewhere().is_ok_and(|same| same == text));
            }
        }
        Err(error) => assert!(error.to_string().contains(env!("CARGO_MANIFEST_DIR")), "{error}"),
    }
});
