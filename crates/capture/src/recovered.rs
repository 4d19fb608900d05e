//! The response of a capture's camera, recovered from the capture's own exposures (`response = "recover"`).
//!
//! Patterns that were photographed at the same exposures are joined into one tall picture an exposure, so that dark and bright
//! ones tell of the curve together. Which are taken depends on the table alone: those with the most exposures, white frames
//! first, from positions spread evenly.

use rayon::prelude::*;
use relumine_radiometry::files::Picture;
use relumine_radiometry::{Counts, Image, RecoveredResponse, RecoveryError};

use crate::{Capture, CaptureError, Developer, PhotographRow, ShownPattern};

/// Views that are joined at most.
const MOST_VIEWS: usize = 12;
/// Pixels of a joined picture, about.
const PIXELS: usize = 1 << 24;
/// Views that are tried before giving up where photographs are lost.
const TRIED: usize = 4;

/// One pattern at one position, and its photographs.
type View<'a> = ((usize, ShownPattern), &'a [PhotographRow]);

/// Recovers the response from the exposures of `capture`. The same photographs give the same curve, to the bit.
///
/// # Errors
/// If no pattern was photographed at two different exposures, the photographs are linear floats, or they do not determine a
/// curve.
pub fn recover_response(capture: &Capture) -> Result<RecoveredResponse, CaptureError> {
    let fail = |reason: String| CaptureError::Setup { path: capture.directory().join("capture.toml"), reason };
    let (width, height) = capture.setup().picture_size();
    let wanted = (PIXELS / (width * height).max(1)).clamp(1, MOST_VIEWS);
    let views = chosen_views(capture, wanted * TRIED);
    let Some(((_, _), first)) = views.first() else {
        return Err(fail(
            "camera: response = \"recover\" needs patterns that were photographed at two or more exposures, but \
             photographs.csv has one exposure a pattern: give \"linear\", \"srgb\" or a response file (`relumine calibrate \
             response` makes one from a bracket of the same camera)"
                .into(),
        ));
    };
    let exposures: Vec<f64> = first.iter().map(|row| row.exposure.relative()).collect();
    let mut joined: Vec<Vec<[u16; 3]>> = vec![Vec::new(); exposures.len()];
    let mut taken = 0;
    let mut lost = Vec::new();
    for ((position, pattern), rows) in views {
        if taken == wanted {
            break;
        }
        let read: Vec<Result<Picture, String>> =
            rows.par_iter().map(|row| Developer::read(capture, row)).collect::<Result<_, _>>()?;
        // A photograph that is lost takes its view along; `develop` lists it where it is needed.
        let pictures = match read.into_iter().collect::<Result<Vec<Picture>, String>>() {
            Ok(pictures) => pictures,
            Err(reason) => {
                lost.push(reason);
                continue;
            }
        };
        for (pixels, picture) in joined.iter_mut().zip(pictures) {
            let Picture::Integer { image, .. } = picture else {
                let reason =
                    format!("position {position}, {pattern}: a linear float picture has no response to recover");
                return Err(fail(format!("camera: {reason}; set response = \"linear\"")));
            };
            pixels.extend_from_slice(image.pixels());
        }
        taken += 1;
    }
    if taken == 0 {
        let first = lost.first().cloned().unwrap_or_default();
        return Err(fail(format!("camera: the photographs to recover the response from cannot be used: {first}")));
    }
    let stack: Vec<Image<Counts>> =
        joined.into_iter().map(|pixels| Image::from_pixels(width, height * taken, pixels)).collect();
    let photographs: Vec<(&Image<Counts>, f64)> = stack.iter().zip(exposures).collect();
    let (black, white) = capture.setup().levels();
    relumine_radiometry::recover_response(&photographs, black.into(), white.into())
        .map_err(|error: RecoveryError| fail(format!("camera: response = \"recover\" from {taken} patterns: {error}")))
}

/// Patterns with the most exposures, all with the same ones: white frames first, then lit patterns, each spread evenly.
fn chosen_views(capture: &Capture, most: usize) -> Vec<View<'_>> {
    let lit = || {
        let views = capture.photographs().rows.iter().filter(|((_, pattern), _)| *pattern != ShownPattern::Black);
        views.map(|(key, rows)| (*key, rows.as_slice()))
    };
    let exposures = |rows: &[PhotographRow]| rows.iter().map(|row| row.exposure.relative()).collect::<Vec<f64>>();
    let longest = lit().map(|(_, rows)| rows.len()).max().unwrap_or(0);
    if longest < 2 {
        return Vec::new();
    }
    let is_white = |view: &View<'_>| view.0.1 == ShownPattern::White;
    let candidates = || lit().filter(|(_, rows)| rows.len() == longest);
    let Some(first) = candidates().find(is_white).or_else(|| candidates().next()) else { return Vec::new() };
    let common = exposures(first.1);
    let (white, others): (Vec<View<'_>>, Vec<View<'_>>) =
        candidates().filter(|(_, rows)| exposures(rows) == common).partition(is_white);
    let whites = spread(white, most.div_ceil(2));
    let others = spread(others, most - whites.len());
    // Alternating, so that the first few have both kinds.
    let mut mixed = Vec::with_capacity(whites.len() + others.len());
    let (mut whites, mut others) = (whites.into_iter(), others.into_iter());
    loop {
        match (whites.next(), others.next()) {
            (None, None) => return mixed,
            (white, other) => mixed.extend(white.into_iter().chain(other)),
        }
    }
}

/// `most` of `views`, spread evenly and in an order in which the first few are spread as well.
fn spread(views: Vec<View<'_>>, most: usize) -> Vec<View<'_>> {
    let count = views.len();
    let mut order: Vec<usize> = (0..count.min(most)).map(|i| (2 * i + 1) * count / (2 * count.min(most))).collect();
    // By bit-reversed rank: any beginning of the list is spread.
    let bits = usize::BITS - order.len().leading_zeros();
    let mut ranked: Vec<(usize, usize)> = order
        .drain(..)
        .enumerate()
        .map(|(rank, view)| (rank.reverse_bits() >> (usize::BITS - bits.max(1)), view))
        .collect();
    ranked.sort_unstable();
    ranked.into_iter().map(|(_, view)| views[view]).collect()
}
