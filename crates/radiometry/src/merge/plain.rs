//! One sample after the other, in double precision: what the fast version is held against, and what it asks where no exposure
//! of a pixel is safe.

use super::{Disagreement, Merged, NoiseModel, Stack, Visibility, of_pixel};
use crate::{Counts, Image, Linearization};

/// As [`merge_counts`](crate::merge_counts), plainly.
///
/// # Panics
/// If there is no photograph or their sizes differ.
pub fn merge_counts_plain(photographs: &[(&Image<Counts>, f64)], camera: &Linearization, noise: NoiseModel) -> Merged {
    merge(&Stack::new(photographs, camera, noise))
}

/// As [`merge_counts_disagreeing`](crate::merge_counts_disagreeing), plainly.
///
/// # Panics
/// If there is no photograph or their sizes differ.
pub fn merge_counts_disagreeing_plain(
    photographs: &[(&Image<Counts>, f64)],
    camera: &Linearization,
    noise: NoiseModel,
    disagreement: &Disagreement,
) -> Merged {
    merge(&Stack { disagreement: Some(disagreement), ..Stack::new(photographs, camera, noise) })
}

fn merge(stack: &Stack<'_>) -> Merged {
    let mut used = vec![0; stack.exposures.len()];
    let samples = (0..stack.width * stack.height).map(|pixel| stack.pixel(pixel, &mut used));
    let (mut radiance, mut variance, mut visibility) = (Vec::new(), Vec::new(), Vec::new());
    for [r, g, b] in samples {
        radiance.push([r, g, b].map(|sample| sample.radiance as f32));
        variance.push([r, g, b].map(|sample| sample.variance as f32));
        visibility.push(of_pixel([r, g, b].map(|sample| sample.visibility)));
    }
    let radiance = Image::from_pixels(stack.width, stack.height, radiance);
    Merged { radiance, variance, visibility, used: stack.shares(&used) }
}

/// One channel of one pixel.
#[derive(Clone, Copy)]
pub(super) struct Sample {
    pub(super) radiance: f64,
    pub(super) variance: f64,
    pub(super) visibility: Visibility,
}

/// A pixel reads too bright beside a clipped one if it is this many standard deviations above the shorter exposures.
pub(super) const BLOOMING_SIGMAS: f64 = 2.0;

impl Stack<'_> {
    /// Merges a pixel and counts in `used` which exposures entered.
    pub(super) fn pixel(&self, pixel: usize, used: &mut [u64]) -> [Sample; 3] {
        let near: Vec<bool> = (0..self.exposures.len()).map(|i| i > 0 && self.touches_clipped(i, pixel)).collect();
        std::array::from_fn(|channel| self.sample(pixel, channel, &near, used))
    }

    /// Whether one of the pixels around this one is clipped in an exposure, in any channel.
    fn touches_clipped(&self, exposure: usize, pixel: usize) -> bool {
        let (x, y) = (pixel % self.width, pixel / self.width);
        let counts = self.exposures[exposure].counts;
        let rows = y.saturating_sub(1)..(y + 2).min(self.height);
        let columns = x.saturating_sub(1)..(x + 2).min(self.width);
        rows.flat_map(|row| &counts[row * self.width..][columns.clone()])
            .any(|counts| counts.iter().any(|code| *code >= self.camera.white_level()))
    }

    fn sample(&self, pixel: usize, channel: usize, near_clipped: &[bool], used: &mut [u64]) -> Sample {
        let code = |i: usize| self.exposures[i].counts[pixel][channel];
        let t = |i: usize| self.exposures[i].t;
        let relative = |i: usize| f64::from(self.camera.exposure(channel, code(i)));
        let rounding = |i: usize| f64::from(self.camera.step(channel, code(i))).powi(2) / 12.0;
        let variance = |radiance: f64, i: usize| self.noise.variance(radiance * t(i)) + rounding(i);

        let (mut light, mut time) = (0.0f64, 0.0f64);
        let mut entering: Vec<usize> = Vec::with_capacity(self.exposures.len());
        for i in (0..self.exposures.len()).filter(|i| self.is_safe(code(*i))) {
            if near_clipped[i] && time > 0.0 {
                let shorter = (light / time).max(0.0);
                let of_shorter = entering.iter().map(|j| variance(shorter, *j)).sum::<f64>() / (time * time);
                let sigma = (variance(shorter, i) + of_shorter * t(i) * t(i)).sqrt();
                if relative(i) - shorter * t(i) > BLOOMING_SIGMAS * sigma {
                    continue;
                }
            }
            entering.push(i);
            light += relative(i);
            time += t(i);
        }
        if entering.is_empty() {
            return self.unsafe_sample(pixel, channel, used);
        }
        let first = (light / time).max(0.0);
        let (mut sum, mut weights, mut spread) = (0.0, 0.0, 0.0);
        for i in entering.iter().copied() {
            let (foreseen, found) = (variance(first, i), self.found(channel, code(i), first * t(i)));
            let weight = t(i) * t(i) / (foreseen + found);
            sum += weight * relative(i) / t(i);
            weights += weight;
            spread += weight * weight * foreseen.max(found) / (t(i) * t(i));
            used[i] += 1;
        }
        let black = entering.iter().all(|i| code(*i) <= self.camera.black_level());
        let visibility = if black { Visibility::Black } else { Visibility::Seen };
        Sample { radiance: sum / weights, variance: spread / (weights * weights), visibility }
    }

    /// The variance of a relative exposure that photographs were found to differ by.
    fn found(&self, channel: usize, code: u16, relative_exposure: f64) -> f64 {
        let share = self.disagreement.map_or(0.0, |disagreement| disagreement.share(channel, code));
        f64::from(share) * relative_exposure * relative_exposure
    }

    /// Where every exposure is at the floor or near white: the longest that is not clipped.
    pub(super) fn unsafe_sample(&self, pixel: usize, channel: usize, used: &mut [u64]) -> Sample {
        let code = |i: usize| self.exposures[i].counts[pixel][channel];
        let unclipped = (0..self.exposures.len()).rfind(|i| code(*i) < self.camera.white_level());
        let clipped_from = unclipped.map_or(0, |i| i + 1);
        match unclipped {
            // At the floor here and clipped in the next: somewhere between.
            Some(i) if code(i) > 0 || clipped_from == self.exposures.len() => {
                let t = self.exposures[i].t;
                let exposure = f64::from(self.camera.exposure(channel, code(i)));
                let rounding = f64::from(self.camera.step(channel, code(i))).powi(2) / 12.0;
                let variance = (self.noise.variance(exposure) + rounding) / (t * t);
                let black = code(i) <= self.camera.black_level();
                used[i] += 1;
                let visibility = if black { Visibility::Black } else { Visibility::Seen };
                Sample { radiance: exposure / t, variance, visibility }
            }
            _ => {
                let radiance = 1.0 / self.exposures[clipped_from].t;
                Sample { radiance, variance: f64::INFINITY, visibility: Visibility::Clipped }
            }
        }
    }
}
