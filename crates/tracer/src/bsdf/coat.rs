//! The clear coat of a plastic: how much light passes it, tabulated once a material.

use glam::Vec3;

use super::fresnel;
use super::ggx::{Ggx, reflect};

/// Steps of the cosine, and samples of the facets a side.
const STEPS: usize = 128;
const SIDE: usize = 32;

/// A rough interface over a diffuse body.
#[derive(Clone, Debug)]
pub(crate) struct Coat {
    pub(super) index: f32,
    pub(super) facets: Ggx,
    /// The share of light that passes the coat at the cosine i/(STEPS − 1).
    passing: Vec<f32>,
    /// The share of diffuse light from below that the coat throws back.
    pub(super) thrown_back: f32,
}

impl Coat {
    pub(super) fn new(index: f32, alpha: f32) -> Self {
        let facets = Ggx::new(alpha);
        let cosine = |step: usize| step as f32 / (STEPS - 1) as f32;
        let passing = (0..STEPS).map(|step| 1.0 - reflected(facets, cosine(step).max(1e-4), index)).collect();
        // 2 ∫ R(µ) µ dµ: the share of what arrives diffusely.
        let middle = |step: usize| (step as f32 + 0.5) / STEPS as f32;
        let below: f32 = (0..STEPS).map(|step| 2.0 * middle(step) * reflected(facets, middle(step), 1.0 / index)).sum();
        Self { index, facets, passing, thrown_back: below / STEPS as f32 }
    }

    /// The share of light that passes the coat from a direction with this cosine.
    pub(super) fn passing(&self, cosine: f32) -> f32 {
        let place = cosine.clamp(0.0, 1.0) * (STEPS - 1) as f32;
        let step = (place as usize).min(STEPS - 2);
        let share = place - step as f32;
        self.passing[step] * (1.0 - share) + self.passing[step + 1] * share
    }
}

/// Directional albedo of rough reflection, `eta` the index of the far side over that of this one: the mean over visible
/// facets of Fresnel times shadowing.
fn reflected(facets: Ggx, cosine: f32, eta: f32) -> f32 {
    let wo = Vec3::new((1.0 - cosine * cosine).max(0.0).sqrt(), 0.0, cosine);
    let mut sum = 0.0;
    for i in 0..SIDE * SIDE {
        let u = [((i % SIDE) as f32 + 0.5) / SIDE as f32, ((i / SIDE) as f32 + 0.5) / SIDE as f32];
        let m = facets.sample(wo, u);
        let wi = reflect(wo, m);
        if wi.z > 0.0 {
            sum += fresnel::dielectric(wo.dot(m).max(0.0), eta).0 * facets.visible(wi, m);
        }
    }
    sum / (SIDE * SIDE) as f32
}
