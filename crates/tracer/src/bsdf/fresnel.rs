//! How much of light a smooth interface reflects.

use glam::Vec3;

/// Unpolarised reflectance of an interface between clear bodies for the cosine `cosine` ≥ 0 on the side where the light
/// comes from, `eta` the index of the other side over that of this one; and the cosine on the other side, 0 where all is
/// reflected.
pub(super) fn dielectric(cosine: f32, eta: f32) -> (f32, f32) {
    let sine2 = (1.0 - cosine * cosine).max(0.0) / (eta * eta);
    if sine2 >= 1.0 {
        return (1.0, 0.0);
    }
    let other = (1.0 - sine2).sqrt();
    let parallel = (eta * cosine - other) / (eta * cosine + other);
    let across = (cosine - eta * other) / (cosine + eta * other);
    (0.5 * (parallel * parallel + across * across), other)
}

/// Reflectance of a metal with complex index `eta` + i `k`, per channel, seen from air.
pub(super) fn conductor(cosine: f32, eta: Vec3, k: Vec3) -> Vec3 {
    let cos2 = cosine * cosine;
    let sin2 = 1.0 - cos2;
    let (eta2, k2) = (eta * eta, k * k);
    let t0 = eta2 - k2 - sin2;
    let a2_plus_b2 = (t0 * t0 + 4.0 * eta2 * k2).map(f32::sqrt);
    let a = (0.5 * (a2_plus_b2 + t0)).max(Vec3::ZERO).map(f32::sqrt);
    let t1 = a2_plus_b2 + cos2;
    let t2 = 2.0 * cosine * a;
    let across = (t1 - t2) / (t1 + t2);
    let t3 = cos2 * a2_plus_b2 + sin2 * sin2;
    let t4 = t2 * sin2;
    let parallel = across * (t3 - t4) / (t3 + t4);
    0.5 * (across + parallel)
}

/// Schlick's approximation between `f0` at normal incidence and white at grazing, as glTF 2.0 has it.
pub(super) fn schlick(cosine: f32, f0: Vec3) -> Vec3 {
    f0 + (Vec3::ONE - f0) * (1.0 - cosine).clamp(0.0, 1.0).powi(5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn textbook_values() {
        // ((n − 1)/(n + 1))² at normal incidence; Brewster's angle reflects half of what one polarisation does.
        assert!((dielectric(1.0, 1.5).0 - 0.04).abs() < 1e-6);
        assert!((dielectric(1.0, 1.0 / 1.5).0 - 0.04).abs() < 1e-6);
        assert_eq!(dielectric(0.5, 1.0 / 1.5).0, 1.0, "total reflection beyond 41.8°");
        assert!((dielectric(1e-4, 1.5).0 - 1.0).abs() < 1e-3);
        // Light that goes in and light that comes out along the same way are reflected alike.
        let (in_, cosine) = dielectric(0.7, 1.5);
        assert!((dielectric(cosine, 1.0 / 1.5).0 - in_).abs() < 1e-6);
        // A metal without absorption is a clear body.
        let metal = conductor(0.6, Vec3::splat(1.5), Vec3::ZERO);
        assert!((metal.x - dielectric(0.6, 1.5).0).abs() < 1e-5);
        // Gold at normal incidence: ((η − 1)² + k²)/((η + 1)² + k²).
        let gold = conductor(1.0, Vec3::new(0.143, 0.375, 1.442), Vec3::new(3.983, 2.386, 1.603));
        let expected = (0.857f32.powi(2) + 3.983f32.powi(2)) / (1.143f32.powi(2) + 3.983f32.powi(2));
        assert!((gold.x - expected).abs() < 1e-4);
    }
}
