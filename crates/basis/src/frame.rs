//! Positions on the hemisphere and the projector's frame at each.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::DVec3;

/// A position on the hemisphere as two angles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Position {
    /// Azimuth φp, radians, counter-clockwise from +x seen from above.
    pub azimuth: f64,
    /// Tilt θp, radians; 0 is the zenith, π/2 the horizon.
    pub tilt: f64,
}

impl Position {
    /// From degrees, as files and the command line give them.
    pub fn from_degrees(azimuth_deg: f64, tilt_deg: f64) -> Self {
        Self { azimuth: azimuth_deg.to_radians(), tilt: tilt_deg.to_radians() }
    }

    /// The position that lies in `direction` seen from the origin; the azimuth of the zenith is 0. Azimuth in [0, 2π).
    pub fn from_direction(direction: DVec3) -> Self {
        let azimuth = direction.y.atan2(direction.x).rem_euclid(TAU);
        // rem_euclid may round up to a whole turn.
        let azimuth = if azimuth >= TAU { 0.0 } else { azimuth };
        let tilt = direction.truncate().length().atan2(direction.z);
        Self { azimuth, tilt }
    }

    /// The unit vector `e_r` from the origin to the position.
    pub fn direction(self) -> DVec3 {
        let (sin_tilt, cos_tilt) = self.tilt.sin_cos();
        let (sin_azimuth, cos_azimuth) = self.azimuth.sin_cos();
        DVec3::new(sin_tilt * cos_azimuth, sin_tilt * sin_azimuth, cos_tilt)
    }

    /// The frame of a projector that stands here and looks at the origin.
    pub fn frame(self) -> ProjectorFrame {
        let (sin_tilt, cos_tilt) = self.tilt.sin_cos();
        let (sin_azimuth, cos_azimuth) = self.azimuth.sin_cos();
        ProjectorFrame {
            outward: DVec3::new(sin_tilt * cos_azimuth, sin_tilt * sin_azimuth, cos_tilt),
            right: DVec3::new(-sin_azimuth, cos_azimuth, 0.0),
            up: DVec3::new(-cos_tilt * cos_azimuth, -cos_tilt * sin_azimuth, sin_tilt),
        }
    }

    /// Whether the position is on the upper hemisphere, horizon included.
    pub fn is_above_horizon(self) -> bool {
        (0.0..=FRAC_PI_2 + 1e-9).contains(&self.tilt)
    }
}

/// The frame of a projector: right-handed, `right` × `up` = `outward`, which points away from the object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProjectorFrame {
    /// To the right as the projector sees the object, `e_φ`.
    pub right: DVec3,
    /// Upward as the projector sees the object, −`e_θ`.
    pub up: DVec3,
    /// From the object to the projector, `e_r`.
    pub outward: DVec3,
}

impl ProjectorFrame {
    /// The unit direction in which light leaves the projector through the tangent-plane point (s, t).
    pub fn world_from_projector(&self, s: f64, t: f64) -> DVec3 {
        (s * self.right + t * self.up - self.outward).normalize()
    }

    /// The tangent-plane coordinates (s, t) of light that travels in `direction`; `None` if it does not travel forward.
    pub fn projector_from_world(&self, direction: DVec3) -> Option<(f64, f64)> {
        let forward = -direction.dot(self.outward);
        (forward > 1e-12).then(|| (direction.dot(self.right) / forward, direction.dot(self.up) / forward))
    }
}
