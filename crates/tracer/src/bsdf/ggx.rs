//! The GGX distribution of microfacets (Walter et al. 2007) with its separable shadowing, and its visible normals
//! (Heitz 2018). Directions are unit vectors in the frame of the surface, z along its normal.

use glam::Vec3;

/// Below this width a surface counts as this rough: single precision resolves no narrower peak.
const NARROWEST: f32 = 1e-3;

/// Microfacets of width α.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ggx {
    alpha: f32,
}

impl Ggx {
    pub(super) fn new(alpha: f32) -> Self {
        Self { alpha: alpha.max(NARROWEST) }
    }

    /// D(m): facets with normal m per unit solid angle and area.
    pub(super) fn density(self, m: Vec3) -> f32 {
        let cos2 = m.z * m.z;
        let a2 = self.alpha * self.alpha;
        // sin² + α²cos²: near the normal 1 − cos² would have lost its digits.
        let t = m.truncate().length_squared() + cos2 * a2;
        a2 / (std::f32::consts::PI * t * t)
    }

    /// G₁: the share of facets with normal m that `w` sees, among those that face it.
    pub(super) fn visible(self, w: Vec3, m: Vec3) -> f32 {
        if w.dot(m) * w.z <= 0.0 {
            return 0.0;
        }
        let cos2 = w.z * w.z;
        let tan2 = (1.0 - cos2).max(0.0) / cos2;
        2.0 / (1.0 + (1.0 + self.alpha * self.alpha * tan2).sqrt())
    }

    /// The density with which [`Ggx::sample`] draws m, by solid angle of m; `wo.z` > 0.
    pub(super) fn sampled(self, wo: Vec3, m: Vec3) -> f32 {
        self.visible(wo, m) * self.density(m) * wo.dot(m).max(0.0) / wo.z
    }

    /// A normal that `wo` (z > 0) sees, for two uniform numbers.
    pub(super) fn sample(self, wo: Vec3, u: [f32; 2]) -> Vec3 {
        // Stretched so that the facets are a hemisphere, of which `wo` sees a half disk and a half ellipse.
        let stretched = Vec3::new(self.alpha * wo.x, self.alpha * wo.y, wo.z).normalize();
        let across = if stretched.truncate().length_squared() > 1e-12 {
            Vec3::new(-stretched.y, stretched.x, 0.0).normalize()
        } else {
            Vec3::X
        };
        let along = stretched.cross(across);
        let radius = u[0].sqrt();
        let (sine, cosine) = (std::f32::consts::TAU * u[1]).sin_cos();
        let x = radius * cosine;
        let s = 0.5 * (1.0 + stretched.z);
        let y = (1.0 - s) * (1.0 - x * x).max(0.0).sqrt() + s * radius * sine;
        let z = (1.0 - x * x - y * y).max(0.0).sqrt();
        let normal = x * across + y * along + z * stretched;
        Vec3::new(self.alpha * normal.x, self.alpha * normal.y, normal.z.max(1e-6)).normalize()
    }
}

/// `w` mirrored at the facet with normal m.
pub(super) fn reflect(w: Vec3, m: Vec3) -> Vec3 {
    2.0 * w.dot(m) * m - w
}
