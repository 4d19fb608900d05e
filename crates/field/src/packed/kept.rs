//! Where the light of a packed field went.

use serde::{Deserialize, Serialize};

/// Sums of transfers over all pixels, channels, positions and squares, by how they are kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Kept {
    /// All of it: what unit light through every cell shows.
    pub whole: f64,
    /// Of that, in squares kept by themselves besides the main ones.
    pub squares: f64,
    /// Of that, shared out evenly in coarse squares.
    pub coarse: f64,
    /// Squares of what the wholes of all positions show, summed.
    pub power: f64,
    /// The same of what quantisation took from them.
    pub residual: f64,
}

impl Kept {
    /// Adds another part of the field.
    pub fn add(&mut self, other: &Self) {
        self.whole += other.whole;
        self.squares += other.squares;
        self.coarse += other.coarse;
        self.power += other.power;
        self.residual += other.residual;
    }
}
