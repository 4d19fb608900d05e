//! The packed encoding: what light through each square shows of 8 × 8 pixels, in a basis of their own.
//!
//! A picture is cut into blocks and these into [`Patches`] of at most 8 × 8 pixels. Under one position a patch is lit directly
//! through one square, at an edge through two or four; what comes from the others is weak and smooth. Over all positions what
//! a patch shows lies near a space of few dimensions (low rank: its surfaces do not change, only the light on them). So a patch
//! keeps a basis of a few little pictures, 8 bits a value, and for every position a list of [`Atom`]s, 8 bits a coefficient:
//!
//! * the **whole**: the patch under all squares at once, kept under the number of its main square;
//! * **squares** that show more than the error allows to be shared out;
//! * **coarse squares**: the sum of all that is left in a group of squares, spread evenly over them.
//!
//! The transfer of square s is what its own atom and its group's share say; the main square's is the whole less all others.
//! Light of one radiance through all squares of a position therefore shows the whole, whatever the rest lost.

mod atoms;
mod basis;
mod block;
mod coder;
mod encode;
mod kept;
mod patches;
mod product;
mod sketch;
pub(crate) mod sketched;
mod smooth;
pub(crate) mod store;

pub use atoms::{Atom, Atoms, Ids};
pub use block::PackedBlock;
pub use kept::Kept;
pub use patches::{Groups, Patches};
pub use sketch::{Keep, Sketch};
pub use store::BlockRecord;
