//! The reflectance field on disk: the transfer Rᵢ of every cell (eq. 5), written once, read many times.
//!
//! A field is a Zarr v3 group that any Zarr reader opens; FORMAT.md says what is in it. Its main array is position-major
//! and cut into blocks of pixels per square, so that light from few positions or squares reads few bytes. Blocks without
//! light are not stored. Values are halves times a scale of their position.
//!
//! * [`FieldWriter`] writes into `NAME.partial`, position by position in any order, remembers what is done in a journal,
//!   and renames the whole to `NAME` when nothing is missing. Killed at any moment, it goes on where it was.
//! * [`ReflectanceField`] reads. Damage is found: blocks and their index carry checksums, files are listed with their
//!   BLAKE3 digests in `checksums.b3`, which the `b3sum` program checks too.
//!
//! This room does not know photographs, light, or how a field was made beyond the words in its metadata.

mod blocks;
mod error;
mod header;
mod journal;
mod manifest;
pub mod packed;
mod reader;
mod shard;
mod shard_index;
mod writer;
mod zarr;

pub use blocks::{Blocks, Extent};
pub use error::FieldError;
pub use header::{Header, Lamps, LayoutRecord, Packing};
pub use journal::PositionRecord;
pub use manifest::Damage;
pub use reader::ReflectanceField;
pub use shard::{BlockBuffer, Shard};
pub use writer::FieldWriter;
