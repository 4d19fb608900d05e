//! Photographs of one position → radiance of each pattern, the projector's black taken away.

use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;
use relumine_radiometry::files::{self, Photograph, Picture};
use relumine_radiometry::{
    Counts, Image, Linear, Linearization, Merged, NoiseModel, NoiseSamples, Radiance, Response, Visibility,
    merge_counts, merge_linear,
};
use sha2::{Digest, Sha256};

use crate::noise::Shown;
use crate::separation::Method;
use crate::setup::CameraResponse;
use crate::{Capture, CaptureError, DevelopedPosition, PhotographRow, Scheme, Setup, ShownPattern, recover_response};

/// Develops the positions of a capture, one at a time and in any order.
pub struct Developer {
    capture: Capture,
    linearization: Linearization,
    method: Method,
    black_level: Option<f64>,
}

/// A photograph that could not be used. What it lights is missing from the field, never black.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Loss {
    /// Where the projector stood.
    pub position: usize,
    /// What it showed.
    pub pattern: ShownPattern,
    /// Why the photograph cannot be used.
    pub reason: String,
    /// Whether other exposures of the same pattern remain, so that only precision is lost.
    pub others_remain: bool,
}

impl fmt::Display for Loss {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "position {}, {}: {}", self.position, self.pattern, self.reason)?;
        if self.others_remain { write!(f, " (its other exposures are used)") } else { Ok(()) }
    }
}

impl Developer {
    /// Prepares to develop `capture`. `black_level` is the projector's b; `None` measures it at each position. Where the response
    /// is to be recovered, it is, from the capture's own exposures.
    ///
    /// # Errors
    /// If the response cannot be recovered, or the black level cannot be.
    pub fn new(capture: Capture, method: Method, black_level: Option<f64>) -> Result<Self, CaptureError> {
        check_black_level(&capture, black_level)?;
        let response = match capture.setup().response() {
            CameraResponse::Known(response) => response.clone(),
            CameraResponse::Recover => recover_response(&capture)?.response,
        };
        let (black_counts, white_counts) = capture.setup().levels();
        let linearization = Linearization::new(&response, black_counts, white_counts);
        Ok(Self { capture, linearization, method, black_level })
    }

    /// As [`Developer::new`] where `capture.toml` says `response = "recover"`, with the curve that was recovered before.
    ///
    /// # Errors
    /// If the black level cannot be.
    pub fn with_recovered(
        capture: Capture,
        method: Method,
        black_level: Option<f64>,
        response: &Response,
    ) -> Result<Self, CaptureError> {
        check_black_level(&capture, black_level)?;
        let (black_counts, white_counts) = capture.setup().levels();
        let linearization = Linearization::new(response, black_counts, white_counts);
        Ok(Self { capture, linearization, method, black_level })
    }

    /// The capture under development.
    pub fn capture(&self) -> &Capture {
        &self.capture
    }

    /// How squares are told apart.
    pub fn method(&self) -> Method {
        self.method
    }

    /// The table from counts to relative exposure.
    pub(crate) fn linearization(&self) -> &Linearization {
        &self.linearization
    }

    /// Bytes that one position needs in memory while it is developed, and `tile_pixels` of its squares are told apart.
    pub fn bytes_per_position(&self, tile_pixels: usize) -> usize {
        self.capture.setup().developing_bytes(tile_pixels)
    }

    /// What the photographs of one pattern show more than the black frame: radiance, its colours corrected, with the projector's
    /// black in it once less (1 − b of what its white would show). `None` if a photograph is missing or damaged.
    ///
    /// # Errors
    /// If a picture is whole but not what `capture.toml` promises.
    pub fn above_black(&self, position: usize, pattern: ShownPattern) -> Result<Option<Image<Radiance>>, CaptureError> {
        let mut losses = Vec::new();
        let (Some(shown), Some(black)) = (
            self.radiance(position, pattern, &mut losses)?,
            self.radiance(position, ShownPattern::Black, &mut losses)?,
        ) else {
            return Ok(None);
        };
        let mut picture = shown.radiance;
        if let Some(patch) = self.capture.setup().reference_patch() {
            let lamp = self.lamp(position, pattern, patch, picture.pixels().as_flattened(), &black)?;
            picture.pixels_mut().as_flattened_mut().iter_mut().for_each(|value| *value /= lamp as f32);
        }
        for (pixel, black) in picture.pixels_mut().iter_mut().zip(black.radiance.pixels()) {
            (0..3).for_each(|channel| pixel[channel] -= black[channel]);
        }
        if let Some(colour) = self.capture.setup().colour() {
            colour.apply_to(&mut picture);
        }
        Ok(Some(picture))
    }

    /// Reads the photographs of a position and makes radiance of them. Inside, `Err` with what was lost if there is no black
    /// frame or nothing it could be taken from: then the whole position is missing.
    ///
    /// # Errors
    /// If a picture is whole but not what `capture.toml` promises (size, bits): then the set-up is wrong, not a photograph.
    pub fn develop(&self, position: usize) -> Result<Result<DevelopedPosition<'_>, Vec<Loss>>, CaptureError> {
        let setup = self.capture.setup();
        let patterns = setup.scheme().lighting(setup.cells().squares());
        let mut losses = Vec::new();
        let Some(black) = self.radiance(position, ShownPattern::Black, &mut losses)? else {
            return Ok(Err(losses));
        };
        let clipped = Mutex::new(vec![0u8; black.visibility.len()]);
        let count_clipped = |merged: &Merged| {
            let mut clipped = clipped.lock().unwrap_or_else(PoisonError::into_inner);
            for (count, seen) in clipped.iter_mut().zip(&merged.visibility) {
                *count = count.saturating_add(u8::from(*seen == Visibility::Clipped));
            }
        };
        count_clipped(&black);
        // All photographs are held at once: of each nothing but its radiance.
        let loaded: Vec<(Option<Image<Radiance>>, NoiseSamples, Vec<Loss>)> = patterns
            .par_iter()
            .map(|pattern| {
                let mut losses = Vec::new();
                let merged = self.radiance(position, *pattern, &mut losses)?;
                merged.iter().for_each(count_clipped);
                let samples = merged.as_ref().map(NoiseSamples::of).unwrap_or_default();
                Ok((merged.map(|merged| merged.radiance), samples, losses))
            })
            .collect::<Result<_, CaptureError>>()?;
        let clipped = clipped.into_inner().unwrap_or_else(PoisonError::into_inner);
        let mut samples = NoiseSamples::of(&black);
        let mut frames = Vec::with_capacity(loaded.len());
        for (radiance, of_frame, lost) in loaded {
            samples.add(&of_frame);
            frames.push(radiance.map(|radiance| radiance.into_pixels().into_flattened()));
            losses.extend(lost);
        }
        if frames.iter().all(Option::is_none) {
            return Ok(Err(losses));
        }
        let mut white = self.white(position, &mut losses)?;
        let lamp = match setup.reference_patch() {
            Some(patch) => Some(self.take_drift_out(position, patch, &black, &mut frames, white.as_mut())?),
            None => None,
        };
        let black = black.radiance.into_pixels().into_flattened();
        let black_level = match self.black_level {
            Some(black_level) => Some(black_level),
            None => measured_black_level(setup.scheme(), &black, &frames, white.as_deref()),
        };
        let shown = Shown {
            scheme: setup.scheme(),
            frames: &frames,
            black: &black,
            white: white.as_deref(),
            black_level: black_level.unwrap_or(0.0),
            clipped: &clipped,
        };
        let (noise, black, black_variance) = shown.noise(samples.curve());
        let scale = (1.0 / (1.0 - black_level.unwrap_or(0.0))) as f32;
        frames.par_iter_mut().flatten().chain(white.par_iter_mut()).for_each(|frame| {
            frame.iter_mut().zip(&black).for_each(|(value, black)| *value = (*value - black) * scale);
        });
        Ok(Ok(DevelopedPosition {
            setup,
            method: self.method,
            position,
            frames,
            white,
            black,
            black_variance,
            noise,
            black_level,
            lamp,
            clipped,
            losses,
        }))
    }

    /// The white frame, NaN where every exposure is clipped; not having one loses nothing.
    fn white(&self, position: usize, losses: &mut Vec<Loss>) -> Result<Option<Vec<f32>>, CaptureError> {
        if self.capture.exposures(position, ShownPattern::White).is_empty() {
            return Ok(None);
        }
        let merged = self.radiance(position, ShownPattern::White, losses)?;
        Ok(merged.map(|merged| {
            let mut pixels = merged.radiance.into_pixels();
            for (pixel, seen) in pixels.iter_mut().zip(&merged.visibility) {
                if *seen == Visibility::Clipped {
                    *pixel = [f32::NAN; 3];
                }
            }
            pixels.into_flattened()
        }))
    }

    /// The radiance of one pattern from all its exposures that can be used.
    fn radiance(
        &self,
        position: usize,
        pattern: ShownPattern,
        losses: &mut Vec<Loss>,
    ) -> Result<Option<Merged>, CaptureError> {
        let rows = self.capture.exposures(position, pattern);
        if rows.is_empty() {
            let reason = "no photograph in photographs.csv".to_string();
            losses.push(Loss { position, pattern, reason, others_remain: false });
            return Ok(None);
        }
        let mut counts: Vec<(Image<Counts>, f64)> = Vec::new();
        let mut linear: Vec<(Image<Linear>, f64)> = Vec::new();
        let mut reasons = Vec::new();
        for row in rows {
            match Self::read(&self.capture, row)? {
                Ok(Picture::Integer { image, .. }) => counts.push((image, row.exposure.relative())),
                Ok(Picture::Float(image)) => linear.push((image, row.exposure.relative())),
                Err(reason) => reasons.push(reason),
            }
        }
        let others_remain = !(counts.is_empty() && linear.is_empty());
        losses.extend(reasons.into_iter().map(|reason| Loss { position, pattern, reason, others_remain }));
        if !counts.is_empty() && !linear.is_empty() {
            return Err(CaptureError::Photograph {
                path: self.capture.directory().join(&rows[0].file),
                reason: format!("position {position}, {pattern}: exposures must be all counts or all floats"),
            });
        }
        let counts: Vec<_> = counts.iter().map(|(image, t)| (image, *t)).collect();
        let linear: Vec<_> = linear.iter().map(|(image, t)| (image, *t)).collect();
        Ok(match (counts.is_empty(), linear.is_empty()) {
            (false, _) => Some(merge_counts(&counts, &self.linearization, NoiseModel::default())),
            (_, false) => Some(merge_linear(&linear, NoiseModel::default())),
            _ => None,
        })
    }

    /// One photograph: `Ok(Err(reason))` if this file is lost, `Err` if it contradicts the set-up.
    pub(crate) fn photograph(&self, row: &PhotographRow) -> Result<Result<Picture, String>, CaptureError> {
        Self::read(&self.capture, row)
    }

    /// A photograph of a capture, as [`Developer::photograph`].
    pub(crate) fn read(capture: &Capture, row: &PhotographRow) -> Result<Result<Picture, String>, CaptureError> {
        let path = capture.directory().join(&row.file);
        let bytes = match fs::read(&path) {
            Ok(bytes) => bytes,
            Err(error) => return Ok(Err(format!("cannot read {}: {error}", path.display()))),
        };
        if let Some(listed) = row.sha256
            && Sha256::digest(&bytes)[..] != listed
        {
            return Ok(Err(format!("{}: the file has changed: its SHA-256 is not the listed one", path.display())));
        }
        match files::decode_photograph(&path, &bytes) {
            Ok(photograph) => {
                let picture = Self::picture(capture.setup(), &path, photograph)?;
                let fail = |reason| CaptureError::Photograph { path: path.clone(), reason };
                capture.setup().check_picture(&picture).map_err(fail)?;
                Ok(Ok(picture))
            }
            Err(error) => Ok(Err(error.to_string())),
        }
    }

    /// The picture of a photograph; the levels that a camera's RAW says must be those of the set-up.
    fn picture(setup: &Setup, path: &Path, photograph: Photograph) -> Result<Picture, CaptureError> {
        let raw = match photograph {
            Photograph::Picture(picture) => return Ok(picture),
            Photograph::Raw(raw) => raw,
        };
        let (black, white) = setup.levels();
        let said = raw.levels;
        if (said.black, said.white) != (black, white) || setup.response_name() != "linear" {
            let reason = format!(
                "a camera RAW with black_level = {}, white_level = {} and response = \"linear\", but capture.toml says \
                 {black}, {white} and \"{}\"",
                said.black,
                said.white,
                setup.response_name()
            );
            return Err(CaptureError::Photograph { path: PathBuf::from(path), reason });
        }
        Ok(Picture::Integer { image: raw.image, bits: 16 })
    }
}

fn check_black_level(capture: &Capture, black_level: Option<f64>) -> Result<(), CaptureError> {
    match black_level.filter(|b| !(0.0..1.0).contains(b)) {
        Some(b) => Err(CaptureError::Setup {
            path: capture.directory().join("capture.toml"),
            reason: format!("the projector's black level must be at least 0 and below 1, but is {b}"),
        }),
        None => Ok(()),
    }
}

/// b from the ratio of the black frame to the white one, over all pixels. Without a white frame, from the sum of
/// photographs that light every square once: all single squares, or one family of combs. `None` if there is neither.
fn measured_black_level(
    scheme: Scheme,
    black: &[f32],
    frames: &[Option<Vec<f32>>],
    white: Option<&[f32]>,
) -> Option<f64> {
    let sum = |frame: &[f32]| frame.iter().map(|value| f64::from(*value)).sum::<f64>();
    if let Some(white) = white {
        let trusted = black.iter().zip(white).filter(|(_, white)| !white.is_nan());
        let (black, white) =
            trusted.fold((0.0, 0.0), |(b, w), (black, white)| (b + f64::from(*black), w + f64::from(*white)));
        if white > 0.0 {
            return Some((black / white).clamp(0.0, 0.5));
        }
    }
    let families = match scheme {
        Scheme::Combs { .. } => frames.chunks(frames.len() / 2),
        Scheme::Squares => frames.chunks(frames.len()),
    };
    let black = sum(black);
    let whole = families.filter(|family| family.iter().all(Option::is_some));
    // Σ (photograph − black) = (1 − b)·white and black = b·white.
    let lit = whole.map(|family| family.iter().flatten().map(|frame| sum(frame) - black).sum::<f64>());
    lit.filter(|lit| *lit > 0.0).map(|lit| (black / (lit + black)).clamp(0.0, 0.5)).next()
}
