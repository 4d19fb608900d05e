//! What of the margins of a table is light, and what noise.
//!
//! Row combs and column combs photograph the same light twice, the white frame all of it once more, so the photographs
//! themselves say what each margin is worth, in three steps:
//!
//! 1. **Totals** ([`totals`]): of every table from its rows, its columns and the white frame by generalised least squares.
//!    They are linear in the photographs: unbiased, whatever the light. The variances are those of both families together,
//!    lest a weight follow the noise of its own photograph.
//! 2. **Squares** ([`Freed`]): the table that is most likely, if each square is normal about its gated minimum m with
//!    variance m² + FLOOR · σ², σ² its variance if both its combs saw it alone, and each margin is the sum of its squares
//!    with the noise of its photograph. A bright square follows its combs, a square in the dark hardly follows their noise.
//!    The normal equations are solved at once (`multipliers.rs`); one sweep over the margins, much like proportional fitting,
//!    takes what rounding left.
//! 3. The sums of these squares are the margins that are fitted. What the total has more, or less, cannot be told from noise
//!    in any one square and is spread evenly over the table, so that sums stay right.

use super::lanes::{Lanes, add, follow};
use super::multipliers::{Family, Solver};
use super::noise::NoiseOfLanes;
use super::table::Table;

/// Variance of a square in the dark, as a share of σ².
const FLOOR: f32 = 0.6;
/// A minimum is gated by z²/(z² + GATE²), z the minimum over its noise.
const GATE: f32 = 2.0;
/// A white frame farther from the combs than this many standard deviations, and than the factor that `fitted` allows,
/// contradicts them.
const CONTRADICTION_SIGMAS: f32 = 5.0;

/// Variances of a table's photographs.
pub(super) struct Variances<const W: usize> {
    rows: Vec<Lanes<W>>,
    columns: Vec<Lanes<W>>,
    /// Of the total, as its own photographs say it.
    total: Lanes<W>,
}

impl<const W: usize> Variances<W> {
    /// Of nothing yet.
    pub(super) fn new() -> Self {
        Self { rows: Vec::new(), columns: Vec::new(), total: [0.0; W] }
    }

    /// Of the rows.
    pub(super) fn rows(&self) -> &[Lanes<W>] {
        &self.rows
    }

    #[inline(always)]
    fn measure(&mut self, table: &Table<W>, noise: &NoiseOfLanes<W>) {
        self.rows.clear();
        self.rows.extend(table.rows.iter().map(|row| noise.of(row)));
        self.columns.clear();
        self.columns.extend(table.columns.iter().map(|column| noise.of(column)));
    }
}

/// How often the black frame is subtracted in the total of a table.
fn blacks<const W: usize>(table: &Table<W>) -> f32 {
    2.0 / (1.0 / table.rows.len() as f32 + 1.0 / table.columns.len() as f32)
}

/// Estimates the totals of all tables of a position, and takes from rows and columns what the white frame says of the black
/// frame's error. `white` is used if all tables are there; `believed` is the factor by which it may differ. Gives the
/// variances of the photographs.
#[inline(always)]
pub(super) fn totals<const W: usize>(
    tables: &mut [Table<W>],
    white: Option<&Lanes<W>>,
    believed: f32,
    noise: &NoiseOfLanes<W>,
    variances: &mut [Variances<W>],
) {
    for (table, variances) in tables.iter_mut().zip(&mut *variances) {
        variances.measure(table, noise);
        (table.total, variances.total) = of_table(table, variances);
    }
    let Some(white) = white else { return };
    let (mut sum, mut variance) = ([0.0; W], [0.0; W]);
    for (table, variances) in tables.iter().zip(&*variances) {
        for lane in 0..W {
            sum[lane] += table.total[lane];
            variance[lane] += variances.total[lane];
        }
    }
    // Combs share the error κ of the black frame: their sum has it `blacks_of_all` times, the white frame once.
    let blacks_of_all = tables.iter().map(blacks).sum::<f32>();
    let of_white = noise.of(white);
    // By lane: what the white frame has more than the combs over the variance of that, and what of it is κ.
    let (mut surprise, mut correction) = ([0.0; W], [0.0; W]);
    for lane in 0..W {
        let (white, sum, shared) = (white[lane], sum[lane], noise.shared[lane]);
        let expected = variance[lane] + of_white[lane] + (blacks_of_all - 1.0).powi(2) * shared;
        let agrees = (white * believed >= sum) & (white <= believed * sum) & (sum > 0.0);
        let near = (white - sum).abs() < CONTRADICTION_SIGMAS * expected.sqrt();
        // False for NaN and for infinities too.
        let is_believed = (white.abs() < f32::INFINITY) & (expected > 0.0) & (agrees | near);
        surprise[lane] = if is_believed { (white - sum) / expected } else { 0.0 };
        correction[lane] = (blacks_of_all - 1.0) * shared * surprise[lane];
    }
    for (table, variances) in tables.iter_mut().zip(&*variances) {
        let blacks = blacks(table);
        for lane in 0..W {
            table.total[lane] += variances.total[lane] * surprise[lane] + blacks * correction[lane];
        }
        for line in table.rows.iter_mut().chain(&mut table.columns) {
            (0..W).for_each(|lane| line[lane] += correction[lane]);
        }
    }
}

/// The total of a table and its variance, its own photographs alone.
#[inline(always)]
fn of_table<const W: usize>(table: &Table<W>, variances: &Variances<W>) -> (Lanes<W>, Lanes<W>) {
    let (rows, columns) = (sum(&table.rows), sum(&table.columns));
    let (of_rows, of_columns) = (sum(&variances.rows), sum(&variances.columns));
    let (down, across) = (table.rows.len() as f32, table.columns.len() as f32);
    // Each photograph counts with the mean variance of all.
    let weights = 1.0 / down + 1.0 / across;
    let mean = |lane: usize| (of_rows[lane] + of_columns[lane]) / (down + across);
    (
        std::array::from_fn(|lane| (rows[lane] / down + columns[lane] / across) / weights),
        std::array::from_fn(|lane| mean(lane) / weights),
    )
}

#[inline(always)]
fn sum<const W: usize>(lines: &[Lanes<W>]) -> Lanes<W> {
    let mut sum = [0.0; W];
    for line in lines {
        (0..W).for_each(|lane| sum[lane] += line[lane]);
    }
    sum
}

/// Squares of one table, freed of noise as far as the photographs can say.
pub(super) struct Freed<const W: usize> {
    /// `[row][column]`: what is to be fitted.
    light: Vec<Lanes<W>>,
    /// `[row][column]`: the variance of a square that is alone in both its combs, and in the end what squares in the dark
    /// follow their combs by; may be negative.
    follow: Vec<Lanes<W>>,
    /// `[row][column]`: the variance of a square about its gated minimum.
    variance: Vec<Lanes<W>>,
    rows: Family<W>,
    columns: Family<W>,
    solver: Solver<W>,
    /// What is added to every square of the table.
    spread: Lanes<W>,
}

impl<const W: usize> Freed<W> {
    /// Of nothing yet.
    pub(super) fn new() -> Self {
        Self {
            light: Vec::new(),
            follow: Vec::new(),
            variance: Vec::new(),
            rows: Family::new(),
            columns: Family::new(),
            solver: Solver::new(),
            spread: [0.0; W],
        }
    }

    /// Frees the margins of a table: they become the sums of its squares, cut at zero, and the total what of them is to be
    /// fitted.
    #[inline(always)]
    pub(super) fn free(&mut self, table: &mut Table<W>, variances: &Variances<W>) {
        self.prepare(table, variances);
        let margins = [table.rows.as_slice(), table.columns.as_slice()];
        let of_margins = [variances.rows.as_slice(), variances.columns.as_slice()];
        self.solver.solve(&self.variance, margins, of_margins, &mut self.rows, &mut self.columns);
        self.apply();
        self.sweep(table, variances);
        // What the floor of the variance let squares follow is kept apart: fitting needs squares that are not negative.
        let across = table.columns.len();
        self.spread = table.total;
        table.rows.fill([0.0; W]);
        table.columns.fill([0.0; W]);
        let squares = self.light.chunks_exact(across).zip(self.follow.chunks_exact_mut(across));
        for ((light, follow), (row, down_by)) in squares.zip(table.rows.iter_mut().zip(&self.rows.multipliers)) {
            let columns = table.columns.iter_mut().zip(&self.columns.multipliers);
            for ((light, follow), (column, across_by)) in light.iter().zip(follow).zip(columns) {
                for lane in 0..W {
                    follow[lane] = FLOOR * follow[lane] * (down_by[lane] + across_by[lane]);
                    let light = light[lane] - follow[lane];
                    self.spread[lane] -= follow[lane];
                    row[lane] += light;
                    column[lane] += light;
                }
            }
        }
        table.total = [0.0; W];
        for line in table.rows.iter_mut().chain(&mut table.columns) {
            for (value, total) in line.iter_mut().zip(&mut table.total) {
                *value = value.max(0.0);
                *total += 0.5 * *value;
            }
        }
        for lane in 0..W {
            self.spread[lane] = (self.spread[lane] - table.total[lane]) / self.light.len() as f32;
        }
    }

    /// `[row][column]`: what is added to a fitted square apart from what is spread.
    pub(super) fn follow(&self) -> &[Lanes<W>] {
        &self.follow
    }

    /// What is spread over all squares of the table, to each of them.
    pub(super) fn spread(&self) -> &Lanes<W> {
        &self.spread
    }

    /// Adds to the squares what the multipliers say, and adds up their rows.
    #[inline(always)]
    fn apply(&mut self) {
        let across = self.columns.multipliers.len();
        let squares = self.light.chunks_exact_mut(across).zip(self.variance.chunks_exact(across));
        for ((light, variance), (sum, of_row)) in squares.zip(self.rows.sums.iter_mut().zip(&self.rows.multipliers)) {
            *sum = [0.0; W];
            for ((light, variance), of_column) in light.iter_mut().zip(variance).zip(&self.columns.multipliers) {
                let step = std::array::from_fn(|lane| of_row[lane] + of_column[lane]);
                follow(light, variance, &step, sum);
            }
        }
    }

    /// Lets squares follow all rows, then all columns; the sums of either are gathered while they follow the other.
    #[inline(always)]
    fn sweep(&mut self, table: &Table<W>, variances: &Variances<W>) {
        let across = table.columns.len();
        self.columns.sums.fill([0.0; W]);
        let squares = self.light.chunks_exact_mut(across).zip(self.variance.chunks_exact(across));
        for (line, (light, variance)) in squares.enumerate() {
            let step = step(&mut self.rows, line, &table.rows[line], &variances.rows[line]);
            for ((light, variance), sum) in light.iter_mut().zip(variance).zip(&mut self.columns.sums) {
                follow(light, variance, &step, sum);
            }
        }
        for line in 0..across {
            // The sum is not needed once the step is known.
            let step = step(&mut self.columns, line, &table.columns[line], &variances.columns[line]);
            self.columns.sums[line] = step;
        }
        let squares = self.light.chunks_exact_mut(across).zip(self.variance.chunks_exact(across));
        for ((light, variance), sum) in squares.zip(&mut self.rows.sums) {
            let mut added = [0.0; W];
            for ((light, variance), step) in light.iter_mut().zip(variance).zip(&self.columns.sums) {
                follow(light, variance, step, &mut added);
            }
            *sum = added;
        }
    }

    /// Gated minima, their variances, and those of the margins.
    #[inline(always)]
    fn prepare(&mut self, table: &Table<W>, variances: &Variances<W>) {
        self.rows.begin(&variances.rows);
        self.columns.begin(&variances.columns);
        let squares = table.rows.len() * table.columns.len();
        for values in [&mut self.light, &mut self.follow, &mut self.variance] {
            values.resize(squares, [0.0; W]);
        }
        let across = table.columns.len();
        let squares = self.light.chunks_exact_mut(across).zip(self.follow.chunks_exact_mut(across));
        let rows = squares.zip(self.variance.chunks_exact_mut(across)).enumerate();
        for (j, ((light, alone), variance)) in rows {
            for (i, ((light, alone), variance)) in light.iter_mut().zip(alone).zip(variance).enumerate() {
                let (row, column) = (&table.rows[j], &table.columns[i]);
                gate(light, alone, variance, row, column, &variances.rows[j], &variances.columns[i]);
                add(&mut self.rows.sums[j], light);
                add(&mut self.columns.sums[i], light);
                add(&mut self.rows.weights[j], variance);
                add(&mut self.columns.weights[i], variance);
            }
        }
        self.rows.weigh();
        self.columns.weigh();
    }
}

/// How far the squares of a line follow its photograph, as its variance and theirs say: a step of the multiplier.
#[inline(always)]
fn step<const W: usize>(family: &mut Family<W>, line: usize, margin: &Lanes<W>, variance: &Lanes<W>) -> Lanes<W> {
    let (multiplier, weight, sum) = (&mut family.multipliers[line], &family.weights[line], &family.sums[line]);
    let step =
        std::array::from_fn(|lane| (margin[lane] - sum[lane] - variance[lane] * multiplier[lane]) * weight[lane]);
    add(multiplier, &step);
    step
}

/// The gated minimum of a row and a column, the variance of a square that is alone in both, and that of this square.
#[inline(always)]
fn gate<const W: usize>(
    light: &mut Lanes<W>,
    alone: &mut Lanes<W>,
    variance: &mut Lanes<W>,
    row: &Lanes<W>,
    column: &Lanes<W>,
    of_row: &Lanes<W>,
    of_column: &Lanes<W>,
) {
    for lane in 0..W {
        let (row, column, of_row, of_column) = (row[lane], column[lane], of_row[lane], of_column[lane]);
        let minimum = (if row < column { row } else { column }).max(0.0);
        let of_minimum = if row < column { of_row } else { of_column };
        let squared = minimum * minimum;
        light[lane] = minimum * (squared / (squared + GATE * GATE * of_minimum).max(f32::MIN_POSITIVE));
        alone[lane] = of_row * of_column / (of_row + of_column).max(f32::MIN_POSITIVE);
        variance[lane] = light[lane] * light[lane] + FLOOR * alone[lane];
    }
}
