//! How far exposures are off from what they show together: what no model of noise foresees.
//!
//! The variance of counts is that of an ideal sensor with a known response. Scanned film, glare of the lens round a bright
//! window, a response that was guessed where no photograph tells, move a code by more, and all photographs of a bracket show by how
//! much: by code, the typical difference of one exposure from what all show of the pixel. Weights then follow what was
//! foreseen and what was found together.
//!
//! Where the model is right, the two are about equal at every code and the weights stay. The difference is a median, so that what
//! moved between the photographs, as long as it is the smaller part, does not enter.

use super::plain::Sample;
use super::{NoiseModel, Stack, Visibility};
use crate::{Counts, Image, Linearization};

/// Codes are told apart by the exposure they stand for: so many bins an octave, from the largest exposure down.
const BINS_AN_OCTAVE: f32 = 16.0;
/// 24 octaves; the last bin takes all below.
const BINS: usize = 385;
/// A bin takes its neighbours' samples, two on each side at least, and more until it has so many.
const NEIGHBOURS: usize = 2;
const ENOUGH: usize = 64;
/// Pixels that are asked, about: a regular grid.
const PIXELS: usize = 20_000;
/// First against the merge by the model alone, then against one that knows the first answer.
const ROUNDS: usize = 2;
/// The median of |x| of a normal distribution, in standard deviations.
const MEDIAN: f32 = 0.674_489_8;

/// By channel and code: the variance of an exposure from what all show, as a share of its square; 0 to about 9.
#[derive(Clone, Debug, PartialEq)]
pub struct Disagreement {
    shares: [Vec<f32>; 3],
}

impl Disagreement {
    /// Measures it in the photographs that are to be merged, each with its exposure t > 0. Nothing is found in one alone.
    ///
    /// # Panics
    /// If there is no photograph or their sizes differ.
    pub fn measure(photographs: &[(&Image<Counts>, f64)], camera: &Linearization, noise: NoiseModel) -> Self {
        let codes = usize::from(camera.white_level()) + 1;
        let mut found = Self { shares: std::array::from_fn(|_| vec![0.0; codes]) };
        if photographs.len() > 1 {
            for _ in 0..ROUNDS {
                let stack = Stack { disagreement: Some(&found), ..Stack::new(photographs, camera, noise) };
                let shares = found.of(&stack);
                found.shares = shares;
            }
        }
        found
    }

    /// Variance at a code, as a share of the square of the exposure.
    pub(super) fn share(&self, channel: usize, code: u16) -> f32 {
        let shares = &self.shares[channel];
        shares[usize::from(code).min(shares.len() - 1)]
    }

    /// The standard deviation of an exposure at the middle code, as a share of it, by channel.
    pub fn at_middle(&self) -> [f32; 3] {
        std::array::from_fn(|channel| self.shares[channel][self.shares[channel].len() / 2].sqrt())
    }

    fn of(&self, stack: &Stack<'_>) -> [Vec<f32>; 3] {
        let mut bins: [Vec<Vec<f32>>; 3] = std::array::from_fn(|_| vec![Vec::new(); BINS]);
        let mut used = vec![0; stack.exposures.len()];
        let apart = ((stack.width * stack.height) as f64 / PIXELS as f64).sqrt().ceil().max(1.0) as usize;
        let rows = (apart / 2..stack.height).step_by(apart);
        for pixel in rows.flat_map(|y| (apart / 2..stack.width).step_by(apart).map(move |x| y * stack.width + x)) {
            for (channel, together) in stack.pixel(pixel, &mut used).iter().enumerate() {
                let Sample { radiance, visibility: Visibility::Seen, .. } = together else { continue };
                for exposed in &stack.exposures {
                    let code = exposed.counts[pixel][channel];
                    let (alone, together) = (stack.camera.exposure(channel, code) as f64, radiance * exposed.t);
                    if stack.is_safe(code) && alone + together > 0.0 {
                        // Twice the difference over the sum: bounded on both sides, and for small ones the logarithm's.
                        let off = 2.0 * (alone - together).abs() / (alone + together);
                        bins[channel][bin(alone as f32)].push(off as f32);
                    }
                }
            }
        }
        std::array::from_fn(|channel| {
            let shares: Vec<f32> = (0..BINS).map(|bin| (median_around(&bins[channel], bin) / MEDIAN).powi(2)).collect();
            (0..=stack.camera.white_level()).map(|code| shares[bin(stack.camera.exposure(channel, code))]).collect()
        })
    }
}

/// The bin of a relative exposure.
fn bin(exposure: f32) -> usize {
    if exposure > 0.0 { ((-exposure.log2()).max(0.0) * BINS_AN_OCTAVE) as usize } else { BINS }.min(BINS - 1)
}

/// The median of what a bin and its neighbours hold; 0 of nothing.
fn median_around(bins: &[Vec<f32>], bin: usize) -> f32 {
    let around = |reach: usize| bin.saturating_sub(reach)..(bin + reach + 1).min(bins.len());
    let number = |reach: &usize| bins[around(*reach)].iter().map(Vec::len).sum::<usize>() >= ENOUGH;
    let reach = (NEIGHBOURS..bins.len()).find(number).unwrap_or(bins.len());
    let mut all: Vec<f32> = bins[around(reach)].iter().flatten().copied().collect();
    if all.is_empty() {
        return 0.0;
    }
    let middle = all.len() / 2;
    *all.select_nth_unstable_by(middle, f32::total_cmp).1
}
