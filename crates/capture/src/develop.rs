//! Photographs of one position → the transfer of its squares, Rᵢ = Sᵢ · |Ωᵢ| / Φ_square (eq. 5, docs/MATH.md).

use std::fmt;
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use relumine_basis::Cell;
use relumine_radiometry::files::{self, Picture};
use relumine_radiometry::{
    Counts, Image, Linear, Linearization, Merged, NoiseModel, Visibility, merge_counts, merge_linear,
};
use sha2::{Digest, Sha256};

use crate::separation::{self, Combs, Method, Residual};
use crate::setup::CameraResponse;
use crate::{Capture, CaptureError, PhotographRow, Scheme, ShownPattern};

/// Pixels that are separated together.
const STRIP: usize = 64;

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

/// The photographs of one position as radiance, black taken away, ready to be separated.
pub struct DevelopedPosition<'a> {
    developer: &'a Developer,
    position: usize,
    /// Lighting patterns in the order of the scheme, minus black, over 1 − b, three lanes a pixel.
    frames: Vec<Option<Vec<f32>>>,
    /// The white frame likewise; NaN where every exposure is clipped.
    white: Option<Vec<f32>>,
    black_level: f64,
    clipped: Vec<u8>,
    losses: Vec<Loss>,
}

/// Separated squares of a rectangle of pixels.
pub struct Tile {
    /// Columns of the picture.
    pub columns: Range<usize>,
    /// Rows of the picture.
    pub rows: Range<usize>,
    /// Transfer, `[(v · M + u)][row][column][channel]`.
    pub transfer: Vec<f32>,
    /// How well the squares explain the photographs.
    pub residual: Residual,
    /// How well the minimum alone would explain them.
    pub residual_of_minimum: Residual,
}

impl Developer {
    /// Prepares to develop `capture`. `black_level` is the projector's b; `None` measures it at each position.
    ///
    /// # Errors
    /// If the camera's response is not known.
    pub fn new(capture: Capture, method: Method, black_level: Option<f64>) -> Result<Self, CaptureError> {
        let fail = |reason: String| Err(CaptureError::Setup { path: capture.directory().join("capture.toml"), reason });
        if let Some(b) = black_level
            && !(0.0..1.0).contains(&b)
        {
            return fail(format!("the projector's black level must be at least 0 and below 1, but is {b}"));
        }
        let linearization = match capture.setup().response() {
            CameraResponse::Known(_) => capture.setup().linearization(),
            CameraResponse::Recover => None,
        };
        match linearization {
            Some(linearization) => Ok(Self { capture, linearization, method, black_level }),
            None => fail(
                "camera: response = \"recover\" is not built yet; give \"linear\", \"srgb\" or a response file".into(),
            ),
        }
    }

    /// The capture under development.
    pub fn capture(&self) -> &Capture {
        &self.capture
    }

    /// How squares are told apart.
    pub fn method(&self) -> Method {
        self.method
    }

    /// Bytes that one position needs in memory while it is developed, tiles of `tile_pixels` included.
    pub fn bytes_per_position(&self, tile_pixels: usize) -> usize {
        let (width, height) = self.capture.setup().picture_size();
        let squares = self.capture.setup().cells().squares();
        let frames = self.capture.setup().scheme().lighting(squares).len() + 2;
        frames * width * height * 12 + 2 * squares * squares * tile_pixels.min(width * height) * 12
    }

    /// Reads the photographs of a position and makes radiance of them. `None` for the position, with what was lost, if
    /// there is no black frame or nothing it could be taken from.
    ///
    /// # Errors
    /// If a picture is whole but not what `capture.toml` promises (size, bits): then the set-up is wrong, not a photograph.
    pub fn develop(&self, position: usize) -> Result<(Option<DevelopedPosition<'_>>, Vec<Loss>), CaptureError> {
        let setup = self.capture.setup();
        let patterns = setup.scheme().lighting(setup.cells().squares());
        let mut losses = Vec::new();
        let Some(black) = self.radiance(position, ShownPattern::Black, &mut losses)? else {
            return Ok((None, losses));
        };
        let loaded: Vec<(Option<Merged>, Vec<Loss>)> = patterns
            .par_iter()
            .map(|pattern| {
                let mut losses = Vec::new();
                Ok((self.radiance(position, *pattern, &mut losses)?, losses))
            })
            .collect::<Result<_, CaptureError>>()?;
        let mut clipped: Vec<u8> = vec![0; black.visibility.len()];
        let mut count_clipped = |merged: &Merged| {
            for (count, seen) in clipped.iter_mut().zip(&merged.visibility) {
                *count = count.saturating_add(u8::from(*seen == Visibility::Clipped));
            }
        };
        count_clipped(&black);
        let mut frames = Vec::with_capacity(loaded.len());
        for (merged, lost) in loaded {
            merged.iter().for_each(&mut count_clipped);
            frames.push(merged.map(|merged| merged.radiance.into_pixels().into_flattened()));
            losses.extend(lost);
        }
        if frames.iter().all(Option::is_none) {
            return Ok((None, losses));
        }
        let white = self.white(position, &mut losses)?;
        let black = black.radiance.into_pixels().into_flattened();
        let black_level = match self.black_level {
            Some(black_level) => black_level,
            None => measured_black_level(setup.scheme(), &black, &frames, white.as_deref()),
        };
        let scale = (1.0 / (1.0 - black_level)) as f32;
        let mut white = white;
        frames.par_iter_mut().flatten().chain(white.par_iter_mut()).for_each(|frame| {
            frame.iter_mut().zip(&black).for_each(|(value, black)| *value = (*value - black) * scale);
        });
        Ok((
            Some(DevelopedPosition { developer: self, position, frames, white, black_level, clipped, losses }),
            Vec::new(),
        ))
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
            match self.photograph(row)? {
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
            (_, false) => Some(merge_linear(&linear)),
            _ => None,
        })
    }

    /// One photograph: `Ok(Err(reason))` if this file is lost, `Err` if it contradicts the set-up.
    fn photograph(&self, row: &PhotographRow) -> Result<Result<Picture, String>, CaptureError> {
        let path = self.capture.directory().join(&row.file);
        let bytes = match fs::read(&path) {
            Ok(bytes) => bytes,
            Err(error) => return Ok(Err(format!("cannot read {}: {error}", path.display()))),
        };
        if let Some(listed) = row.sha256
            && Sha256::digest(&bytes)[..] != listed
        {
            return Ok(Err(format!("{}: the file has changed: its SHA-256 is not the listed one", path.display())));
        }
        match files::decode_picture(&path, &bytes) {
            Ok(picture) => {
                self.check(&path, &picture)?;
                Ok(Ok(picture))
            }
            Err(error) => Ok(Err(error.to_string())),
        }
    }

    /// Holds a picture against what the set-up promises.
    fn check(&self, path: &Path, picture: &Picture) -> Result<(), CaptureError> {
        let setup = self.capture.setup();
        let fail = |reason: String| Err(CaptureError::Photograph { path: PathBuf::from(path), reason });
        let (width, height) = setup.picture_size();
        if picture.size() != (width, height) {
            let (found_width, found_height) = picture.size();
            return fail(format!(
                "capture.toml promises pictures of {width} × {height}, this one has {found_width} × {found_height}"
            ));
        }
        let (_, white_level) = setup.levels();
        match picture {
            Picture::Integer { bits: 8, .. } if white_level > 255 => fail(format!(
                "an 8-bit picture, but capture.toml promises counts up to white_level = {white_level}: convert nothing to \
                 8 bits, or set white_level"
            )),
            Picture::Integer { bits: 16, .. } if white_level <= 255 => fail(format!(
                "a 16-bit picture, but in capture.toml white_level = {white_level}: set it to the counts at which the \
                 camera clips"
            )),
            Picture::Float(_) if setup.response_name() != "linear" => fail(format!(
                "a float picture is linear already, but capture.toml says response = \"{}\"",
                setup.response_name()
            )),
            _ => Ok(()),
        }
    }
}

/// b from the ratio of the black frame to the white one, over all pixels; without a white frame, from the sum of all
/// squares, which the scheme photographs once (squares) or twice (combs).
fn measured_black_level(scheme: Scheme, black: &[f32], frames: &[Option<Vec<f32>>], white: Option<&[f32]>) -> f64 {
    let sum = |frame: &[f32]| frame.iter().filter(|value| !value.is_nan()).map(|value| f64::from(*value)).sum::<f64>();
    if let Some(white) = white {
        let trusted = black.iter().zip(white).filter(|(_, white)| !white.is_nan());
        let (black, white) =
            trusted.fold((0.0, 0.0), |(b, w), (black, white)| (b + f64::from(*black), w + f64::from(*white)));
        return if white > 0.0 { (black / white).clamp(0.0, 0.5) } else { 0.0 };
    }
    if frames.iter().any(Option::is_none) {
        return 0.0;
    }
    let black = sum(black);
    let times = if matches!(scheme, Scheme::Combs { .. }) { 2.0 } else { 1.0 };
    // Σ (photograph − black) = (1 − b)·white and black = b·white.
    let lit = frames.iter().flatten().map(|frame| sum(frame) - black).sum::<f64>() / times;
    if lit > 0.0 { (black / (lit + black)).clamp(0.0, 0.5) } else { 0.0 }
}

impl DevelopedPosition<'_> {
    /// Which position this is.
    pub fn position(&self) -> usize {
        self.position
    }

    /// b, the share of white that shines through black here.
    pub fn black_level(&self) -> f64 {
        self.black_level
    }

    /// For each pixel, in how many photographs every exposure was clipped: there the transfer is a lower bound.
    pub fn clipped(&self) -> &[u8] {
        &self.clipped
    }

    /// Photographs that could not be used.
    pub fn losses(&self) -> &[Loss] {
        &self.losses
    }

    /// `present[v · M + u]`: whether the photographs that tell the square apart were taken.
    pub fn present(&self) -> Vec<bool> {
        let setup = self.developer.capture.setup();
        let m = setup.cells().squares();
        match setup.scheme() {
            Scheme::Squares => self.frames.iter().map(Option::is_some).collect(),
            Scheme::Combs { .. } => {
                let combs = self.combs(0..0);
                (0..m * m).map(|square| combs.is_present(square % m, square / m)).collect()
            }
        }
    }

    /// An upper bound of the transfer of all squares: no square is brighter than the photographs that show it.
    pub fn transfer_bound(&self) -> f64 {
        let setup = self.developer.capture.setup();
        let m = setup.cells().squares();
        let factor = (0..m * m)
            .map(|square| setup.transfer_per_radiance(Cell { position: self.position, u: square % m, v: square / m }))
            .fold(0.0, f64::max);
        // A fitted comb is scaled to the white frame, which may be brighter than any comb.
        let brightest = self
            .frames
            .iter()
            .flatten()
            .chain(&self.white)
            .flat_map(|frame| frame.iter())
            .fold(0.0f32, |bound, value| bound.max(*value));
        f64::from(brightest) * factor
    }

    /// Noise of one photograph, radiance, root mean square over the picture: from the difference between the sum of the
    /// row combs and the sum of the column combs, which photograph the same light twice; for single squares from their sum
    /// and the white frame. `None` if photographs are missing.
    pub fn noise(&self) -> Option<f64> {
        let frames: Vec<&Vec<f32>> = self.frames.iter().map(Option::as_ref).collect::<Option<_>>()?;
        let squares = matches!(self.developer.capture.setup().scheme(), Scheme::Squares);
        let (plus, minus) = if squares { frames.split_at(frames.len()) } else { frames.split_at(frames.len() / 2) };
        let minus = if squares { vec![self.white.as_ref()?] } else { minus.to_vec() };
        let mut difference = vec![0.0f64; plus[0].len()];
        for (sign, frames) in [(1.0, plus), (-1.0, &minus)] {
            for frame in frames {
                let terms = difference.par_iter_mut().zip(frame.par_iter()).with_min_len(1 << 14);
                terms.for_each(|(sum, value)| *sum += sign * f64::from(*value));
            }
        }
        let (mut sum, mut lanes) = (0.0, 0usize);
        for difference in difference.iter().filter(|difference| difference.is_finite()) {
            sum += difference * difference;
            lanes += 1;
        }
        (lanes > 0).then(|| (sum / lanes as f64 / (plus.len() + minus.len()) as f64).sqrt())
    }

    /// Separates the squares of a rectangle of pixels.
    pub fn separate(&self, columns: Range<usize>, rows: Range<usize>) -> Tile {
        let setup = self.developer.capture.setup();
        let m = setup.cells().squares();
        let (width, _) = setup.picture_size();
        // Strips short enough that a table of their lanes stays in the first cache.
        let starts: Vec<usize> = columns.clone().step_by(STRIP).collect();
        let pieces: Vec<(usize, usize)> =
            rows.clone().flat_map(|row| starts.iter().map(move |start| (row, *start))).collect();
        let strips: Vec<(Vec<f32>, Residual, Residual)> = pieces
            .into_par_iter()
            .map(|(row, start)| {
                let end = (start + STRIP).min(columns.end);
                self.separate_lanes((row * width + start) * 3..(row * width + end) * 3)
            })
            .collect();
        let lanes = columns.len() * 3;
        let factors: Vec<f32> = (0..m * m)
            .map(|square| {
                setup.transfer_per_radiance(Cell { position: self.position, u: square % m, v: square / m }) as f32
            })
            .collect();
        let mut transfer = vec![0.0; m * m * rows.len() * lanes];
        transfer.par_chunks_exact_mut(rows.len() * lanes).zip(&factors).enumerate().for_each(
            |(square, (picture, factor))| {
                let pieces = picture.chunks_exact_mut(lanes).flat_map(|row| row.chunks_mut(3 * STRIP));
                for (piece, (squares, ..)) in pieces.zip(&strips) {
                    let separated = &squares[square * piece.len()..][..piece.len()];
                    piece.iter_mut().zip(separated).for_each(|(transfer, value)| *transfer = value * factor);
                }
            },
        );
        // Added in the order of the rows, whatever thread was first.
        let (mut residual, mut residual_of_minimum) = (Residual::default(), Residual::default());
        for (_, fitted, minimum) in &strips {
            residual.add(*fitted);
            residual_of_minimum.add(*minimum);
        }
        Tile { columns, rows, transfer, residual, residual_of_minimum }
    }

    fn separate_lanes(&self, lanes: Range<usize>) -> (Vec<f32>, Residual, Residual) {
        let setup = self.developer.capture.setup();
        let m = setup.cells().squares();
        if matches!(setup.scheme(), Scheme::Squares) {
            return self.single_squares(lanes);
        }
        let combs = self.combs(lanes);
        let mut squares = vec![0.0; m * m * combs.lanes];
        separation::separate_minimum(&combs, &mut squares);
        let of_minimum = separation::residual(&combs, &squares);
        if self.developer.method == Method::Minimum {
            return (squares, of_minimum, of_minimum);
        }
        separation::separate_fitted(&combs, &mut squares);
        let residual = separation::residual(&combs, &squares);
        (squares, residual, of_minimum)
    }

    fn combs(&self, lanes: Range<usize>) -> Combs<'_> {
        let setup = self.developer.capture.setup();
        let Scheme::Combs { spacing } = setup.scheme() else { unreachable!("only combs have combs") };
        let m = setup.cells().squares();
        let frames: Vec<Option<&[f32]>> =
            self.frames.iter().map(|frame| frame.as_ref().map(|frame| &frame[lanes.clone()])).collect();
        let (rows, columns) = frames.split_at(m * spacing);
        Combs {
            squares: m,
            spacing,
            rows: rows.to_vec(),
            columns: columns.to_vec(),
            white: self.white.as_ref().map(|white| &white[lanes.clone()]),
            lanes: lanes.len(),
        }
    }

    /// Squares that were photographed alone need no separation; only the white frame has something to say.
    fn single_squares(&self, lanes: Range<usize>) -> (Vec<f32>, Residual, Residual) {
        let count = lanes.len();
        let mut squares = vec![0.0; self.frames.len() * count];
        for (square, frame) in squares.chunks_exact_mut(count).zip(&self.frames) {
            let Some(frame) = frame else { continue };
            square.iter_mut().zip(&frame[lanes.clone()]).for_each(|(value, frame)| *value = frame.max(0.0));
        }
        let mut residual = Residual::default();
        if let (Some(white), true) = (&self.white, self.frames.iter().all(Option::is_some)) {
            for (lane, white) in white[lanes].iter().enumerate().filter(|(_, white)| !white.is_nan()) {
                let sum: f32 = squares.chunks_exact(count).map(|square| square[lane]).sum();
                residual.white_error += f64::from(sum - white).powi(2);
                residual.white_energy += f64::from(*white).powi(2);
            }
        }
        (squares, residual, residual)
    }
}
