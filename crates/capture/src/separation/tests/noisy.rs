//! Claims about separation of noisy photographs of squares whose light is known.

use rand::{Rng, RngExt, SeedableRng};
use rand_distr::{Distribution, Exp1, StandardNormal};
use rand_pcg::Pcg64Mcg;
use relumine_radiometry::NoiseCurve;

use super::*;
use crate::separation::fitted::separate_fitted_plain;

/// The sensor of issue 5 at an exposure of 0.5: 20,000 electrons full well, 6 electrons of reading.
const SLOPE: f32 = 1.0 / (0.5 * 20_000.0);
const DARK: f32 = 3.6e-7;

/// Photographs of known squares with noise, the black frame being b · white with an error of its own.
struct Noisy {
    truth: Vec<f32>,
    photographed: Photographed,
    curve: NoiseCurve,
    black: Vec<f32>,
    black_variance: Vec<f32>,
}

impl Noisy {
    fn new(squares: usize, truth: Vec<f32>, black_variance: f32, random: &mut impl Rng) -> Self {
        let mut photographed = Photographed::new(squares, 3, &truth);
        let lanes = photographed.lanes;
        let mut gauss = |variance: f32| -> f32 {
            let normal: f32 = StandardNormal.sample(random);
            normal * variance.sqrt()
        };
        let black_error: Vec<f32> = (0..lanes).map(|_| gauss(black_variance)).collect();
        let frames = photographed.rows.iter_mut().chain(&mut photographed.columns).chain([&mut photographed.white]);
        for frame in frames {
            for (value, black_error) in frame.iter_mut().zip(&black_error) {
                *value += gauss(DARK + SLOPE * *value) - black_error;
            }
        }
        let curve = NoiseCurve::linear(DARK, SLOPE);
        Self { truth, photographed, curve, black: vec![0.0; lanes], black_variance: vec![black_variance; lanes] }
    }

    fn combs(&self) -> Combs<'_> {
        let noise =
            CombNoise { curve: &self.curve, black: &self.black, black_variance: &self.black_variance, scale: 1.0 };
        Combs { noise: Some(noise), ..self.photographed.combs() }
    }

    /// By lane: Σ weight · (separated − truth).
    fn errors(&self, separated: &[f32], weights: &[f32]) -> Vec<f64> {
        let lanes = self.photographed.lanes;
        let mut errors = vec![0.0f64; lanes];
        for (square, weight) in weights.iter().enumerate() {
            for (lane, error) in errors.iter_mut().enumerate() {
                let at = square * lanes + lane;
                *error += f64::from(*weight) * f64::from(separated[at] - self.truth[at]);
            }
        }
        errors
    }
}

/// Mean, standard error of the mean, root mean square.
fn moments(values: &[f64]) -> (f64, f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / n;
    (mean, (variance / n).sqrt(), (values.iter().map(|value| value * value).sum::<f64>() / n).sqrt())
}

/// What a pixel of an object shows: one square that lights it directly, and a little from some others.
fn object(squares: usize, lanes: usize, random: &mut impl Rng) -> Vec<f32> {
    let m2 = squares * squares;
    let mut truth = vec![0.0; m2 * lanes];
    for lane in 0..lanes {
        let direct = 0.3f32 * random.random::<f32>().powi(3);
        truth[random.random_range(0..m2) * lanes + lane] += direct;
        for _ in 0..m2 / 8 {
            let indirect: f32 = Exp1.sample(random);
            truth[random.random_range(0..m2) * lanes + lane] += indirect * 5e-4;
        }
    }
    truth
}

const METHODS: [Method; 4] = [Method::Minimum, Method::Thresholded, Method::Unbiased, Method::Fitted];

#[test]
fn in_the_dark_sums_are_right_but_for_the_plain_minimum() {
    let (m, lanes) = (8, 4000);
    let noisy = Noisy::new(m, vec![0.0; m * m * lanes], 0.0, &mut Pcg64Mcg::seed_from_u64(1));
    for method in [Method::Minimum, Method::Unbiased, Method::Fitted] {
        let errors = noisy.errors(&separated(&noisy.combs(), method), &vec![1.0; m * m]);
        let (mean, standard_error, _) = moments(&errors);
        // E[min(X, Y)] = −σ/√π for every one of the squares.
        let of_minimum = -f64::from(DARK).sqrt() / std::f64::consts::PI.sqrt() * (m * m) as f64;
        let (bias, tolerance) = match method {
            Method::Minimum => (of_minimum, 0.0),
            // Its variances are those of noisy values, which are not without light half of the time.
            Method::Unbiased => (0.0, 0.05 * of_minimum.abs()),
            _ => (0.0, 0.0),
        };
        assert!(
            (mean - bias).abs() < 4.0 * standard_error + tolerance,
            "{method:?}: {mean} ± {standard_error}, not {bias}"
        );
    }
}

#[test]
fn two_combs_that_differ_clearly_are_not_corrected() {
    // Rows see 100 σ, columns nothing: the minimum is the column.
    let sigma = DARK.sqrt();
    let curve = NoiseCurve::linear(DARK, 0.0);
    let (row, column) = ([100.0 * sigma], [0.3 * sigma]);
    let mut combs = Photographed::new(1, 1, &[0.0]);
    (combs.rows[0], combs.columns[0]) = (row.to_vec(), column.to_vec());
    let noise = CombNoise { curve: &curve, black: &[0.0], black_variance: &[0.0], scale: 1.0 };
    let combs = Combs { noise: Some(noise), ..combs.combs() };
    assert_eq!(separated(&combs, Method::Unbiased), column);
}

#[test]
fn the_fit_is_unbiased_in_sum_and_the_best_of_all_under_every_light() {
    for (m, black_variance) in [(8, 0.0), (8, DARK), (16, 0.0)] {
        let mut random = Pcg64Mcg::seed_from_u64(2003);
        let lanes = 3000;
        let truth = object(m, lanes, &mut random);
        let noisy = Noisy::new(m, truth, black_variance, &mut random);
        let centre = |square: usize| {
            let (u, v) = ((square % m) as f32 + 0.5, (square / m) as f32 + 0.5);
            ((u - m as f32 / 2.0).powi(2) + (v - m as f32 / 2.0).powi(2)) / (m * m) as f32
        };
        let lights: [(&str, Vec<f32>); 3] = [
            ("uniform", vec![1.0; m * m]),
            ("smooth", (0..m * m).map(|square| (-4.0 * centre(square)).exp()).collect()),
            ("spot", (0..m * m).map(|square| f32::from(u8::from(centre(square) < 0.02))).collect()),
        ];
        let separated: Vec<Vec<f32>> = METHODS.iter().map(|method| separated(&noisy.combs(), *method)).collect();
        for (light, weights) in &lights {
            let of: Vec<_> = separated.iter().map(|squares| moments(&noisy.errors(squares, weights))).collect();
            let (mean, standard_error, rms) = of[3];
            for (method, other) in METHODS.iter().zip(&of).take(3) {
                assert!(rms <= other.2, "{m}, {light}: the fit {rms}, {method:?} {}", other.2);
            }
            if *light == "uniform" {
                assert!(mean.abs() < 4.0 * standard_error, "{m}: {mean} ± {standard_error}");
            }
        }
    }
}

#[test]
fn the_white_frame_counts_by_its_noise() {
    // One white frame against the sums of 24 rows and 24 columns: their mean would have 1/4 · 48 + 1/4 parts of its variance.
    let (m, lanes) = (8, 4000);
    let noisy = Noisy::new(m, vec![0.0; m * m * lanes], 0.0, &mut Pcg64Mcg::seed_from_u64(5));
    let mut combs = noisy.combs();
    let all = vec![1.0; m * m];
    let (_, _, with_white) = moments(&noisy.errors(&separated(&combs, Method::Fitted), &all));
    combs.white = None;
    let (_, _, without) = moments(&noisy.errors(&separated(&combs, Method::Fitted), &all));
    let sigma = f64::from(DARK).sqrt();
    // Rows and columns of a table are weighted by their number: 12.04 variances all in all; with white 1/(1/12.04 + 1).
    let expected = |variances: f64| variances.sqrt() * sigma;
    assert!((without / expected(11.98) - 1.0).abs() < 0.05, "{without}");
    assert!((with_white / expected(1.0 / (1.0 / 11.98 + 1.0)) - 1.0).abs() < 0.05, "{with_white}");
}

#[test]
fn without_any_variance_the_results_are_those_of_exact_photographs_to_the_bit() {
    let (m, lanes) = (8, 200);
    let mut random = Pcg64Mcg::seed_from_u64(7);
    let truth = object(m, lanes, &mut random);
    let mut noisy = Noisy::new(m, truth, 0.0, &mut random);
    noisy.photographed = Photographed::new(m, 3, &noisy.truth);
    noisy.curve = NoiseCurve::linear(0.0, 0.0);
    for method in METHODS {
        let exact = Combs { noise: None, ..noisy.combs() };
        assert_eq!(separated(&noisy.combs(), method), separated(&exact, method), "{method:?}");
    }
}

#[test]
fn the_less_noise_the_nearer_is_the_fit_to_that_of_exact_photographs() {
    let (m, lanes) = (8, 300);
    let mut random = Pcg64Mcg::seed_from_u64(8);
    // Light from everywhere, as in a white bowl, and a bright square among dim ones.
    let bowl = (0..m * m * lanes).map(|_| Distribution::<f32>::sample(&Exp1, &mut random) * 0.01).collect();
    let bright = object(m, lanes, &mut random);
    for (truth, nearest) in [(bowl, 3e-3), (bright, 3e-2)] {
        let photographed = Photographed::new(m, 3, &truth);
        let exact = separated(&photographed.combs(), Method::Fitted);
        let of = |variance: f32| {
            let curve = NoiseCurve::linear(variance, 0.0);
            let zero = vec![0.0; lanes];
            let noise = CombNoise { curve: &curve, black: &zero, black_variance: &zero, scale: 1.0 };
            separated(&Combs { noise: Some(noise), ..photographed.combs() }, Method::Fitted)
        };
        let distance = |squares: &[f32]| {
            let square = |(a, b): (&f32, &f32)| f64::from(a - b).powi(2);
            let energy: f64 = exact.iter().map(|value| f64::from(*value).powi(2)).sum();
            (squares.iter().zip(&exact).map(square).sum::<f64>() / energy).sqrt()
        };
        let distances: Vec<f64> = [1e-5, 1e-7, 1e-9, 1e-11].iter().map(|variance| distance(&of(*variance))).collect();
        assert!(distances.windows(2).all(|pair| pair[1] < pair[0]), "{distances:?}");
        assert!(distances[3] < nearest, "{distances:?}");
        // As exact as numbers are: what is left is rounding.
        let (rounded, sum) = (of(1e-15), |squares: &[f32]| squares.iter().map(|value| f64::from(*value)).sum::<f64>());
        assert!(distance(&rounded) < nearest, "{}", distance(&rounded));
        assert!((sum(&rounded) / sum(&truth) - 1.0).abs() < 1e-4);
    }
}

#[test]
fn no_lane_looks_at_another() {
    let (m, lanes) = (8, 37);
    let mut random = Pcg64Mcg::seed_from_u64(9);
    let truth = object(m, lanes, &mut random);
    let noisy = Noisy::new(m, truth, 1e-7, &mut random);
    let whole = noisy.combs();
    for method in METHODS {
        let together = separated(&whole, method);
        for lane in [0, 5, 36] {
            let cut = |frames: &[Option<&[f32]>]| -> Vec<Vec<f32>> {
                frames.iter().map(|frame| vec![frame.unwrap()[lane]]).collect()
            };
            let (rows, columns) = (cut(&whole.rows), cut(&whole.columns));
            let noise = CombNoise {
                curve: &noisy.curve,
                black: &noisy.black[lane..=lane],
                black_variance: &noisy.black_variance[lane..=lane],
                scale: 1.0,
            };
            let alone = Combs {
                squares: m,
                spacing: 3,
                rows: rows.iter().map(|frame| Some(frame.as_slice())).collect(),
                columns: columns.iter().map(|frame| Some(frame.as_slice())).collect(),
                white: whole.white.map(|white| &white[lane..=lane]),
                noise: Some(noise),
                lanes: 1,
            };
            let expected: Vec<f32> = together.chunks_exact(lanes).map(|square| square[lane]).collect();
            let found = separated(&alone, method);
            assert_eq!(found, expected, "{method:?}, lane {lane}");
        }
    }
}

#[test]
fn lanes_side_by_side_are_fitted_to_the_bits_of_one_after_the_other() {
    for (m, lanes, black_variance) in [(8, 37, 1e-7), (16, 48, 0.0), (3, 1, 1e-7), (5, 17, 0.0)] {
        let mut random = Pcg64Mcg::seed_from_u64(10);
        let truth = object(m, lanes, &mut random);
        let noisy = Noisy::new(m, truth, black_variance, &mut random);
        for noise in [true, false] {
            let mut combs = noisy.combs();
            combs.noise = combs.noise.filter(|_| noise);
            let mut plain = vec![f32::NAN; m * m * lanes];
            separate_fitted_plain(&combs, &mut plain);
            assert_eq!(separated(&combs, Method::Fitted), plain, "{m} squares a side, {lanes} lanes, noise: {noise}");
        }
    }
}
