//! Light from far away: the same at every point, from the upper hemisphere.

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use relumine_radiometry::{Image, Radiance};

/// A light map around the scene, or a constant sky.
#[derive(Clone, Debug)]
pub struct Environment {
    sky: Sky,
    rotation: f64,
    scale: f64,
}

#[derive(Clone, Debug)]
enum Sky {
    Constant(DVec3),
    LatLong(Image<Radiance>),
}

impl Environment {
    /// The same radiance from everywhere above the horizon, W·m⁻²·sr⁻¹.
    pub fn constant(radiance: DVec3) -> Self {
        Self { sky: Sky::Constant(radiance), rotation: 0.0, scale: 1.0 }
    }

    /// A lat-long map: top row +z, middle column +x, azimuth growing to the left; pixel centres at
    /// tilt π (row + ½)/height and azimuth 2π (½ − (column + ½)/width).
    pub fn lat_long(map: Image<Radiance>) -> Self {
        Self { sky: Sky::LatLong(map), rotation: 0.0, scale: 1.0 }
    }

    /// Turned about +z, counter-clockwise seen from above, by `rotation` radians, and multiplied by `scale`.
    #[must_use]
    pub fn turned(mut self, rotation: f64, scale: f64) -> Self {
        self.rotation += rotation;
        self.scale *= scale;
        self
    }

    /// The radiance that comes from the unit vector `towards_sky`, W·m⁻²·sr⁻¹, bilinear between pixel centres; nothing
    /// comes from below the horizon.
    pub fn radiance(&self, towards_sky: DVec3) -> DVec3 {
        if towards_sky.z < 0.0 {
            return DVec3::ZERO;
        }
        let radiance = match &self.sky {
            Sky::Constant(radiance) => *radiance,
            Sky::LatLong(map) => self.look_up(map, towards_sky),
        };
        radiance * self.scale
    }

    fn look_up(&self, map: &Image<Radiance>, towards_sky: DVec3) -> DVec3 {
        let (width, height) = map.size();
        let azimuth = towards_sky.y.atan2(towards_sky.x) - self.rotation;
        let tilt = towards_sky.truncate().length().atan2(towards_sky.z);
        let x = (0.5 - azimuth / TAU).rem_euclid(1.0) * width as f64 - 0.5;
        let y = (tilt / PI * height as f64 - 0.5).clamp(0.0, (height - 1) as f64);
        let (left, right) = (x.floor(), x - x.floor());
        let (top, below) = (y.floor(), y - y.floor());
        let column = |i: i64| i.rem_euclid(width as i64) as usize;
        let columns = [column(left as i64), column(left as i64 + 1)];
        let rows = [top as usize, (top as usize + 1).min(height - 1)];
        let at = |i: usize, j: usize| DVec3::from_array(map.pixel(columns[i], rows[j]).map(f64::from));
        (at(0, 0) * (1.0 - right) + at(1, 0) * right) * (1.0 - below) + (at(0, 1) * (1.0 - right) + at(1, 1) * right) * below
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn compass() -> Image<Radiance> {
        // Columns: azimuth 135°, 45°, −45°, −135°.
        let row: Vec<[f32; 3]> = (0..4).map(|i| [i as f32, 0.0, 0.0]).collect();
        Image::from_pixels(4, 2, [row.clone(), row].concat())
    }

    #[test]
    fn the_middle_column_is_x_and_azimuth_grows_to_the_left() {
        let sky = Environment::lat_long(compass());
        let at = |azimuth_deg: f64| {
            let azimuth = azimuth_deg.to_radians();
            sky.radiance(DVec3::new(azimuth.cos(), azimuth.sin(), 0.5).normalize()).x
        };
        for (azimuth, value) in [(135.0, 0.0), (45.0, 1.0), (-45.0, 2.0), (-135.0, 3.0), (0.0, 1.5)] {
            assert!((at(azimuth) - value).abs() < 1e-9, "{azimuth}°: {}", at(azimuth));
        }
    }

    #[test]
    fn rotation_turns_counter_clockwise_seen_from_above() {
        let sky = Environment::lat_long(compass()).turned(90f64.to_radians(), 2.0);
        // What shone from azimuth 45° now shines from 135°.
        let towards = DVec3::new(-1.0, 1.0, 0.3).normalize();
        assert!((sky.radiance(towards).x - 2.0).abs() < 1e-9);
    }

    #[test]
    fn nothing_comes_from_below() {
        assert_eq!(Environment::constant(DVec3::ONE).radiance(-DVec3::Z), DVec3::ZERO);
    }
}
