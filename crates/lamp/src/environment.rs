//! Light from far away: the same at every point, from the upper hemisphere.

use std::borrow::Cow;
use std::f64::consts::{PI, TAU};

use glam::DVec3;
use relumine_radiometry::{Image, Radiance};

use crate::Arrival;

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

    /// Splits the light in two: what a smooth sky of at most `ceiling` (luminance) would shine, and the highlights above it.
    /// The two add up to the whole. Highlights are few and small, so they are drawn; the rest is integrated.
    pub fn split(&self, ceiling: f64) -> (impl Fn(DVec3) -> DVec3 + '_, Option<Highlights<'_>>) {
        let highlights = Highlights::new(Cow::Borrowed(self), ceiling);
        (move |towards_sky| under(self.radiance(towards_sky), ceiling), highlights)
    }

    /// All of the light as highlights: its directions are drawn by their brightness. `Err` with the light itself if there is
    /// no map to draw from.
    pub fn into_highlights(self) -> Result<Highlights<'static>, Self> {
        // Everything outshines a ceiling of zero.
        match self.sky {
            Sky::LatLong(_) => Highlights::new(Cow::Owned(self.clone()), 0.0).ok_or(self),
            Sky::Constant(_) => Err(self),
        }
    }

    /// Mean luminance of the upper hemisphere.
    pub fn mean_luminance(&self) -> f64 {
        match &self.sky {
            Sky::Constant(radiance) => luminance(*radiance) * self.scale,
            Sky::LatLong(map) => {
                let (sum, weight) = (0..map.height()).fold((0.0, 0.0), |(sum, weight), row| {
                    let (top, bottom) = row_cosines(row, map.height());
                    let band = (top - bottom.max(0.0)).max(0.0) / map.width() as f64;
                    let row = &map.pixels()[row * map.width()..][..map.width()];
                    let bright: f64 = row.iter().map(|pixel| luminance(DVec3::from_array(pixel.map(f64::from)))).sum();
                    (sum + band * bright, weight + band * map.width() as f64)
                });
                sum / weight * self.scale
            }
        }
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
        (at(0, 0) * (1.0 - right) + at(1, 0) * right) * (1.0 - below)
            + (at(0, 1) * (1.0 - right) + at(1, 1) * right) * below
    }
}

/// The parts of an environment map that outshine a ceiling, to be drawn as suns.
pub struct Highlights<'a> {
    environment: Cow<'a, Environment>,
    size: (usize, usize),
    ceiling: f64,
    /// Running sum of the pixels' shares, over the rows above the horizon.
    cumulative: Vec<f64>,
}

impl<'a> Highlights<'a> {
    fn new(environment: Cow<'a, Environment>, ceiling: f64) -> Option<Self> {
        let Sky::LatLong(map) = &environment.sky else { return None };
        let (width, height) = map.size();
        let excess = |x: usize, y: usize| {
            let radiance = DVec3::from_array(map.pixel(x, y).map(f64::from)) * environment.scale;
            (luminance(radiance) - ceiling).max(0.0)
        };
        let mut cumulative = Vec::with_capacity(width * height.div_ceil(2));
        let mut sum = 0.0;
        for y in 0..height.div_ceil(2) {
            let (top, bottom) = row_cosines(y, height);
            for x in 0..width {
                // Bilinear light reaches half a pixel over: neighbours share, so that no lit place is never drawn.
                let around: f64 = [y.saturating_sub(1), y, (y + 1).min(height - 1)]
                    .iter()
                    .flat_map(|y| [x + width - 1, x, x + 1].map(|x| excess(x % width, *y)))
                    .sum();
                sum += (around / 9.0) * (top - bottom);
                cumulative.push(sum);
            }
        }
        (sum > 0.0).then_some(Self { size: (width, height), ceiling, cumulative, environment })
    }

    /// One direction of the highlights and its share of their irradiance, for two uniform numbers in [0, 1).
    pub fn arrival(&self, [a, b]: [f64; 2]) -> Option<Arrival> {
        let (width, height) = self.size;
        let all = *self.cumulative.last()?;
        let at = a * all;
        let index = self.cumulative.partition_point(|sum| *sum <= at).min(self.cumulative.len() - 1);
        let before = if index == 0 { 0.0 } else { self.cumulative[index - 1] };
        let share = self.cumulative[index] - before;
        // What is left of the first number places the direction inside the pixel.
        let across = ((at - before) / share).clamp(0.0, 1.0);
        let (x, y) = (index % width, index / width);
        let (top, bottom) = row_cosines(y, height);
        let cosine = top + b * (bottom - top);
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        let azimuth = (0.5 - (x as f64 + across) / width as f64) * TAU + self.environment.rotation;
        let towards_sky = DVec3::new(sine * azimuth.cos(), sine * azimuth.sin(), cosine);
        let radiance = self.environment.radiance(towards_sky);
        let solid_angle = (top - bottom) * TAU / width as f64;
        let irradiance = (radiance - under(radiance, self.ceiling)) * (solid_angle * all / share);
        let arrival = Arrival { direction: -towards_sky, irradiance, distance_m: f64::INFINITY };
        (irradiance != DVec3::ZERO).then_some(arrival)
    }
}

impl Highlights<'_> {
    /// The light that they are part of.
    pub fn environment(&self) -> &Environment {
        &self.environment
    }

    /// The density, by solid angle, with which [`Highlights::arrival`] draws the unit vector `towards_sky`, sr⁻¹.
    pub fn density(&self, towards_sky: DVec3) -> f64 {
        let (width, height) = self.size;
        let azimuth = towards_sky.y.atan2(towards_sky.x) - self.environment.rotation;
        let tilt = towards_sky.truncate().length().atan2(towards_sky.z);
        let x = ((0.5 - azimuth / TAU).rem_euclid(1.0) * width as f64) as usize;
        let y = (tilt / PI * height as f64) as usize;
        let index = y * width + x.min(width - 1);
        let Some((all, sum)) = self.cumulative.last().zip(self.cumulative.get(index)) else { return 0.0 };
        let before = if index == 0 { 0.0 } else { self.cumulative[index - 1] };
        let (top, bottom) = row_cosines(y, height);
        (sum - before) / (all * (top - bottom) * TAU / width as f64)
    }
}

fn luminance(radiance: DVec3) -> f64 {
    radiance.dot(DVec3::new(0.2126, 0.7152, 0.0722))
}

/// The same colour, its luminance at most `ceiling`.
fn under(radiance: DVec3, ceiling: f64) -> DVec3 {
    let luminance = luminance(radiance);
    if luminance > ceiling { radiance * (ceiling / luminance) } else { radiance }
}

/// Cosines of the tilt at the upper and lower edge of a row of a lat-long map.
fn row_cosines(row: usize, height: usize) -> (f64, f64) {
    ((PI * row as f64 / height as f64).cos(), (PI * (row + 1) as f64 / height as f64).cos())
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
    fn the_smooth_part_and_the_highlights_are_the_whole_light() {
        let mut map = Image::<Radiance>::from_pixels(32, 16, vec![[0.5; 3]; 512]);
        map.pixels_mut()[3 * 32 + 7] = [90.0, 60.0, 30.0];
        map.pixels_mut()[31] = [0.0, 20.0, 0.0];
        let sky = Environment::lat_long(map).turned(0.3, 2.0);
        let (smooth, highlights) = sky.split(1.5);
        let highlights = highlights.unwrap();
        // Horizontal irradiance of both parts against that of the whole.
        let n = 600;
        let (mut whole, mut parts) = (DVec3::ZERO, DVec3::ZERO);
        for i in 0..n {
            for j in 0..n {
                let (a, b) = ((i as f64 + 0.5) / n as f64, (j as f64 + 0.5) / n as f64);
                let (z, azimuth) = (b, a * TAU);
                let r = (1.0 - z * z).sqrt();
                let towards_sky = DVec3::new(r * azimuth.cos(), r * azimuth.sin(), z);
                whole += sky.radiance(towards_sky) * z * TAU;
                parts += smooth(towards_sky) * z * TAU;
                if let Some(arrival) = highlights.arrival([a, b]) {
                    parts += arrival.irradiance * -arrival.direction.z;
                }
            }
        }
        assert!((parts / whole - DVec3::ONE).abs().max_element() < 2e-3, "{}", parts / whole);
        assert!(Environment::constant(DVec3::ONE).split(2.0).1.is_none());
    }

    #[test]
    fn highlights_are_drawn_with_the_density_they_say() {
        let mut map = Image::<Radiance>::from_pixels(16, 9, vec![[0.5; 3]; 144]);
        map.pixels_mut()[3 * 16 + 7] = [90.0, 60.0, 30.0];
        let sky = Environment::lat_long(map).turned(0.3, 2.0);
        let whole = sky.clone().into_highlights().unwrap();
        for i in 0..50 {
            for j in 0..50 {
                let arrival = whole.arrival([(f64::from(i) + 0.5) / 50.0, (f64::from(j) + 0.5) / 50.0]);
                // Below the horizon, in the half row that an odd map has there, nothing shines.
                let Some(arrival) = arrival else { continue };
                let radiance = sky.radiance(-arrival.direction);
                let density = whole.density(-arrival.direction);
                assert!((radiance.x / arrival.irradiance.x / density - 1.0).abs() < 1e-6, "{density}");
            }
        }
    }

    #[test]
    fn nothing_comes_from_below() {
        assert_eq!(Environment::constant(DVec3::ONE).radiance(-DVec3::Z), DVec3::ZERO);
    }
}
