//! Vectors as 8-bit coefficients in a basis.

use crate::packed::Atoms;
use crate::packed::basis::{Basis, sum};
use crate::packed::product::Matrix;

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
    /// The units as columns.
    units: Matrix,
    /// What every unit shows along every other: they are not quite orthogonal.
    gram: Vec<Vec<f32>>,
    /// The sum of the values of each unit.
    sums: Vec<f64>,
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
        let units = Matrix::of_columns(&digits.units);
        let gram = units.times(&digits.units);
        let sums = digits.units.iter().map(|unit| sum(unit)).collect();
        Self { basis: digits, steps, again, noise, units, gram, sums }
    }

    /// What each of `vectors` shows along each component.
    pub(crate) fn along<V: AsRef<[f32]>>(&self, vectors: &[V]) -> Vec<Vec<f32>> {
        self.units.times(vectors)
    }

    /// Codes to about `error` a vector that is `along` the components.
    pub(crate) fn code(&self, id: u16, mut along: Vec<f32>, error: f64) -> OwnedAtom {
        let (length, exponent) = self.shape(&exact_parts(&along, &self.again, &self.gram), error);
        let scale = ((exponent - EXPONENT) as f32).exp2();
        atom(id, exponent, quantised_parts(&mut along[..length], &self.steps, scale, &self.gram))
    }

    /// Takes from a vector that is `along` the components what `weight` times an atom says.
    pub(crate) fn take_off(&self, along: &mut [f32], atom: &OwnedAtom, weight: f32) {
        for (component, value) in self.values(atom, weight).enumerate() {
            take_off(along, value, &self.gram[component]);
        }
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

    /// What atoms say, as vectors.
    pub(crate) fn decode<'a>(&self, atoms: impl Iterator<Item = &'a OwnedAtom>) -> Vec<Vec<f32>> {
        let values: Vec<Vec<f32>> = atoms.map(|atom| self.values(atom, 1.0).collect()).collect();
        Matrix::of_rows(&self.basis.units).times(&values)
    }

    /// The sum of the values of `weight` times what an atom says.
    pub(crate) fn sum(&self, atom: &OwnedAtom, weight: f32) -> f64 {
        self.values(atom, weight).zip(&self.sums).map(|(value, sum)| f64::from(value) * sum).sum()
    }

    /// `weight` times the coefficients of an atom, in units of length.
    fn values(&self, atom: &OwnedAtom, weight: f32) -> impl Iterator<Item = f32> {
        let scale = (f32::from(atom.exponent) - EXPONENT as f32).exp2() * weight;
        atom.coefficients.iter().zip(&self.steps).map(move |(coefficient, step)| f32::from(*coefficient) * step * scale)
    }
}

// One component after the other: what the earlier ones say must not be said again.

relumine_radiometry::for_this_machine! {
    /// The parts of a vector along its components, each less what the ones before it say; 0 for second digits.
    fn exact_parts(along: &[f32], again: &[bool], gram: &[Vec<f32>]) -> Vec<f32> = exact_parts_plain
}

#[inline(always)]
fn exact_parts_plain(along: &[f32], again: &[bool], gram: &[Vec<f32>]) -> Vec<f32> {
    let mut exact = along.to_vec();
    for component in 0..exact.len() {
        if again[component] {
            exact[component] = 0.0;
        } else {
            let (before, after) = exact.split_at_mut(component + 1);
            take_off(after, before[component], &gram[component][component + 1..]);
        }
    }
    exact
}

relumine_radiometry::for_this_machine! {
    /// The coefficients of a vector, each of what the ones before it leave.
    fn quantised_parts(along: &mut [f32], steps: &[f32], scale: f32, gram: &[Vec<f32>]) -> Vec<i8> = quantised_parts_plain
}

#[inline(always)]
fn quantised_parts_plain(along: &mut [f32], steps: &[f32], scale: f32, gram: &[Vec<f32>]) -> Vec<i8> {
    let mut coefficients = vec![0i8; along.len()];
    for (component, coefficient) in coefficients.iter_mut().enumerate() {
        let step = steps[component] * scale;
        let (before, after) = along.split_at_mut(component + 1);
        *coefficient = quantise(before[component] / step);
        if *coefficient != 0 {
            take_off(after, f32::from(*coefficient) * step, &gram[component][component + 1..]);
        }
    }
    coefficients
}

#[inline(always)]
fn take_off(along: &mut [f32], value: f32, gram: &[f32]) {
    along.iter_mut().zip(gram).for_each(|(left, gram)| *left -= value * gram);
}

/// To the nearest, but a little more readily to zero: zeros cost least.
#[inline(always)]
fn quantise(value: f32) -> i8 {
    (value.signum() * (value.abs() + 0.42).floor()).clamp(-127.0, 127.0) as i8
}

fn atom(id: u16, exponent: i32, mut coefficients: Vec<i8>) -> OwnedAtom {
    let length = coefficients.iter().rposition(|value| *value != 0).map_or(0, |last| last + 1);
    coefficients.truncate(length);
    OwnedAtom { id, exponent: exponent as u8, coefficients }
}
