//! What surfaces are made of.

use glam::Vec3;

use crate::Texture;

/// A material and the small relief on it. All surfaces are two-sided.
#[derive(Clone, Debug)]
pub struct Surface {
    /// What it is made of.
    pub material: Material,
    /// Relief too fine for triangles.
    pub normal_map: Option<NormalMap>,
}

impl From<Material> for Surface {
    fn from(material: Material) -> Self {
        Self { material, normal_map: None }
    }
}

/// How light is scattered where it meets a surface. Colours are linear RGB; α is the GGX width, roughness squared.
#[derive(Clone, Debug)]
pub enum Material {
    /// The same radiance in all directions.
    Diffuse {
        /// Albedo, 0 … 1.
        reflectance: Texture,
    },
    /// A metal, rough as GGX says.
    Conductor {
        /// Real part of the index of refraction, per channel.
        eta: Vec3,
        /// Imaginary part.
        k: Vec3,
        /// GGX width.
        alpha: f32,
    },
    /// A diffuse body under a rough clear coat.
    Plastic {
        /// Albedo of the body, 0 … 1.
        diffuse: Texture,
        /// Index of refraction of the coat.
        index: f32,
        /// GGX width of the coat.
        alpha: f32,
    },
    /// A clear body; its inside is where normals do not point.
    Glass {
        /// Index of refraction of the inside.
        index: f32,
        /// GGX width; 0 is smooth.
        alpha: f32,
        /// What each passage through the surface leaves of the light, 0 … 1.
        tint: Vec3,
    },
    /// The metallic-roughness model of glTF 2.0.
    MetallicRoughness {
        /// Base colour, 0 … 1.
        base_colour: Texture,
        /// Roughness in green, metallic in blue, 0 … 1, as glTF packs them.
        roughness_metallic: Texture,
        /// Index of refraction (`KHR_materials_ior`).
        index: f32,
        /// Share of light that passes the surface instead of being scattered under it (`KHR_materials_transmission`).
        transmission: f32,
        /// Whether the surface is a closed body that bends light (`KHR_materials_volume`), not a thin pane.
        solid: bool,
    },
}

/// A picture of tangent-space normals, stored as (n + 1)/2.
#[derive(Clone, Debug)]
pub struct NormalMap {
    /// The stored normals, not decoded from sRGB.
    pub texture: Texture,
    /// What x and y of the normal are multiplied with.
    pub scale: f32,
}
