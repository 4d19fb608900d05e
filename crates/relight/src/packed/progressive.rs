//! A picture early, then the exact one.

use relumine_radiometry::{Image, Radiance};

use crate::packed::sum::Summing;
use crate::packed::{LightWeights, ResidentPacked};

/// Parts in which the exact picture comes.
const PARTS: usize = 16;

/// Relights a field step by step, for a viewer that shows what there is and drops it when the light changes.
///
/// The first step shows every patch as if all its light at a position came through its main square, in the first 8 components of
/// its basis: a sharp picture where light is direct or the same through all squares of a position, at about a sixth of the bytes.
/// Each further step replaces some of the blocks, in their order, by what [`ResidentPacked::relight`] gives; after the last the
/// picture has its bits.
pub struct Progressive<'a> {
    field: &'a ResidentPacked,
    weights: LightWeights,
    picture: Image<Radiance>,
    /// Whether the first step was taken.
    coarse: bool,
    /// Blocks that are exact.
    exact: usize,
}

/// What a step has shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// The whole picture, coarsely.
    Coarse,
    /// So many of all blocks are exact.
    Exact {
        /// Those that are.
        blocks: usize,
        /// All.
        of: usize,
    },
}

impl<'a> Progressive<'a> {
    pub(crate) fn new(field: &'a ResidentPacked, weights: LightWeights) -> Self {
        let (width, height) = field.picture_size();
        Self { field, weights, picture: Image::black(width, height), coarse: false, exact: 0 }
    }

    /// The picture so far, radiance [W·m⁻²·sr⁻¹]; black before the first step.
    pub fn picture(&self) -> &Image<Radiance> {
        &self.picture
    }

    /// Takes all steps that are left.
    pub fn finish(mut self) -> Image<Radiance> {
        self.coarse = true;
        self.by_ref().for_each(drop);
        self.picture
    }
}

impl Iterator for Progressive<'_> {
    type Item = Step;

    fn next(&mut self) -> Option<Step> {
        let of = self.field.blocks().len();
        if !self.coarse {
            self.coarse = true;
            self.field.sum_into(&self.weights, Summing::sum_wholes, 0..of, &mut self.picture);
            return Some(Step::Coarse);
        }
        if self.exact == of {
            return None;
        }
        let end = (self.exact + of.div_ceil(PARTS)).min(of);
        self.field.sum_into(&self.weights, Summing::sum, self.exact..end, &mut self.picture);
        self.exact = end;
        Some(Step::Exact { blocks: end, of })
    }
}
