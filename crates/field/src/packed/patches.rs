//! How a block is cut into patches, and squares into groups.

use std::ops::Range;

/// The cut of `height` × `width` pixels into patches of at most 8 × 8, as equal as may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Patches {
    height: usize,
    width: usize,
}

impl Patches {
    /// The most pixels a side of a patch.
    pub const SIDE: usize = 8;

    /// Of a block of `height` × `width` pixels.
    pub fn new(height: usize, width: usize) -> Self {
        Self { height, width }
    }

    /// Pixels of the block, `[height, width]`.
    pub fn block(&self) -> [usize; 2] {
        [self.height, self.width]
    }

    /// Patches `[down, across]`.
    pub fn counts(&self) -> [usize; 2] {
        [self.height.div_ceil(Self::SIDE), self.width.div_ceil(Self::SIDE)]
    }

    /// Number of patches.
    pub fn len(&self) -> usize {
        let [down, across] = self.counts();
        down * across
    }

    /// Whether there is no pixel.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Rows and columns of a patch in its block; patches are row-major.
    pub fn pixels(&self, patch: usize) -> (Range<usize>, Range<usize>) {
        let [down, across] = self.counts();
        let cut = |index: usize, length: usize, parts: usize| index * length / parts..(index + 1) * length / parts;
        (cut(patch / across, self.height, down), cut(patch % across, self.width, across))
    }
}

/// The groups of squares that share what is left: at most 4 × 4 of them, so that each holds about a sixteenth of the pattern.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Groups {
    squares: usize,
    side: usize,
}

impl Groups {
    const A_SIDE: usize = 4;

    /// Of a pattern of `squares` × `squares`.
    pub fn new(squares: usize) -> Self {
        Self { squares, side: squares.div_ceil(Self::A_SIDE).max(1) }
    }

    /// Number of groups.
    pub fn len(&self) -> usize {
        self.across() * self.across()
    }

    /// Whether there are no squares.
    pub fn is_empty(&self) -> bool {
        self.squares == 0
    }

    fn across(&self) -> usize {
        self.squares.div_ceil(self.side)
    }

    /// The group of square v · M + u.
    pub fn of(&self, square: usize) -> usize {
        (square / self.squares / self.side) * self.across() + square % self.squares / self.side
    }

    /// The number of squares of each group.
    pub fn sizes(&self) -> Vec<usize> {
        let mut sizes = vec![0; self.len()];
        (0..self.squares * self.squares).for_each(|square| sizes[self.of(square)] += 1);
        sizes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patches_and_groups_cover_everything_once() {
        for (height, width) in [(1, 1), (60, 64), (7, 9), (64, 63)] {
            let patches = Patches::new(height, width);
            let mut seen = vec![0; height * width];
            for patch in 0..patches.len() {
                let (rows, columns) = patches.pixels(patch);
                assert!(rows.len() <= 8 && columns.len() <= 8 && !rows.is_empty() && !columns.is_empty());
                rows.for_each(|y| columns.clone().for_each(|x| seen[y * width + x] += 1));
            }
            assert!(seen.iter().all(|times| *times == 1));
        }
        for (squares, groups) in [(1, 1), (2, 4), (4, 16), (5, 9), (8, 16), (16, 16), (32, 16)] {
            assert_eq!(Groups::new(squares).len(), groups, "{squares}");
            assert_eq!(Groups::new(squares).sizes().iter().sum::<usize>(), squares * squares);
        }
    }
}
