//! Recovered responses against responses that are known.

#![allow(clippy::unwrap_used)] // in helpers of tests too

use std::path::Path;

use rand::SeedableRng;
use rand_distr::{Distribution, Normal};
use relumine_radiometry::{Counts, Image, Response, ResponseCurve, recover_response};

/// An S: a toe, a shoulder, and each channel a little different.
fn s_shaped(channel: usize, x: f64) -> f64 {
    let gain = [1.0, 0.8, 1.3][channel];
    let y = x.powf(0.55);
    let bent = |y: f64| (6.0 * gain * (y - 0.5)).tanh();
    0.6 * y + 0.4 * (bent(y) - bent(0.0)) / (bent(1.0) - bent(0.0))
}

/// A view of `width` × 64 patches and slopes over 4 decades, seen by a camera of `bits` with 30,000 electrons.
fn bracket(f: impl Fn(usize, f64) -> f64, bits: u32, black: f64, times: &[f64], seed: u64) -> Vec<Image<Counts>> {
    let (width, height) = (192, 96);
    let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
    let white = f64::from((1u32 << bits) - 1);
    let radiance = |x: usize, y: usize, channel: usize| {
        let (u, v) = (x as f64 / width as f64, y as f64 / height as f64);
        let patch = ((x / 12 * 7 + y / 12 * 5) % 13) as f64 / 13.0;
        10f64.powf(-2.0 + 2.2 * u + 1.2 * patch - 0.8 * v) * [1.0, 0.7, 0.5][channel]
    };
    times
        .iter()
        .map(|t| {
            let pixels = (0..width * height).map(|i| {
                std::array::from_fn(|channel| {
                    let x = radiance(i % width, i / width, channel) * t;
                    let deviation = (x / 30_000.0 + (8.0f64 / 30_000.0).powi(2)).sqrt();
                    let noisy = Normal::new(x, deviation).unwrap().sample(&mut rng).clamp(0.0, 1.0);
                    (black + f(channel, noisy) * (white - black)).round() as u16
                })
            });
            Image::from_pixels(width, height, pixels.collect())
        })
        .collect()
}

fn curve(response: &Response) -> &ResponseCurve {
    match response {
        Response::Curve(curve) => curve,
        other => panic!("a recovered response is a curve, not {other:?}"),
    }
}

/// The largest difference of f where the true fraction is between 5 % and 95 %.
fn largest_difference(found: &ResponseCurve, truth: impl Fn(usize, f64) -> f64) -> f64 {
    let mut largest = 0.0f64;
    for channel in 0..3 {
        for i in 0..=4000 {
            let x = (f64::from(i) / 4000.0).powi(2);
            let true_fraction = truth(channel, x);
            if (0.05..=0.95).contains(&true_fraction) {
                largest = largest.max((found.fraction(channel, x) - true_fraction).abs());
            }
        }
    }
    largest
}

fn recover(stack: &[Image<Counts>], times: &[f64], black: f64, white: f64) -> relumine_radiometry::RecoveredResponse {
    let photographs: Vec<(&Image<Counts>, f64)> = stack.iter().zip(times.iter().copied()).collect();
    recover_response(&photographs, black, white).unwrap()
}

#[test]
fn a_known_response_comes_back_from_noisy_photographs() {
    let powers_of_two: Vec<f64> = (-4..5).map(|stop| 2f64.powi(stop)).collect();
    let two_stops: Vec<f64> = (-2..3).map(|step| 4f64.powi(step)).collect();
    let third_stops: Vec<f64> = (-4..5).map(|step| 2f64.powf(1.33 * f64::from(step))).collect();
    let srgb = |_: usize, x: f64| relumine_radiometry::srgb_encode(x);
    let linear = |_: usize, x: f64| x;
    type Curve = (&'static str, fn(usize, f64) -> f64);
    let curves: [Curve; 3] = [("S", s_shaped), ("sRGB", srgb), ("linear", linear)];
    for (name, f) in curves {
        for (bits, black) in [(8, 0.0), (8, 12.0), (12, 200.0), (16, 0.0), (16, 1024.0)] {
            for (spacing, times) in [("2", &powers_of_two), ("2.5", &third_stops), ("4", &two_stops)] {
                if name != "S" && (bits != 8 || black > 0.0) {
                    continue;
                }
                let white = f64::from((1u32 << bits) - 1);
                let stack = bracket(f, bits, black, times, 1 + u64::from(bits));
                let found = recover(&stack, times, black, white);
                let difference = largest_difference(curve(&found.response), f);
                println!(
                    "{name}, {bits} bits, black {black}, steps of {spacing}: {difference:.5} {:?}",
                    found.report[0]
                );
                assert!(difference <= 0.01, "{name}, {bits} bits, black {black}, steps of {spacing}: {difference:.4}");
            }
        }
    }
}

#[test]
fn the_curve_of_the_chess_capture_comes_back() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/chess-capture");
    let list = folder.join("calibration/exposures.csv");
    if !list.is_file() {
        println!("skipped: {} is not there, a bracket photographed by a renderer that is not ours", list.display());
        return;
    }
    let text = std::fs::read_to_string(&list).unwrap();
    let (mut stack, mut times) = (Vec::new(), Vec::new());
    for line in text.lines().skip(1).filter(|line| !line.is_empty()) {
        let (name, time) = line.split_once(',').unwrap();
        match relumine_radiometry::files::read_picture(&folder.join("calibration").join(name)).unwrap() {
            relumine_radiometry::files::Picture::Integer { image, bits: 8 } => stack.push(image),
            other => panic!("{name}: {}", other.describe()),
        }
        times.push(time.parse().unwrap());
    }
    assert_eq!(stack.len(), 11);
    let path = folder.join("response.csv");
    let truth = ResponseCurve::parse(&path, &std::fs::read_to_string(&path).unwrap()).unwrap();
    let found = recover(&stack, &times, 0.0, 255.0);
    let difference = largest_difference(curve(&found.response), |channel, x| truth.fraction(channel, x));
    println!("chess: {difference:.5} {:?}", found.report);
    assert!(difference <= 0.01, "{difference:.4}");
}
