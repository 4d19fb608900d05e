//! What shines: lamps, environments and mosaics, and the `light.toml` that lists them (FORMAT.md §2).
//!
//! Each lamp says two things, once, for all who ask: which rays carry its flux towards a ball at the origin
//! ([`Lamp::shoot`]), and what arrives at a point ([`Lamp::arrival`], [`Lamp::radiance`]). The first is how light is
//! projected on cells, the second how it is collapsed to a light map and how a virtual scene is lit.
//!
//! Lamps know nothing of cells or positions. World frame, metres, linear RGB.

mod area;
mod description;
mod environment;
mod lamp;
mod placement;
mod sampling;
mod slide;

pub use area::{Disk, Rectangle, Sphere};
pub use description::{Light, LightError, Mosaic};
pub use environment::{Environment, Highlights};
pub use lamp::{Arrival, Lamp, Ray, Sight};
pub use placement::Placement;
pub use slide::Slide;
