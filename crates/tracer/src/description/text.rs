//! The words of `scene.toml`, as they stand there; their meaning is given in the parent module.

use std::fmt;
use std::ops::Deref;
use std::path::PathBuf;

use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{Error, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};

/// A list of `N`, and not one more: an array would take the first of a longer list and leave the rest.
#[derive(Clone, Copy)]
pub(super) struct Exactly<T, const N: usize>(pub(super) [T; N]);

impl<T, const N: usize> Deref for Exactly<T, N> {
    type Target = [T; N];

    fn deref(&self) -> &[T; N] {
        &self.0
    }
}

impl<'de, T: Deserialize<'de>, const N: usize> Deserialize<'de> for Exactly<T, N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let list = Vec::<T>::deserialize(deserializer)?;
        let found = list.len();
        list.try_into().map(Self).map_err(|_| D::Error::invalid_length(found, &format!("a list of {N}").as_str()))
    }
}

type Three = Exactly<f32, 3>;
type Two = Exactly<f32, 2>;

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
    pub(super) position: Exactly<f64, 3>,
    pub(super) target: Exactly<f64, 3>,
    #[serde(default = "z")]
    pub(super) up: Exactly<f64, 3>,
    pub(super) horizontal_fov_deg: f64,
    pub(super) width: usize,
    pub(super) height: usize,
}

fn z() -> Exactly<f64, 3> {
    Exactly([0.0, 0.0, 1.0])
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
    Constant(Three),
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
    pub(super) checkerboard: Option<Exactly<Three, 2>>,
    pub(super) fields: Option<Two>,
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
    pub(super) eta: Option<Three>,
    pub(super) k: Option<Three>,
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
    pub(super) tint: Three,
}

fn glass_index() -> f32 {
    1.5
}

fn white() -> Three {
    Exactly([1.0; 3])
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
    #[serde(default = "zero")]
    pub(super) rotate_deg: Three,
    #[serde(default = "zero")]
    pub(super) translate_m: Three,
}

fn one() -> f32 {
    1.0
}

fn zero() -> Three {
    Exactly([0.0; 3])
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
    pub(super) size_m: Two,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BoxText {
    pub(super) size_m: Three,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LatheText {
    pub(super) profile_m: Vec<Two>,
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
