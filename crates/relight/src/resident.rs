//! A field held in memory, decoded, for lights that follow one another.

use half::f16;
use rayon::prelude::*;
use relumine_field::{BlockBuffer, FieldError, ReflectanceField};

use crate::TransferSource;

/// All blocks of a field as halves: two bytes a pixel, channel and cell that has light.
pub struct ResidentField {
    field: ReflectanceField,
    /// `[position][tile]`, each `[square][block]`.
    tiles: Vec<Vec<ResidentTile>>,
}

/// The blocks of one tile of one position.
pub struct ResidentTile {
    /// Where each block starts in `values`; `None` has no light.
    starts: Vec<Option<usize>>,
    values: Vec<f16>,
    block_values: usize,
    across: usize,
    blocks: usize,
}

impl ResidentField {
    /// Reads and decodes the whole field.
    ///
    /// # Errors
    /// If it cannot be read or is damaged.
    pub fn load(field: ReflectanceField) -> Result<Self, FieldError> {
        let tiles: Vec<[usize; 2]> = field.blocks().all_tiles().collect();
        let tiles = (0..field.cells().positions())
            .into_par_iter()
            .map(|position| tiles.iter().map(|tile| ResidentTile::load(&field, position, *tile)).collect())
            .collect::<Result<_, _>>()?;
        Ok(Self { field, tiles })
    }

    /// Bytes of transfers in memory.
    pub fn bytes(&self) -> usize {
        self.tiles.iter().flatten().map(|tile| tile.values.len() * 2).sum()
    }
}

impl ResidentTile {
    fn load(field: &ReflectanceField, position: usize, tile: [usize; 2]) -> Result<Self, FieldError> {
        let blocks = field.blocks();
        let shard = field.shard(position, tile, true)?;
        let mut buffer = BlockBuffer::new(&blocks)
            .map_err(|source| FieldError::Read { path: field.path().to_path_buf(), source })?;
        let [down, across] = blocks.blocks_per_tile();
        let squares = field.cells().squares() * field.cells().squares();
        let mut starts = Vec::with_capacity(squares * down * across);
        let mut values = Vec::new();
        for square in 0..squares {
            for block in (0..down).flat_map(|j| (0..across).map(move |i| [j, i])) {
                let lit = shard.block(square, block, &mut buffer)?;
                starts.push(lit.then_some(values.len()));
                if lit {
                    values.extend_from_slice(buffer.values());
                }
            }
        }
        values.shrink_to_fit();
        Ok(Self { starts, values, block_values: buffer.values().len(), across, blocks: down * across })
    }
}

impl TransferSource for ResidentField {
    type Tile<'a> = &'a ResidentTile;

    fn field(&self) -> &ReflectanceField {
        &self.field
    }

    fn tile(&self, position: usize, [row, column]: [usize; 2], _: usize) -> Result<&ResidentTile, FieldError> {
        let [_, across] = self.field.blocks().tiles();
        Ok(&self.tiles[position][row * across + column])
    }

    fn block<'b>(
        tile: &'b &ResidentTile,
        square: usize,
        [row, column]: [usize; 2],
        _: &'b mut BlockBuffer,
    ) -> Result<Option<&'b [f16]>, FieldError> {
        let start = tile.starts[square * tile.blocks + row * tile.across + column];
        Ok(start.map(|start| &tile.values[start..start + tile.block_values]))
    }
}
