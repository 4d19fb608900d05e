//! Whether the photographs of a capture are all there and unchanged.

use std::fs;

use rayon::prelude::*;
use relumine_capture::{Capture, PhotographRow, ShownPattern};
use sha2::{Digest, Sha256};

/// What is wrong with the photographs of a capture. Pictures are not decoded: `develop` does that.
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
    /// Reads every photograph of `capture` and holds it against its checksum.
    pub fn of(capture: &Capture) -> Self {
        let rows: Vec<&PhotographRow> = capture.photographs().rows.values().flatten().collect();
        let checked: Vec<Option<String>> = rows.par_iter().map(|row| wrong_with(capture, row)).collect();
        let positions = capture.setup().cells().positions();
        Self {
            missing: (0..positions)
                .flat_map(|position| capture.missing(position).into_iter().map(move |pattern| (position, pattern)))
                .collect(),
            verified: rows.iter().zip(&checked).filter(|(row, wrong)| row.sha256.is_some() && wrong.is_none()).count(),
            unlisted: rows.iter().filter(|row| row.sha256.is_none()).count(),
            damaged: checked.into_iter().flatten().collect(),
        }
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
