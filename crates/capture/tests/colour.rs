//! A capture photographed by a camera whose channels mix comes back to the truth when capture.toml names its correction.

#![allow(clippy::unwrap_used)] // in helpers of tests too

use std::path::Path;

use relumine_basis::Cell;
use relumine_capture::separation::Method;
use relumine_capture::{Capture, Developer, Scheme, Setup, ShownPattern};
use relumine_radiometry::colour::space::{Matrix3, inverse, transform};
use relumine_radiometry::colour::{ColourProfile, Correction};
use relumine_radiometry::files::{ExrSample, write_exr};
use relumine_radiometry::{Image, Radiance};

const WIDTH: usize = 7;
const HEIGHT: usize = 5;
const SQUARES: usize = 4;
/// The camera's channels, from linear Rec. 709.
const CROSSTALK: Matrix3 = [[0.72, 0.22, 0.06], [0.12, 0.76, 0.12], [0.04, 0.24, 0.72]];
const BLACK_LEVEL: f64 = 0.02;

/// Radiance of a pixel under one square at full white. The minimum of two combs is exact where the light through all squares
/// of a row or column but one is dark: each pixel sees one square, and every third one a colour that no display shows.
fn truth(pixel: usize, u: usize, v: usize) -> [f64; 3] {
    if (u, v) != (pixel % SQUARES, pixel / 3 % SQUARES) {
        return [0.0; 3];
    }
    let brightness = 0.2 + 0.05 * pixel as f64;
    match pixel % 3 {
        0 => [0.9, 0.5, 0.2].map(|value| brightness * value),
        1 => [-0.12, 0.9, 0.4].map(|value| brightness * value),
        _ => [0.3, 0.3, 0.3].map(|value| brightness * value),
    }
}

fn photograph(shown: ShownPattern, spacing: usize) -> Image<Radiance> {
    let lit = shown.lit(SQUARES, spacing);
    let pixels = (0..WIDTH * HEIGHT).map(|pixel| {
        let mut sum = [0.0; 3];
        for (v, u) in (0..SQUARES).flat_map(|v| (0..SQUARES).map(move |u| (v, u))) {
            let share = if lit.contains(&(u, v)) { 1.0 } else { BLACK_LEVEL };
            let colour = truth(pixel, u, v);
            (0..3).for_each(|channel| sum[channel] += share * colour[channel]);
        }
        let camera = transform(&CROSSTALK, sum);
        assert!(camera.iter().all(|value| *value >= 0.0), "what a camera sees is not negative");
        camera.map(|value| value as f32)
    });
    Image::from_pixels(WIDTH, HEIGHT, pixels.collect())
}

fn lay_out(directory: &Path, patterns: &str, colour: &str) -> Scheme {
    let setup = format!(
        "format = \"relumine-capture/1\"\n[hemisphere]\nradius_m = 2.0\nazimuths = 1\ntilts = 1\n[projector]\nsquares = \
         {SQUARES}\nhalf_width = 0.3\nintensity_w_sr = 3.0\n[patterns]\n{patterns}\n[camera]\nwidth = {WIDTH}\nheight = {HEIGHT}\n\
         {colour}\n"
    );
    std::fs::write(directory.join("capture.toml"), &setup).unwrap();
    let scheme = if patterns.contains("combs") { Scheme::Combs { spacing: 3 } } else { Scheme::Squares };
    let mut table = relumine_capture::csv_header();
    let frames = scheme.lighting(SQUARES).into_iter().chain([ShownPattern::Black, ShownPattern::White]);
    for pattern in frames {
        let file = format!("{pattern}.exr");
        write_exr(&directory.join(&file), &photograph(pattern, 3), ExrSample::Float, &[]).unwrap();
        table += &format!("0,{pattern},1,,,{file},\n");
    }
    std::fs::write(directory.join("photographs.csv"), table).unwrap();
    scheme
}

fn write_correction(directory: &Path) {
    let correction = Correction::from_matrix(inverse(&CROSSTALK).unwrap());
    ColourProfile { correction, fitted: None }.write(&directory.join("chart.toml")).unwrap();
}

/// The largest difference of a transfer from the truth, over the largest transfer; and the most negative one over it.
fn worst(directory: &Path, method: Method) -> (f64, f64) {
    let developer = Developer::new(Capture::open(directory).unwrap(), method, None).unwrap();
    let developed = developer.develop(0).unwrap().unwrap();
    let tile = developed.separate(0..WIDTH, 0..HEIGHT);
    let (mut worst, mut largest, mut lowest) = (0.0f64, 0.0f64, 0.0f64);
    for (square, picture) in tile.transfer.chunks_exact(WIDTH * HEIGHT * 3).enumerate() {
        let (u, v) = (square % SQUARES, square / SQUARES);
        let factor = developer.capture().setup().transfer_per_radiance(Cell { position: 0, u, v });
        for pixel in 0..WIDTH * HEIGHT {
            for (channel, known) in truth(pixel, u, v).into_iter().enumerate() {
                let (found, known) = (f64::from(picture[channel * WIDTH * HEIGHT + pixel]), known * factor);
                worst = worst.max((found - known).abs());
                largest = largest.max(known.abs());
                lowest = lowest.min(found);
            }
        }
    }
    let reached = tile.transfer.iter().fold(0.0f64, |reached, value| reached.max(f64::from(value.abs())));
    assert!(reached <= developed.transfer_bound(), "{reached} is beyond the bound {}", developed.transfer_bound());
    (worst / largest, lowest / largest)
}

#[test]
fn known_crosstalk_is_undone_and_colours_outside_of_the_gamut_stay_negative() {
    for patterns in ["scheme = \"squares\"", "scheme = \"combs\""] {
        let directory = tempfile::tempdir().unwrap();
        write_correction(directory.path());
        lay_out(directory.path(), patterns, "colour = \"chart.toml\"");
        for method in [Method::Minimum, Method::Fitted] {
            let (error, lowest) = worst(directory.path(), method);
            assert!(error < 1e-5, "{patterns}, {method:?}: {error}");
            assert!(lowest < -0.05, "{patterns}, {method:?}: {lowest}");
        }
        lay_out(directory.path(), patterns, "");
        let (error, lowest) = worst(directory.path(), Method::Fitted);
        assert!(error > 0.1 && lowest > -1e-5, "without the correction it is off: {error}, {lowest}");
    }
}

#[test]
fn what_the_photographs_show_is_corrected_as_the_field_is() {
    let directory = tempfile::tempdir().unwrap();
    write_correction(directory.path());
    let scheme = lay_out(directory.path(), "scheme = \"squares\"", "colour = \"chart.toml\"");
    let developer = Developer::new(Capture::open(directory.path()).unwrap(), Method::Fitted, None).unwrap();
    for pattern in scheme.lighting(SQUARES) {
        let shown = developer.above_black(0, pattern).unwrap().unwrap();
        let (u, v) = pattern.lit(SQUARES, 3)[0];
        for (pixel, found) in shown.pixels().iter().enumerate() {
            let known = truth(pixel, u, v).map(|value| (1.0 - BLACK_LEVEL) * value);
            assert!((0..3).all(|c| (f64::from(found[c]) - known[c]).abs() < 1e-5), "{pattern}: {found:?} {known:?}");
        }
    }
}

#[test]
fn what_is_no_correction_of_a_field_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let refusal = |colour: &str| {
        lay_out(directory.path(), "scheme = \"squares\"", colour);
        Setup::read(&directory.path().join("capture.toml")).err().unwrap().to_string()
    };
    let roots = Correction::from_root_polynomial([[1.0, 0.0, 0.0, 0.1, 0.0, 0.0]; 3]);
    ColourProfile { correction: roots, fitted: None }.write(&directory.path().join("roots.toml")).unwrap();
    let error = refusal("colour = \"roots.toml\"");
    assert!(
        error.contains("capture.toml: camera: colour = \"roots.toml\" is a root-polynomial, which is not linear"),
        "{error}"
    );
    assert!(refusal("colour = \"none.toml\"").contains("none.toml"));
    assert!(refusal("colour = \"../chart.toml\"").contains("must lie inside the capture directory"));
    assert!(refusal("colour = \"\"").contains("must lie inside the capture directory"));
    std::fs::write(
        directory.path().join("bad.toml"),
        "format = \"relumine-colour/1\"\nmodel = \"matrix\"\ncoefficients = [[1, 0, 0]]\n",
    )
    .unwrap();
    assert!(refusal("colour = \"bad.toml\"").contains("bad.toml: coefficients: expected 3 rows"));
}
