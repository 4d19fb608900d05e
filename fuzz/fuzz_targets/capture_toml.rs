//! `capture.toml`: any text gives a set-up that holds together, or an error that names the file.
#![no_main]

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use relumine_capture::Setup;

/// A response file, `response.csv`, lies beside it.
const PATH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/beside/capture.toml");

fuzz_target!(|text: &str| {
    match Setup::parse(Path::new(PATH), text) {
        Ok(setup) => {
            let cells = setup.cells();
            assert!(!cells.is_empty() && cells.len() <= relumine_basis::Cells::MAX);
            for index in [0, cells.len() / 3, cells.len() - 1] {
                let cell = cells.cell(index);
                assert_eq!(cells.index(cell), index);
                assert!(cells.measure(index) >= 0.0);
                let direction = cells.partition().sample(cell.position, 0.3, 0.6);
                assert!((direction.length() - 1.0).abs() < 1e-9, "{direction}");
                let shares = cells.partition().between(direction);
                let sum: f64 = shares.shares().iter().map(|share| share.1).sum();
                assert!((sum - 1.0).abs() < 1e-9, "shares add to {sum}");
                assert!(cells.partition().owner(direction) < cells.positions());
            }
            let (width, height) = setup.picture_size();
            assert!(width > 0 && height > 0 && width * height <= relumine_radiometry::files::MAX_PIXELS);
            let _ = setup.linearization();
        }
        Err(error) => assert!(error.to_string().contains(env!("CARGO_MANIFEST_DIR")), "{error}"),
    }
});
