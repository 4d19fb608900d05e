//! The laboratory notebook: what was set up, what was photographed, and how photographs become one picture a square
//! (paper, §4.2 and §5).
//!
//! A capture directory (FORMAT.md §1) is read as it lies, also while it grows. [`Capture`] says what is there and what is
//! missing; [`Developer`] turns the photographs of one position into radiance, takes the projector's black away and
//! separates the squares of the combs. No hardware is touched here: a capture can be developed anywhere.

mod capture;
mod develop;
mod developed;
mod disagreement;
mod error;
mod judging;
mod noise;
mod pattern;
mod photographs;
mod recovered;
mod reference_patch;
pub mod separation;
mod setup;

pub use capture::{Capture, Remark};
pub use develop::{Developer, Loss};
pub use developed::{DevelopedPosition, Tile};
pub use error::CaptureError;
pub use judging::{Finding, FindingKind, Judge, PatternExposure, PositionJudgement, Severity};
pub use noise::PositionNoise;
pub use pattern::{Scheme, ShownPattern};
pub use photographs::{PhotographRow, Photographs, csv_fields, csv_header};
pub use recovered::recover_response;
pub use reference_patch::ReferencePatch;
pub use setup::{CameraResponse, Setup};
