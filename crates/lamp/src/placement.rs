//! Where the object stands within the light (figs. 11, 12).

use glam::DVec3;

use crate::{Disk, Lamp, Rectangle, Sphere};

/// The object's place in the world of the light: turned about +z, then moved.
///
/// The capture knows only the object's own frame, so it is the light that is moved the other way:
/// p_object = Rz(−rotation) (p_world − translation).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Placement {
    /// Metres.
    pub translation: DVec3,
    /// About +z, counter-clockwise seen from above, radians.
    pub rotation: f64,
}

impl Placement {
    /// Whether the object stands where it was captured.
    pub fn is_identity(&self) -> bool {
        *self == Self::default()
    }

    /// A direction of the world as the object sees it.
    pub fn object_from_world_direction(&self, direction: DVec3) -> DVec3 {
        turned(direction, -self.rotation)
    }

    /// A point of the world as the object sees it.
    pub fn object_from_world_point(&self, point: DVec3) -> DVec3 {
        turned(point - self.translation, -self.rotation)
    }

    /// A direction of the object's frame in the world.
    pub fn world_from_object_direction(&self, direction: DVec3) -> DVec3 {
        turned(direction, self.rotation)
    }

    /// A point of the object's frame in the world.
    pub fn world_from_object_point(&self, point: DVec3) -> DVec3 {
        turned(point, self.rotation) + self.translation
    }

    /// A lamp of the world as the object sees it.
    pub fn object_from_world_lamp(&self, lamp: &Lamp) -> Lamp {
        let point = |p: DVec3| self.object_from_world_point(p);
        let way = |d: DVec3| self.object_from_world_direction(d);
        match lamp.clone() {
            Lamp::Point { position, intensity } => Lamp::Point { position: point(position), intensity },
            Lamp::Spot { position, axis, intensity, beam_half_angle, cutoff_half_angle } => {
                Lamp::Spot { position: point(position), axis: way(axis), intensity, beam_half_angle, cutoff_half_angle }
            }
            Lamp::Sphere(sphere) => Lamp::Sphere(Sphere { center: point(sphere.center), ..sphere }),
            Lamp::Rectangle(rectangle) => Lamp::Rectangle(Rectangle {
                corner: point(rectangle.corner),
                edge_u: way(rectangle.edge_u),
                edge_v: way(rectangle.edge_v),
                ..rectangle
            }),
            Lamp::Disk(disk) => Lamp::Disk(Disk { center: point(disk.center), normal: way(disk.normal), ..disk }),
            Lamp::Sun { direction, irradiance } => Lamp::Sun { direction: way(direction), irradiance },
            Lamp::Shaft { origin, direction, radius_m, irradiance } => {
                Lamp::Shaft { origin: point(origin), direction: way(direction), radius_m, irradiance }
            }
            Lamp::Slide(slide) => Lamp::Slide(slide.placed(self)),
        }
    }
}

fn turned(vector: DVec3, angle: f64) -> DVec3 {
    let (sine, cosine) = angle.sin_cos();
    DVec3::new(cosine * vector.x - sine * vector.y, sine * vector.x + cosine * vector.y, vector.z)
}
