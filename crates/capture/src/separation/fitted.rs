//! The refined separation: iterative proportional fitting of the minimum to every photograph (docs/MATH.md).
//!
//! Per lane, the squares of row comb (v, k) must add to its photograph, and so must those of column comb (u, k'). Row comb
//! (v, k) and column comb (u, k') share a square only if u ≡ k and v ≡ k': the M × M squares fall into spacing² *tables*
//! (k, k') of about M/spacing × M/spacing squares, and in each table the row combs are the sums of its rows and the column
//! combs the sums of its columns. Tables do not touch each other; fitting a table to its margins is the classical problem
//! of Deming & Stephan (1940).
//!
//! Photographs are noisy, so a table's row combs and column combs do not have quite the same total, and no table has both.
//! They are reconciled first. Where the noise is known, light and noise are told apart (`margins.rs`): dark squares stay
//! dark, bright ones follow their combs by the variance of each, and what cannot be told from noise is spread evenly, so
//! that the squares add up to the best estimate of the total. Where no noise is known: each table's total is the mean of
//! the two, all totals are scaled so that they add to the white frame (unless it is dark, clipped or contradicts them),
//! and the margins, cut off at zero, are scaled to their total. Either way the fit then has a solution.

use super::lanes::{Lanes, TOGETHER, load, scale, store};
use super::margins::{Freed, Variances, totals};
use super::noise::NoiseOfLanes;
use super::table::Table;
use super::{Combs, Removed, separate_minimum};

/// Sweeps stop when every row of the table is within this share of the table's total. Halves round to 5·10⁻⁴.
const TOLERANCE: f32 = 1e-4;
/// So far from its margin, in standard deviations of its photograph, a row may be besides.
const TOLERATED_SIGMAS: f32 = 0.02;
/// Sweeps at most; most tables need fewer than ten.
const SWEEPS: usize = 30;
/// A white frame that differs from the combs by more than this factor, and by more than its noise, is no white frame: the
/// combs decide.
const BELIEVED: f32 = 2.0;

relumine_radiometry::for_this_machine! {
    /// Separates by fitting; squares whose comb was not taken become zero, and tables that lack a photograph keep the minimum.
    /// Says what was spread.
    ///
    /// # Panics
    /// If `squares` does not hold M² · lanes values.
    pub fn separate_fitted(combs: &Combs, squares: &mut [f32]) -> Removed = fit_together::<TOGETHER>
}

/// As [`separate_fitted`], one lane after the other.
#[cfg(test)]
pub(super) fn separate_fitted_plain(combs: &Combs, squares: &mut [f32]) -> Removed {
    fit_together::<1>(combs, squares)
}

/// Separates W lanes at a time.
#[inline(always)]
fn fit_together<const W: usize>(combs: &Combs, squares: &mut [f32]) -> Removed {
    let (m, phases, lanes) = (combs.squares, combs.spacing, combs.lanes);
    assert_eq!(squares.len(), m * m * lanes);
    let mut tables: Vec<Table<W>> =
        (0..phases).flat_map(|k| (0..phases).filter_map(move |kk| Table::new(combs, k, kk))).collect();
    let all_there = tables.len() == phases * phases;
    if !all_there {
        separate_minimum(combs, squares);
    }
    let white = combs.white.filter(|_| all_there);
    let mut variances: Vec<Variances<W>> = tables.iter().map(|_| Variances::new()).collect();
    let (mut freed, mut fit) = (Freed::new(), Fit::new());
    let (mut light, mut spread) = ([0.0f64; W], [0.0f64; W]);
    for at in (0..lanes).step_by(W) {
        let white = white.map(|white| load(white, at));
        tables.iter_mut().for_each(|table| table.load(combs, at));
        let noise = combs.noisy().map(|noise| NoiseOfLanes::new(noise, at));
        match &noise {
            Some(noise) => totals(&mut tables, white.as_ref(), BELIEVED, noise, &mut variances),
            None => white.iter().for_each(|white| scale_to_white(&mut tables, white)),
        }
        for (table, variances) in tables.iter_mut().zip(&variances) {
            if noise.is_some() {
                freed.free(table, variances);
            }
            table.reconcile();
            fit.tolerate(table, noise.is_some().then(|| variances.rows()));
            fit.run(table);
            if noise.is_some() {
                let mut of_table = [0.0f32; W];
                for (square, follow) in fit.table.iter_mut().zip(freed.follow()) {
                    for lane in 0..W {
                        square[lane] += follow[lane] + freed.spread()[lane];
                        of_table[lane] += square[lane];
                    }
                }
                // Lanes beyond the end were loaded as zeros and have noise.
                for lane in 0..W.min(lanes - at) {
                    light[lane] += f64::from(of_table[lane]);
                    spread[lane] += f64::from(freed.spread()[lane] * fit.table.len() as f32);
                }
            }
            for (v, row) in table.vs.iter().zip(fit.table.chunks_exact(table.us.len())) {
                for (u, values) in table.us.iter().zip(row) {
                    store(&mut squares[(v * m + u) * lanes..][..lanes], at, values);
                }
            }
        }
    }
    Removed { light: light.iter().sum(), spread: spread.iter().sum(), ..Removed::default() }
}

/// Scales the totals of all tables so that they add to the white frame, where it is to be trusted.
#[inline(always)]
fn scale_to_white<const W: usize>(tables: &mut [Table<W>], white: &Lanes<W>) {
    let mut sum = [0.0; W];
    for table in &*tables {
        (0..W).for_each(|lane| sum[lane] += table.total[lane]);
    }
    let mut factor = [1.0; W];
    for lane in 0..W {
        // False for NaN, for black and for a sum of zero.
        let (white, sum) = (white[lane], sum[lane]);
        if (white * BELIEVED >= sum) & (white <= BELIEVED * sum) & (sum > 0.0) {
            factor[lane] = white / sum;
        }
    }
    for table in tables {
        (0..W).for_each(|lane| table.total[lane] *= factor[lane]);
    }
}

/// Sweeps over one table.
struct Fit<const W: usize> {
    /// `[row][column]`.
    table: Vec<Lanes<W>>,
    /// Sums of rows and columns, or what they are to be scaled by.
    rows: Vec<Lanes<W>>,
    columns: Vec<Lanes<W>>,
    /// By row: how far from its margin is near enough.
    tolerances: Vec<Lanes<W>>,
}

impl<const W: usize> Fit<W> {
    fn new() -> Self {
        Self { table: Vec::new(), rows: Vec::new(), columns: Vec::new(), tolerances: Vec::new() }
    }

    /// Sets the tolerances of rows whose photographs have these variances, if they have any.
    #[inline(always)]
    fn tolerate(&mut self, margins: &Table<W>, variances: Option<&[Lanes<W>]>) {
        let of_total = margins.total.map(|total| TOLERANCE * total);
        self.tolerances.clear();
        self.tolerances.resize(margins.rows.len(), of_total);
        for (tolerance, variance) in self.tolerances.iter_mut().zip(variances.into_iter().flatten()) {
            (0..W).for_each(|lane| tolerance[lane] += TOLERATED_SIGMAS * variance[lane].sqrt());
        }
    }

    /// Rescales rows and columns in turn until the table has its margins; the last word have the columns, so the squares add
    /// exactly to the total. A lane that has them changes no more, whatever others still need.
    #[inline(always)]
    fn run(&mut self, margins: &Table<W>) {
        let across = margins.columns.len();
        // The minimum of the reconciled margins: zero only where a margin is, so the fit can always succeed.
        self.table.clear();
        self.rows.clear();
        self.columns.resize(across, [0.0; W]);
        for row in &margins.rows {
            let mut sum = [0.0; W];
            for column in &margins.columns {
                let square: Lanes<W> = std::array::from_fn(|lane| row[lane].min(column[lane]));
                (0..W).for_each(|lane| sum[lane] += square[lane]);
                self.table.push(square);
            }
            self.rows.push(sum);
        }
        let mut unfinished = [true; W];
        for _ in 0..SWEEPS {
            let mut worst = [0.0f32; W];
            self.columns.fill([0.0; W]);
            let rows = self.table.chunks_exact_mut(across).zip(&self.rows);
            for ((row, sum), (margin, tolerance)) in rows.zip(margins.rows.iter().zip(&self.tolerances)) {
                for lane in 0..W {
                    worst[lane] = worst[lane].max((sum[lane] - margin[lane]).abs() - tolerance[lane]);
                }
                let factor = factor(margin, sum, &unfinished);
                for (square, column) in row.iter_mut().zip(&mut self.columns) {
                    scale(square, &factor, column);
                }
            }
            for (column, margin) in self.columns.iter_mut().zip(&margins.columns) {
                *column = factor(margin, column, &unfinished);
            }
            for (row, sum) in self.table.chunks_exact_mut(across).zip(&mut self.rows) {
                *sum = [0.0; W];
                row.iter_mut().zip(&self.columns).for_each(|(square, factor)| scale(square, factor, sum));
            }
            (0..W).for_each(|lane| unfinished[lane] &= worst[lane] > 0.0);
            if unfinished == [false; W] {
                break;
            }
        }
    }
}

/// What a line is scaled by to add to its margin; nothing where that is done.
#[inline(always)]
fn factor<const W: usize>(margin: &Lanes<W>, sum: &Lanes<W>, unfinished: &[bool; W]) -> Lanes<W> {
    // Branch-free: a sum of zero has only zeros to scale.
    std::array::from_fn(|lane| {
        let factor = margin[lane] / sum[lane].max(f32::MIN_POSITIVE);
        if unfinished[lane] { factor } else { 1.0 }
    })
}
