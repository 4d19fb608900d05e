//! The words of `light.toml`, as they stand there; their meaning is given in the parent module.

use std::path::PathBuf;

use serde::Deserialize;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Text {
    pub(super) format: String,
    #[serde(default)]
    pub(super) point: Vec<PointText>,
    #[serde(default)]
    pub(super) spot: Vec<SpotText>,
    #[serde(default)]
    pub(super) sphere: Vec<SphereText>,
    #[serde(default)]
    pub(super) rectangle: Vec<RectangleText>,
    #[serde(default)]
    pub(super) disk: Vec<DiskText>,
    #[serde(default)]
    pub(super) sun: Vec<SunText>,
    #[serde(default)]
    pub(super) shaft: Vec<ShaftText>,
    #[serde(default)]
    pub(super) slide: Vec<SlideText>,
    pub(super) environment: Option<EnvironmentText>,
    pub(super) mosaic: Option<MosaicText>,
    pub(super) placement: Option<PlacementText>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PointText {
    pub(super) position: [f64; 3],
    pub(super) intensity_w_sr: [f64; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SpotText {
    pub(super) position: [f64; 3],
    pub(super) target: [f64; 3],
    pub(super) intensity_w_sr: [f64; 3],
    pub(super) beam_half_angle_deg: f64,
    pub(super) cutoff_half_angle_deg: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SphereText {
    pub(super) center: [f64; 3],
    pub(super) radius_m: f64,
    pub(super) radiance: [f64; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RectangleText {
    pub(super) corner: [f64; 3],
    pub(super) edge_u: [f64; 3],
    pub(super) edge_v: [f64; 3],
    pub(super) radiance: [f64; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct DiskText {
    pub(super) center: [f64; 3],
    pub(super) normal: [f64; 3],
    pub(super) radius_m: f64,
    pub(super) radiance: [f64; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SunText {
    pub(super) direction: [f64; 3],
    pub(super) irradiance_w_m2: [f64; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ShaftText {
    pub(super) origin: [f64; 3],
    pub(super) direction: [f64; 3],
    pub(super) radius_m: f64,
    pub(super) irradiance_w_m2: [f64; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SlideText {
    pub(super) position: [f64; 3],
    pub(super) target: [f64; 3],
    #[serde(default = "upward")]
    pub(super) up: [f64; 3],
    pub(super) half_width: f64,
    pub(super) picture: PathBuf,
    pub(super) intensity_w_sr: [f64; 3],
}

fn upward() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct EnvironmentText {
    pub(super) map: Option<PathBuf>,
    pub(super) radiance: Option<[f64; 3]>,
    #[serde(default)]
    pub(super) rotation_deg: f64,
    #[serde(default = "one")]
    pub(super) scale: f64,
}

fn one() -> f64 {
    1.0
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MosaicText {
    pub(super) file: PathBuf,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PlacementText {
    #[serde(default)]
    pub(super) translate_m: [f64; 3],
    #[serde(default)]
    pub(super) rotate_deg: f64,
}
