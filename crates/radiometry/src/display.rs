//! From radiance to display codes, the one place where it happens, and back.

use crate::{Encoded, Image, Radiance};

/// How radiance above the display's white is brought into its range.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tone {
    /// Cut off at white: what is below is shown as it is.
    #[default]
    Clip,
    /// Roll highlights off on a filmic curve: the fit by K. Narkowicz (2016) to the ACES reference rendering.
    Filmic,
}

/// Exposure, tone curve, sRGB encoding, in this order.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Display {
    /// Stops: radiance is multiplied by 2^stops.
    pub exposure_stops: f32,
    /// How highlights are treated.
    pub tone: Tone,
}

impl Display {
    /// The picture to show; negative radiance is shown black.
    pub fn encode(&self, radiance: &Image<Radiance>) -> Image<Encoded> {
        let gain = self.exposure_stops.exp2();
        let pixels = radiance.pixels().iter().map(|pixel| pixel.map(|sample| self.code(sample * gain))).collect();
        Image::from_pixels(radiance.width(), radiance.height(), pixels)
    }

    fn code(&self, value: f32) -> f32 {
        let value = match self.tone {
            Tone::Clip => value,
            Tone::Filmic => {
                let x = value.max(0.0);
                (x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14)
            }
        };
        // Written so that NaN becomes black.
        if value > 0.0 { srgb_encode(f64::from(value.min(1.0))) as f32 } else { 0.0 }
    }
}

/// sRGB encoding of a linear value (IEC 61966-2-1).
pub fn srgb_encode(linear: f64) -> f64 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// The linear value of an sRGB code fraction (IEC 61966-2-1).
pub fn srgb_decode(encoded: f64) -> f64 {
    if encoded <= 0.040_45 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_goes_there_and_back() {
        for i in 0..=1000 {
            let x = f64::from(i) / 1000.0;
            assert!((srgb_decode(srgb_encode(x)) - x).abs() < 1e-6);
        }
    }

    #[test]
    fn one_stop_doubles_and_nothing_leaves_the_range() {
        let scene = Image::from_pixels(4, 1, vec![[0.1; 3], [0.2; 3], [50.0; 3], [-1.0; 3]]);
        for tone in [Tone::Clip, Tone::Filmic] {
            let shown = Display { exposure_stops: 0.0, tone }.encode(&scene);
            let brighter = Display { exposure_stops: 1.0, tone }.encode(&scene);
            assert_eq!(brighter.pixel(0, 0), shown.pixel(1, 0));
            assert!(shown.pixels().iter().flatten().all(|code| (0.0..=1.0).contains(code)));
            assert_eq!(shown.pixel(3, 0), [0.0; 3]);
        }
    }
}
