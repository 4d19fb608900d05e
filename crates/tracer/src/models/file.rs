//! The model file that is being read: for messages, and for the files that it may name.

use std::fmt::Display;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};

use super::{MAX_BYTES, MAX_TRIANGLES, ModelError};

/// Long names are cut, lest thousands of parts carry one of a megabyte.
const NAME_LETTERS: usize = 80;

/// A model, or a material library beside it.
pub(super) struct ModelFile<'a> {
    path: &'a Path,
}

impl<'a> ModelFile<'a> {
    pub(super) fn new(path: &'a Path) -> Self {
        Self { path }
    }

    pub(super) fn path(&self) -> &'a Path {
        self.path
    }

    pub(super) fn malformed(&self, place: impl Display, reason: impl Display) -> ModelError {
        ModelError::Malformed { path: self.path.to_path_buf(), place: place.to_string(), reason: reason.to_string() }
    }

    pub(super) fn unsupported(&self, place: impl Display, what: impl Display) -> ModelError {
        ModelError::Unsupported { path: self.path.to_path_buf(), place: place.to_string(), what: what.to_string() }
    }

    /// Where the file lies that is named `reference`. One file has one path, however it was spelled.
    pub(super) fn beside(&self, place: impl Display, reference: &str) -> Result<PathBuf, ModelError> {
        let outside = || ModelError::Outside {
            path: self.path.to_path_buf(),
            place: place.to_string(),
            reference: short(reference),
        };
        let mut path = self.path.parent().unwrap_or(Path::new("")).to_path_buf();
        let mut named = false;
        for component in Path::new(reference).components() {
            match component {
                Component::Normal(name) => {
                    path.push(name);
                    named = true;
                }
                Component::CurDir => {}
                Component::Prefix(_) | Component::RootDir | Component::ParentDir => return Err(outside()),
            }
        }
        // Windows reads these as a drive and a folder; elsewhere nobody names files so.
        if !named || reference.contains(['\\', '\0']) || reference.contains("://") {
            return Err(outside());
        }
        Ok(path)
    }

    /// Adds to the triangles counted so far, while there are not too many.
    pub(super) fn count_triangles(&self, place: impl Display, sum: &mut usize, more: usize) -> Result<(), ModelError> {
        *sum = sum.saturating_add(more);
        if *sum > MAX_TRIANGLES {
            return Err(
                self.malformed(place, format!("at most {MAX_TRIANGLES} triangles were expected, here are more"))
            );
        }
        Ok(())
    }
}

/// Reads a file that a model names.
pub(super) fn read_named(path: &Path) -> Result<Vec<u8>, ModelError> {
    read_regular(path, MAX_BYTES).map_err(|source| ModelError::Read { path: path.to_path_buf(), source })
}

/// Reads a regular file of at most `most` bytes. What a device or a pipe says of its length is not believed.
pub(super) fn read_regular(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    // Looked at before it is opened: opening a pipe would wait for its writer.
    if !fs::metadata(path)?.is_file() {
        return Err(io::Error::other("not a regular file"));
    }
    let mut bytes = Vec::new();
    File::open(path)?.take(most + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most {
        return Err(io::Error::other(format!("longer than the {most} bytes that such a file may have")));
    }
    Ok(bytes)
}

/// A name as parts and messages carry it.
pub(super) fn short(name: &str) -> String {
    name.chars().take(NAME_LETTERS).collect()
}
