//! `light.toml`: any text gives lamps that can be shot and asked, or an error that names the file.
#![no_main]

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use relumine_lamp::{Lamp, Light};

/// `picture.png`, `map.hdr` and `mosaic.exr` lie beside it.
const PATH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/beside/light.toml");

fuzz_target!(|text: &str| {
    match Light::parse(Path::new(PATH), text) {
        Ok(light) => {
            for lamp in &light.lamps {
                if let Lamp::Spot { axis: way, .. }
                | Lamp::Sun { direction: way, .. }
                | Lamp::Shaft { direction: way, .. } = lamp
                {
                    assert!((way.length() - 1.0).abs() < 1e-9, "{way} is no unit vector");
                }
                // No promise about the values here, only that asking does not panic.
                let lamp = light.placement.object_from_world_lamp(lamp);
                let _ = lamp.shoot(1.0, [0.3, 0.6, 0.2, 0.9]);
                let _ = lamp.arrival(Default::default(), [0.3, 0.6]);
            }
            if let Some(environment) = &light.environment {
                let mean = environment.mean_luminance();
                assert!(mean.is_finite() && mean >= 0.0, "{mean}");
            }
        }
        Err(error) => assert!(error.to_string().contains(env!("CARGO_MANIFEST_DIR")), "{error}"),
    }
});
