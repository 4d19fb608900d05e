//! Vectors as 8-bit coefficients in a basis.

use crate::packed::Atoms;
use crate::packed::basis::{Basis, dot};

/// The exponent of coefficients that count whole steps; smaller ones count parts of them.
pub(crate) const EXPONENT: i32 = 12;

/// An atom with coefficients of its own.
#[derive(Debug)]
pub(crate) struct OwnedAtom {
    pub(crate) id: u16,
    pub(crate) exponent: u8,
    pub(crate) coefficients: Vec<i8>,
}

/// Vectors as coefficients in a basis.
pub(crate) struct Coder {
    pub(crate) basis: Basis,
    /// By component, in units of length along it.
    pub(crate) steps: Vec<f32>,
    /// By component: whether it is the one before it once more, in finer steps.
    pub(crate) again: Vec<bool>,
    /// By number of components: mean square error of quantising them all.
    noise: Vec<f64>,
}

impl Coder {
    pub(crate) fn new(basis: Basis, allowed: f64, length: usize) -> Self {
        // One step for all components is best for the mean square error. Where most coefficients would not fit 8 bits, they
        // are two digits: the component stands in the basis twice, in coarse steps and in fine ones.
        let step = allowed * (12.0 / length as f64).sqrt();
        let (mut digits, mut steps, mut again) = (Basis::default(), Vec::new(), Vec::new());
        for component in 0..basis.vectors.len() {
            let over = 4.0 * f64::from(basis.strengths[component]) / (127.0 * step);
            let coarse = step * over.log2().ceil().max(0.0).exp2();
            let fine = step.max(coarse / 128.0);
            let left = Atoms::MOST_COEFFICIENTS - digits.vectors.len() - (basis.vectors.len() - component);
            let both = [(coarse, false), (fine, true)];
            for (step, is_again) in both.into_iter().take(if coarse > step && left > 0 { 2 } else { 1 }) {
                digits.vectors.push(basis.vectors[component].clone());
                digits.units.push(basis.units[component].clone());
                digits.per_unit.push(basis.per_unit[component]);
                digits.strengths.push(basis.strengths[component]);
                steps.push(step as f32);
                again.push(is_again);
            }
        }
        let mut noise = vec![0.0];
        for (index, step) in steps.iter().enumerate() {
            let of_step = f64::from(*step).powi(2) / 12.0;
            // The fine digit's takes the place of the coarse one's.
            let before = noise[if again[index] { index - 1 } else { index }];
            noise.push(before + of_step);
        }
        Self { basis: digits, steps, again, noise }
    }

    /// Codes `values` to about `error`; leaves what is lost.
    pub(crate) fn code(&self, id: u16, values: &mut [f32], error: f64) -> OwnedAtom {
        // One after the other: units are not quite orthogonal, so what the earlier ones say must not be said again.
        let mut left = values.to_vec();
        let exact: Vec<f32> = self
            .basis
            .units
            .iter()
            .zip(&self.again)
            .map(|(unit, again)| {
                let value = if *again { 0.0 } else { dot(unit, &left) };
                left.iter_mut().zip(unit).for_each(|(left, unit)| *left -= value * unit);
                value
            })
            .collect();
        let (length, exponent) = self.shape(&exact, error);
        let scale = ((exponent - EXPONENT) as f32).exp2();
        let mut coefficients = vec![0i8; length];
        for (component, (coefficient, unit)) in coefficients.iter_mut().zip(&self.basis.units).enumerate() {
            let step = self.steps[component] * scale;
            *coefficient = quantise(dot(unit, values) / step);
            if *coefficient != 0 {
                let value = f32::from(*coefficient) * step;
                values.iter_mut().zip(unit).for_each(|(left, unit)| *left -= value * unit);
            }
        }
        atom(id, exponent, coefficients)
    }

    /// Codes coefficients along the first components.
    pub(crate) fn code_coefficients(&self, id: u16, exact: &[f32], error: f64) -> OwnedAtom {
        let (length, exponent) = self.shape(exact, error);
        let scale = ((exponent - EXPONENT) as f32).exp2();
        let mut left = 0.0;
        let coefficients = exact[..length].iter().zip(&self.steps).zip(&self.again).map(|((value, step), again)| {
            let value = if *again { left } else { *value };
            let coefficient = quantise(value / (step * scale));
            left = value - f32::from(coefficient) * step * scale;
            coefficient
        });
        atom(id, exponent, coefficients.collect())
    }

    /// How many coefficients to keep, and their exponent: half of the error, as power, may be in what is left off, half in
    /// what is quantised. The exponent is larger if they would not fit otherwise.
    fn shape(&self, exact: &[f32], error: f64) -> (usize, i32) {
        let power = error * error / 2.0;
        let mut length = exact.len();
        let mut left = 0.0;
        while length > 0 {
            left += f64::from(exact[length - 1]).powi(2);
            if left > power {
                break;
            }
            length -= 1;
        }
        if length > 0 && length < exact.len() && self.again[length] {
            length += 1;
        }
        let over = exact[..length]
            .iter()
            .zip(&self.steps)
            .fold(0.0f32, |over, (value, step)| over.max(value.abs() / (127.0 * step)));
        let fits = if over > 0.0 { over.log2().ceil() as i32 } else { i32::MIN / 2 };
        let fine = (power / self.noise[length].max(f64::MIN_POSITIVE)).log2() / 2.0;
        let most = i32::from(Atoms::EXPONENTS) - 1;
        (length, (fits.max(fine.floor().clamp(-100.0, 100.0) as i32) + EXPONENT).clamp(0, most))
    }

    pub(crate) fn decode(&self, atom: &OwnedAtom, weight: f32) -> Vec<f32> {
        let mut values = vec![0.0; self.basis.units.first().map_or(0, Vec::len)];
        let scale = (f32::from(atom.exponent) - EXPONENT as f32).exp2() * weight;
        for ((coefficient, step), unit) in atom.coefficients.iter().zip(&self.steps).zip(&self.basis.units) {
            let value = f32::from(*coefficient) * step * scale;
            values.iter_mut().zip(unit).for_each(|(sum, unit)| *sum += value * unit);
        }
        values
    }
}

/// To the nearest, but a little more readily to zero: zeros cost least.
fn quantise(value: f32) -> i8 {
    (value.signum() * (value.abs() + 0.42).floor()).clamp(-127.0, 127.0) as i8
}

fn atom(id: u16, exponent: i32, mut coefficients: Vec<i8>) -> OwnedAtom {
    let length = coefficients.iter().rposition(|value| *value != 0).map_or(0, |last| last + 1);
    coefficients.truncate(length);
    OwnedAtom { id, exponent: exponent as u8, coefficients }
}
