//! How surfaces scatter light: value, density and samples of every [`Material`].
//!
//! Directions are unit vectors in the frame of the surface, both pointing away from it, z along the normal on the side of
//! `wo`, so `wo.z` > 0 always; `wi.z` < 0 is light that comes through. Values are f·|cosθᵢ|, per channel. Light travels
//! from `wi` to `wo`: radiance, so that what crosses into a denser body grows with the square of the index.

mod coat;
mod fresnel;
mod ggx;
mod glass;
mod layered;

use std::collections::HashMap;
use std::f32::consts::{FRAC_1_PI, TAU};
use std::sync::Arc;

use glam::{Vec2, Vec3};

use crate::Material;
use coat::Coat;
use ggx::{Ggx, reflect};
use glass::Glass;

/// A material made ready: what does not vary over the surface.
#[derive(Clone, Debug)]
pub(crate) enum Bsdf {
    Diffuse,
    Conductor { eta: Vec3, k: Vec3, facets: Ggx },
    Plastic(Arc<Coat>),
    Glass(Glass),
    MetallicRoughness { index: f32, transmission: f32, solid: bool },
}

/// The coats of plastics by index and width.
pub(crate) type Coats = HashMap<[u32; 2], Arc<Coat>>;

/// The least index of refraction of a solid that lets light through.
const LEAST_BENDING: f32 = 1.01;

/// What varies over the surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Varying {
    /// Albedo, base colour or tint.
    pub(crate) colour: Vec3,
    /// GGX width and metallic, of the metallic-roughness model.
    pub(crate) alpha: f32,
    pub(crate) metallic: f32,
    /// Whether `wo` is on the side where the normal points.
    pub(crate) outside: bool,
}

/// A sampled direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scattered {
    pub(crate) wi: Vec3,
    /// f·|cosθᵢ| over the density.
    pub(crate) weight: Vec3,
    /// Density by solid angle; `None` for a mirror's or smooth glass's one direction.
    pub(crate) density: Option<f32>,
}

impl Bsdf {
    /// Makes a material ready; `coats` keeps those that are tabulated already.
    pub(crate) fn new(material: &Material, coats: &mut Coats) -> Self {
        match material {
            Material::Diffuse { .. } => Self::Diffuse,
            Material::Conductor { eta, k, alpha } => Self::Conductor { eta: *eta, k: *k, facets: Ggx::new(*alpha) },
            Material::Plastic { index, alpha, .. } => {
                let coat = coats.entry([index.to_bits(), alpha.to_bits()]);
                Self::Plastic(coat.or_insert_with(|| Arc::new(Coat::new(*index, *alpha))).clone())
            }
            Material::Glass { index, alpha, .. } => Self::Glass(Glass::new(*index, *alpha)),
            Material::MetallicRoughness { index, transmission, solid, .. } => {
                // Where nothing is bent a rough surface would have no facet that sends light on.
                let index = if *solid && *transmission > 0.0 { index.max(LEAST_BENDING) } else { *index };
                Self::MetallicRoughness { index, transmission: *transmission, solid: *solid }
            }
        }
    }

    /// What of the material varies, at texture coordinates `uv`.
    pub(crate) fn varying(material: &Material, uv: Vec2, outside: bool) -> Varying {
        let plain = |colour: Vec3| Varying { colour, alpha: 0.0, metallic: 0.0, outside };
        match material {
            Material::Diffuse { reflectance } => plain(reflectance.at(uv)),
            Material::Conductor { .. } => plain(Vec3::ONE),
            Material::Plastic { diffuse, .. } => plain(diffuse.at(uv)),
            Material::Glass { tint, .. } => plain(*tint),
            Material::MetallicRoughness { base_colour, roughness_metallic, .. } => {
                let packed = roughness_metallic.at(uv);
                Varying { colour: base_colour.at(uv), alpha: packed.y * packed.y, metallic: packed.z, outside }
            }
        }
    }

    /// Whether light can come through from behind.
    pub(crate) fn transmits(&self) -> bool {
        match self {
            Self::Glass(_) => true,
            Self::MetallicRoughness { transmission, .. } => *transmission > 0.0,
            Self::Diffuse | Self::Conductor { .. } | Self::Plastic(_) => false,
        }
    }

    /// Whether it scatters in single directions only, so that no lamp can be connected to it.
    pub(crate) fn is_specular(&self) -> bool {
        matches!(self, Self::Glass(glass) if glass.is_smooth())
    }

    /// f·|cosθᵢ|.
    pub(crate) fn value(&self, at: &Varying, wo: Vec3, wi: Vec3) -> Vec3 {
        match self {
            Self::Diffuse => at.colour * (FRAC_1_PI * wi.z.max(0.0)),
            Self::Conductor { eta, k, facets } => {
                let Some((m, factor)) = reflection(*facets, wo, wi) else { return Vec3::ZERO };
                at.colour * fresnel::conductor(wo.dot(m), *eta, *k) * factor
            }
            Self::Plastic(coat) => plastic(coat, at, wo, wi),
            Self::Glass(glass) => glass.value(at, wo, wi),
            Self::MetallicRoughness { index, transmission, solid } => {
                layered::value(layered::Parameters::new(*index, *transmission, *solid, at), wo, wi)
            }
        }
    }

    /// The density by solid angle with which [`Bsdf::sample`] draws `wi`.
    pub(crate) fn density(&self, at: &Varying, wo: Vec3, wi: Vec3) -> f32 {
        match self {
            Self::Diffuse => FRAC_1_PI * wi.z.max(0.0),
            Self::Conductor { facets, .. } => reflection_density(*facets, wo, wi),
            Self::Plastic(coat) => {
                let coated = coat_share(coat, at, wo);
                coated * reflection_density(coat.facets, wo, wi) + (1.0 - coated) * FRAC_1_PI * wi.z.max(0.0)
            }
            Self::Glass(glass) => glass.density(at, wo, wi),
            Self::MetallicRoughness { index, transmission, solid } => {
                layered::density(layered::Parameters::new(*index, *transmission, *solid, at), wo, wi)
            }
        }
    }

    /// A direction that light may come from, for three uniform numbers; `None` where it is absorbed.
    pub(crate) fn sample(&self, at: &Varying, wo: Vec3, u: [f32; 3]) -> Option<Scattered> {
        let wi = match self {
            Self::Diffuse => {
                // Density and value are proportional: the albedo is left.
                let wi = cosine_hemisphere(u[0], u[1]);
                return Some(Scattered { wi, weight: at.colour, density: Some(FRAC_1_PI * wi.z) });
            }
            Self::Glass(glass) => return glass.sample(at, wo, u),
            Self::Conductor { facets, .. } => reflect(wo, facets.sample(wo, [u[0], u[1]])),
            Self::Plastic(coat) => {
                if u[2] < coat_share(coat, at, wo) {
                    reflect(wo, coat.facets.sample(wo, [u[0], u[1]]))
                } else {
                    cosine_hemisphere(u[0], u[1])
                }
            }
            Self::MetallicRoughness { index, transmission, solid } => {
                layered::sample(layered::Parameters::new(*index, *transmission, *solid, at), wo, u)?
            }
        };
        let density = self.density(at, wo, wi);
        let weight = self.value(at, wo, wi) / density;
        (density > 0.0 && weight.is_finite()).then_some(Scattered { wi, weight, density: Some(density) })
    }
}

/// Body and coat: Mitsuba's rough plastic (W. Jakob, after Walter et al. 2007), whose body sees light that has passed the
/// coat twice and what the coat throws back, without colour shift.
fn plastic(coat: &Coat, at: &Varying, wo: Vec3, wi: Vec3) -> Vec3 {
    if wi.z <= 0.0 {
        return Vec3::ZERO;
    }
    let through = coat.passing(wo.z) * coat.passing(wi.z) / (coat.index * coat.index);
    let body = at.colour * (FRAC_1_PI * wi.z * through / (1.0 - coat.thrown_back));
    match reflection(coat.facets, wo, wi) {
        Some((m, factor)) => body + fresnel::dielectric(wo.dot(m), coat.index).0 * factor,
        None => body,
    }
}

/// How often a sample of a plastic is one of its coat.
fn coat_share(coat: &Coat, at: &Varying, wo: Vec3) -> f32 {
    let coated = 1.0 - coat.passing(wo.z);
    let body = (1.0 - coated) * at.colour.max_element();
    // Never left out: seen straight on a coat reflects little, but little of much.
    if coated + body > 0.0 { (coated / (coated + body)).clamp(0.1, 1.0) } else { 1.0 }
}

/// The facet that reflects `wi` to `wo`, and D·G/(4 cosθₒ): with Fresnel, f·cosθᵢ.
fn reflection(facets: Ggx, wo: Vec3, wi: Vec3) -> Option<(Vec3, f32)> {
    let m = (wo + wi).try_normalize().filter(|_| wi.z > 0.0 && wo.z > 0.0)?;
    let factor = facets.density(m) * facets.visible(wo, m) * facets.visible(wi, m) / (4.0 * wo.z);
    Some((m, factor))
}

fn reflection_density(facets: Ggx, wo: Vec3, wi: Vec3) -> f32 {
    match (wo + wi).try_normalize() {
        Some(m) if wi.z > 0.0 => facets.sampled(wo, m) / (4.0 * wo.dot(m)),
        _ => 0.0,
    }
}

fn cosine_hemisphere(a: f32, b: f32) -> Vec3 {
    let (sine, cosine) = (TAU * b).sin_cos();
    let radius = a.sqrt();
    Vec3::new(radius * cosine, radius * sine, (1.0 - a).max(0.0).sqrt())
}

#[cfg(test)]
mod tests;
