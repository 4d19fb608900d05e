//! What rays meet: triangles and balls.

use glam::Vec3;
use obvhs::Boundable;
use obvhs::aabb::Aabb;

/// A ray prepared for the watertight triangle test: axes permuted so that it runs along the last one, and sheared.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PreparedRay {
    origin: Vec3,
    direction: Vec3,
    axes: [usize; 3],
    shear: Vec3,
}

impl PreparedRay {
    pub(crate) fn new(origin: Vec3, direction: Vec3) -> Self {
        let size = direction.abs();
        let kz = if size.x > size.y && size.x > size.z {
            0
        } else if size.y > size.z {
            1
        } else {
            2
        };
        let (mut kx, mut ky) = ((kz + 1) % 3, (kz + 2) % 3);
        if direction[kz] < 0.0 {
            std::mem::swap(&mut kx, &mut ky);
        }
        let z = direction[kz];
        Self { origin, direction, axes: [kx, ky, kz], shear: Vec3::new(direction[kx] / z, direction[ky] / z, 1.0 / z) }
    }
}

/// A place on a shape.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShapeHit {
    /// Distance along the ray.
    pub(crate) distance: f32,
    /// Barycentric weights of the second and third corner of a triangle; unused for balls.
    pub(crate) weights: [f32; 2],
}

/// One shape.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Shape {
    Triangle([Vec3; 3]),
    Ball { centre: Vec3, radius: f32 },
}

impl Boundable for Shape {
    fn aabb(&self) -> Aabb {
        match self {
            Self::Triangle([a, b, c]) => Aabb::new(a.min(*b).min(*c).into(), a.max(*b).max(*c).into()),
            Self::Ball { centre, radius } => Aabb::new((*centre - *radius).into(), (*centre + *radius).into()),
        }
    }
}

impl Shape {
    /// Where the ray meets it, farther than 0 and nearer than `nearest`.
    #[inline]
    pub(crate) fn meet(&self, ray: &PreparedRay, nearest: f32) -> Option<ShapeHit> {
        match self {
            Self::Triangle(corners) => meet_triangle(corners, ray, nearest),
            Self::Ball { centre, radius } => meet_ball(*centre, *radius, ray, nearest),
        }
    }
}

/// Woop, Benthin, Wald 2013: neighbouring triangles leave no gap between them.
#[inline]
fn meet_triangle(corners: &[Vec3; 3], ray: &PreparedRay, nearest: f32) -> Option<ShapeHit> {
    let [kx, ky, kz] = ray.axes;
    let sheared = |corner: Vec3| {
        let offset = corner - ray.origin;
        (offset[kx] - ray.shear.x * offset[kz], offset[ky] - ray.shear.y * offset[kz], offset[kz])
    };
    let ((ax, ay, az), (bx, by, bz), (cx, cy, cz)) = (sheared(corners[0]), sheared(corners[1]), sheared(corners[2]));
    let (mut u, mut v, mut w) = (cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax);
    if u == 0.0 || v == 0.0 || w == 0.0 {
        // On an edge single precision cannot tell the side, double precision can.
        let cross =
            |ax: f32, ay: f32, bx: f32, by: f32| (f64::from(ax) * f64::from(by) - f64::from(ay) * f64::from(bx)) as f32;
        (u, v, w) = (cross(cx, cy, bx, by), cross(ax, ay, cx, cy), cross(bx, by, ax, ay));
    }
    if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
        return None;
    }
    let sum = u + v + w;
    if sum == 0.0 {
        return None;
    }
    let distance = (u * az + v * bz + w * cz) * ray.shear.z / sum;
    (distance > 0.0 && distance < nearest).then(|| ShapeHit { distance, weights: [v / sum, w / sum] })
}

/// The nearer meeting in front of the origin. The discriminant is taken from the foot of the perpendicular, where far balls
/// lose no digits (Haines et al. 2019).
fn meet_ball(centre: Vec3, radius: f32, ray: &PreparedRay, nearest: f32) -> Option<ShapeHit> {
    let offset = ray.origin - centre;
    let along = -offset.dot(ray.direction);
    let foot = offset + along * ray.direction;
    let squared = radius * radius - foot.length_squared();
    if squared < 0.0 {
        return None;
    }
    let half = squared.sqrt();
    // q has the sign of `along`, so the two never cancel.
    let q = if along >= 0.0 { along + half } else { along - half };
    let c = offset.length_squared() - radius * radius;
    let (first, second) = if along >= 0.0 { (c / q, q) } else { (q, c / q) };
    let distance = if first > 0.0 { first } else { second };
    (distance > 0.0 && distance < nearest).then_some(ShapeHit { distance, weights: [0.0; 2] })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    #[test]
    fn a_ray_through_a_shared_edge_meets_one_of_its_triangles() {
        let mut rng = Pcg64::seed_from_u64(5);
        let mut random = || Vec3::new(rng.random(), rng.random(), rng.random()) * 2.0 - 1.0;
        for _ in 0..20_000 {
            let (a, b, c, d) = (random(), random(), random(), random());
            let origin = random() * 5.0;
            let share = random().x.abs();
            let on_edge = a + share * (b - a);
            let Some(direction) = (on_edge - origin).try_normalize() else { continue };
            // Only where the edge is no silhouette: the two triangles lie on both sides of it, seen from the origin.
            let plane = (a - origin).cross(b - origin);
            if (c - origin).dot(plane) * (d - origin).dot(plane) >= 0.0 {
                continue;
            }
            let ray = PreparedRay::new(origin, direction);
            let met = [[a, b, c], [b, a, d]].iter().any(|t| Shape::Triangle(*t).meet(&ray, f32::INFINITY).is_some());
            // The point on the edge is itself rounded, off the edge by some 1e-7: near its ends the ray may pass outside.
            assert!(met || !(0.001..0.999).contains(&share), "{a} {b} {c} {d} from {origin}");
        }
    }

    #[test]
    fn a_ball_is_met_on_its_surface_from_outside_and_inside() {
        let ball = Shape::Ball { centre: Vec3::new(1.0, 2.0, 3.0), radius: 0.5 };
        let at = |origin: Vec3| {
            let ray = PreparedRay::new(origin, Vec3::X);
            ball.meet(&ray, f32::INFINITY).map(|hit| origin.x + hit.distance)
        };
        assert!((at(Vec3::new(-1000.0, 2.0, 3.0)).unwrap() - 0.5).abs() < 1e-3);
        assert!((at(Vec3::new(1.1, 2.0, 3.0)).unwrap() - 1.5).abs() < 1e-6);
        assert!(at(Vec3::new(2.0, 2.0, 3.0)).is_none() && at(Vec3::new(0.0, 2.6, 3.0)).is_none());
    }
}
