//! Things that move, shine and see, and the run of a plan (paper, §4.1 and §5).
//!
//! A rig is three devices with one verb each: a [`Stage`] moves, a [`Projector`] shows, a [`Camera`] photographs. [`Rig`] is its
//! description, [`Plan`] the order of its photographs, [`lay_out`] makes the capture directory, and [`Run`] fills it,
//! photograph by photograph, so that nothing but the one under way is lost whenever it is stopped. [`exam`] holds any device
//! to what the others rely on.
//!
//! Nothing is developed here, and no motor or camera protocol is spoken yet: the drivers are [`manual`] and [`simulated`].

mod description;
mod devices;
pub mod drivers;
mod error;
mod estimate;
pub mod exam;
mod journal;
mod layout;
pub mod manual;
mod plan;
mod run;
pub mod simulated;

pub use description::{Hands, Manual, Rig, Timing};
pub use devices::{Camera, Drivers, Photograph, Projector, Stage};
pub use error::RigError;
pub use estimate::{Estimate, PlanWarning};
pub use layout::{lay_out, pattern_picture};
pub use plan::{Plan, Planned};
pub use run::{Run, Taken};
