//! The lamps of a light description, the rays that carry their flux, and what arrives from them at a point.

use std::f64::consts::PI;

use glam::DVec3;

use crate::sampling::{self, Cone};
use crate::{Disk, Rectangle, Slide, Sphere};

/// One lamp. Positions in metres, world frame; colours linear RGB.
#[derive(Clone, Debug)]
pub enum Lamp {
    /// Radiates equally in all directions.
    Point {
        /// Where it stands.
        position: DVec3,
        /// Radiant intensity, W·sr⁻¹.
        intensity: DVec3,
    },
    /// Full inside the beam, linear in angle from beam to cutoff, nothing beyond.
    Spot {
        /// Where it stands.
        position: DVec3,
        /// Unit direction of the axis, the way the light travels.
        axis: DVec3,
        /// Radiant intensity inside the beam, W·sr⁻¹.
        intensity: DVec3,
        /// Half angle of the beam, radians.
        beam_half_angle: f64,
        /// Half angle beyond which nothing shines, radians.
        cutoff_half_angle: f64,
    },
    /// A glowing ball.
    Sphere(Sphere),
    /// A glowing rectangle, one side.
    Rectangle(Rectangle),
    /// A glowing disk, one side.
    Disk(Disk),
    /// Parallel light from infinity.
    Sun {
        /// Unit direction, the way the light travels.
        direction: DVec3,
        /// Irradiance on a plane across the direction, W·m⁻².
        irradiance: DVec3,
    },
    /// Parallel light inside a cylinder that starts at `origin`: a beam through a hole.
    Shaft {
        /// Centre of the hole.
        origin: DVec3,
        /// Unit direction, the way the light travels.
        direction: DVec3,
        /// Radius of the hole, metres.
        radius_m: f64,
        /// Irradiance on a plane across the direction, W·m⁻².
        irradiance: DVec3,
    },
    /// A picture thrown from a point.
    Slide(Slide),
}

/// A ray that carries flux.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Where it starts: on the lamp; for a sun, upstream of the ball.
    pub origin: DVec3,
    /// Unit direction, the way the light travels.
    pub direction: DVec3,
    /// Flux, W: the mean over many uniform samples is the lamp's flux through the region it was asked for.
    pub flux: DVec3,
}

/// Light that arrives at a point from one direction.
#[derive(Clone, Copy, Debug)]
pub struct Arrival {
    /// Unit direction, the way the light travels.
    pub direction: DVec3,
    /// Irradiance on a plane across the direction, W·m⁻².
    pub irradiance: DVec3,
    /// How far it has come from the lamp, metres; infinite from the sun and the sky.
    pub distance_m: f64,
}

/// A lamp of finite extent as it is seen from a point in one direction.
#[derive(Clone, Copy, Debug)]
pub struct Sight {
    /// Radiance, W·m⁻²·sr⁻¹.
    pub radiance: DVec3,
    /// How far away it is, metres.
    pub distance_m: f64,
    /// The density, by solid angle, with which [`Lamp::arrival`] draws this direction for uniform numbers, sr⁻¹.
    pub density: f64,
}

impl Lamp {
    /// A ray that carries flux towards the ball of `ball_radius` metres at the origin, for four uniform numbers in [0, 1):
    /// the first two choose the direction (for parallel light the place in the beam), the other two the place on the lamp.
    /// Every ray of the lamp that meets the ball can be drawn; some that are drawn may miss it. `None` carries nothing.
    pub fn shoot(&self, ball_radius: f64, xi: [f64; 4]) -> Option<Ray> {
        let [a, b, ..] = xi;
        match self {
            Lamp::Point { position, intensity } => {
                let cone = Cone::towards_ball(*position, ball_radius);
                Some(Ray { origin: *position, direction: cone.sample(a, b), flux: *intensity * cone.solid_angle() })
            }
            Lamp::Spot { position, axis, cutoff_half_angle, .. } => {
                let beam = Cone::new(*axis, *cutoff_half_angle);
                let ball = Cone::towards_ball(*position, ball_radius);
                // Whichever cone is narrower wastes fewer rays.
                let cone = if beam.solid_angle() < ball.solid_angle() { beam } else { ball };
                let direction = cone.sample(a, b);
                let intensity = self.intensity_towards(direction)?;
                Some(Ray { origin: *position, direction, flux: intensity * cone.solid_angle() })
            }
            Lamp::Sphere(sphere) => Some(sphere.shoot(ball_radius, xi)),
            Lamp::Rectangle(rectangle) => rectangle.shoot(ball_radius, xi),
            Lamp::Disk(disk) => disk.shoot(ball_radius, xi),
            Lamp::Sun { direction, irradiance } => {
                let (x, y) = sampling::across(*direction);
                let point = ball_radius * sampling::disk(a, b);
                Some(Ray {
                    // Upstream of the whole ball.
                    origin: point.x * x + point.y * y - ball_radius * *direction,
                    direction: *direction,
                    flux: *irradiance * (PI * ball_radius * ball_radius),
                })
            }
            Lamp::Shaft { origin, direction, radius_m, irradiance } => {
                let (x, y) = sampling::across(*direction);
                let point = *radius_m * sampling::disk(a, b);
                Some(Ray {
                    origin: *origin + point.x * x + point.y * y,
                    direction: *direction,
                    flux: *irradiance * (PI * radius_m * radius_m),
                })
            }
            Lamp::Slide(slide) => Some(slide.shoot(a, b)),
        }
    }

    /// What arrives at `point`, for two uniform numbers in [0, 1) that choose the place on an extended lamp: the mean
    /// over many is the lamp's irradiance there. `None` where nothing arrives.
    pub fn arrival(&self, point: DVec3, xi: [f64; 2]) -> Option<Arrival> {
        let from = |position: DVec3| {
            let offset = point - position;
            let distance = offset.length();
            (distance > 0.0).then(|| (offset / distance, distance))
        };
        match self {
            Lamp::Point { position, intensity } => {
                let (direction, distance_m) = from(*position)?;
                Some(Arrival { direction, irradiance: *intensity / distance_m.powi(2), distance_m })
            }
            Lamp::Spot { position, .. } => {
                let (direction, distance_m) = from(*position)?;
                let irradiance = self.intensity_towards(direction)? / distance_m.powi(2);
                Some(Arrival { direction, irradiance, distance_m })
            }
            Lamp::Sphere(sphere) => sphere.arrival(point, xi),
            Lamp::Rectangle(rectangle) => rectangle.arrival(point, xi),
            Lamp::Disk(disk) => disk.arrival(point, xi),
            Lamp::Sun { direction, irradiance } => {
                Some(Arrival { direction: *direction, irradiance: *irradiance, distance_m: f64::INFINITY })
            }
            Lamp::Shaft { origin, direction, radius_m, irradiance } => {
                let offset = point - *origin;
                let along = offset.dot(*direction);
                let inside = along >= 0.0 && (offset - along * *direction).length() <= *radius_m;
                inside.then_some(Arrival { direction: *direction, irradiance: *irradiance, distance_m: along })
            }
            Lamp::Slide(slide) => {
                let (direction, distance_m) = from(slide.position())?;
                let irradiance = slide.intensity_towards(direction)? / distance_m.powi(2);
                Some(Arrival { direction, irradiance, distance_m })
            }
        }
    }

    /// The lamp as `point` sees it by light that travels in `direction`; `None` if it is not there, and always for point-like
    /// and parallel lamps, whose radiance is a delta.
    pub fn sight(&self, point: DVec3, direction: DVec3) -> Option<Sight> {
        match self {
            Lamp::Sphere(sphere) => sphere.sight(point, direction),
            Lamp::Rectangle(rectangle) => rectangle.sight(point, direction),
            Lamp::Disk(disk) => disk.sight(point, direction),
            Lamp::Point { .. } | Lamp::Spot { .. } | Lamp::Sun { .. } | Lamp::Shaft { .. } | Lamp::Slide(_) => None,
        }
    }

    /// The radiance that arrives at `point`, W·m⁻²·sr⁻¹, by light that travels in `direction`: zero where the lamp is not
    /// seen ([`Lamp::sight`]).
    pub fn radiance(&self, point: DVec3, direction: DVec3) -> DVec3 {
        self.sight(point, direction).map_or(DVec3::ZERO, |sight| sight.radiance)
    }

    fn intensity_towards(&self, direction: DVec3) -> Option<DVec3> {
        let Lamp::Spot { axis, intensity, beam_half_angle, cutoff_half_angle, .. } = self else { return None };
        // atan2 keeps small angles exact where acos would not.
        let angle = axis.cross(direction).length().atan2(axis.dot(direction));
        if angle <= *beam_half_angle {
            return Some(*intensity);
        }
        (angle < *cutoff_half_angle)
            .then(|| *intensity * ((cutoff_half_angle - angle) / (cutoff_half_angle - beam_half_angle)))
    }
}
