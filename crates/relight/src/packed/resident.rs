//! A packed field held in memory.

use rayon::prelude::*;
use relumine_basis::Coefficients;
use relumine_field::ReflectanceField;
use relumine_field::packed::PackedBlock;
use relumine_radiometry::{Image, Radiance};

use crate::RelightError;
use crate::packed::block::Slot;
use crate::packed::kernel::Kernel;
use crate::packed::rows::Rows;
use crate::packed::sum::{Summing, write_block};
use crate::packed::{LightWeights, PackedError, Progressive, ResidentBlock};

/// A packed field in memory, for lights that follow one another.
#[derive(Clone, Debug)]
pub struct ResidentPacked {
    width: usize,
    height: usize,
    positions: usize,
    squares: usize,
    blocks: Vec<ResidentBlock>,
    rows: Rows,
}

/// Sums of some blocks under a light, one after the other.
pub(crate) type Sum = for<'a> fn(&'a mut Summing, &Kernel, &[ResidentBlock], &LightWeights) -> &'a [Slot];

/// Blocks that take turns, at most: more share the tables of a light, fewer are spread better.
const IN_TURN: usize = 8;
/// The tables of so many positions stay in the cache by themselves: blocks need not take turns.
const FEW_POSITIONS: usize = 32;

impl ResidentPacked {
    /// Reads a packed field, all of it: about twice its bytes on disk.
    ///
    /// # Errors
    /// If it is not packed, or cannot be read or is damaged.
    pub fn load(field: &ReflectanceField) -> Result<Self, RelightError> {
        if !field.is_packed() {
            return Err(PackedError::NotPacked.into());
        }
        let ([down, across], squares) = (field.blocks().grid(), field.cells().squares());
        let blocks = (0..down * across)
            .into_par_iter()
            .map(|index| {
                let block = field.packed_block([index / across, index % across], |_| true)?;
                Ok(ResidentBlock::new(&block, squares)?)
            })
            .collect::<Result<Vec<_>, RelightError>>()?;
        let (width, height) = field.picture_size();
        Ok(Self::from_resident(blocks, [width, height], field.cells().positions(), squares)?)
    }

    /// Lays out blocks that were read whole, for a picture of `[width, height]` pixels and a field of `positions` × `squares` ×
    /// `squares` cells. Pixels that no block holds stay black.
    ///
    /// # Errors
    /// If a block was not read at all its positions, does not fit the picture or the cells, or cannot be laid out.
    pub fn new(
        blocks: Vec<PackedBlock>,
        [width, height]: [usize; 2],
        positions: usize,
        squares: usize,
    ) -> Result<Self, PackedError> {
        let blocks = blocks
            .into_par_iter()
            .map(|block| ResidentBlock::new(&block, squares))
            .collect::<Result<Vec<_>, PackedError>>()?;
        Self::from_resident(blocks, [width, height], positions, squares)
    }

    /// As [`ResidentPacked::new`], of blocks laid out one by one as they were read.
    ///
    /// # Errors
    /// If a block was not read at all its positions, or does not fit the picture or the cells.
    pub fn from_resident(
        blocks: Vec<ResidentBlock>,
        [width, height]: [usize; 2],
        positions: usize,
        squares: usize,
    ) -> Result<Self, PackedError> {
        for block in &blocks {
            let found = block.positions();
            if found != positions {
                return Err(PackedError::Positions { expected: positions, found });
            }
            if let Some(position) = (0..positions).find(|position| block.segment(*position).is_none()) {
                return Err(PackedError::Unread { position });
            }
            let (found, ids) = (block.squares * block.squares, squares * squares);
            if found != ids {
                return Err(PackedError::NoSuchSquare { id: found.saturating_sub(1), ids });
            }
        }
        let rows = Rows::new(width, height, &blocks)?;
        Ok(Self { width, height, positions, squares, blocks, rows })
    }

    /// Pixels of the picture, (width, height).
    pub fn picture_size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Positions of the field.
    pub fn positions(&self) -> usize {
        self.positions
    }

    /// M, squares a side of the pattern.
    pub fn squares(&self) -> usize {
        self.squares
    }

    /// Bytes in memory.
    pub fn bytes(&self) -> usize {
        self.blocks.iter().map(ResidentBlock::bytes).sum()
    }

    /// The weights of a light on the cells of this field.
    ///
    /// # Errors
    /// If the light is for other cells.
    pub fn weights(&self, light: &Coefficients) -> Result<LightWeights, PackedError> {
        LightWeights::new(light, self.squares, self.positions)
    }

    /// The relit picture, radiance [W·m⁻²·sr⁻¹].
    ///
    /// # Errors
    /// If the light is for other cells.
    pub fn relight(&self, light: &Coefficients) -> Result<Image<Radiance>, PackedError> {
        let mut picture = Image::black(self.width, self.height);
        self.relight_into(light, &mut picture)?;
        Ok(picture)
    }

    /// As [`ResidentPacked::relight`], over a picture of the same size.
    ///
    /// # Errors
    /// If the light is for other cells.
    ///
    /// # Panics
    /// If the picture has another size.
    pub fn relight_into(&self, light: &Coefficients, picture: &mut Image<Radiance>) -> Result<(), PackedError> {
        let weights = self.weights(light)?;
        self.sum_into(&weights, Summing::sum, 0..self.blocks.len(), picture);
        Ok(())
    }

    /// First a coarse picture, then the exact one part by part.
    ///
    /// # Errors
    /// If the light is for other cells.
    pub fn progressive(&self, light: &Coefficients) -> Result<Progressive<'_>, PackedError> {
        Ok(Progressive::new(self, self.weights(light)?))
    }

    /// The pixels of some blocks from their sums.
    pub(crate) fn sum_into(
        &self,
        weights: &LightWeights,
        sum: Sum,
        chosen: std::ops::Range<usize>,
        picture: &mut Image<Radiance>,
    ) {
        let kernel = Kernel::best();
        let mut shares = self.share_out(picture);
        let most = if weights.lit().len() > FEW_POSITIONS { IN_TURN } else { 1 };
        let in_turn = (chosen.len() / (4 * rayon::current_num_threads())).clamp(1, most);
        let blocks = self.blocks[chosen.clone()].par_chunks(in_turn).zip(shares[chosen].par_chunks_mut(in_turn));
        blocks.for_each_init(Summing::default, |summing, (blocks, shares)| {
            let mut slots = sum(summing, &kernel, blocks, weights);
            for (block, rows) in blocks.iter().zip(shares) {
                let (mine, after) = slots.split_at(block.number_of_slots());
                slots = after;
                write_block(&kernel, block, mine, rows);
            }
        });
    }

    /// The rows of each block.
    pub(crate) fn share_out<'a>(&self, picture: &'a mut Image<Radiance>) -> Vec<Vec<&'a mut [[f32; 3]]>> {
        assert_eq!(picture.size(), (self.width, self.height), "a picture of another size");
        self.rows.share_out(picture, &self.blocks)
    }

    /// The blocks.
    pub(crate) fn blocks(&self) -> &[ResidentBlock] {
        &self.blocks
    }
}
