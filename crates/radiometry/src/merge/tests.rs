//! Claims about merging: nothing clipped leaks, the mean is right, and the variance is the one that is found.

use std::path::Path;

use super::*;
use crate::{Response, ResponseCurve};

fn grey(code: u16) -> Image<Counts> {
    Image::from_pixels(1, 1, vec![[code; 3]])
}

fn linear8() -> Linearization {
    Linearization::new(&Response::Linear, 0, 255)
}

#[test]
fn a_clipped_exposure_never_leaks_into_the_radiance() {
    let (short, long) = (grey(51), grey(255));
    let merged = merge_counts(&[(&long, 8.0), (&short, 0.5)], &linear8(), NoiseModel::default());
    assert!((merged.radiance.pixel(0, 0)[0] - 0.4).abs() < 1e-6);
    assert_eq!(merged.visibility, [Visibility::Seen]);
}

#[test]
fn what_no_exposure_saw_is_marked() {
    let noise = NoiseModel::default();
    let clipped = merge_counts(&[(&grey(255), 8.0), (&grey(255), 0.5)], &linear8(), noise);
    assert_eq!((clipped.radiance.pixel(0, 0), clipped.visibility[0]), ([2.0; 3], Visibility::Clipped));
    let black = merge_counts(&[(&grey(0), 8.0), (&grey(0), 0.5)], &linear8(), noise);
    assert_eq!((black.radiance.pixel(0, 0), black.visibility[0]), ([0.0; 3], Visibility::Black));
}

#[test]
fn the_order_of_the_photographs_does_not_matter() {
    let (a, b, c) = (grey(20), grey(41), grey(160));
    let noise = NoiseModel::default();
    let forward = merge_counts(&[(&a, 0.5), (&b, 1.0), (&c, 4.0)], &linear8(), noise);
    let backward = merge_counts(&[(&c, 4.0), (&b, 1.0), (&a, 0.5)], &linear8(), noise);
    assert_eq!(forward.radiance, backward.radiance);
}

/// A seeded generator of uniform and normal numbers.
struct Noise(u64);

impl Noise {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Box and Muller.
    fn gauss(&mut self) -> f64 {
        (-2.0 * (1.0 - self.uniform()).ln()).sqrt() * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

/// A camera with photon noise, read noise, a response and codes.
struct Camera {
    response: Response,
    black: u16,
    white: u16,
    noise: NoiseModel,
}

impl Camera {
    fn code(&self, channel: usize, exposure: f64, random: &mut Noise) -> u16 {
        let x = exposure + random.gauss() * self.noise.variance(exposure).sqrt();
        let fraction = match &self.response {
            Response::Linear => x,
            Response::Srgb => crate::srgb_encode(x.max(0.0)),
            Response::Curve(curve) => curve.fraction(channel, x),
        };
        let (black, white) = (f64::from(self.black), f64::from(self.white));
        (black + fraction * (white - black)).round().clamp(0.0, white) as u16
    }

    fn shoot(&self, radiance: &[[f64; 3]], width: usize, t: f64, random: &mut Noise) -> Image<Counts> {
        let codes = radiance.iter().map(|pixel| [0, 1, 2].map(|c| self.code(c, pixel[c] * t, random)));
        Image::from_pixels(width, radiance.len() / width, codes.collect())
    }

    fn linearization(&self) -> Linearization {
        Linearization::new(&self.response, self.black, self.white)
    }
}

/// A response that is steep at the foot and flat at the shoulder, like that of a film.
fn film() -> Response {
    let mut text = ResponseCurve::HEADER.to_string();
    for row in 0..=256 {
        let x = f64::from(row) / 256.0;
        let y = x.powf(0.45) * (1.25 - 0.25 * x);
        text += &format!("\n{x},{y},{y},{y}");
    }
    Response::Curve(ResponseCurve::parse(Path::new("film.csv"), &text).unwrap())
}

fn merge_all(shots: &[(Image<Counts>, f64)], camera: &Camera) -> Merged {
    let shots: Vec<_> = shots.iter().map(|(image, t)| (image, *t)).collect();
    merge_counts(&shots, &camera.linearization(), camera.noise)
}

/// Mean and variance.
fn moments(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (mean, values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (n - 1.0))
}

#[test]
fn the_merge_is_unbiased_and_its_variance_is_the_one_that_is_found() {
    let noise = NoiseModel { full_well_electrons: 20_000.0, read_noise_electrons: 6.0 };
    let cameras = [
        ("12 bit, linear", Camera { response: Response::Linear, black: 64, white: 4095, noise }),
        ("14 bit, linear, dark", Camera { response: Response::Linear, black: 512, white: 16383, noise }),
        ("8 bit, film", Camera { response: film(), black: 0, white: 255, noise }),
        ("8 bit, sRGB", Camera { response: Response::Srgb, black: 0, white: 255, noise }),
    ];
    let n = 60_000;
    for (name, camera) in &cameras {
        for (radiance, times) in [
            (0.05, &[2.0, 4.0][..]),
            (0.05, &[0.25, 1.0, 4.0, 16.0, 64.0]),
            (0.0015, &[0.25, 1.0, 4.0, 16.0, 64.0]),
            (0.3, &[1.0]),
        ] {
            // A tenth of spread in the radiance, taken out again, so that rounding to codes is not the same for all.
            let mut random = Noise(11);
            let truth: Vec<_> = (0..n).map(|_| [radiance * (0.95 + 0.1 * random.uniform()); 3]).collect();
            let shots: Vec<_> = times.iter().map(|t| (camera.shoot(&truth, 300, *t, &mut random), *t)).collect();
            let merged = merge_all(&shots, camera);
            let residuals: Vec<f64> = merged
                .radiance
                .pixels()
                .as_flattened()
                .iter()
                .zip(truth.as_flattened())
                .map(|(found, truth)| f64::from(*found) - truth)
                .collect();
            let (bias, found) = moments(&residuals);
            let predicted =
                moments(&merged.variance.as_flattened().iter().map(|v| f64::from(*v)).collect::<Vec<_>>()).0;
            let case = format!("{name}, radiance {radiance}, exposures {times:?}");
            assert!((predicted / found - 1.0).abs() < 0.04, "{case}: predicted {predicted:e}, found {found:e}");
            assert!(bias.abs() < 0.03 * found.sqrt(), "{case}: bias {bias:e} at σ {:e}", found.sqrt());
        }
    }
}

#[test]
fn the_merge_is_better_than_its_best_exposure_by_the_photons_that_it_has_more() {
    let noise = NoiseModel::default();
    let camera = Camera { response: Response::Linear, black: 64, white: 4095, noise };
    let mut random = Noise(7);
    let truth = vec![[0.05; 3]; 20_000];
    let shots: Vec<_> = [2.0, 4.0].map(|t| (camera.shoot(&truth, 200, t, &mut random), t)).into();
    let sigma = |merged: &Merged| {
        let values: Vec<f64> = merged.radiance.pixels().as_flattened().iter().map(|value| f64::from(*value)).collect();
        moments(&values).1.sqrt()
    };
    let ratio = sigma(&merge_all(&shots, &camera)) / sigma(&merge_all(&shots[1..], &camera));
    assert!((ratio - (4.0f64 / 6.0).sqrt()).abs() < 0.02, "σ of both over σ of the better: {ratio}");
}

#[test]
fn linear_photographs_have_the_variance_that_is_found() {
    let noise = NoiseModel { full_well_electrons: 5_000.0, read_noise_electrons: 20.0 };
    let mut random = Noise(3);
    for radiance in [0.0, 0.02, 0.4] {
        let shots = [0.5, 2.0].map(|t| {
            let mut sample = || (radiance * t + random.gauss() * noise.variance(radiance * t).sqrt()) as f32;
            (Image::<Linear>::from_pixels(200, 200, (0..40_000).map(|_| [sample(), sample(), sample()]).collect()), t)
        });
        let merged = merge_linear(&[(&shots[0].0, 0.5), (&shots[1].0, 2.0)], noise);
        let values: Vec<f64> = merged.radiance.pixels().as_flattened().iter().map(|value| f64::from(*value)).collect();
        let (mean, found) = moments(&values);
        let predicted = moments(&merged.variance.as_flattened().iter().map(|v| f64::from(*v)).collect::<Vec<_>>()).0;
        assert!((mean - radiance).abs() < 4.0 * (found / values.len() as f64).sqrt(), "mean {mean} at {radiance}");
        // At zero the radiance below it has no photon noise, and above it seems to have some.
        let allowed = if radiance == 0.0 { 0.15 } else { 0.03 };
        assert!((predicted / found - 1.0).abs() < allowed, "at {radiance}: predicted {predicted:e}, found {found:e}");
    }
}

/// A scene with four decades of radiance, a lamp and a black corner.
fn scene(width: usize, height: usize) -> Vec<[f64; 3]> {
    let mut random = Noise(5);
    let radiance = |x: usize, y: usize, c: usize| {
        let (u, v) = (x as f64 / width as f64, y as f64 / height as f64);
        let lamp = if (u - 0.7).hypot(v - 0.3) < 0.08 { 300.0 } else { 0.0 };
        let base = if u < 0.1 && v < 0.1 { 0.0 } else { 10f64.powf(-3.0 + 3.5 * u) };
        base * [1.0, 0.8, 0.5][c] * (0.7 + 0.6 * v) + lamp
    };
    let pixels = (0..width * height).map(|i| [0, 1, 2].map(|c| radiance(i % width, i / width, c)));
    pixels.map(|pixel| pixel.map(|value| value * (0.9 + 0.2 * random.uniform()))).collect()
}

#[test]
fn the_fast_merge_agrees_with_the_plain_one() {
    let noise = NoiseModel::default();
    let mut both = Vec::new();
    for (camera, times) in [
        (Camera { response: Response::Srgb, black: 0, white: 255, noise }, &[1.0 / 64.0, 0.125, 1.0, 8.0, 64.0][..]),
        (Camera { response: Response::Linear, black: 100, white: 4000, noise }, &[3e-7, 3e-5, 3e-3]),
        (Camera { response: film(), black: 0, white: 65535, noise }, &[0.5]),
    ] {
        // Odd sizes, so that blocks and bands end where they like.
        let (width, height) = (331, 217);
        let mut random = Noise(9);
        let scale = 1.0 / times[0] / 64.0;
        let truth: Vec<_> = scene(width, height).iter().map(|pixel| pixel.map(|value| value * scale)).collect();
        let shots: Vec<_> = times.iter().map(|t| (camera.shoot(&truth, width, *t, &mut random), *t)).collect();
        let shots: Vec<_> = shots.iter().map(|(image, t)| (image, *t)).collect();
        let camera = camera.linearization();
        let disagreement = Disagreement::measure(&shots, &camera, noise);
        both.push((merge_counts(&shots, &camera, noise), merge_counts_plain(&shots, &camera, noise)));
        both.push((
            merge_counts_disagreeing(&shots, &camera, noise, &disagreement),
            merge_counts_disagreeing_plain(&shots, &camera, noise, &disagreement),
        ));
    }
    for (fast, plain) in both {
        assert_eq!(fast.visibility, plain.visibility);
        // Whether a sample is too bright by two standard deviations may turn on the last digit of single precision.
        let (a, b): (f64, f64) = (fast.used.iter().sum(), plain.used.iter().sum());
        assert!((a - b).abs() < 1e-4, "used {:?} and {:?}", fast.used, plain.used);
        let mut another_decision = 0;
        assert!(plain.visibility.contains(&Visibility::Clipped) && plain.visibility.contains(&Visibility::Seen));
        // Single precision, a few roundings a sum.
        let close = |a: f32, b: f32| a == b || (a - b).abs() <= 3e-6 * b.abs().max(a.abs());
        let samples = |merged: &Merged| {
            let radiance = merged.radiance.pixels().as_flattened().to_vec();
            radiance.into_iter().zip(merged.variance.as_flattened().to_vec()).collect::<Vec<_>>()
        };
        for ((radiance, variance), (of_plain, plain_variance)) in samples(&fast).into_iter().zip(samples(&plain)) {
            if !close(variance, plain_variance) {
                another_decision += 1;
                continue;
            }
            let near = (radiance - of_plain).abs() <= 1e-5 * plain_variance.sqrt();
            assert!(close(radiance, of_plain) || near, "radiance {radiance} and {of_plain}");
        }
        assert!(another_decision <= 10, "{another_decision} samples were decided otherwise");
    }
}

#[test]
fn five_noisy_photographs_of_8_bits_give_the_radiance_within_a_percent_and_a_half() {
    let noise = NoiseModel { full_well_electrons: 20_000.0, read_noise_electrons: 6.0 };
    let camera = Camera { response: film(), black: 0, white: 255, noise };
    let (width, height) = (400, 300);
    let truth = scene(width, height);
    let mut random = Noise(21);
    let times = [1.0 / 32.0, 0.25, 2.0, 16.0, 128.0];
    let shots: Vec<_> = times.iter().map(|t| (camera.shoot(&truth, width, *t, &mut random), *t)).collect();
    let merged = merge_all(&shots, &camera);
    let mut errors: Vec<f64> = (0..width * height)
        .filter(|i| merged.visibility[*i] == Visibility::Seen)
        .flat_map(|i| [0, 1, 2].map(|c| (f64::from(merged.radiance.pixels()[i][c]) / truth[i][c] - 1.0).abs()))
        .collect();
    assert!(errors.len() > 3 * width * height * 9 / 10, "{} samples seen", errors.len());
    errors.sort_by(f64::total_cmp);
    let (median, p95) = (errors[errors.len() / 2], errors[errors.len() * 95 / 100]);
    assert!(median <= 0.015 && p95 <= 0.05, "median error {median}, 95th percentile {p95}");
}

/// Median and 95th percentile of the relative error where something was seen.
fn relative_errors(merged: &Merged, truth: &[[f64; 3]]) -> [f64; 2] {
    let pixels = merged.radiance.pixels().iter().zip(truth).zip(&merged.visibility);
    let mut errors: Vec<f64> = pixels
        .filter(|(_, seen)| **seen == Visibility::Seen)
        .flat_map(|((found, truth), _)| [0, 1, 2].map(|c| (f64::from(found[c]) / truth[c] - 1.0).abs()))
        .collect();
    errors.sort_by(f64::total_cmp);
    [errors[errors.len() / 2], errors[errors.len() * 95 / 100]]
}

#[test]
fn codes_at_which_photographs_disagree_count_less() {
    let noise = NoiseModel { full_well_electrons: 20_000.0, read_noise_electrons: 6.0 };
    let camera = Camera { response: film(), black: 0, white: 255, noise };
    let (width, height) = (400, 300);
    let truth = scene(width, height);
    let mut random = Noise(22);
    let times = [1.0 / 8.0, 0.5, 2.0, 8.0, 32.0];
    let mut shots: Vec<_> = times.iter().map(|t| (camera.shoot(&truth, width, *t, &mut random), *t)).collect();
    let linearization = camera.linearization();
    let merge = |shots: &[(Image<Counts>, f64)]| {
        let shots: Vec<_> = shots.iter().map(|(image, t)| (image, *t)).collect();
        let disagreement = Disagreement::measure(&shots, &linearization, noise);
        let disagreeing = merge_counts_disagreeing(&shots, &linearization, noise, &disagreement);
        [merge_counts(&shots, &linearization, noise), disagreeing].map(|merged| relative_errors(&merged, &truth))
    };
    // Where the model is right, nothing is lost.
    let [model, disagreeing] = merge(&shots);
    let close = |a: f64, b: f64| a < 1.05 * b;
    assert!(close(disagreeing[0], model[0]) && close(disagreeing[1], model[1]), "{disagreeing:?} instead of {model:?}");
    // A scanner that shows the shoulder of the film darker than it is.
    for code in shots.iter_mut().flat_map(|(image, _)| image.pixels_mut()).flat_map(|pixel| pixel.iter_mut()) {
        *code = if (190..255).contains(code) { *code - (*code - 190) / 3 } else { *code };
    }
    let [model, disagreeing] = merge(&shots);
    // Where some other code tells, it is believed; where none does, nothing is lost.
    let (median, p95) = (disagreeing[0] / model[0], disagreeing[1] / model[1]);
    assert!(median < 1.03 && p95 < 0.75, "{disagreeing:?} instead of {model:?}");
}

#[test]
fn the_variance_stays_that_which_is_found_where_photographs_agree() {
    let noise = NoiseModel { full_well_electrons: 20_000.0, read_noise_electrons: 6.0 };
    let camera = Camera { response: Response::Linear, black: 0, white: 4095, noise };
    let (width, height) = (300, 300);
    // No exposure clips: what touches a clipped pixel is judged by itself.
    let level = |i: usize| 0.004 * 1.6f64.powi((i % 10) as i32);
    let truth: Vec<_> = (0..width * height).map(|i| [level(i); 3]).collect();
    let mut random = Noise(23);
    let shots: Vec<_> = [0.2, 0.8, 3.2].map(|t| (camera.shoot(&truth, width, t, &mut random), t)).into();
    let shots: Vec<_> = shots.iter().map(|(image, t)| (image, *t)).collect();
    let linearization = camera.linearization();
    let disagreement = Disagreement::measure(&shots, &linearization, noise);
    let merged = merge_counts_disagreeing(&shots, &linearization, noise, &disagreement);
    let model = merge_counts(&shots, &linearization, noise);
    for at in 0..10 {
        let of_level = || (at..width * height).step_by(10);
        let found: Vec<f64> = of_level().map(|i| f64::from(merged.radiance.pixels()[i][1])).collect();
        let (mean, variance) = moments(&found);
        let said = of_level().map(|i| f64::from(merged.variance[i][1])).sum::<f64>() / found.len() as f64;
        let of_model: Vec<f64> = of_level().map(|i| f64::from(model.radiance.pixels()[i][1])).collect();
        let (ratio, lost) = (said / variance, variance / moments(&of_model).1);
        assert!(lost < 1.06, "radiance {mean}: {lost} times the variance of the model's weights");
        assert!((0.9..1.25).contains(&ratio), "radiance {mean}: variance {said:e} said, {variance:e} found");
    }
}

#[test]
fn what_moves_in_a_small_part_of_the_picture_does_not_count_as_disagreement() {
    let camera = linear8();
    let (width, height) = (200, 100);
    let shot = |t: f64, at: usize| {
        let brighter = |i: usize| if (at..at + 20).contains(&(i % width)) { 1.5 } else { 1.0 };
        let code = |i: usize| brighter(i) * (0.2 + 0.001 * (i / width) as f64);
        let codes = (0..width * height).map(|i| [(code(i) * t * 255.0 + 0.5 * (i % 3) as f64).round() as u16; 3]);
        Image::<Counts>::from_pixels(width, height, codes.collect())
    };
    let still = [(shot(1.0, 50), 1.0), (shot(2.0, 50), 2.0), (shot(0.5, 50), 0.5)];
    let moving = [(shot(1.0, 50), 1.0), (shot(2.0, 110), 2.0), (shot(0.5, 140), 0.5)];
    let [still, moving] = [still, moving].map(|shots| {
        let shots: Vec<_> = shots.iter().map(|(image, t)| (image, *t)).collect();
        let found = Disagreement::measure(&shots, &camera, NoiseModel::default());
        [53, 64, 75, 106, 128, 148].map(|code| found.share(0, code).sqrt())
    });
    for (still, moving) in still.iter().zip(moving) {
        assert!(moving < 0.02 && (moving - still).abs() < 0.01, "{moving} instead of {still}");
    }
}

#[test]
fn light_that_spills_from_a_clipped_pixel_is_left_out() {
    // A wall of 0.1 and a lamp; in the long exposure the lamp's charge spills into the columns beside it.
    let camera = linear8();
    let (width, height) = (9, 5);
    let shot = |t: f64, spill: u16| {
        let code = |x: usize| match x {
            4 => 255,
            3 | 5 => (0.1 * t * 255.0f64).round() as u16 + spill,
            _ => (0.1 * t * 255.0f64).round() as u16,
        };
        Image::<Counts>::from_pixels(width, height, (0..width * height).map(|i| [code(i % width); 3]).collect())
    };
    let (short, long) = (shot(1.0, 0), shot(4.0, 60));
    let merged = merge_counts(&[(&short, 1.0), (&long, 4.0)], &camera, NoiseModel::default());
    for x in [0, 1, 2, 3, 5, 6, 7, 8] {
        let found = merged.radiance.pixel(x, 2)[0];
        assert!((found - 0.1).abs() < 0.003, "column {x}: {found}");
    }
    // What does not read too bright is not thrown away: an edge against a clipped window keeps its long exposure.
    let clean = shot(4.0, 0);
    let merged = merge_counts(&[(&short, 1.0), (&clean, 4.0)], &camera, NoiseModel::default());
    let (beside, away) = (merged.variance[2 * width + 3][0], merged.variance[2 * width][0]);
    assert!(beside == away, "variance beside the lamp {beside:e}, away from it {away:e}");
}

#[test]
fn between_black_and_clipped_nothing_is_invented() {
    let merged = merge_counts(&[(&grey(0), 0.5), (&grey(255), 8.0)], &linear8(), NoiseModel::default());
    assert_eq!((merged.radiance.pixel(0, 0), merged.visibility[0]), ([0.125; 3], Visibility::Clipped));
    assert_eq!(merged.variance[0], [f32::INFINITY; 3]);
    assert_eq!(merged.used, [0.0, 0.0]);
}

#[test]
fn the_share_that_was_used_of_a_photograph_is_told_in_the_order_given() {
    let mixed = Image::<Counts>::from_pixels(2, 1, vec![[255; 3], [100; 3]]);
    let merged = merge_counts(&[(&mixed, 4.0), (&grey2(25), 1.0)], &linear8(), NoiseModel::default());
    assert_eq!(merged.used, [0.5, 1.0]);
}

fn grey2(code: u16) -> Image<Counts> {
    Image::from_pixels(2, 1, vec![[code; 3]; 2])
}

#[test]
fn nominal_exposures_are_refined_to_what_they_were() {
    let noise = NoiseModel::default();
    let camera = Camera { response: film(), black: 0, white: 255, noise };
    let (width, height) = (300, 200);
    let mut truth = scene(width, height);
    let mut random = Noise(31);
    let nominal = [1.0 / 60.0, 0.25, 1.0, 4.0, 13.0];
    let real = [1.0 / 64.0, 0.25, 1.0, 4.0, 12.7];
    let mut shots = Vec::new();
    for (nominal, real) in nominal.into_iter().zip(real) {
        // Something moves: a part of the scene is another in every photograph.
        for pixel in &mut truth[..width * height / 20] {
            *pixel = [0.05 + random.uniform(); 3];
        }
        shots.push((camera.shoot(&truth, width, real, &mut random), nominal));
    }
    let shots: Vec<_> = shots.iter().map(|(image, t)| (image, *t)).collect();
    let refined = refine_exposures(&shots, &camera.linearization());
    for (i, ratio) in refined.ratios.iter().enumerate() {
        let truth = real[i + 1] / real[i];
        assert!((ratio.refined / truth - 1.0).abs() < 0.003, "{i}: {ratio:?}, really {truth}");
        assert!(ratio.samples > 1000 && ratio.relative_error < 0.002, "{ratio:?}");
    }
    let product = |exposures: &[f64]| exposures.iter().map(|t| t.ln()).sum::<f64>();
    assert!((product(&refined.exposures) - product(&nominal)).abs() < 1e-9, "the scale has moved");
}

#[test]
fn a_ratio_that_nothing_shows_stays_nominal() {
    let refined = refine_exposures(&[(&grey(0), 0.5), (&grey(255), 8.0)], &linear8());
    assert_eq!(refined.exposures, [0.5, 8.0]);
    assert_eq!(refined.ratios[0].samples, 0);
}
