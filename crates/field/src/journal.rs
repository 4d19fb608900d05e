//! What of an unfinished field is done: one line a position, appended and synced when its shards are on disk.

use std::collections::BTreeMap;
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

/// A position that is done.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Entry {
    pub(crate) record: PositionRecord,
    /// By name below the field: the BLAKE3 digests of its shards.
    pub(crate) shards: BTreeMap<String, Digest>,
}

/// A BLAKE3 digest, in JSON as hexadecimal digits.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub(crate) struct Digest(pub(crate) blake3::Hash);

impl TryFrom<String> for Digest {
    type Error = blake3::HexError;

    fn try_from(digits: String) -> Result<Self, Self::Error> {
        blake3::Hash::from_hex(digits).map(Self)
    }
}

impl From<Digest> for String {
    fn from(digest: Digest) -> Self {
        digest.0.to_hex().to_string()
    }
}

/// The journal file: each line is a BLAKE3 digest and an entry as JSON.
pub(crate) struct Journal {
    path: PathBuf,
    file: File,
}

impl Journal {
    /// Opens or starts the journal and gives the whole entries in it; a torn or damaged end is cut off.
    pub(crate) fn open(path: &Path) -> Result<(Self, Vec<Entry>), FieldError> {
        let write = |source| FieldError::Write { path: path.to_path_buf(), source };
        let mut entries = Vec::new();
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
                let Some(entry) = parse(&line) else { break };
                entries.push(entry);
                whole += length as u64;
            }
        }
        let file = OpenOptions::new().create(true).append(true).open(path).map_err(write)?;
        file.set_len(whole).map_err(write)?;
        Ok((Self { path: path.to_path_buf(), file }, entries))
    }

    /// Appends an entry and waits until it is on disk.
    pub(crate) fn append(&mut self, entry: &Entry) -> Result<(), FieldError> {
        let write = |source| FieldError::Write { path: self.path.clone(), source };
        let json = serde_json::to_string(entry).map_err(|error| write(error.into()))?;
        let line = format!("{} {json}\n", blake3::hash(json.as_bytes()).to_hex());
        self.file.write_all(line.as_bytes()).map_err(write)?;
        self.file.sync_data().map_err(write)
    }
}

fn parse(line: &[u8]) -> Option<Entry> {
    let text = std::str::from_utf8(line).ok()?.strip_suffix('\n')?;
    let (digest, json) = text.split_once(' ')?;
    (blake3::hash(json.as_bytes()).to_hex().as_str() == digest).then(|| serde_json::from_str(json).ok())?
}
