//! The refined separation: iterative proportional fitting of the minimum to every photograph (docs/MATH.md).
//!
//! Per lane, the squares of row comb (v, k) must add to its photograph, and so must those of column comb (u, k'). Row comb
//! (v, k) and column comb (u, k') share a square only if u ≡ k and v ≡ k': the M × M squares fall into spacing² *blocks*
//! (k, k') of about M/spacing × M/spacing squares, and in each block the row combs are the sums of its rows and the column
//! combs the sums of its columns. Blocks do not touch each other; fitting a table to its margins is the classical problem
//! of Deming & Stephan (1940).
//!
//! Photographs are noisy, so a block's row combs and column combs do not have quite the same total, and no table has both.
//! They are reconciled first. Where the noise is known, light and noise are told apart (`margins.rs`): dark squares stay
//! dark, bright ones follow their combs by the variance of each, and what cannot be told from noise is spread evenly, so
//! that the squares add up to the best estimate of the total. Where no noise is known: each block's total is the mean of
//! the two, all totals are scaled so that they add to the white frame (unless it is dark, clipped or contradicts them),
//! and the margins, cut off at zero, are scaled to their total. Either way the fit then has a solution.

use super::margins::{Freed, Margins, totals};
use super::{Combs, Removed, separate_minimum};

/// Sweeps stop when every row of the block is within this share of the block's total. Halves round to 5·10⁻⁴.
const TOLERANCE: f32 = 1e-4;
/// Sweeps at most; most blocks need fewer than ten.
const SWEEPS: usize = 30;

/// Separates by fitting; squares whose comb was not taken become zero, and blocks that lack a photograph keep the minimum.
/// Says what was spread.
///
/// # Panics
/// If `squares` does not hold M² · lanes values.
pub fn separate_fitted(combs: &Combs, squares: &mut [f32]) -> Removed {
    separate_minimum(combs, squares);
    let (phases, lanes) = (combs.spacing, combs.lanes);
    let mut blocks: Vec<Block> =
        (0..phases).flat_map(|k| (0..phases).filter_map(move |kk| Block::new(combs, k, kk))).collect();
    let white = combs.white.filter(|_| blocks.len() == phases * phases);
    let mut fit = Fit::new(lanes);
    let mut removed = Removed::default();
    if let Some(noise) = combs.noisy() {
        let mut tables: Vec<Margins> = blocks.iter_mut().map(Block::margins).collect();
        totals(&mut tables, white, BELIEVED, noise, lanes);
        let mut freed = Freed::default();
        for block in &mut blocks {
            freed.free(&mut block.margins(), noise, lanes);
            block.reconcile(&mut fit);
            fit.run(combs, block, squares);
            for (square, (u, v)) in block.squares().enumerate() {
                let values = &mut squares[(v * combs.squares + u) * lanes..][..lanes];
                for (lane, value) in values.iter_mut().enumerate() {
                    let (rest, spread) = freed.rest(square, lane, lanes);
                    *value += rest;
                    removed.spread += f64::from(spread);
                    removed.light += f64::from(*value);
                }
            }
        }
        return removed;
    }
    if let Some(white) = white {
        scale_to_white(&mut blocks, white);
    }
    for block in &mut blocks {
        block.reconcile(&mut fit);
        fit.run(combs, block, squares);
    }
    removed
}

/// The squares (u, v) with u ≡ k, v ≡ k', their margins and total.
struct Block {
    /// The columns u of the block.
    us: Vec<usize>,
    /// The rows v of the block.
    vs: Vec<usize>,
    /// Row margins, `[row in block][lane]`.
    rows: Vec<f32>,
    /// Column margins, `[column in block][lane]`.
    columns: Vec<f32>,
    /// Total a lane.
    total: Vec<f32>,
}

impl Block {
    /// Gathers the photographs of the block; `None` if one was not taken.
    fn new(combs: &Combs, k: usize, kk: usize) -> Option<Self> {
        let line = |phase: usize| (phase..combs.squares).step_by(combs.spacing).collect::<Vec<_>>();
        let (us, vs) = (line(k), line(kk));
        let gather = |lines: &[usize], frames: &[Option<&[f32]>], phase: usize| {
            let frames = lines.iter().map(|line| frames[line * combs.spacing + phase]);
            frames.collect::<Option<Vec<_>>>().map(|frames| frames.concat())
        };
        let rows = gather(&vs, &combs.rows, k)?;
        let columns = gather(&us, &combs.columns, kk)?;
        // The two families measure the same light: their mean has half the variance.
        let mut total = vec![0.0; combs.lanes];
        for margin in [&rows, &columns] {
            for frame in margin.chunks_exact(combs.lanes) {
                total.iter_mut().zip(frame).for_each(|(total, value)| *total += 0.5 * value);
            }
        }
        total.iter_mut().for_each(|total| *total = total.max(0.0));
        Some(Self { us, vs, rows, columns, total })
    }

    fn margins(&mut self) -> Margins<'_> {
        Margins { rows: &mut self.rows, columns: &mut self.columns, total: &mut self.total }
    }

    /// The squares (u, v), row by row.
    fn squares(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.vs.iter().flat_map(|v| self.us.iter().map(move |u| (*u, *v)))
    }

    /// Cuts the margins at zero and scales each family to the block's total.
    fn reconcile(&mut self, fit: &mut Fit) {
        for margin in [&mut self.rows, &mut self.columns] {
            let count = margin.len() / fit.lanes;
            fit.sum.fill(0.0);
            for frame in margin.chunks_exact_mut(fit.lanes) {
                for (value, sum) in frame.iter_mut().zip(&mut fit.sum) {
                    *value = value.max(0.0);
                    *sum += *value;
                }
            }
            for frame in margin.chunks_exact_mut(fit.lanes) {
                for ((value, sum), total) in frame.iter_mut().zip(&fit.sum).zip(&self.total) {
                    // A family that saw nothing of the total says nothing about where it is.
                    *value = if *sum > 0.0 { *value * (total / sum) } else { total / count as f32 };
                }
            }
        }
    }
}

/// A white frame that differs from the combs by more than this factor, and by more than its noise, is no white frame: the
/// combs decide.
const BELIEVED: f32 = 2.0;

/// Scales the totals of all blocks so that they add to the white frame, where it is to be trusted.
fn scale_to_white(blocks: &mut [Block], white: &[f32]) {
    for (lane, white) in white.iter().enumerate() {
        let sum: f32 = blocks.iter().map(|block| block.total[lane]).sum();
        // False for NaN, for black and for a sum of zero.
        if *white * BELIEVED >= sum && *white <= BELIEVED * sum && sum > 0.0 {
            blocks.iter_mut().for_each(|block| block.total[lane] *= white / sum);
        }
    }
}

/// Scratch for sweeps over the lanes of one block.
struct Fit {
    lanes: usize,
    sum: Vec<f32>,
    table: Vec<f32>,
}

impl Fit {
    fn new(lanes: usize) -> Self {
        Self { lanes, sum: vec![0.0; lanes], table: Vec::new() }
    }

    /// Rescales rows and columns in turn until the table has the block's margins; the last word have the columns, so the
    /// squares add exactly to the total.
    fn run(&mut self, combs: &Combs, block: &Block, squares: &mut [f32]) {
        let lanes = self.lanes;
        let (across, down) = (block.us.len(), block.vs.len());
        // The minimum of the reconciled margins: zero only where a margin is, so the fit can always succeed.
        self.table.clear();
        for row in block.rows.chunks_exact(lanes) {
            for column in block.columns.chunks_exact(lanes) {
                self.table.extend(row.iter().zip(column).map(|(row, column)| row.min(*column)));
            }
        }
        for _ in 0..SWEEPS {
            let mut worst = 0.0f32;
            for j in 0..down {
                let row = (0..across).map(|i| j * across + i);
                let margin = &block.rows[j * lanes..][..lanes];
                self.add_up(row.clone());
                for ((sum, margin), total) in self.sum.iter().zip(margin).zip(&block.total) {
                    worst = worst.max((sum - margin).abs() - TOLERANCE * total);
                }
                self.rescale(row, margin);
            }
            for i in 0..across {
                let column = (0..down).map(|j| j * across + i);
                self.add_up(column.clone());
                self.rescale(column, &block.columns[i * lanes..][..lanes]);
            }
            if worst <= 0.0 {
                break;
            }
        }
        for (j, v) in block.vs.iter().enumerate() {
            for (i, u) in block.us.iter().enumerate() {
                let fitted = &self.table[(j * across + i) * lanes..][..lanes];
                squares[(v * combs.squares + u) * lanes..][..lanes].copy_from_slice(fitted);
            }
        }
    }

    /// The sums of the table's `members`.
    fn add_up(&mut self, members: impl Iterator<Item = usize>) {
        self.sum.fill(0.0);
        for member in members {
            let values = &self.table[member * self.lanes..][..self.lanes];
            self.sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
        }
    }

    /// Scales the table's `members`, whose sums were taken, so that they add to `margin`.
    fn rescale(&mut self, members: impl Iterator<Item = usize>, margin: &[f32]) {
        // Branch-free: a sum of zero has only zeros to scale.
        self.sum.iter_mut().zip(margin).for_each(|(sum, margin)| *sum = margin / sum.max(f32::MIN_POSITIVE));
        for member in members {
            let values = &mut self.table[member * self.lanes..][..self.lanes];
            values.iter_mut().zip(&self.sum).for_each(|(value, factor)| *value *= factor);
        }
    }
}
