//! Measured beside reference patches, as a picture.

use super::chart::Chart;
use super::fit::ColourFit;
use super::reference::rec709_of_d50;
use super::space::{D50, Lab, xyz_from_lab};
use crate::{Encoded, Image, srgb_encode};

/// The longer side of the picture, pixels.
const SIDE: f64 = 1200.0;
/// The display code of what is between the patches.
const BETWEEN: f32 = 0.25;

impl ColourFit {
    /// A picture of the chart, 1200 pixels on its longer side: of every patch the left third is what the camera saw, scaled to the exposure
    /// of the neutral patches; the middle third is corrected; the right third is the reference. Patches that were not fitted are left out;
    /// what no display shows is cut off.
    pub fn side_by_side(&self, chart: &Chart) -> Image<Encoded> {
        let around = chart.patches().iter().map(|patch| patch.rectangle);
        let around = around.reduce(|a, b| [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])]);
        let [left, top, right, bottom] = around.unwrap_or([0.0, 0.0, 1.0, 1.0]);
        // Patches of a chart much longer than wide still have a pixel.
        let scale = 0.95 * SIDE / (right - left).max(bottom - top);
        let rim = 0.025 * SIDE;
        let side = |length: f64| ((length * scale + 2.0 * rim).round() as usize).max(1);
        let (width, height) = (side(right - left), side(bottom - top));
        let mut pixels = vec![[BETWEEN; 3]; width * height];
        for fitted in &self.patches {
            let Some(patch) = chart.patches().iter().find(|patch| patch.name == fitted.name) else { continue };
            let place =
                |value: f64, start: f64, end: usize| (((value - start) * scale + rim).round() as usize).min(end);
            let [x0, y0, x1, y1] = patch.rectangle;
            for (third, lab) in [fitted.before, fitted.after, fitted.reference].into_iter().enumerate() {
                let edge = |third: usize| place(x0 + (x1 - x0) * third as f64 / 3.0, left, width);
                for row in place(y0, top, height)..place(y1, top, height) {
                    pixels[row * width + edge(third)..row * width + edge(third + 1)].fill(shown(lab));
                }
            }
        }
        Image::from_pixels(width, height, pixels)
    }
}

fn shown(lab: Lab) -> [f32; 3] {
    rec709_of_d50(xyz_from_lab(lab, D50)).map(|value| srgb_encode(value.clamp(0.0, 1.0)) as f32)
}
