//! What explains it when photographs do not add up: the least that does.

use super::adding_up::Sums;
use super::{BLANK, DRIFT, Room, mean_of};
use crate::Scheme;
use crate::judging::neighbours::Neighbours;
use crate::judging::sums::{BLACK, Equations, FIRST, Remainder, WHITE};
use crate::judging::{FindingKind, Severity};

/// A remainder that nothing explains is a contradiction above this.
const CONTRADICTION: f64 = 0.06;
/// One cause that explains so much of the remainder is the cause.
const EXPLAINED: f64 = 0.8;
/// One cause among several explains so much.
const PARTLY: f64 = 0.3;
/// Combs that should show less than this of the mean comb are never called blank.
const SHOWN: f64 = 0.05;
/// No lamp changes by more.
const FARTHEST_DRIFT: f64 = 0.4;

impl Room<'_> {
    /// Finds one cause of the remainder and takes it out; false if there is none.
    pub(super) fn explain(
        &mut self,
        sums: &mut Sums,
        known: &mut [bool],
        equations: &Equations,
        remainder: &Remainder,
    ) -> bool {
        let exchange = remainder.best_exchange(known);
        if let Some(exchange) = exchange.filter(|exchange| exchange.explained >= EXPLAINED) {
            self.swapped(sums, exchange.i, exchange.j, exchange.explained);
            return true;
        }
        if let Some((slope, _, explained)) = remainder.drift(&sums.times, sums.bins)
            && explained >= EXPLAINED
            && (DRIFT..FARTHEST_DRIFT).contains(&slope.abs())
        {
            sums.take_drift_out(slope);
            return true;
        }
        if let Some((index, shown)) = self.blank(sums, known, equations, remainder) {
            let pattern = self.frames[index].pattern;
            let text = format!(
                "{pattern} shows no more than black, though the other photographs say that it lights something"
            );
            self.find(FindingKind::Blank, Severity::Fault, &[index], (shown, 1.0), text);
            known[index] = false;
            return true;
        }
        if self.one_frame(sums, known, equations, remainder) {
            return true;
        }
        if let Some(exchange) = exchange.filter(|exchange| exchange.explained >= PARTLY) {
            self.swapped(sums, exchange.i, exchange.j, exchange.explained);
            return true;
        }
        if remainder.relative() > CONTRADICTION {
            let text = format!(
                "the photographs contradict each other by {:.0} %, and neither two of them exchanged nor one that is wrong explains it: was \
                 something moved, or the light switched on?",
                100.0 * remainder.relative()
            );
            let figures = (remainder.relative(), CONTRADICTION);
            self.find(FindingKind::Contradiction, Severity::Fault, &[], figures, text);
        }
        false
    }

    pub(super) fn swapped(&mut self, sums: &mut Sums, i: usize, j: usize, explained: f64) {
        let (a, b) = (self.frames[i].pattern, self.frames[j].pattern);
        let text = format!(
            "the photographs of {a} and {b} are exchanged: in each other's place they remove {:.0} % of what contradicts the others",
            100.0 * explained.min(1.0)
        );
        self.find(FindingKind::Swapped, Severity::Fault, &[i, j], (explained.min(1.0), 0.0), text);
        sums.frames.swap(i, j);
    }

    /// A frame that shows nothing where the others say that it does; and its share of that.
    pub(super) fn blank(
        &self,
        sums: &Sums,
        known: &[bool],
        equations: &Equations,
        remainder: &Remainder,
    ) -> Option<(usize, f64)> {
        let above_black = |frame: &Vec<f32>| mean_of(frame) - mean_of(&sums.frames[BLACK]);
        let lit: Vec<f64> = sums.frames[FIRST..].iter().filter(|frame| !frame.is_empty()).map(above_black).collect();
        let usual = lit.iter().sum::<f64>() / lit.len().max(1) as f64;
        let candidates: Vec<(usize, f64, Vec<f32>)> = (WHITE..sums.frames.len())
            .filter(|index| known[*index] && remainder.explained_by_any_picture(*index) > PARTLY / 2.0)
            .filter_map(|index| {
                let demanded = equations.demanded(index, &sums.frames)?;
                let (shown, expected) = (above_black(&sums.frames[index]), mean_of(&demanded));
                (expected > SHOWN * usual && shown < BLANK * expected).then_some((index, shown / expected, demanded))
            })
            .collect();
        if candidates.len() < 2 {
            return candidates.first().map(|(index, shown, _)| (*index, shown.max(0.0)));
        }
        // Several show nothing; what is demanded fits beside its neighbours in the place of one of them.
        let disorder = |(index, _, demanded): &(usize, f64, Vec<f32>)| {
            let mut frames = sums.above_black();
            frames[*index].clone_from(demanded);
            Neighbours::new(self.scheme, self.squares, &frames, sums.width).disorder()
        };
        let disorders: Vec<f64> = candidates.iter().map(disorder).collect();
        let best = (0..candidates.len()).min_by(|a, b| disorders[*a].total_cmp(&disorders[*b]))?;
        Some((candidates[best].0, candidates[best].1.max(0.0)))
    }

    /// One frame that shows something else than the others say.
    pub(super) fn one_frame(
        &mut self,
        sums: &mut Sums,
        known: &mut [bool],
        equations: &Equations,
        remainder: &Remainder,
    ) -> bool {
        let explained: Vec<f64> = (0..sums.frames.len())
            .map(|index| if known[index] { remainder.explained_by_any_picture(index) } else { 0.0 })
            .collect();
        let most = explained.iter().copied().fold(0.0, f64::max);
        if most < EXPLAINED {
            return false;
        }
        let alike: Vec<usize> = (0..explained.len()).filter(|index| explained[*index] > most - 0.02).collect();
        if alike.contains(&BLACK) || alike.contains(&WHITE) {
            return self.black_or_white(sums, known, equations, &alike);
        }
        let index = self.the_wrong_one(sums, equations, remainder, &alike);
        let demanded = equations.demanded(index, &sums.frames).unwrap_or_default();
        let ratio = mean_of(&sums.frames[index]) / (mean_of(&demanded) + mean_of(&sums.frames[BLACK]));
        let (scaled, _) = remainder.explained_by_scaling(index);
        let pattern = self.frames[index].pattern;
        let why = if scaled > EXPLAINED {
            "is its exposure listed wrong, or did the lamp flicker?"
        } else {
            "it is of something else than the table says"
        };
        let text = format!("{pattern} shows {ratio:.2} times the light that the other photographs say: {why}");
        self.find(FindingKind::Contradiction, Severity::Fault, &[index], (ratio, 1.0), text);
        known[index] = false;
        true
    }

    /// Frames of one table stand in the same equations. The one that is wrong shows a multiple of what it should, or is replaced by
    /// light where the others are replaced by less than none, or else by light that fits beside its neighbours.
    pub(super) fn the_wrong_one(
        &self,
        sums: &Sums,
        equations: &Equations,
        remainder: &Remainder,
        alike: &[usize],
    ) -> usize {
        let least = |values: &[f64]| (0..values.len()).min_by(|a, b| values[*a].total_cmp(&values[*b])).unwrap_or(0);
        let unscaled: Vec<f64> = alike.iter().map(|index| 1.0 - remainder.explained_by_scaling(*index).0).collect();
        if unscaled[least(&unscaled)] < 1.0 - EXPLAINED {
            return alike[least(&unscaled)];
        }
        let demanded = |index: usize| equations.demanded(index, &sums.frames).unwrap_or_default();
        let below_zero =
            |index: usize| demanded(index).iter().map(|value| f64::from(value.min(0.0)).powi(2)).sum::<f64>();
        let negative: Vec<f64> = alike.iter().map(|index| below_zero(*index)).collect();
        let best = least(&negative);
        if negative.iter().enumerate().all(|(other, value)| other == best || negative[best] < 0.5 * value) {
            return alike[best];
        }
        let disorder = |index: usize| {
            let mut frames = sums.above_black();
            frames[index] = demanded(index);
            Neighbours::new(self.scheme, self.squares, &frames, sums.width).disorder()
        };
        let disorders: Vec<f64> = alike.iter().map(|index| disorder(*index)).collect();
        alike[least(&disorders)]
    }

    /// The black or the white frame contradicts all others.
    pub(super) fn black_or_white(
        &mut self,
        sums: &mut Sums,
        known: &mut [bool],
        equations: &Equations,
        alike: &[usize],
    ) -> bool {
        let Some(demanded) = equations.demanded_black(&sums.frames) else { return false };
        let (black, expected) = (mean_of(&sums.frames[BLACK]), mean_of(&demanded));
        let white = if sums.frames[WHITE].is_empty() { f64::NAN } else { mean_of(&sums.frames[WHITE]) };
        // Where both explain it: a black frame is too bright when something else shone, never below zero.
        let white_is_wrong = !alike.contains(&BLACK) || alike.contains(&WHITE) && (expected < 0.0 || expected > black);
        if white_is_wrong {
            let count = self.frames.len() - FIRST;
            let families = if matches!(self.scheme, Scheme::Squares) { 1.0 } else { 2.0 };
            let lit: f64 = sums.frames[FIRST..].iter().map(|frame| mean_of(frame) - black).sum::<f64>() / families;
            let ratio = (white - black) / lit;
            let text = format!(
                "white shows {ratio:.2} times the light of all {count} patterns together: is its exposure listed wrong, or is it of \
                 something else?"
            );
            self.find(FindingKind::Contradiction, Severity::Fault, &[WHITE], (ratio, 1.0), text);
            known[WHITE] = false;
            return true;
        }
        let text = format!(
            "the black frame shows {:.2} % of white, the other photographs say {:.2} %: was there other light, or is it of another pattern?",
            100.0 * black / white,
            100.0 * expected / white
        );
        self.find(FindingKind::BlackFrame, Severity::Fault, &[BLACK], (black / white, expected / white), text);
        sums.frames[BLACK] = demanded;
        true
    }
}
