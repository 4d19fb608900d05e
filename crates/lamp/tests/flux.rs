//! What a lamp shoots is what arrives: each claim compares the rays that carry a lamp's flux with what it does at a point.

#![allow(clippy::unwrap_used)] // in helpers of tests too

use glam::DVec3;
use relumine_lamp::{Lamp, Light};
use std::path::Path;

const BALL: f64 = 0.5;

fn lamps() -> Vec<(&'static str, Lamp)> {
    let text = r#"
format = "relumine-light/1"
[[point]]
position = [1.0, -1.0, 1.5]
intensity_w_sr = [10, 9, 8]
[[spot]]
position = [2.0, -2.0, 3.5]
target = [0, 0, 0]
intensity_w_sr = [30, 24, 15]
beam_half_angle_deg = 4.0
cutoff_half_angle_deg = 9.5
[[sphere]]
center = [-1.0, -1.0, 1.15]
radius_m = 0.3
radiance = [60, 50, 40]
[[rectangle]]
corner = [1, 1, 1]
edge_u = [0.5, 0, 0]
edge_v = [0, 0.1, -0.5]
radiance = [5, 6, 7]
[[rectangle]]
corner = [-1, -1, 1.5]
edge_u = [0, 2, 0]
edge_v = [2, 0, 0]
radiance = [5, 6, 7]
[[disk]]
center = [0, 0.3, 2]
normal = [0, -0.1, -1]
radius_m = 0.4
radiance = [5, 5, 5]
[[sun]]
direction = [0.5, 0.6, -0.64]
irradiance_w_m2 = [3, 2.8, 2.4]
"#;
    let light = Light::parse(Path::new("lamps.toml"), text).unwrap();
    let names = ["point", "spot", "sphere", "rectangle that shines away", "rectangle", "disk", "sun"];
    names.into_iter().zip(light.lamps).collect()
}

/// n⁴ strata of four numbers.
fn strata(n: usize) -> impl Iterator<Item = [f64; 4]> {
    let at = move |i: usize| (i as f64 + 0.5) / n as f64;
    (0..n.pow(4)).map(move |i| [at(i % n), at(i / n % n), at(i / n / n % n), at(i / n / n / n)])
}

/// Flux through the ball from its irradiance: ∫ over the ball's surface of the irradiance vector's inward part, which for
/// light from outside that meets nothing is ∫ E·n over the surface turned to the light.
fn flux_arriving(lamp: &Lamp) -> DVec3 {
    let n = 14;
    let mut flux = DVec3::ZERO;
    let mut samples = 0;
    for [a, b, c, d] in strata(n) {
        let (z, azimuth) = (2.0 * a - 1.0, std::f64::consts::TAU * b);
        let r = (1.0 - z * z).sqrt();
        let normal = DVec3::new(r * azimuth.cos(), r * azimuth.sin(), z);
        if let Some(arrival) = lamp.arrival(BALL * normal, [c, d]) {
            flux += arrival.irradiance * (-arrival.direction.dot(normal)).max(0.0);
        }
        samples += 1;
    }
    flux * (4.0 * std::f64::consts::PI * BALL * BALL / f64::from(samples))
}

#[test]
fn the_rays_carry_the_flux_that_arrives() {
    for (name, lamp) in lamps() {
        let mut shot = DVec3::ZERO;
        let mut rays = 0;
        for xi in strata(14) {
            if let Some(ray) = lamp.shoot(BALL, xi)
                && ray.origin.reject_from_normalized(ray.direction).length() <= BALL
                && ray.origin.dot(ray.direction) <= 0.0
            {
                shot += ray.flux;
            }
            rays += 1;
        }
        let shot = shot / f64::from(rays);
        let arriving = flux_arriving(&lamp);
        if name == "rectangle that shines away" {
            assert!(arriving.max_element() <= 0.02 && shot.max_element() <= 0.02, "{name}: {arriving} {shot}");
            continue;
        }
        assert!(arriving.min_element() > 0.0, "{name} is dark");
        let error = (shot / arriving - DVec3::ONE).abs().max_element();
        assert!(error < 0.02, "{name}: {shot} W shot, {arriving} W arrive");
    }
}

#[test]
fn radiance_is_there_where_light_arrives_from_and_nowhere_else() {
    let point = DVec3::new(0.1, -0.05, 0.2);
    for (name, lamp) in lamps() {
        if !matches!(lamp, Lamp::Sphere(_) | Lamp::Rectangle(_) | Lamp::Disk(_)) {
            assert_eq!(lamp.radiance(point, -DVec3::Z), DVec3::ZERO, "{name} is a delta");
            continue;
        }
        // ∫ radiance over all directions = irradiance summed over the lamp.
        let arriving = (0..400)
            .filter_map(|i| lamp.arrival(point, [(f64::from(i % 20) + 0.5) / 20.0, (f64::from(i / 20) + 0.5) / 20.0]))
            .fold(DVec3::ZERO, |sum, arrival| {
                assert!(lamp.radiance(point, arrival.direction) != DVec3::ZERO, "{name}");
                sum + arrival.irradiance / 400.0
            });
        let n = 700;
        let mut integral = DVec3::ZERO;
        for i in 0..n * n {
            let (z, azimuth) = (
                2.0 * (f64::from(i % n) + 0.5) / f64::from(n) - 1.0,
                std::f64::consts::TAU * (f64::from(i / n) + 0.5) / f64::from(n),
            );
            let r = (1.0 - z * z).sqrt();
            integral += lamp.radiance(point, DVec3::new(r * azimuth.cos(), r * azimuth.sin(), z));
        }
        integral *= 4.0 * std::f64::consts::PI / f64::from(n * n);
        assert!(
            (integral - arriving).abs().max_element() <= 0.02 * arriving.max_element(),
            "{name}: {integral} {arriving}"
        );
    }
}

#[test]
fn a_spot_falls_off_linearly_from_beam_to_cutoff() {
    let (_, spot) = lamps().swap_remove(1);
    let Lamp::Spot { position, axis, .. } = &spot else { unreachable!() };
    let side = axis.any_orthonormal_vector();
    let at = |angle_deg: f64| {
        let (sine, cosine) = angle_deg.to_radians().sin_cos();
        spot.arrival(*position + cosine * *axis + sine * side, [0.5; 2]).map_or(0.0, |arrival| arrival.irradiance.x)
    };
    for (angle, expected) in [(0.0, 30.0), (3.9, 30.0), (6.75, 15.0), (9.49, 0.0546), (9.6, 0.0), (120.0, 0.0)] {
        assert!((at(angle) - expected).abs() < 1e-3, "{angle}°: {}", at(angle));
    }
}

#[test]
fn a_slide_lights_a_flat_screen_evenly_and_upright() {
    let folder = tempfile::tempdir().unwrap();
    let mut picture = relumine_radiometry::Image::<relumine_radiometry::Radiance>::black(4, 2);
    picture.pixels_mut().fill([1.0; 3]);
    picture.pixels_mut()[0] = [1.0, 0.0, 0.0]; // top left
    relumine_radiometry::files::write_exr(
        &folder.path().join("slide.exr"),
        &picture,
        relumine_radiometry::files::ExrSample::Float,
        &[],
    )
    .unwrap();
    let text = "format = \"relumine-light/1\"\n[[slide]]\nposition = [0, -4, 0]\ntarget = [0, 0, 0]\nhalf_width = 0.2\n\
                picture = \"slide.exr\"\nintensity_w_sr = [50, 50, 50]\n";
    let light = Light::parse(&folder.path().join("light.toml"), text).unwrap();
    let slide = &light.lamps[0];
    // A screen across the axis at the origin: irradiance I₀/D² wherever the picture is white.
    for (x, z) in [(0.0, 0.0), (0.7, 0.3), (-0.3, -0.35), (0.75, -0.35)] {
        let arrival = slide.arrival(DVec3::new(x, 0.0, z), [0.5; 2]).unwrap();
        let on_screen = arrival.irradiance.y * arrival.direction.y;
        assert!((on_screen - 50.0 / 16.0).abs() < 1e-9, "({x}, {z}): {on_screen}");
    }
    // Seen from the slide, x is to the right and z up.
    assert_eq!(slide.arrival(DVec3::new(-0.7, 0.0, 0.3), [0.5; 2]).unwrap().irradiance.y, 0.0);
    assert!(slide.arrival(DVec3::new(0.9, 0.0, 0.0), [0.5; 2]).is_none(), "outside the picture");
    assert!(slide.arrival(DVec3::new(0.0, -8.0, 0.0), [0.5; 2]).is_none(), "behind the projector");
}

#[test]
fn what_cannot_be_is_an_error_that_says_where() {
    let parse = |text: &str| {
        Light::parse(Path::new("l.toml"), &format!("format = \"relumine-light/1\"\n{text}")).unwrap_err().to_string()
    };
    assert!(
        parse("[[sphere]]\ncentre = [0, 0, 0]\n").contains("l.toml:3: unknown key `centre`: did you mean `center`?")
    );
    assert!(parse("[[spots]]\n").contains("did you mean `spot`?"));
    assert!(parse("[[sun]]\ndirection = [0, 0, 0]\nirradiance_w_m2 = [1, 1, 1]\n").contains("sun 0: direction"));
    assert!(parse("[[point]]\nposition = [0, 0, nan]\nintensity_w_sr = [1, 1, 1]\n").contains("point 0: position"));
    assert!(parse("[[point]]\nposition = [0, 0, 1]\nintensity_w_sr = [1, -1, 1]\n").contains("none negative"));
    assert!(parse("[environment]\n").contains("either `map` or `radiance`"));
    assert!(parse("[mosaic]\nfile = \"nowhere.exr\"\n").contains("nowhere.exr"));
    let error = Light::parse(Path::new("l.toml"), "format = \"relumine-light/2\"").unwrap_err().to_string();
    assert!(error.contains("expected \"relumine-light/1\", found \"relumine-light/2\""));
}
