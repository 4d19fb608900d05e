//! Lists of lamps. The first byte chooses: an RTI list, a CSV table, or the three files of a DiLiGenT folder, with a line
//! `%` between them.
#![no_main]

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use relumine::LampList;
use relumine_basis::{Layout, Partition};

fuzz_target!(|text: &str| {
    let (kind, text) = text.split_at_checked(1).unwrap_or_default();
    let list = match kind {
        "c" => LampList::parse_csv(Path::new("dome/dirs.csv"), text),
        "d" => {
            let mut files = text.split("\n%\n");
            let mut file = || files.next();
            let (directions, names) = (file().unwrap_or_default(), file().unwrap_or_default());
            LampList::parse_diligent(Path::new("dome"), directions, names, file())
        }
        _ => LampList::parse_lp(Path::new("dome/dirs.lp"), text),
    };
    match list {
        Ok(list) => {
            assert!(!list.lamps.is_empty());
            for lamp in &list.lamps {
                assert!(lamp.position.is_above_horizon() && lamp.position.azimuth.is_finite(), "{:?}", lamp.position);
                assert!(lamp.irradiance.iter().all(|value| *value > 0.0 && value.is_finite()), "{:?}", lamp.irradiance);
            }
            // What the import does next: patches round the lamps. Two lamps may still be too near to each other.
            let layout = Layout::List(list.lamps.iter().map(|lamp| lamp.position).collect());
            if let Ok(partition) = Partition::new(layout) {
                let whole: f64 = (0..partition.positions().len()).map(|index| partition.solid_angle(index)).sum();
                assert!((whole / std::f64::consts::TAU - 1.0).abs() < 1e-6, "the patches add to {whole} sr");
            }
        }
        Err(error) => assert!(error.to_string().starts_with("dome"), "{error}"),
    }
});
