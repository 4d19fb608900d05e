//! The three things of a rig, each with one verb. Any hardware becomes a driver by doing one of them; [`crate::exam`] holds it
//! to its word.

use relumine_basis::Position;
use relumine_capture::ShownPattern;
use relumine_radiometry::ExposureSettings;

use crate::RigError;

/// Something that moves the projector about the object, or the object under the projector: a gantry, a turntable, a person.
pub trait Stage {
    /// Brings the projector to `position` (radians), the capture's position number `index` from 0, and returns when
    /// nothing moves any more. Moving to where it stands already is allowed and does nothing.
    ///
    /// # Errors
    /// If it cannot be reached; where the projector stands is then not known.
    fn move_to(&mut self, index: usize, position: Position) -> Result<(), RigError>;
}

/// Something that shows patterns: u grows rightward and v downward as the projector sees the object.
pub trait Projector {
    /// Shows `pattern` and returns when it stands still; it stays until the next one, also while the stage moves.
    ///
    /// # Errors
    /// If it cannot be shown.
    fn show(&mut self, pattern: ShownPattern) -> Result<(), RigError>;
}

/// Something that photographs. Focus, aperture, sensitivity and white balance stay the same for a whole capture.
pub trait Camera {
    /// Takes one photograph with this shutter time (and sensitivity and aperture, if given).
    ///
    /// # Errors
    /// If none can be had.
    fn photograph(&mut self, exposure: &ExposureSettings) -> Result<Photograph, RigError>;
}

/// A photograph as the camera wrote it: a picture file's content.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Photograph {
    /// The file's bytes: PNG, TIFF, JPEG or EXR.
    pub bytes: Vec<u8>,
    /// The file's extension, without the dot: "png".
    pub extension: String,
}

/// A rig that is ready.
pub struct Drivers {
    /// What moves.
    pub stage: Box<dyn Stage>,
    /// What shines.
    pub projector: Box<dyn Projector>,
    /// What sees.
    pub camera: Box<dyn Camera>,
    /// Whether each photograph must be on disk before the next is taken: yes for all that cannot be had again for nothing.
    pub durable: bool,
}
