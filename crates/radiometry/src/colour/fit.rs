//! Fitting a colour correction to measured patches: linear least squares first, then Levenberg and Marquardt's method on
//! the sum of ΔE₀₀².

use serde::{Deserialize, Serialize};

use super::ColourError;
use super::correction::{Correction, Model};
use super::difference::{components, delta_e_2000};
use super::measure::Measurement;
use super::reference::{Reference, rec709_of_d50};
use super::solve::least_squares_of;
use super::space::{D50, D65, Lab, Xyz, adaptation, chroma, lab_from_xyz, luminance, transform, xyz_from_rec709};

/// Patches whose chroma C* is below are neutral.
const NEUTRAL_CHROMA: f64 = 5.0;
/// The parts that patches are held out in, one after the other, at most.
const PARTS: usize = 24;
/// Steps of the minimisation, at most.
const STEPS: usize = 60;

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

fn apply(model: Model, coefficients: &[[f64; 6]; 3], camera: [f64; 3]) -> [f64; 3] {
    let features = model.features(camera);
    coefficients.map(|row| row.iter().zip(&features).map(|(a, b)| a * b).sum())
}

/// L*a*b* (D50) of linear Rec. 709.
fn lab_of(rgb: [f64; 3]) -> Lab {
    lab_from_xyz(transform(&adaptation(D65, D50), xyz_from_rec709(rgb)), D50)
}

/// What is fitted: all coefficients, or those that keep white.
///
/// Coefficient row = Σ unknown · direction, with directions that are orthonormal: without a white to keep, the axes. With one,
/// the first is the white's own and has one unknown for all three rows, so that white comes out neutral whatever the others are.
struct Unknowns {
    model: Model,
    directions: Vec<[f64; 6]>,
    white: bool,
}

impl Unknowns {
    fn new(model: Model, white: Option<[f64; 3]>) -> Self {
        let terms = model.terms();
        let axis = |term: usize| std::array::from_fn::<f64, 6, _>(|k| if k == term { 1.0 } else { 0.0 });
        let Some(white) = white else {
            return Self { model, directions: (0..terms).map(axis).collect(), white: false };
        };
        // Gram and Schmidt, beginning with the white.
        let mut directions: Vec<[f64; 6]> = Vec::new();
        for candidate in std::iter::once(model.features(white)).chain((0..terms).map(axis)) {
            let mut rest = candidate;
            for known in &directions {
                let along = dot(&rest, known);
                rest.iter_mut().zip(known).for_each(|(rest, known)| *rest -= along * known);
            }
            let length = dot(&rest, &rest).sqrt();
            if length > 1e-3 && directions.len() < terms {
                directions.push(rest.map(|value| value / length));
            }
        }
        Self { model, directions, white: true }
    }

    fn count(&self) -> usize {
        let own = self.directions.len() - usize::from(self.white);
        3 * own + usize::from(self.white)
    }

    /// The unknown of a channel along a direction.
    fn place(&self, channel: usize, direction: usize) -> usize {
        match (self.white, direction) {
            (true, 0) => 0,
            (true, direction) => 1 + channel * (self.directions.len() - 1) + direction - 1,
            (false, direction) => channel * self.directions.len() + direction,
        }
    }

    fn coefficients(&self, unknowns: &[f64]) -> [[f64; 6]; 3] {
        std::array::from_fn(|channel| {
            let mut row = [0.0; 6];
            for (index, direction) in self.directions.iter().enumerate() {
                let value = unknowns[self.place(channel, index)];
                row.iter_mut().zip(direction).for_each(|(sum, along)| *sum += value * along);
            }
            row
        })
    }

    /// Goes from `start` to the least Σ ΔE₀₀².
    fn refine(&self, samples: &[&Sample], start: &[f64]) -> Vec<f64> {
        let mut unknowns = start.to_vec();
        let mut residuals = self.residuals(samples, &unknowns);
        let (mut error, mut damping) = (squares(&residuals), 1e-3);
        for _ in 0..STEPS {
            let jacobian = self.jacobian(samples, &unknowns);
            let lengths: Vec<f64> =
                (0..unknowns.len()).map(|k| jacobian.iter().map(|row| row[k] * row[k]).sum::<f64>().sqrt()).collect();
            let mut better = None;
            while better.is_none() && damping < 1e9 {
                // The damped step as least squares: one row more for each unknown.
                let mut rows = jacobian.clone();
                let mut right: Vec<f64> = residuals.iter().map(|residual| -residual).collect();
                for (k, length) in lengths.iter().enumerate() {
                    let mut row = vec![0.0; unknowns.len()];
                    row[k] = f64::sqrt(damping) * length.max(1e-12);
                    rows.push(row);
                    right.push(0.0);
                }
                let step = least_squares_of(rows, right, unknowns.len());
                let tried = step.map(|step| unknowns.iter().zip(&step).map(|(a, b)| a + b).collect::<Vec<f64>>());
                better =
                    tried.map(|tried| (self.residuals(samples, &tried), tried)).filter(|(r, _)| squares(r) < error);
                damping *= if better.is_some() { 0.2 } else { 5.0 };
            }
            let Some((found, tried)) = better else { break };
            let gain = error - squares(&found);
            (residuals, unknowns) = (found, tried);
            error -= gain;
            if gain < 1e-9 * error {
                break;
            }
        }
        unknowns
    }

    /// Linear least squares in Rec. 709; dark patches weigh more, as they do to the eye. `None` if it is open.
    fn linear(&self, samples: &[&Sample]) -> Option<Vec<f64>> {
        let (mut rows, mut right) = (Vec::new(), Vec::new());
        for sample in samples {
            let (target, features) = (rec709_of_d50(sample.xyz), self.model.features(sample.camera));
            let weight = 1.0 / (sample.xyz[1].max(0.0) + 0.05);
            for (channel, target) in target.iter().enumerate() {
                let mut row = vec![0.0; self.count()];
                for (index, direction) in self.directions.iter().enumerate() {
                    row[self.place(channel, index)] += weight * dot(&features, direction);
                }
                rows.push(row);
                right.push(weight * target);
            }
        }
        least_squares_of(rows, right, self.count())
    }

    fn residuals(&self, samples: &[&Sample], unknowns: &[f64]) -> Vec<f64> {
        let coefficients = self.coefficients(unknowns);
        let of = |sample: &&Sample| components(lab_of(apply(self.model, &coefficients, sample.camera)), sample.lab);
        samples.iter().flat_map(of).collect()
    }

    /// By central differences.
    fn jacobian(&self, samples: &[&Sample], unknowns: &[f64]) -> Vec<Vec<f64>> {
        let mut jacobian = vec![vec![0.0; unknowns.len()]; 3 * samples.len()];
        let size = unknowns.iter().fold(0.0f64, |size, value| size.max(value.abs()));
        for k in 0..unknowns.len() {
            let step = 1e-6 * size;
            let mut moved = unknowns.to_vec();
            moved[k] += step;
            let above = self.residuals(samples, &moved);
            moved[k] = unknowns[k] - step;
            let below = self.residuals(samples, &moved);
            for (row, (above, below)) in jacobian.iter_mut().zip(above.iter().zip(&below)) {
                row[k] = (above - below) / (2.0 * step);
            }
        }
        jacobian
    }
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

fn dot(a: &[f64; 6], b: &[f64; 6]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn squares(residuals: &[f64]) -> f64 {
    residuals.iter().map(|residual| residual * residual).sum()
}
