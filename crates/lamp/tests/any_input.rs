//! Any text gives a light that can be used, or an error that names the description: never a panic.

use std::path::Path;

use proptest::prelude::*;
use relumine_lamp::{Lamp, Light};
use tempfile::TempDir;

#[path = "../../../fuzz/spoil.rs"]
mod spoil;
use spoil::{seeded, spoiled_text};

const LIGHTS: [&str; 3] = [
    r#"format = "relumine-light/1"
[[point]]
position = [1.0, -1.0, 1.5]
intensity_w_sr = [10, 9, 8]
[[spot]]
position = [2.0, -2.0, 3.5]
target = [0, 0, 0.2]
intensity_w_sr = [30, 24, 15]
beam_half_angle_deg = 4.0
cutoff_half_angle_deg = 5.5
[[sphere]]
center = [-1.0, -1.0, 1.15]
radius_m = 0.12
radiance = [60, 50, 40]
[placement]
translate_m = [0.1, 0, 0]
rotate_deg = 30
"#,
    r#"format = "relumine-light/1"
[[rectangle]]
corner = [1, 1, 1]
edge_u = [0.5, 0, 0]
edge_v = [0, 0.5, 0]
radiance = [5, 5, 5]
[[disk]]
center = [0, 0, 2]
normal = [0, 0, -1]
radius_m = 0.2
radiance = [5, 5, 5]
[[sun]]
direction = [0.5, 0.6, -0.64]
irradiance_w_m2 = [3, 2.8, 2.4]
[[shaft]]
origin = [0, -3, 3]
direction = [0, 0.7, -0.7]
radius_m = 0.15
irradiance_w_m2 = [20, 18, 15]
[environment]
radiance = [1, 1, 1]
rotation_deg = 10
scale = 1.0
"#,
    r#"format = "relumine-light/1"
[[slide]]
position = [0, -4, 3]
target = [0, 0, 0.2]
up = [0, 0, 1]
half_width = 0.2
picture = "map.hdr"
intensity_w_sr = [50, 50, 50]
[environment]
map = "map.hdr"
rotation_deg = 90
scale = 0.5
[mosaic]
file = "map.hdr"
"#,
];

/// A folder with a map of 2 × 1 pixels.
fn folder() -> TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let map = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n\x80\x40\x20\x81\x10\x20\x30\x80";
    std::fs::write(folder.path().join("map.hdr"), map).expect("a map");
    folder
}

/// A colour is finite and not negative, a direction one long.
fn holds(light: &Light) {
    let unit = |way: glam::DVec3| assert!((way.length() - 1.0).abs() < 1e-12, "{way} has the length {}", way.length());
    let colour = |value: glam::DVec3| assert!(value.is_finite() && value.min_element() >= 0.0, "the colour {value}");
    let length = |value: f64| assert!(value > 0.0 && value.is_finite(), "the length {value}");
    for lamp in &light.lamps {
        match lamp {
            Lamp::Point { position, intensity } => {
                assert!(position.is_finite());
                colour(*intensity);
            }
            Lamp::Spot { position, axis, intensity, beam_half_angle, cutoff_half_angle } => {
                assert!(position.is_finite());
                unit(*axis);
                colour(*intensity);
                assert!(*beam_half_angle >= 0.0 && beam_half_angle <= cutoff_half_angle && *cutoff_half_angle > 0.0);
            }
            Lamp::Sphere(sphere) => {
                length(sphere.radius_m);
                colour(sphere.radiance);
            }
            Lamp::Rectangle(rectangle) => {
                assert!(rectangle.edge_u.cross(rectangle.edge_v).length() > 0.0);
                colour(rectangle.radiance);
            }
            Lamp::Disk(disk) => {
                unit(disk.normal);
                length(disk.radius_m);
                colour(disk.radiance);
            }
            Lamp::Sun { direction, irradiance } => {
                unit(*direction);
                colour(*irradiance);
            }
            Lamp::Shaft { direction, radius_m, irradiance, .. } => {
                unit(*direction);
                length(*radius_m);
                colour(*irradiance);
            }
            Lamp::Slide(_) => {}
        }
        let Some(ray) = lamp.shoot(1.0, [0.3, 0.6, 0.2, 0.9]) else { continue };
        assert!(!ray.origin.is_nan() && !ray.flux.is_nan() && !ray.direction.is_nan(), "{lamp:?} shoots {ray:?}");
    }
    if let Some(environment) = &light.environment {
        let mean = environment.mean_luminance();
        assert!(mean.is_finite() && mean >= 0.0, "the mean luminance {mean}");
    }
    assert!(light.placement.translation.is_finite() && light.placement.rotation.is_finite());
}

fn try_light(folder: &Path, text: &str) -> Result<(), String> {
    match Light::parse(&folder.join("light.toml"), text) {
        Ok(light) => {
            holds(&light);
            Ok(())
        }
        Err(error) => Err(error.to_string()),
    }
}

proptest! {
    #![proptest_config(seeded(1000))]

    #[test]
    fn a_spoiled_light_is_used_or_refused(text in spoiled_text(&LIGHTS)) {
        let folder = folder();
        if let Err(error) = try_light(folder.path(), &text) {
            // Of the description or of a picture beside it.
            prop_assert!(error.starts_with(&folder.path().display().to_string()), "{error}");
        }
    }

    #[test]
    fn any_text_is_no_light(text in any::<String>()) {
        let error = try_light(Path::new("no/such"), &text).expect_err("no light has only a few letters");
        prop_assert!(error.starts_with("no/such/light.toml"), "{error}");
    }
}

#[test]
fn the_valid_texts_are_read() {
    let folder = folder();
    for text in LIGHTS {
        try_light(folder.path(), text).expect("a light");
    }
}

#[test]
fn a_tiny_direction_is_one_long_or_refused() {
    for (text, from, to) in [
        (LIGHTS[1], "direction = [0.5, 0.6, -0.64]", "direction = [0, 1e-161, -1e-161]"),
        (LIGHTS[1], "normal = [0, 0, -1]", "normal = [1e-161, 2e-161, 3e-161]"),
        (LIGHTS[0], "target = [0, 0, 0.2]", "target = [2.0, -2.0, 3.5]"),
    ] {
        let text = text.replace(from, to);
        assert!(text.contains(to));
        if let Err(error) = try_light(Path::new("no/such"), &text) {
            assert!(error.starts_with("no/such/light.toml: "), "{error}");
        }
    }
}

#[test]
fn a_lamp_larger_than_the_world_is_refused() {
    for radius in ["1e200", "1e308"] {
        let text = LIGHTS[0].replace("radius_m = 0.12", &format!("radius_m = {radius}"));
        assert!(try_light(Path::new("no/such"), &text).is_err(), "{radius} m");
    }
}
