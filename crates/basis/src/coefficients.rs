//! The light on the cells: lᵢ of eq. 4, one linear RGB radiance a cell, and its picture, the mosaic of fig. 9.

use crate::BasisError;

/// Coefficients lᵢ, linear RGB radiance [W·m⁻²·sr⁻¹], in the order of the cell index.
#[derive(Clone, Debug, PartialEq)]
pub struct Coefficients {
    squares: usize,
    columns: usize,
    rows: usize,
    values: Vec<[f32; 3]>,
}

impl Coefficients {
    /// No light, for `columns` × `rows` positions of `squares` × `squares` squares.
    pub fn dark(squares: usize, columns: usize, rows: usize) -> Self {
        Self { squares, columns, rows, values: vec![[0.0; 3]; squares * squares * columns * rows] }
    }

    /// The values by cell index.
    pub fn values(&self) -> &[[f32; 3]] {
        &self.values
    }

    /// The values by cell index, to change.
    pub fn values_mut(&mut self) -> &mut [[f32; 3]] {
        &mut self.values
    }

    /// M, squares a side.
    pub fn squares(&self) -> usize {
        self.squares
    }

    /// Width and height of the mosaic, pixels.
    pub fn mosaic_size(&self) -> (usize, usize) {
        (self.columns * self.squares, self.rows * self.squares)
    }

    /// The index of the cell at pixel (x, y) of the mosaic.
    fn cell_at(&self, x: usize, y: usize) -> usize {
        let m = self.squares;
        let position = (y / m) * self.columns + x / m;
        (position * m + y % m) * m + x % m
    }

    /// The mosaic: the square at column i, row j is position (i, j), its pixel (u, v) the coefficient of that cell.
    /// Row-major from the top.
    pub fn to_mosaic(&self) -> Vec<[f32; 3]> {
        let (width, height) = self.mosaic_size();
        (0..height).flat_map(|y| (0..width).map(move |x| self.values[self.cell_at(x, y)])).collect()
    }

    /// Replaces the values by those of a mosaic of `width` × `height` pixels.
    ///
    /// # Errors
    /// If the mosaic has another shape than these cells.
    pub fn set_mosaic(&mut self, width: usize, height: usize, pixels: &[[f32; 3]]) -> Result<(), BasisError> {
        let (expected_width, expected_height) = self.mosaic_size();
        if (width, height) != (expected_width, expected_height) || pixels.len() != width * height {
            return Err(BasisError::MosaicShape {
                expected_width,
                expected_height,
                columns: self.columns,
                rows: self.rows,
                squares: self.squares,
                width,
                height,
            });
        }
        for y in 0..height {
            for x in 0..width {
                let cell = self.cell_at(x, y);
                self.values[cell] = pixels[y * width + x];
            }
        }
        Ok(())
    }

    /// Whether no cell of position `p` is lit.
    pub fn is_position_dark(&self, p: usize) -> bool {
        let m2 = self.squares * self.squares;
        self.values[p * m2..(p + 1) * m2].iter().all(|value| *value == [0.0; 3])
    }
}
