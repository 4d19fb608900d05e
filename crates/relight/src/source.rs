//! Where blocks of transfers come from: a field on disk, or one held in memory.

use half::f16;
use relumine_field::{BlockBuffer, FieldError, ReflectanceField, Shard};

/// Blocks of transfers of one field.
pub trait TransferSource: Sync {
    /// One tile of one position, open.
    type Tile<'a>
    where
        Self: 'a;

    /// The field's metadata.
    fn field(&self) -> &ReflectanceField;

    /// Opens a tile of a position of which `squares` squares will be read.
    ///
    /// # Errors
    /// If it cannot be read or is damaged.
    fn tile(&self, position: usize, tile: [usize; 2], squares: usize) -> Result<Self::Tile<'_>, FieldError>;

    /// One block of one square, `[channel][row][column]`, padded; `None` if it has no light.
    ///
    /// # Errors
    /// If it cannot be read or is damaged.
    fn block<'b>(
        tile: &'b Self::Tile<'_>,
        square: usize,
        block: [usize; 2],
        buffer: &'b mut BlockBuffer,
    ) -> Result<Option<&'b [f16]>, FieldError>;
}

impl TransferSource for ReflectanceField {
    type Tile<'a> = Shard;

    fn field(&self) -> &ReflectanceField {
        self
    }

    fn tile(&self, position: usize, tile: [usize; 2], squares: usize) -> Result<Shard, FieldError> {
        // Above a quarter of the squares one long read is faster than many short ones.
        let all = self.cells().squares() * self.cells().squares();
        self.shard(position, tile, 4 * squares >= all)
    }

    fn block<'b>(
        tile: &'b Shard,
        square: usize,
        block: [usize; 2],
        buffer: &'b mut BlockBuffer,
    ) -> Result<Option<&'b [f16]>, FieldError> {
        Ok(tile.block(square, block, buffer)?.then(|| buffer.values()))
    }
}
