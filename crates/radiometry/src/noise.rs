//! How uncertain radiance is by how bright it is: the variance of the merged photographs of one set-up as a curve.
//!
//! The variance that merging gives ([`crate::Merged::variance`]) depends on little but the radiance: exposures and sensor
//! are the same for all photographs of a position. So one curve stands for all their variances, and can be kept.

use serde::{Deserialize, Serialize};

use crate::Merged;

/// Radiances below 2^LOWEST count as none.
const LOWEST: i32 = -60;
/// Radiances from 2^HIGHEST on share one bin.
const HIGHEST: i32 = 60;

/// Variance of a sample of radiance, radiance², by its radiance: linear between none and powers of two, and beyond.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Knots", into = "Knots")]
pub struct NoiseCurve {
    dark: f32,
    first: i32,
    /// At 2^first, 2^(first + 1), …; at least two.
    variance: Vec<f32>,
    /// For every exponent of a float: variance = line[0] + line[1] · radiance.
    lines: Box<[[f32; 2]; EXPONENTS]>,
}

/// Exponents that a single-precision float may have.
const EXPONENTS: usize = 256;

/// The curve in files.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Knots {
    /// Variance without light.
    dark: f32,
    /// Exponent of the radiance of the first knot.
    first_octave: i32,
    /// Variance at that radiance, twice it, four times it, …
    variance: Vec<f32>,
}

impl From<NoiseCurve> for Knots {
    fn from(curve: NoiseCurve) -> Self {
        Self { dark: curve.dark, first_octave: curve.first, variance: curve.variance }
    }
}

impl TryFrom<Knots> for NoiseCurve {
    type Error = String;

    fn try_from(knots: Knots) -> Result<Self, String> {
        let Knots { dark, first_octave: first, variance } = knots;
        let octaves = LOWEST..=HIGHEST + 1;
        let last = first.saturating_add(i32::try_from(variance.len()).unwrap_or(i32::MAX));
        if variance.len() < 2 || !octaves.contains(&first) || last > HIGHEST + 3 {
            return Err(format!(
                "a curve of noise needs 2 knots or more between 2^{LOWEST} and 2^{HIGHEST}, but has {} from 2^{first}",
                variance.len()
            ));
        }
        let wrong = variance.iter().copied().chain([dark]).find(|value| !value.is_finite() || *value < 0.0);
        match wrong {
            Some(wrong) => Err(format!("a variance must be finite and not negative, but is {wrong}")),
            None => Ok(Self::new(dark, first, variance)),
        }
    }
}

impl NoiseCurve {
    fn new(dark: f32, first: i32, variance: Vec<f32>) -> Self {
        let line = |exponent: usize| {
            let knot = exponent as i32 - 127 - first;
            let last = variance.len() as i32 - 2;
            // Below the first knot from none, beyond the last as before it.
            let ((x0, v0), (x1, v1)) = if knot < 0 {
                ((0.0, dark), (exp2(first), variance[0]))
            } else {
                let knot = knot.min(last);
                let (below, above) = (knot as usize, knot as usize + 1);
                ((exp2(first + knot), variance[below]), (exp2(first + knot + 1), variance[above]))
            };
            let slope = (f64::from(v1) - f64::from(v0)) / (x1 - x0);
            [(f64::from(v0) - slope * x0) as f32, slope as f32]
        };
        let lines = Box::new(std::array::from_fn(line));
        Self { dark, first, variance, lines }
    }

    /// dark + slope · radiance: the curve of photographs of one exposure.
    pub fn linear(dark: f32, slope: f32) -> Self {
        // Any two knots do: the curve is linear beyond them.
        Self::new(dark, 0, vec![dark + slope, dark + 2.0 * slope])
    }

    /// Variance without light.
    pub fn dark(&self) -> f32 {
        self.dark
    }

    /// Variance at a radiance; as without light at and below zero.
    #[inline(always)]
    pub fn at(&self, radiance: f32) -> f32 {
        // The maximum of NaN and a number is the number.
        let radiance = radiance.max(0.0);
        let [constant, slope] = self.lines[(radiance.to_bits() >> 23) as usize % EXPONENTS];
        // Rounding may not make a variance negative.
        (constant + slope * radiance).max(0.0)
    }

    /// The curve of a sensor whose noise without light has `dark` times the variance, and what light adds `light` times.
    pub fn scaled(&self, dark: f64, light: f64) -> Self {
        let scaled = |value: f32| (dark * f64::from(self.dark) + light * f64::from(value - self.dark)).max(0.0) as f32;
        Self::new(scaled(self.dark), self.first, self.variance.iter().copied().map(scaled).collect())
    }
}

fn exp2(exponent: i32) -> f64 {
    f64::from(exponent).exp2()
}

/// Lanes of a picture that noise is measured on, a lane being a channel of a pixel: all of a small picture; of a large one runs
/// spread evenly over it, since a few numbers are known well enough from a quarter of a million samples.
#[derive(Clone, Copy, Debug)]
pub struct MeasuredLanes {
    lanes: usize,
    measured: usize,
}

impl MeasuredLanes {
    /// Lanes of one run: cache lines that are read at all are read whole.
    const RUN: usize = 48;
    const MOST_RUNS: usize = 1 << 13;

    /// Of a picture of so many.
    pub fn of(lanes: usize) -> Self {
        Self { lanes, measured: lanes.min(Self::RUN * Self::MOST_RUNS) }
    }

    /// How many are measured.
    #[allow(clippy::len_without_is_empty)] // a number, not a collection
    pub fn len(&self) -> usize {
        self.measured
    }

    /// The lane that is measured as number `index`.
    pub fn lane(&self, index: usize) -> usize {
        if self.measured == self.lanes {
            return index;
        }
        let (run, within) = (index / Self::RUN, index % Self::RUN);
        run * (self.lanes / Self::RUN) / Self::MOST_RUNS * Self::RUN + within
    }

    /// All of them, in their order.
    pub fn iter(self) -> impl Iterator<Item = usize> {
        (0..self.measured).map(move |index| self.lane(index))
    }
}

/// Samples of photographs, gathered by their radiance, of which a [`NoiseCurve`] is made.
#[derive(Clone, Debug, Default)]
pub struct NoiseSamples {
    dark: (f64, u64),
    /// By octave from 2^LOWEST: number, sum of radiances, sum of variances.
    octaves: Vec<(u64, f64, f64)>,
}

impl NoiseSamples {
    /// The samples of the measured lanes of one photograph; those that are clipped have no variance and are left out.
    pub fn of(merged: &Merged) -> Self {
        let mut samples = Self { dark: (0.0, 0), octaves: vec![(0, 0.0, 0.0); (HIGHEST - LOWEST + 1) as usize] };
        let (radiances, variances) = (merged.radiance.pixels().as_flattened(), merged.variance.as_flattened());
        for lane in MeasuredLanes::of(radiances.len()).iter() {
            let (radiance, variance) = (&radiances[lane], &variances[lane]);
            if !variance.is_finite() || !radiance.is_finite() {
                continue;
            }
            let exponent = (radiance.to_bits() >> 23) as i32 - 127;
            if *radiance <= 0.0 || exponent < LOWEST {
                samples.dark.0 += f64::from(*variance);
                samples.dark.1 += 1;
            } else {
                let (number, light, sum) = &mut samples.octaves[(exponent.min(HIGHEST) - LOWEST) as usize];
                *number += 1;
                *light += f64::from(*radiance);
                *sum += f64::from(*variance);
            }
        }
        samples
    }

    /// Adds the samples of another photograph.
    pub fn add(&mut self, other: &Self) {
        self.dark.0 += other.dark.0;
        self.dark.1 += other.dark.1;
        self.octaves.resize(self.octaves.len().max(other.octaves.len()), (0, 0.0, 0.0));
        for (sum, octave) in self.octaves.iter_mut().zip(&other.octaves) {
            *sum = (sum.0 + octave.0, sum.1 + octave.1, sum.2 + octave.2);
        }
    }

    /// The curve through their means; `None` if there is no sample.
    pub fn curve(&self) -> Option<NoiseCurve> {
        let mut line: Vec<(f64, f64)> = Vec::new();
        let mut octaves: Vec<i32> = Vec::new();
        for (octave, (number, light, variance)) in (LOWEST..).zip(&self.octaves) {
            if *number > 0 {
                line.push((light / *number as f64, variance / *number as f64));
                octaves.push(octave);
            }
        }
        let dark = if self.dark.1 > 0 { self.dark.0 / self.dark.1 as f64 } else { line.first()?.1 };
        line.insert(0, (0.0, dark));
        let (Some(first), Some(last)) = (octaves.first(), octaves.last()) else {
            return Some(NoiseCurve::linear(dark as f32, 0.0));
        };
        let at = |radiance: f64| {
            let above = line.iter().position(|(x, _)| *x >= radiance).unwrap_or(line.len() - 1).max(1);
            let ((x0, v0), (x1, v1)) = (line[above - 1], line[above]);
            (v0 + (v1 - v0) * (radiance - x0) / (x1 - x0)).max(0.0)
        };
        let variance = (*first..=last + 1).map(|octave| at(f64::from(octave).exp2()) as f32).collect();
        Some(NoiseCurve::new(dark as f32, *first, variance))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Image, Visibility};

    fn merged(samples: &[f32], variance: impl Fn(f32) -> f32) -> Merged {
        Merged {
            radiance: Image::from_pixels(samples.len(), 1, samples.iter().map(|x| [*x; 3]).collect()),
            variance: samples.iter().map(|x| [variance(*x); 3]).collect(),
            visibility: vec![Visibility::Seen; samples.len()],
            used: vec![1.0],
        }
    }

    #[test]
    fn a_curve_of_one_exposure_is_found_again() {
        let variance = |x: f32| 3e-7 + 1e-4 * x.max(0.0);
        let samples: Vec<f32> = (-20..2000).map(|i| i as f32 * 7e-4).collect();
        let mut all = NoiseSamples::of(&merged(&samples[..900], variance));
        all.add(&NoiseSamples::of(&merged(&samples[900..], variance)));
        let curve = all.curve().unwrap();
        for x in [-1.0, 0.0, 1e-4, 1e-3, 0.02, 0.3, 1.0, 1.4, 3.0] {
            assert!((curve.at(x) / variance(x) - 1.0).abs() < 1e-3, "{x}: {} not {}", curve.at(x), variance(x));
            assert!((NoiseCurve::linear(3e-7, 1e-4).at(x) / variance(x) - 1.0).abs() < 1e-5);
        }
        let louder = curve.scaled(4.0, 2.0);
        assert!((louder.at(0.0) / 12e-7 - 1.0).abs() < 1e-3);
        assert!((louder.at(1.0) / (12e-7 + 2e-4) - 1.0).abs() < 1e-3);
    }

    #[test]
    fn a_curve_comes_back_from_a_file_and_one_that_cannot_be_does_not() {
        let curve = NoiseCurve::linear(3e-7, 1e-4).scaled(2.0, 3.0);
        let text = toml::to_string(&curve).unwrap();
        assert_eq!(toml::from_str::<NoiseCurve>(&text).unwrap(), curve);
        for wrong in [
            "dark = 1e-7\nfirst_octave = 0\nvariance = [1e-4]",
            "dark = -1e-7\nfirst_octave = 0\nvariance = [1e-4, 2e-4]",
            "dark = 1e-7\nfirst_octave = 0\nvariance = [1e-4, inf]",
            "dark = nan\nfirst_octave = 0\nvariance = [1e-4, 2e-4]",
            "dark = 1e-7\nfirst_octave = -2000000000\nvariance = [1e-4, 2e-4]",
            "dark = 1e-7\nfirst_octave = 61\nvariance = [1e-4, 2e-4, 3e-4]",
            "dark = 1e-7\nfirst_octave = 0\nvariance = [1e-4, 2e-4]\ngain = 2",
        ] {
            assert!(toml::from_str::<NoiseCurve>(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn measured_lanes_are_all_of_few_and_spread_over_many() {
        assert!(MeasuredLanes::of(1000).iter().eq(0..1000));
        let (lanes, measured) = (1440 * 960 * 3, MeasuredLanes::of(1440 * 960 * 3));
        let of: Vec<usize> = measured.iter().collect();
        assert_eq!(of.len(), measured.len());
        assert!(of.windows(2).all(|pair| pair[0] < pair[1]), "a lane counts once");
        assert!(*of.last().unwrap() < lanes && of.windows(2).all(|pair| pair[1] - pair[0] < lanes / 5000));
        for channel in 0..3 {
            assert_eq!(of.iter().filter(|lane| *lane % 3 == channel).count(), of.len() / 3);
        }
    }

    #[test]
    fn clipped_samples_say_nothing_and_nothing_makes_no_curve() {
        assert!(NoiseSamples::default().curve().is_none());
        assert!(NoiseSamples::of(&merged(&[2.0; 9], |_| f32::INFINITY)).curve().is_none());
        let one = NoiseSamples::of(&merged(&[0.0; 4], |_| 5e-6)).curve().unwrap();
        assert_eq!((one.at(0.0), one.at(7.0)), (5e-6, 5e-6));
    }
}
