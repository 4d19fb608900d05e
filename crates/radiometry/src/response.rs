//! From camera counts to relative exposure: the response f of §4.2 (Debevec & Malik 1997), given or recovered.
//!
//! A camera gives the fraction f(X) of its code range at the relative exposure X, where 1 is clipping. f is linear, the
//! sRGB curve, a curve read from a response file, or one recovered from exposures ([`recover_response`]).

mod curve_file;
mod plot;
mod recover;

pub use plot::response_plot;
pub use recover::{ChannelFit, RecoveredResponse, RecoveryError, recover_response};

use crate::display::srgb_decode;

/// The response of a camera: which fraction of its code range it gives at a relative exposure.
#[derive(Clone, Debug, PartialEq)]
pub enum Response {
    /// f(X) = X.
    Linear,
    /// f is the sRGB encoding (IEC 61966-2-1).
    Srgb,
    /// A measured curve.
    Curve(ResponseCurve),
}

/// A measured response: rows of relative exposure and code fraction per channel, linear between rows.
#[derive(Clone, Debug, PartialEq)]
pub struct ResponseCurve {
    exposures: Vec<f64>,
    fractions: [Vec<f64>; 3],
}

/// What is wrong with a response file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{path}:{line}: {reason}")]
pub struct ResponseError {
    path: String,
    line: usize,
    reason: String,
}

impl ResponseCurve {
    /// The curve through strictly rising exposures of each channel and their fractions: rows stand at the exposures of all
    /// channels, so nothing is lost.
    fn from_channels(channels: &[(Vec<f64>, Vec<f64>); 3]) -> Result<Self, &'static str> {
        if channels.iter().any(|(exposures, _)| exposures.len() < 2) {
            return Err("a response that does not rise tells nothing about exposure");
        }
        let mut rows: Vec<f64> = channels.iter().flat_map(|(exposures, _)| exposures).copied().collect();
        rows.sort_by(f64::total_cmp);
        rows.dedup();
        let fractions = std::array::from_fn(|channel| {
            let (exposures, fractions) = &channels[channel];
            // Rounding in the interpolation must not make a step down.
            let mut highest = f64::NEG_INFINITY;
            let at = |row: &f64| {
                highest = interpolate(exposures, fractions, *row).max(highest);
                highest
            };
            rows.iter().map(at).collect()
        });
        Ok(Self { exposures: rows, fractions })
    }

    /// f(X) for one channel.
    pub fn fraction(&self, channel: usize, exposure: f64) -> f64 {
        interpolate(&self.exposures, &self.fractions[channel], exposure)
    }

    /// f⁻¹ for one channel; where f is flat, the middle of the flat part. Beyond the ends the end slopes go on, so that
    /// noise below black stays noise and does not pile up at zero.
    fn exposure(&self, channel: usize, fraction: f64) -> f64 {
        let fractions = &self.fractions[channel];
        let first = fractions.partition_point(|f| *f < fraction);
        let after = fractions.partition_point(|f| *f <= fraction);
        if first < after {
            return 0.5 * (self.exposures[first] + self.exposures[after - 1]);
        }
        interpolate_rising(fractions, &self.exposures, fraction)
    }
}

fn interpolate(x: &[f64], y: &[f64], at: f64) -> f64 {
    if at <= x[0] {
        return y[0];
    }
    if at >= x[x.len() - 1] {
        return y[y.len() - 1];
    }
    interpolate_rising(x, y, at)
}

/// Linear between rows and beyond them along the nearest slope; flat parts of `x` are stepped over.
fn interpolate_rising(x: &[f64], y: &[f64], at: f64) -> f64 {
    let mut right = x.partition_point(|value| *value < at).clamp(1, x.len() - 1);
    let mut left = right - 1;
    while x[left] == x[right] && right + 1 < x.len() {
        right += 1;
    }
    while x[left] == x[right] && left > 0 {
        left -= 1;
    }
    y[left] + (y[right] - y[left]) * (at - x[left]) / (x[right] - x[left])
}

/// Relative exposure for every code of a camera, tabulated once: 256 or 65,536 entries a channel.
#[derive(Clone, Debug)]
pub struct Linearization {
    black_level: u16,
    white_level: u16,
    exposures: [Vec<f32>; 3],
    steps: [Vec<f32>; 3],
}

impl Linearization {
    /// Tabulates f⁻¹ for codes between `black_level` (counts without light) and `white_level` (counts at which a pixel is
    /// clipped).
    ///
    /// # Panics
    /// If `black_level` is not below `white_level`.
    pub fn new(response: &Response, black_level: u16, white_level: u16) -> Self {
        assert!(black_level < white_level, "black level {black_level} must be below white level {white_level}");
        let range = f64::from(white_level) - f64::from(black_level);
        let exposure_of = |channel: usize, code: f64| {
            let fraction = (code - f64::from(black_level)) / range;
            match response {
                Response::Linear => fraction,
                Response::Srgb => srgb_decode(fraction),
                Response::Curve(curve) => curve.exposure(channel, fraction),
            }
        };
        let table = |value: &dyn Fn(usize, f64) -> f64| {
            std::array::from_fn(|channel| {
                (0..=white_level).map(|code| value(channel, f64::from(code)) as f32).collect::<Vec<f32>>()
            })
        };
        Self {
            black_level,
            white_level,
            exposures: table(&exposure_of),
            steps: table(&|channel, code| exposure_of(channel, code + 0.5) - exposure_of(channel, code - 0.5)),
        }
    }

    /// Counts without light.
    pub fn black_level(&self) -> u16 {
        self.black_level
    }

    /// Counts at which a pixel is clipped.
    pub fn white_level(&self) -> u16 {
        self.white_level
    }

    /// X = f⁻¹(code) of one channel; codes above the white level count as the white level.
    pub fn exposure(&self, channel: usize, code: u16) -> f32 {
        self.exposures[channel][usize::from(code.min(self.white_level))]
    }

    /// The width in X of one code: the quantisation step.
    pub fn step(&self, channel: usize, code: u16) -> f32 {
        self.steps[channel][usize::from(code.min(self.white_level))]
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn s_curve() -> ResponseCurve {
        let mut text = ResponseCurve::HEADER.to_string();
        for row in 0..=64 {
            let x = f64::from(row) / 64.0;
            let y = x.powf(0.6) * (1.2 - 0.2 * x);
            text += &format!("\n{x},{y},{},{}", y * y, x);
        }
        ResponseCurve::parse(Path::new("r.csv"), &text).unwrap()
    }

    #[test]
    fn the_inverse_response_sends_every_exposure_home() {
        let curve = s_curve();
        for channel in 0..3 {
            for i in 0..=100 {
                let x = f64::from(i) / 100.0;
                let back = curve.exposure(channel, curve.fraction(channel, x));
                assert!((back - x).abs() < 1e-9, "channel {channel}: {x} came back as {back}");
            }
        }
    }

    #[test]
    fn linear_counts_below_black_stay_negative() {
        let table = Linearization::new(&Response::Linear, 100, 1100);
        assert_eq!(table.exposure(0, 100), 0.0);
        assert!((table.exposure(1, 50) + 0.05).abs() < 1e-6);
        assert_eq!(table.exposure(2, 1100), 1.0);
        assert_eq!(table.exposure(2, 65535), 1.0);
    }

    #[test]
    fn a_response_file_that_cannot_be_says_in_which_line() {
        let parse = |text: &str| ResponseCurve::parse(Path::new("r.csv"), text).unwrap_err().to_string();
        assert!(parse("x,y\n").contains("r.csv:1: expected the header"));
        let header = ResponseCurve::HEADER;
        assert!(parse(&format!("{header}\n0,0,0,0\n1,1,1\n")).contains("r.csv:3: expected four numbers"));
        assert!(parse(&format!("{header}\n0,0,0,0\n1,1,nan,1\n")).contains("r.csv:3"));
        assert!(parse(&format!("{header}\n0,0,0,0\n0,1,1,1\n")).contains("must grow"));
        assert!(parse(&format!("{header}\n0,0,1,0\n1,1,0,1\n")).contains("must not fall"));
        assert!(parse(&format!("{header}\n0,0,0,0\n1,1,0,1\n")).contains("does not rise"));
    }
}
