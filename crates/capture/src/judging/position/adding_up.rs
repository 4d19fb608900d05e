//! The frames of a position added up, defect after defect taken out, until what is left is noise.

use super::{DRIFT, Room};
use crate::ShownPattern;
use crate::judging::neighbours::Neighbours;
use crate::judging::reading::Frame;
use crate::judging::sums::{BLACK, Equations, Products, Remainder, WHITE};
use crate::judging::{FindingKind, Severity};

/// A remainder of the sums below this is noise.
const NOISE: f64 = 0.02;
/// How often a drift must be its standard error.
const SIGNIFICANT: f64 = 6.0;
/// Share of small pixels that must be unclipped in all frames to add frames up, and how many at least.
const USABLE: (f64, usize) = (0.25, 40);
/// Defects of the sums that are looked for in one position.
const DEFECTS: usize = 8;

/// The frames that are added up, while defects are taken out of them.
pub(super) struct Sums {
    /// Small, 0 where any is clipped; empty where not known.
    pub(super) frames: Vec<Vec<f32>>,
    /// Pixels that are not clipped.
    pub(super) bins: usize,
    pub(super) width: usize,
    pub(super) times: Vec<f64>,
    /// What has been taken out.
    pub(super) drift: f64,
}

impl Sums {
    pub(super) fn take_drift_out(&mut self, slope: f64) {
        self.drift += slope;
        for (frame, time) in self.frames.iter_mut().zip(&self.times) {
            let scale = (1.0 / (1.0 + slope * time)) as f32;
            frame.iter_mut().for_each(|value| *value *= scale);
        }
    }

    pub(super) fn above_black(&self) -> Vec<Vec<f32>> {
        let black = &self.frames[BLACK];
        let above = |frame: &Vec<f32>| frame.iter().zip(black).map(|(value, black)| value - black).collect();
        self.frames.iter().map(above).collect()
    }
}

impl Room<'_> {
    /// Adds frames up and looks for what explains the remainder. Comes back with the contradiction that was there at first, and the
    /// lamp's drift.
    pub(super) fn sums(&mut self, known: &mut [bool]) -> (Option<f64>, Option<f64>) {
        if !known[BLACK] {
            return (None, None);
        }
        let used = |frames: &[Frame], known: &[bool], bin: usize| {
            frames.iter().zip(known).all(|(frame, known)| !known || frame.small[bin].is_finite())
        };
        let usable: Vec<bool> = (0..self.frames[BLACK].small.len()).map(|bin| used(&self.frames, known, bin)).collect();
        let bins = usable.iter().filter(|usable| **usable).count();
        if bins < USABLE.1 || (bins as f64) < USABLE.0 * usable.len() as f64 {
            return (None, None);
        }
        let keep = |frame: &Frame| -> Vec<f32> {
            frame.small.iter().zip(&usable).map(|(value, usable)| if *usable { *value } else { 0.0 }).collect()
        };
        let frames: Vec<Vec<f32>> = self
            .frames
            .iter()
            .zip(&*known)
            .map(|(frame, known)| if *known { keep(frame) } else { Vec::new() })
            .collect();
        let mut sums = Sums { frames, bins, width: self.judge.small.size.0, times: self.times(known), drift: 0.0 };
        let mut contradiction = None;
        for _ in 0..DEFECTS {
            let equations = Equations::new(self.scheme, self.squares, known);
            if equations.is_empty() {
                break;
            }
            let products = Products::new(&sums.frames);
            let remainder = Remainder::new(&equations, &products);
            contradiction.get_or_insert(remainder.relative());
            if remainder.relative() < NOISE || !self.explain(&mut sums, known, &equations, &remainder) {
                break;
            }
        }
        self.slow_drift(&mut sums, known);
        self.restore(&mut sums, known);
        self.order(&mut sums);
        let drift = contradiction.map(|_| sums.drift);
        (contradiction, drift)
    }

    /// When each frame was taken, −½ … ½ over the position.
    pub(super) fn times(&self, known: &[bool]) -> Vec<f64> {
        let lines = || self.frames.iter().zip(known).filter(|(_, known)| **known).map(|(frame, _)| frame.line);
        let (first, last) = (lines().fold(f64::INFINITY, f64::min), lines().fold(f64::NEG_INFINITY, f64::max));
        let span = (last - first).max(1.0);
        self.frames.iter().map(|frame| (frame.line - first) / span - 0.5).collect()
    }

    /// A lamp that rises or falls evenly, which shows in all sums a little.
    pub(super) fn slow_drift(&mut self, sums: &mut Sums, known: &[bool]) {
        let equations = Equations::new(self.scheme, self.squares, known);
        let products = Products::new(&sums.frames);
        if let Some((slope, error, _)) = Remainder::new(&equations, &products).drift(&sums.times, sums.bins)
            && slope.abs() > SIGNIFICANT * error
        {
            sums.take_drift_out(slope);
        }
        if sums.drift.abs() >= DRIFT {
            let text = format!(
                "the lamp changed by {:+.1} % from the first photograph of the position to the last: let it warm up, or give a \
                 reference_patch",
                100.0 * sums.drift
            );
            self.find(FindingKind::LampDrift, Severity::Warning, &[], (sums.drift, DRIFT), text);
        }
    }

    /// Puts what the others say in the place of frames that cannot be believed, where they say it.
    pub(super) fn restore(&self, sums: &mut Sums, known: &[bool]) {
        let bins = sums.frames[BLACK].len();
        let lost: Vec<usize> = (WHITE..known.len()).filter(|index| !known[*index]).collect();
        for index in lost {
            let mut with = known.to_vec();
            with[index] = true;
            sums.frames[index] = vec![0.0; bins];
            let demanded = Equations::new(self.scheme, self.squares, &with).demanded(index, &sums.frames);
            let above_zero = |mut demanded: Vec<f32>| {
                demanded.iter_mut().zip(&sums.frames[BLACK]).for_each(|(value, black)| *value += black);
                demanded
            };
            sums.frames[index] = demanded.map(above_zero).unwrap_or_default();
        }
    }

    /// Patterns exchanged that no sum tells apart.
    pub(super) fn order(&mut self, sums: &mut Sums) {
        for _ in 0..DEFECTS {
            let neighbours = Neighbours::new(self.scheme, self.squares, &sums.above_black(), sums.width);
            let Some((a, b, before, after)) = neighbours.best_exchange() else { return };
            let index = |pattern: ShownPattern| self.frames.iter().position(|frame| frame.pattern == pattern);
            let (Some(i), Some(j)) = (index(a), index(b)) else { return };
            let text = format!(
                "the photographs of {a} and {b} are exchanged: their squares light pixels beside those of squares that stand apart, and \
                 would not in each other's place"
            );
            self.find(FindingKind::Swapped, Severity::Fault, &[i, j], (1.0 - after / before, 0.0), text);
            sums.frames.swap(i, j);
        }
    }
}
