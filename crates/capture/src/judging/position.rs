//! One position: its photographs read, held against each other, and what is wrong with them.

mod adding_up;
mod causes;
mod exposures;

use std::path::PathBuf;

use rayon::prelude::*;

use super::reading::{self, Frame};
use super::registration::Orientations;
use super::sums::{BLACK, WHITE};
use super::{Finding, FindingKind, Judge, PatternExposure, PositionJudgement, Severity};
use crate::{ReferencePatch, Scheme, ShownPattern};

/// A frame that shows less than this of what the others say of it is blank.
const BLANK: f64 = 0.1;
/// A lamp that changes by more while the projector stands is worth a word.
const DRIFT: f64 = 0.01;
/// Pixels that the camera moved within a position, where the light is the same.
const MOVED: f64 = 0.5;

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

fn mean_of(values: &[f32]) -> f64 {
    values.iter().map(|value| f64::from(*value)).sum::<f64>() / values.len().max(1) as f64
}
