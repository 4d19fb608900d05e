//! What can go wrong with a picture file, said as where, what was expected, what came.

use std::io;
use std::path::{Path, PathBuf};

use super::{Format, MAX_PIXELS};

/// Why a picture file could not be read or written. Every variant names the file.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// The operating system did not give the bytes; the file itself may be sound.
    #[error("{}: could not be read: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
    /// The file could not be written (disk full, no such folder, …); nothing is left of the attempt.
    #[error("{}: could not be written: {source}", path.display())]
    Write {
        /// The file that was to be.
        path: PathBuf,
        /// What the operating system or the encoder said.
        source: io::Error,
    },
    /// The content begins like no format known here.
    #[error(
        "{}: expected an OpenEXR, Radiance HDR, PNG, TIFF, JPEG or camera RAW picture, found {start}",
        path.display()
    )]
    Unrecognised {
        /// The file.
        path: PathBuf,
        /// How the content begins, in words.
        start: String,
    },
    /// The format is known, but the content contradicts itself or ends too early.
    #[error("{}: not a whole {format} picture: {reason}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The format its first bytes announce.
        format: &'static str,
        /// What is wrong.
        reason: String,
    },
    /// The file may be sound, but uses a part of its format that is not read here.
    #[error("{}: this kind of {format} picture is not read here: {reason}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// The format its first bytes announce.
        format: &'static str,
        /// The part that is missing here.
        reason: String,
    },
    /// The header announces more pixels than [`MAX_PIXELS`]; nothing was allocated.
    #[error(
        "{}: a picture of at most {MAX_PIXELS} pixels was expected, the header announces {width} × {height}",
        path.display()
    )]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Announced pixels in a row.
        width: u64,
        /// Announced rows.
        height: u64,
    },
    /// A floating-point picture holds NaN or infinity.
    #[error(
        "{}: every sample must be finite, but {count} are NaN or infinite, the first in channel {channel} of pixel \
         ({x}, {y})",
        path.display()
    )]
    NotFinite {
        /// The file.
        path: PathBuf,
        /// Column of the first bad sample.
        x: usize,
        /// Row of the first bad sample.
        y: usize,
        /// Its channel: `R`, `G` or `B`.
        channel: char,
        /// How many samples of the picture are bad.
        count: usize,
    },
    /// A photograph does not say how long it was exposed.
    #[error("{}: a photograph with its exposure time in EXIF was expected, but {reason}", path.display())]
    NoExposure {
        /// The file.
        path: PathBuf,
        /// What is missing.
        reason: String,
    },
    /// Scene-linear samples were asked for, and the file holds integers with an unknown curve.
    #[error(
        "{}: linear floating-point samples were expected (OpenEXR, Radiance HDR or float TIFF), found a {found}",
        path.display()
    )]
    NotLinear {
        /// The file.
        path: PathBuf,
        /// What the file holds.
        found: String,
    },
    /// A sample does not fit the sample type of the file to be written.
    #[error(
        "{}: {value} in channel {channel} of pixel ({x}, {y}) does not fit {format}, which ends at {limit}",
        path.display()
    )]
    OutOfRange {
        /// The file that was to be.
        path: PathBuf,
        /// Column of the first such sample.
        x: usize,
        /// Row of the first such sample.
        y: usize,
        /// Its channel: `R`, `G` or `B`.
        channel: char,
        /// The sample.
        value: f32,
        /// The sample type, in words.
        format: &'static str,
        /// The largest value the sample type holds.
        limit: f32,
    },
}

impl FileError {
    /// The file the error is about.
    pub fn path(&self) -> &Path {
        match self {
            Self::Read { path, .. }
            | Self::Write { path, .. }
            | Self::Unrecognised { path, .. }
            | Self::Damaged { path, .. }
            | Self::Unsupported { path, .. }
            | Self::TooLarge { path, .. }
            | Self::NotFinite { path, .. }
            | Self::NoExposure { path, .. }
            | Self::NotLinear { path, .. }
            | Self::OutOfRange { path, .. } => path,
        }
    }
}

/// What a decoder finds wrong; it knows neither the path nor the name of its format.
#[derive(Debug, PartialEq)]
pub(super) enum Fault {
    Damaged(String),
    Unsupported(String),
    TooLarge { width: u64, height: u64 },
}

impl Fault {
    pub(super) fn damaged(reason: impl Into<String>) -> Self {
        Self::Damaged(reason.into())
    }

    pub(super) fn unsupported(reason: impl Into<String>) -> Self {
        Self::Unsupported(reason.into())
    }

    /// The same reason everywhere, for a file that was cut off.
    pub(super) fn early_end() -> Self {
        Self::damaged("unexpected end of file")
    }

    pub(super) fn at(self, path: &Path, format: Format) -> FileError {
        let (path, format) = (path.to_path_buf(), format.name());
        match self {
            Self::Damaged(reason) => FileError::Damaged { path, format, reason },
            Self::Unsupported(reason) => FileError::Unsupported { path, format, reason },
            Self::TooLarge { width, height } => FileError::TooLarge { path, width, height },
        }
    }
}

/// The door every announced size passes before a pixel is allocated.
pub(super) fn check_size(width: u64, height: u64) -> Result<(), Fault> {
    match width.checked_mul(height) {
        Some(0) => Err(Fault::damaged(format!("the header announces {width} × {height} pixels"))),
        Some(pixels) if pixels <= MAX_PIXELS as u64 => Ok(()),
        _ => Err(Fault::TooLarge { width, height }),
    }
}
