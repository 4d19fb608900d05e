//! A lamp that drifts while the projector stands, with a reference patch beside the object: `develop` takes it out.

#![allow(clippy::unwrap_used)] // in helpers of tests too

#[path = "support/painted.rs"]
mod painted;

use painted::{HEIGHT, Painted, WIDTH, World};
use relumine_capture::separation::Method;
use relumine_capture::{Capture, Developer, Judge, ShownPattern};

/// Relative L2 of all squares of position 2, told apart by the minimum, against those of `truth`. (Fitted squares are scaled to the
/// white frame, whatever the lamp did meanwhile.)
fn error(capture: &Painted, truth: &Painted) -> f64 {
    let transfer = |capture: &Painted| {
        let developer = Developer::new(Capture::open(capture.path()).unwrap(), Method::Minimum, None).unwrap();
        let developed = developer.develop(2).unwrap().unwrap();
        (developed.separate(8..WIDTH, 0..HEIGHT).transfer, developed.lamp(), developed.black_level().unwrap())
    };
    let ((found, lamp, b), (expected, _, expected_b)) = (transfer(capture), transfer(truth));
    println!("lamp {lamp:?}, b {b} and {expected_b}");
    let (mut error, mut energy) = (0.0, 0.0);
    for (found, expected) in found.iter().zip(&expected) {
        error += f64::from(found - expected).powi(2);
        energy += f64::from(*expected).powi(2);
    }
    (error / energy).sqrt()
}

#[test]
fn what_is_developed_is_what_a_steady_lamp_would_have_shown() {
    let steady = World { unlit: 8, ..World::default() };
    let drifting = |camera| World { unlit: 8, drift: Some((2, 0.12)), camera, ..World::default() };
    // The lamp is 6 % weaker at the black frame, and that is what the patch normalises to.
    let truth = steady.photographed_with(&|place, radiance| {
        if place.position == 2 { radiance.map(|value| 0.94 * value) } else { radiance }
    });
    let without = error(&drifting("").photographed(), &truth);
    let with = error(&drifting("reference_patch = [1, 4, 6, 56]").photographed(), &truth);
    println!("relative L2 {without:.4} without, {with:.4} with the patch");
    assert!(without > 0.03 && with < 0.005, "{without} without, {with} with the patch");
    assert!(with < 0.2 * without);
}

#[test]
fn the_judge_measures_the_drift_in_the_patch() {
    let world =
        World { unlit: 8, drift: Some((2, 0.12)), camera: "reference_patch = [1, 4, 6, 56]", ..World::default() };
    let capture = world.photographed();
    let developer = Developer::new(Capture::open(capture.path()).unwrap(), Method::Fitted, None).unwrap();
    let judgement = Judge::new(&developer).position(2);
    let (least, most) = judgement.patch_drift.unwrap();
    assert!((most / least - 1.06 / 0.94).abs() < 0.01, "{least} to {most}");
    assert_eq!(judgement.findings.len(), 1, "{:?}", judgement.findings);
    // With it taken out, nothing is left for the sums to find.
    assert!(judgement.drift.unwrap().abs() < 0.003);
}

#[test]
fn a_patch_that_measures_nothing_is_refused_with_the_photograph() {
    let told = |camera: &'static str| {
        let capture = World { unlit: 8, camera, ..World::default() }.photographed();
        let developer = Developer::new(Capture::open(capture.path()).unwrap(), Method::Fitted, None).unwrap();
        let white = developer.above_black(1, ShownPattern::White);
        assert!(white.is_err() == developer.develop(1).is_err());
        developer.develop(1).err().map(|error| error.to_string())
    };
    assert_eq!(told("reference_patch = [1, 4, 6, 56]"), None);
    let lit = told("reference_patch = [40, 20, 10, 10]").unwrap();
    assert!(lit.contains("photographs/p001/") && lit.contains("times as bright as under black"), "{lit}");
}
