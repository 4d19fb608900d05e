//! What is left of a group of squares, known by the means of quarters of a patch only, in the first components of its basis.

use crate::packed::coder::Coder;
use crate::packed::sketch::{QUARTERS, quarter, quarter_sizes};

/// Components that groups are coded in: what is left is smooth. Each may be two digits.
const GROUP_COMPONENTS: usize = 4;
const GROUP_RANK: usize = 2 * GROUP_COMPONENTS;

/// Fits the first components to means of quarters, which are all that is known of a remainder.
pub(crate) struct Smooth {
    /// `[component][channel · quarter]`: coefficients = this × means.
    inverse: Vec<[f32; 3 * QUARTERS]>,
}

impl Smooth {
    pub(crate) fn new(Coder { basis, again, .. }: &Coder, [height, width]: [usize; 2]) -> Self {
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

    /// The coefficients of `scale` times a remainder with these means, `[channel][quarter]`.
    pub(crate) fn fit(&self, means: &[f32], scale: f32) -> Vec<f32> {
        self.inverse.iter().map(|row| scale * row.iter().zip(means).map(|(a, b)| a * b).sum::<f32>()).collect()
    }
}

/// Solves a small positive definite system by elimination.
fn solve(mut matrix: [[f64; GROUP_RANK]; GROUP_RANK], right: &[f64]) -> Vec<f64> {
    let mut x = right.to_vec();
    let n = x.len();
    for i in 0..n {
        for j in i + 1..n {
            let pivot = matrix[i];
            let factor = matrix[j][i] / pivot[i];
            matrix[j].iter_mut().zip(pivot).skip(i).for_each(|(entry, above)| *entry -= factor * above);
            x[j] -= factor * x[i];
        }
    }
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|j| matrix[i][j] * x[j]).sum();
        x[i] = (x[i] - known) / matrix[i][i];
    }
    x
}
