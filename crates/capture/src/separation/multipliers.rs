//! The normal equations of one table, solved.
//!
//! A square is g + v (λ + μ): what was expected of it, its variance, the multipliers of its row and of its column. With a
//! margin of variance σ², every row says Σ (g + v (λ + μ)) + σ² λ = its photograph, and every column the same of μ.
//!
//! In λ and −μ this is a network of conductances: v joins a row with a column, σ² a line with the ground. Lines are eliminated
//! one after the other; each leaves conductances between those that it joined, and the sum of what leaves a line is added up anew
//! from its parts. So nothing is ever subtracted (Grassmann, Taksar & Heyman 1985), and small conductances beside large ones,
//! dim squares beside bright ones, keep all their digits.

use super::lanes::{Lanes, add};

/// Variances below this are none: its inverse is far from infinity.
const NOTHING: f32 = 1e-30;

/// One family of margins of a table.
pub(super) struct Family<const W: usize> {
    /// 1 over the variances of a margin and of all its squares together; before [`Family::weigh`] the variances themselves.
    pub(super) weights: Vec<Lanes<W>>,
    /// What the squares of a line add up to.
    pub(super) sums: Vec<Lanes<W>>,
    /// λ, or μ.
    pub(super) multipliers: Vec<Lanes<W>>,
}

impl<const W: usize> Family<W> {
    pub(super) fn new() -> Self {
        Self { weights: Vec::new(), sums: Vec::new(), multipliers: Vec::new() }
    }

    /// Begins with margins of these variances, without squares.
    #[inline(always)]
    pub(super) fn begin(&mut self, variances: &[Lanes<W>]) {
        self.weights.clear();
        self.weights.extend_from_slice(variances);
        self.sums.clear();
        self.sums.resize(variances.len(), [0.0; W]);
        self.multipliers.resize(variances.len(), [0.0; W]);
    }

    /// When all squares are added.
    #[inline(always)]
    pub(super) fn weigh(&mut self) {
        self.weights.iter_mut().for_each(|weight| *weight = inverse(weight));
    }
}

/// Working memory of the solution.
pub(super) struct Solver<const W: usize> {
    /// Variances of squares times the weights of their columns, `[row][column]`.
    weighted: Vec<Lanes<W>>,
    /// What joins a row with those before it, row by row; once a row is eliminated, as a share of all that leaves it.
    joined: Vec<Lanes<W>>,
    /// What joins a row with the ground.
    ground: Vec<Lanes<W>>,
    /// 1 over all that leaves a row when it is eliminated.
    pivots: Vec<Lanes<W>>,
    /// What rows and columns lack.
    lacking: [Vec<Lanes<W>>; 2],
}

impl<const W: usize> Solver<W> {
    pub(super) fn new() -> Self {
        let none = Vec::new;
        Self { weighted: none(), joined: none(), ground: none(), pivots: none(), lacking: [none(), none()] }
    }

    /// Finds the multipliers of `rows` and `columns` of a table: photographs and their variances of rows and of columns, and
    /// `variance` of squares, `[row][column]`.
    #[inline(always)]
    pub(super) fn solve(
        &mut self,
        variance: &[Lanes<W>],
        margins: [&[Lanes<W>]; 2],
        of_margins: [&[Lanes<W>]; 2],
        rows: &mut Family<W>,
        columns: &mut Family<W>,
    ) {
        for (lacking, (margins, family)) in self.lacking.iter_mut().zip(margins.into_iter().zip([&*rows, &*columns])) {
            lacking.clear();
            lacking.extend(margins.iter().zip(&family.sums).map(|(margin, sum)| difference(margin, sum)));
        }
        self.eliminate_columns(variance, of_margins, columns);
        self.eliminate_rows();
        let [right, of_columns] = &mut self.lacking;
        let count = right.len();
        for row in 1..count {
            let (before, own) = right.split_at_mut(row);
            for (share, value) in self.joined[before_row(row)..].iter().zip(before) {
                add_product(&mut own[0], share, value);
            }
        }
        right.iter_mut().zip(&self.pivots).for_each(|(value, pivot)| multiply(value, pivot));
        for row in (1..count).rev() {
            let (before, own) = right.split_at_mut(row);
            for (share, value) in self.joined[before_row(row)..].iter().zip(before) {
                add_product(value, share, &own[0]);
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

    /// The network of the rows alone, and what they lack when columns are done.
    #[inline(always)]
    fn eliminate_columns(&mut self, variance: &[Lanes<W>], of_margins: [&[Lanes<W>]; 2], columns: &Family<W>) {
        let across = columns.weights.len();
        let [of_rows, of_columns] = of_margins;
        self.weighted.clear();
        for of_row in variance.chunks_exact(across) {
            let products = of_row.iter().zip(&columns.weights).map(|(variance, weight)| product(variance, weight));
            self.weighted.extend(products);
        }
        self.joined.clear();
        self.ground.clear();
        self.ground.extend_from_slice(of_rows);
        let [lacking, of_lacking_columns] = &mut self.lacking;
        for (row, weighted) in self.weighted.chunks_exact(across).enumerate() {
            for of_other in variance.chunks_exact(across).take(row) {
                let mut joined = [0.0; W];
                for (weighted, variance) in weighted.iter().zip(of_other) {
                    add_product(&mut joined, weighted, variance);
                }
                self.joined.push(joined);
            }
            for ((weighted, of_column), of_lacking) in weighted.iter().zip(of_columns).zip(&*of_lacking_columns) {
                add_product(&mut self.ground[row], weighted, of_column);
                subtract_product(&mut lacking[row], weighted, of_lacking);
            }
        }
    }

    #[inline(always)]
    fn eliminate_rows(&mut self) {
        let count = self.ground.len();
        self.pivots.clear();
        for pivot in 0..count {
            let mut leaving = self.ground[pivot];
            for row in pivot + 1..count {
                add(&mut leaving, &self.joined[before_row(row) + pivot]);
            }
            let per_leaving = inverse(&leaving);
            let to_ground = self.ground[pivot];
            for row in pivot + 1..count {
                let share = product(&self.joined[before_row(row) + pivot], &per_leaving);
                add_product(&mut self.ground[row], &share, &to_ground);
                for other in pivot + 1..row {
                    // Rows from this one on still have what joined them with the pivot.
                    let joined = self.joined[before_row(other) + pivot];
                    add_product(&mut self.joined[before_row(row) + other], &share, &joined);
                }
            }
            for row in pivot + 1..count {
                multiply(&mut self.joined[before_row(row) + pivot], &per_leaving);
            }
            self.pivots.push(per_leaving);
        }
    }
}

/// Where the rows before a row stand for it.
fn before_row(row: usize) -> usize {
    row * row.saturating_sub(1) / 2
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

#[inline(always)]
fn add_product<const W: usize>(value: &mut Lanes<W>, a: &Lanes<W>, b: &Lanes<W>) {
    (0..W).for_each(|lane| value[lane] += a[lane] * b[lane]);
}

/// 1/value; of nothing a large number.
#[inline(always)]
fn inverse<const W: usize>(value: &Lanes<W>) -> Lanes<W> {
    std::array::from_fn(|lane| 1.0 / if value[lane] > NOTHING { value[lane] } else { NOTHING })
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
                rows.weights[j][0] += variance;
                columns.weights[i][0] += variance;
            }
            rows.weigh();
            columns.weigh();
            let of_margins = [vec![[self.of_margins]; margins[0].len()], vec![[self.of_margins]; across]];
            let (margins, of_margins) =
                (margins.each_ref().map(Vec::as_slice), of_margins.each_ref().map(Vec::as_slice));
            Solver::new().solve(&lanes(&self.variance), margins, of_margins, &mut rows, &mut columns);
            let step = |square: usize| rows.multipliers[square / across][0] + columns.multipliers[square % across][0];
            (0..self.light.len()).map(|square| f64::from(self.variance[square] * step(square))).collect()
        }

        /// The same from all equations at once, by Gaussian elimination in double precision.
        fn plainly(&self) -> Vec<f64> {
            let (down, across) = (self.margins[0].len(), self.margins[1].len());
            let count = down + across;
            let mut system = vec![vec![0.0f64; count + 1]; count];
            for (line, margin) in self.margins.iter().flatten().enumerate() {
                system[line][line] += f64::from(self.of_margins);
                system[line][count] += f64::from(*margin);
            }
            for (square, (light, variance)) in self.light.iter().zip(&self.variance).enumerate() {
                let (row, column) = (square / across, down + square % across);
                for (line, other) in [(row, column), (column, row)] {
                    system[line][line] += f64::from(*variance);
                    system[line][other] += f64::from(*variance);
                    system[line][count] -= f64::from(*light);
                }
            }
            for pivot in 0..count {
                let own = system[pivot].clone();
                for line in (0..count).filter(|line| *line != pivot) {
                    let factor = system[line][pivot] / own[pivot];
                    system[line].iter_mut().zip(&own).for_each(|(entry, own)| *entry -= factor * own);
                }
            }
            let multiplier = |line: usize| system[line][count] / system[line][line];
            let step = |square: usize| multiplier(square / across) + multiplier(down + square % across);
            (0..self.light.len()).map(|square| f64::from(self.variance[square]) * step(square)).collect()
        }
    }

    #[test]
    fn the_solution_is_that_of_all_equations_in_double_precision() {
        let mut random = Pcg64Mcg::seed_from_u64(1940);
        for (down, across) in [(1, 1), (1, 6), (6, 5), (5, 6), (16, 16)] {
            for snr in [0.0, 3.0, 30.0, 150.0, 1000.0] {
                let case = Case::new(down, across, snr, &mut random);
                let (found, expected) = (case.solved(), case.plainly());
                let worst = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                // In standard deviations of a photograph. λ and μ of a bright square are far larger than their sum.
                let bound = 1e-3 + 4e-7 * f64::from(snr).powi(2);
                assert!(worst < bound, "{down} × {across}, brightest {snr} σ: {worst} σ");
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
