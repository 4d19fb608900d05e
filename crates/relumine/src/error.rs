//! Everything that can go wrong behind the front door, and what to do then.

use std::path::PathBuf;

use relumine_capture::CaptureError;
use relumine_field::FieldError;
use relumine_incident::IncidentError;
use relumine_lamp::LightError;
use relumine_radiometry::DescriptionError;
use relumine_radiometry::files::FileError;
use relumine_relight::RelightError;

/// Why a job failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The capture.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// The field.
    #[error(transparent)]
    Field(#[from] FieldError),
    /// The light description.
    #[error(transparent)]
    Light(#[from] LightError),
    /// The light on these cells.
    #[error(transparent)]
    Incident(#[from] IncidentError),
    /// The relighting.
    #[error(transparent)]
    Relight(#[from] RelightError),
    /// A picture file.
    #[error(transparent)]
    File(#[from] FileError),
    /// Nothing of an input could be used.
    #[error("{}: nothing in it can be used; the first loss: {first}", path.display())]
    NothingUsable {
        /// The input.
        path: PathBuf,
        /// Why the first part of it could not be used.
        first: String,
    },
    /// A list of lamps that cannot be.
    #[error("{}: {reason}", path.display())]
    LampList {
        /// The list or folder.
        path: PathBuf,
        /// Where, what was expected, what came.
        reason: String,
    },
    /// A picture that is neither a mosaic for these cells nor a lat-long map.
    #[error(
        "{}: {width} × {height} pixels are neither a mosaic for these cells ({mosaic_width} × {mosaic_height}) nor a \
         lat-long map (twice as wide as high)",
        path.display()
    )]
    NeitherMosaicNorMap {
        /// The picture.
        path: PathBuf,
        /// Its width.
        width: usize,
        /// Its height.
        height: usize,
        /// The width of a mosaic for these cells.
        mosaic_width: usize,
        /// The height of a mosaic for these cells.
        mosaic_height: usize,
    },
}

impl Error {
    /// What a person can do about it, if there is anything to say beyond the error itself.
    pub fn hint(&self) -> Option<&'static str> {
        match self {
            Self::Capture(CaptureError::Read { .. }) => {
                Some("a capture is a directory with capture.toml and photographs.csv; FORMAT.md describes both")
            }
            Self::Capture(CaptureError::Row { .. }) => Some("correct the line, or remove it if the photograph is gone"),
            Self::Capture(CaptureError::Photograph { .. }) => {
                Some("correct [camera] in capture.toml, or remove the photograph's row from photographs.csv")
            }
            Self::Field(FieldError::Exists { .. }) => Some("choose another name, or add --force to replace it"),
            Self::Capture(CaptureError::Description(DescriptionError::Read { .. })) => {
                Some("a capture is a directory with capture.toml and photographs.csv; FORMAT.md describes both")
            }
            Self::Field(FieldError::Damaged { .. } | FieldError::Read { .. })
            | Self::Relight(RelightError::Field(FieldError::Damaged { .. } | FieldError::Read { .. })) => {
                Some("`relumine inspect` lists all that is damaged; develop the capture again")
            }
            Self::Field(FieldError::NotAField { .. }) => {
                Some("fields are made by `relumine develop` and `relumine import`")
            }
            Self::Field(FieldError::Write { .. } | FieldError::File(FileError::Write { .. }))
            | Self::File(FileError::Write { .. }) => {
                Some("free some space or choose another disk; run the same command again to go on")
            }
            Self::Field(FieldError::Busy { .. }) => Some("wait for it to end, or choose another name"),
            Self::LampList { .. } => Some("correct the list"),
            Self::NothingUsable { .. } => Some("check that the photographs lie where the list says"),
            Self::NeitherMosaicNorMap { .. } | Self::Incident(IncidentError::Mosaic { .. }) => {
                Some("a mosaic belongs to the cells it was written for; write one with `relumine light … --for FIELD`")
            }
            _ => None,
        }
    }

    /// Whether the input is damaged or incomplete, rather than the job having failed.
    pub fn is_damaged_input(&self) -> bool {
        match self {
            Self::Capture(_) => true,
            Self::Field(error) | Self::Relight(RelightError::Field(error)) => matches!(
                error,
                FieldError::Damaged { .. }
                    | FieldError::Read { .. }
                    | FieldError::NotAField { .. }
                    | FieldError::Geometry { .. }
            ),
            Self::File(error) => !matches!(error, FileError::Write { .. }),
            Self::Light(_) | Self::NothingUsable { .. } | Self::LampList { .. } => true,
            Self::Incident(_) | Self::Relight(_) | Self::NeitherMosaicNorMap { .. } => false,
        }
    }
}
