//! The metadata of a field: its geometry, its units and how it was made.

use relumine_basis::{BasisError, Cells, Layout, Partition, Pattern, Position, Reach};
use serde::{Deserialize, Serialize};

use crate::Blocks;

/// What a field is, as the attribute `relumine` of its Zarr group says it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Header {
    /// Always [`Header::FORMAT`].
    pub format: String,
    /// A title for people.
    pub title: Option<String>,
    /// Pixels of every basis picture, `[width, height]`.
    pub picture: [usize; 2],
    /// Where the projector or the lamps stood.
    pub positions: LayoutRecord,
    /// Whether lamps stood at infinity, or a projector on a hemisphere.
    pub lamps: Lamps,
    /// What the numbers of `transfer` are.
    pub units: String,
    /// How it was made: program, separation, input.
    pub made: serde_json::Value,
    /// How it is packed; halves of every square if not at all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub packing: Option<Packing>,
}

/// How a field is packed ([`crate::packed`]).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Packing {
    /// About what the pictures of squares are off by, patch for patch and root mean square over squares, over what all squares of
    /// one position show there, root mean square over positions; a share, such as 0.01.
    pub error: f64,
}

/// The positions, in degrees.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, untagged)]
pub enum LayoutRecord {
    /// A regular grid.
    Grid {
        /// Positions round the zenith.
        azimuths: usize,
        /// Rings from zenith to horizon.
        tilts: usize,
    },
    /// A list of `[azimuth, tilt]`.
    List {
        /// By index, degrees.
        positions_deg: Vec<[f64; 2]>,
    },
}

/// What lit the object.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, tag = "kind", rename_all = "lowercase")]
pub enum Lamps {
    /// A projector on a hemisphere.
    Projector {
        /// Radius of the hemisphere, metres.
        radius_m: f64,
        /// M, squares a side.
        squares: usize,
        /// Tangent of half the pattern's angle.
        half_width: f64,
    },
    /// Lamps at infinity, one cell a position.
    Distant {
        /// Irradiance Eᵢ of each lamp, RGB, W·m⁻²: the field is already divided by it.
        irradiance: Vec<[f64; 3]>,
    },
}

impl Packing {
    /// The most squares a side: squares and groups are numbered in 16 bits.
    pub const MOST_SQUARES: usize = 255;
}

impl Header {
    /// The `format` of this version.
    pub const FORMAT: &'static str = "relumine-field/1";
    /// The value of [`Header::units`].
    pub const UNITS: &'static str = "transfer × scale[position]: radiance towards the camera per unit incident radiance over one cell, R_i of eq. 5";

    /// A header for the given cells.
    pub fn new(cells: &Cells, picture: [usize; 2], title: Option<String>, made: serde_json::Value) -> Self {
        let positions = match cells.partition().layout() {
            Layout::Grid { azimuths, tilts } => LayoutRecord::Grid { azimuths: *azimuths, tilts: *tilts },
            Layout::List(positions) => LayoutRecord::List {
                positions_deg: positions
                    .iter()
                    .map(|position| [position.azimuth.to_degrees(), position.tilt.to_degrees()])
                    .collect(),
            },
        };
        let lamps = match cells.reach() {
            Reach::Near { radius_m, pattern } => {
                Lamps::Projector { radius_m, squares: pattern.squares(), half_width: pattern.half_width() }
            }
            Reach::Far => Lamps::Distant { irradiance: vec![[1.0; 3]; cells.positions()] },
        };
        Self {
            format: Self::FORMAT.into(),
            title,
            picture,
            positions,
            lamps,
            units: Self::UNITS.into(),
            made,
            packing: None,
        }
    }

    /// The cells of the field.
    ///
    /// # Errors
    /// If the geometry cannot be.
    pub fn cells(&self) -> Result<Cells, BasisError> {
        let layout = match &self.positions {
            LayoutRecord::Grid { azimuths, tilts } => Layout::Grid { azimuths: *azimuths, tilts: *tilts },
            LayoutRecord::List { positions_deg } => Layout::List(
                positions_deg.iter().map(|[azimuth, tilt]| Position::from_degrees(*azimuth, *tilt)).collect(),
            ),
        };
        let reach = match self.lamps {
            Lamps::Projector { radius_m, squares, half_width } => {
                Reach::Near { radius_m, pattern: Pattern::new(squares, half_width)? }
            }
            Lamps::Distant { .. } => Reach::Far,
        };
        Cells::new(Partition::new(layout)?, reach)
    }

    /// M, squares a side; 1 for distant lamps.
    pub fn squares(&self) -> usize {
        match self.lamps {
            Lamps::Projector { squares, .. } => squares,
            Lamps::Distant { .. } => 1,
        }
    }

    /// How the pictures are cut.
    pub fn blocks(&self) -> Blocks {
        Blocks::of_picture(self.picture[0], self.picture[1])
    }
}
