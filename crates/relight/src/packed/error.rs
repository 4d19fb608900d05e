//! Why packed blocks cannot be relit.

/// Why packed blocks cannot be held or relit.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PackedError {
    /// A field of halves.
    #[error("the field is not packed: `relumine pack` does that")]
    NotPacked,
    /// A light for other cells.
    #[error("the light has {found} coefficients, but the field has {expected} cells")]
    OtherCells {
        /// Cells of the field.
        expected: usize,
        /// Coefficients of the light.
        found: usize,
    },
    /// A lit position whose atoms were not read.
    #[error("the atoms of position {position} were not read")]
    Unread {
        /// The first such position.
        position: usize,
    },
    /// Another number of positions than the field has.
    #[error("a block has atoms of {found} positions, but the field has {expected}")]
    Positions {
        /// Positions of the field.
        expected: usize,
        /// Positions of the block.
        found: usize,
    },
    /// A block whose parts do not fit each other.
    #[error("a block of {patches} patches and rank {rank} has {basis} values of bases and {steps} steps")]
    Shape {
        /// Its patches.
        patches: usize,
        /// Components of its longest basis.
        rank: usize,
        /// Values of its bases.
        basis: usize,
        /// Its steps.
        steps: usize,
    },
    /// An atom of a square that the pattern has not.
    #[error("an atom of square {id}, but squares and groups are {ids}")]
    NoSuchSquare {
        /// Of the atom.
        id: usize,
        /// Squares and groups.
        ids: usize,
    },
    /// More than the layout in memory can count.
    #[error("a block has {found} {what}, at most {most} can be held")]
    TooMany {
        /// What there is too much of.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many there may be.
        most: usize,
    },
    /// A block outside the picture, or on pixels of another.
    #[error("the block at column {column}, row {row} lies outside the picture or over another block")]
    Misplaced {
        /// Its first column.
        column: usize,
        /// Its first row.
        row: usize,
    },
}
