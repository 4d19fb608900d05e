//! A photograph of a chart as a virtual camera takes it: in perspective, under light that falls off, with a surround, noise
//! and crosstalk between the channels.

use super::radiometry::Homography;
use super::radiometry::colour::{Chart, Reference};
use super::radiometry::{Counts, Image, Linear, srgb_encode};

/// How the chart is photographed.
#[derive(Clone, Copy)]
pub(crate) struct Scene {
    pub(crate) size: [usize; 2],
    /// Where the chart's corners lie: top left, top right, bottom right, bottom left.
    pub(crate) corners: [[f64; 2]; 4],
    /// Camera RGB of linear Rec. 709.
    pub(crate) camera: [[f64; 3]; 3],
    /// What a perfect diffuser gives in the middle, of the range.
    pub(crate) exposure: f64,
    /// How much brighter the light is at the right border than at the left, of its mean.
    pub(crate) fall_off: f64,
    /// Standard deviation of the noise where a perfect diffuser stands; it goes with the root of the light.
    pub(crate) noise: f64,
}

/// The chart's corners in the photograph: 420 pixels long, seen from the side.
pub(crate) const CORNERS: [[f64; 2]; 4] = [[131.0, 96.0], [532.0, 121.0], [517.0, 371.0], [122.0, 389.0]];

/// Channels that mix, rows red, green, blue; grey stays grey.
pub(crate) const CROSSTALK: [[f64; 3]; 3] = [[0.72, 0.22, 0.06], [0.12, 0.76, 0.12], [0.04, 0.24, 0.72]];

impl Scene {
    pub(crate) fn plain() -> Self {
        Self { size: [640, 480], corners: CORNERS, camera: CROSSTALK, exposure: 0.8, fall_off: 0.0, noise: 0.0 }
    }

    /// The same, camera and all turned by quarters of a turn, clockwise.
    #[allow(dead_code)] // not every test turns
    pub(crate) fn turned(mut self, quarters: usize) -> Self {
        for _ in 0..quarters {
            let [width, height] = self.size;
            self.corners = self.corners.map(|[x, y]| [height as f64 - y, x]);
            self.size = [height, width];
        }
        self
    }

    pub(crate) fn photograph(&self, chart: &Chart, reference: &Reference) -> Image<Linear> {
        let [width, height] = self.size;
        let pairs: Vec<_> = self.corners.into_iter().zip(chart.corners()).collect();
        let map = Homography::fit(&pairs).unwrap();
        let patches: Vec<([f64; 4], [f64; 3])> =
            chart.patches().iter().map(|patch| (patch.rectangle, reference.rec709(&patch.name).unwrap())).collect();
        let around = patches.iter().map(|patch| patch.0);
        let [left, top, right, bottom] =
            around.reduce(|a, b| [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])]).unwrap();
        let rim = 0.08 * (bottom - top);
        let at = |x: f64, y: f64| {
            let [u, v] = map.apply([x, y]);
            let inside = |r: &[f64; 4]| (r[0]..r[2]).contains(&u) && (r[1]..r[3]).contains(&v);
            match patches.iter().find(|patch| inside(&patch.0)) {
                Some((_, colour)) => *colour,
                None if inside(&[left - rim, top - rim, right + rim, bottom + rim]) => [0.032, 0.032, 0.034],
                // A table with a grain, a dozen pixels wide.
                None => {
                    let grain = (0.31 * x).sin() * (0.27 * y + 0.1 * x).sin();
                    [0.35 + 0.15 * grain, 0.25 + 0.1 * grain, 0.15 + 0.05 * grain]
                }
            }
        };
        let mut random = Random(0x2545_f491_4f6c_dd1d);
        let mut pixels = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                let mut sum = [0.0; 3];
                for part in 0..4 {
                    let (dx, dy) = (f64::from(part % 2) / 2.0 + 0.25, f64::from(part / 2) / 2.0 + 0.25);
                    let colour = at(x as f64 + dx, y as f64 + dy);
                    (0..3).for_each(|channel| sum[channel] += colour[channel] / 4.0);
                }
                let light = self.exposure * (1.0 + self.fall_off * (x as f64 / width as f64 - 0.5));
                pixels.push(self.camera.map(|row| {
                    let value = light * (0..3).map(|k| row[k] * sum[k]).sum::<f64>();
                    (value + self.noise * (self.exposure * value.max(0.0)).sqrt() * random.normal()) as f32
                }));
            }
        }
        Image::from_pixels(width, height, pixels)
    }
}

/// As a camera stores it for a display: 8 bits, sRGB.
#[allow(dead_code)] // not every test stores
pub(crate) fn display_codes(picture: &Image<Linear>) -> Image<Counts> {
    let code = |value: f32| (srgb_encode(f64::from(value).clamp(0.0, 1.0)) * 255.0).round() as u16;
    let pixels = picture.pixels().iter().map(|pixel| pixel.map(code)).collect();
    Image::from_pixels(picture.width(), picture.height(), pixels)
}

struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.unit()).sum::<f64>() - 6.0
    }
}
