//! By how much one picture is shifted against another that was taken under other light.
//!
//! Orientation correlation (Fitch, Kadyrov, Christmas, Kittler 2002): a picture is reduced to the direction of its gradient, so
//! that strong and weak edges count alike, here with twice its angle, so that an edge counts alike from whichever side it is
//! lit; shifted by the phase of the cross-power spectrum, whitened by half. What stays under moving light is the edges of things and paint;
//! the edges of shadows move, and are outvoted where the rest has enough edges. A picture without any is not registered.

use super::fourier::{Complex, transformed};

/// Pixels of the longer side above which a picture is reduced before it is registered.
pub(super) const DETAIL: usize = 1536;
/// Pictures with a shorter side than this have too few edges.
const LEAST_SIDE: usize = 32;
/// A peak that stands less above the second one is not believed.
const LEAST_DISTINCT: f32 = 1.4;
/// Pixels around a peak that belong to it.
const PEAK_RADIUS: usize = 3;

/// The spectrum of a picture's orientations, transposed.
pub(super) struct Orientations {
    spectrum: Vec<Complex>,
    width: usize,
    height: usize,
}

impl Orientations {
    /// Of a picture in row-major order, radiance; `None` if it is too small or has no edges.
    pub(super) fn of(picture: &[f32], width: usize, height: usize) -> Option<Self> {
        if width.min(height) < LEAST_SIDE || picture.iter().any(|value| !value.is_finite()) {
            return None;
        }
        let mean = picture.iter().map(|value| f64::from(*value)).sum::<f64>() / picture.len() as f64;
        if mean <= 0.0 {
            return None;
        }
        // Ratios of radiance: a surface has the same edges in bright and in weak light; what is dark is mostly noise.
        let floor = (0.02 * mean) as f32;
        let log: Vec<f32> = picture.iter().map(|value| (value.max(0.0) + floor).ln()).collect();
        let smooth = |picture: &[f32]| along_y(&along_x(picture, width, &SMOOTH), width, height, &SMOOTH);
        let smooth = smooth(&log);
        let (gx, gy) = (along_x(&smooth, width, &SLOPE), along_y(&smooth, width, height, &SLOPE));
        let mut strengths: Vec<f32> = gx.iter().zip(&gy).map(|(x, y)| x.hypot(*y)).collect();
        let middle = strengths.len() / 2;
        let weak = *strengths.select_nth_unstable_by(middle, f32::total_cmp).1;
        let energy = (weak * weak).max(1e-8);
        let (padded_width, padded_height) = (width.next_power_of_two(), height.next_power_of_two());
        let mut oriented = vec![Complex::default(); padded_width * padded_height];
        for y in 0..height {
            for x in 0..width {
                let (gx, gy) = (gx[y * width + x], gy[y * width + x]);
                let factor = hann(x, width) * hann(y, height) / (gx * gx + gy * gy + energy);
                oriented[y * padded_width + x] = Complex { re: gx * gx - gy * gy, im: 2.0 * gx * gy }.scaled(factor);
            }
        }
        let spectrum = transformed(oriented, padded_width, padded_height);
        Some(Self { spectrum, width: padded_width, height: padded_height })
    }

    /// (dx, dy), pixels, by which this picture is shifted against `reference`; `None` if the pictures have too little in common
    /// to tell.
    pub(super) fn shift_from(&self, reference: &Self) -> Option<(f64, f64)> {
        let (width, height) = (self.width, self.height);
        let cross = self.spectrum.iter().zip(&reference.spectrum).map(|(here, there)| {
            let product = *here * there.conjugate();
            let strength = product.re.hypot(product.im).sqrt();
            // Conjugated, so that the forward transform inverts.
            product.conjugate().scaled(if strength > 0.0 { 1.0 / strength } else { 0.0 })
        });
        let correlation = transformed(cross.collect(), height, width);
        let at = |x: usize, y: usize| correlation[y % height * width + x % width].re;
        let (mut peak, mut best) = ((0, 0), f32::NEG_INFINITY);
        for (index, value) in correlation.iter().enumerate() {
            if value.re > best {
                (peak, best) = ((index % width, index / width), value.re);
            }
        }
        let near = |a: usize, b: usize, side: usize| {
            (a + side - b) % side <= PEAK_RADIUS || (b + side - a) % side <= PEAK_RADIUS
        };
        let second = correlation
            .iter()
            .enumerate()
            .filter(|(index, _)| !(near(index % width, peak.0, width) && near(index / width, peak.1, height)))
            .map(|(_, value)| value.re)
            .fold(f32::NEG_INFINITY, f32::max);
        if !(best > 0.0 && best >= LEAST_DISTINCT * second) {
            return None;
        }
        let (x, y) = peak;
        let dx = vertex(at(x + width - 1, y), best, at(x + 1, y));
        let dy = vertex(at(x, y + height - 1), best, at(x, y + 1));
        let signed =
            |value: usize, side: usize| if value > side / 2 { value as f64 - side as f64 } else { value as f64 };
        Some((signed(x, width) + dx, signed(y, height) + dy))
    }
}

/// Where the parabola through three values has its top, −½ … ½.
fn vertex(left: f32, middle: f32, right: f32) -> f64 {
    let curvature = f64::from(left) - 2.0 * f64::from(middle) + f64::from(right);
    if curvature < 0.0 { (0.5 * (f64::from(left) - f64::from(right)) / curvature).clamp(-0.5, 0.5) } else { 0.0 }
}

fn hann(index: usize, length: usize) -> f32 {
    let phase = (index as f64 + 0.5) / length as f64;
    (std::f64::consts::PI * phase).sin().powi(2) as f32
}

/// A Gaussian of one pixel, and the difference that takes its slope.
const SMOOTH: [f32; 5] = [0.054_488_68, 0.244_201_35, 0.402_619_95, 0.244_201_35, 0.054_488_68];
const SLOPE: [f32; 3] = [-0.5, 0.0, 0.5];

fn along_x(picture: &[f32], width: usize, kernel: &[f32]) -> Vec<f32> {
    let reach = kernel.len() / 2;
    let mut out = vec![0.0; picture.len()];
    for (row, out) in picture.chunks_exact(width).zip(out.chunks_exact_mut(width)) {
        for (x, value) in out.iter_mut().enumerate() {
            let tap = |index: usize| row[(x + index).saturating_sub(reach).min(width - 1)];
            *value = kernel.iter().enumerate().map(|(index, weight)| weight * tap(index)).sum();
        }
    }
    out
}

fn along_y(picture: &[f32], width: usize, height: usize, kernel: &[f32]) -> Vec<f32> {
    let reach = kernel.len() / 2;
    let mut out = vec![0.0; picture.len()];
    for (y, out) in out.chunks_exact_mut(width).enumerate() {
        for (index, weight) in kernel.iter().enumerate() {
            let row = (y + index).saturating_sub(reach).min(height - 1) * width;
            out.iter_mut().zip(&picture[row..row + width]).for_each(|(sum, value)| *sum += weight * value);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Painted fields under light from a side: shading turns with `light`, paint stays; shifted by (dx, dy).
    fn scene(light: f64, dx: f64, dy: f64) -> Vec<f32> {
        let (width, height) = (100, 70);
        let mut picture = vec![0.0; width * height];
        for (index, value) in picture.iter_mut().enumerate() {
            let (x, y) = ((index % width) as f64 - dx, (index / width) as f64 - dy);
            let paint = (0.37 * x).sin() * (0.29 * y + 0.004 * x * x).sin();
            let paint = 0.5 + 0.4 * (6.0 * paint).tanh();
            let shading = 1.0 + 0.45 * ((x - 50.0) / 60.0 * light.cos() + (y - 35.0) / 50.0 * light.sin());
            *value = (paint * shading) as f32;
        }
        picture
    }

    #[test]
    fn a_shift_is_measured_under_other_light() {
        let of = |light, dx, dy| Orientations::of(&scene(light, dx, dy), 100, 70).unwrap();
        let reference = of(0.3, 0.0, 0.0);
        // Whole pixels are found to a third of one; between them, under light from the other side, to one.
        for (light, dx, dy, within) in
            [(2.5, 0.0, 0.0, 0.3), (1.0, 2.0, -1.0, 0.3), (5.0, 7.0, 3.0, 0.3), (4.0, -0.5, 1.25, 1.0)]
        {
            let (x, y) = of(light, dx, dy).shift_from(&reference).unwrap();
            assert!((x - dx).abs() < within && (y - dy).abs() < within, "({dx}, {dy}) was found as ({x}, {y})");
        }
    }

    #[test]
    fn pictures_without_edges_or_with_nothing_in_common_are_not_registered() {
        assert!(Orientations::of(&[0.0; 64 * 64], 64, 64).is_none());
        assert!(Orientations::of(&[1.0; 16 * 64], 16, 64).is_none());
        let noise = |mut state: u64| -> Vec<f32> {
            (0..64 * 64)
                .map(|_| {
                    state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                    0.5 + (state >> 40) as f32 / (1 << 24) as f32
                })
                .collect()
        };
        let of = |seed| Orientations::of(&noise(seed), 64, 64).unwrap();
        assert_eq!(of(1).shift_from(&of(2)), None);
    }
}
