//! What of an unfinished field is done: one line a position, appended and synced when its shards are on disk.

use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::FieldError;

/// What is known of a position besides its shards.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PositionRecord {
    /// Index of the position.
    pub position: usize,
    /// What a stored half is multiplied with: a power of two.
    pub scale: f32,
    /// Cells [v · M + u] that were not photographed; the field says nothing about them.
    pub missing: Vec<usize>,
    /// How the position was made: black level, residuals, noise, losses.
    pub report: serde_json::Value,
}

/// The journal file: each line is a BLAKE3 digest and a record as JSON.
pub(crate) struct Journal {
    path: PathBuf,
    file: File,
}

impl Journal {
    /// Opens or starts the journal and gives the whole records in it; a torn or damaged end is cut off.
    pub(crate) fn open(path: &Path) -> Result<(Self, Vec<PositionRecord>), FieldError> {
        let write = |source| FieldError::Write { path: path.to_path_buf(), source };
        let mut records = Vec::new();
        let mut whole = 0;
        if path.exists() {
            let file = File::open(path).map_err(|source| FieldError::Read { path: path.to_path_buf(), source })?;
            let mut reader = BufReader::new(file);
            let mut line = Vec::new();
            loop {
                line.clear();
                let length = reader
                    .read_until(b'\n', &mut line)
                    .map_err(|source| FieldError::Read { path: path.to_path_buf(), source })?;
                let Some(record) = parse(&line) else { break };
                records.push(record);
                whole += length as u64;
            }
        }
        let file = OpenOptions::new().create(true).append(true).open(path).map_err(write)?;
        file.set_len(whole).map_err(write)?;
        Ok((Self { path: path.to_path_buf(), file }, records))
    }

    /// Appends a record and waits until it is on disk.
    pub(crate) fn append(&mut self, record: &PositionRecord) -> Result<(), FieldError> {
        let write = |source| FieldError::Write { path: self.path.clone(), source };
        let json = serde_json::to_string(record).map_err(|error| write(error.into()))?;
        let line = format!("{} {json}\n", blake3::hash(json.as_bytes()).to_hex());
        self.file.write_all(line.as_bytes()).map_err(write)?;
        self.file.sync_data().map_err(write)
    }
}

fn parse(line: &[u8]) -> Option<PositionRecord> {
    let text = std::str::from_utf8(line).ok()?.strip_suffix('\n')?;
    let (digest, json) = text.split_once(' ')?;
    (blake3::hash(json.as_bytes()).to_hex().as_str() == digest).then(|| serde_json::from_str(json).ok())?
}
