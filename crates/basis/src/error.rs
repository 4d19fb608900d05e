//! What can be wrong with a description of positions and squares.

use crate::spherical::SphericalError;

/// A geometry that cannot be: the message names the value, what was expected and what came.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BasisError {
    /// A value outside its range.
    #[error("{name} must be {expected}, but is {found}")]
    OutOfRange {
        /// The value's name, as the files spell it.
        name: &'static str,
        /// The range in words.
        expected: &'static str,
        /// What came.
        found: String,
    },
    /// The positions do not divide the hemisphere.
    #[error("the positions do not divide the hemisphere: {0}")]
    Positions(#[from] SphericalError),
    /// A mosaic of another shape than the cells.
    #[error(
        "a mosaic for these cells has {expected_width} × {expected_height} pixels ({columns} × {rows} positions of \
         {squares} × {squares} squares), but this one has {width} × {height}"
    )]
    MosaicShape {
        /// Pixels across that the cells need.
        expected_width: usize,
        /// Pixels down that the cells need.
        expected_height: usize,
        /// Positions across.
        columns: usize,
        /// Positions down.
        rows: usize,
        /// M, squares a side.
        squares: usize,
        /// Pixels across that came.
        width: usize,
        /// Pixels down that came.
        height: usize,
    },
}
