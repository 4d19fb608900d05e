//! Scenes that can be solved on paper.

#![allow(clippy::unwrap_used)]

use std::f64::consts::PI;
use std::path::Path;

use glam::DVec3;
use relumine_basis::{Pattern, Position};
use relumine_lamp::Light;
use relumine_radiometry::Image;
use relumine_tracer::{Lantern, PathOptions, Paths, Rendered, Rendering, Scene};

fn scene(camera: &str, rest: &str) -> Scene {
    let text = format!("format = \"relumine-scene/1\"\n[camera]\n{camera}\n{rest}");
    Scene::parse(Path::new("scene.toml"), &text).unwrap()
}

fn light(text: &str) -> Light {
    Light::parse(Path::new("light.toml"), &format!("format = \"relumine-light/1\"\n{text}")).unwrap()
}

fn options(samples: usize, bounces: usize) -> PathOptions {
    PathOptions { samples, bounces, seed: 11 }
}

fn render(scene: &Scene, light: &Light, options: PathOptions) -> Rendered {
    Rendering::new(scene, light, options, false).unwrap().run()
}

/// A ball of one material, seen from the side.
fn ball(material: &str) -> Scene {
    scene(
        "position = [0, -6, 0]\ntarget = [0, 0, 0]\nhorizontal_fov_deg = 20\nwidth = 24\nheight = 24",
        &format!("[[material]]\nname = \"m\"\n{material}\n[[object]]\nmaterial = \"m\"\nsphere.radius_m = 0.9\n"),
    )
}

const SKY: &str = "[environment]\nradiance = [1, 1, 1]";

/// Mean over the picture of what is expected and what came, and the standard error of the latter.
fn mean(rendered: &Rendered, expected: impl Fn(usize, usize) -> Option<f64>) -> (f64, f64, f64) {
    let (width, _) = rendered.picture.size();
    let (mut came, mut wanted, mut variance, mut count) = (0.0, 0.0, 0.0, 0.0);
    for (index, pixel) in rendered.picture.pixels().iter().enumerate() {
        let (x, y) = (index % width, index / width);
        if let Some(value) = expected(x, y) {
            came += f64::from(pixel[1]);
            wanted += value;
            variance += f64::from(rendered.standard_error.pixel(x, y)[1]).powi(2);
            count += 1.0;
        }
    }
    (came / count, wanted / count, variance.sqrt() / count)
}

#[test]
fn in_a_white_furnace_a_white_ball_is_not_seen() {
    // The sky shines from above only. Turned upside down, the ball sees the other half: both together are the furnace.
    for (material, lowest) in [
        ("diffuse.reflectance = [1, 1, 1]", 1.0),
        ("glass = { index = 1.5 }", 1.0),
        // Of rough surfaces the model loses what is scattered between their own facets.
        ("glass = { index = 1.5, alpha = 0.1 }", 0.94),
        ("conductor = { eta = [0.001, 0.001, 0.001], k = [100, 100, 100], alpha = 0.1 }", 0.97),
        ("plastic = { diffuse = [1, 1, 1], alpha = 0.1 }", 0.9),
    ] {
        let scene = ball(material);
        let rendered = render(&scene, &light(SKY), options(1024, 128));
        let (width, height) = rendered.picture.size();
        let (mut sum, mut variance, mut count) = (0.0, 0.0, 0.0);
        for y in 0..height {
            for x in 0..width {
                if rendered.coverage[y * width + x] == 1.0 && rendered.coverage[(height - 1 - y) * width + x] == 1.0 {
                    sum += 2.0 * f64::from(rendered.picture.pixel(x, y)[0]);
                    variance += 4.0 * f64::from(rendered.standard_error.pixel(x, y)[0]).powi(2);
                    count += 1.0;
                }
            }
        }
        let (mean, error) = (sum / count, f64::sqrt(variance) / count);
        println!("{material}: {mean:.5} ± {error:.5}");
        assert!(
            mean <= 1.0 + 3.0 * error + 1e-4 && mean >= lowest - 3.0 * error - 1e-4,
            "{material}: {mean} ± {error}"
        );
    }
}

#[test]
fn a_matte_ball_under_a_uniform_sky_has_the_radiance_of_its_tilt() {
    let scene = ball("diffuse.reflectance = [0.6, 0.6, 0.6]");
    let rendered = render(&scene, &light(SKY), options(4096, 1));
    let (width, height) = scene.picture_size();
    let from = scene.camera().position();
    // E = π (1 + cosθ)/2, seen over the pixel by a fine grid.
    let expected = |x: usize, y: usize| {
        (rendered.coverage[y * width + x] == 1.0).then(|| {
            let n = 16;
            let points = (0..n * n).map(|i| {
                let (a, b) = ((f64::from(i % n) + 0.5) / f64::from(n), (f64::from(i / n) + 0.5) / f64::from(n));
                let towards = scene.camera().towards(x as f64 + a, y as f64 + b, width, height);
                let along = -from.dot(towards);
                let half = (0.81 - (from + along * towards).length_squared()).max(0.0).sqrt();
                let normal = (from + (along - half) * towards) / 0.9;
                0.6 * (1.0 + normal.z) / 2.0
            });
            points.sum::<f64>() / f64::from(n * n)
        })
    };
    let (came, wanted, error) = mean(&rendered, expected);
    println!("{came:.6}, on paper {wanted:.6}, ± {error:.6}");
    assert!((came - wanted).abs() < 3.0 * error, "{came}, not {wanted} ± {error}");
    let mut worst = 0.0f64;
    for (index, pixel) in rendered.picture.pixels().iter().enumerate() {
        if let Some(wanted) = expected(index % width, index / width) {
            worst = worst.max((f64::from(pixel[0]) - wanted).abs());
        }
    }
    assert!(worst < 0.03, "one pixel is {worst} off");
}

#[test]
fn a_closed_room_keeps_its_energy() {
    // Inside a ball with a lamp at its centre every point gets I/R², and 1/(1 − ρ) times that with all that is reflected.
    let room = |albedo: f64| {
        scene(
            "position = [0.3, -0.2, 0.1]\ntarget = [0, 1, 0.2]\nhorizontal_fov_deg = 90\nwidth = 8\nheight = 8",
            &format!(
                "[[material]]\nname = \"m\"\ndiffuse.reflectance = [{albedo}, {albedo}, {albedo}]\n[[object]]\n\
                 material = \"m\"\nsphere.radius_m = 2\n"
            ),
        )
    };
    let lamp = light("[[point]]\nposition = [0, 0, 0]\nintensity_w_sr = [10, 10, 10]");
    for albedo in [0.2, 0.5, 0.8] {
        let direct = albedo / PI * 10.0 / 4.0;
        for bounces in [1, 2, 3, 200] {
            let rendered = render(&room(albedo), &lamp, options(2048, bounces));
            let expected = direct * (1.0 - albedo.powi(bounces as i32)) / (1.0 - albedo);
            let (came, wanted, error) = mean(&rendered, |_, _| Some(expected));
            println!("albedo {albedo}, {bounces} bounces: {came:.5}, on paper {wanted:.5}, ± {error:.5}");
            assert!((came - wanted).abs() < 3.0 * error + 1e-4 * wanted, "{came}, not {wanted} ± {error}");
        }
    }
}

/// A matte plane that fills the picture, seen from straight above over this angle.
fn ground(size: usize, fov_deg: f64) -> Scene {
    scene(
        &format!(
            "position = [0, 0, 5]\ntarget = [0, 0, 0]\nup = [0, 1, 0]\nhorizontal_fov_deg = {fov_deg}\nwidth = {size}\n\
             height = {size}"
        ),
        "[[material]]\nname = \"m\"\ndiffuse.reflectance = [0.5, 0.5, 0.5]\n[[object]]\nmaterial = \"m\"\nplane.size_m = [4, 4]\n",
    )
}

#[test]
fn a_plane_under_one_square_has_the_irradiance_of_the_formula() {
    let scene = ground(16, 20.0);
    let (position, radius, intensity) = (Position::from_degrees(35.0, 50.0), 4.0, 50.0);
    let pattern = Pattern::new(6, 0.3).unwrap();
    let vignetting = 0.3;
    let lantern = Lantern::projector(position, radius, pattern, intensity, vignetting);
    let frame = position.frame();
    // Radiance at a point of the plane, and the square it lies in.
    let on_paper = |point: DVec3| {
        let offset = point - radius * frame.outward;
        let direction = offset.normalize();
        let (s, t) = frame.projector_from_world(direction)?;
        let (u, v) = pattern.square_at(s, t)?;
        let cosine = -direction.dot(frame.outward);
        let falloff = 1.0 - vignetting * (s * s + t * t) / (2.0 * 0.3 * 0.3);
        let irradiance = intensity * falloff / cosine.powi(3) / offset.length_squared() * -direction.z;
        Some((v * 6 + u, 0.5 / PI * irradiance))
    };
    let mut expected = vec![0.0; 36];
    let n = 16 * 64;
    for i in 0..n * n {
        let (x, y) = ((f64::from(i % n) + 0.5) / 64.0, (f64::from(i / n) + 0.5) / 64.0);
        let towards = scene.camera().towards(x, y, 16, 16);
        if let Some((square, radiance)) = on_paper(scene.camera().position() + towards * (5.0 / -towards.z)) {
            expected[square] += radiance / f64::from(n * n) * 256.0;
        }
    }
    // Twelve independent goes give the spread.
    let goes: Vec<Vec<f64>> = (0..12)
        .map(|seed| {
            let options = PathOptions { samples: 64, bounces: 1, seed };
            let mut sums = vec![0.0; 36];
            for share in Paths::trace(&scene, 0..16, 0..16, &options).under(&scene, &lantern, 0..16, 0..16) {
                sums[share.square as usize] += f64::from(share.radiance[0]);
            }
            sums
        })
        .collect();
    let mut lit = 0;
    for square in 0..36 {
        let mean = goes.iter().map(|sums| sums[square]).sum::<f64>() / 12.0;
        let variance = goes.iter().map(|sums| (sums[square] - mean).powi(2)).sum::<f64>() / (12.0 * 11.0);
        lit += usize::from(mean > 0.0);
        // With 36 squares one may well be three errors off; four and a half would be no chance.
        let off = (mean - expected[square]).abs();
        assert!(off <= 4.5 * variance.sqrt() + 1e-4 * expected[square], "{square}: {mean}, not {}", expected[square]);
    }
    let (total, wanted) = (goes.iter().flatten().sum::<f64>() / 12.0, expected.iter().sum::<f64>());
    let variance = goes.iter().map(|sums| (sums.iter().sum::<f64>() - total).powi(2)).sum::<f64>() / (12.0 * 11.0);
    println!("{lit} squares lit; in all {total:.5}, on paper {wanted:.5}, ± {:.5}", variance.sqrt());
    assert!(lit > 20 && (total - wanted).abs() < 3.0 * variance.sqrt() + 1e-4 * wanted);
}

#[test]
fn lamps_of_extent_give_the_irradiance_of_their_shape() {
    // As good as the origin alone.
    let scene = ground(2, 0.1);
    // A ball that is wholly above the horizon: E = π L sin²α cosθ. A large disk close by sees nearly all of the ground's sky.
    for (text, expected) in [
        ("[[sphere]]\ncenter = [0, 0, 2]\nradius_m = 0.8\nradiance = [3, 3, 3]", 3.0 * PI * 0.16),
        ("[[disk]]\ncenter = [0, 0, 1]\nnormal = [0, 0, -1]\nradius_m = 2\nradiance = [3, 3, 3]", 3.0 * PI * 0.8),
        (
            "[[rectangle]]\ncorner = [-2, -2, 1]\nedge_u = [0, 4, 0]\nedge_v = [4, 0, 0]\nradiance = [3, 3, 3]",
            // Four corners, each 2 × 2 at the distance 1.
            3.0 * 4.0 * 0.5 * 2.0 * (2.0 / 5f64.sqrt() * (2.0 / 5f64.sqrt()).atan()),
        ),
    ] {
        let rendered = render(&scene, &light(text), options(20_000, 1));
        let (came, wanted, error) = mean(&rendered, |_, _| Some(0.5 / PI * expected));
        println!("{came:.5}, on paper {wanted:.5}, ± {error:.5}: {text}");
        assert!((came - wanted).abs() < 3.0 * error + 1e-3 * wanted, "{text}: {came}, not {wanted} ± {error}");
    }
}

/// Pieces of all kinds close together on a floor.
fn still_life() -> Scene {
    scene(
        "position = [0, -4, 3]\ntarget = [0, 0, 0.2]\nhorizontal_fov_deg = 20\nwidth = 24\nheight = 16",
        r#"
[[material]]
name = "floor"
diffuse.reflectance = { checkerboard = [[0.8, 0.7, 0.6], [0.1, 0.2, 0.3]], fields = [4, 4] }
[[material]]
name = "metal"
conductor = { metal = "Cu", alpha = 0.3 }
[[material]]
name = "clay"
plastic = { diffuse = [0.7, 0.4, 0.3], alpha = 0.2 }
[[material]]
name = "frosted"
glass = { index = 1.5, alpha = 0.4 }
[[object]]
material = "floor"
plane.size_m = [1.4, 1.4]
[[object]]
material = "metal"
sphere.radius_m = 0.2
translate_m = [-0.25, 0, 0.2]
[[object]]
material = "clay"
lathe.profile_m = [[0, 0], [0.2, 0], [0.1, 0.2], [0.15, 0.4], [0, 0.5]]
translate_m = [0.2, 0.1, 0]
[[object]]
material = "frosted"
box.size_m = [0.15, 0.15, 0.3]
rotate_deg = [0, 0, 30]
translate_m = [0, -0.3, 0]
"#,
    )
}

#[test]
fn one_pass_gives_what_each_square_gives_alone_and_their_sum_what_white_gives() {
    let scene = still_life();
    let (width, height) = scene.picture_size();
    let position = Position::from_degrees(-60.0, 40.0);
    let (radius, intensity, m, half_width) = (4.0, 50.0, 3, 0.2);
    let lantern = Lantern::projector(position, radius, Pattern::new(m, half_width).unwrap(), intensity, 0.0);
    let goes = 16;
    let mut planes = vec![vec![0.0f64; width * height]; m * m];
    let mut spread = vec![0.0f64; width * height];
    for seed in 0..goes {
        let options = PathOptions { samples: 64, bounces: 3, seed };
        let mut white = vec![0.0f64; width * height];
        for share in Paths::trace(&scene, 0..width, 0..height, &options).under(&scene, &lantern, 0..width, 0..height) {
            let radiance = f64::from(share.radiance[1]);
            planes[share.square as usize][share.pixel as usize] += radiance / goes as f64;
            white[share.pixel as usize] += radiance;
        }
        for (sum, value) in spread.iter_mut().zip(white) {
            *sum += value * value / goes as f64;
        }
    }
    // The same projector as a slide: one square white, or all of them.
    let folder = tempfile::tempdir().unwrap();
    let slide = |lit: &dyn Fn(usize) -> bool| {
        let pixels = (0..m * m).map(|square| [f32::from(u8::from(lit(square))); 3]).collect();
        let picture: Image<relumine_radiometry::Radiance> = Image::from_pixels(m, m, pixels);
        let path = folder.path().join("slide.exr");
        relumine_radiometry::files::write_exr(&path, &picture, relumine_radiometry::files::ExrSample::Float, &[])
            .unwrap();
        let at = radius * position.direction();
        let text = format!(
            "format = \"relumine-light/1\"\n[[slide]]\nposition = [{}, {}, {}]\ntarget = [0, 0, 0]\nup = [0, 0, 1]\n\
             half_width = {half_width}\npicture = \"slide.exr\"\nintensity_w_sr = [{intensity}, {intensity}, {intensity}]",
            at.x, at.y, at.z
        );
        let light = Light::parse(&folder.path().join("light.toml"), &text).unwrap();
        render(&scene, &light, PathOptions { samples: 1024, bounces: 3, seed: 999 })
    };
    let compare = |name: &str, ours: &[f64], alone: &Rendered| {
        let sum: f64 = ours.iter().sum();
        let (mut wanted, mut variance) = (0.0, 0.0);
        for (pixel, error) in alone.picture.pixels().iter().zip(alone.standard_error.pixels()) {
            wanted += f64::from(pixel[1]);
            // Both goes have as many paths, and as much noise.
            variance += 2.0 * f64::from(error[1]).powi(2);
        }
        println!("{name}: {sum:.4} in one pass, {wanted:.4} alone, ± {:.4}", variance.sqrt());
        assert!((sum - wanted).abs() < 3.5 * variance.sqrt(), "{name}: {sum}, not {wanted} ± {}", variance.sqrt());
        // And pixel by pixel: not one in a hundred is five errors off.
        let far = ours.iter().enumerate().filter(|(pixel, value)| {
            let error = f64::from(alone.standard_error.pixels()[*pixel][1]).max(1e-4);
            (**value - f64::from(alone.picture.pixels()[*pixel][1])).abs() > 7.0 * error
        });
        let far = far.count();
        assert!(far * 100 < ours.len(), "{name}: {far} pixels differ");
    };
    for (square, plane) in planes.iter().enumerate() {
        compare(&format!("square {square}"), plane, &slide(&|lit| lit == square));
    }
    let white: Vec<f64> = (0..width * height).map(|pixel| planes.iter().map(|plane| plane[pixel]).sum()).collect();
    compare("white", &white, &slide(&|_| true));
}

#[test]
fn the_same_seed_gives_the_same_bits_on_any_number_of_threads() {
    let scene = still_life();
    let light = light(
        "[[sphere]]\ncenter = [1, -1, 2]\nradius_m = 0.3\nradiance = [5, 4, 3]\n[environment]\nradiance = [1, 1, 1]",
    );
    let lantern = Lantern::projector(Position::from_degrees(20.0, 30.0), 4.0, Pattern::new(5, 0.2).unwrap(), 1.0, 0.0);
    let run = |threads: usize| {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
            let options = options(8, 4);
            let picture = render(&scene, &light, options).picture;
            let whole = Paths::trace(&scene, 0..24, 0..16, &options).under(&scene, &lantern, 0..24, 0..16);
            // A part of the picture has the pixels of the whole.
            let part = Paths::trace(&scene, 5..20, 3..9, &options).under(&scene, &lantern, 5..20, 3..9);
            (picture, whole, part)
        })
    };
    let (one, three) = (run(1), run(3));
    assert!(one == three);
    for share in &one.2 {
        let pixel = (share.pixel / 15 + 3) * 24 + share.pixel % 15 + 5;
        assert!(
            one.1
                .iter()
                .any(|other| other.pixel == pixel && other.square == share.square && other.radiance == share.radiance)
        );
    }
}
