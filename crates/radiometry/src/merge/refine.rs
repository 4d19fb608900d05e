//! What the exposures really were, where they are nominal: a shutter marked 13 s may stay open 12.7.
//!
//! The ratio of neighbouring exposures is measured at the samples that both expose well. A median of the logarithms of single
//! ratios finds the samples that agree, whatever moved in between, and the ratio of the sums over those is the estimate: it
//! has no bias from the noise of single ratios. The product of all exposures is kept, so that radiance keeps its scale.
//! After P. Hanji, R. K. Mantiuk, *Robust estimation of exposure ratios in multi-exposure image stacks*, IEEE Transactions on
//! Computational Imaging, 2023, without their joint solution over all pairs.

use super::{NoiseModel, Stack};
use crate::{Counts, Image, Linearization};

/// The ratio of an exposure to the next shorter one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExposureRatio {
    /// As it was given.
    pub nominal: f64,
    /// As it was measured; the nominal one if it could not be.
    pub refined: f64,
    /// Standard error of `refined` over `refined`, from the spread of single ratios.
    pub relative_error: f64,
    /// Samples it was measured at; 0 if it could not be measured.
    pub samples: usize,
}

/// Exposures as they were, up to a common factor.
#[derive(Clone, Debug, PartialEq)]
pub struct RefinedExposures {
    /// Exposures, in the order in which the photographs were given; their product is that of the nominal ones.
    pub exposures: Vec<f64>,
    /// From the shortest exposure to the longest.
    pub ratios: Vec<ExposureRatio>,
}

/// Well exposed: relative exposures in the shorter and in the longer photograph, as both together say them.
const FEWEST_LIGHT: f64 = 0.01;
const MOST_LIGHT: f64 = 0.85;
/// So many samples say a ratio.
const FEWEST_SAMPLES: usize = 100;
/// Samples that are looked at, about.
const MOST_SAMPLES: usize = 1 << 20;
/// Single ratios further from the median than so many times their spread are of something that moved.
const OUTLIER: f64 = 3.0;

/// Measures the ratios of exposures in the photographs themselves.
///
/// # Panics
/// If there is no photograph or their sizes differ.
pub fn refine_exposures(photographs: &[(&Image<Counts>, f64)], camera: &Linearization) -> RefinedExposures {
    let stack = Stack::new(photographs, camera, NoiseModel::default());
    let ratios: Vec<_> = (1..stack.exposures.len()).map(|longer| ratio(&stack, longer)).collect();
    // Logarithms of the exposures from the first on, then moved so that their mean is that of the nominal ones.
    let mut corrections = vec![0.0];
    for ratio in &ratios {
        corrections.push(corrections[corrections.len() - 1] + (ratio.refined / ratio.nominal).ln());
    }
    let mean = corrections.iter().sum::<f64>() / corrections.len() as f64;
    let mut exposures = vec![0.0; corrections.len()];
    for (exposed, correction) in stack.exposures.iter().zip(&corrections) {
        exposures[exposed.given] = exposed.t * (correction - mean).exp();
    }
    RefinedExposures { exposures, ratios }
}

fn ratio(stack: &Stack<'_>, longer: usize) -> ExposureRatio {
    let [shorter, longer] = [longer - 1, longer].map(|i| &stack.exposures[i]);
    let nominal = longer.t / shorter.t;
    let unmeasured = ExposureRatio { nominal, refined: nominal, relative_error: f64::INFINITY, samples: 0 };
    let stride = (3 * stack.width * stack.height / MOST_SAMPLES).max(1);
    // Strides that share no factor with 3 visit all channels.
    let stride = if stride > 1 && stride.is_multiple_of(3) { stride + 1 } else { stride };
    let mut pairs = Vec::new();
    for sample in (0..3 * stack.width * stack.height).step_by(stride) {
        let codes = [shorter, longer].map(|exposed| exposed.counts[sample / 3][sample % 3]);
        if codes.iter().all(|code| stack.is_safe(*code)) {
            let [a, b] = codes.map(|code| f64::from(stack.camera.exposure(sample % 3, code)));
            // Chosen by all light over all time: chosen by one of the two, those would be taken whose noise is on one side.
            let light = (a + b) / (1.0 + nominal);
            if light > FEWEST_LIGHT && light * nominal < MOST_LIGHT && a > 0.0 && b > 0.0 {
                pairs.push((a, b, (b / a).ln()));
            }
        }
    }
    if pairs.len() < FEWEST_SAMPLES {
        return unmeasured;
    }
    let mut logarithms: Vec<f64> = pairs.iter().map(|pair| pair.2).collect();
    let middle = median(&mut logarithms);
    let mut distances: Vec<f64> = pairs.iter().map(|pair| (pair.2 - middle).abs()).collect();
    // 1.4826 times the median distance is the standard deviation of a normal distribution.
    let spread = (1.4826 * median(&mut distances)).max(1e-6);
    let (mut sums, mut squares, mut samples) = ([0.0; 2], 0.0, 0usize);
    for (a, b, logarithm) in pairs {
        if (logarithm - middle).abs() <= OUTLIER * spread {
            sums = [sums[0] + a, sums[1] + b];
            squares += (logarithm - middle).powi(2);
            samples += 1;
        }
    }
    if samples < FEWEST_SAMPLES {
        return unmeasured;
    }
    let relative_error = squares.sqrt() / samples as f64;
    ExposureRatio { nominal, refined: sums[1] / sums[0], relative_error, samples }
}

fn median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}
