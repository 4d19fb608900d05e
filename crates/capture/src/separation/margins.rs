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
//!    The normal equations are solved margin by margin (Gauss–Seidel on the multipliers), much like proportional fitting.
//! 3. The sums of these squares are the margins that are fitted. What the total has more, or less, cannot be told from noise
//!    in any one square and is spread evenly over the table, so that sums stay right.

use super::noise::CombNoise;

/// Variance of a square in the dark, as a share of σ².
const FLOOR: f32 = 0.6;
/// A minimum is gated by z²/(z² + GATE²), z the minimum over its noise.
const GATE: f32 = 2.0;
/// Sweeps over the margins of a table; more change relit pictures by less than 1 % of their noise.
const SWEEPS: usize = 12;
/// A white frame farther from the combs than this many standard deviations, and than the factor that `fitted` allows,
/// contradicts them.
const CONTRADICTION_SIGMAS: f32 = 5.0;

/// The margins of one table, `[line][lane]`.
pub(super) struct Margins<'a> {
    pub(super) rows: &'a mut [f32],
    pub(super) columns: &'a mut [f32],
    pub(super) total: &'a mut [f32],
}

/// What is known of the total of one table in one lane.
#[derive(Clone, Copy, Default)]
struct Total {
    value: f32,
    /// Variance of its own.
    variance: f32,
    /// How often the black frame is subtracted in it.
    blacks: f32,
}

/// Estimates the totals of all tables of a position lane by lane, and takes from rows and columns what the white frame says
/// of the black frame's error. `white` is used if all tables are there; `believed` is the factor by which it may differ.
pub(super) fn totals(tables: &mut [Margins], white: Option<&[f32]>, believed: f32, noise: &CombNoise, lanes: usize) {
    let mut of_lane = vec![Total::default(); tables.len()];
    for lane in 0..lanes {
        for (total, table) in of_lane.iter_mut().zip(tables.iter()) {
            *total = of_table(table, noise, lane, lanes);
        }
        let mut correction = 0.0;
        if let Some(white) = white.map(|white| white[lane]).filter(|white| white.is_finite()) {
            let (sum, variance, blacks) = of_lane.iter().fold((0.0, 0.0, 0.0), |(sum, variance, blacks), total| {
                (sum + total.value, variance + total.variance, blacks + total.blacks)
            });
            // Combs share the error κ of the black frame: their sum has it `blacks` times, the white frame once.
            let (shared, surprise) = (noise.shared(lane), white - sum);
            let expected = variance + noise.of(lane, white) + (blacks - 1.0).powi(2) * shared;
            let agrees = white * believed >= sum && white <= believed * sum && sum > 0.0;
            if expected > 0.0 && (agrees || surprise.abs() < CONTRADICTION_SIGMAS * expected.sqrt()) {
                correction = (blacks - 1.0) * shared / expected * surprise;
                for total in &mut of_lane {
                    total.value += total.variance / expected * surprise + total.blacks * correction;
                }
            }
        }
        for (total, table) in of_lane.iter().zip(tables.iter_mut()) {
            table.total[lane] = total.value;
            let lines = table.rows.chunks_exact_mut(lanes).chain(table.columns.chunks_exact_mut(lanes));
            lines.for_each(|line| line[lane] += correction);
        }
    }
}

fn of_table(table: &Margins, noise: &CombNoise, lane: usize, lanes: usize) -> Total {
    let add = |lines: &[f32]| {
        let values = lines.chunks_exact(lanes).map(|line| line[lane]);
        values.fold((0.0, 0.0), |(sum, variance), value| (sum + value, variance + noise.of(lane, value)))
    };
    let ((rows, of_rows), (columns, of_columns)) = (add(table.rows), add(table.columns));
    let (down, across) = ((table.rows.len() / lanes) as f32, (table.columns.len() / lanes) as f32);
    // Each photograph counts with the mean variance of all.
    let (mean, weights) = ((of_rows + of_columns) / (down + across), 1.0 / down + 1.0 / across);
    Total { value: (rows / down + columns / across) / weights, variance: mean / weights, blacks: 2.0 / weights }
}

/// Squares of one table, freed of noise as far as the photographs can say.
#[derive(Default)]
pub(super) struct Freed {
    /// `[row][column][lane]`: what is to be fitted.
    light: Vec<f32>,
    /// `[row][column][lane]`: what squares in the dark follow their combs by; may be negative.
    follow: Vec<f32>,
    spread: Vec<f32>,
    variance: Vec<f32>,
    multipliers: [Vec<f32>; 2],
    deviations: [Vec<f32>; 2],
    sum: Vec<f32>,
    /// Of rows and of columns: 1 over the variances of the margin and of all its squares together.
    weights: [Vec<f32>; 2],
}

impl Freed {
    /// Frees the margins of a table: they become the sums of its squares, cut at zero, and the total what of them is to be
    /// fitted.
    pub(super) fn free(&mut self, table: &mut Margins, noise: &CombNoise, lanes: usize) {
        let (down, across) = (table.rows.len() / lanes, table.columns.len() / lanes);
        self.prepare(table, noise, lanes);
        let ([of_rows, of_columns], [down_by, across_by]) = (&self.deviations, &mut self.multipliers);
        for _ in 0..SWEEPS {
            for j in 0..down {
                let members = (0..across).map(|i| j * across + i);
                let margin = (&table.rows[j * lanes..][..lanes], &of_rows[j * lanes..][..lanes]);
                let known = (&self.variance[..], &self.weights[0][j * lanes..][..lanes]);
                follow(&mut self.light, known, members, margin, &mut down_by[j * lanes..][..lanes], &mut self.sum);
            }
            for i in 0..across {
                let members = (0..down).map(|j| j * across + i);
                let margin = (&table.columns[i * lanes..][..lanes], &of_columns[i * lanes..][..lanes]);
                let known = (&self.variance[..], &self.weights[1][i * lanes..][..lanes]);
                follow(&mut self.light, known, members, margin, &mut across_by[i * lanes..][..lanes], &mut self.sum);
            }
        }
        // What the floor of the variance let squares follow is kept apart: fitting needs squares that are not negative.
        let total = table.total.to_vec();
        table.rows.fill(0.0);
        table.columns.fill(0.0);
        self.spread.copy_from_slice(&total);
        for j in 0..down {
            for i in 0..across {
                let at = (j * across + i) * lanes;
                for lane in 0..lanes {
                    let alone = alone(of_rows[j * lanes + lane], of_columns[i * lanes + lane]);
                    let multiplier = down_by[j * lanes + lane] + across_by[i * lanes + lane];
                    let follow = FLOOR * alone * multiplier;
                    let light = self.light[at + lane] - follow;
                    self.follow[at + lane] = follow;
                    self.spread[lane] -= follow;
                    table.rows[j * lanes + lane] += light;
                    table.columns[i * lanes + lane] += light;
                }
            }
        }
        table.total.fill(0.0);
        for lines in [&mut *table.rows, &mut *table.columns] {
            for line in lines.chunks_exact_mut(lanes) {
                for (value, total) in line.iter_mut().zip(table.total.iter_mut()) {
                    *value = value.max(0.0);
                    *total += 0.5 * *value;
                }
            }
        }
        let fitted = table.total.iter();
        self.spread
            .iter_mut()
            .zip(fitted)
            .for_each(|(spread, fitted)| *spread = (*spread - fitted) / (down * across) as f32);
    }

    /// What is added to a fitted square, and what of it was spread over all squares of the table.
    pub(super) fn rest(&self, square: usize, lane: usize, lanes: usize) -> (f32, f32) {
        let spread = self.spread[lane];
        (self.follow[square * lanes + lane] + spread, spread)
    }

    /// Gated minima, their variances, and those of the margins.
    fn prepare(&mut self, table: &Margins, noise: &CombNoise, lanes: usize) {
        let (down, across) = (table.rows.len() / lanes, table.columns.len() / lanes);
        for (lines, (deviations, multipliers)) in
            [&*table.rows, &*table.columns].into_iter().zip(self.deviations.iter_mut().zip(&mut self.multipliers))
        {
            deviations.clear();
            deviations.extend(lines.iter().enumerate().map(|(at, value)| noise.of(at % lanes, *value)));
            multipliers.clear();
            multipliers.resize(lines.len(), 0.0);
        }
        self.sum.resize(lanes, 0.0);
        self.spread.resize(lanes, 0.0);
        self.follow.resize(down * across * lanes, 0.0);
        self.light.clear();
        self.variance.clear();
        for (weights, deviations) in self.weights.iter_mut().zip(&self.deviations) {
            weights.clone_from(deviations);
        }
        for j in 0..down {
            for i in 0..across {
                for lane in 0..lanes {
                    let (row, column) = (table.rows[j * lanes + lane], table.columns[i * lanes + lane]);
                    let (of_row, of_column) =
                        (self.deviations[0][j * lanes + lane], self.deviations[1][i * lanes + lane]);
                    let minimum = row.min(column).max(0.0);
                    let variance = if row < column { of_row } else { of_column };
                    let square = minimum * minimum;
                    let gated = minimum * (square / (square + GATE * GATE * variance).max(f32::MIN_POSITIVE));
                    let variance = gated * gated + FLOOR * alone(of_row, of_column);
                    self.light.push(gated);
                    self.variance.push(variance);
                    self.weights[0][j * lanes + lane] += variance;
                    self.weights[1][i * lanes + lane] += variance;
                }
            }
        }
        let weights = self.weights.iter_mut().flatten();
        weights.for_each(|weight| *weight = 1.0 / weight.max(f32::MIN_POSITIVE));
    }
}

/// Variance of a square that is alone in both its combs.
fn alone(of_row: f32, of_column: f32) -> f32 {
    of_row * of_column / (of_row + of_column).max(f32::MIN_POSITIVE)
}

/// Lets the squares of one margin follow its photograph as far as both their variances say.
fn follow(
    squares: &mut [f32],
    (variances, weights): (&[f32], &[f32]),
    members: impl Iterator<Item = usize> + Clone,
    (margin, of_margin): (&[f32], &[f32]),
    multiplier: &mut [f32],
    sum: &mut [f32],
) {
    let lanes = margin.len();
    sum.fill(0.0);
    for member in members.clone() {
        let values = &squares[member * lanes..][..lanes];
        sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
    }
    for (((sum, weight), multiplier), (margin, of_margin)) in
        sum.iter_mut().zip(weights).zip(multiplier.iter_mut()).zip(margin.iter().zip(of_margin))
    {
        let step = (margin - *sum - of_margin * *multiplier) * weight;
        *multiplier += step;
        *sum = step;
    }
    for member in members {
        let variances = &variances[member * lanes..][..lanes];
        let values = squares[member * lanes..][..lanes].iter_mut();
        for ((value, variance), step) in values.zip(variances).zip(sum.iter()) {
            *value += variance * step;
        }
    }
}
