//! The normal equations of one table, solved.
//!
//! A square is g + v (λ + μ): what was expected of it, its variance, the multipliers of its row and of its column. With a
//! margin of variance σ², every row says Σ (g + v (λ + μ)) + σ² λ = its photograph, and every column the same of μ. The μ
//! are eliminated; what is left for the λ is symmetric and positive, and is factorised as L D Lᵀ.
//!
//! Where squares are far more uncertain than photographs, rows and columns may pass light to each other at next to no cost:
//! λ and μ are uncertain by a common number that cancels in the squares. A pivot of such a direction is rounding, and is held
//! above [`PIVOT`]; a sweep over rows and columns afterwards takes what is left.

use super::lanes::Lanes;

/// Least pivot, as a share of the diagonal it came from.
const PIVOT: f32 = 1e-6;
/// Variances below this are none: its inverse is far from infinity.
const NOTHING: f32 = 1e-30;

/// One family of margins of a table.
pub(super) struct Family<const W: usize> {
    /// The variance of a margin and of all its squares together, and 1 over it.
    pub(super) variances: Vec<Lanes<W>>,
    pub(super) weights: Vec<Lanes<W>>,
    /// What the squares of a line add up to.
    pub(super) sums: Vec<Lanes<W>>,
    /// λ, or μ.
    pub(super) multipliers: Vec<Lanes<W>>,
}

impl<const W: usize> Family<W> {
    pub(super) fn new() -> Self {
        Self { variances: Vec::new(), weights: Vec::new(), sums: Vec::new(), multipliers: Vec::new() }
    }

    /// Begins with margins of these variances, without squares.
    #[inline(always)]
    pub(super) fn begin(&mut self, variances: &[Lanes<W>]) {
        self.variances.clear();
        self.variances.extend_from_slice(variances);
        self.sums.clear();
        self.sums.resize(variances.len(), [0.0; W]);
        self.weights.resize(variances.len(), [0.0; W]);
        self.multipliers.resize(variances.len(), [0.0; W]);
    }

    /// When all squares are added.
    #[inline(always)]
    pub(super) fn weigh(&mut self) {
        for (weight, variance) in self.weights.iter_mut().zip(&self.variances) {
            *weight = inverse(variance, &[NOTHING; W]);
        }
    }
}

/// Working memory of the solution.
pub(super) struct Solver<const W: usize> {
    /// Variances of squares times the weights of their columns, `[row][column]`.
    weighted: Vec<Lanes<W>>,
    /// The lower triangle, row by row; L once it is factorised.
    system: Vec<Lanes<W>>,
    /// 1/D.
    pivots: Vec<Lanes<W>>,
    /// What rows and columns lack.
    lacking: [Vec<Lanes<W>>; 2],
}

impl<const W: usize> Solver<W> {
    pub(super) fn new() -> Self {
        Self { weighted: Vec::new(), system: Vec::new(), pivots: Vec::new(), lacking: [Vec::new(), Vec::new()] }
    }

    /// Finds the multipliers of `rows` and `columns`, whose photographs are `margins` and whose squares have the `variance`
    /// `[row][column]`.
    #[inline(always)]
    pub(super) fn solve(
        &mut self,
        variance: &[Lanes<W>],
        margins: [&[Lanes<W>]; 2],
        rows: &mut Family<W>,
        columns: &mut Family<W>,
    ) {
        for (lacking, (margins, family)) in self.lacking.iter_mut().zip(margins.into_iter().zip([&*rows, &*columns])) {
            lacking.clear();
            lacking.extend(margins.iter().zip(&family.sums).map(|(margin, sum)| difference(margin, sum)));
        }
        self.eliminate(variance, rows, columns);
        self.factorise();
        let [right, of_columns] = &mut self.lacking;
        let count = right.len();
        for row in 1..count {
            let (before, own) = right.split_at_mut(row);
            for (entry, value) in self.system[triangle(row)..].iter().zip(before) {
                subtract_product(&mut own[0], entry, value);
            }
        }
        right.iter_mut().zip(&self.pivots).for_each(|(value, pivot)| multiply(value, pivot));
        for row in (1..count).rev() {
            let (before, own) = right.split_at_mut(row);
            for (entry, value) in self.system[triangle(row)..].iter().zip(before) {
                subtract_product(value, entry, &own[0]);
            }
        }
        rows.multipliers.copy_from_slice(right);
        for ((multiplier, lacking), weight) in columns.multipliers.iter_mut().zip(of_columns).zip(&columns.weights) {
            multiply(lacking, weight);
            *multiplier = *lacking;
        }
        for (weighted, of_row) in self.weighted.chunks_exact(columns.weights.len()).zip(&rows.multipliers) {
            for (multiplier, weighted) in columns.multipliers.iter_mut().zip(weighted) {
                subtract_product(multiplier, weighted, of_row);
            }
        }
    }

    /// The system of the rows' multipliers, and its right side in place of what the rows lack.
    #[inline(always)]
    fn eliminate(&mut self, variance: &[Lanes<W>], rows: &Family<W>, columns: &Family<W>) {
        let across = columns.weights.len();
        self.weighted.clear();
        for of_row in variance.chunks_exact(across) {
            self.weighted
                .extend(of_row.iter().zip(&columns.weights).map(|(variance, weight)| product(variance, weight)));
        }
        self.system.clear();
        let [of_rows, of_columns] = &mut self.lacking;
        for (row, weighted) in self.weighted.chunks_exact(across).enumerate() {
            for (other, of_other) in variance.chunks_exact(across).enumerate().take(row + 1) {
                let mut entry = if other == row { rows.variances[row] } else { [0.0; W] };
                for (weighted, variance) in weighted.iter().zip(of_other) {
                    subtract_product(&mut entry, weighted, variance);
                }
                self.system.push(entry);
            }
            for (weighted, lacking) in weighted.iter().zip(&*of_columns) {
                subtract_product(&mut of_rows[row], weighted, lacking);
            }
        }
        self.pivots.clear();
        self.pivots.extend_from_slice(&rows.variances);
    }

    /// L D Lᵀ of the system, in its place.
    #[inline(always)]
    fn factorise(&mut self) {
        let count = self.pivots.len();
        for pivot in 0..count {
            let least = std::array::from_fn(|lane| (PIVOT * self.pivots[pivot][lane]).max(NOTHING));
            self.pivots[pivot] = inverse(&self.system[triangle(pivot) + pivot], &least);
            for row in pivot + 1..count {
                let factor = product(&self.system[triangle(row) + pivot], &self.pivots[pivot]);
                for other in pivot + 1..=row {
                    // Rows from this one on still have what they had in this column.
                    let above = self.system[triangle(other) + pivot];
                    subtract_product(&mut self.system[triangle(row) + other], &factor, &above);
                }
            }
            for row in pivot + 1..count {
                multiply(&mut self.system[triangle(row) + pivot], &self.pivots[pivot]);
            }
        }
    }
}

/// Where a row begins in a lower triangle.
fn triangle(row: usize) -> usize {
    row * (row + 1) / 2
}

#[inline(always)]
fn product<const W: usize>(a: &Lanes<W>, b: &Lanes<W>) -> Lanes<W> {
    std::array::from_fn(|lane| a[lane] * b[lane])
}

#[inline(always)]
fn difference<const W: usize>(a: &Lanes<W>, b: &Lanes<W>) -> Lanes<W> {
    std::array::from_fn(|lane| a[lane] - b[lane])
}

#[inline(always)]
fn multiply<const W: usize>(value: &mut Lanes<W>, factor: &Lanes<W>) {
    (0..W).for_each(|lane| value[lane] *= factor[lane]);
}

#[inline(always)]
fn subtract_product<const W: usize>(value: &mut Lanes<W>, a: &Lanes<W>, b: &Lanes<W>) {
    (0..W).for_each(|lane| value[lane] -= a[lane] * b[lane]);
}

/// 1/value, the value held above `least`.
#[inline(always)]
fn inverse<const W: usize>(value: &Lanes<W>, least: &Lanes<W>) -> Lanes<W> {
    std::array::from_fn(|lane| 1.0 / if value[lane] > least[lane] { value[lane] } else { least[lane] })
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    use super::*;

    /// A table, one lane: light and variances of squares, photographs of rows and columns and their variance.
    struct Case {
        light: Vec<f32>,
        variance: Vec<f32>,
        margins: [Vec<f32>; 2],
        of_margins: f32,
    }

    impl Case {
        /// A table whose brightest square has `snr` times the noise of a photograph.
        fn new(down: usize, across: usize, snr: f32, random: &mut Pcg64Mcg) -> Self {
            let light: Vec<f32> = (0..down * across).map(|_| snr * random.random::<f32>().powi(4)).collect();
            let variance = light.iter().map(|light| light * light + 0.3).collect();
            let mut noisy = |sum: f32| sum + 3.0 * (random.random::<f32>() - 0.5);
            let rows = light.chunks_exact(across).map(|row| noisy(row.iter().sum())).collect();
            let columns = (0..across).map(|i| light.iter().skip(i).step_by(across).sum()).collect::<Vec<f32>>();
            let columns = columns.into_iter().map(&mut noisy).collect();
            Self { light, variance, margins: [rows, columns], of_margins: 1.0 }
        }

        /// What the squares change by, v (λ + μ), as the solver says.
        fn solved(&self) -> Vec<f64> {
            let across = self.margins[1].len();
            let lanes = |values: &[f32]| values.iter().map(|value| [*value]).collect::<Vec<Lanes<1>>>();
            let margins = [lanes(&self.margins[0]), lanes(&self.margins[1])];
            let (mut rows, mut columns) = (Family::<1>::new(), Family::<1>::new());
            rows.begin(&vec![[self.of_margins]; margins[0].len()]);
            columns.begin(&vec![[self.of_margins]; across]);
            for (square, (light, variance)) in self.light.iter().zip(&self.variance).enumerate() {
                let (j, i) = (square / across, square % across);
                rows.sums[j][0] += light;
                columns.sums[i][0] += light;
                rows.variances[j][0] += variance;
                columns.variances[i][0] += variance;
            }
            rows.weigh();
            columns.weigh();
            Solver::new().solve(&lanes(&self.variance), [&margins[0], &margins[1]], &mut rows, &mut columns);
            let step = |square: usize| rows.multipliers[square / across][0] + columns.multipliers[square % across][0];
            (0..self.light.len()).map(|square| f64::from(self.variance[square] * step(square))).collect()
        }

        /// The same by Gauss–Seidel, margin by margin in double precision until nothing moves.
        fn plainly(&self) -> Vec<f64> {
            let across = self.margins[1].len();
            let mut change = vec![0.0f64; self.light.len()];
            let mut multipliers = self.margins.each_ref().map(|family| vec![0.0f64; family.len()]);
            for _ in 0..200_000 {
                let mut most = 0.0f64;
                for family in 0..2 {
                    for line in 0..self.margins[family].len() {
                        let members: Vec<usize> = if family == 0 {
                            (line * across..(line + 1) * across).collect()
                        } else {
                            (line..change.len()).step_by(across).collect()
                        };
                        let sum: f64 =
                            members.iter().map(|member| f64::from(self.light[*member]) + change[*member]).sum();
                        let variance: f64 = members.iter().map(|member| f64::from(self.variance[*member])).sum();
                        let (own, multiplier) = (f64::from(self.of_margins), &mut multipliers[family][line]);
                        let lacking = f64::from(self.margins[family][line]) - sum - own * *multiplier;
                        let step = lacking / (variance + own);
                        *multiplier += step;
                        most = most.max(lacking.abs());
                        members.iter().for_each(|member| change[*member] += f64::from(self.variance[*member]) * step);
                    }
                }
                if most < 1e-9 {
                    break;
                }
            }
            change
        }
    }

    #[test]
    fn the_solution_is_what_sweeps_would_come_to() {
        let mut random = Pcg64Mcg::seed_from_u64(1940);
        for (down, across) in [(1, 1), (1, 6), (6, 5), (5, 6), (16, 16)] {
            for snr in [0.0, 3.0, 30.0, 150.0] {
                let case = Case::new(down, across, snr, &mut random);
                let (found, expected) = (case.solved(), case.plainly());
                // In standard deviations of a photograph.
                let worst = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(worst < 0.02, "{down} × {across}, brightest {snr} σ: {worst} σ");
            }
        }
    }

    #[test]
    fn photographs_without_any_noise_break_nothing() {
        let mut random = Pcg64Mcg::seed_from_u64(7);
        let mut case = Case::new(5, 6, 30.0, &mut random);
        case.of_margins = 0.0;
        assert!(case.solved().iter().all(|change| change.is_finite()));
        case.variance.fill(0.0);
        assert!(case.solved().iter().all(|change| *change == 0.0));
    }
}
