//! `checksums.b3`: the BLAKE3 digest of every file of a field, in the format of the `b3sum` program.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use relumine_radiometry::files::write_atomically;
use relumine_radiometry::read_bounded;

use crate::FieldError;
use crate::journal::Digest;

pub(crate) const NAME: &str = "checksums.b3";

/// What is wrong with a file of a field.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Damage {
    /// It is listed, but not there.
    Missing(PathBuf),
    /// Its bytes are not the ones that were written.
    Changed(PathBuf),
    /// It is there, but not listed.
    Unlisted(PathBuf),
    /// It cannot be read.
    Unreadable(PathBuf, String),
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing(path) => write!(f, "{}: missing", path.display()),
            Self::Changed(path) => write!(f, "{}: changed since it was written", path.display()),
            Self::Unlisted(path) => write!(f, "{}: not part of the field", path.display()),
            Self::Unreadable(path, reason) => write!(f, "{}: {reason}", path.display()),
        }
    }
}

/// Lists every file below `field` with its digest. The digests of those that are `known`, by name, were taken when they were
/// written: they are not read again.
pub(crate) fn write(field: &Path, known: &BTreeMap<String, Digest>) -> Result<(), FieldError> {
    let names = files_below(field)?;
    if let Some(missing) = known.keys().find(|name| names.binary_search(name).is_err()) {
        let reason = "it was written, but is not there any more: start again with --force".into();
        return Err(FieldError::Damaged { path: field.join(missing), reason });
    }
    let digests: Vec<(String, blake3::Hash)> = names
        .into_par_iter()
        .map(|name| {
            if let Some(Digest(digest)) = known.get(&name) {
                return Ok((name, *digest));
            }
            let path = field.join(&name);
            let digest = digest(&path).map_err(|source| FieldError::Read { path, source })?;
            Ok((name, digest))
        })
        .collect::<Result<_, FieldError>>()?;
    let text: String = digests.iter().map(|(name, digest)| format!("{}  {name}\n", digest.to_hex())).collect();
    write_atomically(&field.join(NAME), |file| io::Write::write_all(file, text.as_bytes()))?;
    Ok(())
}

/// The list of a field.
pub(crate) struct Listed {
    digests: BTreeMap<String, blake3::Hash>,
}

/// Metadata are never longer: 65,536 positions with a report each.
pub(crate) const MAX_BYTES: u64 = 64 << 20;

/// Reads the list of the field at `field`.
pub(crate) fn read(field: &Path) -> Result<Listed, FieldError> {
    let path = field.join(NAME);
    let text = read_bounded(&path, MAX_BYTES).map_err(|source| match source.kind() {
        io::ErrorKind::NotFound => {
            FieldError::NotAField { path: path.clone(), reason: "this list of its files is missing".into() }
        }
        _ => FieldError::Read { path: path.clone(), source },
    })?;
    let mut digests = BTreeMap::new();
    for (index, line) in text.lines().enumerate() {
        let entry = line
            .split_once("  ")
            .and_then(|(digest, name)| Some((blake3::Hash::from_hex(digest).ok()?, name)))
            .filter(|(_, name)| is_inside(name));
        match entry {
            Some((digest, name)) => digests.insert(name.to_string(), digest),
            None => {
                let reason = format!("line {}: expected a digest and a file name", index + 1);
                return Err(FieldError::Damaged { path, reason });
            }
        };
    }
    Ok(Listed { digests })
}

impl Listed {
    /// Whether the text of a file of the field is what was written.
    pub(crate) fn check(&self, field: &Path, name: &str, text: &str) -> Result<(), FieldError> {
        if self.digests.get(name) == Some(&blake3::hash(text.as_bytes())) {
            return Ok(());
        }
        let reason = format!("changed since it was written: its digest is not the one in {NAME}");
        Err(FieldError::Damaged { path: field.join(name), reason })
    }
}

/// Holds every file below `field` against the list.
pub(crate) fn verify(field: &Path) -> Result<Vec<Damage>, FieldError> {
    let listed: Vec<(String, blake3::Hash)> = read(field)?.digests.into_iter().collect();
    let mut damage: Vec<Damage> = listed
        .par_iter()
        .filter_map(|(name, listed)| match digest(&field.join(name)) {
            Ok(found) if found == *listed => None,
            Ok(_) => Some(Damage::Changed(name.into())),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Some(Damage::Missing(name.into())),
            Err(error) => Some(Damage::Unreadable(name.into(), error.to_string())),
        })
        .collect();
    let names: BTreeSet<&str> = listed.iter().map(|(name, _)| name.as_str()).collect();
    damage.extend(
        files_below(field)?
            .iter()
            .filter(|name| !names.contains(name.as_str()))
            .map(|name| Damage::Unlisted(name.into())),
    );
    Ok(damage)
}

fn is_inside(name: &str) -> bool {
    Path::new(name).components().all(|part| matches!(part, std::path::Component::Normal(_)))
}

/// File names below `field`, with '/' between folders, sorted; the list itself is not listed.
fn files_below(field: &Path) -> Result<Vec<String>, FieldError> {
    let mut names = Vec::new();
    let mut folders = vec![String::new()];
    while let Some(folder) = folders.pop() {
        let path = field.join(&folder);
        let read = |source| FieldError::Read { path: path.clone(), source };
        for entry in fs::read_dir(&path).map_err(read)? {
            let entry = entry.map_err(read)?;
            let name = entry.file_name();
            let name = name.to_str().ok_or_else(|| read(io::Error::other(format!("{name:?} is not UTF-8"))))?;
            let name = if folder.is_empty() { name.to_string() } else { format!("{folder}/{name}") };
            if entry.file_type().map_err(read)?.is_dir() {
                folders.push(name);
            } else if name != NAME {
                names.push(name);
            }
        }
    }
    names.sort();
    Ok(names)
}

fn digest(path: &Path) -> io::Result<blake3::Hash> {
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(File::open(path)?)?;
    Ok(hasher.finalize())
}
