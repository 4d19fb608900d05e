//! Relumine photographs an object under a moving projector once and shows it under any light: *Relighting with 4D Incident
//! Light Fields* (Peers, Masselus, Dutré, Willems, SIGGRAPH 2003).
//!
//! This is the front door, the paper in one page:
//!
//! ```no_run
//! use std::path::Path;
//! use relumine::{Development, DevelopOptions, Light, ProjectionOptions, ReflectanceField, Relighting, project};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // Photographs → reflectance field: black subtracted, combs separated (§5), one transfer Rᵢ a cell (eq. 5).
//! let mut development = Development::start(Path::new("chess"), Path::new("chess.field"), &DevelopOptions::default())?;
//! for position in &mut development {
//!     println!("{:?}", position?.report.residual_combs);
//! }
//! development.finish()?;
//!
//! // Light → coefficients lᵢ (§4.3).
//! let field = ReflectanceField::open(Path::new("chess.field"))?;
//! let light = Light::read(Path::new("spots.toml"))?;
//! let projected = project(&light, field.cells(), &ProjectionOptions::default())?;
//!
//! // Σ lᵢ Rᵢ (eq. 4).
//! let pictures = Relighting::new(&field, &[projected.coefficients])?.run()?;
//! # Ok(())
//! # }
//! ```

mod against;
mod bracket;
mod check;
mod develop;
mod error;
mod import;
mod kept_response;
mod lights;
mod noise;
mod pack;
mod queue;
mod scene_field;

pub use against::{TestLight, differences, differences_from_photographs, test_lights};
pub use bracket::{Bracket, BracketPhotograph, BracketResponse, ExposureList, Levels, MergedBracket};
pub use check::CaptureCheck;
pub use develop::{DevelopOptions, DevelopedReport, Development, PositionOutcome};
pub use error::Error;
pub use import::{Import, ImportOptions, LampList, LampPhotograph};
pub use lights::{LightKind, picture_kind, read_light, write_mosaic};
pub use noise::field_noise;
pub use pack::{Encoding, Repacking, kept};
pub use scene_field::SceneField;

pub use relumine_basis as basis;
pub use relumine_basis::{Cell, Cells, Coefficients};
pub use relumine_capture::{Capture, ShownPattern, separation::Method as Separation};
pub use relumine_field::ReflectanceField;
pub use relumine_incident::{Options as ProjectionOptions, Projected, Reconstruction, project};
pub use relumine_lamp::Light;
pub use relumine_radiometry as radiometry;
pub use relumine_relight::{
    FieldNoise, Incremental, Relighting, ResidentField, ResidentPacked, StandardErrors, missing_share,
    relight_reference,
};
pub use relumine_rig as rig;
pub use relumine_rig::{Rig, Run, lay_out};
pub use relumine_tracer as tracer;
pub use relumine_tracer::{PathOptions, Rendering, Scene};
