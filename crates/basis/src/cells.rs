//! Cells Ωᵢ: the index, the measure, and which cell a ray belongs to.

use glam::DVec3;

use crate::{BasisError, Coefficients, Partition, Pattern, Position};

/// One cell Ωᵢ: a position and a square of its pattern.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cell {
    /// Index of the position.
    pub position: usize,
    /// Column of the square, rightward as the projector sees the object.
    pub u: usize,
    /// Row of the square, downward as the projector sees the object.
    pub v: usize,
}

/// How far away the hemisphere stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reach {
    /// A projector on a hemisphere of finite radius throws a pattern: light varies with position and direction.
    Near {
        /// Radius of the hemisphere, metres.
        radius_m: f64,
        /// The squares of the pattern.
        pattern: Pattern,
    },
    /// Lamps at infinity: each position is one cell, every point of the object sees the same light.
    Far,
}

/// Where a ray enters the hemisphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Entry {
    /// Through square (u, v) as seen by a projector that would stand at the point of entry.
    Square {
        /// The unit direction from the origin to the point of entry.
        outward: DVec3,
        /// Column of the square.
        u: usize,
        /// Row of the square.
        v: usize,
    },
    /// From below the horizon: no position shines from there.
    BelowHorizon,
    /// Outside the pattern's cone.
    OutsidePattern,
    /// The ray does not meet the hemisphere's sphere at all.
    Misses,
}

/// All cells of a capture or field: positions × squares.
pub struct Cells {
    partition: Partition,
    reach: Reach,
}

impl Cells {
    /// The most cells: a thousand times the paper's 57,344, and a bound for input from outside.
    pub const MAX: usize = 1 << 26;

    /// The cells of `partition` with a hemisphere at `reach`.
    ///
    /// # Errors
    /// If the radius is not between a micrometre and a thousand kilometres, or there are more than 2²⁶ cells.
    pub fn new(partition: Partition, reach: Reach) -> Result<Self, BasisError> {
        if let Reach::Near { radius_m, .. } = reach
            && !(1e-6..=1e6).contains(&radius_m)
        {
            return Err(BasisError::OutOfRange {
                name: "radius_m",
                expected: "0.000001 to 1000000 metres",
                found: radius_m.to_string(),
            });
        }
        let cells = Self { partition, reach };
        if cells.len() > Self::MAX {
            return Err(BasisError::OutOfRange {
                name: "positions × squares²",
                expected: "at most 67108864 cells",
                found: cells.len().to_string(),
            });
        }
        Ok(cells)
    }

    /// The hemisphere's patches.
    pub fn partition(&self) -> &Partition {
        &self.partition
    }

    /// How far away the hemisphere stands.
    pub fn reach(&self) -> Reach {
        self.reach
    }

    /// M, squares a side of the pattern; 1 for far fields.
    pub fn squares(&self) -> usize {
        match self.reach {
            Reach::Near { pattern, .. } => pattern.squares(),
            Reach::Far => 1,
        }
    }

    /// Number of positions.
    pub fn positions(&self) -> usize {
        self.partition.positions().len()
    }

    /// Number of cells, N.
    pub fn len(&self) -> usize {
        self.positions() * self.squares() * self.squares()
    }

    /// Never: there is always a position.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Index of a cell, i = (p · M + v) · M + u.
    pub fn index(&self, cell: Cell) -> usize {
        let m = self.squares();
        debug_assert!(cell.position < self.positions() && cell.u < m && cell.v < m);
        (cell.position * m + cell.v) * m + cell.u
    }

    /// The cell of an index.
    pub fn cell(&self, index: usize) -> Cell {
        let m = self.squares();
        Cell { position: index / (m * m), u: index % m, v: index / m % m }
    }

    /// |Ωᵢ|: for a hemisphere of finite radius ∫ dA ∫ cosθa dω, m²·sr; for far fields the patch's solid angle, sr.
    pub fn measure(&self, index: usize) -> f64 {
        let Cell { position, u, v } = self.cell(index);
        let solid_angle = self.partition.solid_angle(position);
        match self.reach {
            Reach::Near { radius_m, pattern } => {
                radius_m * radius_m * solid_angle * pattern.projected_solid_angle(u, v)
            }
            Reach::Far => solid_angle,
        }
    }

    /// Radius of the largest ball at the origin that every pattern covers, R·sin(atan h), metres; infinite for far fields.
    pub fn covered_radius_m(&self) -> f64 {
        match self.reach {
            Reach::Near { radius_m, pattern } => radius_m * pattern.half_width().atan().sin(),
            Reach::Far => f64::INFINITY,
        }
    }

    /// Radius of the ball at the origin that every ray of every cell meets: the pattern's corners graze it, metres.
    pub fn reached_radius_m(&self) -> f64 {
        match self.reach {
            Reach::Near { radius_m, pattern } => {
                radius_m * (std::f64::consts::SQRT_2 * pattern.half_width()).atan().sin()
            }
            Reach::Far => f64::INFINITY,
        }
    }

    /// Where the line through `point` in `direction` (unit, the way light travels) enters the hemisphere. A lamp inside
    /// is followed back along the line, as if its light had come through the hemisphere.
    ///
    /// Far fields are entered from `−direction`, wherever `point` is.
    pub fn entry(&self, point: DVec3, direction: DVec3) -> Entry {
        let outward = match self.reach {
            Reach::Far => -direction,
            Reach::Near { radius_m, .. } => {
                // From the foot of the perpendicular, where far points have lost no digits, back to the way in.
                let foot = point.reject_from_normalized(direction);
                let squared = radius_m * radius_m - foot.length_squared();
                if squared < 0.0 {
                    return Entry::Misses;
                }
                (foot - direction * squared.sqrt()) / radius_m
            }
        };
        if outward.z < 0.0 {
            return Entry::BelowHorizon;
        }
        match self.square_seen(outward, direction) {
            Some((u, v)) => Entry::Square { outward, u, v },
            None => Entry::OutsidePattern,
        }
    }

    /// The square that light in `direction` falls in, seen from a projector at `outward`.
    pub fn square_seen(&self, outward: DVec3, direction: DVec3) -> Option<(usize, usize)> {
        match self.reach {
            Reach::Far => Some((0, 0)),
            Reach::Near { pattern, .. } => {
                let (s, t) = Position::from_direction(outward).frame().projector_from_world(direction)?;
                pattern.square_at(s, t)
            }
        }
    }

    /// Coefficients of zero for every cell.
    pub fn dark(&self) -> Coefficients {
        let (columns, rows) = self.partition.mosaic_shape();
        Coefficients::dark(self.squares(), columns, rows)
    }
}
