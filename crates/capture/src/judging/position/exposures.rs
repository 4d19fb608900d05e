//! Exposures of one pattern: too much, too little, not of the same.

use super::{BLANK, Room};
use crate::judging::reading::Frame;
use crate::judging::sums::{BLACK, Equations};
use crate::judging::{FindingKind, Severity};

/// Highlights are clipped in about so many pixels of a good capture.
const CLIPPED: f64 = 0.01;
/// The brightest pixels of a well exposed capture reach so much of the camera's range.
const FILLED: f64 = 0.05;
/// Exposures that differ by more do not show the same.
const UNLIKE: f64 = 0.2;

impl Room<'_> {
    /// Over- and under-exposed photographs.
    pub(super) fn exposures(&mut self) {
        let is_over = |frame: &Frame| frame.over > CLIPPED && frame.losses.is_empty();
        let over: Vec<usize> = (0..self.frames.len()).filter(|index| is_over(&self.frames[*index])).collect();
        let worst = over.iter().copied().max_by(|a, b| self.frames[*a].over.total_cmp(&self.frames[*b].over));
        if let Some(worst) = worst {
            let frame = &self.frames[worst];
            let text = format!(
                "{:.1} % of the pixels of {} are clipped in every exposure, and in {} pattern(s) more than {:.0} %: add a shorter \
                 exposure",
                100.0 * frame.over,
                frame.pattern,
                over.len(),
                100.0 * CLIPPED
            );
            let shortest = |index: &usize| self.frames[*index].exposures.first().map(|exposure| exposure.file.clone());
            let files = over.iter().filter_map(shortest).collect();
            let figures = (frame.over, CLIPPED);
            self.find_files(FindingKind::OverExposed, Severity::Warning, &over, files, figures, text);
        }
        let bright = |index: &usize| self.frames[*index].brightest;
        let read = (0..self.frames.len()).filter(|index| self.frames[*index].is_read());
        let brightest = read.max_by(|a, b| bright(a).total_cmp(&bright(b)));
        if let Some(index) = brightest.filter(|index| bright(index) < FILLED) {
            let frame = &self.frames[index];
            let text = format!(
                "the brightest 1 % of {} begin at {:.2} % of the camera's range in its longest exposure: add a longer exposure",
                frame.pattern,
                100.0 * frame.brightest
            );
            let figures = (frame.brightest, FILLED);
            let files = frame.exposures.last().map(|exposure| exposure.file.clone()).into_iter().collect();
            self.find_files(FindingKind::UnderExposed, Severity::Warning, &[index], files, figures, text);
        }
    }

    /// Holds the exposures of each pattern against each other. Comes back with the frames that can be believed.
    pub(super) fn unlike_exposures(&mut self) -> Vec<bool> {
        let mut known: Vec<bool> = self.frames.iter().map(Frame::is_read).collect();
        // (frame, shorter exposure, difference)
        let mut unlike: Vec<(usize, usize, f64)> = Vec::new();
        for (index, frame) in self.frames.iter().enumerate() {
            for (shorter, exposure) in frame.exposures.iter().enumerate() {
                if let Some(difference) = exposure.unlike_next.filter(|difference| *difference > UNLIKE) {
                    unlike.push((index, shorter, difference));
                    known[index] = false;
                }
            }
        }
        while let Some((index, shorter, difference)) = unlike.first().copied() {
            let partner = unlike[1..].iter().find_map(|(other, at, _)| {
                let (other, at) = (*other, *at);
                let level = self.exchanged_at(index, other, shorter).filter(|_| at == shorter && other != index);
                level.map(|level| (other, level))
            });
            let pattern = self.frames[index].pattern;
            if let Some((other, level)) = partner {
                let files = [index, other].map(|frame| self.frames[frame].exposures[level].file.clone()).to_vec();
                let text = format!(
                    "a photograph of {pattern} and one of {} are exchanged: each fits the other pattern's exposures",
                    self.frames[other].pattern
                );
                self.find_files(FindingKind::Swapped, Severity::Fault, &[index, other], files, (1.0, 0.0), text);
                unlike.retain(|(frame, ..)| *frame != index && *frame != other);
                continue;
            }
            unlike.retain(|(frame, ..)| *frame != index);
            if let Some((level, shown)) = self.blank_at(index, shorter) {
                let files = vec![self.frames[index].exposures[level].file.clone()];
                let text = format!("a photograph of {pattern} shows no more than black, another exposure of it does");
                self.find_files(FindingKind::Blank, Severity::Fault, &[index], files, (shown, 1.0), text);
                continue;
            }
            let exposures = &self.frames[index].exposures;
            let files = [shorter, shorter + 1].map(|at| exposures[at].file.clone()).to_vec();
            let text = format!(
                "two exposures of {pattern} differ by {:.0} % of their light: is an exposure listed wrong, or one of another pattern?",
                100.0 * difference
            );
            self.find_files(FindingKind::Exposures, Severity::Fault, &[index], files, (difference, UNLIKE), text);
        }
        known
    }

    /// At which of two neighbouring exposures frames `a` and `b` are exchanged, if that makes both agree with themselves.
    pub(super) fn exchanged_at(&self, a: usize, b: usize, shorter: usize) -> Option<usize> {
        let small = |frame: usize, at: usize| self.frames[frame].exposures.get(at).map(|exposure| &exposure.small[..]);
        let (a_short, a_long) = (small(a, shorter)?, small(a, shorter + 1)?);
        let (b_short, b_long) = (small(b, shorter)?, small(b, shorter + 1)?);
        let crossed = (unlike_small(a_short, b_long)?, unlike_small(b_short, a_long)?);
        let straight = (unlike_small(a_short, a_long)?, unlike_small(b_short, b_long)?);
        if crossed.0.max(crossed.1) > UNLIKE.min(0.5 * straight.0.min(straight.1)) {
            return None;
        }
        // Which of the two exposures is the wrong one, the black frame cannot say; the sums of the others can.
        let wrong = |at: usize| {
            let demanded = self.demanded_of(a)?;
            unlike_small(small(a, at)?, &demanded)
        };
        match (wrong(shorter), wrong(shorter + 1)) {
            (Some(short), Some(long)) if long > short => Some(shorter + 1),
            _ => Some(shorter),
        }
    }

    /// What the frames that agree with themselves say of frame `index`, with black in it; small.
    pub(super) fn demanded_of(&self, index: usize) -> Option<Vec<f32>> {
        let agrees = |frame: &Frame| {
            frame.is_read()
                && frame.exposures.iter().all(|exposure| exposure.unlike_next.is_none_or(|unlike| unlike <= UNLIKE))
        };
        let mut known: Vec<bool> = self.frames.iter().map(agrees).collect();
        known[index] = true;
        let equations = Equations::new(self.scheme, self.squares, &known);
        let frames: Vec<Vec<f32>> = self.frames.iter().map(|frame| frame.small.clone()).collect();
        let mut demanded = equations.demanded(index, &frames)?;
        demanded.iter_mut().zip(&frames[BLACK]).for_each(|(value, black)| *value += black);
        Some(demanded)
    }

    /// Which of two neighbouring exposures shows no more than the black frame's, and what it shows over the other.
    pub(super) fn blank_at(&self, index: usize, shorter: usize) -> Option<(usize, f64)> {
        if index == BLACK {
            return None;
        }
        let black = mean(self.frames[BLACK].small.iter().copied())?;
        let shown = |at: usize| {
            let small = &self.frames[index].exposures.get(at)?.small;
            Some(mean(small.iter().copied())? - black)
        };
        let (short, long) = (shown(shorter)?, shown(shorter + 1)?);
        let (least, level, most) = if short < long { (short, shorter, long) } else { (long, shorter + 1, short) };
        (most > black && least < BLANK * most).then(|| (level, (least / most).max(0.0)))
    }
}

/// Relative L1 difference of two small pictures where neither is clipped; `None` if they have nothing to compare.
fn unlike_small(a: &[f32], b: &[f32]) -> Option<f64> {
    let both = a.iter().zip(b).filter(|(a, b)| a.is_finite() && b.is_finite());
    let (difference, light) = both.fold((0.0, 0.0), |(difference, light), (a, b)| {
        (difference + f64::from((a - b).abs()), light + f64::from(a.max(*b).max(0.0)))
    });
    (light > 0.0).then(|| difference / light)
}

fn mean(values: impl Iterator<Item = f32>) -> Option<f64> {
    let (sum, count) = values
        .filter(|value| value.is_finite())
        .fold((0.0, 0usize), |(sum, count), value| (sum + f64::from(value), count + 1));
    (count > 0).then(|| sum / count as f64)
}
