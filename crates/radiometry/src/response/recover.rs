//! The response of a camera recovered from photographs of one view at known exposures (paper, §4.2), after Debevec &
//! Malik 1997, *Recovering High Dynamic Range Radiance Maps from Photographs*, eq. 3.
//!
//! As there, g = ln f⁻¹ and the radiance of chosen pixels are found together so that g(Zᵢⱼ) = ln Eᵢ + ln tⱼ in the sense of
//! least squares, with a smooth g. What differs: the unknowns are the logarithms of the slopes of g, so that every result
//! rises strictly (`curve`); pixels are spread over brightness and over the picture (`selection`); weights follow the noise
//! of counts instead of a hat, and observations far from the others count little or nothing (`fit`).
//!
//! What photographs cannot say: if all exposures stand in one ratio, say 2, then a ripple of g that repeats every factor 2
//! of exposure changes no difference between them. The smoothest curve is taken.

mod curve;
mod fit;
mod selection;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Response, ResponseCurve};
use crate::{Counts, Image};
use curve::Knots;

/// The response that photographs agree on, and how well they do.
#[derive(Clone, Debug, PartialEq)]
pub struct RecoveredResponse {
    /// The curve: relative exposure 1 is where a channel reaches the white level. Always [`Response::Curve`].
    pub response: Response,
    /// The fit, per channel: red, green, blue.
    pub report: [ChannelFit; 3],
}

/// How well the photographs agree with the recovered curve of one channel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChannelFit {
    /// Pixels that were chosen and used.
    pub pixels: usize,
    /// Pixels that were looked at but became darker with longer exposure: something moved, or shone.
    pub contradicting_pixels: usize,
    /// Observations (a pixel in one photograph) used.
    pub observations: usize,
    /// Observations left out because they lie more than 4.7 standard deviations from what the others say.
    pub outliers: usize,
    /// Root mean square of g(Z) − ln E − ln t over the observations used, natural logarithm of exposure; each counts by its
    /// weight.
    pub rms_log_exposure: f64,
    /// The lowest and the highest fraction of the code range that was used; outside of it the curve is extrapolated.
    pub seen: (f64, f64),
    /// The smallest slope d ln f / d ln X within the seen range: above 0 for a curve that rises everywhere.
    pub smallest_gamma: f64,
    /// The largest slope d ln f / d ln X within the seen range.
    pub largest_gamma: f64,
}

/// Why no response can be recovered.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RecoveryError {
    /// One exposure tells nothing about the curve.
    #[error(
        "a response is recovered from at least two different exposures of one view, but {found} came; \
         photograph the view again with shorter and longer exposures, or give the response"
    )]
    TooFewExposures {
        /// How many different ones came.
        found: usize,
    },
    /// Photographs of one view have one size.
    #[error(
        "photograph {index} has {} × {} pixels, but the first has {} × {}: they must show one view", found.0, found.1,
        expected.0, expected.1
    )]
    SizesDiffer {
        /// Which photograph, counted from 0.
        index: usize,
        /// Width and height of the first.
        expected: (usize, usize),
        /// Width and height of this one.
        found: (usize, usize),
    },
    /// Exposures are positive numbers.
    #[error("photograph {index}: an exposure must be a positive number, but is {exposure}")]
    Exposure {
        /// Which photograph, counted from 0.
        index: usize,
        /// Its exposure.
        exposure: f64,
    },
    /// Counts without light lie below those of clipping.
    #[error(
        "black level {black} must be finite, at least 0 and at least 8 counts below white level {white}, at most 65535"
    )]
    Levels {
        /// Counts without light.
        black: f64,
        /// Counts at which a pixel is clipped.
        white: f64,
    },
    /// The view is too dark, too bright, or too uniform.
    #[error(
        "channel {channel}: only {pixels} pixels are neither black nor clipped in at least two exposures, of {needed} needed; \
         is the view all black or all white, or do the levels {black} to {white} belong to another camera?"
    )]
    TooFewPixels {
        /// Red, green or blue.
        channel: &'static str,
        /// How many came.
        pixels: usize,
        /// How many are needed.
        needed: usize,
        /// Counts without light.
        black: f64,
        /// Counts at which a pixel is clipped.
        white: f64,
    },
    /// Differences between exposures do not reach across the code range.
    #[error(
        "channel {channel}: the pixels cover {:.0} % to {:.0} % of the code range, which is too little to find the curve; \
         photograph a view with bright and dark parts at exposures a factor 2 to 4 apart", 100.0 * seen.0, 100.0 * seen.1
    )]
    NarrowRange {
        /// Red, green or blue.
        channel: &'static str,
        /// Lowest and highest fraction of the code range.
        seen: (f64, f64),
    },
    /// Codes do not rise with exposure.
    #[error(
        "channel {channel}: photographs of longer exposure are not brighter; are the exposures in the order of the pictures, \
         in seconds and not one over seconds?"
    )]
    NotRising {
        /// Red, green or blue.
        channel: &'static str,
    },
}

const CHANNELS: [&str; 3] = ["red", "green", "blue"];

/// Recovers the response of each channel from photographs of one view, each with its relative exposure (seconds · iso/100 /
/// f², or any multiple of it).
///
/// `black_level` are counts without light, `white_level` counts at which a pixel is clipped. Ranges of up to 256 counts get a
/// knot a count, wider ones 384 knots that stand closer near black and white. The result does not depend on the order
/// of the photographs nor on the number of threads.
///
/// # Errors
/// If the photographs do not determine a curve: [`RecoveryError`] says why and what to do.
pub fn recover_response(
    photographs: &[(&Image<Counts>, f64)],
    black_level: f64,
    white_level: f64,
) -> Result<RecoveredResponse, RecoveryError> {
    check(photographs, black_level, white_level)?;
    let mut stack: Vec<(&Image<Counts>, f64)> = photographs.to_vec();
    stack.sort_by(|a, b| a.1.total_cmp(&b.1));
    let knots = Knots::new(white_level - black_level);
    let fits: Vec<(fit::Fit, ChannelFit)> = (0..3)
        .into_par_iter()
        .map(|channel| {
            let name = CHANNELS[channel];
            let chosen = selection::choose(&stack, channel, black_level, white_level);
            if chosen.pixels.len() < selection::NEEDED {
                if chosen.contradicting > chosen.pixels.len() {
                    return Err(RecoveryError::NotRising { channel: name });
                }
                return Err(RecoveryError::TooFewPixels {
                    channel: name,
                    pixels: chosen.pixels.len(),
                    needed: selection::NEEDED,
                    black: black_level,
                    white: white_level,
                });
            }
            let log_exposures: Vec<f64> = stack.iter().map(|(_, t)| t.ln()).collect();
            let fit = fit::fit(&knots, &chosen.pixels, &log_exposures);
            if fit.seen.1 - fit.seen.0 < 0.25 {
                return Err(RecoveryError::NarrowRange { channel: name, seen: fit.seen });
            }
            let (smallest_gamma, largest_gamma) = fit.gammas(&knots);
            let report = ChannelFit {
                pixels: fit.pixels,
                contradicting_pixels: chosen.contradicting,
                observations: fit.observations,
                outliers: fit.outliers,
                rms_log_exposure: fit.rms,
                seen: fit.seen,
                smallest_gamma,
                largest_gamma,
            };
            Ok((fit, report))
        })
        .collect::<Result<_, _>>()?;
    let channels =
        std::array::from_fn(|channel| (curve::exposures(&fits[channel].0.log_exposures), knots.fractions_with_zero()));
    let curve =
        ResponseCurve::from_channels(&channels).map_err(|_| RecoveryError::NotRising { channel: CHANNELS[0] })?;
    Ok(RecoveredResponse { response: Response::Curve(curve), report: std::array::from_fn(|channel| fits[channel].1) })
}

fn check(photographs: &[(&Image<Counts>, f64)], black: f64, white: f64) -> Result<(), RecoveryError> {
    let sound = black.is_finite() && white.is_finite() && black >= 0.0 && white - black >= 8.0 && white <= 65535.0;
    if !sound {
        return Err(RecoveryError::Levels { black, white });
    }
    let mut exposures = Vec::with_capacity(photographs.len());
    for (index, (image, exposure)) in photographs.iter().enumerate() {
        if !(exposure.is_finite() && *exposure > 0.0) {
            return Err(RecoveryError::Exposure { index, exposure: *exposure });
        }
        let expected = photographs[0].0.size();
        if image.size() != expected {
            return Err(RecoveryError::SizesDiffer { index, expected, found: image.size() });
        }
        exposures.push(*exposure);
    }
    exposures.sort_by(f64::total_cmp);
    // Exposures less than a percent apart are one exposure, named twice.
    exposures.dedup_by(|b, a| *b < *a * 1.01);
    if exposures.len() < 2 {
        return Err(RecoveryError::TooFewExposures { found: exposures.len() });
    }
    Ok(())
}
