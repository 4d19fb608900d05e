//! A slide projector: a picture thrown from a point, lighting a flat screen evenly where the picture is white.

use glam::DVec3;
use relumine_radiometry::{Image, Radiance};

use crate::{Placement, Ray};

/// A slide projector. Its intensity where the picture is white is I₀/cos³a, a the angle from the axis (docs/MATH.md).
#[derive(Clone, Debug)]
pub struct Slide {
    position: DVec3,
    right: DVec3,
    up: DVec3,
    axis: DVec3,
    half_width: f64,
    half_height: f64,
    intensity: DVec3,
    picture: Image<Radiance>,
}

impl Slide {
    /// A projector at `position` that looks along the unit vector `axis`, upright with respect to `up`, and throws
    /// `picture` over a half angle whose tangent is `half_width`; `intensity` on the axis, where the picture is 1, W·sr⁻¹.
    /// `None` if `up` is parallel to the axis or the picture is empty.
    pub fn new(
        position: DVec3,
        axis: DVec3,
        up: DVec3,
        half_width: f64,
        intensity: DVec3,
        picture: Image<Radiance>,
    ) -> Option<Self> {
        let right = axis.cross(up).try_normalize()?;
        let (width, height) = picture.size();
        if width == 0 || height == 0 {
            return None;
        }
        let half_height = half_width * height as f64 / width as f64;
        Some(Self { position, right, up: right.cross(axis), axis, half_width, half_height, intensity, picture })
    }

    pub(crate) fn position(&self) -> DVec3 {
        self.position
    }

    pub(crate) fn placed(&self, placement: &Placement) -> Self {
        Self {
            position: placement.object_from_world_point(self.position),
            right: placement.object_from_world_direction(self.right),
            up: placement.object_from_world_direction(self.up),
            axis: placement.object_from_world_direction(self.axis),
            ..self.clone()
        }
    }

    /// The picture's value at the tangent-plane point (s, t), t upward: the pixel it falls in.
    fn picture_at(&self, s: f64, t: f64) -> Option<DVec3> {
        let (width, height) = self.picture.size();
        let x = (s / self.half_width + 1.0) / 2.0 * width as f64;
        let y = (1.0 - t / self.half_height) / 2.0 * height as f64;
        if !(x >= 0.0 && y >= 0.0 && x < width as f64 && y < height as f64) {
            return None;
        }
        Some(DVec3::from_array(self.picture.pixel(x as usize, y as usize).map(f64::from)))
    }

    pub(crate) fn shoot(&self, a: f64, b: f64) -> Ray {
        let (s, t) = ((2.0 * a - 1.0) * self.half_width, (1.0 - 2.0 * b) * self.half_height);
        let value = self.picture_at(s, t).unwrap_or_default();
        // I(a) dω = I₀/cos³a · cos³a ds dt: even on the tangent plane.
        let area = 4.0 * self.half_width * self.half_height;
        Ray {
            origin: self.position,
            direction: (self.axis + s * self.right + t * self.up).normalize(),
            flux: self.intensity * value * area,
        }
    }

    pub(crate) fn intensity_towards(&self, direction: DVec3) -> Option<DVec3> {
        let cosine = direction.dot(self.axis);
        if cosine <= 1e-9 {
            return None;
        }
        let (s, t) = (direction.dot(self.right) / cosine, direction.dot(self.up) / cosine);
        Some(self.intensity * self.picture_at(s, t)? / cosine.powi(3))
    }
}
