//! Claims about the world, held against what can be computed on paper: through the command, from photographs to pictures.

#![allow(clippy::unwrap_used)] // in helpers of tests too

mod support;

use std::f64::consts::PI;
use std::fs;
use std::path::Path;

use relumine::radiometry::{Image, Linear};
use relumine::{Cell, Coefficients, ReflectanceField, relight_reference};
use support::studio::{Patterns, Plan, Positions, Studio, truth};
use support::{read, relative_l2, relumine};

const ALBEDO: f64 = 0.6;
/// Half the side of the white plane, metres.
const HALF_SIDE: f64 = 0.07;
const PIXELS: usize = 12;

/// The point of the plane z = 0 that pixel (x, y) sees.
fn plane_point(pixel: usize) -> [f64; 3] {
    let along = |index: usize| ((index as f64 + 0.5) / PIXELS as f64 * 2.0 - 1.0) * HALF_SIDE;
    [along(pixel % PIXELS), along(pixel / PIXELS), 0.0]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// 8 × 4 positions, each square photographed alone: the set-up under which the plane is photographed.
fn plane_plan() -> Plan {
    Plan {
        positions: Positions::Grid(8, 4),
        patterns: Patterns::Squares,
        size: (PIXELS, PIXELS),
        half_width: 0.06,
        intensity_w_sr: 15.0,
        ..Plan::default()
    }
}

/// Photographs of a horizontal matte white plane, computed on paper: a projector at P that lights a flat screen evenly has
/// the intensity I₀/cos³a (docs/MATH.md), so a point X shows ALBEDO/π · I₀/cos³a · cosθ/d² under the square that X falls in.
fn plane_studio() -> Studio {
    let plan = plane_plan();
    let (radius, half_width, m) = (plan.radius_m, plan.half_width, plan.squares as f64);
    let photograph = |position: usize, u: usize, v: usize| -> Vec<[f64; 3]> {
        let azimuth = ((position % 8) as f64 + 0.5) * 2.0 * PI / 8.0;
        let tilt = ((position / 8) as f64 + 0.5) * PI / 2.0 / 4.0;
        let outward = [tilt.sin() * azimuth.cos(), tilt.sin() * azimuth.sin(), tilt.cos()];
        let right = [-azimuth.sin(), azimuth.cos(), 0.0];
        let up = [-tilt.cos() * azimuth.cos(), -tilt.cos() * azimuth.sin(), tilt.sin()];
        let lit = |pixel: usize| {
            let point = plane_point(pixel);
            let way = [0, 1, 2].map(|axis| point[axis] - radius * outward[axis]);
            let (forward, squared) = (-dot(way, outward), dot(way, way));
            let (s, t) = (dot(way, right) / forward, dot(way, up) / forward);
            let column = ((s / half_width + 1.0) / 2.0 * m).floor();
            let row = ((1.0 - t / half_width) / 2.0 * m).floor();
            assert!((0.0..m).contains(&column) && (0.0..m).contains(&row), "the plane must lie inside the pattern");
            if (column as usize, row as usize) != (u, v) {
                return [0.0; 3];
            }
            let cos_a = forward / squared.sqrt();
            let cos_incident = -way[2] / squared.sqrt();
            [ALBEDO / PI * plan.intensity_w_sr / cos_a.powi(3) * cos_incident / squared; 3]
        };
        (0..PIXELS * PIXELS).map(lit).collect()
    };
    Studio::photographing(&plan, &photograph)
}

/// What four rings of positions make of the irradiance of a constant sky on a horizontal plane, over what it is. Box: each
/// ring counts for its band, which gives 1/cos(Δθ/2) (docs/MATH.md). Linear: for the hat function between its neighbours.
fn quadrature(between: &str) -> f64 {
    if between == "box" {
        return 1.0 / (PI / 16.0).cos();
    }
    let (rings, steps) = (4, 100_000);
    let share = |step: usize| {
        let tilt = (step as f64 + 0.5) / steps as f64 * PI / 2.0;
        let ring = (tilt / (PI / 8.0) - 0.5).clamp(0.0, 3.0);
        let cosine_of = |ring: f64| ((ring + 0.5) * PI / 8.0).cos();
        let (above, below) = (ring.floor(), (ring.floor() + 1.0).min(f64::from(rings - 1)));
        let cosine = cosine_of(above) * (1.0 - ring.fract()) + cosine_of(below) * ring.fract();
        2.0 * cosine * tilt.sin() * PI / 2.0 / steps as f64
    };
    (0..steps).map(share).sum()
}

fn mean_of_green(picture: &Image<Linear>) -> f64 {
    picture.pixels().iter().map(|pixel| f64::from(pixel[1])).sum::<f64>() / picture.pixels().len() as f64
}

#[test]
fn a_white_plane_under_a_constant_sky_shows_its_albedo() {
    let studio = plane_studio();
    let field = studio.field();
    let sky = studio.light("sky.toml", "[environment]\nradiance = [0.5, 1, 2]\n");
    // The lowest ring gives 14.6 % of the light; of its squares just above the axis, which light half of the plane, 3.9 %
    // would have to travel upward and is no light of the sky: 0.3 % of all.
    let expected = |between| ALBEDO * quadrature(between) * 0.997;
    for between in ["box", "linear"] {
        let relit = studio.relit(&field, &sky, &["--between", between, "--samples", "1048576"]);
        let ratio = mean_of_green(&relit) / expected(between);
        assert!((ratio - 1.0).abs() < 0.004, "{between}: the whole plane shows {ratio} of what it must");
        for (index, pixel) in relit.pixels().iter().enumerate() {
            let ratio = f64::from(pixel[1]) / expected(between);
            assert!((ratio - 1.0).abs() < 0.012, "{between}: pixel {index} shows {ratio} of what it must");
            // The sky's colour, and no other.
            assert!((pixel[0] / pixel[1] - 0.5).abs() < 2e-3 && (pixel[2] / pixel[1] - 2.0).abs() < 4e-3, "{pixel:?}");
        }
    }
}

#[test]
fn a_white_plane_under_a_sun_shows_albedo_over_pi_times_irradiance_times_cosine() {
    let studio = plane_studio();
    let field = studio.field();
    for (position, words) in [(2, "--between=box"), (12, "--between=box"), (12, "--between=linear")] {
        // The sun stands behind a captured position: the light travels the other way.
        let azimuth = ((position % 8) as f64 + 0.5) * PI / 4.0;
        let tilt = ((position / 8) as f64 + 0.5) * PI / 8.0;
        let [x, y, z] = [-tilt.sin() * azimuth.cos(), -tilt.sin() * azimuth.sin(), -tilt.cos()];
        let sun = format!("[[sun]]\ndirection = [{x}, {y}, {z}]\nirradiance_w_m2 = [3, 2, 1]\n");
        let relit = studio.relit(&field, &studio.light("sun.toml", &sun), &[words, "--samples", "262144"]);
        let expected = ALBEDO / PI * 2.0 * tilt.cos();
        let ratio = mean_of_green(&relit) / expected;
        assert!((ratio - 1.0).abs() < 0.01, "position {position}, {words}: {ratio}");
    }
}

#[test]
fn the_squares_of_a_position_add_up_to_its_white_frame() {
    for patterns in [Patterns::Combs { spacing: 2 }, Patterns::Combs { spacing: 3 }, Patterns::Squares] {
        let studio = Studio::new(&Plan { patterns, ..Plan::default() });
        let field = ReflectanceField::open(&studio.field()).unwrap();
        // Φ_square = I₀ (2h/M)².
        let square_flux = 12.0 * (2.0f64 * 0.25 / 4.0).powi(2);
        for position in 0..field.cells().positions() {
            let (mut sum, mut white) = (vec![[0.0f32; 3]; 240], vec![[0.0f32; 3]; 240]);
            for (u, v) in (0..16).map(|square| (square % 4, square / 4)) {
                let cell = field.cells().index(Cell { position, u, v });
                let to_radiance = (square_flux / field.cells().measure(cell)) as f32;
                for (index, transfer) in field.transfer(cell).unwrap().pixels().iter().enumerate() {
                    for channel in 0..3 {
                        sum[index][channel] += transfer[channel] * to_radiance;
                        white[index][channel] += truth(position, u, v, index % 20, index / 20)[channel] as f32;
                    }
                }
            }
            assert!(relative_l2(&sum, &white) < 1e-3, "position {position}: {}", relative_l2(&sum, &white));
        }
    }
}

const POINT: &str = "[[point]]\nposition = [0.4, -0.6, 1.1]\nintensity_w_sr = [5, 4, 3]\n";
const SPOT: &str = "[[spot]]\nposition = [-1.0, 0.3, 1.4]\ntarget = [0.05, 0, 0]\nintensity_w_sr = [6, 7, 9]\n\
                    beam_half_angle_deg = 6\ncutoff_half_angle_deg = 9\n";
const SKY: &str = "[environment]\nradiance = [0.3, 0.4, 0.6]\n";

fn sum(pictures: &[Image<Linear>]) -> Vec<[f32; 3]> {
    let mut sum = pictures[0].clone();
    pictures[1..].iter().for_each(|picture| sum.add_scaled(picture, [1.0; 3]));
    sum.into_pixels()
}

#[test]
fn light_adds_up() {
    let studio = Studio::new(&Plan::default());
    let field = studio.field();
    let relit = |text: &str| studio.relit(&field, &studio.light("light.toml", text), &["--samples", "65536"]);
    let (point, spot, sky) = (relit(POINT), relit(SPOT), relit(SKY));
    assert!(relative_l2(relit(&format!("{POINT}{SKY}")).pixels(), &sum(&[point.clone(), sky.clone()])) < 1e-5);
    assert!(relative_l2(relit(&format!("{SPOT}{SKY}")).pixels(), &sum(&[spot.clone(), sky])) < 1e-5);
    assert!(relative_l2(relit(&format!("{POINT}{SPOT}")).pixels(), &sum(&[point.clone(), spot])) < 1e-5);
    let brighter = relit(&POINT.replace("[5, 4, 3]", "[10, 8, 6]"));
    assert!(relative_l2(brighter.pixels(), &sum(&[point.clone(), point])) < 1e-5);
}

#[test]
fn an_object_moved_in_the_light_is_the_light_moved_the_other_way() {
    let studio = Studio::new(&Plan::default());
    let field = studio.field();
    let (moved, turned_deg) = ([0.2, -0.1, 0.05], 30.0f64);
    let (sine, cosine) = turned_deg.to_radians().sin_cos();
    // Turned by −30° about +z, as the light looks to an object that was turned by 30°.
    let back = |[x, y, z]: [f64; 3]| [cosine * x + sine * y, cosine * y - sine * x, z];
    let seen = |point: [f64; 3]| back([0, 1, 2].map(|axis| point[axis] - moved[axis]));
    let lights = |placed: bool| {
        let (point, way) = if placed {
            (seen([0.4, -0.6, 1.1]), back([0.3, 0.5, -0.7]))
        } else {
            ([0.4, -0.6, 1.1], [0.3, 0.5, -0.7])
        };
        let target = if placed { seen([0.0, 0.1, 0.0]) } else { [0.0, 0.1, 0.0] };
        let spot = if placed { seen([-1.0, 0.3, 1.4]) } else { [-1.0, 0.3, 1.4] };
        let rotation = if placed { -turned_deg } else { 0.0 };
        format!(
            "[[point]]\nposition = {point:?}\nintensity_w_sr = [5, 4, 3]\n\
             [[spot]]\nposition = {spot:?}\ntarget = {target:?}\nintensity_w_sr = [6, 7, 9]\n\
             beam_half_angle_deg = 6\ncutoff_half_angle_deg = 9\n\
             [[sun]]\ndirection = {way:?}\nirradiance_w_m2 = [1, 2, 3]\n\
             [environment]\nmap = \"map.exr\"\nrotation_deg = {rotation:?}\n"
        )
    };
    let map = |x: usize, y: usize| [1.0 + x as f32, 0.5 + y as f32, if x == 3 { 20.0 } else { 1.0 }];
    support::studio::write_exr(&studio.path("map.exr"), (16, 8), map);
    let placement = format!("[placement]\ntranslate_m = {moved:?}\nrotate_deg = {turned_deg:?}\n");
    let with_placement = studio.light("object.toml", &(lights(false) + &placement));
    let with_lights_moved = studio.light("lights.toml", &lights(true));
    let unmoved = studio.light("unmoved.toml", &lights(false));
    let relit = |light: &Path| studio.relit(&field, light, &["--samples", "65536"]);
    let (a, b, still) = (relit(&with_placement), relit(&with_lights_moved), relit(&unmoved));
    assert!(relative_l2(a.pixels(), b.pixels()) < 1e-5, "{}", relative_l2(a.pixels(), b.pixels()));
    assert!(relative_l2(still.pixels(), b.pixels()) > 0.02, "the move must show");
}

#[test]
fn a_mosaic_is_the_light_it_was_made_of() {
    let studio = Studio::new(&Plan::default());
    let (field, light) = (studio.field(), studio.light("light.toml", &format!("{POINT}{SPOT}{SKY}")));
    let mosaic = studio.path("mosaic.exr");
    for words in [["--between", "box"], ["--between", "linear"]] {
        let [name, value] = words;
        relumine!["light", &light, "--for", &field, "--samples", "16384", name, value, "-o", &mosaic, "--force"]
            .succeeds();
        let direct = studio.relit(&field, &light, &words);
        assert_eq!(studio.relit(&field, &mosaic, &[]).pixels(), direct.pixels());
        let inside = studio.light("inside.toml", "[mosaic]\nfile = \"mosaic.exr\"\n");
        assert_eq!(studio.relit(&field, &inside, &[]).pixels(), direct.pixels());
        assert!(mosaic.with_extension("png").exists());
    }
    // The capture has the same cells as its field.
    let of_capture = studio.path("of-capture.exr");
    relumine!["light", &light, "--for", &studio.capture(), "--samples", "16384", "-o", &of_capture].succeeds();
    assert_eq!(fs::read(&of_capture).unwrap(), fs::read(&mosaic).unwrap());
}

#[test]
fn a_painted_mosaic_lights_exactly_the_cell_it_says() {
    let studio = Studio::new(&Plan::default());
    let path = studio.field();
    let field = ReflectanceField::open(&path).unwrap();
    // Position (azimuth 1, tilt 0), square (u, v) = (2, 3) is pixel (4 + 2, 3) of the mosaic (FORMAT.md).
    let light = studio.path("one.exr");
    support::studio::write_exr(&light, (8, 8), |x, y| if (x, y) == (6, 3) { [2.0, 1.0, 0.5] } else { [0.0; 3] });
    let relit = studio.relit(&path, &light, &[]);
    let transfer = field.transfer(field.cells().index(Cell { position: 1, u: 2, v: 3 })).unwrap();
    let expected: Vec<_> = transfer.pixels().iter().map(|[r, g, b]| [2.0 * r, *g, 0.5 * b]).collect();
    assert!(relative_l2(relit.pixels(), &expected) < 1e-6);
}

#[test]
fn the_fast_sum_is_the_plain_sum() {
    let studio = Studio::new(&Plan { size: (150, 70), positions: Positions::Grid(3, 2), ..Plan::default() });
    let (path, light) = (studio.field(), studio.light("light.toml", &format!("{POINT}{SPOT}{SKY}")));
    let mosaic = studio.path("mosaic.exr");
    relumine!["light", &light, "--for", &path, "--samples", "16384", "-o", &mosaic].succeeds();
    let field = ReflectanceField::open(&path).unwrap();
    let mut coefficients: Coefficients = field.cells().dark();
    let picture = read(&mosaic);
    coefficients.set_mosaic(picture.width(), picture.height(), picture.pixels()).unwrap();
    let plain = relight_reference(&field, &coefficients).unwrap();
    let fast = studio.relit(&path, &light, &[]);
    assert!(relative_l2(fast.pixels(), plain.pixels()) < relumine_relight::TOLERANCE);
}

#[test]
fn light_that_is_the_same_everywhere_is_its_own_light_map() {
    let studio = Studio::new(&Plan::default());
    let field = studio.field();
    let sun = "[[sun]]\ndirection = [0.4, 0.2, -0.8]\nirradiance_w_m2 = [3, 2, 1]\n";
    for text in [sun, SKY] {
        let light = studio.light("light.toml", text);
        let (field_of_light, map) = (studio.relit(&field, &light, &[]), studio.relit(&field, &light, &["--light-map"]));
        assert!(relative_l2(map.pixels(), field_of_light.pixels()) < 1e-6, "{text}");
    }
    // A narrow beam through the centre becomes the sun that it is there.
    let shaft = "[[shaft]]\norigin = [-1.2, -0.6, 2.4]\ndirection = [0.4, 0.2, -0.8]\nradius_m = 0.03\n\
                 irradiance_w_m2 = [3, 2, 1]\n";
    let (shaft, sun) = (studio.light("shaft.toml", shaft), studio.light("sun.toml", sun));
    let of_sun = studio.relit(&field, &sun, &[]);
    assert!(relative_l2(studio.relit(&field, &shaft, &["--light-map"]).pixels(), of_sun.pixels()) < 1e-6);
    assert!(relative_l2(studio.relit(&field, &shaft, &[]).pixels(), of_sun.pixels()) > 0.5);
    // A lamp at 1.31 m from the centre becomes the sun of irradiance I/d² there.
    let squared: f64 = 0.4 * 0.4 + 0.6 * 0.6 + 1.1 * 1.1;
    let irradiance = [5.0, 4.0, 3.0].map(|intensity| intensity / squared);
    let sun = format!("[[sun]]\ndirection = [-0.4, 0.6, -1.1]\nirradiance_w_m2 = {irradiance:?}\n");
    let (point, sun) = (studio.light("point.toml", POINT), studio.light("sun.toml", &sun));
    let (map, sun) = (studio.relit(&field, &point, &["--light-map"]), studio.relit(&field, &sun, &[]));
    assert!(relative_l2(map.pixels(), sun.pixels()) < 1e-4);
}
