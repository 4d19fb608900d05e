//! The hemisphere cut into patches, one a position, and what lies between positions.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::DVec3;

use crate::spherical::{self, Triangulation, VoronoiRegion};
use crate::{BasisError, Position};

/// How the positions are laid out.
#[derive(Clone, Debug, PartialEq)]
pub enum Layout {
    /// The regular partition: position (i, j) at azimuth (i + ½)·360°/azimuths, tilt (j + ½)·90°/tilts, index
    /// j · azimuths + i.
    Grid {
        /// Positions round the zenith.
        azimuths: usize,
        /// Rings from zenith to horizon.
        tilts: usize,
    },
    /// Any list of positions; patches are spherical Voronoi regions cut at the horizon.
    List(Vec<Position>),
}

/// Which positions share a ray, and how much each gets: up to four, weights ≥ 0 that add to one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Between {
    shares: [(usize, f64); 4],
    len: usize,
}

impl Between {
    fn new() -> Self {
        Self { shares: [(0, 0.0); 4], len: 0 }
    }

    /// All to one position.
    pub fn only(position: usize) -> Self {
        let mut all = Self::new();
        all.push(position, 1.0);
        all
    }

    fn push(&mut self, position: usize, weight: f64) {
        if weight > 0.0 {
            self.shares[self.len] = (position, weight);
            self.len += 1;
        }
    }

    /// `(position, weight)`, weights positive.
    pub fn shares(&self) -> &[(usize, f64)] {
        &self.shares[..self.len]
    }
}

enum Patches {
    Grid { azimuths: usize, tilts: usize },
    Voronoi { triangulation: Box<Triangulation>, regions: Vec<VoronoiRegion> },
}

/// The upper hemisphere divided among positions: patches that do not overlap and leave nothing out (eq. 2).
pub struct Partition {
    layout: Layout,
    positions: Vec<Position>,
    solid_angles: Vec<f64>,
    patches: Patches,
}

impl Partition {
    /// The most positions: a bound for input from outside.
    pub const MAX_POSITIONS: usize = 1 << 16;
    /// The most positions of a list, whose patches are computed pair by pair.
    pub const MAX_LISTED: usize = 4096;

    /// Divides the hemisphere among the positions of `layout`.
    ///
    /// # Errors
    /// If there is no position or there are too many, a tilt is outside 0–90°, or two positions of a list coincide.
    pub fn new(layout: Layout) -> Result<Self, BasisError> {
        match layout {
            Layout::Grid { azimuths, tilts } => Self::grid(azimuths, tilts),
            Layout::List(positions) => Self::list(positions),
        }
    }

    fn grid(azimuths: usize, tilts: usize) -> Result<Self, BasisError> {
        let count = azimuths.saturating_mul(tilts);
        if !(1..=Self::MAX_POSITIONS).contains(&count) {
            return Err(BasisError::OutOfRange {
                name: "azimuths × tilts",
                expected: "1 to 65536 positions",
                found: format!("{azimuths} × {tilts}"),
            });
        }
        let delta_azimuth = TAU / azimuths as f64;
        let delta_tilt = FRAC_PI_2 / tilts as f64;
        let mut positions = Vec::with_capacity(count);
        let mut solid_angles = Vec::with_capacity(count);
        for j in 0..tilts {
            // The band between two tilts has the height of its slice: Archimedes' hat box.
            let band = (j as f64 * delta_tilt).cos() - ((j + 1) as f64 * delta_tilt).cos();
            for i in 0..azimuths {
                positions
                    .push(Position { azimuth: (i as f64 + 0.5) * delta_azimuth, tilt: (j as f64 + 0.5) * delta_tilt });
                solid_angles.push(delta_azimuth * band);
            }
        }
        Ok(Self {
            layout: Layout::Grid { azimuths, tilts },
            positions,
            solid_angles,
            patches: Patches::Grid { azimuths, tilts },
        })
    }

    fn list(positions: Vec<Position>) -> Result<Self, BasisError> {
        if !(1..=Self::MAX_LISTED).contains(&positions.len()) {
            return Err(BasisError::OutOfRange {
                name: "positions_deg",
                expected: "a list of 1 to 4096 positions",
                found: format!("{} positions", positions.len()),
            });
        }
        for position in &positions {
            if !(position.azimuth.is_finite() && position.is_above_horizon()) {
                return Err(BasisError::OutOfRange {
                    name: "positions_deg",
                    expected: "[azimuth, tilt] with a tilt of 0 to 90 degrees",
                    found: format!("[{}, {}]", position.azimuth.to_degrees(), position.tilt.to_degrees()),
                });
            }
        }
        let sites: Vec<DVec3> = positions.iter().map(|position| position.direction()).collect();
        let regions = spherical::hemisphere_voronoi(&sites)?;
        let triangulation = Box::new(Triangulation::new(&sites)?);
        Ok(Self {
            solid_angles: regions.iter().map(VoronoiRegion::area).collect(),
            layout: Layout::List(positions.clone()),
            positions,
            patches: Patches::Voronoi { triangulation, regions },
        })
    }

    /// How the positions are laid out.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// The positions, by index.
    pub fn positions(&self) -> &[Position] {
        &self.positions
    }

    /// Solid angle of the patch of position `p` seen from the origin, sr; all patches add to 2π.
    pub fn solid_angle(&self, p: usize) -> f64 {
        self.solid_angles[p]
    }

    /// Columns and rows of positions in a mosaic (fig. 9).
    pub fn mosaic_shape(&self) -> (usize, usize) {
        match self.layout {
            Layout::Grid { azimuths, tilts } => (azimuths, tilts),
            Layout::List(_) => (self.positions.len(), 1),
        }
    }

    /// The position whose patch holds `direction` (from the origin, unit, on the upper hemisphere).
    pub fn owner(&self, direction: DVec3) -> usize {
        match &self.patches {
            Patches::Grid { azimuths, tilts } => {
                let Position { azimuth, tilt } = Position::from_direction(direction);
                let i = ((azimuth / TAU * *azimuths as f64) as usize).min(azimuths - 1);
                let j = ((tilt / FRAC_PI_2 * *tilts as f64) as usize).min(tilts - 1);
                j * azimuths + i
            }
            Patches::Voronoi { triangulation, .. } => triangulation.nearest(direction),
        }
    }

    /// The positions around `direction` and their shares: bilinear in (φ, θ) between the centres of a grid, wrapped in φ
    /// and clamped in θ; barycentric on the spherical Delaunay triangulation of a list, clamped at its border.
    pub fn between(&self, direction: DVec3) -> Between {
        let mut shares = Between::new();
        match &self.patches {
            Patches::Grid { azimuths, tilts } => {
                let Position { azimuth, tilt } = Position::from_direction(direction);
                let x = azimuth / TAU * *azimuths as f64 - 0.5;
                let y = (tilt / FRAC_PI_2 * *tilts as f64 - 0.5).clamp(0.0, (tilts - 1) as f64);
                let (column, right) = (x.floor(), x - x.floor());
                let (row, below) = (y.floor(), y - y.floor());
                for (dj, wy) in [(0, 1.0 - below), (1, below)] {
                    for (di, wx) in [(0, 1.0 - right), (1, right)] {
                        let i = (column as i64 + di).rem_euclid(*azimuths as i64) as usize;
                        let j = (row as usize + dj).min(tilts - 1);
                        shares.push(j * azimuths + i, wx * wy);
                    }
                }
            }
            Patches::Voronoi { triangulation, .. } => {
                for &(position, weight) in triangulation.weights(direction).as_slice() {
                    shares.push(position, weight);
                }
            }
        }
        shares
    }

    /// A direction in the patch of position `p`, uniform by solid angle for uniform (a, b) in [0, 1)².
    pub fn sample(&self, p: usize, a: f64, b: f64) -> DVec3 {
        match &self.patches {
            Patches::Grid { azimuths, tilts } => {
                let (i, j) = ((p % azimuths) as f64, (p / azimuths) as f64);
                let delta_tilt = FRAC_PI_2 / *tilts as f64;
                let azimuth = (i + a) * TAU / *azimuths as f64;
                let top = (j * delta_tilt).cos();
                let cos_tilt = (top + b * (((j + 1.0) * delta_tilt).cos() - top)).clamp(0.0, 1.0);
                let sin_tilt = (1.0 - cos_tilt * cos_tilt).sqrt();
                DVec3::new(sin_tilt * azimuth.cos(), sin_tilt * azimuth.sin(), cos_tilt)
            }
            Patches::Voronoi { regions, .. } => regions[p].sample(a, b),
        }
    }
}
