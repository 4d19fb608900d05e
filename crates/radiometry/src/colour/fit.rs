//! Fitting a colour correction to measured patches: linear least squares first, then Levenberg and Marquardt's method on
//! the sum of ΔE₀₀².

mod unknowns;

use serde::{Deserialize, Serialize};

use super::ColourError;
use super::correction::{Correction, Model};
use super::difference::delta_e_2000;
use super::measure::Measurement;
use super::reference::{Reference, rec709_of_d50};
use super::space::{D50, Lab, Xyz, chroma, lab_from_xyz, luminance};
use unknowns::{Unknowns, apply, lab_of};

/// Patches whose chroma C* is below are neutral.
const NEUTRAL_CHROMA: f64 = 5.0;
/// The parts that patches are held out in, one after the other, at most.
const PARTS: usize = 24;

/// One patch: what the camera saw and what it is.
#[derive(Clone, Debug)]
pub(super) struct Sample {
    pub(super) name: String,
    pub(super) camera: [f64; 3],
    pub(super) xyz: Xyz,
    pub(super) lab: Lab,
}

/// A fitted correction and how well it does.
#[derive(Clone, Debug)]
pub struct ColourFit {
    /// Camera RGB → linear Rec. 709; neutral patches keep their luminance.
    pub correction: Correction,
    /// What the corrected photograph is multiplied with so that a perfect diffuser where the chart was is 1.
    pub exposure: f64,
    /// Whether grey was held neutral exactly.
    pub white_kept: bool,
    /// Patch by patch, in the order of the chart.
    pub patches: Vec<PatchFit>,
}

/// How one patch came out. Colours are L\*a\*b\* (D50), differences ΔE₀₀.
#[derive(Clone, Debug, PartialEq)]
pub struct PatchFit {
    /// The patch.
    pub name: String,
    /// Camera RGB.
    pub camera: [f64; 3],
    /// The reference value.
    pub reference: Lab,
    /// The camera's channels taken for Rec. 709, scaled to the exposure of the neutral patches.
    pub before: Lab,
    /// After the correction.
    pub after: Lab,
    /// ΔE₀₀ before the correction.
    pub error_before: f64,
    /// ΔE₀₀ after it.
    pub error_after: f64,
    /// ΔE₀₀ after a correction fitted without this patch (of more than 24 patches every 24th is held out together).
    pub error_held_out: f64,
}

/// Mean, median and largest ΔE₀₀.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Errors {
    /// Mean.
    pub mean: f64,
    /// Median.
    pub median: f64,
    /// The largest.
    pub max: f64,
    /// Its patch.
    pub worst: String,
}

impl ColourFit {
    /// Fits a correction to the patches that have been measured and have a reference value. With `keep_white`, the mean colour of
    /// the neutral patches (chroma C* below 5) becomes exactly neutral.
    ///
    /// # Errors
    /// If fewer patches are left than the model has terms and three more, a patch is black in all channels, their colours do not tell the
    /// three channels apart, or there is no neutral patch and white is to be kept.
    pub fn new(
        measurements: &[Measurement],
        reference: &Reference,
        model: Model,
        keep_white: bool,
    ) -> Result<Self, ColourError> {
        let samples: Vec<Sample> = measurements
            .iter()
            .filter_map(|measured| {
                let xyz = reference.xyz(&measured.name)?;
                let (name, camera) = (measured.name.clone(), measured.camera);
                Some(Sample { name, camera, xyz, lab: lab_from_xyz(xyz, D50) })
            })
            .collect();
        let fewest = model.terms() + 3;
        if samples.len() < fewest {
            return Err(ColourError::Patches(format!(
                "{} patches are measured and have a value in the reference, {fewest} are needed: does the reference ({}) belong to this \
                 chart?",
                samples.len(),
                reference.name()
            )));
        }
        let is_lit = |sample: &Sample| luminance(sample.camera) > 0.0;
        if let Some(bad) = samples.iter().find(|sample| !is_lit(sample)) {
            return Err(ColourError::Patches(format!(
                "patch {} is black in the photograph: is the black level right, and do the corners lie on the chart?",
                bad.name
            )));
        }
        let neutral: Vec<&Sample> = samples.iter().filter(|sample| chroma(sample.lab) < NEUTRAL_CHROMA).collect();
        let white = mean_colour(&neutral);
        if keep_white && white.is_none() {
            let reason = "white cannot be kept: no patch of the reference is neutral (C* below 5)";
            return Err(ColourError::Patches(reason.into()));
        }
        let white = white.filter(|_| keep_white);
        let space = Unknowns::new(model, white);
        let all: Vec<&Sample> = samples.iter().collect();
        let start = space.linear(&all).ok_or_else(|| {
            ColourError::Patches(
                "the patches do not tell the camera's three channels apart: do the corners lie on the chart?".into(),
            )
        })?;
        let whole = space.refine(&all, &start);
        let fitted = space.coefficients(&whole);
        let scaled_to: Vec<&Sample> = if neutral.is_empty() { samples.iter().collect() } else { neutral };
        // Neutral patches keep their luminance: least squares of s · Y(corrected) against Y(camera).
        let scale = ratio(
            scaled_to.iter().map(|sample| (luminance(apply(model, &fitted, sample.camera)), luminance(sample.camera))),
        );
        let before = ratio(scaled_to.iter().map(|s| (luminance(s.camera), luminance(rec709_of_d50(s.xyz)))));
        if !(scale > 0.0 && scale.is_finite() && before > 0.0) {
            return Err(ColourError::Patches("the fit ends at no colours: do the corners lie on the chart?".into()));
        }
        let scaled = fitted.map(|row| row.map(|value| scale * value));
        let correction = match model {
            Model::Matrix => Correction::from_matrix(scaled.map(|[r, g, b, ..]| [r, g, b])),
            Model::RootPolynomial => Correction::from_root_polynomial(scaled),
        };
        let held_out = hold_out(&space, &samples, &whole);
        let patches = samples.into_iter().zip(held_out).map(|(sample, error_held_out)| {
            let before = lab_of(sample.camera.map(|value| before * value));
            let after = lab_of(apply(model, &fitted, sample.camera));
            PatchFit {
                error_before: delta_e_2000(before, sample.lab),
                error_after: delta_e_2000(after, sample.lab),
                error_held_out,
                name: sample.name,
                camera: sample.camera,
                reference: sample.lab,
                before,
                after,
            }
        });
        Ok(Self { correction, exposure: 1.0 / scale, white_kept: keep_white, patches: patches.collect() })
    }

    /// Figures over all patches, of ΔE₀₀ before, after, or held out.
    pub fn errors(&self, error: impl Fn(&PatchFit) -> f64) -> Errors {
        let mut errors: Vec<(f64, &str)> =
            self.patches.iter().map(|patch| (error(patch), patch.name.as_str())).collect();
        errors.sort_by(|a, b| a.0.total_cmp(&b.0));
        let count = errors.len();
        let (max, worst) = errors[count - 1];
        Errors {
            mean: errors.iter().map(|(error, _)| error).sum::<f64>() / count as f64,
            median: 0.5 * (errors[(count - 1) / 2].0 + errors[count / 2].0),
            max,
            worst: worst.into(),
        }
    }
}

/// Mean of the colours of neutral patches, each divided by its luminance.
fn mean_colour(neutral: &[&Sample]) -> Option<[f64; 3]> {
    let count = neutral.len() as f64;
    let sum = neutral.iter().fold([0.0; 3], |sum: [f64; 3], sample| {
        let y = luminance(sample.camera);
        [0, 1, 2].map(|channel| sum[channel] + sample.camera[channel] / y)
    });
    (!neutral.is_empty()).then(|| sum.map(|value| value / count))
}

/// The factor of the first numbers that brings them nearest to the second.
fn ratio(pairs: impl Iterator<Item = (f64, f64)>) -> f64 {
    let (ab, aa) = pairs.fold((0.0, 0.0), |(ab, aa), (a, b)| (ab + a * b, aa + a * a));
    ab / aa
}

/// ΔE₀₀ of every patch after a fit without it.
fn hold_out(space: &Unknowns, samples: &[Sample], whole: &[f64]) -> Vec<f64> {
    let parts = samples.len().min(PARTS);
    let fits: Vec<[[f64; 6]; 3]> = (0..parts)
        .map(|part| {
            let kept = samples.iter().enumerate().filter(|(index, _)| index % parts != part).map(|(_, sample)| sample);
            space.coefficients(&space.refine(&kept.collect::<Vec<_>>(), whole))
        })
        .collect();
    let error = |(index, sample): (usize, &Sample)| {
        delta_e_2000(lab_of(apply(space.model, &fits[index % parts], sample.camera)), sample.lab)
    };
    samples.iter().enumerate().map(error).collect()
}
