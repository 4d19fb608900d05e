//! Any text gives a scene that can be rendered, or an error that names a file: never a panic.

#![allow(clippy::unwrap_used)] // in helpers of tests too

use std::path::Path;

use proptest::prelude::*;
use relumine_lamp::Light;
use relumine_tracer::{PathOptions, Rendering, Scene};
use tempfile::TempDir;

#[path = "../../../fuzz/spoil.rs"]
mod spoil;
use spoil::{seeded, spoiled_text};

const SCENES: [&str; 2] = [
    r#"format = "relumine-scene/1"
[camera]
position = [0, -4, 3]
target = [0, 0, 0.2]
up = [0, 0, 1]
horizontal_fov_deg = 20
width = 6
height = 4
[[material]]
name = "floor"
diffuse.reflectance = { checkerboard = [[0.8, 0.7, 0.6], [0.1, 0.2, 0.3]], fields = [4, 4] }
[[material]]
name = "metal"
conductor = { metal = "Cu", alpha = 0.3 }
[[material]]
name = "clay"
plastic = { diffuse = [0.7, 0.4, 0.3], index = 1.5, alpha = 0.2 }
[[object]]
material = "floor"
plane.size_m = [1.4, 1.4]
[[object]]
name = "ball"
material = "metal"
sphere.radius_m = 0.2
translate_m = [-0.25, 0, 0.2]
[[object]]
material = "clay"
lathe = { profile_m = [[0, 0], [0.2, 0], [0.1, 0.2], [0.15, 0.4], [0, 0.5]], smooth = true, segments = 8 }
rotate_deg = [10, 0, 30]
translate_m = [0.2, 0.1, 0]
"#,
    r#"format = "relumine-scene/1"
[camera]
position = [0.5, -3, 1.5]
target = [0, 0, 0.2]
horizontal_fov_deg = 30
width = 5
height = 5
[[material]]
name = "shown"
diffuse.reflectance.picture = "map.hdr"
[[material]]
name = "iron"
[material.conductor]
eta = [2.91, 2.95, 2.58]
k = [3.09, 2.93, 2.77]
alpha = 0.1
[[material]]
name = "frosted"
glass = { index = 1.5, alpha = 0.4, tint = [0.9, 1, 0.9] }
[[object]]
material = "shown"
box.size_m = [0.5, 0.5, 0.3]
rotate_deg = [0, 0, 30]
[[object]]
material = "frosted"
sphere.radius_m = 0.2
scale = 0.5
translate_m = [0.1, -0.5, 0.2]
[[object]]
material = "iron"
lathe.profile_m = [[0.2, 0], [0.1, 0.3]]
lathe.smooth = false
lathe.segments = 5
[[object]]
model = { file = "tent.obj", up = "z" }
scale = 0.4
translate_m = [0.4, 0.3, 0]
"#,
];

/// A folder with a picture of 2 × 1 pixels and a model of two triangles.
fn folder() -> TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let map = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n\x80\x40\x20\x81\x10\x20\x30\x80";
    std::fs::write(folder.path().join("map.hdr"), map).expect("a map");
    let tent = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0.5 0.5 1\nf 1 2 4\nf 3 1 4\n";
    std::fs::write(folder.path().join("tent.obj"), tent).expect("a model");
    folder
}

fn light() -> Light {
    let text = "format = \"relumine-light/1\"\n[[sphere]]\ncenter = [1, -1, 2]\nradius_m = 0.3\nradiance = [5, 4, 3]\n\
                [environment]\nradiance = [1, 1, 1]";
    Light::parse(Path::new("light.toml"), text).expect("a light")
}

fn try_scene(folder: &Path, text: &str) -> Result<(), String> {
    let scene = Scene::parse(&folder.join("scene.toml"), text).map_err(|error| error.to_string())?;
    let (width, height) = scene.picture_size();
    assert!(width > 0 && height > 0);
    assert!(scene.radius_m().is_finite() && scene.radius_m() <= 3f64.sqrt() * 1000.1);
    // Whatever the scene, its light is a number.
    let scene = scene.with_picture_size(4, 3);
    let options = PathOptions { samples: 2, bounces: 4, seed: 7 };
    let rendered = Rendering::new(&scene, &light(), options, true).expect("no mosaic").run();
    for pixel in rendered.picture.pixels() {
        assert!(pixel.iter().all(|value| value.is_finite() && *value >= 0.0), "{pixel:?} under\n{text}");
    }
    Ok(())
}

proptest! {
    #![proptest_config(seeded(600))]

    #[test]
    fn a_spoiled_scene_is_rendered_or_refused(text in spoiled_text(&SCENES)) {
        let folder = folder();
        if let Err(error) = try_scene(folder.path(), &text) {
            // Of the description, or of a picture or model beside it.
            prop_assert!(error.contains(&folder.path().display().to_string()), "{error}");
        }
    }

    #[test]
    fn any_text_is_no_scene(text in any::<String>()) {
        let error = try_scene(Path::new("no/such"), &text).expect_err("no scene has only a few letters");
        prop_assert!(error.starts_with("no/such/scene.toml"), "{error}");
    }
}

#[test]
fn the_valid_texts_are_read() {
    let folder = folder();
    for text in SCENES {
        try_scene(folder.path(), text).expect("a scene");
    }
}
