//! What can be wrong with a capture.

use std::path::PathBuf;

use relumine_basis::BasisError;
use relumine_radiometry::colour::ColourError;
use relumine_radiometry::files::FileError;
use relumine_radiometry::{DescriptionError, ResponseError};

/// Why a capture cannot be read or developed: where, what was expected, what came.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CaptureError {
    /// A file or directory cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// `capture.toml` is not a description, or has unknown keys.
    #[error(transparent)]
    Description(#[from] DescriptionError),
    /// A value of `capture.toml` that cannot be.
    #[error("{}: {reason}", path.display())]
    Setup {
        /// The description.
        path: PathBuf,
        /// Which key, what was expected, what came.
        reason: String,
    },
    /// The geometry cannot be.
    #[error("{}: {source}", path.display())]
    Geometry {
        /// The description.
        path: PathBuf,
        /// Which value.
        source: BasisError,
    },
    /// The response file.
    #[error(transparent)]
    Response(#[from] ResponseError),
    /// The colour correction.
    #[error(transparent)]
    Colour(#[from] ColourError),
    /// A row of `photographs.csv` that cannot be.
    #[error("{}:{line}: {reason}", path.display())]
    Row {
        /// The table.
        path: PathBuf,
        /// Line, from 1.
        line: u64,
        /// What was expected and what came.
        reason: String,
    },
    /// A picture that cannot be read.
    #[error(transparent)]
    Picture(#[from] FileError),
    /// A picture that is whole but not the one that `capture.toml` promises.
    #[error("{}: {reason}", path.display())]
    Photograph {
        /// The picture.
        path: PathBuf,
        /// What was expected and what came.
        reason: String,
    },
}
