//! A picture shared out to its blocks.

use relumine_radiometry::{Image, Radiance};

use crate::packed::{PackedError, ResidentBlock};

/// Which blocks lie on each row of a picture, from the left.
#[derive(Clone, Debug)]
pub(crate) struct Rows(Vec<Vec<u32>>);

impl Rows {
    /// Of a picture of `width` × `height` pixels.
    ///
    /// # Errors
    /// If a block lies outside the picture or over another.
    pub(crate) fn new(width: usize, height: usize, blocks: &[ResidentBlock]) -> Result<Self, PackedError> {
        let misplaced = |block: &ResidentBlock| PackedError::Misplaced {
            column: block.extent().columns.start,
            row: block.extent().rows.start,
        };
        let mut rows = vec![Vec::new(); height];
        let mut order: Vec<usize> = (0..blocks.len()).collect();
        order.sort_by_key(|index| blocks[*index].extent().columns.start);
        for index in order {
            let block = &blocks[index];
            let extent = block.extent();
            if extent.columns.end > width || extent.rows.end > height {
                return Err(misplaced(block));
            }
            for row in &mut rows[extent.rows.clone()] {
                let left = row.last().map_or(0, |left: &u32| blocks[*left as usize].extent().columns.end);
                if extent.columns.start < left {
                    return Err(misplaced(block));
                }
                row.push(index as u32);
            }
        }
        Ok(Self(rows))
    }

    /// The rows of each block.
    pub(crate) fn share_out<'a>(
        &self,
        picture: &'a mut Image<Radiance>,
        blocks: &[ResidentBlock],
    ) -> Vec<Vec<&'a mut [[f32; 3]]>> {
        let width = picture.width();
        let mut shares: Vec<Vec<_>> =
            blocks.iter().map(|block| Vec::with_capacity(block.extent().rows.len())).collect();
        for (row, pixels) in self.0.iter().zip(picture.pixels_mut().chunks_exact_mut(width.max(1))) {
            let (mut rest, mut left) = (pixels, 0);
            for index in row {
                let columns = &blocks[*index as usize].extent().columns;
                let (mine, after) = rest.split_at_mut(columns.end - left);
                shares[*index as usize].push(&mut mine[columns.start - left..]);
                rest = after;
                left = columns.end;
            }
        }
        shares
    }
}
