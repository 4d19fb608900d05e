//! What can go wrong with a model file, said as where, what was expected, what came.

use std::io;
use std::path::PathBuf;

use relumine_radiometry::files::FileError;

/// Why a model cannot be read. Every variant names a file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// A file cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file: the model, or one that it names.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The name does not end as those of model files do.
    #[error("{}: a name that ends in .gltf, .glb or .obj was expected", path.display())]
    UnknownFormat {
        /// The file.
        path: PathBuf,
    },
    /// The file contradicts its format or itself.
    #[error("{}: {place}: {reason}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Where: `line 12`, `accessors[3]`.
        place: String,
        /// What was expected and what came.
        reason: String,
    },
    /// The file may be sound, but uses a part of its format that is not read here.
    #[error("{}: {place}: not supported: {what}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// Where.
        place: String,
        /// The part that is missing here.
        what: String,
    },
    /// The file names another outside its folder.
    #[error(
        "{}: {place}: a file in the model's folder was expected, given by a relative path without `..`, but it is {reference:?}",
        path.display()
    )]
    Outside {
        /// The file.
        path: PathBuf,
        /// Where.
        place: String,
        /// What it names.
        reference: String,
    },
    /// A picture cannot be decoded.
    #[error("{}: {place}: {source}", path.display())]
    Picture {
        /// The file that names or holds the picture.
        path: PathBuf,
        /// Where.
        place: String,
        /// What is wrong with it.
        source: FileError,
    },
}
