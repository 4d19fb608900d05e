//! The sum: relit picture = Σ lᵢ Rᵢ (eq. 4).
//!
//! [`relight_reference`] is the equation as it stands, in double precision; [`Relighting`] is the same sum on all cores,
//! block by block, for several lights in one pass over the field. It touches only the positions and squares that a light
//! shines from. The two agree to [`TOLERANCE`].
//!
//! [`StandardErrors`] says what noise of the photographs leaves uncertain in it.
//!
//! Nothing here knows where coefficients come from or how a field was made.

mod kernel;
mod packed;
mod reference;
mod relighting;
mod resident;
mod source;
mod standard_error;

pub use packed::{
    Incremental, LightWeights, PackedError, Progressive, ResidentBlock, ResidentPacked, Step, Update, relight_block,
};
pub use reference::relight_reference;
pub use relighting::{RelightError, Relighting, missing_share};
pub use resident::ResidentField;
pub use source::TransferSource;
pub use standard_error::{FieldNoise, PhotographNoise, SeparationNoise, StandardErrors};

/// Relative L2 difference allowed between the reference and the fast version: single precision sums of at most some
/// hundred thousand terms of one sign, a few units of the last place each.
pub const TOLERANCE: f64 = 2e-6;
