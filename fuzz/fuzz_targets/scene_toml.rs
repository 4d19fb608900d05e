//! `scene.toml`: any text gives a scene whose light is a number wherever it is looked at, or an error that names a file.
#![no_main]

use std::path::Path;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use relumine_lamp::Light;
use relumine_tracer::{PathOptions, Rendering, Scene};

/// `picture.png`, `map.hdr` and `model.obj` lie beside it.
const PATH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/beside/scene.toml");

/// The same from above everywhere.
static LIGHT: LazyLock<Light> = LazyLock::new(|| {
    let text = "format = \"relumine-light/1\"\n[environment]\nradiance = [1, 1, 1]";
    Light::parse(Path::new("light.toml"), text).expect("a light")
});

fuzz_target!(|text: &str| {
    match Scene::parse(Path::new(PATH), text) {
        Ok(scene) => {
            assert!(scene.radius_m() <= 1800.0, "{} m", scene.radius_m());
            // Every pixel of a large picture would only take long.
            let scene = scene.with_picture_size(3, 2);
            let options = PathOptions { samples: 2, bounces: 4, seed: 7 };
            let rendered = Rendering::new(&scene, &LIGHT, options, true).expect("a light without mosaic").run();
            for value in rendered.picture.pixels().as_flattened() {
                assert!(value.is_finite() && *value >= 0.0, "{value}");
            }
        }
        Err(error) => assert!(error.to_string().contains(env!("CARGO_MANIFEST_DIR")), "{error}"),
    }
});
