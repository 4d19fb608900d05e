//! What can go wrong with a rig and the capture it fills.

use std::path::PathBuf;

use relumine_capture::{CaptureError, ShownPattern};
use relumine_radiometry::DescriptionError;
use relumine_radiometry::files::FileError;
use relumine_tracer::SceneError;

/// Why a rig cannot be read, laid out or run: where, what was expected, what came.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RigError {
    /// `rig.toml` is not a description, or has unknown keys.
    #[error(transparent)]
    Description(#[from] DescriptionError),
    /// The part of the rig that is a capture's too, or the capture itself.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// A picture file.
    #[error(transparent)]
    File(#[from] FileError),
    /// The virtual scene.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A value of `rig.toml` that cannot be.
    #[error("{}: {reason}", path.display())]
    Rig {
        /// The description.
        path: PathBuf,
        /// Which key, what was expected, what came.
        reason: String,
    },
    /// A file or directory cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A file or directory cannot be written.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// There is something where the capture should be laid out.
    #[error("{} exists already", path.display())]
    Exists {
        /// The directory that was to be.
        path: PathBuf,
    },
    /// What is there is not replaced.
    #[error("{} is not replaced: {reason}", path.display())]
    Precious {
        /// The directory.
        path: PathBuf,
        /// What is in it.
        reason: String,
    },
    /// Another process fills the capture.
    #[error("{}: another process is photographing into this capture", path.display())]
    Busy {
        /// The capture.
        path: PathBuf,
    },
    /// The capture's two descriptions, or its photographs, are not of one rig.
    #[error("{}: {reason}", path.display())]
    Contradiction {
        /// The file that says otherwise.
        path: PathBuf,
        /// What it says and what the other says.
        reason: String,
    },
    /// The camera gave a picture that is not the one promised.
    #[error("position {position}, {pattern}: the camera's picture cannot be used: {reason}")]
    Photograph {
        /// Where the projector stood.
        position: usize,
        /// What it showed.
        pattern: ShownPattern,
        /// What was promised and what came.
        reason: String,
    },
    /// A stage, projector or camera does not do what it should.
    #[error("{device}: {reason}")]
    Device {
        /// Which.
        device: &'static str,
        /// What was expected and what came.
        reason: String,
    },
    /// The person at the rig stopped it.
    #[error("stopped at the rig")]
    Stopped,
}
