//! The variance that one position adds to a sample of a relit picture.

use super::{PhotographNoise, SeparationNoise, StandardErrors};

/// As the separation has it: variance of a dark square over σ².
const FLOOR: f64 = 0.6;
/// What remains of σ² in any square: the gate of the separation lets some noise through.
const REMAINDER: f64 = 0.1;
/// The share of a table's spread light, as variance, that one square may hold: two squares have it all.
const SPREAD: f64 = 2.0;

/// One position: what its squares weigh in each light, and one sample of all of them.
pub(super) struct OfPosition<'a> {
    noise: &'a PhotographNoise,
    tables: Vec<Table>,
    /// `[light][channel][square]`, radiance of the picture per radiance of the photographed square.
    weights: Vec<f64>,
    lights: usize,
    /// The squares' radiance in one sample.
    pub(super) squares: Vec<f64>,
    scratch: Scratch,
}

/// The squares of one table, row by row.
struct Table {
    across: usize,
    down: usize,
    squares: Vec<usize>,
}

#[derive(Default)]
struct Scratch {
    rows: Vec<f64>,
    columns: Vec<f64>,
    /// Of every square: its variance, and how far it follows its combs.
    variance: Vec<f64>,
    follows: Vec<f64>,
    /// Of every table: variance of its total, and how often the black frame is in it.
    totals: Vec<(f64, f64)>,
}

impl<'a> OfPosition<'a> {
    pub(super) fn new(of: &StandardErrors<'a>, noise: &'a PhotographNoise, position: usize) -> Self {
        let m2 = of.noise.square_flux.len();
        let m = of.field.cells().squares();
        let tables = match of.noise.separation {
            SeparationNoise::Alone => Vec::new(),
            SeparationNoise::Fitted { spacing } => (0..spacing)
                .flat_map(|k| (0..spacing).map(move |kk| (k, kk)))
                .map(|(k, kk)| {
                    let line = |start: usize| (start..m).step_by(spacing);
                    let squares = line(kk).flat_map(|v| line(k).map(move |u| v * m + u)).collect();
                    Table { across: line(k).count(), down: line(kk).count(), squares }
                })
                .collect(),
        };
        let mut weights = Vec::with_capacity(of.lights.len() * 3 * m2);
        for light in of.lights {
            for channel in 0..3 {
                weights.extend((0..m2).map(|square| {
                    let cell = position * m2 + square;
                    f64::from(light.values()[cell][channel]) * of.field.cells().measure(cell)
                        / of.noise.square_flux[square]
                }));
            }
        }
        let scratch = Scratch { variance: vec![0.0; m2], follows: vec![0.0; m2], ..Scratch::default() };
        Self { noise, tables, weights, lights: of.lights.len(), squares: vec![0.0; m2], scratch }
    }

    /// Adds the variance of the sample under every light.
    pub(super) fn add(&mut self, is_clipped: bool, channel: usize, mut add: impl FnMut(usize, f64)) {
        let b = self.noise.black_level;
        let scale = 1.0 / ((1.0 - b) * (1.0 - b));
        // The white frame shows all squares; of it, b is what black shows.
        let white: f64 = self.squares.iter().sum();
        let at = |radiance: f64| f64::from(self.noise.curve.at(radiance as f32));
        // Of (photograph − black)/(1 − b), the black frame's own error left aside.
        let of = |light: f64| scale * at((1.0 - b) * light + b * white);
        let from_white = self.noise.black_from_white;
        let of_black = scale * ((1.0 - from_white).powi(2) * at(b * white) + (from_white * b).powi(2) * at(white));
        let m2 = self.squares.len();
        if self.tables.is_empty() {
            for (variance, light) in self.scratch.variance.iter_mut().zip(&self.squares) {
                *variance = of(*light);
            }
            for light in 0..self.lights {
                let weights = &self.weights[(light * 3 + channel) * m2..][..m2];
                let own: f64 = weights.iter().zip(&self.scratch.variance).map(|(w, variance)| w * w * variance).sum();
                add(light, own + weights.iter().sum::<f64>().powi(2) * of_black);
            }
            return;
        }
        let scratch = &mut self.scratch;
        scratch.totals.clear();
        for table in &self.tables {
            scratch.of_table(table, &self.squares, of);
        }
        let (all, blacks) = scratch.totals.iter().fold((0.0, 0.0), |sum, total| (sum.0 + total.0, sum.1 + total.1));
        let surprise = all + scale * at(white) + (blacks - 1.0).powi(2) * of_black;
        for light in 0..self.lights {
            let weights = &self.weights[(light * 3 + channel) * m2..][..m2];
            if weights.iter().all(|weight| *weight == 0.0) {
                continue;
            }
            let (mut totals, mut in_black, mut known, mut own, mut shared) = (0.0, 0.0, 0.0, 0.0, 0.0);
            for (table, (variance, blacks_of_table)) in self.tables.iter().zip(&scratch.totals) {
                let mean =
                    table.squares.iter().map(|square| weights[*square]).sum::<f64>() / table.squares.len() as f64;
                totals += mean * mean * variance;
                in_black += mean * blacks_of_table;
                known += mean * (variance + blacks_of_table * (blacks - 1.0) * of_black);
                for square in &table.squares {
                    let deviation = weights[*square] - mean;
                    own += deviation * deviation * scratch.variance[*square];
                    shared += deviation * scratch.follows[*square];
                }
            }
            let of_totals = totals + in_black * in_black * of_black;
            // What the white frame takes from it, unless it is clipped.
            let by_white = self.noise.has_white && !is_clipped && surprise > 0.0;
            let of_totals = if by_white { (of_totals - known * known / surprise).max(0.0) } else { of_totals };
            add(light, of_totals + own + shared * shared * of_black);
        }
    }
}

impl Scratch {
    /// Variances of a table's total and squares.
    fn of_table(&mut self, table: &Table, squares: &[f64], of: impl Fn(f64) -> f64) {
        let Table { across, down, squares: members } = table;
        self.rows.clear();
        self.rows.resize(*down, 0.0);
        self.columns.clear();
        self.columns.resize(*across, 0.0);
        let mut least = f64::INFINITY;
        for (at, square) in members.iter().enumerate() {
            self.rows[at / across] += squares[*square];
            self.columns[at % across] += squares[*square];
            least = least.min(squares[*square]);
        }
        self.rows.iter_mut().chain(&mut self.columns).for_each(|value| *value = of(*value));
        let mean = self.rows.iter().chain(&self.columns).sum::<f64>() / (down + across) as f64;
        let weights = 1.0 / *down as f64 + 1.0 / *across as f64;
        self.totals.push((mean / weights, 2.0 / weights));
        // Squares that nothing else lights show what was spread.
        let spread = SPREAD * members.len() as f64 * least.max(0.0).powi(2);
        for (at, square) in members.iter().enumerate() {
            let (row, column) = (self.rows[at / across], self.columns[at % across]);
            let alone = row * column / (row + column).max(f64::MIN_POSITIVE);
            let light = squares[*square].max(0.0);
            let varies = light * light + FLOOR * alone;
            let follows = varies / (varies + alone).max(f64::MIN_POSITIVE);
            // What it follows of the noise, and what it does not follow of its light.
            let of_light = ((1.0 - follows) * light).powi(2);
            self.follows[*square] = follows;
            self.variance[*square] = (follows * follows + REMAINDER) * alone + of_light + spread;
        }
    }
}
