//! Lamps of finite extent and constant radiance: sphere, rectangle, disk.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use crate::sampling::{self, Cone};
use crate::{Arrival, Ray, Sight};

/// A glowing ball.
#[derive(Clone, Copy, Debug)]
pub struct Sphere {
    /// Centre, metres.
    pub center: DVec3,
    /// Radius, metres.
    pub radius_m: f64,
    /// Radiance, W·m⁻²·sr⁻¹.
    pub radiance: DVec3,
}

impl Sphere {
    pub(crate) fn shoot(&self, ball_radius: f64, [a, b, c, d]: [f64; 4]) -> Ray {
        // In every direction the ball shows the same disk: choose the direction, then the place on the disk.
        let cone = Cone::towards_ball(self.center, ball_radius + self.radius_m);
        let direction = cone.sample(a, b);
        let (x, y) = sampling::across(direction);
        let point = self.radius_m * sampling::disk(c, d);
        Ray {
            origin: self.center + point.x * x + point.y * y,
            direction,
            flux: self.radiance * (cone.solid_angle() * PI * self.radius_m * self.radius_m),
        }
    }

    pub(crate) fn arrival(&self, point: DVec3, [a, b]: [f64; 2]) -> Option<Arrival> {
        let cone = self.cone(point)?;
        let direction = cone.sample(a, b);
        let distance_m = self.distance(point, direction).unwrap_or_else(|| {
            // A direction on the rim may miss the ball by its rounding.
            (point - self.center).dot(direction)
        });
        Some(Arrival { direction, irradiance: self.radiance * cone.solid_angle(), distance_m })
    }

    pub(crate) fn sight(&self, point: DVec3, direction: DVec3) -> Option<Sight> {
        let cone = self.cone(point)?;
        let distance_m = self.distance(point, direction)?;
        Some(Sight { radiance: self.radiance, distance_m, density: 1.0 / cone.solid_angle() })
    }

    /// The directions of its light at `point`; `None` inside it.
    fn cone(&self, point: DVec3) -> Option<Cone> {
        let offset = self.center - point;
        let distance = offset.length();
        (distance > self.radius_m).then(|| Cone::new(-offset / distance, (self.radius_m / distance).asin()))
    }

    /// How far light that reaches `point` in `direction` has come from the ball.
    fn distance(&self, point: DVec3, direction: DVec3) -> Option<f64> {
        let offset = point - self.center;
        let along = offset.dot(direction);
        let squared = self.radius_m * self.radius_m - (offset - along * direction).length_squared();
        (along > 0.0 && squared >= 0.0).then(|| along - squared.sqrt())
    }
}

/// A glowing rectangle that shines on the side of `edge_u` × `edge_v`.
#[derive(Clone, Copy, Debug)]
pub struct Rectangle {
    /// One corner, metres.
    pub corner: DVec3,
    /// One edge from the corner, metres.
    pub edge_u: DVec3,
    /// The other edge from the corner, metres.
    pub edge_v: DVec3,
    /// Radiance, W·m⁻²·sr⁻¹.
    pub radiance: DVec3,
}

impl Rectangle {
    fn face(&self) -> Face {
        let normal = self.edge_u.cross(self.edge_v);
        Face { normal: normal.normalize(), area: normal.length(), radiance: self.radiance }
    }

    fn place(&self, c: f64, d: f64) -> DVec3 {
        self.corner + c * self.edge_u + d * self.edge_v
    }

    pub(crate) fn shoot(&self, ball_radius: f64, [a, b, c, d]: [f64; 4]) -> Option<Ray> {
        self.face().shoot(self.place(c, d), ball_radius, a, b)
    }

    pub(crate) fn arrival(&self, point: DVec3, [c, d]: [f64; 2]) -> Option<Arrival> {
        self.face().arrival(self.place(c, d), point)
    }

    pub(crate) fn sight(&self, point: DVec3, direction: DVec3) -> Option<Sight> {
        let face = self.face();
        let (hit, sight) = face.hit(self.corner, point, direction)?;
        // Coordinates of the hit along the edges, which need not be at right angles.
        let normal = self.edge_u.cross(self.edge_v);
        let offset = hit - self.corner;
        let u = offset.cross(self.edge_v).dot(normal) / normal.length_squared();
        let v = self.edge_u.cross(offset).dot(normal) / normal.length_squared();
        let inside = (0.0..=1.0).contains(&u) && (0.0..=1.0).contains(&v);
        inside.then_some(sight)
    }
}

/// A glowing disk that shines along its normal.
#[derive(Clone, Copy, Debug)]
pub struct Disk {
    /// Centre, metres.
    pub center: DVec3,
    /// Unit normal.
    pub normal: DVec3,
    /// Radius, metres.
    pub radius_m: f64,
    /// Radiance, W·m⁻²·sr⁻¹.
    pub radiance: DVec3,
}

impl Disk {
    fn face(&self) -> Face {
        Face { normal: self.normal, area: TAU / 2.0 * self.radius_m * self.radius_m, radiance: self.radiance }
    }

    fn place(&self, c: f64, d: f64) -> DVec3 {
        let (x, y) = sampling::across(self.normal);
        let point = self.radius_m * sampling::disk(c, d);
        self.center + point.x * x + point.y * y
    }

    pub(crate) fn shoot(&self, ball_radius: f64, [a, b, c, d]: [f64; 4]) -> Option<Ray> {
        self.face().shoot(self.place(c, d), ball_radius, a, b)
    }

    pub(crate) fn arrival(&self, point: DVec3, [c, d]: [f64; 2]) -> Option<Arrival> {
        self.face().arrival(self.place(c, d), point)
    }

    pub(crate) fn sight(&self, point: DVec3, direction: DVec3) -> Option<Sight> {
        let (hit, sight) = self.face().hit(self.center, point, direction)?;
        (hit.distance(self.center) <= self.radius_m).then_some(sight)
    }
}

/// What flat lamps have in common.
struct Face {
    normal: DVec3,
    area: f64,
    radiance: DVec3,
}

impl Face {
    fn shoot(&self, place: DVec3, ball_radius: f64, a: f64, b: f64) -> Option<Ray> {
        let cone = Cone::towards_ball(place, ball_radius);
        let direction = cone.sample(a, b);
        let cosine = direction.dot(self.normal);
        (cosine > 0.0).then(|| Ray {
            origin: place,
            direction,
            flux: self.radiance * (cosine * self.area * cone.solid_angle()),
        })
    }

    fn arrival(&self, place: DVec3, point: DVec3) -> Option<Arrival> {
        let offset = point - place;
        let direction = offset.try_normalize()?;
        let cosine = direction.dot(self.normal);
        (cosine > 0.0).then(|| Arrival {
            direction,
            irradiance: self.radiance * (cosine * self.area / offset.length_squared()),
            distance_m: offset.length(),
        })
    }

    /// Where light that reaches `point` in `direction` left the plane through `origin`, if it left the bright side, and what
    /// is seen there.
    fn hit(&self, origin: DVec3, point: DVec3, direction: DVec3) -> Option<(DVec3, Sight)> {
        let cosine = direction.dot(self.normal);
        let distance_m = (point - origin).dot(self.normal) / cosine;
        (cosine > 1e-12 && distance_m > 0.0).then(|| {
            let density = distance_m * distance_m / (cosine * self.area);
            (point - distance_m * direction, Sight { radiance: self.radiance, distance_m, density })
        })
    }
}
