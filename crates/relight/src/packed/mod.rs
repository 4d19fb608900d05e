//! Relighting of the packed encoding ([`relumine_field::packed`]).
//!
//! What a patch shows is Σₖ stepₖ · basisₖ · vₖ, where vₖ sums, over the positions and the atoms of their lists, the atom's
//! weight under the light times its k-th coefficient. So all work on positions is on the few numbers v of a patch, and its pixels
//! are made once, at the end. [`relumine_field::packed::PackedBlock::add_weighted`] is the plain version, in double precision; the
//! versions here agree with it to [`crate::TOLERANCE`], and give the same bits with any number of threads on any machine:
//!
//! * [`ResidentPacked`] holds a field in memory and relights it at once;
//! * [`Incremental`] follows a light that changes at some positions, and touches only what shows them;
//! * [`Progressive`] shows a picture early and ends with the exact one;
//! * [`relight_block`] relights one block as it was read, under several lights, and keeps nothing.

mod block;
mod build;
mod error;
mod incremental;
mod kernel;
mod progressive;
mod resident;
mod rows;
mod stream;
mod sum;
#[cfg(test)]
mod synthetic;
mod weights;

pub use block::ResidentBlock;
pub use error::PackedError;
pub use incremental::{Incremental, Update};
pub use progressive::{Progressive, Step};
pub use resident::ResidentPacked;
pub use stream::relight_block;
pub use weights::LightWeights;
