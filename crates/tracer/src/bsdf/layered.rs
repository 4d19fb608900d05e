//! The metallic-roughness model of glTF 2.0 (appendix B), with `KHR_materials_transmission`: a metal of the base colour, or
//! a dielectric whose interface covers a diffuse body or lets light through.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use super::ggx::{Ggx, reflect};
use super::glass::{refract, transmission, transmission_density};
use super::{Varying, cosine_hemisphere, fresnel, reflection, reflection_density};

/// One point of a surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct Parameters {
    colour: Vec3,
    metallic: f32,
    /// Share of what passes the interface that goes on instead of being scattered.
    transmission: f32,
    /// A closed body bends light, a thin pane does not.
    solid: bool,
    /// Index behind over index before.
    eta: f32,
    facets: Ggx,
}

impl Parameters {
    pub(super) fn new(index: f32, transmission: f32, solid: bool, at: &Varying) -> Self {
        Self {
            colour: at.colour,
            metallic: at.metallic,
            transmission,
            solid,
            eta: if solid && !at.outside { 1.0 / index } else { index },
            facets: Ggx::new(at.alpha),
        }
    }

    /// How often each lobe is sampled: interface, body, light that comes through.
    fn shares(&self, wo: Vec3) -> [f32; 3] {
        let reflected = fresnel::dielectric(wo.z, self.eta).0;
        // Facets see other angles than the surface, so neither side is left out.
        let interface = self.metallic + (1.0 - self.metallic) * reflected.clamp(0.15, 0.85);
        let rest = 1.0 - interface;
        [interface, rest * (1.0 - self.transmission), rest * self.transmission]
    }
}

pub(super) fn value(p: Parameters, wo: Vec3, wi: Vec3) -> Vec3 {
    if wi.z < 0.0 {
        let through = if p.solid {
            transmission(p.facets, p.eta, wo, wi)
        } else {
            let mirrored = Vec3::new(wi.x, wi.y, -wi.z);
            reflection(p.facets, wo, mirrored)
                .map_or(0.0, |(m, factor)| (1.0 - fresnel::dielectric(wo.dot(m), p.eta).0) * factor)
        };
        return p.colour * ((1.0 - p.metallic) * p.transmission * through);
    }
    let Some((m, factor)) = reflection(p.facets, wo, wi) else { return Vec3::ZERO };
    let reflected = fresnel::dielectric(wo.dot(m), p.eta).0;
    let body = p.colour * ((1.0 - p.transmission) * (1.0 - reflected) * FRAC_1_PI * wi.z);
    let dielectric = Vec3::splat(reflected * factor) + body;
    let metal = fresnel::schlick(wo.dot(m), p.colour) * factor;
    dielectric.lerp(metal, p.metallic)
}

pub(super) fn density(p: Parameters, wo: Vec3, wi: Vec3) -> f32 {
    let [interface, body, through] = p.shares(wo);
    if wi.z >= 0.0 {
        return interface * reflection_density(p.facets, wo, wi) + body * FRAC_1_PI * wi.z;
    }
    if through == 0.0 {
        return 0.0;
    }
    // A solid is refracted by the same facets that `transmission_density` weighs with Fresnel.
    through
        * if p.solid {
            transmission_density(p.facets, p.eta, wo, wi)
        } else {
            reflection_density(p.facets, wo, Vec3::new(wi.x, wi.y, -wi.z))
        }
}

pub(super) fn sample(p: Parameters, wo: Vec3, [a, b, c]: [f32; 3]) -> Option<Vec3> {
    let [interface, body, through] = p.shares(wo);
    if c < interface {
        return Some(reflect(wo, p.facets.sample(wo, [a, b]))).filter(|wi| wi.z > 0.0);
    }
    if c < interface + body {
        return Some(cosine_hemisphere(a, b));
    }
    let m = p.facets.sample(wo, [a, b]);
    if !p.solid {
        let wi = reflect(wo, m);
        return Some(Vec3::new(wi.x, wi.y, -wi.z)).filter(|_| wi.z > 0.0);
    }
    let (reflected, cosine) = fresnel::dielectric(wo.dot(m).max(0.0), p.eta);
    // What is left of the third number decides with Fresnel, as the density says.
    let left = (c - interface - body) / through;
    (left >= reflected).then(|| refract(wo, m, p.eta, cosine)).filter(|wi| wi.z < 0.0)
}
