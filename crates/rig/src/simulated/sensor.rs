//! From radiance to counts: photons, reading, response, quantisation.

use rand::SeedableRng;
use rand_distr::{Distribution, Poisson, StandardNormal};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use relumine_radiometry::{Counts, ExposureSettings, Image, Radiance, Response, srgb_encode};
use sha2::{Digest, Sha256};

use super::SensorText;
use super::world::Place;

/// A sensor behind a lens: the relative exposure X = radiance · exposure, 1 = clipping.
pub(super) struct Sensor {
    full_well_e: f64,
    read_noise_e: f64,
    response: Response,
    black_level: f64,
    white_level: f64,
    seed: u64,
}

impl Sensor {
    pub(super) fn new(
        text: SensorText,
        response: Response,
        (black_level, white_level): (u16, u16),
        seed: u64,
    ) -> Result<Self, String> {
        let SensorText { full_well_e, read_noise_e, bits } = text;
        if !(1.0..=1e12).contains(&full_well_e) || !(0.0..=full_well_e).contains(&read_noise_e) {
            return Err(format!(
                "sensor: expected full_well_e of 1 to 1e12 and read_noise_e of 0 to full_well_e, found {full_well_e} and \
                 {read_noise_e}"
            ));
        }
        if !(8..=16).contains(&bits) {
            return Err(format!("sensor: bits must be 8 to 16, but is {bits}"));
        }
        let most = (1u32 << bits) - 1;
        // Pictures of more than 8 bits are told from others by their white level.
        if u32::from(white_level) > most || (bits > 8) != (white_level > 255) {
            return Err(format!(
                "sensor: counts of {bits} bits go up to {most}, but [camera] white_level is {white_level}: set one to fit \
                 the other"
            ));
        }
        let (black_level, white_level) = (f64::from(black_level), f64::from(white_level));
        Ok(Self { full_well_e, read_noise_e, response, black_level, white_level, seed })
    }

    /// Bits of the picture file.
    pub(super) fn bits(&self) -> u8 {
        if self.white_level > 255.0 { 16 } else { 8 }
    }

    /// One photograph. Its noise follows from the seed and from what is photographed how.
    pub(super) fn counts(
        &self,
        radiance: &Image<Radiance>,
        exposure: &ExposureSettings,
        place: &Place,
    ) -> Image<Counts> {
        let (width, height) = radiance.size();
        let exposure = exposure.relative();
        let Place { index, pattern } = place;
        let named = Sha256::digest(format!("{} {index} {pattern} {:x}", self.seed, exposure.to_bits()));
        let start = u64::from_le_bytes(std::array::from_fn(|byte| named[byte]));
        let rows: Vec<Vec<[u16; 3]>> = radiance
            .pixels()
            .par_chunks(width)
            .enumerate()
            .map(|(y, row)| {
                let mut random = Pcg64Mcg::seed_from_u64(start.wrapping_add(y as u64));
                let mut count =
                    |channel: usize, value: f32| self.count(channel, f64::from(value) * exposure, &mut random);
                row.iter().map(|pixel| std::array::from_fn(|channel| count(channel, pixel[channel]))).collect()
            })
            .collect();
        Image::from_pixels(width, height, rows.concat())
    }

    /// The count for the relative exposure `x`.
    fn count(&self, channel: usize, x: f64, random: &mut Pcg64Mcg) -> u16 {
        // The well holds no more, but twice of it is counted: noise is not cut where pixels clip.
        let caught = caught(x.clamp(0.0, 2.0) * self.full_well_e, random);
        let noise: f64 = StandardNormal.sample(random);
        let read = (caught + self.read_noise_e * noise) / self.full_well_e;
        let fraction = match &self.response {
            Response::Linear => read,
            Response::Srgb => srgb_encode(read.clamp(0.0, 1.0)),
            Response::Curve(curve) => curve.fraction(channel, read),
        };
        let code = self.black_level + fraction * (self.white_level - self.black_level);
        // To the nearest: what is cut off here is above zero.
        (code.clamp(0.0, self.white_level) + 0.5) as u16
    }
}

/// Beyond this many electrons a Poisson distribution is taken as the Gaussian of its mean and variance: three standard
/// deviations out, 192 electrons, the two differ by 1.3.
const MANY: f64 = 4096.0;

/// Electrons caught where `expected` are expected.
fn caught(expected: f64, random: &mut Pcg64Mcg) -> f64 {
    if expected > MANY {
        let spread: f64 = StandardNormal.sample(random);
        return expected + expected.sqrt() * spread;
    }
    // There is no distribution around nothing.
    Poisson::new(expected).map_or(0.0, |poisson| poisson.sample(random))
}

#[cfg(test)]
mod tests {
    use relumine_capture::ShownPattern;

    use super::*;

    fn sensor(full_well_e: f64, bits: u8, levels: (u16, u16)) -> Sensor {
        let text = SensorText { full_well_e, read_noise_e: 4.0, bits };
        Sensor::new(text, Response::Linear, levels, 7).unwrap()
    }

    fn photograph(sensor: &Sensor, value: f32) -> Vec<f64> {
        let radiance = Image::from_pixels(200, 100, vec![[value; 3]; 20_000]);
        let exposure = ExposureSettings { exposure_s: 0.5, gain: None };
        let place = Place { index: 3, pattern: ShownPattern::White };
        let counts = sensor.counts(&radiance, &exposure, &place);
        counts.pixels().iter().flatten().map(|count| f64::from(*count)).collect()
    }

    #[test]
    fn mean_and_variance_are_those_of_photons_and_reading() {
        let sensor = sensor(10_000.0, 16, (1000, 61_000));
        for radiance in [0.0f32, 0.02, 0.4, 1.2] {
            let counts = photograph(&sensor, radiance);
            let n = counts.len() as f64;
            let mean = counts.iter().sum::<f64>() / n;
            let variance = counts.iter().map(|count| (count - mean).powi(2)).sum::<f64>() / n;
            let electrons = f64::from(radiance) * 0.5 * 10_000.0;
            let gain = 60_000.0 / 10_000.0;
            let expected = 1000.0 + gain * electrons;
            let spread = gain * gain * (electrons + 16.0) + 1.0 / 12.0;
            assert!((mean - expected).abs() < 4.0 * (spread / n).sqrt(), "{radiance}: mean {mean}, not {expected}");
            assert!((variance / spread - 1.0).abs() < 0.05, "{radiance}: variance {variance}, not {spread}");
        }
        assert!(photograph(&sensor, 5.0).iter().all(|count| *count == 61_000.0), "clipped");
    }

    #[test]
    fn a_photograph_taken_again_is_the_same_and_another_is_not() {
        let sensor = sensor(10_000.0, 8, (0, 255));
        assert_eq!(photograph(&sensor, 0.5), photograph(&sensor, 0.5));
        let radiance = Image::from_pixels(50, 1, vec![[0.5; 3]; 50]);
        let exposure = |exposure_s: f64| ExposureSettings { exposure_s, gain: None };
        let at = |index: usize, exposure_s: f64| {
            sensor.counts(&radiance, &exposure(exposure_s), &Place { index, pattern: ShownPattern::Black })
        };
        assert_ne!(at(0, 1.0), at(1, 1.0));
    }

    #[test]
    fn levels_that_do_not_fit_the_bits_are_refused() {
        let of = |bits: u8, white: u16| {
            Sensor::new(SensorText { bits, ..SensorText::default() }, Response::Linear, (0, white), 0)
        };
        assert!(of(8, 255).is_ok() && of(12, 4095).is_ok() && of(16, 65535).is_ok());
        assert!(of(8, 4095).is_err() && of(12, 65535).is_err() && of(12, 200).is_err() && of(7, 100).is_err());
    }
}
