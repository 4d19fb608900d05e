//! Charts, reference values and colour corrections. The first byte chooses: `c` a `.cht`, `p` a chart.toml, any other byte
//! a table of reference values.
#![no_main]

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use relumine_radiometry::Homography;
use relumine_radiometry::colour::{Chart, ColourProfile, Illuminant, Reference};

fuzz_target!(|text: &str| {
    let (kind, text) = text.split_at_checked(1).unwrap_or_default();
    let path = Path::new("colour/file");
    let error = match kind {
        "c" => match Chart::parse_cht(path, text) {
            Ok(chart) => {
                assert!(!chart.patches().is_empty() && chart.patches().len() <= 10_000);
                assert!(chart.patches().iter().all(|patch| patch.rectangle.iter().all(|value| value.is_finite())));
                let square = [[0.0, 0.0], [100.0, 0.0], [100.0, 100.0], [0.0, 100.0]];
                let _ = Homography::fit(&chart.corners().into_iter().zip(square).collect::<Vec<_>>());
                let _ = Reference::of_chart(&chart, Illuminant::LightestPatch);
                return;
            }
            Err(error) => error,
        },
        "p" => match ColourProfile::parse(path, text) {
            Ok(profile) => {
                assert!(profile.correction.apply([0.5, 0.25, 1.0]).iter().all(|value| value.is_finite()));
                let again = profile.to_text().expect("what was read can be written");
                assert_eq!(ColourProfile::parse(path, &again).expect("and read again").correction, profile.correction);
                return;
            }
            Err(error) => error,
        },
        _ => {
            for illuminant in [Illuminant::A, Illuminant::LightestPatch] {
                if let Ok(reference) = Reference::parse(path, text, illuminant) {
                    let (name, chroma) = reference.lightest().expect("a reference has patches");
                    assert!(chroma.is_finite(), "{name}");
                }
            }
            match Reference::parse(path, text, Illuminant::D50) {
                Ok(_) => return,
                Err(error) => error,
            }
        }
    };
    assert!(error.to_string().starts_with("colour/file"), "{error}");
});
