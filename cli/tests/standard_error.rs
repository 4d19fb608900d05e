//! `relight --error`: written beside the picture, refused where a field does not know what it is uncertain by.

#![allow(clippy::unwrap_used)] // in helpers of tests too

mod support;

use support::studio::{Plan, Studio};
use support::{read, relumine, shown};

#[test]
fn the_standard_error_is_a_picture_of_its_own_and_repeats_to_the_bit() {
    let studio = Studio::new(&Plan::default());
    let (field, sky) = (studio.field(), studio.sky());
    let errors = ["1", "2"].map(|threads| {
        let (picture, error) = (studio.path(&format!("{threads}.exr")), studio.path(&format!("{threads}-error.exr")));
        let words = ["relight", "--threads", threads].map(std::ffi::OsString::from);
        let words =
            words.into_iter().chain([&field, &"--light".into(), &sky].map(|word| word.clone().into_os_string()));
        let words = words.chain(["-o".into(), picture.into(), "--error".into(), error.clone().into()]);
        support::run(&words.collect::<Vec<_>>()).succeeds();
        read(&error)
    });
    let samples = errors[0].pixels().as_flattened();
    assert!(samples.iter().all(|sample| sample.is_finite() && *sample >= 0.0));
    assert!(samples.iter().any(|sample| *sample > 0.0), "photographs of whole numbers are uncertain by their rounding");
    assert_eq!(errors[0], errors[1]);
}

#[test]
fn what_cannot_be_is_refused() {
    let studio = Studio::new(&Plan::default());
    let (field, sky, picture) = (studio.field(), studio.sky(), studio.path("out.exr"));
    let other = studio.path("minimum.field");
    relumine!("develop", &studio.capture(), "-o", &other, "--separation", "minimum").succeeds();
    let error = studio.path("error.exr");
    relumine!("relight", &other, "--light", &sky, "-o", &picture, "--error", &error)
        .fails(1, &["does not say what it is uncertain by", "\"minimum\"", &shown(&other)]);
    assert!(!picture.exists() && !error.exists(), "refused before anything is written");
    relumine!("relight", &field, "--light", &sky, "-o", &picture, "--error", &studio.path("error.png"))
        .fails(2, &["error.png", ".exr or .hdr"]);
    relumine!("relight", &field, "--light", &sky, "-o", &picture, "--error", &picture).fails(2, &["given twice"]);
    relumine!("relight", &field, "--light", &sky, "-o", &picture, "--error", &error, "--error", &studio.path("b.exr"))
        .fails(2, &["1 lights, but 2 standard errors"]);
}
