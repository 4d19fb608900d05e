//! Points and directions from uniform numbers in [0, 1).

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

/// Uniform on the unit disk (Shirley & Chiu 1997: squares to sectors, strata stay compact).
pub(crate) fn disk(a: f64, b: f64) -> DVec2 {
    let (x, y) = (2.0 * a - 1.0, 2.0 * b - 1.0);
    if x == 0.0 && y == 0.0 {
        return DVec2::ZERO;
    }
    let (radius, angle) =
        if x.abs() > y.abs() { (x, TAU / 8.0 * (y / x)) } else { (y, TAU / 4.0 - TAU / 8.0 * (x / y)) };
    radius * DVec2::new(angle.cos(), angle.sin())
}

/// Two unit vectors that make a right-handed frame with the unit vector `axis` (Duff et al. 2017).
pub(crate) fn across(axis: DVec3) -> (DVec3, DVec3) {
    let sign = 1.0f64.copysign(axis.z);
    let a = -1.0 / (sign + axis.z);
    let b = axis.x * axis.y * a;
    (
        DVec3::new(1.0 + sign * axis.x * axis.x * a, sign * b, -sign * axis.x),
        DVec3::new(b, sign + axis.y * axis.y * a, -axis.y),
    )
}

/// A cone of directions around a unit axis, or the whole sphere.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cone {
    axis: DVec3,
    /// 1 − the cosine of the half angle: small cones keep their digits.
    versine: f64,
}

impl Cone {
    pub(crate) fn new(axis: DVec3, half_angle: f64) -> Self {
        Self { axis, versine: 2.0 * (half_angle / 2.0).sin().powi(2) }
    }

    /// The directions from `point` that meet the ball of `radius` at the origin; all of them from inside the ball.
    pub(crate) fn towards_ball(point: DVec3, radius: f64) -> Self {
        let distance = point.length();
        if distance <= radius {
            return Self { axis: DVec3::Z, versine: 2.0 };
        }
        let squared = (radius / distance).powi(2);
        Self { axis: -point / distance, versine: squared / (1.0 + (1.0 - squared).sqrt()) }
    }

    /// Solid angle, sr.
    pub(crate) fn solid_angle(&self) -> f64 {
        TAU * self.versine
    }

    /// A direction, uniform by solid angle.
    pub(crate) fn sample(&self, a: f64, b: f64) -> DVec3 {
        let versine = a * self.versine;
        let (cosine, sine) = (1.0 - versine, (versine * (2.0 - versine)).max(0.0).sqrt());
        let (x, y) = across(self.axis);
        (sine * ((TAU * b).cos() * x + (TAU * b).sin() * y) + cosine * self.axis).normalize()
    }
}
