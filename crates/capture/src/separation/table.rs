//! Tables of squares and their margins: what combs of two families say of them.

use super::Combs;
use super::lanes::{Lanes, load};

/// The squares (u, v) with u ≡ k, v ≡ k', and W lanes of their margins and total.
pub(super) struct Table<const W: usize> {
    /// The columns u of the table.
    pub(super) us: Vec<usize>,
    /// The rows v of the table.
    pub(super) vs: Vec<usize>,
    /// k and k'.
    phases: [usize; 2],
    /// Row margins, one a row of the table.
    pub(super) rows: Vec<Lanes<W>>,
    /// Column margins, one a column of the table.
    pub(super) columns: Vec<Lanes<W>>,
    /// What all squares add up to.
    pub(super) total: Lanes<W>,
}

impl<const W: usize> Table<W> {
    /// The table of k and k', no margins loaded; `None` if one of its photographs was not taken.
    pub(super) fn new(combs: &Combs, k: usize, kk: usize) -> Option<Self> {
        let line = |phase: usize| (phase..combs.squares).step_by(combs.spacing).collect::<Vec<_>>();
        let (us, vs) = (line(k), line(kk));
        let is_whole = vs.iter().all(|v| combs.rows[v * combs.spacing + k].is_some())
            && us.iter().all(|u| combs.columns[u * combs.spacing + kk].is_some());
        let (rows, columns) = (vec![[0.0; W]; vs.len()], vec![[0.0; W]; us.len()]);
        is_whole.then_some(Self { us, vs, phases: [k, kk], rows, columns, total: [0.0; W] })
    }

    /// Loads the margins of the lanes from `at` on; the total is the mean of what both families say, at least zero.
    #[inline(always)]
    pub(super) fn load(&mut self, combs: &Combs, at: usize) {
        let [k, kk] = self.phases;
        let frame = |frame: Option<&[f32]>| frame.map_or([0.0; W], |frame| load(frame, at));
        self.total = [0.0; W];
        for (v, row) in self.vs.iter().zip(&mut self.rows) {
            *row = frame(combs.rows[v * combs.spacing + k]);
            // The two families measure the same light: their mean has half the variance.
            (0..W).for_each(|lane| self.total[lane] += 0.5 * row[lane]);
        }
        for (u, column) in self.us.iter().zip(&mut self.columns) {
            *column = frame(combs.columns[u * combs.spacing + kk]);
            (0..W).for_each(|lane| self.total[lane] += 0.5 * column[lane]);
        }
        (0..W).for_each(|lane| self.total[lane] = self.total[lane].max(0.0));
    }

    /// Cuts the margins at zero and scales each family to the total.
    #[inline(always)]
    pub(super) fn reconcile(&mut self) {
        for margin in [&mut self.rows, &mut self.columns] {
            let mut sum = [0.0; W];
            for line in &mut *margin {
                for lane in 0..W {
                    line[lane] = line[lane].max(0.0);
                    sum[lane] += line[lane];
                }
            }
            // A family that saw nothing of the total says nothing about where it is.
            let share = 1.0 / margin.len() as f32;
            let (mut factor, mut even) = ([0.0; W], [0.0; W]);
            for lane in 0..W {
                factor[lane] = if sum[lane] > 0.0 { self.total[lane] / sum[lane] } else { 0.0 };
                even[lane] = if sum[lane] > 0.0 { 0.0 } else { self.total[lane] * share };
            }
            for line in margin {
                (0..W).for_each(|lane| line[lane] = line[lane] * factor[lane] + even[lane]);
            }
        }
    }
}
