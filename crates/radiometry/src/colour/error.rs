//! What can be wrong with charts, their references, photographs of them, and what was fitted.

use std::path::{Path, PathBuf};

use crate::DescriptionError;

/// Why colours cannot be calibrated: where, what was expected, what came.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ColourError {
    /// A file that cannot be read, or is no TOML of the expected kind.
    #[error(transparent)]
    Description(#[from] DescriptionError),
    /// A line of a table or chart that cannot be.
    #[error("{}:{line}: {reason}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// What was expected and what came.
        reason: String,
    },
    /// A file whose lines can be, but not together.
    #[error("{}: {reason}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What was expected and what came.
        reason: String,
    },
    /// The chart is not where the photograph was searched for it.
    #[error("{0}")]
    NotFound(String),
    /// The patches do not allow what was asked for.
    #[error("{0}")]
    Patches(String),
}

impl ColourError {
    pub(super) fn line(path: &Path, line: usize, reason: impl Into<String>) -> Self {
        Self::Line { path: path.to_path_buf(), line, reason: reason.into() }
    }

    pub(super) fn content(path: &Path, reason: impl Into<String>) -> Self {
        Self::Content { path: path.to_path_buf(), reason: reason.into() }
    }
}
