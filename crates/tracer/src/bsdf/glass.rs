//! Clear bodies, smooth or rough (Walter et al. 2007).

use glam::Vec3;

use super::ggx::{Ggx, reflect};
use super::{Scattered, Varying, fresnel, reflection, reflection_density};

/// The surface of a clear body.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Glass {
    index: f32,
    /// `None` if smooth.
    facets: Option<Ggx>,
}

impl Glass {
    pub(super) fn new(index: f32, alpha: f32) -> Self {
        Self { index, facets: (alpha > 0.0).then(|| Ggx::new(alpha)) }
    }

    pub(super) fn is_smooth(&self) -> bool {
        self.facets.is_none()
    }

    /// The index of the side behind over that of the side of `wo`.
    fn eta(&self, at: &Varying) -> f32 {
        if at.outside { self.index } else { 1.0 / self.index }
    }

    pub(super) fn value(&self, at: &Varying, wo: Vec3, wi: Vec3) -> Vec3 {
        let Some(facets) = self.facets else { return Vec3::ZERO };
        let eta = self.eta(at);
        if wi.z > 0.0 {
            let Some((m, factor)) = reflection(facets, wo, wi) else { return Vec3::ZERO };
            return Vec3::splat(fresnel::dielectric(wo.dot(m).max(0.0), eta).0 * factor);
        }
        at.colour * transmission(facets, eta, wo, wi)
    }

    pub(super) fn density(&self, at: &Varying, wo: Vec3, wi: Vec3) -> f32 {
        let Some(facets) = self.facets else { return 0.0 };
        let eta = self.eta(at);
        if wi.z > 0.0 {
            let Some(m) = (wo + wi).try_normalize() else { return 0.0 };
            return fresnel::dielectric(wo.dot(m).max(0.0), eta).0 * reflection_density(facets, wo, wi);
        }
        transmission_density(facets, eta, wo, wi)
    }

    pub(super) fn sample(&self, at: &Varying, wo: Vec3, [a, b, c]: [f32; 3]) -> Option<Scattered> {
        let eta = self.eta(at);
        let m = self.facets.map_or(Vec3::Z, |facets| facets.sample(wo, [a, b]));
        let (reflected, cosine) = fresnel::dielectric(wo.dot(m).max(0.0), eta);
        let (wi, colour) = if c < reflected {
            (reflect(wo, m), Vec3::ONE)
        } else {
            // Radiance is spread over a wider cone where it leaves the denser body.
            (refract(wo, m, eta, cosine), at.colour / (eta * eta))
        };
        if (c < reflected) != (wi.z > 0.0) || wi.z == 0.0 {
            return None;
        }
        match self.facets {
            None => Some(Scattered { wi, weight: colour, density: None }),
            Some(facets) => {
                // Fresnel, D and the shadowing of `wo` are in the density already.
                let density = self.density(at, wo, wi);
                let weight = colour * facets.visible(wi, m);
                (density > 0.0).then_some(Scattered { wi, weight, density: Some(density) })
            }
        }
    }
}

/// `wo` refracted at the facet m, whose far side has `eta` times the index of this one; `cosine` on the far side.
pub(super) fn refract(wo: Vec3, m: Vec3, eta: f32, cosine: f32) -> Vec3 {
    ((wo.dot(m) / eta - cosine) * m - wo / eta).normalize()
}

/// The facet that refracts `wi` (z < 0) to `wo`, and the square in the denominator of its Jacobian.
fn refracting(eta: f32, wo: Vec3, wi: Vec3) -> Option<(Vec3, f32)> {
    let m = (wo + eta * wi).try_normalize()?;
    let m = if m.z < 0.0 { -m } else { m };
    // Facets seen from behind refract nothing.
    if wo.dot(m) <= 0.0 || wi.dot(m) >= 0.0 {
        return None;
    }
    Some((m, (wi.dot(m) + wo.dot(m) / eta).powi(2)))
}

/// f·|cosθᵢ| of light that comes through, without colour.
pub(super) fn transmission(facets: Ggx, eta: f32, wo: Vec3, wi: Vec3) -> f32 {
    let Some((m, squared)) = refracting(eta, wo, wi) else { return 0.0 };
    let passing = 1.0 - fresnel::dielectric(wo.dot(m), eta).0;
    let shadowing = facets.visible(wo, m) * facets.visible(wi, m);
    passing * facets.density(m) * shadowing * (wi.dot(m) * wo.dot(m)).abs() / (wo.z * squared * eta * eta)
}

/// The density of light that comes through, Fresnel included.
pub(super) fn transmission_density(facets: Ggx, eta: f32, wo: Vec3, wi: Vec3) -> f32 {
    let Some((m, squared)) = refracting(eta, wo, wi) else { return 0.0 };
    let passing = 1.0 - fresnel::dielectric(wo.dot(m), eta).0;
    passing * facets.sampled(wo, m) * wi.dot(m).abs() / squared
}
