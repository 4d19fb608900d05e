//! Whether photographs of the same light agree: a wrong exposure, a swapped pattern, a white frame of another set-up do not.

use rayon::prelude::*;
use relumine_radiometry::MeasuredLanes;

use crate::{DevelopedPosition, Scheme};

/// Lanes that one task compares.
const PART: usize = 1 << 13;
/// Squared differences of photographs up to so many variances are noise.
const WITHIN_NOISE: f64 = 2.0;

/// Frames that are added up, as lanes.
type Frames<'a> = Vec<&'a [f32]>;

impl DevelopedPosition<'_> {
    /// By what share of the light photographs of the same light disagree beyond their noise: row combs and column combs table
    /// by table, and both with the white frame; all single squares with the white frame. Zero within noise; `None` if there
    /// is nothing to compare.
    pub fn disagreement(&self) -> Option<f64> {
        let noise = self.noise.as_ref()?;
        let scale = 1.0 / (1.0 - noise.black_level);
        let measured = MeasuredLanes::of(self.black.len());
        let frames: Vec<&[f32]> = self.frames.iter().map(Option::as_deref).collect::<Option<_>>()?;
        // Sums of the same light: what is in the first less what is in the second.
        let mut pairs: Vec<(Frames, Frames)> = Vec::new();
        if let Scheme::Combs { spacing } = self.setup.scheme() {
            let m = self.setup.cells().squares();
            let (rows, columns) = frames.split_at(frames.len() / 2);
            let phases = (0..spacing).flat_map(|k| (0..spacing).map(move |kk| (k, kk)));
            for (k, kk) in phases {
                let lines = |first: usize| (first..m).step_by(spacing);
                pairs.push((
                    lines(kk).map(|v| rows[v * spacing + k]).collect(),
                    lines(k).map(|u| columns[u * spacing + kk]).collect(),
                ));
            }
            pairs.extend(self.white.as_deref().map(|white| (rows.to_vec(), vec![white])));
        } else {
            pairs.push((frames, vec![self.white.as_deref()?]));
        }
        let worst = pairs.iter().map(|(first, second)| {
            // The error of the black frame is in all of them.
            let blacks = first.len() as f64 - second.len() as f64;
            let of_lane = |lane: usize| {
                let add = |frames: &[&[f32]]| {
                    frames.iter().fold((0.0, 0.0), |(sum, variance), frame| {
                        let radiance = frame[lane] / scale as f32 + self.black[lane];
                        (sum + f64::from(frame[lane]), variance + f64::from(noise.curve.at(radiance)))
                    })
                };
                let ((first, of_first), (second, of_second)) = (add(first), add(second));
                let of_black = blacks * blacks * f64::from(self.black_variance[lane]);
                ((first - second).powi(2), scale * scale * (of_first + of_second + of_black), second * second)
            };
            // Part by part, each added in the order of its lanes, so that threads do not matter.
            let part = |start: usize| {
                let lanes = (start..(start + PART).min(measured.len())).map(|index| measured.lane(index));
                let seen = lanes.filter(|lane| self.clipped[lane / 3] == 0).map(of_lane);
                seen.filter(|(square, ..)| square.is_finite()).fold((0.0, 0.0, 0.0), add_three)
            };
            let parts: Vec<(f64, f64, f64)> =
                (0..measured.len().div_ceil(PART)).into_par_iter().map(|i| part(i * PART)).collect();
            let (square, expected, light) = parts.into_iter().fold((0.0, 0.0, 0.0), add_three);
            let excess = square - WITHIN_NOISE * expected;
            if excess > 0.0 { (excess / light.max(f64::MIN_POSITIVE)).sqrt() } else { 0.0 }
        });
        Some(worst.fold(0.0, f64::max))
    }
}

fn add_three(sum: (f64, f64, f64), other: (f64, f64, f64)) -> (f64, f64, f64) {
    (sum.0 + other.0, sum.1 + other.1, sum.2 + other.2)
}
