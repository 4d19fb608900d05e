//! The words of `scene.toml`, as they stand there; their meaning is given in the parent module.

use std::fmt;
use std::path::PathBuf;

use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Text {
    pub(super) format: String,
    pub(super) camera: CameraText,
    #[serde(default)]
    pub(super) material: Vec<MaterialText>,
    #[serde(default)]
    pub(super) object: Vec<ObjectText>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CameraText {
    pub(super) position: [f64; 3],
    pub(super) target: [f64; 3],
    #[serde(default = "z")]
    pub(super) up: [f64; 3],
    pub(super) horizontal_fov_deg: f64,
    pub(super) width: usize,
    pub(super) height: usize,
}

fn z() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MaterialText {
    pub(super) name: String,
    pub(super) diffuse: Option<DiffuseText>,
    pub(super) conductor: Option<ConductorText>,
    pub(super) plastic: Option<PlasticText>,
    pub(super) glass: Option<GlassText>,
}

/// A colour, or what varies over the surface.
pub(super) enum ColourText {
    Constant([f32; 3]),
    Varying(VaryingText),
}

/// By hand, so that a mistake inside is named: serde's untagged enums only say that nothing fits.
impl<'de> Deserialize<'de> for ColourText {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Words;

        impl<'de> Visitor<'de> for Words {
            type Value = ColourText;

            fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
                formatter.write_str("a colour [red, green, blue], { checkerboard, fields } or { picture }")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, numbers: A) -> Result<ColourText, A::Error> {
                Deserialize::deserialize(SeqAccessDeserializer::new(numbers)).map(ColourText::Constant)
            }

            fn visit_map<A: MapAccess<'de>>(self, keys: A) -> Result<ColourText, A::Error> {
                Deserialize::deserialize(MapAccessDeserializer::new(keys)).map(ColourText::Varying)
            }
        }

        deserializer.deserialize_any(Words)
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct VaryingText {
    pub(super) checkerboard: Option<[[f32; 3]; 2]>,
    pub(super) fields: Option<[f32; 2]>,
    pub(super) picture: Option<PathBuf>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct DiffuseText {
    pub(super) reflectance: ColourText,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ConductorText {
    pub(super) metal: Option<String>,
    pub(super) eta: Option<[f32; 3]>,
    pub(super) k: Option<[f32; 3]>,
    pub(super) alpha: f32,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PlasticText {
    pub(super) diffuse: ColourText,
    #[serde(default = "plastic_index")]
    pub(super) index: f32,
    pub(super) alpha: f32,
}

fn plastic_index() -> f32 {
    1.49
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GlassText {
    #[serde(default = "glass_index")]
    pub(super) index: f32,
    #[serde(default)]
    pub(super) alpha: f32,
    #[serde(default = "white")]
    pub(super) tint: [f32; 3],
}

fn glass_index() -> f32 {
    1.5
}

fn white() -> [f32; 3] {
    [1.0; 3]
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ObjectText {
    pub(super) name: Option<String>,
    pub(super) material: Option<String>,
    pub(super) model: Option<ModelText>,
    pub(super) sphere: Option<SphereText>,
    pub(super) plane: Option<PlaneText>,
    #[serde(rename = "box")]
    pub(super) cuboid: Option<BoxText>,
    pub(super) lathe: Option<LatheText>,
    #[serde(default = "one")]
    pub(super) scale: f32,
    #[serde(default)]
    pub(super) rotate_deg: [f32; 3],
    #[serde(default)]
    pub(super) translate_m: [f32; 3],
}

fn one() -> f32 {
    1.0
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ModelText {
    pub(super) file: PathBuf,
    pub(super) up: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SphereText {
    pub(super) radius_m: f32,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PlaneText {
    pub(super) size_m: [f32; 2],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BoxText {
    pub(super) size_m: [f32; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LatheText {
    pub(super) profile_m: Vec<[f32; 2]>,
    #[serde(default = "yes")]
    pub(super) smooth: bool,
    #[serde(default = "segments")]
    pub(super) segments: usize,
}

fn yes() -> bool {
    true
}

fn segments() -> usize {
    96
}
