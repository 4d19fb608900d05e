//! From the sketches of all positions to the basis and the atoms of a patch.

use half::slice::HalfFloatSliceExt;

use crate::packed::basis::{Basis, Enough, dot, norm};
use crate::packed::sketch::{PatchSketch, QUARTERS, quarter, quarter_sizes};
use crate::packed::{Atoms, Groups, Kept};

/// The errors of a square's parts add up, and the picture of one square is dimmer than that of all: what is allowed for is
/// this share of the error asked for.
const ALLOWED: f64 = 0.75;

/// A square is kept by itself if it shows more than this share of the error, as norms over a patch.
pub(crate) const SQUARE_SHARE: f64 = 0.6;

/// Errors of the whole, of squares and of groups, over what is allowed.
const OF_WHOLE: f64 = 0.6;
const OF_SQUARE: f64 = 0.6;
const OF_GROUP: f64 = 0.2;

/// The basis may leave this share of what is allowed.
const OF_BASIS: f64 = 0.65;

/// Components that groups are coded in: what is left is smooth. Each may be two digits.
const GROUP_COMPONENTS: usize = 4;
const GROUP_RANK: usize = 2 * GROUP_COMPONENTS;

/// The exponent of coefficients that count whole steps; smaller ones count parts of them.
const EXPONENT: i32 = 12;

/// The most vectors of a basis.
const MOST_RANK: usize = 128;

/// A patch, packed.
#[derive(Debug, Default)]
pub(crate) struct PackedPatch {
    /// `[component][channel · row · column]`.
    pub(crate) vectors: Vec<Vec<i8>>,
    /// By component: what a coefficient of exponent 0 is worth.
    pub(crate) steps: Vec<f32>,
    /// By position: the atoms, the whole first.
    pub(crate) atoms: Vec<Vec<OwnedAtom>>,
    /// Where the light went.
    pub(crate) kept: Kept,
}

/// An atom with coefficients of its own.
#[derive(Debug)]
pub(crate) struct OwnedAtom {
    pub(crate) id: u16,
    pub(crate) exponent: u8,
    pub(crate) coefficients: Vec<i8>,
}

/// Packs a patch of `height` × `width` pixels, seen from all positions, for M = `squares`, so that no square of any position
/// is off by much more than `error` times what all squares of one position show, root mean square over positions.
pub(crate) fn pack_patch(
    [height, width]: [usize; 2],
    squares: usize,
    positions: &[&PatchSketch],
    error: f64,
) -> PackedPatch {
    let length = 3 * height * width;
    let lit: Vec<&[f32]> = positions.iter().map(|sketch| &sketch.whole[..]).filter(|whole| !whole.is_empty()).collect();
    let power = lit.iter().map(|whole| f64::from(dot(whole, whole))).sum::<f64>() / positions.len() as f64;
    if power <= 0.0 {
        return PackedPatch { atoms: positions.iter().map(|_| Vec::new()).collect(), ..PackedPatch::default() };
    }
    let allowed = ALLOWED * error * power.sqrt();
    let groups = Groups::new(squares);
    let least = SQUARE_SHARE * error * power.sqrt();
    let parts: Vec<Parts> =
        positions.iter().map(|sketch| Parts::of(sketch, &groups, [height, width], least)).collect();
    let mut rows: Vec<Vec<f32>> = lit.iter().map(|whole| whole.to_vec()).collect();
    rows.extend(parts.iter().flat_map(|parts| parts.squares.iter().map(|(_, values)| values.clone())));
    let basis = Basis::of_rows(&rows, &Enough { residual: OF_BASIS * allowed, rank: MOST_RANK });
    let coder = Coder::new(basis, allowed, length);
    let smooth = Smooth::new(&coder, [height, width]);
    let mut kept = Kept::default();
    let sizes = groups.sizes();
    let m2 = squares * squares;
    let atoms = positions
        .iter()
        .zip(parts)
        .map(|(sketch, parts)| {
            let mut atoms = Vec::new();
            if sketch.whole.is_empty() {
                return atoms;
            }
            let mut left = sketch.whole.clone();
            atoms.push(coder.code(sketch.main, &mut left, OF_WHOLE * allowed));
            kept.whole += sum(&sketch.whole);
            kept.power += f64::from(dot(&sketch.whole, &sketch.whole));
            kept.residual += f64::from(dot(&left, &left));
            // Groups first: squares are coded as what they show beyond their group's share.
            let mut members = sizes.clone();
            for square in parts.squares.iter().map(|(square, _)| *square).chain([sketch.main]) {
                members[groups.of(usize::from(square))] -= 1;
            }
            let mut shares: Vec<Option<Vec<f32>>> = vec![None; groups.len()];
            let mut of_groups = Vec::new();
            for group in (0..groups.len()).filter(|group| members[*group] > 0) {
                let spread = sizes[group] as f32 / members[group] as f32;
                let rest = &parts.rest[group * 3 * QUARTERS..][..3 * QUARTERS];
                let atom = coder.code_coefficients((m2 + group) as u16, &smooth.fit(rest, spread), OF_GROUP * allowed);
                if !atom.coefficients.is_empty() {
                    let share = coder.decode(&atom, 1.0 / sizes[group] as f32);
                    kept.coarse += sum(&share) * members[group] as f64;
                    shares[group] = Some(share);
                    of_groups.push(atom);
                }
            }
            for (square, mut values) in parts.squares {
                kept.squares += sum(&values);
                if let Some(share) = &shares[groups.of(usize::from(square))] {
                    values.iter_mut().zip(share).for_each(|(value, share)| *value -= share);
                }
                let atom = coder.code(square, &mut values, OF_SQUARE * allowed);
                if !atom.coefficients.is_empty() {
                    atoms.push(atom);
                }
            }
            atoms.extend(of_groups);
            atoms
        })
        .collect();
    let Coder { basis, steps, .. } = coder;
    let scale = 0.5f32.powi(EXPONENT);
    PackedPatch {
        steps: steps.iter().zip(&basis.per_unit).map(|(step, per_unit)| step * per_unit * scale).collect(),
        vectors: basis.vectors,
        atoms,
        kept,
    }
}

fn sum(values: &[f32]) -> f64 {
    values.iter().map(|value| f64::from(*value)).sum()
}

/// A sketch cut at the error: squares that show less have gone to the rest of their group.
struct Parts {
    squares: Vec<(u16, Vec<f32>)>,
    rest: Vec<f32>,
}

impl Parts {
    fn of(sketch: &PatchSketch, groups: &Groups, [height, width]: [usize; 2], least: f64) -> Self {
        let mut squares = Vec::new();
        let mut rest = sketch.rest.clone();
        let sizes = quarter_sizes(height, width);
        for (square, halves) in &sketch.squares {
            let mut values = vec![0.0; halves.len()];
            halves.convert_to_f32_slice(&mut values);
            values.iter_mut().for_each(|value| *value *= sketch.scale);
            if f64::from(norm(&values)) > least {
                squares.push((*square, values));
                continue;
            }
            let rest = &mut rest[groups.of(usize::from(*square)) * 3 * QUARTERS..][..3 * QUARTERS];
            for (index, value) in values.iter().enumerate() {
                let (channel, pixel) = (index / (height * width), index % (height * width));
                let quarter = quarter(pixel / width, height, pixel % width, width);
                rest[channel * QUARTERS + quarter] += value / sizes[quarter] as f32;
            }
        }
        Self { squares, rest }
    }
}

/// Vectors as coefficients in a basis.
struct Coder {
    basis: Basis,
    /// By component, in units of length along it.
    steps: Vec<f32>,
    /// By component: whether it is the one before it once more, in finer steps.
    again: Vec<bool>,
    /// By number of components: mean square error of quantising them all.
    noise: Vec<f64>,
}

impl Coder {
    fn new(basis: Basis, allowed: f64, length: usize) -> Self {
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
    fn code(&self, id: u16, values: &mut [f32], error: f64) -> OwnedAtom {
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
    fn code_coefficients(&self, id: u16, exact: &[f32], error: f64) -> OwnedAtom {
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
        let over = exact[..length].iter().zip(&self.steps).fold(0.0f32, |over, (value, step)| over.max(value.abs() / (127.0 * step)));
        let fits = if over > 0.0 { over.log2().ceil() as i32 } else { i32::MIN / 2 };
        let fine = (power / self.noise[length].max(f64::MIN_POSITIVE)).log2() / 2.0;
        let most = i32::from(Atoms::EXPONENTS) - 1;
        (length, (fits.max(fine.floor().clamp(-100.0, 100.0) as i32) + EXPONENT).clamp(0, most))
    }

    fn decode(&self, atom: &OwnedAtom, weight: f32) -> Vec<f32> {
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

/// Fits the first components to means of quarters, which are all that is known of a remainder.
struct Smooth {
    /// `[component][channel · quarter]`: coefficients = this × means.
    inverse: Vec<[f32; 3 * QUARTERS]>,
}

impl Smooth {
    fn new(Coder { basis, again, .. }: &Coder, [height, width]: [usize; 2]) -> Self {
        let next = (0..basis.units.len()).filter(|component| !again[*component]).nth(GROUP_COMPONENTS);
        let rank = next.unwrap_or(basis.units.len());
        let sizes = quarter_sizes(height, width);
        let means: Vec<[f64; 3 * QUARTERS]> = basis.units[..rank]
            .iter()
            .zip(again)
            .map(|(unit, again)| {
                let mut means = [0.0; 3 * QUARTERS];
                // A second digit takes what the first leaves.
                if *again {
                    return means;
                }
                for (index, value) in unit.iter().enumerate() {
                    let (channel, pixel) = (index / (height * width), index % (height * width));
                    let quarter = quarter(pixel / width, height, pixel % width, width);
                    means[channel * QUARTERS + quarter] += f64::from(*value) / sizes[quarter] as f64;
                }
                means
            })
            .collect();
        // Least squares, held back where the means say little: (BᵀB + ν Λ⁻¹) c = Bᵀ m with Λ the components' own strengths.
        let first_digits = basis.strengths.iter().zip(again).filter(|(_, again)| !**again);
        let power: f64 = first_digits.map(|(strength, _)| f64::from(*strength).powi(2)).sum();
        let doubt = 0.01 * power / (3 * height * width) as f64;
        let mut matrix = [[0.0; GROUP_RANK]; GROUP_RANK];
        for (i, row) in matrix.iter_mut().enumerate().take(rank) {
            for (j, entry) in row.iter_mut().enumerate().take(rank) {
                *entry = means[i].iter().zip(&means[j]).map(|(a, b)| a * b).sum();
            }
            row[i] += doubt / f64::from(basis.strengths[i]).powi(2).max(f64::MIN_POSITIVE);
        }
        let mut inverse = vec![[0.0f32; 3 * QUARTERS]; rank];
        for mean in 0..3 * QUARTERS {
            let column: Vec<f64> = means.iter().map(|of_component| of_component[mean]).collect();
            for (component, value) in solve(matrix, &column).into_iter().enumerate().take(rank) {
                inverse[component][mean] = value as f32;
            }
        }
        Self { inverse }
    }

    fn fit(&self, means: &[f32], scale: f32) -> Vec<f32> {
        self.inverse.iter().map(|row| scale * row.iter().zip(means).map(|(a, b)| a * b).sum::<f32>()).collect()
    }
}

/// Solves a small positive definite system by elimination.
fn solve(mut matrix: [[f64; GROUP_RANK]; GROUP_RANK], right: &[f64]) -> Vec<f64> {
    let mut x = right.to_vec();
    let n = x.len();
    for i in 0..n {
        for j in i + 1..n {
            let factor = matrix[j][i] / matrix[i][i];
            for k in i..n {
                matrix[j][k] -= factor * matrix[i][k];
            }
            x[j] -= factor * x[i];
        }
    }
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|j| matrix[i][j] * x[j]).sum();
        x[i] = (x[i] - known) / matrix[i][i];
    }
    x
}
