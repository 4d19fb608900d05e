//! One position: its photographs read, held against each other, and what is wrong with them.

use std::path::PathBuf;

use rayon::prelude::*;

use super::neighbours::Neighbours;
use super::reading::{self, Frame};
use super::registration::Orientations;
use super::sums::{BLACK, Equations, FIRST, Products, Remainder, WHITE};
use super::{Finding, FindingKind, Judge, PatternExposure, PositionJudgement, Severity};
use crate::{ReferencePatch, Scheme, ShownPattern};

/// Highlights are clipped in about so many pixels of a good capture.
const CLIPPED: f64 = 0.01;
/// The brightest pixels of a well exposed capture reach so much of the camera's range.
const FILLED: f64 = 0.05;
/// Exposures that differ by more do not show the same.
const UNLIKE: f64 = 0.2;
/// A remainder of the sums below this is noise.
const NOISE: f64 = 0.02;
/// A remainder that nothing explains is a contradiction above this.
const CONTRADICTION: f64 = 0.06;
/// One cause that explains so much of the remainder is the cause.
const EXPLAINED: f64 = 0.8;
/// One cause among several explains so much.
const PARTLY: f64 = 0.3;
/// A frame that shows less than this of what the others say of it is blank.
const BLANK: f64 = 0.1;
/// Combs that should show less than this of the mean comb are never called blank.
const SHOWN: f64 = 0.05;
/// A lamp that changes by more while the projector stands is worth a word.
const DRIFT: f64 = 0.01;
/// No lamp changes by more.
const FARTHEST_DRIFT: f64 = 0.4;
/// How often a drift must be its standard error.
const SIGNIFICANT: f64 = 6.0;
/// Pixels that the camera moved within a position, where the light is the same.
const MOVED: f64 = 0.5;
/// Share of small pixels that must be unclipped in all frames to add frames up, and how many at least.
const USABLE: (f64, usize) = (0.25, 40);
/// Defects of the sums that are looked for in one position.
const DEFECTS: usize = 8;

pub(super) fn judge(judge: &Judge, position: usize) -> PositionJudgement {
    let setup = judge.capture().setup();
    let squares = setup.cells().squares();
    let patterns: Vec<ShownPattern> =
        [ShownPattern::Black, ShownPattern::White].into_iter().chain(setup.scheme().lighting(squares)).collect();
    let (frames, families) = read_all(judge, position, &patterns);
    let mut room = Room { judge, position, scheme: setup.scheme(), squares, frames, findings: Vec::new() };
    room.exposures();
    let mut known = room.unlike_exposures();
    let patch_drift = room.reference_patch();
    let (contradiction, drift) = room.sums(&mut known);
    let white = judge.orientations(&room.frames[WHITE].detail);
    room.movement(white.as_ref(), &families);
    let shifts = judge
        .references
        .iter()
        .map(|(_, reference)| white.as_ref()?.shift_from(reference.as_ref()?))
        .map(|shift| shift.map(|(dx, dy)| (dx * judge.detail.block as f64, dy * judge.detail.block as f64)))
        .collect();
    let listed: Vec<_> = patterns.iter().flat_map(|pattern| judge.capture().exposures(position, *pattern)).collect();
    PositionJudgement {
        position,
        patterns: room.frames.iter().filter(|frame| !frame.files.is_empty()).map(exposure).collect(),
        damaged: room.frames.iter().flat_map(|frame| frame.losses.clone()).collect(),
        verified: room.frames.iter().map(|frame| frame.verified).sum(),
        unlisted: listed.iter().filter(|row| row.sha256.is_none()).count(),
        black_share: room.black_share(),
        findings: room.findings,
        contradiction,
        drift,
        patch_drift,
        shifts,
    }
}

fn exposure(frame: &Frame) -> PatternExposure {
    PatternExposure {
        pattern: frame.pattern,
        files: frame.files.clone(),
        over_exposed: frame.over,
        under_exposed: frame.under,
    }
}

/// A family of patterns that lights every square once: its name, and the sum of its frames, if all could be read.
type Family = (&'static str, Option<Vec<f32>>);

/// Reads all photographs of a position, a few patterns at a time; of their pixels only sums are kept.
fn read_all(judge: &Judge, position: usize, patterns: &[ShownPattern]) -> (Vec<Frame>, Vec<Family>) {
    let mut families: Vec<Family> = match judge.capture().setup().scheme() {
        Scheme::Combs { .. } => vec![("row combs", None), ("column combs", None)],
        Scheme::Squares => vec![("squares", None)],
    };
    families.iter_mut().for_each(|(_, sum)| *sum = Some(vec![0.0; judge.detail.len()]));
    let mut frames: Vec<Frame> = Vec::with_capacity(patterns.len());
    for batch in patterns.chunks(2 * rayon::current_num_threads()) {
        let read =
            |pattern: &ShownPattern| reading::read(judge.developer, position, *pattern, judge.small, judge.detail);
        for mut frame in batch.par_iter().map(read).collect::<Vec<_>>() {
            let family = match frame.pattern {
                ShownPattern::Black | ShownPattern::White => None,
                ShownPattern::Row { .. } | ShownPattern::Square { .. } => Some(0),
                ShownPattern::Column { .. } => Some(1),
            };
            if let Some(family) = family {
                // Added in the order of the scheme, whatever thread was first.
                let sum = &mut families[family].1;
                if !frame.is_read() {
                    *sum = None;
                }
                sum.iter_mut().flatten().zip(&frame.detail).for_each(|(sum, value)| *sum += value);
                frame.detail = Vec::new();
            }
            frames.push(frame);
        }
    }
    (frames, families)
}

/// A position under judgement.
struct Room<'a> {
    judge: &'a Judge<'a>,
    position: usize,
    scheme: Scheme,
    squares: usize,
    /// Black, white, and the lighting patterns of the scheme.
    frames: Vec<Frame>,
    findings: Vec<Finding>,
}

impl Room<'_> {
    fn find(
        &mut self,
        kind: FindingKind,
        severity: Severity,
        frames: &[usize],
        (measured, expected): (f64, f64),
        text: String,
    ) {
        let files = frames.iter().flat_map(|index| self.frames[*index].files.clone()).collect();
        self.find_files(kind, severity, frames, files, (measured, expected), text);
    }

    fn find_files(
        &mut self,
        kind: FindingKind,
        severity: Severity,
        frames: &[usize],
        files: Vec<PathBuf>,
        (measured, expected): (f64, f64),
        text: String,
    ) {
        let patterns = frames.iter().map(|index| self.frames[*index].pattern).collect();
        self.findings.push(Finding {
            kind,
            severity,
            position: self.position,
            patterns,
            files,
            measured,
            expected,
            text,
        });
    }

    /// Over- and under-exposed photographs.
    fn exposures(&mut self) {
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
    fn unlike_exposures(&mut self) -> Vec<bool> {
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
    fn exchanged_at(&self, a: usize, b: usize, shorter: usize) -> Option<usize> {
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
    fn demanded_of(&self, index: usize) -> Option<Vec<f32>> {
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
    fn blank_at(&self, index: usize, shorter: usize) -> Option<(usize, f64)> {
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

    /// What the reference patch says of the lamp; takes it out of the frames.
    fn reference_patch(&mut self) -> Option<(f64, f64)> {
        self.judge.capture().setup().reference_patch()?;
        let black = self.frames[BLACK].patch.filter(|black| *black > 0.0)?;
        let (mut least, mut most) = ((1.0f64, BLACK), (1.0f64, BLACK));
        for index in 0..self.frames.len() {
            let Some(patch) = self.frames[index].patch else { continue };
            let lamp = patch / black;
            if !ReferencePatch::PLAUSIBLE.contains(&lamp) {
                let text = format!(
                    "under {} the reference patch is {lamp:.2} times as bright as under black: it must lie where no square of the \
                     pattern lights it",
                    self.frames[index].pattern
                );
                self.find(FindingKind::LampDrift, Severity::Fault, &[index], (lamp, 1.0), text);
                continue;
            }
            if lamp < least.0 {
                least = (lamp, index);
            }
            if lamp > most.0 {
                most = (lamp, index);
            }
            let frame = &mut self.frames[index];
            frame.small.iter_mut().chain(&mut frame.detail).for_each(|value| *value /= lamp as f32);
        }
        let change = most.0 / least.0 - 1.0;
        if change > DRIFT {
            let text = format!(
                "the lamp changed by {:.1} % while the projector stood, says the reference patch, from {} to {}: `develop` takes it out",
                100.0 * change,
                self.frames[least.1].pattern,
                self.frames[most.1].pattern
            );
            self.find(FindingKind::LampDrift, Severity::Warning, &[least.1, most.1], (change, DRIFT), text);
        }
        Some((least.0, most.0))
    }

    /// Adds frames up and looks for what explains the remainder. Comes back with the contradiction that was there at first, and the
    /// lamp's drift.
    fn sums(&mut self, known: &mut [bool]) -> (Option<f64>, Option<f64>) {
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
    fn times(&self, known: &[bool]) -> Vec<f64> {
        let lines = || self.frames.iter().zip(known).filter(|(_, known)| **known).map(|(frame, _)| frame.line);
        let (first, last) = (lines().fold(f64::INFINITY, f64::min), lines().fold(f64::NEG_INFINITY, f64::max));
        let span = (last - first).max(1.0);
        self.frames.iter().map(|frame| (frame.line - first) / span - 0.5).collect()
    }

    /// Finds one cause of the remainder and takes it out; false if there is none.
    fn explain(&mut self, sums: &mut Sums, known: &mut [bool], equations: &Equations, remainder: &Remainder) -> bool {
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

    fn swapped(&mut self, sums: &mut Sums, i: usize, j: usize, explained: f64) {
        let (a, b) = (self.frames[i].pattern, self.frames[j].pattern);
        let text = format!(
            "the photographs of {a} and {b} are exchanged: in each other's place they remove {:.0} % of what contradicts the others",
            100.0 * explained.min(1.0)
        );
        self.find(FindingKind::Swapped, Severity::Fault, &[i, j], (explained.min(1.0), 0.0), text);
        sums.frames.swap(i, j);
    }

    /// A frame that shows nothing where the others say that it does; and its share of that.
    fn blank(&self, sums: &Sums, known: &[bool], equations: &Equations, remainder: &Remainder) -> Option<(usize, f64)> {
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
    fn one_frame(&mut self, sums: &mut Sums, known: &mut [bool], equations: &Equations, remainder: &Remainder) -> bool {
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
    fn the_wrong_one(&self, sums: &Sums, equations: &Equations, remainder: &Remainder, alike: &[usize]) -> usize {
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
    fn black_or_white(&mut self, sums: &mut Sums, known: &mut [bool], equations: &Equations, alike: &[usize]) -> bool {
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

    /// A lamp that rises or falls evenly, which shows in all sums a little.
    fn slow_drift(&mut self, sums: &mut Sums, known: &[bool]) {
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
    fn restore(&self, sums: &mut Sums, known: &[bool]) {
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
    fn order(&mut self, sums: &mut Sums) {
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

    /// Whether the camera moved between the white frame and the families of patterns.
    fn movement(&mut self, white: Option<&Orientations>, families: &[Family]) {
        let families: Vec<(&str, Option<Orientations>)> = families
            .iter()
            .map(|(name, sum)| (*name, sum.as_ref().and_then(|sum| self.judge.orientations(sum))))
            .collect();
        let (name, reference) = match white {
            Some(white) => ("the white frame", Some(white)),
            None => (families[0].0, families[0].1.as_ref()),
        };
        let Some(reference) = reference else { return };
        let block = self.judge.detail.block as f64;
        for (family, orientations) in &families {
            let Some((dx, dy)) = orientations.as_ref().and_then(|found| found.shift_from(reference)) else { continue };
            let (dx, dy) = (dx * block, dy * block);
            if dx.hypot(dy) > MOVED * block {
                let text = format!(
                    "the {family} together are shifted by ({dx:.1}, {dy:.1}) pixels against {name}: the camera or the object moved \
                     between them"
                );
                let figures = (dx.hypot(dy), MOVED * block);
                self.find(FindingKind::CameraMoved, Severity::Fault, &[], figures, text);
            }
        }
    }

    /// The black frame's light over the white frame's.
    fn black_share(&self) -> Option<f64> {
        let (black, white) = (&self.frames[BLACK].small, &self.frames[WHITE].small);
        let both = black.iter().zip(white).filter(|(black, white)| black.is_finite() && white.is_finite());
        let (black, white) =
            both.fold((0.0, 0.0), |(b, w), (black, white)| (b + f64::from(*black), w + f64::from(*white)));
        (white > 0.0).then(|| black / white)
    }
}

/// The frames that are added up, while defects are taken out of them.
struct Sums {
    /// Small, 0 where any is clipped; empty where not known.
    frames: Vec<Vec<f32>>,
    /// Pixels that are not clipped.
    bins: usize,
    width: usize,
    times: Vec<f64>,
    /// What has been taken out.
    drift: f64,
}

impl Sums {
    fn take_drift_out(&mut self, slope: f64) {
        self.drift += slope;
        for (frame, time) in self.frames.iter_mut().zip(&self.times) {
            let scale = (1.0 / (1.0 + slope * time)) as f32;
            frame.iter_mut().for_each(|value| *value *= scale);
        }
    }

    fn above_black(&self) -> Vec<Vec<f32>> {
        let black = &self.frames[BLACK];
        let above = |frame: &Vec<f32>| frame.iter().zip(black).map(|(value, black)| value - black).collect();
        self.frames.iter().map(above).collect()
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

fn mean_of(values: &[f32]) -> f64 {
    values.iter().map(|value| f64::from(*value)).sum::<f64>() / values.len().max(1) as f64
}
