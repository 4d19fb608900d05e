//! `rig.toml` as it is written. What it shares with `capture.toml` is serialised back into one, so that one reader judges it.

use std::path::PathBuf;

use relumine_capture::Setup;
use serde::{Deserialize, Serialize};

use crate::simulated::SimulatedText;

/// Serialised, it is a `capture.toml`: the sections and keys that a capture does not have are skipped.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Text {
    pub(super) format: String,
    pub(super) title: Option<String>,
    pub(super) hemisphere: HemisphereText,
    pub(super) projector: ProjectorText,
    pub(super) patterns: PatternsText,
    pub(super) camera: CameraText,
    #[serde(skip_serializing)]
    pub(super) drivers: DriversText,
    #[serde(skip_serializing, default)]
    pub(super) manual: Manual,
    #[serde(skip_serializing, default)]
    pub(super) timing: Timing,
    #[serde(skip_serializing)]
    pub(super) simulated: Option<SimulatedText>,
}

impl Text {
    /// The `capture.toml` of this rig.
    pub(super) fn capture_toml(&mut self) -> Result<String, toml::ser::Error> {
        self.format = Setup::FORMAT.into();
        toml::to_string(self)
    }
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct HemisphereText {
    radius_m: f64,
    azimuths: Option<usize>,
    tilts: Option<usize>,
    positions_deg: Option<Vec<[f64; 2]>>,
    #[serde(skip_serializing)]
    pub(super) object_radius_m: Option<f64>,
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ProjectorText {
    squares: usize,
    half_width: f64,
    intensity_w_sr: Option<f64>,
    square_flux: Option<Vec<Vec<f64>>>,
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PatternsText {
    scheme: String,
    spacing: Option<usize>,
    #[serde(skip_serializing, default = "yes")]
    pub(super) white: bool,
}

fn yes() -> bool {
    true
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CameraText {
    width: usize,
    height: usize,
    pub(super) response: Option<String>,
    pub(super) colour: Option<String>,
    black_level: Option<u16>,
    white_level: Option<u16>,
    reference_patch: Option<[usize; 4]>,
    #[serde(skip_serializing)]
    pub(super) exposures_s: Vec<f64>,
    #[serde(skip_serializing)]
    pub(super) iso: Option<f64>,
    #[serde(skip_serializing)]
    pub(super) f_number: Option<f64>,
    #[serde(skip_serializing)]
    pub(super) bytes_per_photograph: Option<u64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct DriversText {
    pub(super) stage: HandText,
    pub(super) projector: HandText,
    pub(super) camera: CameraDriverText,
}

#[derive(Clone, Copy, Deserialize, PartialEq)]
#[serde(rename_all = "kebab-case")]
pub(super) enum HandText {
    Manual,
    Simulated,
}

#[derive(Clone, Copy, Deserialize, PartialEq)]
#[serde(rename_all = "kebab-case")]
pub(super) enum CameraDriverText {
    WatchedFolder,
    Simulated,
}

/// The section `[manual]`: a person moves and shows, the camera's program puts its pictures in a folder.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct Manual {
    /// The folder that is watched, relative to the capture directory.
    pub folder: PathBuf,
    /// A picture counts when its file has not changed for so long, seconds.
    pub settle_s: f64,
}

impl Default for Manual {
    fn default() -> Self {
        Self { folder: "incoming".into(), settle_s: 1.0 }
    }
}

/// The section `[timing]`: what a capture's duration is estimated from.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct Timing {
    /// Moving to the next position, seconds.
    pub move_s: f64,
    /// Showing the next pattern, seconds.
    pub show_s: f64,
    /// What a photograph takes beside its exposure, seconds.
    pub photograph_s: f64,
}

impl Default for Timing {
    fn default() -> Self {
        Self { move_s: 30.0, show_s: 0.5, photograph_s: 2.0 }
    }
}
