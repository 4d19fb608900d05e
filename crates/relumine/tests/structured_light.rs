//! Real photographs under structured light, read through the chain of a capture: black subtraction, superposition, the minimum.
//!
//! They lie beside the project, in `../shared/data`; without them these tests say so and pass.

#![allow(clippy::unwrap_used)] // in helpers of tests too

use std::path::{Path, PathBuf};

use relumine::radiometry::files::{self, Picture};
use relumine::radiometry::{Linearization, NoiseModel, Response, ResponseCurve, merge_counts};
use relumine_capture::separation::{Combs, separate_minimum};

fn data(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(name);
    if path.exists() {
        return Some(path);
    }
    eprintln!("skipped: {} is not there, so no real photographs of patterns are read", path.display());
    None
}

/// One photograph as radiance, mean of the channels, as `develop` would read it.
fn read(path: &Path, response: &Response) -> Vec<f32> {
    let Picture::Integer { image, bits: 8 } = files::read_picture(path).unwrap() else { panic!("8 bits") };
    let camera = Linearization::new(response, 0, 255);
    let merged = merge_counts(&[(&image, 1.0)], &camera, NoiseModel::default());
    merged.radiance.pixels().iter().map(|pixel| pixel.iter().sum::<f32>() / 3.0).collect()
}

/// Stripes: of each bit the pattern and its inverse.
struct Stripes {
    white: Vec<f32>,
    black: Vec<f32>,
    x: Vec<[Vec<f32>; 2]>,
    y: Vec<[Vec<f32>; 2]>,
}

impl Stripes {
    /// White above black where the projector shines at all.
    fn lit(&self) -> Vec<usize> {
        let above: Vec<f32> = self.white.iter().zip(&self.black).map(|(white, black)| white - black).collect();
        let mut sorted = above.clone();
        sorted.sort_by(f32::total_cmp);
        let bright = 0.3 * sorted[sorted.len() - 1 - sorted.len() / 100];
        (0..above.len()).filter(|pixel| above[*pixel] > bright && self.white[*pixel] < 0.99).collect()
    }

    /// Pattern + inverse less white + black, of one bit, over white: of the sums over `lit`, and pixel by pixel (L1), where the noise of
    /// four photographs is in it.
    fn superposition(&self, [pattern, inverse]: &[Vec<f32>; 2], lit: &[usize]) -> (f64, f64) {
        let (mut sums, mut error, mut light) = (0.0, 0.0, 0.0);
        for pixel in lit {
            let sum = pattern[*pixel] + inverse[*pixel] - self.white[*pixel] - self.black[*pixel];
            sums += f64::from(sum);
            error += f64::from(sum.abs());
            light += f64::from(self.white[*pixel]);
        }
        (f64::abs(sums) / light, error / light)
    }

    /// The minimum of an x and a y stripe pattern, over white: where both shine, and where at most one does. A pixel shines under
    /// a pattern where that is brighter than its inverse by half of white.
    fn minimum(&self, bit_x: usize, bit_y: usize, lit: &[usize]) -> (Vec<f64>, Vec<f64>) {
        let above =
            |frame: &[f32]| -> Vec<f32> { lit.iter().map(|pixel| frame[*pixel] - self.black[*pixel]).collect() };
        let white = above(&self.white);
        // Two combs of one square: what `separation` tells apart.
        let (row, column) = (above(&self.y[bit_y][0]), above(&self.x[bit_x][0]));
        let combs = Combs {
            squares: 1,
            spacing: 1,
            rows: vec![Some(&row)],
            columns: vec![Some(&column)],
            white: Some(&white),
            noise: None,
            lanes: lit.len(),
        };
        let mut square = vec![0.0; lit.len()];
        separate_minimum(&combs, &mut square);
        let (mut inside, mut outside) = (Vec::new(), Vec::new());
        for (index, pixel) in lit.iter().enumerate() {
            let shines = |[pattern, inverse]: &[Vec<f32>; 2]| {
                let difference = pattern[*pixel] - inverse[*pixel];
                (difference.abs() > 0.5 * white[index]).then_some(difference > 0.0)
            };
            let (Some(x), Some(y)) = (shines(&self.x[bit_x]), shines(&self.y[bit_y])) else { continue };
            let ratio = f64::from(square[index] / white[index]);
            if x && y { inside.push(ratio) } else { outside.push(ratio) }
        }
        (inside, outside)
    }
}

fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * share) as usize]
}

#[test]
fn a_linear_camera_adds_up_and_the_minimum_tells_apart() {
    let Some(folder) = data("procam_kamino_chess/capture_0") else { return };
    let photograph = |index: usize| read(&folder.join(format!("graycode_{index:02}.png")), &Response::Linear);
    let pair = |index: usize| [photograph(index), photograph(index + 1)];
    let stripes = Stripes {
        white: photograph(40),
        black: photograph(41),
        x: (0..10).map(|bit| pair(2 * bit)).collect(),
        y: (0..10).map(|bit| pair(20 + 2 * bit)).collect(),
    };
    let lit = stripes.lit();
    let black = lit.iter().map(|pixel| f64::from(stripes.black[*pixel])).sum::<f64>() / lit.len() as f64 * 255.0;
    println!("{} lit pixels, black {black:.2} counts", lit.len());
    assert!((3.0..10.0).contains(&black));
    for (name, pairs) in [("x", &stripes.x), ("y", &stripes.y)] {
        for (bit, pair) in pairs.iter().enumerate() {
            let (sums, pixels) = stripes.superposition(pair, &lit);
            println!(
                "{name} bit {bit}: pattern + inverse is white + black within {:.2} % of white, pixel by pixel {:.2} %",
                100.0 * sums,
                100.0 * pixels
            );
            assert!(sums < 0.02 && pixels < 0.03, "{name} bit {bit}: {sums} and {pixels}");
        }
    }
    for bit in 0..5 {
        let (mut inside, mut outside) = stripes.minimum(bit, bit, &lit);
        let (inside, outside) = (quantile(&mut inside, 0.5), quantile(&mut outside, 0.5));
        println!("minimum of x and y stripes, bit {bit}: inside {inside:.3}, outside {outside:.3} of white (medians)");
        assert!(inside > 0.91 && inside < 1.01 && outside < 0.055, "bit {bit}: {inside} and {outside}");
    }
}

#[test]
fn jpeg_photographs_of_a_figurine_tell_apart_raw_and_better_linearized() {
    let Some(folder) = data("sl_two_toys/GrayCodes/view0") else { return };
    let mut names: Vec<PathBuf> =
        std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).filter(|path| path.is_file()).collect();
    names.sort();
    assert_eq!(names.len(), 42);
    let gamma = |gamma: f64| {
        let row = |index: u32| (f64::from(index) / 256.0, (f64::from(index) / 256.0).powf(1.0 / gamma));
        let rows: String = (0..=256).map(row).map(|(x, y)| format!("{x},{y},{y},{y}\n")).collect();
        let text = format!("{}\n{rows}", ResponseCurve::HEADER);
        Response::Curve(ResponseCurve::parse(Path::new("gamma.csv"), &text).unwrap())
    };
    let figures = |response: &Response| {
        let photograph = |index: usize| read(&names[index], response);
        let pair = |index: usize| [photograph(index), photograph(index + 1)];
        let bits = 0..4;
        let stripes = Stripes {
            white: photograph(0),
            black: photograph(1),
            x: bits.clone().map(|bit| pair(2 + 2 * bit)).collect(),
            y: bits.clone().map(|bit| pair(22 + 2 * bit)).collect(),
        };
        let lit = stripes.lit();
        let minima = bits.clone().map(|bit| {
            let (mut inside, mut outside) = stripes.minimum(bit, bit, &lit);
            [quantile(&mut inside, 0.5), quantile(&mut outside, 0.5), quantile(&mut outside, 0.95)]
        });
        let sums = bits.clone().map(|bit| stripes.superposition(&stripes.x[bit], &lit).1).sum::<f64>() / 4.0;
        (minima.collect::<Vec<_>>(), sums)
    };
    let raw = figures(&Response::Linear);
    let linear = figures(&gamma(1.45));
    for (name, (minima, sums)) in [("raw", &raw), ("gamma 1.45 undone", &linear)] {
        println!("{name}: sums off by {:.2} % pixel by pixel", 100.0 * sums);
        for (bit, [inside, outside, p95]) in minima.iter().enumerate() {
            println!("  bit {bit}: inside {inside:.3} of white, outside {outside:.4} (95th percentile {p95:.4})");
            assert!((0.97..=1.005).contains(inside), "{name}, bit {bit}");
        }
        // The widest stripes, whose edges are few.
        let [_, outside, p95] = minima[0];
        assert!(outside.abs() < 0.0005 && p95 <= 0.03, "{name}");
    }
    // Once light is light again, nothing is worse and what was outside is darker.
    for (raw, linear) in raw.0.iter().zip(&linear.0) {
        assert!(linear[1] <= raw[1] && linear[2] < raw[2] && linear[0] > raw[0] - 0.01, "{linear:?} after {raw:?}");
    }
    assert!(linear.1 < raw.1, "{} after {}", linear.1, raw.1);
}
