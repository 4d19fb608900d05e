//! Response files: any text gives a curve that rises and can be inverted and drawn, or an error that names the file.
#![no_main]

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use relumine_radiometry::{Linearization, Response, ResponseCurve, response_plot};

fuzz_target!(|text: &str| {
    match ResponseCurve::parse(Path::new("r.csv"), text) {
        Ok(curve) => {
            for channel in 0..3 {
                let mut last = f64::NEG_INFINITY;
                for step in 0..=64 {
                    let fraction = curve.fraction(channel, f64::from(step) / 64.0);
                    assert!(fraction.is_finite() && fraction >= last, "{fraction} after {last}");
                    last = fraction;
                }
            }
            assert_eq!(ResponseCurve::parse(Path::new("r.csv"), &curve.to_csv()), Ok(curve.clone()));
            assert!(response_plot(&curve, None, Some(("itself", &curve)), "a curve").ends_with("</svg>\n"));
            let table = Linearization::new(&Response::Curve(curve), 0, 255);
            assert!((1..=255).all(|code| table.exposure(0, code) >= table.exposure(0, code - 1)));
        }
        Err(error) => assert!(error.to_string().starts_with("r.csv:"), "{error}"),
    }
});
