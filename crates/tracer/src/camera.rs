//! The pinhole camera.

use glam::DVec3;

/// A pinhole camera. World frame, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    position: DVec3,
    right: DVec3,
    up: DVec3,
    forward: DVec3,
    half_width: f64,
}

impl Camera {
    /// A camera at `position` that looks at `target`, upright with respect to `up`, and sees `horizontal_fov` radians from
    /// the left border of the picture to the right. `None` if there is no such camera: it looks nowhere or along `up`, or
    /// the angle is not between 0 and π.
    pub fn new(position: DVec3, target: DVec3, up: DVec3, horizontal_fov: f64) -> Option<Self> {
        let forward = (target - position).try_normalize()?;
        let right = forward.cross(up).try_normalize()?;
        let half_width = (horizontal_fov / 2.0).tan();
        let sees = horizontal_fov > 0.0 && horizontal_fov < std::f64::consts::PI && half_width.is_finite();
        sees.then(|| Self { position, right, up: right.cross(forward), forward, half_width })
    }

    /// Where it stands.
    pub fn position(&self) -> DVec3 {
        self.position
    }

    /// The unit direction of the point (x, y) of a picture of `width` × `height` square pixels: (0, 0) is its upper left
    /// corner, pixel centres lie at halves.
    pub fn towards(&self, x: f64, y: f64, width: usize, height: usize) -> DVec3 {
        let side = 2.0 * self.half_width / width as f64;
        let (s, t) = ((x - width as f64 / 2.0) * side, (height as f64 / 2.0 - y) * side);
        (self.forward + s * self.right + t * self.up).normalize()
    }

    /// The point of a picture that shows `point`; `None` behind the camera.
    pub fn picture_of(&self, point: DVec3, width: usize, height: usize) -> Option<(f64, f64)> {
        let offset = point - self.position;
        let depth = offset.dot(self.forward);
        let side = 2.0 * self.half_width / width as f64;
        (depth > 0.0).then(|| {
            let (s, t) = (offset.dot(self.right) / depth, offset.dot(self.up) / depth);
            (s / side + width as f64 / 2.0, height as f64 / 2.0 - t / side)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_point_of_the_picture_comes_home() {
        let camera = Camera::new(DVec3::new(1.0, -4.0, 2.0), DVec3::new(0.0, 0.3, 0.1), DVec3::Z, 0.5).unwrap();
        for (x, y) in [(0.0, 0.0), (13.5, 88.25), (150.0, 100.0), (75.0, 50.0)] {
            let point = camera.position() + 3.7 * camera.towards(x, y, 150, 100);
            let (u, v) = camera.picture_of(point, 150, 100).unwrap();
            assert!((u - x).abs() < 1e-9 && (v - y).abs() < 1e-9, "({x}, {y}) came back as ({u}, {v})");
        }
        let centre = camera.towards(75.0, 50.0, 150, 100);
        assert!((camera.position() + centre * 4.5 - DVec3::new(0.0, 0.3, 0.1)).length() < 0.5);
        let border = camera.towards(0.0, 50.0, 150, 100);
        assert!((border.dot(centre).acos() - 0.25).abs() < 1e-9, "half the angle of view");
    }

    #[test]
    fn what_looks_nowhere_is_no_camera() {
        let camera = |target: DVec3, fov: f64| Camera::new(DVec3::ZERO, target, DVec3::Z, fov);
        assert!(camera(DVec3::X, 1.0).is_some());
        assert!(camera(DVec3::ZERO, 1.0).is_none() && camera(DVec3::Z, 1.0).is_none());
        assert!(
            camera(DVec3::X, 0.0).is_none() && camera(DVec3::X, 3.2).is_none() && camera(DVec3::X, f64::NAN).is_none()
        );
    }
}
