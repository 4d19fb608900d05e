//! Light to relight with: any light description projected on the cells (paper, §4.3), lᵢ = Φᵢ / |Ωᵢ|, with Φᵢ the flux of
//! the light through cell i (docs/MATH.md).
//!
//! Lamps are projected *from the source*: rays that carry their flux are drawn, followed back to the hemisphere, and
//! counted in the cell they came through; so point lights, spots and suns, which are deltas in angle or space, need no
//! special treatment. Environments and mosaics are integrated *from the cell*: points of the patch, directions of the
//! square. Both are stratified, start from a fixed seed, and say how uncertain they are.
//!
//! Lamps that stand inside the hemisphere have their light followed back as if it had come through it. What then cannot be
//! right stays wrong: the lamp's own shadow, and light that an object between lamp and hemisphere would have stopped.

use glam::DVec3;
use relumine_basis::{Between, Cells};

mod cell_quadrature;
mod deposit;
mod project;
mod source_rays;

pub use project::{Lost, Options, Projected, project};

/// How a ray between positions is shared among them (docs/MATH.md, "Between positions").
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reconstruction {
    /// All to the position whose patch it enters: the paper's box basis. The beam is turned by up to half a patch.
    Box,
    /// Split over the positions around it, same local square: halves the error of most lights, and turns one hard shadow
    /// into up to four faint ones.
    #[default]
    Linear,
}

impl Reconstruction {
    /// The positions that share what enters at `outward`.
    pub(crate) fn shares(self, cells: &Cells, outward: DVec3) -> Between {
        match self {
            Self::Box => Between::only(cells.partition().owner(outward)),
            Self::Linear => cells.partition().between(outward),
        }
    }
}

/// Why a light cannot be projected.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum IncidentError {
    /// The mosaic does not fit the cells.
    #[error("{}: {source}", path.display())]
    Mosaic {
        /// The mosaic.
        path: std::path::PathBuf,
        /// What was expected and what came.
        source: relumine_basis::BasisError,
    },
}
