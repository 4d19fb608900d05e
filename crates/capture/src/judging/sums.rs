//! What the photographs of a position must add up to, and what explains it when they do not.
//!
//! Above black, every table of squares (see `separation/fitted.rs`) is photographed twice: by its row combs and by its column combs;
//! and the combs of a family, or all single squares, add up to the white frame. Each of these is an equation Σ aᵢ Fᵢ = 0 over the
//! frames Fᵢ. What they leave over is explained by the least that does: one frame that shows something else, two frames exchanged,
//! or a lamp that drifted. All of it follows from the products of frames with each other.

use rayon::prelude::*;

use crate::{Scheme, ShownPattern};

/// Index of the black frame; the white frame and the lighting patterns of the scheme, in its order, follow.
pub(super) const BLACK: usize = 0;
/// Index of the white frame.
pub(super) const WHITE: usize = 1;
/// Index of the first lighting pattern.
pub(super) const FIRST: usize = 2;

/// The equations of a position.
#[derive(Clone)]
pub(super) struct Equations {
    frames: usize,
    /// aₑᵢ over the root of how many frames are in it, so that noise weighs alike in all.
    rows: Vec<Vec<f64>>,
    /// Σᵢ |aₑᵢ| of the lighting frames, before that.
    terms: Vec<f64>,
}

impl Equations {
    /// Those whose frames are all `known`.
    pub(super) fn new(scheme: Scheme, squares: usize, known: &[bool]) -> Self {
        let patterns = scheme.lighting(squares);
        let frames = FIRST + patterns.len();
        let mut equations = Self { frames, rows: Vec::new(), terms: Vec::new() };
        let mut add = |sign: &dyn Fn(ShownPattern) -> f64, white: bool| {
            let mut row = vec![0.0; frames];
            for (value, pattern) in row[FIRST..].iter_mut().zip(&patterns) {
                *value = sign(*pattern);
            }
            row[WHITE] = if white { -1.0 } else { 0.0 };
            row[BLACK] = -row.iter().sum::<f64>();
            let terms: f64 = row[WHITE..].iter().map(|value| value.abs()).sum();
            if row.iter().zip(known).all(|(value, known)| *value == 0.0 || *known) {
                row.iter_mut().for_each(|value| *value /= terms.sqrt());
                equations.rows.push(row);
                equations.terms.push(terms);
            }
        };
        match scheme {
            Scheme::Squares => add(&|_| 1.0, true),
            Scheme::Combs { spacing } => {
                let phases = spacing.min(squares);
                for (k, l) in (0..phases).flat_map(|k| (0..phases).map(move |l| (k, l))) {
                    let sign = |pattern: ShownPattern| match pattern {
                        ShownPattern::Row { v, k: phase } if phase == k && v % spacing == l => 1.0,
                        ShownPattern::Column { u, k: phase } if phase == l && u % spacing == k => -1.0,
                        _ => 0.0,
                    };
                    add(&sign, false);
                }
                add(&|pattern| f64::from(u8::from(matches!(pattern, ShownPattern::Row { .. }))), true);
                add(&|pattern| f64::from(u8::from(matches!(pattern, ShownPattern::Column { .. }))), true);
            }
        }
        equations
    }

    pub(super) fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The equations that frame `i` is in, and aₑᵢ.
    fn of(&self, i: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.rows.iter().enumerate().map(move |(e, row)| (e, row[i])).filter(|(_, value)| *value != 0.0)
    }

    /// What the other frames of an equation say that frame `i` shows above black: its own, less what the equation leaves over. From the
    /// equation with the fewest frames.
    pub(super) fn demanded(&self, i: usize, frames: &[Vec<f32>]) -> Option<Vec<f32>> {
        let (e, own) = self.of(i).min_by(|a, b| self.terms[a.0].total_cmp(&self.terms[b.0]))?;
        let bins = frames[BLACK].len();
        let mut demanded: Vec<f32> = (0..bins).map(|bin| frames[i][bin] - frames[BLACK][bin]).collect();
        for (j, weight) in self.rows[e].iter().enumerate().filter(|(_, weight)| **weight != 0.0) {
            let factor = (weight / own) as f32;
            demanded.iter_mut().zip(&frames[j]).for_each(|(sum, value)| *sum -= factor * value);
        }
        Some(demanded)
    }

    /// What the other frames say of the black frame, if black were in the combs and in white alike: (Σ combs − white)/(count − 1).
    pub(super) fn demanded_black(&self, frames: &[Vec<f32>]) -> Option<Vec<f32>> {
        let whole: Vec<usize> = (0..self.rows.len()).filter(|e| self.rows[*e][WHITE] != 0.0).collect();
        let mut black = vec![0.0f32; frames[BLACK].len()];
        for e in &whole {
            let own = self.rows[*e][BLACK];
            for (j, weight) in self.rows[*e].iter().enumerate().skip(WHITE).filter(|(_, weight)| **weight != 0.0) {
                let factor = (-weight / own / whole.len() as f64) as f32;
                black.iter_mut().zip(&frames[j]).for_each(|(sum, value)| *sum += factor * value);
            }
        }
        (!whole.is_empty()).then_some(black)
    }
}

/// Fᵢ · Fⱼ for all frames: symmetric, row by row.
#[derive(Clone)]
pub(super) struct Products {
    frames: usize,
    values: Vec<f64>,
}

impl Products {
    /// Of frames without NaN; empty ones count as black.
    pub(super) fn new(frames: &[Vec<f32>]) -> Self {
        let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum::<f64>();
        let rows: Vec<Vec<f64>> = (0..frames.len())
            .into_par_iter()
            .map(|i| (0..frames.len()).map(|j| if j < i { 0.0 } else { dot(&frames[i], &frames[j]) }).collect())
            .collect();
        let count = frames.len();
        let values = (0..count * count)
            .map(|index| rows[(index / count).min(index % count)][(index / count).max(index % count)]);
        Self { frames: count, values: values.collect() }
    }

    pub(super) fn at(&self, i: usize, j: usize) -> f64 {
        self.values[i * self.frames + j]
    }

    /// |Fᵢ − Fⱼ|².
    pub(super) fn distance2(&self, i: usize, j: usize) -> f64 {
        self.at(i, i) + self.at(j, j) - 2.0 * self.at(i, j)
    }
}

/// What the equations leave over.
pub(super) struct Remainder<'a> {
    equations: &'a Equations,
    products: &'a Products,
    /// rₑ · Fⱼ.
    with_frames: Vec<Vec<f64>>,
    /// Σ rₑ².
    pub(super) energy: f64,
    /// Σ over equations of the mean energy of their lighting frames.
    scale: f64,
}

/// Exchanging frames `i` and `j` lowers the remainder.
#[derive(Clone, Copy, Debug)]
pub(super) struct Exchange {
    pub(super) i: usize,
    pub(super) j: usize,
    /// Share of the remainder that it removes.
    pub(super) explained: f64,
    /// What it removes over what it should remove if it were the only defect: 1 if it is right.
    pub(super) of_ideal: f64,
}

impl<'a> Remainder<'a> {
    pub(super) fn new(equations: &'a Equations, products: &'a Products) -> Self {
        let frames = equations.frames;
        let weigh = |row: &Vec<f64>| -> Vec<f64> {
            let used: Vec<(usize, f64)> =
                row.iter().copied().enumerate().filter(|(_, weight)| *weight != 0.0).collect();
            (0..frames).map(|j| used.iter().map(|(i, weight)| weight * products.at(*i, j)).sum()).collect()
        };
        let with_frames: Vec<Vec<f64>> = equations.rows.iter().map(weigh).collect();
        let energy = equations.rows.iter().zip(&with_frames).map(|(row, with)| dot(row, with)).sum::<f64>().max(0.0);
        let scale = equations
            .rows
            .iter()
            .zip(&equations.terms)
            .map(|(row, terms)| {
                let lit = (FIRST..frames).filter(|i| row[*i] != 0.0);
                lit.map(|i| products.distance2(i, BLACK)).sum::<f64>() / terms
            })
            .sum();
        Self { equations, products, with_frames, energy, scale }
    }

    /// Relative L2: 0 where all agrees, of the order of one where photographs have nothing to do with each other.
    pub(super) fn relative(&self) -> f64 {
        if self.scale > 0.0 { (self.energy / self.scale).sqrt() } else { 0.0 }
    }

    /// Share of the remainder that is gone if frame `i` may be any picture.
    pub(super) fn explained_by_any_picture(&self, i: usize) -> f64 {
        let (mut projected, mut weight) = (0.0, 0.0);
        let of: Vec<(usize, f64)> = self.equations.of(i).collect();
        for (e, a) in &of {
            weight += a * a;
            for (other, b) in &of {
                projected += a * b * dot(&self.equations.rows[*other], &self.with_frames[*e]);
            }
        }
        if weight > 0.0 && self.energy > 0.0 { projected / weight / self.energy } else { 0.0 }
    }

    /// Share of the remainder that is gone if frame `i` is multiplied by a number, and the number.
    pub(super) fn explained_by_scaling(&self, i: usize) -> (f64, f64) {
        let weight: f64 = self.equations.of(i).map(|(_, a)| a * a).sum::<f64>() * self.products.at(i, i);
        let along: f64 = self.equations.of(i).map(|(e, a)| a * self.with_frames[e][i]).sum();
        if weight > 0.0 && self.energy > 0.0 {
            (along * along / weight / self.energy, 1.0 - along / weight)
        } else {
            (0.0, 1.0)
        }
    }

    /// The exchange that removes most, of those that remove about what they should.
    pub(super) fn best_exchange(&self, known: &[bool]) -> Option<Exchange> {
        let frames: Vec<usize> = (0..self.equations.frames).filter(|i| known[*i]).collect();
        let mut best: Option<Exchange> = None;
        for (index, i) in frames.iter().copied().enumerate() {
            for j in frames[index + 1..].iter().copied() {
                let (mut along, mut weight) = (0.0, 0.0);
                for (row, with) in self.equations.rows.iter().zip(&self.with_frames) {
                    let turned = row[i] - row[j];
                    if turned != 0.0 {
                        weight += turned * turned;
                        along += turned * (with[i] - with[j]);
                    }
                }
                let ideal = weight * self.products.distance2(i, j);
                if ideal <= 0.0 {
                    continue;
                }
                // r becomes r − turned (Fᵢ − Fⱼ).
                let removed = 2.0 * along - ideal;
                let found = Exchange { i, j, explained: removed / self.energy, of_ideal: removed / ideal };
                if (0.6..=1.6).contains(&found.of_ideal) && best.is_none_or(|best| best.explained < found.explained) {
                    best = Some(found);
                }
            }
        }
        best
    }

    /// The slope a of a lamp that shone 1 + a·tᵢ for frame i, its standard error for `bins` independent values a frame, and the share of the
    /// remainder that it explains.
    pub(super) fn drift(&self, times: &[f64], bins: usize) -> Option<(f64, f64, f64)> {
        let (mut along, mut weight) = (0.0, 0.0);
        for (row, with) in self.equations.rows.iter().zip(&self.with_frames) {
            let moved: Vec<(usize, f64)> =
                row.iter().zip(times).map(|(a, t)| a * t).enumerate().filter(|(_, value)| *value != 0.0).collect();
            for (i, a) in &moved {
                along += a * with[*i];
                weight += moved.iter().map(|(j, b)| a * b * self.products.at(*i, *j)).sum::<f64>();
            }
        }
        if weight <= 0.0 || self.energy <= 0.0 {
            return None;
        }
        let explained = along * along / weight / self.energy;
        let left = self.energy * (1.0 - explained).max(0.0) / (bins * self.equations.rows.len()) as f64;
        Some((along / weight, (left / weight).sqrt(), explained))
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
