//! Several exposures of one view merged into radiance (§4.2), with the variance of every sample.
//!
//! Each exposure estimates the radiance as X/t, X its relative exposure and t its exposure. The estimates are averaged
//! with weights 1/variance, the variance that of counts: photon noise, read noise and the rounding to codes, which the
//! slope of the inverse response carries from codes to exposure. The variance of all exposures is taken at one common
//! first estimate, all light over all time: weights that follow each exposure's own noise would prefer the ones that came
//! out dark. So weighted the merge is near-optimal without calibrating the camera (P. Hanji, F. Zhong, R. K. Mantiuk,
//! *Noise-aware merging of high dynamic range image stacks without camera calibration*, ECCV workshops 2020).
//!
//! - Clipped counts never enter, nor those that noise may have clipped (2 % below white) while there is any other.
//! - **Blooming**: light of a clipped pixel spills into its neighbours, by the sensor, the demosaic or the chroma of a JPEG.
//!   A pixel that touches a clipped one (in any channel, also across a corner) of the same exposure is left out there, if it
//!   is brighter than the shorter exposures say by more than two standard deviations of the difference.
//! - Code 0 may be anything below: it enters only where no exposure saw more.
//! - What photographs differ by beyond their noise can be measured in them and enter the weights ([`Disagreement`]).
//!
//! The plain version is in `plain.rs`, the fast one, from tables, in `fast.rs`.

mod disagreement;
mod fast;
mod plain;
mod refine;

#[cfg(test)]
mod tests;

pub use disagreement::Disagreement;
pub use plain::{merge_counts_disagreeing_plain, merge_counts_plain};
pub use refine::{ExposureRatio, RefinedExposures, refine_exposures};

use crate::{Counts, Image, Linear, Linearization, Radiance};

/// The noise of a sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseModel {
    /// Electrons at relative exposure 1.
    pub full_well_electrons: f64,
    /// Standard deviation of a pixel without light, electrons.
    pub read_noise_electrons: f64,
}

impl Default for NoiseModel {
    /// A common camera: 40,000 electrons full well, 6 electrons read noise. Weights forgive a wrong guess; a variance is as
    /// good as the guess.
    fn default() -> Self {
        Self { full_well_electrons: 40_000.0, read_noise_electrons: 6.0 }
    }
}

impl NoiseModel {
    /// Variance of the relative exposure X of one photograph before it is rounded to codes: X/F + (r/F)², F electrons full
    /// well, r electrons read noise. No light below X = 0.
    pub fn variance(&self, relative_exposure: f64) -> f64 {
        relative_exposure.max(0.0) * self.shot() + self.read()
    }

    fn shot(&self) -> f64 {
        1.0 / self.full_well_electrons
    }

    fn read(&self) -> f64 {
        (self.read_noise_electrons / self.full_well_electrons).powi(2)
    }
}

/// What the exposures together saw of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Visibility {
    /// At least one exposure measured every channel.
    #[default]
    Seen = 0,
    /// A channel is clipped in every exposure that is not black: the radiance is a lower bound.
    Clipped = 1,
    /// A channel is at or below black in every exposure: the radiance is zero within noise.
    Black = 2,
}

/// Radiance merged from exposures.
#[derive(Clone, Debug)]
pub struct Merged {
    /// Radiance; where clipped, the lower bound that the shortest clipped exposure gives.
    pub radiance: Image<Radiance>,
    /// Variance of each sample of `radiance`, row-major, radiance²; +∞ in a channel that is clipped. Independent from pixel to
    /// pixel, unless a demosaic or a JPEG has mixed them before.
    pub variance: Vec<[f32; 3]>,
    /// What was seen of each pixel, row-major.
    pub visibility: Vec<Visibility>,
    /// Of each photograph, in the order given: the share of its samples (pixels × channels) that entered the radiance.
    pub used: Vec<f64>,
}

/// Counts closer to white than this share of the code range may be clipped by noise; a shorter exposure is preferred.
const NEAR_WHITE: f64 = 0.02;

/// Merges photographs of camera counts, each with its exposure t > 0 (seconds · iso/100 / f²).
///
/// # Panics
/// If there is no photograph or their sizes differ.
pub fn merge_counts(photographs: &[(&Image<Counts>, f64)], camera: &Linearization, noise: NoiseModel) -> Merged {
    fast::merge(&Stack::new(photographs, camera, noise))
}

/// As [`merge_counts`], weighted also by how far the photographs were found to be off at each code. Where that is more than
/// the noise model foresees, the variance follows it.
///
/// # Panics
/// If there is no photograph or their sizes differ.
pub fn merge_counts_disagreeing(
    photographs: &[(&Image<Counts>, f64)],
    camera: &Linearization,
    noise: NoiseModel,
    disagreement: &Disagreement,
) -> Merged {
    fast::merge(&Stack { disagreement: Some(disagreement), ..Stack::new(photographs, camera, noise) })
}

/// Photographs with the shortest exposure first, and what is asked of their counts.
struct Stack<'a> {
    exposures: Vec<Exposed<'a>>,
    width: usize,
    height: usize,
    camera: &'a Linearization,
    noise: NoiseModel,
    disagreement: Option<&'a Disagreement>,
    /// Counts from here on may be clipped by noise.
    near_white: u16,
}

struct Exposed<'a> {
    counts: &'a [[u16; 3]],
    /// Exposure t.
    t: f64,
    /// Place in the order given.
    given: usize,
}

impl<'a> Stack<'a> {
    fn new(photographs: &[(&'a Image<Counts>, f64)], camera: &'a Linearization, noise: NoiseModel) -> Self {
        let (width, height) = photographs[0].0.size();
        assert!(photographs.iter().all(|(image, _)| image.size() == (width, height)), "exposures differ in size");
        let given = photographs.iter().enumerate();
        let mut exposures: Vec<_> =
            given.map(|(given, (image, t))| Exposed { counts: image.pixels(), t: *t, given }).collect();
        exposures.sort_by(|a, b| a.t.total_cmp(&b.t));
        let range = f64::from(camera.white_level() - camera.black_level());
        let near_white = camera.white_level() - (range * NEAR_WHITE).ceil() as u16;
        Self { exposures, width, height, camera, noise, disagreement: None, near_white }
    }

    /// Counts that enter without a question: above the floor of the converter and safely below white.
    fn is_safe(&self, code: u16) -> bool {
        code > 0 && code < self.near_white
    }

    fn shares(&self, used: &[u64]) -> Vec<f64> {
        let samples = (3 * self.width * self.height).max(1) as f64;
        let mut shares = vec![0.0; used.len()];
        for (exposed, used) in self.exposures.iter().zip(used) {
            shares[exposed.given] = *used as f64 / samples;
        }
        shares
    }
}

/// What is seen of a pixel, from what is seen of its channels: a clipped one first, then a black one.
fn of_pixel(channels: [Visibility; 3]) -> Visibility {
    let any = |kind| channels.contains(&kind).then_some(kind);
    any(Visibility::Clipped).or(any(Visibility::Black)).unwrap_or_default()
}

/// Merges linear float photographs, each with its exposure t > 0: all light over all time, the weights of photon noise. A
/// sample of 1 is the full well, as in counts; floats do not say where they clip, so every pixel counts as seen.
///
/// # Panics
/// If there is no photograph or their sizes differ.
pub fn merge_linear(photographs: &[(&Image<Linear>, f64)], noise: NoiseModel) -> Merged {
    let (width, height) = photographs[0].0.size();
    let mut sum = Image::<Linear>::black(width, height);
    let total: f64 = photographs.iter().map(|(_, t)| t).sum();
    for (image, _) in photographs {
        sum.add_scaled(image, [(1.0 / total) as f32; 3]);
    }
    // Σ Var(Xᵢ) / (Σ tᵢ)², with Var(Xᵢ) = L tᵢ/F + (r/F)².
    let shot = (noise.shot() / total) as f32;
    let read = (noise.read() * photographs.len() as f64 / (total * total)) as f32;
    let variance = sum.pixels().iter().map(|pixel| pixel.map(|radiance| radiance.max(0.0) * shot + read)).collect();
    Merged {
        radiance: sum.reinterpret(),
        variance,
        visibility: vec![Visibility::Seen; width * height],
        used: vec![1.0; photographs.len()],
    }
}
