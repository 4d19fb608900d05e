//! What a light gives each square and group of squares: one table a position, shared by all blocks.

use std::ops::Range;

use rayon::prelude::*;
use relumine_basis::Coefficients;
use relumine_field::packed::Groups;

use crate::packed::PackedError;

/// Radiance of a square or mean radiance of a group, RGB and one lane that is 0.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(16))]
pub(crate) struct Row(pub(crate) [f32; 4]);

/// The coefficients of a light as its atoms need them: by lit position the radiance [W·m⁻²·sr⁻¹] of each square, then the mean
/// radiance of each group.
#[derive(Clone, Debug)]
pub struct LightWeights {
    squares: usize,
    positions: usize,
    /// Rows a position.
    ids: usize,
    lit: Vec<Lit>,
    /// `[lit position][square, then group]`.
    table: Vec<Row>,
}

/// A position that light comes from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lit {
    pub(crate) position: usize,
    /// Whether some square is dark, so that whole lists may be.
    pub(crate) sparse: bool,
}

impl LightWeights {
    /// Of a light on `positions` × `squares` × `squares` cells.
    ///
    /// # Errors
    /// If the light is for other cells.
    pub fn new(light: &Coefficients, squares: usize, positions: usize) -> Result<Self, PackedError> {
        check_cells(light, squares, positions)?;
        let lit: Vec<usize> = (0..positions).filter(|position| !light.is_position_dark(*position)).collect();
        Ok(Self::of_positions(light, squares, positions, &lit))
    }

    /// Of some positions, lit or not, of a light for the right cells.
    pub(crate) fn of_positions(light: &Coefficients, squares: usize, positions: usize, chosen: &[usize]) -> Self {
        let groups = Groups::new(squares);
        let m2 = squares * squares;
        let ids = m2 + groups.len();
        let group_of: Vec<usize> = (0..m2).map(|square| groups.of(square)).collect();
        let sizes = groups.sizes();
        let mut table = vec![Row::default(); ids * chosen.len()];
        let fill = |(rows, position): (&mut [Row], &usize)| {
            let radiances = &light.values()[position * m2..(position + 1) * m2];
            let mut sums = vec![[0.0f64; 3]; sizes.len()];
            for ((row, group), radiance) in rows.iter_mut().zip(&group_of).zip(radiances) {
                row.0[..3].copy_from_slice(radiance);
                (0..3).for_each(|channel| sums[*group][channel] += f64::from(radiance[channel]));
            }
            for ((row, sum), size) in rows[m2..].iter_mut().zip(&sums).zip(&sizes) {
                (0..3).for_each(|channel| row.0[channel] = (sum[channel] / *size as f64) as f32);
            }
            let sparse = radiances.contains(&[0.0; 3]);
            Lit { position: *position, sparse }
        };
        let lit = table.par_chunks_mut(ids.max(1)).zip(chosen).with_min_len(16).map(fill).collect();
        Self { squares, positions, ids, lit, table }
    }

    /// M, squares a side.
    pub fn squares(&self) -> usize {
        self.squares
    }

    /// Positions of the field, lit or not.
    pub fn positions(&self) -> usize {
        self.positions
    }

    /// The positions that light comes from, in order.
    pub fn lit(&self) -> impl ExactSizeIterator<Item = usize> + '_ {
        self.lit.iter().map(|lit| lit.position)
    }

    /// Some of the lit positions, by their number among these, and their tables.
    pub(crate) fn tables(&self, chosen: Range<usize>) -> impl ExactSizeIterator<Item = (Lit, &[Row])> {
        let rows = &self.table[chosen.start * self.ids..chosen.end * self.ids];
        self.lit[chosen].iter().copied().zip(rows.chunks_exact(self.ids.max(1)))
    }
}

/// Whether a light is for `positions` × `squares` × `squares` cells.
pub(crate) fn check_cells(light: &Coefficients, squares: usize, positions: usize) -> Result<(), PackedError> {
    let (expected, found) = (positions * squares * squares, light.values().len());
    if found != expected || light.squares() != squares {
        return Err(PackedError::OtherCells { expected, found });
    }
    Ok(())
}
