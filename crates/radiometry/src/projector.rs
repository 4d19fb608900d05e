//! A projector measured with a camera: how evenly it shines, what its black still shows, its colour, what it makes of a grey level.
//!
//! What is photographed is a flat matte card across the projector's axis that fills the pattern. A card of albedo ρ at the distance D
//! along the axis gets the irradiance E(s, t) = I(a) cos³a / D² and shows the radiance ρE/π from wherever it is looked at
//! (docs/MATH.md). The flux of a square is ∫ I dω = ∫ I cos³a ds dt = D² ∫ E ds dt: the mean radiance over the square's area on the card is
//! its flux but for a constant. No power of the cosine is left, whether of the projector's angle or of the camera's place; only what
//! the camera's own lens darkens towards its corners would be taken for the projector's.

mod flat_field;
mod ramp;
mod view;

pub use flat_field::{Card, FlatField};
pub use ramp::{LevelRamp, RampEntry};
pub use view::PatternView;

/// Why a projector cannot be measured from a photograph.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ProjectorError {
    /// The corners do not span a pattern.
    #[error("corners: {0}")]
    Corners(String),
    /// The photographs do not measure it.
    #[error("{0}")]
    Photograph(String),
    /// A list of grey levels that cannot be.
    #[error("{path}:{line}: {reason}")]
    List {
        /// The list.
        path: String,
        /// Line, from 1.
        line: usize,
        /// What was expected and what came.
        reason: String,
    },
}
