//! Whether the photographs of a capture are all there and unchanged, and what they show.

use std::fs;

use rayon::prelude::*;
use relumine_capture::separation::Method;
use relumine_capture::{Capture, Developer, Finding, Judge, PhotographRow, PositionJudgement, ShownPattern};
use sha2::{Digest, Sha256};

use crate::Error;

/// Whether the photographs of a capture are there, unchanged and readable.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CaptureCheck {
    /// Photographs that the scheme needs and the table does not list.
    pub missing: Vec<(usize, ShownPattern)>,
    /// Listed photographs that are not there, cannot be read, or have changed.
    pub damaged: Vec<String>,
    /// Photographs whose checksum was verified.
    pub verified: usize,
    /// Photographs without a checksum.
    pub unlisted: usize,
}

impl CaptureCheck {
    /// Reads every photograph of `capture` and holds it against its checksum; pictures are not decoded.
    pub fn of(capture: &Capture) -> Self {
        let rows: Vec<&PhotographRow> = capture.photographs().rows.values().flatten().collect();
        let checked: Vec<Option<String>> = rows.par_iter().map(|row| wrong_with(capture, row)).collect();
        Self {
            missing: missing(capture),
            verified: rows.iter().zip(&checked).filter(|(row, wrong)| row.sha256.is_some() && wrong.is_none()).count(),
            unlisted: rows.iter().filter(|row| row.sha256.is_none()).count(),
            damaged: checked.into_iter().flatten().collect(),
        }
    }
}

fn missing(capture: &Capture) -> Vec<(usize, ShownPattern)> {
    let at = |position: usize| capture.missing(position).into_iter().map(move |pattern| (position, pattern));
    (0..capture.setup().cells().positions()).flat_map(at).collect()
}

/// A capture judged photograph by photograph.
#[derive(Clone, Debug)]
pub struct CaptureJudgement {
    /// Whether its photographs are there, unchanged and readable.
    pub check: CaptureCheck,
    /// Each position, in their order.
    pub positions: Vec<PositionJudgement>,
    /// All that was found, by position.
    pub findings: Vec<Finding>,
}

impl CaptureJudgement {
    /// Reads and judges every photograph of `capture`, position by position; `done` hears of each.
    ///
    /// # Errors
    /// If the camera's response is not known, so that photographs cannot be added up.
    pub fn of(capture: Capture, mut done: impl FnMut()) -> Result<Self, Error> {
        let developer = Developer::new(capture, Method::default(), None)?;
        let (capture, judge) = (developer.capture(), Judge::new(&developer));
        let mut positions = Vec::new();
        for position in 0..capture.setup().cells().positions() {
            positions.push(judge.position(position));
            done();
        }
        let own = positions.iter().flat_map(|judgement| judgement.findings.clone());
        let mut findings: Vec<Finding> = own.chain(judge.across(&positions)).collect();
        findings.sort_by_key(|finding| finding.position);
        let check = CaptureCheck {
            missing: missing(capture),
            damaged: positions.iter().flat_map(|judgement| &judgement.damaged).map(ToString::to_string).collect(),
            verified: positions.iter().map(|judgement| judgement.verified).sum(),
            unlisted: positions.iter().map(|judgement| judgement.unlisted).sum(),
        };
        Ok(Self { check, positions, findings })
    }
}

fn wrong_with(capture: &Capture, row: &PhotographRow) -> Option<String> {
    let path = capture.directory().join(&row.file);
    let bytes = match fs::read(&path) {
        Ok(bytes) => bytes,
        Err(error) => return Some(format!("cannot read {}: {error}", path.display())),
    };
    let changed = row.sha256.is_some_and(|listed| Sha256::digest(&bytes)[..] != listed);
    changed.then(|| format!("{}: changed: its SHA-256 is not the listed one", path.display()))
}
