//! From where light comes: the hemisphere around the object, cut into cells (paper, §3 and §4.1).
//!
//! A *position* is where the projector stands, a *square* one of the M × M squares of its pattern, and a cell Ωᵢ the two
//! together: all rays that enter through the position's patch of the hemisphere inside the square's cone (eq. 2). This
//! room knows the geometry of cells, how large each is (its measure |Ωᵢ|), which cell a ray belongs to, and the shape of
//! the numbers that a light leaves on them (its [`Coefficients`]).
//!
//! It reads and writes nothing, knows no photographs and no lamps.
//!
//! World frame: right-handed, metres, z up, origin at the centre of the hemisphere. Angles are radians.

mod cells;
mod coefficients;
mod error;
mod frame;
mod partition;
mod pattern;
pub mod spherical;

pub use cells::{Cell, Cells, Entry, Reach};
pub use coefficients::Coefficients;
pub use error::BasisError;
pub use frame::{Position, ProjectorFrame};
pub use partition::{Between, Layout, Partition};
pub use pattern::Pattern;
