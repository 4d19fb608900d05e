//! What the photographs of a position are uncertain by, measured on them.
//!
//! Merging says how uncertain radiance is if the sensor is a common one. How it really is, photographs of the same light
//! say: the row combs together show what the column combs together show, all single squares what white shows. What the two
//! differ by, pixel by pixel, is fitted with two numbers, one for the variance without light (reading, rounding) and one
//! for what light adds (photons). So a sensor need not be known, and whatever else makes photographs differ is in the noise.
//!
//! The **black frame** is subtracted from every photograph, its noise with it: hundreds of times in the sum of all squares.
//! It is black because a dark projector still shines, so it is b times the white frame, which is much less uncertain. By how
//! much the black frame agrees with that, it is replaced by it; where it differs by more than noise (a lamp in the room, a
//! hot pixel), it stays.

use rayon::prelude::*;
use relumine_radiometry::{MeasuredLanes, NoiseCurve};
use serde::{Deserialize, Serialize};

use crate::Scheme;

/// What the photographs of a position are uncertain by, as a field keeps it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PositionNoise {
    /// Variance of a photograph by its radiance, radiance².
    pub curve: NoiseCurve,
    /// Whether the curve was measured on the photographs; otherwise it is that of a common camera.
    pub is_measured: bool,
    /// b, the projector's black level that photographs were divided by 1 − b with.
    pub black_level: f64,
    /// g: the black frame that was subtracted is g·b·white + (1 − g)·black, but where the two contradict each other.
    pub black_from_white: f64,
    /// Whether there is a white frame.
    pub has_white: bool,
}

/// Fewer lanes than this measure no noise.
const FEWEST_LANES: usize = 300;
/// Squared differences count no more than this many variances, lest a few lanes that something else spoils decide.
const MOST_VARIANCES: f64 = 25.0;
/// A black frame farther from b·white than this many standard deviations is not b·white there.
const HOT: f32 = 4.0;
/// What variances of a common camera may be off by.
const UNMEASURED: f64 = 4.0;

/// What a position showed, as radiance, nothing subtracted.
pub(crate) struct Shown<'a> {
    pub(crate) scheme: Scheme,
    pub(crate) frames: &'a [Option<Vec<f32>>],
    pub(crate) black: &'a [f32],
    pub(crate) white: Option<&'a [f32]>,
    pub(crate) black_level: f64,
    pub(crate) clipped: &'a [u8],
}

/// The squared difference of two photographs of the same light, and what of its variance there is without light and what
/// light adds, if the sensor is a common one.
#[derive(Clone, Copy)]
struct Difference {
    square: f64,
    dark: f64,
    light: f64,
}

impl Shown<'_> {
    /// The noise by the curve of a common camera; the black frame to subtract; its variance lane by lane.
    pub(crate) fn noise(&self, common: Option<NoiseCurve>) -> (Option<PositionNoise>, Vec<f32>, Vec<f32>) {
        let Some(common) = common else {
            return (None, self.black.to_vec(), vec![0.0; self.black.len()]);
        };
        let is_combs = matches!(self.scheme, Scheme::Combs { .. });
        // The sums of both families of combs have the same black in them.
        let of_combs = if is_combs { scales(&self.combs(&common)) } else { None };
        let curve = of_combs.map_or_else(|| common.clone(), |[dark, light]| common.scaled(dark, light));
        let (from_white, black, variance) = self.black(&curve, if of_combs.is_some() { 1.0 } else { UNMEASURED });
        let noise = |curve, is_measured| PositionNoise {
            curve,
            is_measured,
            black_level: self.black_level,
            black_from_white: f64::from(from_white),
            has_white: self.white.is_some(),
        };
        if is_combs {
            return (Some(noise(curve, of_combs.is_some())), black, variance);
        }
        match scales(&self.squares(&common, &black, &variance)) {
            Some([dark, light]) => {
                let measured = common.scaled(dark, light);
                let variance = self.variance_of_black(&measured, from_white, &black);
                (Some(noise(measured, true)), black, variance)
            }
            None => (Some(noise(common, false)), black, variance),
        }
    }

    /// Row combs less column combs.
    fn combs(&self, common: &NoiseCurve) -> Vec<Difference> {
        let Some(frames) = self.frames.iter().map(Option::as_deref).collect::<Option<Vec<&[f32]>>>() else {
            return Vec::new();
        };
        let (rows, columns) = frames.split_at(frames.len() / 2);
        self.lanes(|lane| {
            let of_rows = add(rows, lane, common);
            let of_columns = add(columns, lane, common);
            let difference = of_rows.0 - of_columns.0;
            let dark = frames.len() as f64 * f64::from(common.dark());
            Difference { square: difference * difference, dark, light: of_rows.1 + of_columns.1 - dark }
        })
    }

    /// All single squares less the white frame, black taken from all of them.
    fn squares(&self, common: &NoiseCurve, black: &[f32], of_black: &[f32]) -> Vec<Difference> {
        let frames = self.frames.iter().map(Option::as_deref).collect::<Option<Vec<&[f32]>>>();
        let (Some(frames), Some(white)) = (frames, self.white) else { return Vec::new() };
        let blacks = frames.len() as f64 - 1.0;
        self.lanes(|lane| {
            let (sum, variance) = add(&frames, lane, common);
            let white = white[lane];
            let difference = sum - f64::from(white) - blacks * f64::from(black[lane]);
            let dark = (frames.len() + 1) as f64 * f64::from(common.dark());
            let light = variance + f64::from(common.at(white)) - dark;
            let dark = dark + blacks * blacks * f64::from(of_black[lane]);
            Difference { square: difference * difference, dark, light }
        })
    }

    /// Of every measured lane that nothing clipped.
    fn lanes(&self, difference: impl Fn(usize) -> Difference + Sync + Send) -> Vec<Difference> {
        let measured = MeasuredLanes::of(self.black.len());
        let lanes = (0..measured.len()).into_par_iter().with_min_len(1 << 10).map(|index| measured.lane(index));
        lanes
            .filter(|lane| self.clipped[lane / 3] == 0)
            .map(difference)
            .filter(|difference| difference.square.is_finite() && difference.dark + difference.light > 0.0)
            .collect()
    }

    /// How much of the black frame is taken from the white one, what is subtracted, and its variance. `tolerance` is the factor
    /// by which the variances may be too small.
    fn black(&self, curve: &NoiseCurve, tolerance: f64) -> (f32, Vec<f32>, Vec<f32>) {
        let b = self.black_level as f32;
        let Some(white) = self.white.filter(|_| b > 0.0) else {
            let variance = self.black.iter().map(|black| curve.at(*black)).collect();
            return (0.0, self.black.to_vec(), variance);
        };
        let expected = |lane: usize| curve.at(self.black[lane]) + b * b * curve.at(white[lane]);
        let (mut sum, mut expected_sum) = (0.0, 0.0);
        for lane in (0..self.black.len()).filter(|lane| self.clipped[lane / 3] == 0 && white[*lane].is_finite()) {
            let variance = tolerance * f64::from(expected(lane));
            let difference = f64::from(self.black[lane] - b * white[lane]);
            sum += (difference * difference).min(MOST_VARIANCES * variance);
            expected_sum += variance;
        }
        // The share of the squared difference that is noise: the rest is black that is not b·white.
        let from_white = if expected_sum > 0.0 { (expected_sum / sum.max(expected_sum)) as f32 } else { 0.0 };
        let black = (0..self.black.len())
            .map(|lane| {
                let (black, difference) = (self.black[lane], b * white[lane] - self.black[lane]);
                let is_noise = difference.abs() <= HOT * (tolerance as f32 * expected(lane)).sqrt();
                if is_noise { black + from_white * difference } else { black }
            })
            .collect::<Vec<f32>>();
        let variance = self.variance_of_black(curve, from_white, &black);
        (from_white, black, variance)
    }

    /// Variance of the black that is subtracted.
    fn variance_of_black(&self, curve: &NoiseCurve, from_white: f32, subtracted: &[f32]) -> Vec<f32> {
        let b = self.black_level as f32;
        let mixed = |lane: usize| match self.white {
            Some(white) if subtracted[lane] != self.black[lane] => {
                let (of_black, of_white) = (curve.at(self.black[lane]), b * b * curve.at(white[lane]));
                (1.0 - from_white).powi(2) * of_black + from_white * from_white * of_white
            }
            _ => curve.at(self.black[lane]),
        };
        (0..subtracted.len()).map(mixed).collect()
    }
}

/// The sum of frames in a lane, and of their variances.
fn add(frames: &[&[f32]], lane: usize, curve: &NoiseCurve) -> (f64, f64) {
    let values = frames.iter().map(|frame| frame[lane]);
    values.fold((0.0, 0.0), |(sum, variance), value| (sum + f64::from(value), variance + f64::from(curve.at(value))))
}

/// The two factors by which noise without light and what light adds differ from those of a common camera: the squares of
/// differences are fitted by weighted least squares, the weights from the fit itself. `None` if there are too few.
fn scales(differences: &[Difference]) -> Option<[f64; 2]> {
    if differences.len() < FEWEST_LANES {
        return None;
    }
    // Begin with a factor that a few outliers do not move: the median of χ² of one degree of freedom is 0.4549.
    let mut ratios: Vec<f64> = differences.iter().map(|d| d.square / (d.dark + d.light)).collect();
    let middle = ratios.len() / 2;
    let (_, median, _) = ratios.select_nth_unstable_by(middle, f64::total_cmp);
    let first = (*median / 0.4549).max(1e-9);
    let mut scales = [first, first];
    for _ in 0..8 {
        // Σ w (dark, light) (dark, light)ᵀ · scales = Σ w (dark, light) · square, w = 1/variance².
        let (mut dd, mut dl, mut ll, mut ds, mut ls) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for Difference { square, dark, light } in differences {
            let expected = (scales[0] * dark + scales[1] * light).max(f64::MIN_POSITIVE);
            let (dark, light, square) = (dark / expected, light / expected, square / expected);
            let square = square.min(MOST_VARIANCES);
            dd += dark * dark;
            dl += dark * light;
            ll += light * light;
            ds += dark * square;
            ls += light * square;
        }
        let determinant = dd * ll - dl * dl;
        let solved = [(ds * ll - ls * dl) / determinant, (ls * dd - ds * dl) / determinant];
        scales = match solved {
            [dark, light] if dark > 0.0 && light > 0.0 && determinant > 1e-9 * dd * ll => solved,
            // One of the two is all that these lanes can tell.
            [dark, _] if dark <= 0.0 && ll > 0.0 => [0.0, ls / ll],
            [_, light] if light <= 0.0 && dd > 0.0 => [ds / dd, 0.0],
            _ => {
                let both = (ds + ls) / (dd + 2.0 * dl + ll);
                [both, both]
            }
        };
    }
    scales.iter().all(|scale| scale.is_finite()).then_some(scales)
}
