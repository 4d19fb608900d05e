//! A capture judged photograph by photograph, before it is developed: what is over-exposed, exchanged, dark, moved, drifting.
//!
//! A position photographs the same light many times: row combs and column combs add up to the white frame, and to each other table by
//! table ([`sums`]). What contradicts that is found and named, whatever the object is. What the sums cannot see is whether squares that
//! light neighbouring pixels are neighbours ([`neighbours`]). Positions are lit from different sides; what stays between them is the
//! edges of things ([`registration`]) and the share of white that black shines.
//!
//! Not found: combs exchanged that light next to nothing of the object; a camera that moved by less than about half a pixel (of a
//! picture reduced to 1536 pixels a side), or before an object without edges; a lamp that drifts between positions, which
//! looks like light from another side.

mod across;
mod finding;
mod fourier;
mod neighbours;
mod position;
mod reading;
mod reduction;
mod registration;
mod sums;

use std::path::PathBuf;

use rayon::prelude::*;

use crate::{Capture, Developer, Loss, ShownPattern};

pub use finding::{Finding, FindingKind, Severity};
use reduction::Reduction;
use registration::Orientations;

/// Pixels of the longer side of the pictures that sums are made of.
const SMALL: usize = 160;
/// So many positions are what the others are registered against.
const REFERENCES: usize = 5;

/// Judges the positions of a capture, one at a time and in any order. One position's photographs are reduced as they are read, so that
/// memory does not grow with their number.
pub struct Judge<'a> {
    developer: &'a Developer,
    small: Reduction,
    detail: Reduction,
    /// Positions spread over the capture, and what their white frame looks like.
    references: Vec<(usize, Option<Orientations>)>,
}

/// How the photographs of one pattern are exposed.
#[derive(Clone, Debug, PartialEq)]
pub struct PatternExposure {
    /// The pattern.
    pub pattern: ShownPattern,
    /// Its photographs, relative to the capture, shortest exposure first.
    pub files: Vec<PathBuf>,
    /// Share of pixels with a channel that is clipped in every exposure.
    pub over_exposed: f64,
    /// Share of pixels with a channel that is at or below the camera's black in every exposure.
    pub under_exposed: f64,
}

/// What the judge says of one position.
#[derive(Clone, Debug)]
pub struct PositionJudgement {
    /// Which.
    pub position: usize,
    /// Its patterns in the order of the scheme, black and white first; those that have photographs.
    pub patterns: Vec<PatternExposure>,
    /// Photographs that cannot be read, have changed, or are not what capture.toml promises.
    pub damaged: Vec<Loss>,
    /// Number of photographs that were read and have the listed checksum.
    pub verified: usize,
    /// Number of photographs that the table has no checksum of.
    pub unlisted: usize,
    /// What is wrong with it by itself.
    pub findings: Vec<Finding>,
    /// Radiance of the black frame over that of the white frame.
    pub black_share: Option<f64>,
    /// Relative L2 by which the photographs contradict each other; `None` if too many are missing or clipped to tell.
    pub contradiction: Option<f64>,
    /// By how much the lamp's light rose from the first to the last photograph, relative, as the sums say.
    pub drift: Option<f64>,
    /// The lamp's light under the reference patch, least and most over that for the black frame.
    pub patch_drift: Option<(f64, f64)>,
    /// Pixels by which the picture is shifted against each of [`Judge::references`]; `None` where that cannot be told.
    pub shifts: Vec<Option<(f64, f64)>>,
}

impl<'a> Judge<'a> {
    /// Prepares to judge the capture of `developer`: reads the white frames of a few positions.
    pub fn new(developer: &'a Developer) -> Self {
        let size = developer.capture().setup().picture_size();
        let mut judge = Self {
            developer,
            small: Reduction::new(size, SMALL),
            detail: Reduction::new(size, registration::DETAIL),
            references: Vec::new(),
        };
        let capture = judge.capture();
        let positions: Vec<usize> = (0..capture.setup().cells().positions())
            .filter(|position| !capture.exposures(*position, ShownPattern::White).is_empty())
            .collect();
        let count = REFERENCES.min(positions.len());
        let chosen: Vec<usize> = (0..count).map(|index| positions[index * positions.len() / count]).collect();
        judge.references = chosen
            .into_par_iter()
            .map(|position| {
                let white = reading::read(developer, position, ShownPattern::White, judge.small, judge.detail);
                (position, judge.orientations(&white.detail))
            })
            .collect();
        judge
    }

    /// The capture that is judged.
    pub fn capture(&self) -> &Capture {
        self.developer.capture()
    }

    /// The positions that all others are registered against.
    pub fn references(&self) -> Vec<usize> {
        self.references.iter().map(|(position, _)| *position).collect()
    }

    /// Reads and judges one position.
    pub fn position(&self, position: usize) -> PositionJudgement {
        position::judge(self, position)
    }

    /// What all positions together show: `judgements` of all positions, in their order.
    pub fn across(&self, judgements: &[PositionJudgement]) -> Vec<Finding> {
        across::judge(self, judgements)
    }

    fn orientations(&self, detail: &[f32]) -> Option<Orientations> {
        if detail.is_empty() {
            return None;
        }
        Orientations::of(detail, self.detail.size.0, self.detail.size.1)
    }
}
