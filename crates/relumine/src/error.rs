//! Everything that can go wrong behind the front door, and what to do then.

use std::path::PathBuf;

use relumine_capture::CaptureError;
use relumine_field::FieldError;
use relumine_incident::IncidentError;
use relumine_lamp::LightError;
use relumine_radiometry::DescriptionError;
use relumine_radiometry::colour::ColourError;
use relumine_radiometry::files::FileError;
use relumine_relight::RelightError;
use relumine_rig::RigError;
use relumine_tracer::{RenderError, SceneError};

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
    /// The rig, or the capture that it fills.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// The virtual scene.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The light on a virtual scene.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// A picture file.
    #[error(transparent)]
    File(#[from] FileError),
    /// A colour chart, its reference values, or a correction.
    #[error(transparent)]
    Colour(#[from] ColourError),
    /// Nothing of an input could be used.
    #[error("{}: nothing in it can be used; the first loss: {first}", path.display())]
    NothingUsable {
        /// The input.
        path: PathBuf,
        /// Why the first part of it could not be used.
        first: String,
    },
    /// A field without what a standard error comes from.
    #[error("{}: the field does not say what it is uncertain by: {reason}", path.display())]
    NoNoise {
        /// The field.
        path: PathBuf,
        /// Why it does not.
        reason: String,
    },
    /// Fields, or a field and a capture, that do not belong together.
    #[error("{}: {found}, but {expected} is what it is held against", path.display())]
    NotAlike {
        /// The field.
        path: PathBuf,
        /// What it is held against has.
        expected: String,
        /// What it has.
        found: String,
    },
    /// Photographs of a card that do not measure a projector.
    #[error("{}: {source}", path.display())]
    Card {
        /// The photograph, or the list of them.
        path: PathBuf,
        /// Why.
        source: relumine_radiometry::projector::ProjectorError,
    },
    /// A list of lamps that cannot be.
    #[error("{}: {reason}", path.display())]
    LampList {
        /// The list or folder.
        path: PathBuf,
        /// Where, what was expected, what came.
        reason: String,
    },
    /// A list of exposures that cannot be.
    #[error("{}:{line}: {reason}", path.display())]
    ExposureList {
        /// The list.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// What was expected, what came.
        reason: String,
    },
    /// Photographs that are no bracket of one view.
    #[error("{}: {reason}", path.display())]
    Bracket {
        /// The first photograph that does not fit the others, or the list.
        path: PathBuf,
        /// What was expected, what came.
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
            Self::Rig(error) => rig_hint(error),
            Self::Capture(error) => capture_hint(error),
            Self::Field(FieldError::Exists { .. }) => Some("choose another name, or add --force to replace it"),
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
            Self::NotAlike { .. } => Some("hold it against what has the same cells and pictures of the same size"),
            Self::LampList { .. } | Self::ExposureList { .. } => Some("correct the list"),
            Self::Bracket { .. } => {
                Some("give photographs of one view, from one camera, that differ in nothing but the exposure")
            }
            Self::File(FileError::Read { .. }) => Some("check the name, and that the file may be read"),
            Self::File(FileError::Unsupported { .. }) => {
                Some("convert it to a picture that is read: PNG, TIFF, JPEG, OpenEXR or Radiance HDR")
            }
            Self::File(FileError::NoExposure { .. }) => {
                Some("write `name seconds` of each photograph into a file, a line each, and give it with --list")
            }
            Self::Card { .. } => {
                Some("FORMAT.md says how the card is photographed; --corners are those of the pattern on it")
            }
            Self::NoNoise { .. } => Some(
                "a standard error needs a field developed by `relumine develop`, fitted or of single squares, not packed",
            ),
            Self::NothingUsable { .. } => Some("check that the photographs lie where the list says"),
            Self::NeitherMosaicNorMap { .. } | Self::Incident(IncidentError::Mosaic { .. }) => {
                Some("a mosaic belongs to the cells it was written for; write one with `relumine light … --for FIELD`")
            }
            Self::Scene(SceneError::Description(DescriptionError::Read { .. })) => {
                Some("a scene is a scene.toml (FORMAT.md describes it), or a model: .gltf, .glb or .obj")
            }
            Self::Light(LightError::Description(DescriptionError::Read { .. })) => {
                Some("a light is a light.toml; FORMAT.md describes it")
            }
            Self::Render(RenderError::Mosaic) => {
                Some("render the scene's field (`relumine render … --transfer RIG.toml -o FIELD`), and relight that")
            }
            _ => None,
        }
    }

    /// Whether the input is damaged or incomplete, rather than the job having failed.
    pub fn is_damaged_input(&self) -> bool {
        match self {
            Self::Capture(_) => true,
            Self::Rig(error) => matches!(
                error,
                RigError::Description(_) | RigError::Capture(_) | RigError::Rig { .. } | RigError::Contradiction { .. }
            ),
            Self::Field(error) | Self::Relight(RelightError::Field(error)) => matches!(
                error,
                FieldError::Damaged { .. }
                    | FieldError::Read { .. }
                    | FieldError::NotAField { .. }
                    | FieldError::Geometry { .. }
            ),
            Self::File(error) => !matches!(error, FileError::Write { .. }),
            Self::Scene(_)
            | Self::Light(_)
            | Self::Colour(_)
            | Self::NothingUsable { .. }
            | Self::LampList { .. }
            | Self::ExposureList { .. }
            | Self::Bracket { .. }
            | Self::Card { .. } => true,
            Self::Incident(_)
            | Self::Relight(_)
            | Self::NotAlike { .. }
            | Self::NoNoise { .. }
            | Self::Render(_)
            | Self::NeitherMosaicNorMap { .. } => false,
        }
    }
}

fn capture_hint(error: &CaptureError) -> Option<&'static str> {
    match error {
        CaptureError::Read { .. } | CaptureError::Description(DescriptionError::Read { .. }) => {
            Some("a capture is a directory with capture.toml and photographs.csv; FORMAT.md describes both")
        }
        CaptureError::Setup { .. } => Some("correct capture.toml; FORMAT.md describes it"),
        CaptureError::Row { .. } => Some("correct the line, or remove it if the photograph is gone"),
        CaptureError::Photograph { .. } => {
            Some("correct [camera] in capture.toml, or remove the photograph's row from photographs.csv")
        }
        _ => None,
    }
}

fn rig_hint(error: &RigError) -> Option<&'static str> {
    match error {
        RigError::Capture(error) => capture_hint(error),
        RigError::Description(DescriptionError::Read { .. }) => Some(
            "`relumine plan RIG.toml CAPTURE` lays out a capture from the description of a rig; FORMAT.md has every key",
        ),
        RigError::Exists { .. } => Some("choose another name, or add --force to replace a capture without photographs"),
        RigError::Precious { .. } => Some("choose another name, or move it away yourself"),
        RigError::Busy { .. } => Some("wait for it to end"),
        RigError::Contradiction { .. } => Some("undo the change, or lay out another capture with `relumine plan`"),
        RigError::Write { .. } => Some("free some space or choose another disk; run the same command again to go on"),
        RigError::Photograph { .. } => Some(
            "set the camera as [camera] in rig.toml says, or lay out another capture; run the same command again to go on",
        ),
        RigError::Read { .. } | RigError::Device { .. } | RigError::Stopped => {
            Some("put it right and run the same command again to go on")
        }
        _ => None,
    }
}
