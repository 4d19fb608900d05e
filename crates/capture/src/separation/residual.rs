//! How well separated squares explain the photographs they came from.

use super::Combs;
use super::lanes::{Lanes, TOGETHER, add, load};

/// How well the squares explain the photographs: sums of squares over lanes, to be added and compared.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Residual {
    /// Σ (sum of the comb's squares − comb photograph)², over all combs.
    pub combs_error: f64,
    /// Σ (comb photograph)².
    pub combs_energy: f64,
    /// Σ (sum of all squares − white frame)².
    pub white_error: f64,
    /// Σ (white frame)².
    pub white_energy: f64,
}

impl Residual {
    /// Adds what another part of the picture says.
    pub fn add(&mut self, other: Self) {
        self.combs_error += other.combs_error;
        self.combs_energy += other.combs_energy;
        self.white_error += other.white_error;
        self.white_energy += other.white_energy;
    }

    /// Relative L2 error against the comb photographs; `None` if there are none or they are all black.
    pub fn combs(&self) -> Option<f64> {
        (self.combs_energy > 0.0).then(|| (self.combs_error / self.combs_energy).sqrt())
    }

    /// Relative L2 error against the white frame; `None` if there is none or it is all black.
    pub fn white(&self) -> Option<f64> {
        (self.white_energy > 0.0).then(|| (self.white_error / self.white_energy).sqrt())
    }
}

relumine_radiometry::for_this_machine! {
    /// Compares separated squares with the photographs they came from. Combs that lack a square are left out, and the white
    /// frame where any square is missing.
    pub fn residual(combs: &Combs, squares: &[f32]) -> Residual = of_squares_together::<TOGETHER>
}

relumine_radiometry::for_this_machine! {
    /// As [`residual`], of what [`separate_minimum`](super::separate_minimum) gives.
    pub fn residual_of_minimum(combs: &Combs) -> Residual = of_minimum_together::<TOGETHER>
}

#[inline(always)]
fn of_squares_together<const W: usize>(combs: &Combs, squares: &[f32]) -> Residual {
    let (m, lanes) = (combs.squares, combs.lanes);
    compare_all::<W>(combs, |u, v, at| load(&squares[(v * m + u) * lanes..][..lanes], at))
}

#[inline(always)]
fn of_minimum_together<const W: usize>(combs: &Combs) -> Residual {
    compare_all::<W>(combs, |u, v, at| match (combs.row(u, v), combs.column(u, v)) {
        (Some(row), Some(column)) => minimum(&load(row, at), &load(column, at)),
        _ => [0.0; W],
    })
}

#[inline(always)]
fn minimum<const W: usize>(row: &Lanes<W>, column: &Lanes<W>) -> Lanes<W> {
    std::array::from_fn(|lane| if row[lane] < column[lane] { row[lane] } else { column[lane] })
}

/// Compares W lanes at a time; `square` gives those of square (u, v) from a lane on.
#[inline(always)]
fn compare_all<const W: usize>(combs: &Combs, square: impl Fn(usize, usize, usize) -> Lanes<W>) -> Residual {
    let (m, spacing) = (combs.squares, combs.spacing);
    let of_line = |line: usize, k: usize| (k..m).step_by(spacing).map(move |other| (line, other));
    // The photographs of which every square is there, in the order of the sums that they are held against.
    let lines = || (0..m).flat_map(|line| (0..spacing).map(move |k| (line, k)));
    let rows: Vec<Option<&[f32]>> = lines()
        .map(|(v, k)| combs.rows[v * spacing + k].filter(|_| of_line(v, k).all(|(v, u)| combs.is_present(u, v))))
        .collect();
    let columns: Vec<Option<&[f32]>> = lines()
        .map(|(u, k)| combs.columns[u * spacing + k].filter(|_| of_line(u, k).all(|(u, v)| combs.is_present(u, v))))
        .collect();
    let white = combs.white.filter(|_| (0..m * m).all(|square| combs.is_present(square % m, square / m)));
    let (mut of_rows, mut of_columns) = (vec![[0.0; W]; rows.len()], vec![[0.0; W]; columns.len()]);
    let (mut of_combs, mut of_white) = (Squares::new(), Squares::new());
    for at in (0..combs.lanes).step_by(W) {
        of_rows.fill([0.0; W]);
        of_columns.fill([0.0; W]);
        let mut of_all = [0.0; W];
        for v in 0..m {
            for u in 0..m {
                let square = square(u, v, at);
                add(&mut of_rows[v * spacing + u % spacing], &square);
                add(&mut of_columns[u * spacing + v % spacing], &square);
                add(&mut of_all, &square);
            }
        }
        for (sum, photograph) in of_rows.iter().zip(&rows).chain(of_columns.iter().zip(&columns)) {
            photograph.iter().for_each(|photograph| of_combs.add(sum, &load(photograph, at)));
        }
        white.iter().for_each(|white| of_white.add(&of_all, &load(white, at)));
    }
    let ((combs_error, combs_energy), (white_error, white_energy)) = (of_combs.sums(), of_white.sums());
    Residual { combs_error, combs_energy, white_error, white_energy }
}

/// Sums of squares of what is wrong and of what was to be, lane by lane.
struct Squares<const W: usize> {
    error: [f64; W],
    energy: [f64; W],
}

impl<const W: usize> Squares<W> {
    fn new() -> Self {
        Self { error: [0.0; W], energy: [0.0; W] }
    }

    #[inline(always)]
    fn add(&mut self, sum: &Lanes<W>, photograph: &Lanes<W>) {
        for lane in 0..W {
            let is_known = !photograph[lane].is_nan();
            let error = if is_known { sum[lane] - photograph[lane] } else { 0.0 };
            let light = if is_known { photograph[lane] } else { 0.0 };
            self.error[lane] += f64::from(error) * f64::from(error);
            self.energy[lane] += f64::from(light) * f64::from(light);
        }
    }

    fn sums(&self) -> (f64, f64) {
        (self.error.iter().sum(), self.energy.iter().sum())
    }
}
