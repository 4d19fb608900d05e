//! The whole job on a scene that fits on one page: `cargo run --release --example ball [DIR]`.
//!
//! A red matte ball on a chequered matte table, computed by formula instead of photographed: 48 projector positions, row and
//! column combs of 8 × 8 squares, a projector whose black still shines, 16-bit pictures. The capture lands in DIR/capture, is
//! developed into DIR/ball.field and relit under the lights of DIR/*.toml; beside each picture lies the truth, computed
//! directly, and the figures are printed.

use std::error::Error;
use std::f64::consts::PI;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use glam::DVec3;
use relumine::basis::{Pattern, Reach};
use relumine::radiometry::files::{write_png_counts, write_png8};
use relumine::radiometry::{Counts, Display, Image, Radiance, difference};
use relumine::{
    Capture, Cells, DevelopOptions, Development, Light, ProjectionOptions, ReflectanceField, Relighting, ShownPattern,
    project,
};

const SIZE: (usize, usize) = (120, 80);
const BALL: (DVec3, f64) = (DVec3::new(0.0, 0.0, 0.3), 0.3);
const BLACK_LEVEL: f64 = 0.002;
/// Radiance of the brightest code: white paper right under the projector shows about 0.8.
const WHITE: f64 = 1.6;

const SETUP: &str = r#"format = "relumine-capture/1"
title = "A ball on a table"

[hemisphere]
radius_m = 4.0
azimuths = 12
tilts = 4

[projector]
squares = 8
half_width = 0.3
intensity_w_sr = 50.0

[patterns]
scheme = "combs"
spacing = 3

[camera]
width = 120
height = 80
response = "linear"
"#;

const LIGHTS: [(&str, &str); 3] = [
    (
        "spot",
        "[[spot]]\nposition = [1.5, -2.4, 2.8]\ntarget = [0, 0, 0.2]\nintensity_w_sr = [30, 26, 20]\nbeam_half_angle_deg = 5\ncutoff_half_angle_deg = 8\n",
    ),
    (
        "lamps",
        "[[sphere]]\ncenter = [-1.2, -0.6, 1.2]\nradius_m = 0.15\nradiance = [40, 30, 20]\n\n[[disk]]\ncenter = [1.2, 0.8, 1.4]\nnormal = [-1.2, -0.8, -1.4]\nradius_m = 0.2\nradiance = [4, 8, 20]\n",
    ),
    ("sun", "[[sun]]\ndirection = [0.5, 0.6, -0.64]\nirradiance_w_m2 = [3, 2.8, 2.4]\n"),
];

/// A point of the scene: where, which way it faces, what it reflects.
struct Surface {
    point: DVec3,
    normal: DVec3,
    albedo: DVec3,
}

/// What the camera sees at a pixel: from (0, −4, 3.2) towards the ball.
fn seen(x: usize, y: usize) -> Option<Surface> {
    let eye = DVec3::new(0.0, -4.0, 3.2);
    let forward = (DVec3::new(0.0, 0.0, 0.15) - eye).normalize();
    let right = forward.cross(DVec3::Z).normalize();
    let up = right.cross(forward);
    let (width, height) = (SIZE.0 as f64, SIZE.1 as f64);
    let (a, b) = ((x as f64 + 0.5) / width - 0.5, 0.5 - (y as f64 + 0.5) / height);
    let direction = (forward + 0.36 * (a * right + b * height / width * up)).normalize();
    if let Some(distance) = meets_ball(eye, direction) {
        let point = eye + distance * direction;
        return Some(Surface { point, normal: (point - BALL.0) / BALL.1, albedo: DVec3::new(0.75, 0.15, 0.1) });
    }
    let point = eye - eye.z / direction.z * direction;
    let light = (point.x * 5.0).floor() as i64 + (point.y * 5.0).floor() as i64;
    let albedo = if light.rem_euclid(2) == 0 { DVec3::splat(0.75) } else { DVec3::new(0.2, 0.22, 0.25) };
    (point.truncate().length() < 0.9).then_some(Surface { point, normal: DVec3::Z, albedo })
}

fn meets_ball(from: DVec3, direction: DVec3) -> Option<f64> {
    let offset = from - BALL.0;
    let b = offset.dot(direction);
    let discriminant = b * b - offset.length_squared() + BALL.1 * BALL.1;
    (discriminant > 0.0).then(|| -b - discriminant.sqrt()).filter(|distance| *distance > 1e-6)
}

/// Radiance towards the camera under light of one direction: matte, shadowed by the ball.
fn reflected(surface: &Surface, direction: DVec3, irradiance: DVec3) -> DVec3 {
    let cosine = -direction.dot(surface.normal);
    if cosine <= 0.0 || meets_ball(surface.point + 1e-6 * surface.normal, -direction).is_some() {
        return DVec3::ZERO;
    }
    surface.albedo / PI * irradiance * cosine
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).unwrap_or_else(|| "ball".into());
    let folder = Path::new(&folder);
    let (capture, field) = (folder.join("capture"), folder.join("ball.field"));
    if field.exists() {
        return Err(format!("{} is there already: remove it to do the job again", field.display()).into());
    }
    let scene: Vec<Option<Surface>> = (0..SIZE.1).flat_map(|y| (0..SIZE.0).map(move |x| seen(x, y))).collect();
    photograph(&capture, &scene)?;

    let mut development =
        Development::start(&capture, &field, &DevelopOptions { replace: true, ..Default::default() })?;
    let mut worst = 0.0f64;
    for position in &mut development {
        worst = worst.max(position?.report.residual_combs.unwrap_or(0.0));
    }
    development.finish()?;
    println!("developed into {}; combs are explained to {:.3} %", field.display(), 100.0 * worst);

    let field = ReflectanceField::open(&field)?;
    for (name, text) in LIGHTS {
        let path = folder.join(format!("{name}.toml"));
        fs::write(&path, format!("format = \"relumine-light/1\"\n\n{text}"))?;
        let light = Light::read(&path)?;
        let coefficients = [project(&light, field.cells(), &ProjectionOptions::default())?.coefficients];
        let relit = Relighting::new(&field, &coefficients)?.run()?.remove(0);
        let truth = truth(&scene, &light);
        let display = Display { exposure_stops: 1.0, ..Display::default() };
        write_png8(&folder.join(format!("{name}.png")), &display.encode(&relit))?;
        write_png8(&folder.join(format!("{name}-truth.png")), &display.encode(&truth))?;
        let figures = difference(&relit, &truth, None, false).ok_or("the truth is black")?;
        println!("{name:<6} ratio of means {:.3}, relative L2 {:.3}", figures.ratio_of_means, figures.relative_l2);
    }
    println!("pictures and lights lie in {}", folder.display());
    Ok(())
}

/// Writes the capture directory: every pattern of every position, by formula.
fn photograph(capture: &Path, scene: &[Option<Surface>]) -> Result<(), Box<dyn Error>> {
    fs::create_dir_all(capture)?;
    fs::write(capture.join("capture.toml"), SETUP)?;
    let mut table = String::from("position,pattern,exposure_s,iso,f_number,file,sha256\n");
    fs::write(capture.join("photographs.csv"), &table)?;
    let opened = Capture::open(capture)?;
    let setup = opened.setup();
    for position in 0..setup.cells().positions() {
        let lit = under_projector(setup.cells(), position, setup.intensity_w_sr(), scene)?;
        fs::create_dir_all(capture.join(format!("photographs/p{position:03}")))?;
        let squares = setup.cells().squares();
        let mut patterns = vec![ShownPattern::Black, ShownPattern::White];
        patterns.extend(setup.scheme().lighting(squares));
        for pattern in patterns {
            let lights = pattern.lit(squares, 3);
            let pixels = lit
                .iter()
                .map(|(square, radiance)| {
                    let share = if lights.contains(square) { 1.0 } else { BLACK_LEVEL };
                    (*radiance * share / WHITE * 65535.0).to_array().map(|code| code.round() as u16)
                })
                .collect();
            let file = format!("photographs/p{position:03}/{pattern}.png");
            write_png_counts(&capture.join(&file), &Image::<Counts>::from_pixels(SIZE.0, SIZE.1, pixels), 16)?;
            // At this exposure a radiance of WHITE clips.
            writeln!(table, "{position},{pattern},{},,,{file},", 1.0 / WHITE)?;
        }
    }
    fs::write(capture.join("photographs.csv"), table)?;
    println!("photographed {} patterns into {}", opened.setup().scheme().lighting(8).len() + 2, capture.display());
    Ok(())
}

/// The square that lights a pixel, and the pixel's radiance under it.
type Lit = ((usize, usize), DVec3);

/// Each pixel under the projector at a position.
fn under_projector(
    cells: &Cells,
    position: usize,
    intensity: f64,
    scene: &[Option<Surface>],
) -> Result<Vec<Lit>, Box<dyn Error>> {
    let Reach::Near { radius_m, pattern } = cells.reach() else { return Err("a projector stands near".into()) };
    let frame = cells.partition().positions()[position].frame();
    let projector = radius_m * frame.outward;
    let pixel = |surface: &Surface, pattern: &Pattern| {
        let offset = surface.point - projector;
        let direction = offset.normalize();
        let (s, t) = frame.projector_from_world(direction)?;
        // I(a) = I₀/cos³a lights a screen evenly.
        let irradiance = intensity * (1.0 + s * s + t * t).powf(1.5) / offset.length_squared();
        Some((pattern.square_at(s, t)?, reflected(surface, direction, DVec3::splat(irradiance))))
    };
    let dark = ((0, 0), DVec3::ZERO);
    Ok(scene.iter().map(|surface| surface.as_ref().and_then(|s| pixel(s, &pattern)).unwrap_or(dark)).collect())
}

/// The scene under a light, directly: 16 × 16 places on each lamp.
fn truth(scene: &[Option<Surface>], light: &Light) -> Image<Radiance> {
    let n = 16;
    let places: Vec<[f64; 2]> = (0..n * n)
        .map(|i| [(f64::from(i % n) + 0.5) / f64::from(n), (f64::from(i / n) + 0.5) / f64::from(n)])
        .collect();
    let radiance = |surface: &Surface| {
        let arrivals = light.lamps.iter().flat_map(|lamp| places.iter().map(|xi| lamp.arrival(surface.point, *xi)));
        let sum: DVec3 =
            arrivals.flatten().map(|arrival| reflected(surface, arrival.direction, arrival.irradiance)).sum();
        sum / places.len() as f64
    };
    let pixel = |surface: &Option<Surface>| surface.as_ref().map_or(DVec3::ZERO, radiance).as_vec3().to_array();
    Image::from_pixels(SIZE.0, SIZE.1, scene.iter().map(pixel).collect())
}
