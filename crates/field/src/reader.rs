//! Reading a field.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use relumine_basis::{Cell, Cells};
use relumine_radiometry::files::MAX_PIXELS;
use relumine_radiometry::{Image, Transfer, read_bounded};
use serde::Deserialize;

use half::f16;

use crate::packed::{BlockRecord, Groups, PackedBlock, store};
use crate::writer::shard_path;
use crate::{BlockBuffer, Blocks, Damage, FieldError, Header, Lamps, PositionRecord, Shard, manifest, zarr};

/// A reflectance field on disk, open for reading.
pub struct ReflectanceField {
    path: PathBuf,
    header: Header,
    cells: Cells,
    records: Vec<PositionRecord>,
    /// Cell indices that were not photographed.
    missing: HashSet<usize>,
    /// Of a packed field: its blocks, row-major.
    packed: Vec<BlockRecord>,
}

#[derive(Deserialize)]
struct Group {
    attributes: Attributes,
}

#[derive(Deserialize)]
struct Attributes {
    relumine: Header,
    positions: Vec<PositionRecord>,
    #[serde(default)]
    blocks: Vec<BlockRecord>,
}

impl ReflectanceField {
    /// The most pixels a side of a picture.
    const MAX_SIDE: usize = 65_536;

    /// Opens the field at `path`: reads its metadata, which must be what was written, and none of its transfers.
    ///
    /// # Errors
    /// If there is no field of this version, or its metadata are damaged or contradict themselves.
    pub fn open(path: &Path) -> Result<Self, FieldError> {
        let group_path = path.join("zarr.json");
        let not_a_field = |reason: String| FieldError::NotAField { path: path.to_path_buf(), reason };
        let text = read_metadata(&group_path)?;
        let group: Group = serde_json::from_str(&text)
            .map_err(|error| FieldError::NotAField { path: group_path.clone(), reason: error.to_string() })?;
        let Attributes { relumine: header, positions: records, blocks: packed } = group.attributes;
        if header.format != Header::FORMAT {
            return Err(not_a_field(format!("expected format \"{}\", found \"{}\"", Header::FORMAT, header.format)));
        }
        // It is a field of this version: from here on every byte must be what was written.
        let listed = manifest::read(path)?;
        listed.check(path, "zarr.json", &text)?;
        let [width, height] = header.picture;
        let side = 1..=Self::MAX_SIDE;
        if !side.contains(&width) || !side.contains(&height) || width * height > MAX_PIXELS {
            return Err(not_a_field(format!("a picture of {width} × {height} pixels")));
        }
        let cells = header.cells().map_err(|source| FieldError::Geometry { path: group_path, source })?;
        let m2 = cells.squares() * cells.squares();
        if records.len() != cells.positions() {
            return Err(not_a_field(format!("{} positions, but {} records", cells.positions(), records.len())));
        }
        let mut missing = HashSet::new();
        for (index, record) in records.iter().enumerate() {
            if record.position != index || !(record.scale > 0.0 && record.scale.is_finite()) {
                return Err(not_a_field(format!("the record of position {index} cannot be")));
            }
            for cell in &record.missing {
                if *cell >= m2 {
                    return Err(not_a_field(format!("position {index} misses a cell it does not have: {cell}")));
                }
                missing.insert(index * m2 + cell);
            }
        }
        if let Lamps::Distant { irradiance } = &header.lamps
            && irradiance.len() != cells.positions()
        {
            return Err(not_a_field(format!("{} positions, but {} lamps", cells.positions(), irradiance.len())));
        }
        if header.packing.is_some() {
            let [down, across] = header.blocks().grid();
            if packed.len() != down * across {
                return Err(not_a_field(format!("{} blocks, but {} records", down * across, packed.len())));
            }
            if let Some(block) = packed.iter().find(|block| !block.is_possible()) {
                return Err(not_a_field(format!("a block of rank {} and {} bytes", block.rank, block.bytes)));
            }
            return Ok(Self { path: path.to_path_buf(), header, cells, records, missing, packed });
        }
        // The array must be cut as this version cuts it: nothing else in its metadata is ours to interpret.
        let array = format!("{}/zarr.json", zarr::TRANSFER);
        let array_path = path.join(&array);
        let text = read_metadata(&array_path)?;
        listed.check(path, &array, &text)?;
        let found: serde_json::Value = serde_json::from_str(&text)
            .map_err(|error| FieldError::NotAField { path: array_path.clone(), reason: error.to_string() })?;
        if found != zarr::transfer(&header) {
            let reason = "the array is cut or coded in another way than this version does".into();
            return Err(FieldError::NotAField { path: array_path, reason });
        }
        Ok(Self { path: path.to_path_buf(), header, cells, records, missing, packed: Vec::new() })
    }

    /// Where it lies.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What it is.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// Its cells.
    pub fn cells(&self) -> &Cells {
        &self.cells
    }

    /// How each position was made.
    pub fn records(&self) -> &[PositionRecord] {
        &self.records
    }

    /// Pixels of every basis picture, `(width, height)`.
    pub fn picture_size(&self) -> (usize, usize) {
        let [width, height] = self.header.picture;
        (width, height)
    }

    /// How the pictures are cut.
    pub fn blocks(&self) -> Blocks {
        self.header.blocks()
    }

    /// What a stored half of a position is multiplied with to be a transfer.
    pub fn scale(&self, position: usize) -> f32 {
        self.records[position].scale
    }

    /// Whether a cell was not photographed: the field says nothing about it.
    pub fn is_missing(&self, cell: usize) -> bool {
        self.missing.contains(&cell)
    }

    /// Opens one tile of one position; `at_once` reads all its blocks now.
    ///
    /// # Errors
    /// If it cannot be read or its index is damaged.
    pub fn shard(&self, position: usize, tile: [usize; 2], at_once: bool) -> Result<Shard, FieldError> {
        let squares = self.cells.squares() * self.cells.squares();
        Shard::open(&shard_path(&self.path, position, tile), self.blocks(), squares, at_once)
    }

    /// Whether it is packed: then [`ReflectanceField::packed_block`] reads it, otherwise [`ReflectanceField::shard`].
    pub fn is_packed(&self) -> bool {
        self.header.packing.is_some()
    }

    /// The records of a packed field's blocks, row-major.
    pub fn block_records(&self) -> &[BlockRecord] {
        &self.packed
    }

    /// Reads a block of a packed field: its bases, and the atoms of positions that are `wanted`.
    ///
    /// # Errors
    /// If it cannot be read or is damaged.
    ///
    /// # Panics
    /// If the field is not packed or has no such block.
    pub fn packed_block(&self, block: [usize; 2], wanted: impl Fn(usize) -> bool) -> Result<PackedBlock, FieldError> {
        let record = &self.packed[block[0] * self.blocks().grid()[1] + block[1]];
        let extent = self.blocks().block_extent(block);
        let (squares, positions) = (self.cells.squares(), self.cells.positions());
        store::read(&store::folder_of(&self.path, block), record, extent, squares, positions, wanted)
    }

    /// All squares of a position in one block, in units of its scale: `[square][channel][row][column]`
    /// of the block's own pixels, into `values`.
    ///
    /// # Errors
    /// If it cannot be read or is damaged.
    pub fn squares_of_block(
        &self,
        position: usize,
        block: [usize; 2],
        buffer: &mut BlockBuffer,
        values: &mut Vec<f16>,
    ) -> Result<(), FieldError> {
        let blocks = self.blocks();
        let extent = blocks.block_extent(block);
        let m2 = self.cells.squares() * self.cells.squares();
        values.clear();
        values.resize(m2 * 3 * extent.pixels(), f16::ZERO);
        if self.is_packed() {
            let groups = Groups::new(self.cells.squares());
            self.packed_block(block, |wanted| wanted == position)?.decode(
                position,
                &groups,
                self.scale(position),
                values,
            );
            return Ok(());
        }
        let (tile, inner) = blocks.tile_of(block);
        let shard = self.shard(position, tile, false)?;
        let [height, width] = blocks.block();
        for (square, values) in values.chunks_exact_mut(3 * extent.pixels()).enumerate() {
            if !shard.block(square, inner, buffer)? {
                continue;
            }
            let planes = values.chunks_exact_mut(extent.pixels()).zip(buffer.values().chunks_exact(height * width));
            for (to, from) in planes {
                for (to, from) in to.chunks_exact_mut(extent.columns.len()).zip(from.chunks_exact(width)) {
                    to.copy_from_slice(&from[..to.len()]);
                }
            }
        }
        Ok(())
    }

    /// In how many photographs of a position each pixel is clipped, row-major.
    ///
    /// # Errors
    /// If it cannot be read or is damaged.
    pub fn clipped(&self, position: usize) -> Result<Vec<u8>, FieldError> {
        let (width, height) = self.picture_size();
        let path = self.path.join(format!("{}/c/{position}/0/0", zarr::CLIPPED));
        if path.exists() { store::decompress_file(&path, width * height) } else { Ok(vec![0; width * height]) }
    }

    /// The transfer Rᵢ of one cell as a picture.
    ///
    /// # Errors
    /// If it cannot be read or is damaged.
    pub fn transfer(&self, cell: usize) -> Result<Image<Transfer>, FieldError> {
        if self.is_packed() { self.packed_transfer(cell) } else { self.transfer_of_halves(cell) }
    }

    fn packed_transfer(&self, cell: usize) -> Result<Image<Transfer>, FieldError> {
        let (width, height) = self.picture_size();
        let Cell { position, u, v } = self.cells.cell(cell);
        let m = self.cells.squares();
        let mut weights = vec![[0.0; 3]; m * m];
        weights[v * m + u] = [1.0; 3];
        let mut picture = Image::black(width, height);
        let [down, across] = self.blocks().grid();
        for block in (0..down).flat_map(|row| (0..across).map(move |column| [row, column])) {
            let block = self.packed_block(block, |wanted| wanted == position)?;
            let mut values = vec![0.0f64; 3 * block.extent.pixels()];
            block.add_weighted(position, &Groups::new(m), &weights, &mut values);
            for (index, value) in values.into_iter().enumerate() {
                let (channel, pixel) = (index / block.extent.pixels(), index % block.extent.pixels());
                let y = block.extent.rows.start + pixel / block.extent.columns.len();
                let x = block.extent.columns.start + pixel % block.extent.columns.len();
                picture.pixels_mut()[y * width + x][channel] = value as f32;
            }
        }
        Ok(picture)
    }

    fn transfer_of_halves(&self, cell: usize) -> Result<Image<Transfer>, FieldError> {
        let (width, height) = self.picture_size();
        let Cell { position, u, v } = self.cells.cell(cell);
        let square = v * self.cells.squares() + u;
        let blocks = self.blocks();
        let mut buffer =
            BlockBuffer::new(&blocks).map_err(|source| FieldError::Read { path: self.path.clone(), source })?;
        let mut picture = Image::black(width, height);
        let ([block_height, block_width], [down, across]) = (blocks.block(), blocks.blocks_per_tile());
        for tile in blocks.all_tiles() {
            let shard = self.shard(position, tile, false)?;
            let extent = blocks.tile_extent(tile);
            for block in (0..down).flat_map(|j| (0..across).map(move |i| [j, i])) {
                let inner = blocks.block_in_tile(&extent, block);
                if inner.pixels() == 0 || !shard.block(square, block, &mut buffer)? {
                    continue;
                }
                for (row, y) in inner.rows.clone().enumerate() {
                    for (column, x) in inner.columns.clone().enumerate() {
                        let value = |channel: usize| {
                            let half = buffer.values()[(channel * block_height + row) * block_width + column];
                            half.to_f32() * self.scale(position)
                        };
                        let pixel = (extent.rows.start + y) * width + extent.columns.start + x;
                        picture.pixels_mut()[pixel] = [value(0), value(1), value(2)];
                    }
                }
            }
        }
        Ok(picture)
    }

    /// A name for its contents: the digest of the list of its files' digests, in hexadecimal.
    ///
    /// # Errors
    /// If the list cannot be read.
    pub fn digest(&self) -> Result<String, FieldError> {
        let path = self.path.join(manifest::NAME);
        let list = std::fs::read(&path).map_err(|source| FieldError::Read { path, source })?;
        Ok(blake3::hash(&list).to_hex().to_string())
    }

    /// Holds every file against its digest: an empty list means that the field is whole.
    ///
    /// # Errors
    /// If the list of digests cannot be read.
    pub fn verify(&self) -> Result<Vec<Damage>, FieldError> {
        manifest::verify(&self.path)
    }
}

fn read_metadata(path: &Path) -> Result<String, FieldError> {
    read_bounded(path, manifest::MAX_BYTES).map_err(|source| FieldError::Read { path: path.to_path_buf(), source })
}
