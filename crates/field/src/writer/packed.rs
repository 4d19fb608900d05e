//! Writing a packed field: block by block, from the sketches of all positions.

use std::fs;
use std::io;
use std::path::PathBuf;

use rayon::prelude::*;

use crate::packed::{BlockRecord, Sketch, sketched, store};
use crate::{Extent, FieldError, FieldWriter, zarr};

impl FieldWriter {
    /// The blocks of a packed field that are not written yet, row-major.
    pub fn remaining_blocks(&self) -> Vec<[usize; 2]> {
        let missing = |block: &[usize; 2]| store::record(&store::folder_of(&self.field, *block)).is_none();
        self.all_blocks().filter(missing).collect()
    }

    /// Forgets the blocks of a packed field that are written: a position is going to change.
    ///
    /// # Errors
    /// If they cannot be removed.
    pub fn forget_blocks(&self) -> Result<(), FieldError> {
        let path = self.field.join(zarr::PACKED);
        match fs::remove_dir_all(&path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(FieldError::Write { path, source: error }),
            _ => Ok(()),
        }
    }

    /// All blocks of the picture, row-major.
    pub fn all_blocks(&self) -> impl Iterator<Item = [usize; 2]> + use<> {
        let [down, across] = self.blocks.grid();
        (0..down).flat_map(move |row| (0..across).map(move |column| [row, column]))
    }

    /// Packs and writes a block of a field whose header has a [`crate::Packing`], from the sketches of all positions.
    ///
    /// # Errors
    /// If it cannot be written; then it is not done and can be written again.
    ///
    /// # Panics
    /// If the field is not packed, or there are more or fewer sketches than positions.
    pub fn write_packed(&self, block: [usize; 2], sketches: &[Sketch]) -> Result<BlockRecord, FieldError> {
        let packing = self.header.packing.expect("the field is packed");
        assert_eq!(sketches.len(), self.cells.positions(), "a packed block needs every position");
        let packed = store::pack(&self.blocks.block_extent(block), self.cells.squares(), sketches, packing.error);
        packed.write(&store::folder_of(&self.field, block))
    }

    /// Keeps the sketches of one tile of a position of a packed field until every position has its own: `sketch_of` gives that
    /// of a block of pixels, and whatever else the caller wants to know of it, which comes back in the order of the blocks.
    ///
    /// # Errors
    /// If they cannot be written; then the position is not done and can be written again.
    pub fn write_sketches<T: Send>(
        &self,
        position: usize,
        tile: [usize; 2],
        sketch_of: impl Fn(&Extent) -> (Sketch, T) + Sync,
    ) -> Result<Vec<T>, FieldError> {
        let path = sketched::path_of(&self.sketches(), position, tile);
        let blocks = self.blocks.in_tile(tile);
        let sketched: Vec<Option<(Vec<u8>, T)>> = blocks
            .into_par_iter()
            .map(|extent| {
                if extent.pixels() == 0 {
                    return Ok(None);
                }
                let (sketch, known) = sketch_of(&extent);
                Ok(Some((sketched::to_frame(&sketch)?, known)))
            })
            .collect::<io::Result<_>>()
            .map_err(|source| FieldError::Write { path: path.clone(), source })?;
        let (frames, known): (Vec<_>, Vec<_>) = sketched
            .into_iter()
            .map(|sketched| sketched.map_or((None, None), |(frame, known)| (Some(frame), Some(known))))
            .unzip();
        sketched::write(&path, &frames)?;
        Ok(known.into_iter().flatten().collect())
    }

    /// Packs and writes a block from the sketches that [`FieldWriter::write_sketches`] kept of all positions.
    ///
    /// # Errors
    /// If a sketch is not there or damaged, or the block cannot be written.
    pub fn pack_sketched(&self, block: [usize; 2]) -> Result<BlockRecord, FieldError> {
        let (tile, [row, column]) = self.blocks.tile_of(block);
        let [down, across] = self.blocks.blocks_per_tile();
        let sketches = (0..self.cells.positions())
            .map(|position| {
                let path = sketched::path_of(&self.sketches(), position, tile);
                sketched::read(&path, down * across, row * across + column)
            })
            .collect::<Result<Vec<Sketch>, FieldError>>()?;
        self.write_packed(block, &sketches)
    }

    fn sketches(&self) -> PathBuf {
        self.partial.join("sketches")
    }

    /// The records of all packed blocks, row-major.
    pub(super) fn block_records(&self) -> Result<Vec<BlockRecord>, FieldError> {
        self.all_blocks()
            .map(|block| {
                let folder = store::folder_of(&self.field, block);
                store::record(&folder).ok_or_else(|| {
                    let source = io::Error::other("the block is not done");
                    FieldError::Write { path: folder, source }
                })
            })
            .collect()
    }
}
