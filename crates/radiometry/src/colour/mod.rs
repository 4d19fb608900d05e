//! Colour: from the camera's channels to Rec. 709, by a photographed chart (paper, §4.2: "camera and projector are colour
//! calibrated with a ColorChecker").
pub mod space;
mod chart;
mod cht;
mod difference;
mod error;
mod homography;
mod reference;
mod solve;
mod table;

pub use chart::{Chart, Patch};
pub use difference::delta_e_2000;
pub use error::ColourError;
pub use homography::Homography;
pub use reference::{Illuminant, Reference};
