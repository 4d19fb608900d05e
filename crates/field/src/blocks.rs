//! How a picture is cut: into blocks, the unit that is compressed, and tiles of blocks, the unit that is a file.

use std::ops::Range;

/// A rectangle of pixels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Extent {
    /// Columns of the picture.
    pub columns: Range<usize>,
    /// Rows of the picture.
    pub rows: Range<usize>,
}

impl Extent {
    /// Pixels in it.
    pub fn pixels(&self) -> usize {
        self.columns.len() * self.rows.len()
    }
}

/// The cut of a picture into blocks of at most 64 × 64 pixels and tiles of at most 4 × 4 blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Blocks {
    /// Pixels of the picture, `[height, width]`.
    picture: [usize; 2],
    /// Pixels of a block, `[height, width]`.
    block: [usize; 2],
    /// Blocks of a tile, `[down, across]`.
    tile: [usize; 2],
}

impl Blocks {
    const LONGEST_SIDE: usize = 64;
    const MOST_A_TILE: usize = 4;

    /// Cuts a picture of `width` × `height` pixels so that blocks overhang its border as little as may be.
    pub fn of_picture(width: usize, height: usize) -> Self {
        let cut = |length: usize| {
            let blocks = length.div_ceil(Self::LONGEST_SIDE);
            (length.div_ceil(blocks), blocks.min(Self::MOST_A_TILE))
        };
        let ((block_height, down), (block_width, across)) = (cut(height), cut(width));
        Self { picture: [height, width], block: [block_height, block_width], tile: [down, across] }
    }

    /// Pixels of a block, `[height, width]`; blocks at the right and bottom border may overhang the picture.
    pub fn block(&self) -> [usize; 2] {
        self.block
    }

    /// Pixels of a tile, `[height, width]`.
    pub fn tile(&self) -> [usize; 2] {
        [self.tile[0] * self.block[0], self.tile[1] * self.block[1]]
    }

    /// Blocks of a tile, `[down, across]`.
    pub fn blocks_per_tile(&self) -> [usize; 2] {
        self.tile
    }

    /// Tiles of the picture, `[down, across]`.
    pub fn tiles(&self) -> [usize; 2] {
        let tile = self.tile();
        [self.picture[0].div_ceil(tile[0]), self.picture[1].div_ceil(tile[1])]
    }

    /// Blocks of the whole picture, `[down, across]`, whatever their tile.
    pub fn grid(&self) -> [usize; 2] {
        [self.picture[0].div_ceil(self.block[0]), self.picture[1].div_ceil(self.block[1])]
    }

    /// The pixels of block (row, column) of the whole picture, cut at its border.
    pub fn block_extent(&self, [row, column]: [usize; 2]) -> Extent {
        let cut = |index: usize, side: usize, length: usize| index * side..((index + 1) * side).min(length);
        Extent { columns: cut(column, self.block[1], self.picture[1]), rows: cut(row, self.block[0], self.picture[0]) }
    }

    /// The tile of block (row, column) of the whole picture, and the block within it.
    pub fn tile_of(&self, [row, column]: [usize; 2]) -> ([usize; 2], [usize; 2]) {
        ([row / self.tile[0], column / self.tile[1]], [row % self.tile[0], column % self.tile[1]])
    }

    /// All tiles as (row, column), row-major.
    pub fn all_tiles(&self) -> impl Iterator<Item = [usize; 2]> + use<> {
        let [down, across] = self.tiles();
        (0..down).flat_map(move |row| (0..across).map(move |column| [row, column]))
    }

    /// The pixels of a tile, cut at the picture's border.
    pub fn tile_extent(&self, [row, column]: [usize; 2]) -> Extent {
        let tile = self.tile();
        Extent {
            columns: column * tile[1]..((column + 1) * tile[1]).min(self.picture[1]),
            rows: row * tile[0]..((row + 1) * tile[0]).min(self.picture[0]),
        }
    }

    /// The pixels of every block of a tile, row-major, cut at the picture's border; some may be empty.
    pub fn in_tile(&self, tile: [usize; 2]) -> Vec<Extent> {
        let all = self.tile_extent(tile);
        let [down, across] = self.tile;
        let blocks = (0..down).flat_map(|row| (0..across).map(move |column| [row, column]));
        let moved = |range: Range<usize>, start: usize| range.start + start..range.end + start;
        blocks
            .map(|block| {
                let inner = self.block_in_tile(&all, block);
                Extent { columns: moved(inner.columns, all.columns.start), rows: moved(inner.rows, all.rows.start) }
            })
            .collect()
    }

    /// The pixels of block (row, column) of a tile, relative to the tile's corner, cut at `extent`, the tile's own.
    pub fn block_in_tile(&self, extent: &Extent, [row, column]: [usize; 2]) -> Extent {
        let cut =
            |index: usize, side: usize, length: usize| (index * side).min(length)..((index + 1) * side).min(length);
        Extent {
            columns: cut(column, self.block[1], extent.columns.len()),
            rows: cut(row, self.block[0], extent.rows.len()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_and_blocks_cover_every_pixel_once() {
        for (width, height) in [(1, 1), (144, 96), (64, 64), (65, 300), (1440, 960), (402, 395)] {
            let blocks = Blocks::of_picture(width, height);
            let mut seen = vec![0u8; width * height];
            for tile in blocks.all_tiles() {
                let extent = blocks.tile_extent(tile);
                let [down, across] = blocks.blocks_per_tile();
                for block in (0..down).flat_map(|j| (0..across).map(move |i| [j, i])) {
                    let inner = blocks.block_in_tile(&extent, block);
                    for y in inner.rows {
                        for x in inner.columns.clone() {
                            seen[(extent.rows.start + y) * width + extent.columns.start + x] += 1;
                        }
                    }
                }
            }
            assert!(seen.iter().all(|times| *times == 1), "{width} × {height}");
            let [block_height, block_width] = blocks.block();
            let padded = height.next_multiple_of(block_height) * width.next_multiple_of(block_width);
            assert!(padded as f64 <= (width * height) as f64 * 1.1, "{width} × {height} is padded to {padded}");
        }
    }
}
