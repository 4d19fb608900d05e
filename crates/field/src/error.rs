//! What can go wrong with a field on disk.

use std::path::PathBuf;

use relumine_basis::BasisError;
use relumine_radiometry::files::FileError;

/// Why a field cannot be read or written: where, what was expected, what came.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FieldError {
    /// A file cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A file cannot be written.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A picture file beside the field cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The directory is no field of this version.
    #[error("{}: not a reflectance field: {reason}", path.display())]
    NotAField {
        /// The directory or file.
        path: PathBuf,
        /// What was expected and what came.
        reason: String,
    },
    /// A file of the field is damaged.
    #[error("{}: damaged: {reason}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The geometry in the metadata cannot be.
    #[error("{}: {source}", path.display())]
    Geometry {
        /// The metadata.
        path: PathBuf,
        /// Which value.
        source: BasisError,
    },
    /// There is something at the output already.
    #[error("{} exists already", path.display())]
    Exists {
        /// The output.
        path: PathBuf,
    },
    /// Another process writes the field.
    #[error("{}: another process is writing this field", path.display())]
    Busy {
        /// The unfinished field.
        path: PathBuf,
    },
    /// An unfinished field that was made from something else.
    #[error(
        "{} is an unfinished field made from another input or with other options; remove it, or add --force, to start afresh",
        path.display()
    )]
    OtherUnfinished {
        /// The unfinished field.
        path: PathBuf,
    },
}
