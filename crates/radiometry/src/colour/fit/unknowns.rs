//! The numbers that a fit looks for, and the way to the best ones.

use super::Sample;
use crate::colour::correction::Model;
use crate::colour::difference::components;
use crate::colour::reference::rec709_of_d50;
use crate::colour::space::{D50, D65, Lab, adaptation, lab_from_xyz, transform, xyz_from_rec709};
use crate::solve::least_squares_of;

/// Steps of the minimisation, at most.
const STEPS: usize = 60;

/// What is fitted: all coefficients, or those that keep white.
///
/// Coefficient row = Σ unknown · direction, with directions that are orthonormal: without a white to keep, the axes. With one,
/// the first is the white's own and has one unknown for all three rows, so that white comes out neutral whatever the others are.
pub(super) struct Unknowns {
    pub(super) model: Model,
    directions: Vec<[f64; 6]>,
    white: bool,
}

impl Unknowns {
    pub(super) fn new(model: Model, white: Option<[f64; 3]>) -> Self {
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

    pub(super) fn coefficients(&self, unknowns: &[f64]) -> [[f64; 6]; 3] {
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
    pub(super) fn refine(&self, samples: &[&Sample], start: &[f64]) -> Vec<f64> {
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
    pub(super) fn linear(&self, samples: &[&Sample]) -> Option<Vec<f64>> {
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

pub(super) fn apply(model: Model, coefficients: &[[f64; 6]; 3], camera: [f64; 3]) -> [f64; 3] {
    let features = model.features(camera);
    coefficients.map(|row| row.iter().zip(&features).map(|(a, b)| a * b).sum())
}

/// L*a*b* (D50) of linear Rec. 709.
pub(super) fn lab_of(rgb: [f64; 3]) -> Lab {
    lab_from_xyz(transform(&adaptation(D65, D50), xyz_from_rec709(rgb)), D50)
}

fn dot(a: &[f64; 6], b: &[f64; 6]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn squares(residuals: &[f64]) -> f64 {
    residuals.iter().map(|residual| residual * residual).sum()
}
