//! Colour: from the camera's channels to linear Rec. 709 by a photographed chart (paper, §4.2: camera and projector are
//! calibrated with a ColorChecker).
//!
//! A [`Chart`] says where its patches lie, a [`Reference`] which colours they have; [`Chart::find`] or four corners place the
//! chart in a [`Photograph`], [`measure`] reads its patches, [`ColourFit`] fits a [`Correction`] to them, and a
//! [`ColourProfile`] keeps it as `chart.toml`. [`white_balance`] is for a projector's own colour.
//!
//! Not here: spectral data, ICC profiles, look-up tables, and the light's unevenness across the chart (take it away with a
//! flat field first).

mod balance;
mod chart;
mod cht;
mod correction;
mod difference;
mod error;
mod find;
mod fit;
mod measure;
mod picture;
mod profile;
mod reference;
pub mod space;
mod table;

pub use balance::white_balance;
pub use chart::{Chart, Patch};
pub use correction::{Correction, Model};
pub use difference::delta_e_2000;
pub use error::ColourError;
pub use find::Found;
pub use fit::{ColourFit, Errors, PatchFit};
pub use measure::{LeftOut, Measurement, Photograph, measure};
pub use profile::{ColourProfile, Fitted};
pub use reference::{Illuminant, Reference};
