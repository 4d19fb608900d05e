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
}

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
            None => Ok(Self { dark, first, variance }),
        }
    }
}

impl NoiseCurve {
    /// dark + slope · radiance: the curve of photographs of one exposure.
    pub fn linear(dark: f32, slope: f32) -> Self {
        // Any two knots do: the curve is linear beyond them.
        Self { dark, first: 0, variance: vec![dark + slope, dark + 2.0 * slope] }
    }

    /// Variance without light.
    pub fn dark(&self) -> f32 {
        self.dark
    }

    /// Variance at a radiance; as without light at and below zero.
    #[inline]
    pub fn at(&self, radiance: f32) -> f32 {
        // Not above zero: NaN too.
        if radiance.is_nan() || radiance <= 0.0 {
            return self.dark;
        }
        let exponent = (radiance.to_bits() >> 23) as i32 - 127;
        let knot = exponent - self.first;
        if knot < 0 {
            return self.dark + (self.variance[0] - self.dark) * radiance / exp2(self.first);
        }
        let knot = knot as usize;
        let (knot, part) = if knot < self.variance.len() - 1 {
            // radiance/2^exponent − 1: what the digits of the number say.
            (knot, f32::from_bits(radiance.to_bits() & 0x7f_ffff | 0x3f80_0000) - 1.0)
        } else {
            let last = self.variance.len() - 2;
            (last, radiance / exp2(self.first + last as i32) - 1.0)
        };
        self.variance[knot] + (self.variance[knot + 1] - self.variance[knot]) * part
    }

    /// The curve of a sensor whose noise without light has `dark` times the variance, and what light adds `light` times.
    pub fn scaled(&self, dark: f64, light: f64) -> Self {
        let scaled = |value: f32| (dark * f64::from(self.dark) + light * f64::from(value - self.dark)).max(0.0) as f32;
        Self {
            dark: scaled(self.dark),
            first: self.first,
            variance: self.variance.iter().copied().map(scaled).collect(),
        }
    }
}

fn exp2(exponent: i32) -> f32 {
    f32::from_bits(((exponent + 127).clamp(1, 254) as u32) << 23)
}

/// Samples of photographs, gathered by their radiance, of which a [`NoiseCurve`] is made.
#[derive(Clone, Debug, Default)]
pub struct NoiseSamples {
    dark: (f64, u64),
    /// By octave from 2^LOWEST: number, sum of radiances, sum of variances.
    octaves: Vec<(u64, f64, f64)>,
}

impl NoiseSamples {
    /// The samples of one photograph; those that are clipped have no variance and are left out.
    pub fn of(merged: &Merged) -> Self {
        let mut samples = Self { dark: (0.0, 0), octaves: vec![(0, 0.0, 0.0); (HIGHEST - LOWEST + 1) as usize] };
        let radiances = merged.radiance.pixels().iter().flatten();
        for (radiance, variance) in radiances.zip(merged.variance.iter().flatten()) {
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
        Some(NoiseCurve { dark: dark as f32, first: *first, variance })
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
    fn clipped_samples_say_nothing_and_nothing_makes_no_curve() {
        assert!(NoiseSamples::default().curve().is_none());
        assert!(NoiseSamples::of(&merged(&[2.0; 9], |_| f32::INFINITY)).curve().is_none());
        let one = NoiseSamples::of(&merged(&[0.0; 4], |_| 5e-6)).curve().unwrap();
        assert_eq!((one.at(0.0), one.at(7.0)), (5e-6, 5e-6));
    }
}
