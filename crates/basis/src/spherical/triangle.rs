//! One spherical triangle: its solid angle, and points spread uniformly over it.

use glam::DVec3;

/// Signed solid angle \[sr\] of the triangle with unit corners a, b, c; positive when counter-clockwise from outside.
///
/// Van Oosterom & Strackee 1983, eq. 8: tan(Ω/2) = a·(b×c) / (1 + a·b + b·c + c·a). The triple product is taken of
/// the edges from a, so that it keeps its digits when the triangle is tiny.
pub(super) fn solid_angle(a: DVec3, b: DVec3, c: DVec3) -> f64 {
    let volume = a.dot((b - a).cross(c - a));
    2.0 * volume.atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a))
}

/// The point of a counter-clockwise triangle that (u, v) in \[0, 1\]² stands for, uniform by solid angle.
///
/// Arvo 1995, "Stratified sampling of spherical triangles": u cuts off the part a, b, c′ with that share of the area,
/// c′ on the arc from a to c; v then walks the arc from b to c′ uniformly in cosine. Instead of Arvo's angles, which
/// cancel in small triangles, c′ comes from solving the formula of [`solid_angle`] for the half tangent of arc a c′.
pub(super) fn sample(a: DVec3, b: DVec3, c: DVec3, u: f64, v: f64) -> DVec3 {
    let towards_c = (c - a).reject_from_normalized(a).normalize_or_zero();
    let ab = 1.0 + a.dot(b);
    let volume = a.dot((b - a).cross(towards_c));
    // tan(uΩ/2) = τ·volume / (ab + τ·b·towards_c), with τ = tan(∠(a, c′)/2).
    let share = (0.5 * u * solid_angle(a, b, c)).tan();
    let tau = (share * ab / (volume - share * b.dot(towards_c))).max(0.0);
    let cut = if tau.is_finite() { (a * (1.0 - tau * tau) + towards_c * (2.0 * tau)) / (1.0 + tau * tau) } else { c };
    // Area grows with 1 − cos of the distance from b, which is half the squared chord.
    let chord2 = v * (cut - b).length_squared();
    let sideways = (cut - b).reject_from_normalized(b).normalize_or_zero();
    (b * (1.0 - 0.5 * chord2) + sideways * (chord2 * (1.0 - 0.25 * chord2)).max(0.0).sqrt()).normalize_or(b)
}

#[cfg(test)]
mod tests {
    use super::{sample, solid_angle};
    use glam::DVec3;
    use std::f64::consts::{FRAC_PI_2, PI};

    #[test]
    fn an_octant_is_an_eighth_of_the_sphere() {
        assert!((solid_angle(DVec3::X, DVec3::Y, DVec3::Z) - FRAC_PI_2).abs() < 1e-15);
        assert!((solid_angle(DVec3::X, DVec3::Z, DVec3::Y) + FRAC_PI_2).abs() < 1e-15);
    }

    #[test]
    fn a_tiny_triangle_has_its_planar_area() {
        let a = DVec3::new(0.3, -0.5, 0.8).normalize();
        let (x, y) = a.any_orthonormal_pair();
        let size = 1e-6;
        let area = solid_angle(a, (a + x * size).normalize(), (a + y * size).normalize());
        assert!((area / (0.5 * size * size) - 1.0).abs() < 1e-8, "{area:e}");
    }

    #[test]
    fn samples_fill_a_triangle_evenly_whatever_its_size() {
        let a = DVec3::new(0.2, 0.1, 0.9).normalize();
        let (x, y) = a.any_orthonormal_pair();
        for size in [2.0, 0.3, 1e-3, 1e-6] {
            let (b, c) = ((a + x * size).normalize(), (a + (y - x * 0.4) * size).normalize());
            // The corner part near each corner, cut at the arc's middle points, must get its share of the samples.
            let (ab, ac) = ((a + b).normalize(), (a + c).normalize());
            let share = solid_angle(a, ab, ac) / solid_angle(a, b, c);
            let n = 400;
            let mut inside = 0;
            for i in 0..n * n {
                let (u, v) = ((f64::from(i % n) + 0.5) / f64::from(n), (f64::from(i / n) + 0.5) / f64::from(n));
                let p = sample(a, b, c, u, v);
                assert!((p.length() - 1.0).abs() < 1e-15);
                for (from, to) in [(a, b), (b, c), (c, a)] {
                    assert!(p.dot((from - p).cross(to - p)) >= -1e-8 * size * size);
                }
                inside += u32::from(p.dot((ab - p).cross(ac - p)) > 0.0);
            }
            let got = f64::from(inside) / f64::from(n * n);
            assert!((got - share).abs() < 0.003, "size {size}: {got} of the samples, {share} of the area");
        }
    }

    #[test]
    fn a_triangle_without_area_gives_one_of_its_points() {
        let far = DVec3::new(1.0, 0.0, 1.0).normalize();
        for (u, v) in [(0.0, 0.0), (0.5, 0.5), (0.999, 0.1)] {
            for (a, b, c) in [(far, far, far), (DVec3::X, far, DVec3::Z), (far, far, DVec3::Z)] {
                let p = sample(a, b, c, u, v);
                assert!((p.length() - 1.0).abs() < 1e-12 && p.y.abs() < 1e-7 && p.z > -1e-12, "{p}");
            }
        }
        assert!(solid_angle(DVec3::X, DVec3::X, DVec3::Z).abs() < PI * 1e-16);
    }
}
