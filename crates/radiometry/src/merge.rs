//! Several exposures of one view merged into radiance (§4.2).
//!
//! Each exposure estimates the radiance as X/t, X its relative exposure and t its exposure. The estimates are averaged
//! with weights 1/variance, the variance that of counts: photon noise, read noise and the rounding to codes. The variance
//! of all exposures is taken at one common first estimate: weights that follow each exposure's own noise would prefer the
//! ones that came out dark. Clipped pixels never enter; black ones only where no exposure saw more.

use rayon::prelude::*;

use crate::{Counts, Image, Linear, Linearization, Radiance};

/// The noise of a sensor, for weights only: they are forgiving, near-optimal without calibrating the camera
/// (Hanji, Zhong, Mantiuk 2020).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseModel {
    /// Electrons at relative exposure 1.
    pub full_well_electrons: f64,
    /// Standard deviation of a pixel without light, electrons.
    pub read_noise_electrons: f64,
}

impl Default for NoiseModel {
    /// A common camera: 40,000 electrons full well, 6 electrons read noise.
    fn default() -> Self {
        Self { full_well_electrons: 40_000.0, read_noise_electrons: 6.0 }
    }
}

/// What the exposures together saw of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Visibility {
    /// At least one exposure measured every channel.
    #[default]
    Seen = 0,
    /// A channel is clipped in every exposure: the radiance is a lower bound.
    Clipped = 1,
    /// A channel is at or below black in every exposure: the radiance is zero within noise.
    Black = 2,
}

/// Radiance merged from exposures.
#[derive(Clone, Debug)]
pub struct Merged {
    /// Radiance; where clipped, the lower bound that the shortest exposure gives.
    pub radiance: Image<Radiance>,
    /// What was seen of each pixel, row-major.
    pub visibility: Vec<Visibility>,
}

/// Counts closer to white than this share of the code range may be clipped by noise; a shorter exposure is preferred.
const NEAR_WHITE: f64 = 0.02;
/// Pixels that one task merges.
const CHUNK: usize = 4096;

/// Merges photographs of camera counts, each with its exposure t > 0 (seconds · iso/100 / f²).
///
/// # Panics
/// If there is no photograph or their sizes differ.
pub fn merge_counts(photographs: &[(&Image<Counts>, f64)], camera: &Linearization, noise: NoiseModel) -> Merged {
    let (width, height) = photographs[0].0.size();
    assert!(photographs.iter().all(|(image, _)| image.size() == (width, height)), "exposures differ in size");
    let mut by_exposure: Vec<(&[[u16; 3]], f64)> = photographs.iter().map(|(image, t)| (image.pixels(), *t)).collect();
    by_exposure.sort_by(|a, b| a.1.total_cmp(&b.1));
    let merger = Merger {
        stack: by_exposure,
        camera,
        near_white: camera.white_level()
            - (f64::from(camera.white_level() - camera.black_level()) * NEAR_WHITE).ceil() as u16,
        shot: 1.0 / noise.full_well_electrons,
        read: (noise.read_noise_electrons / noise.full_well_electrons).powi(2),
    };
    let mut radiance = vec![[0.0; 3]; width * height];
    let mut visibility = vec![Visibility::Seen; width * height];
    let chunks = radiance.par_chunks_mut(CHUNK).zip(visibility.par_chunks_mut(CHUNK));
    chunks.enumerate().for_each(|(chunk, (pixels, seen))| {
        for (index, (pixel, seen)) in pixels.iter_mut().zip(seen).enumerate() {
            for (channel, value) in pixel.iter_mut().enumerate() {
                let (merged, visible) = merger.channel(chunk * CHUNK + index, channel);
                *value = merged as f32;
                if visible == Visibility::Clipped || *seen == Visibility::Seen {
                    *seen = visible;
                }
            }
        }
    });
    Merged { radiance: Image::from_pixels(width, height, radiance), visibility }
}

struct Merger<'a> {
    /// Shortest exposure first.
    stack: Vec<(&'a [[u16; 3]], f64)>,
    camera: &'a Linearization,
    near_white: u16,
    shot: f64,
    read: f64,
}

impl Merger<'_> {
    fn channel(&self, index: usize, channel: usize) -> (f64, Visibility) {
        let code = |exposure: usize| self.stack[exposure].0[index][channel];
        let relative = |exposure: usize| f64::from(self.camera.exposure(channel, code(exposure)));
        let t = |exposure: usize| self.stack[exposure].1;
        if code(0) >= self.camera.white_level() {
            return (1.0 / t(0), Visibility::Clipped);
        }
        // Exposures safely below white; the shortest one counts whatever its margin.
        let mut end = 1;
        while end < self.stack.len() && code(end) < self.near_white {
            end += 1;
        }
        // Of these, the dark ones say nothing that a brighter one does not say better.
        let mut start = 0;
        while start < end && code(start) <= self.camera.black_level() {
            start += 1;
        }
        if start == end {
            return (relative(end - 1) / t(end - 1), Visibility::Black);
        }
        if start + 1 == end {
            return (relative(start) / t(start), Visibility::Seen);
        }
        // First estimate: all electrons over all time.
        let (light, time) = (start..end).fold((0.0, 0.0), |(light, time), i| (light + relative(i), time + t(i)));
        let first = (light / time).max(0.0);
        let (mut sum, mut weights) = (0.0, 0.0);
        for i in start..end {
            let step = f64::from(self.camera.step(channel, code(i)));
            let variance = first * t(i) * self.shot + self.read + step * step / 12.0;
            let weight = t(i) * t(i) / variance;
            sum += weight * relative(i) / t(i);
            weights += weight;
        }
        (sum / weights, Visibility::Seen)
    }
}

/// Merges linear float photographs, each with its exposure t > 0: all light over all time, the weights of photon noise.
/// Floats do not say where they clip, so every pixel counts as seen.
///
/// # Panics
/// If there is no photograph or their sizes differ.
pub fn merge_linear(photographs: &[(&Image<Linear>, f64)]) -> Merged {
    let (width, height) = photographs[0].0.size();
    let mut sum = Image::<Linear>::black(width, height);
    let total: f64 = photographs.iter().map(|(_, t)| t).sum();
    for (image, _) in photographs {
        sum.add_scaled(image, [(1.0 / total) as f32; 3]);
    }
    Merged { radiance: sum.reinterpret(), visibility: vec![Visibility::Seen; width * height] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Response;

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
    fn the_merge_is_unbiased_and_better_than_its_best_exposure() {
        // A linear 12-bit camera with photon noise at radiance 0.05: X = 0.1 and 0.2 at t = 2 and 4.
        let mut state = 7u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        let mut gauss = || (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
        let camera = Linearization::new(&Response::Linear, 64, 4095);
        let n = 20_000;
        let full_well = 40_000.0;
        let mut shoot = |t: f64| {
            let pixels = (0..n)
                .map(|_| {
                    let electrons = 0.05 * t * full_well + gauss() * (0.05 * t * full_well + 36.0).sqrt();
                    [(64.0 + electrons / full_well * 4031.0).round() as u16; 3]
                })
                .collect();
            Image::<Counts>::from_pixels(n, 1, pixels)
        };
        let (a, b) = (shoot(2.0), shoot(4.0));
        let spread = |merged: &Merged| {
            let values: Vec<f64> = merged.radiance.pixels().iter().map(|pixel| f64::from(pixel[0])).collect();
            let mean = values.iter().sum::<f64>() / n as f64;
            (mean, (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / n as f64).sqrt())
        };
        let (mean, sigma) = spread(&merge_counts(&[(&a, 2.0), (&b, 4.0)], &camera, NoiseModel::default()));
        let (_, best) = spread(&merge_counts(&[(&b, 4.0)], &camera, NoiseModel::default()));
        // Three standard errors of the mean; photon noise alone predicts σ smaller by √(4/6).
        assert!((mean - 0.05).abs() < 3.0 * sigma / (n as f64).sqrt() + 1e-6, "mean {mean}");
        assert!((sigma / best - (4.0f64 / 6.0).sqrt()).abs() < 0.03, "σ {sigma} against {best}");
    }

    #[test]
    fn the_order_of_the_photographs_does_not_matter() {
        let (a, b, c) = (grey(20), grey(41), grey(160));
        let noise = NoiseModel::default();
        let forward = merge_counts(&[(&a, 0.5), (&b, 1.0), (&c, 4.0)], &linear8(), noise);
        let backward = merge_counts(&[(&c, 4.0), (&b, 1.0), (&a, 0.5)], &linear8(), noise);
        assert_eq!(forward.radiance, backward.radiance);
    }
}
