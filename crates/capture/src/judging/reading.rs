//! The photographs of one pattern, read, held against each other, and reduced to what the judge needs of them.

use std::path::PathBuf;

use relumine_radiometry::files::Picture;
use relumine_radiometry::{Counts, Image, Linear, Linearization, NoiseModel, Visibility, merge_counts, merge_linear};

use super::reduction::Reduction;
use crate::{Developer, Loss, ShownPattern};

/// Relative exposures below this are left to noise when exposures are compared.
const FAINT: f32 = 0.005;
/// So many codes above black are needed too.
const FAINT_CODES: f32 = 3.0;
/// Samples that two exposures must share to be compared.
const LEAST_SAMPLES: usize = 30;

/// One photograph.
pub(super) struct Exposure {
    /// Relative to the capture.
    pub(super) file: PathBuf,
    /// Radiance as this photograph alone shows it, small; NaN where it is clipped.
    pub(super) small: Vec<f32>,
    /// Relative L1 difference from the next longer exposure, where both see something.
    pub(super) unlike_next: Option<f64>,
}

/// The photographs of one pattern.
pub(super) struct Frame {
    pub(super) pattern: ShownPattern,
    /// Those that could be read, shortest first.
    pub(super) exposures: Vec<Exposure>,
    /// Radiance merged from all, small; NaN where all are clipped. Empty if none could be read.
    pub(super) small: Vec<f32>,
    /// The same less reduced; 0 is not NaN but a lower bound where clipped.
    pub(super) detail: Vec<f32>,
    /// Share of pixels clipped in every exposure, and share at or below black in every one.
    pub(super) over: f64,
    pub(super) under: f64,
    /// The relative exposure that 1 % of the pixels exceed in the longest exposure.
    pub(super) brightest: f64,
    /// Mean radiance of the reference patch.
    pub(super) patch: Option<f64>,
    /// Where the table lists it: the middle of its lines.
    pub(super) line: f64,
    /// Files of all listed photographs.
    pub(super) files: Vec<PathBuf>,
    /// How many were read and have the listed checksum.
    pub(super) verified: usize,
    pub(super) losses: Vec<Loss>,
}

impl Frame {
    pub(super) fn is_read(&self) -> bool {
        !self.small.is_empty()
    }
}

/// Reads the photographs of `pattern` at `position`.
pub(super) fn read(
    developer: &Developer,
    position: usize,
    pattern: ShownPattern,
    small: Reduction,
    detail: Reduction,
) -> Frame {
    let rows = developer.capture().exposures(position, pattern);
    let mut counts: Vec<(Image<Counts>, f64)> = Vec::new();
    let mut linear: Vec<(Image<Linear>, f64)> = Vec::new();
    let mut files = Vec::new();
    let mut verified = 0;
    let mut losses = Vec::new();
    let mut lose = |reason: String| losses.push(Loss { position, pattern, reason, others_remain: false });
    for row in rows {
        match developer.photograph(row) {
            Ok(Ok(Picture::Integer { image, .. })) => counts.push((image, row.exposure.relative())),
            Ok(Ok(Picture::Float(image))) => linear.push((image, row.exposure.relative())),
            Ok(Err(reason)) => {
                lose(reason);
                continue;
            }
            Err(contradiction) => {
                lose(contradiction.to_string());
                continue;
            }
        }
        files.push(row.file.clone());
        verified += usize::from(row.sha256.is_some());
    }
    if !counts.is_empty() && !linear.is_empty() {
        lose("exposures must be all counts or all floats".into());
        linear.clear();
    }
    let line = rows.iter().map(|row| row.line as f64).sum::<f64>() / rows.len().max(1) as f64;
    let mut frame = Frame {
        pattern,
        exposures: Vec::new(),
        small: Vec::new(),
        detail: Vec::new(),
        over: 0.0,
        under: 0.0,
        brightest: 0.0,
        patch: None,
        line,
        files: rows.iter().map(|row| row.file.clone()).collect(),
        verified,
        losses,
    };
    let merged = if !counts.is_empty() {
        let camera = developer.linearization();
        for (index, (image, exposure)) in counts.iter().enumerate() {
            let small = shown_alone(image, *exposure, camera, small);
            let unlike_next =
                counts.get(index + 1).and_then(|(next, longer)| unlike((image, *exposure), (next, *longer), camera));
            frame.exposures.push(Exposure { file: files[index].clone(), small, unlike_next });
        }
        frame.brightest = exceeded_by_one_percent(&counts[counts.len() - 1].0, camera);
        let stack: Vec<_> = counts.iter().map(|(image, exposure)| (image, *exposure)).collect();
        merge_counts(&stack, camera, NoiseModel::default())
    } else if !linear.is_empty() {
        for (file, (image, exposure)) in files.iter().zip(&linear) {
            let mut alone = small.mean(image.pixels(), |_| true);
            alone.iter_mut().for_each(|value| *value /= *exposure as f32);
            frame.exposures.push(Exposure { file: file.clone(), small: alone, unlike_next: None });
        }
        // Floats do not say what their range is.
        frame.brightest = 1.0;
        let stack: Vec<_> = linear.iter().map(|(image, exposure)| (image, *exposure)).collect();
        merge_linear(&stack, NoiseModel::default())
    } else {
        return frame;
    };
    let pixels = merged.radiance.pixels();
    let share = |which: Visibility| {
        merged.visibility.iter().filter(|seen| **seen == which).count() as f64 / merged.visibility.len() as f64
    };
    (frame.over, frame.under) = (share(Visibility::Clipped), share(Visibility::Black));
    frame.small = small.mean(pixels, |pixel| merged.visibility[pixel] != Visibility::Clipped);
    frame.detail = detail.mean(pixels, |_| true);
    frame.patch = developer.capture().setup().reference_patch().map(|patch| patch.mean(&merged.radiance));
    frame
}

/// Radiance as one photograph shows it, small; NaN where it is clipped.
fn shown_alone(image: &Image<Counts>, exposure: f64, camera: &Linearization, small: Reduction) -> Vec<f32> {
    let scale = (1.0 / exposure) as f32;
    let radiance: Vec<[f32; 3]> = image
        .pixels()
        .iter()
        .map(|pixel| std::array::from_fn(|channel| camera.exposure(channel, pixel[channel]) * scale))
        .collect();
    small.mean(&radiance, |pixel| image.pixels()[pixel].iter().all(|code| *code < camera.white_level()))
}

/// By how much two exposures of one pattern differ, relative L1, where one of them sees more than noise; where the longer one is
/// clipped it says only that there is at least so much. `None` if there is too little to compare.
fn unlike(
    (short, t_short): (&Image<Counts>, f64),
    (long, t_long): (&Image<Counts>, f64),
    camera: &Linearization,
) -> Option<f64> {
    let ratio = (t_short / t_long) as f32;
    let (mut difference, mut light, mut samples) = (0.0, 0.0, 0);
    for (short, long) in short.pixels().iter().zip(long.pixels()) {
        for channel in 0..3 {
            let seen = camera.exposure(channel, short[channel]);
            let expected = camera.exposure(channel, long[channel]) * ratio;
            let faint = FAINT.max(FAINT_CODES * camera.step(channel, short[channel]));
            let clipped = (long[channel] >= camera.white_level(), short[channel] >= camera.white_level());
            if seen.max(expected) < faint || clipped.1 {
                continue;
            }
            // What is clipped is at least so bright: that contradicts or says nothing.
            let apart = if clipped.0 { 0.9 * expected - seen } else { (seen - expected).abs() };
            if clipped.0 && apart <= 0.0 {
                continue;
            }
            samples += 1;
            light += f64::from(seen.max(expected));
            difference += f64::from(apart);
        }
    }
    (samples >= LEAST_SAMPLES).then(|| difference / light)
}

fn exceeded_by_one_percent(image: &Image<Counts>, camera: &Linearization) -> f64 {
    let brightest = |pixel: &[u16; 3]| {
        (0..3).map(|channel| camera.exposure(channel, pixel[channel])).fold(f32::NEG_INFINITY, f32::max)
    };
    let mut values: Vec<f32> = image.pixels().iter().map(brightest).collect();
    let at = values.len() - 1 - values.len() / 100;
    f64::from(*values.select_nth_unstable_by(at, f32::total_cmp).1)
}
