//! How a position came out.

use std::collections::VecDeque;

use relumine_capture::PositionNoise;
use relumine_field::{FieldWriter, PositionRecord};
use serde::{Deserialize, Serialize};

/// How one position came out, as the field keeps it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DevelopedReport {
    /// b, the share of white that shines through black.
    pub black_level: Option<f64>,
    /// Relative L2 of the squares' sums against the comb photographs.
    pub residual_combs: Option<f64>,
    /// The same for the minimum alone.
    pub residual_combs_of_minimum: Option<f64>,
    /// Relative L2 of the sum of all squares against the white frame.
    pub residual_white: Option<f64>,
    /// Noise of one photograph, radiance, root mean square.
    pub noise: Option<f64>,
    /// The least and the most that the lamp shone over what it shone for the black frame, as the reference patch says; taken out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lamp: Option<(f64, f64)>,
    /// By what share of the light photographs of the same light disagree beyond their noise.
    #[serde(default)]
    pub disagreement: Option<f64>,
    /// What one photograph is uncertain by, by its radiance: what the standard error of a relit picture comes from.
    #[serde(default)]
    pub photograph_noise: Option<PositionNoise>,
    /// Share of the light that lay below a threshold and was cut off.
    #[serde(default)]
    pub cut: Option<f64>,
    /// Share of the light that was added because minima of noisy values are too small.
    #[serde(default)]
    pub bias_subtracted: Option<f64>,
    /// Share of the light that could not be told from noise in single squares and was spread evenly over tables of squares.
    #[serde(default)]
    pub spread: Option<f64>,
    /// Pixels that were clipped in every exposure of some photograph: their transfers are lower bounds.
    pub clipped_pixels: usize,
    /// Photographs that could not be used, and why.
    pub losses: Vec<String>,
}

/// One position is done.
#[derive(Clone, Debug, PartialEq)]
pub struct PositionOutcome {
    /// Which.
    pub position: usize,
    /// Squares that are missing from it.
    pub missing_squares: usize,
    /// How it came out.
    pub report: DevelopedReport,
}

impl PositionOutcome {
    /// The positions that an earlier run has done, and those that are to be done. Where photographs were lost, they may have
    /// been found again: such positions are done once more.
    pub(crate) fn done_and_waiting(writer: &FieldWriter) -> (Vec<Self>, VecDeque<usize>) {
        let (done, again): (Vec<Self>, Vec<Self>) =
            writer.done().iter().filter_map(Self::of).partition(|outcome| outcome.report.losses.is_empty());
        let mut waiting = writer.remaining();
        waiting.extend(again.iter().map(|outcome| outcome.position));
        waiting.sort_unstable();
        (done, waiting.into())
    }

    /// What the record of a position says; `None` if its report is of another version.
    pub(crate) fn of(record: &PositionRecord) -> Option<Self> {
        let report = DevelopedReport::of(record)?;
        Some(Self { position: record.position, missing_squares: record.missing.len(), report })
    }
}

impl DevelopedReport {
    /// Of photographs that nothing was measured on but what was clipped and lost.
    pub(crate) fn unmeasured(clipped_pixels: usize, losses: Vec<String>) -> Self {
        Self { clipped_pixels, losses, ..Self::default() }
    }

    /// The report in a field's record of a position; `None` if it is of another version.
    pub fn of(record: &PositionRecord) -> Option<Self> {
        serde_json::from_value(record.report.clone()).ok()
    }
}
