//! Which square lights a pixel, and whether squares that light neighbouring pixels are neighbours in the pattern.
//!
//! Two combs of one table may be exchanged without any sum noticing: `row-0-1` and `row-3-1`, 3 apart, light the same columns. But then
//! pixels beside each other are lit by squares that stand apart. A pixel belongs to the square of its brightest row comb and
//! brightest column comb, if these share one and are bright enough to be direct light.

use std::collections::BTreeMap;

use crate::{Scheme, ShownPattern};

use super::sums::FIRST;

/// A comb that shows less of white than this does not light a pixel directly.
const DIRECT: f32 = 0.3;
/// A pixel that gets less than this of the mean light is left out.
const DARK: f32 = 0.1;
/// Pairs of neighbouring pixels that two patterns must light before they are accused: so many, and this share of what two patterns light
/// on average.
const LEAST_PAIRS: (f64, f64) = (10.0, 0.15);
/// What may be left of them if two patterns are exchanged.
const LEFT: f64 = 0.4;
/// Squares farther apart count no more than this.
const FARTHEST: usize = 3;

/// How often squares light neighbouring pixels.
pub(super) struct Neighbours {
    scheme: Scheme,
    squares: usize,
    /// Patterns whose frames are not known: what is in a table with one of them is not judged.
    unknown: Vec<ShownPattern>,
    /// By square (v · M + u): the other, and how many pairs of pixels.
    pairs: Vec<Vec<(usize, f64)>>,
}

impl Neighbours {
    /// From frames above black, indexed as in [`super::sums`]; those that are not known are empty.
    pub(super) fn new(scheme: Scheme, squares: usize, frames: &[Vec<f32>], width: usize) -> Self {
        let patterns = scheme.lighting(squares);
        let labels = labels(scheme, squares, &patterns, &frames[FIRST..]);
        let mut counts: BTreeMap<(usize, usize), usize> = BTreeMap::new();
        for (index, label) in labels.iter().enumerate() {
            let right = (index % width + 1 < width).then(|| index + 1);
            let below = (index + width < labels.len()).then(|| index + width);
            for other in [right, below].into_iter().flatten() {
                if let (Some(a), Some(b)) = (label, labels[other])
                    && *a != b
                {
                    *counts.entry((*a, b)).or_default() += 1;
                }
            }
        }
        let mut pairs = vec![Vec::new(); squares * squares];
        for ((a, b), count) in counts {
            pairs[a].push((b, count as f64));
            pairs[b].push((a, count as f64));
        }
        let unknown =
            patterns.iter().zip(&frames[FIRST..]).filter(|(_, frame)| frame.is_empty()).map(|(pattern, _)| *pattern);
        let unknown = unknown.collect();
        Self { scheme, squares, unknown, pairs }
    }

    /// By how much two squares are no neighbours.
    fn apart(&self, a: usize, b: usize) -> f64 {
        let m = self.squares;
        let chebyshev = (a % m).abs_diff(b % m).max((a / m).abs_diff(b / m));
        chebyshev.saturating_sub(1).min(FARTHEST) as f64
    }

    /// How far apart squares are that light neighbouring pixels, over all pixels.
    pub(super) fn disorder(&self) -> f64 {
        let of =
            |square: usize| self.pairs[square].iter().map(move |(other, count)| count * self.apart(square, *other));
        (0..self.pairs.len()).flat_map(of).sum::<f64>() / 2.0
    }

    /// The patterns that no sum tells apart and that, exchanged, bring the squares into order; with how many pairs of pixels were out
    /// of order and how many are left.
    pub(super) fn best_exchange(&self) -> Option<(ShownPattern, ShownPattern, f64, f64)> {
        let mut best: Option<(ShownPattern, ShownPattern, f64, f64)> = None;
        let candidates = self.candidates();
        let all: f64 = self.pairs.iter().flatten().map(|(_, count)| count).sum();
        let patterns = self.scheme.lighting(self.squares).len() as f64;
        // Both families together light every pixel twice.
        let families = if self.scheme == Scheme::Squares { 1.0 } else { 2.0 };
        let least = LEAST_PAIRS.0.max(LEAST_PAIRS.1 * 2.0 * families * all / patterns);
        for (a, b) in candidates {
            let (before, after, pairs) = self.exchanged(a, b);
            let better = best.is_none_or(|(_, _, b, a)| before - after > b - a);
            if pairs >= least && before >= 0.5 * pairs && after <= LEFT * before && better {
                best = Some((a, b, before, after));
            }
        }
        best
    }

    fn candidates(&self) -> Vec<(ShownPattern, ShownPattern)> {
        let patterns = self.scheme.lighting(self.squares);
        let alike = |a: ShownPattern, b: ShownPattern| match (self.scheme, a, b) {
            (Scheme::Squares, ..) => true,
            (Scheme::Combs { spacing }, ShownPattern::Row { v, k }, ShownPattern::Row { v: other, k: phase })
            | (
                Scheme::Combs { spacing },
                ShownPattern::Column { u: v, k },
                ShownPattern::Column { u: other, k: phase },
            ) => k == phase && v % spacing == other % spacing,
            _ => false,
        };
        let pairs =
            patterns.iter().enumerate().flat_map(|(index, a)| patterns[index + 1..].iter().map(move |b| (*a, *b)));
        let judged = |pattern: ShownPattern| !self.unknown.iter().any(|unknown| alike(pattern, *unknown));
        pairs.filter(|(a, b)| alike(*a, *b) && judged(*a)).collect()
    }

    /// Disorder of the pairs that a square of `a` or `b` is in, as they are and if these were exchanged; and how many pairs these are.
    fn exchanged(&self, a: ShownPattern, b: ShownPattern) -> (f64, f64, f64) {
        let m = self.squares;
        let spacing = match self.scheme {
            Scheme::Combs { spacing } => spacing,
            Scheme::Squares => 1,
        };
        let lit = |pattern: ShownPattern| pattern.lit(m, spacing).into_iter().map(|(u, v)| v * m + u);
        // Squares of combs that are exchanged trade places one for one.
        let trades: BTreeMap<usize, usize> =
            lit(a).zip(lit(b)).flat_map(|(one, other)| [(one, other), (other, one)]).collect();
        let (mut before, mut after, mut pairs) = (0.0, 0.0, 0.0);
        for (square, traded) in &trades {
            for (other, count) in &self.pairs[*square] {
                // A pair of two that trade is seen from both.
                let weight = if trades.contains_key(other) { 0.5 * count } else { *count };
                pairs += weight;
                before += weight * self.apart(*square, *other);
                after += weight * self.apart(*traded, *trades.get(other).unwrap_or(other));
            }
        }
        (before, after, pairs)
    }
}

/// The square that lights each pixel directly, if it can be told.
fn labels(scheme: Scheme, squares: usize, patterns: &[ShownPattern], frames: &[Vec<f32>]) -> Vec<Option<usize>> {
    let pixels = frames.iter().map(Vec::len).max().unwrap_or(0);
    let lit = |frames: &[Vec<f32>], pixel: usize| -> f32 { frames.iter().filter_map(|frame| frame.get(pixel)).sum() };
    let mean = (0..pixels).map(|pixel| lit(frames, pixel)).sum::<f32>() / pixels.max(1) as f32;
    let brightest = |frames: &[Vec<f32>], pixel: usize| {
        let mut best: Option<(usize, f32)> = None;
        let mut sum = 0.0;
        for (index, frame) in frames.iter().enumerate() {
            let value = frame.get(pixel).copied().unwrap_or(0.0);
            sum += value;
            if best.is_none_or(|best| value > best.1) {
                best = Some((index, value));
            }
        }
        best.filter(|(_, value)| *value > 0.0 && *value >= DIRECT * sum).map(|(index, _)| index)
    };
    let label = |pixel: usize| match scheme {
        _ if lit(frames, pixel) < DARK * mean => None,
        Scheme::Squares => brightest(frames, pixel),
        Scheme::Combs { spacing } => {
            let (rows, columns) = frames.split_at(frames.len() / 2);
            let (row, column) = (brightest(rows, pixel)?, brightest(columns, pixel)?);
            match (patterns[row], patterns[rows.len() + column]) {
                (ShownPattern::Row { v, k }, ShownPattern::Column { u, k: l })
                    if u % spacing == k && v % spacing == l =>
                {
                    Some(v * squares + u)
                }
                _ => None,
            }
        }
    };
    (0..pixels).map(label).collect()
}
