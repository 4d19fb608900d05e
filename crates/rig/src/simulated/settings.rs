//! The section `[simulated]` of a rig description.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// What is simulated, as rig.toml says it; FORMAT.md has the meaning of every key.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct SimulatedText {
    /// The scene, relative to rig.toml.
    pub scene: PathBuf,
    /// Paths a pixel.
    #[serde(default = "samples")]
    pub samples: usize,
    /// Times that light is scattered on its way, at most.
    #[serde(default = "bounces")]
    pub bounces: usize,
    /// Start of all random numbers.
    #[serde(default)]
    pub seed: u64,
    /// What the projector's black shines, as a share of its white.
    #[serde(default)]
    pub projector_black: f64,
    /// The share of light that is lacking in the pattern's corners, growing with the square of the distance from the axis.
    #[serde(default)]
    pub projector_vignetting: f64,
    /// Standard deviation of where the projector really stands about where it should, degrees, along each of two axes.
    #[serde(default)]
    pub misplaced_deg: f64,
    /// The camera's sensor.
    #[serde(default)]
    pub sensor: SensorText,
}

/// The sensor of the simulated camera.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct SensorText {
    /// Electrons at which a pixel is clipped; photon noise is Poisson in electrons.
    #[serde(default = "full_well_e")]
    pub full_well_e: f64,
    /// Standard deviation of the noise of reading, electrons.
    #[serde(default = "read_noise_e")]
    pub read_noise_e: f64,
    /// Bits of the counts, 8 to 16; up to 8 are written as 8-bit PNG, more as 16-bit PNG.
    #[serde(default = "bits")]
    pub bits: u8,
}

impl Default for SensorText {
    fn default() -> Self {
        Self { full_well_e: full_well_e(), read_noise_e: read_noise_e(), bits: bits() }
    }
}

fn samples() -> usize {
    64
}

fn bounces() -> usize {
    4
}

fn full_well_e() -> f64 {
    60_000.0
}

fn read_noise_e() -> f64 {
    5.0
}

fn bits() -> u8 {
    16
}
