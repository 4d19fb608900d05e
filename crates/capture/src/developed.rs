//! The photographs of one position, developed: its squares told apart, and how well they explain the photographs.
//!
//! The camera's colours are corrected last, on the transfers. Telling squares apart relies on what holds of the camera's own
//! channels and not of mixtures of them: they are never negative, and what one is clipped or noisy by is its own affair. The
//! matrix is linear, so that it may come after the sum that makes a square; colours outside of Rec. 709 come out with negative
//! channels, and stay so.

use std::ops::Range;

use rayon::prelude::*;
use relumine_basis::Cell;
use relumine_radiometry::colour::Correction;

use crate::separation::{self, CombNoise, Combs, Method, Removed, Residual, THRESHOLD_SIGMAS};
use crate::{Loss, PositionNoise, Scheme, Setup};

/// Pixels that are separated together.
const STRIP: usize = 64;

/// The photographs of one position as radiance, black taken away, ready to be separated.
pub struct DevelopedPosition<'a> {
    pub(crate) setup: &'a Setup,
    pub(crate) method: Method,
    pub(crate) position: usize,
    /// Lighting patterns in the order of the scheme, minus black, over 1 − b, three lanes a pixel.
    pub(crate) frames: Vec<Option<Vec<f32>>>,
    /// The white frame likewise; NaN where every exposure is clipped.
    pub(crate) white: Option<Vec<f32>>,
    /// What was subtracted, three lanes a pixel, and its variance.
    pub(crate) black: Vec<f32>,
    pub(crate) black_variance: Vec<f32>,
    pub(crate) noise: Option<PositionNoise>,
    pub(crate) black_level: Option<f64>,
    pub(crate) lamp: Option<(f64, f64)>,
    pub(crate) clipped: Vec<u8>,
    pub(crate) losses: Vec<Loss>,
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
    /// What was taken from the light because of noise.
    pub removed: Removed,
}

impl DevelopedPosition<'_> {
    /// Which position this is.
    pub fn position(&self) -> usize {
        self.position
    }

    /// b, the share of white that shines through black here; `None` if it could not be measured and nothing was divided by
    /// 1 − b.
    pub fn black_level(&self) -> Option<f64> {
        self.black_level
    }

    /// The least and the most that the lamp shone over what it shone for the black frame, as the reference patch says: taken out. `None`
    /// without a reference patch.
    pub fn lamp(&self) -> Option<(f64, f64)> {
        self.lamp
    }

    /// For each pixel, in how many photographs every exposure was clipped: there the transfer is a lower bound.
    pub fn clipped(&self) -> &[u8] {
        &self.clipped
    }

    /// What the photographs are uncertain by; `None` if every sample is clipped.
    pub fn photograph_noise(&self) -> Option<&PositionNoise> {
        self.noise.as_ref()
    }

    /// Photographs that could not be used.
    pub fn losses(&self) -> &[Loss] {
        &self.losses
    }

    /// `present[v · M + u]`: whether the photographs that tell the square apart were taken.
    pub fn present(&self) -> Vec<bool> {
        let setup = self.setup;
        let m = setup.cells().squares();
        match setup.scheme() {
            Scheme::Squares => self.frames.iter().map(Option::is_some).collect(),
            Scheme::Combs { .. } => {
                let combs = self.combs(0..0);
                (0..m * m).map(|square| combs.is_present(square % m, square / m)).collect()
            }
        }
    }

    /// What the transfers of this position reach, up or down: no square is brighter than the brightest photograph, up to noise.
    pub fn transfer_bound(&self) -> f64 {
        let setup = self.setup;
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
        let gain = setup.colour().and_then(Correction::matrix).map_or(1.0, |matrix| {
            matrix.iter().map(|row| row.iter().map(|value| value.abs()).sum::<f64>()).fold(0.0, f64::max)
        });
        f64::from(brightest) * factor * gain
    }

    /// Noise of one photograph, radiance, root mean square over the picture: from the difference between the sum of the
    /// row combs and the sum of the column combs, which photograph the same light twice; for single squares from their sum
    /// and the white frame. `None` if photographs are missing.
    pub fn noise(&self) -> Option<f64> {
        let frames: Vec<&Vec<f32>> = self.frames.iter().map(Option::as_ref).collect::<Option<_>>()?;
        let squares = matches!(self.setup.scheme(), Scheme::Squares);
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
        let setup = self.setup;
        let m = setup.cells().squares();
        let (width, _) = setup.picture_size();
        // Strips short enough that a table of their lanes stays in the first cache.
        let starts: Vec<usize> = columns.clone().step_by(STRIP).collect();
        let pieces: Vec<(usize, usize)> =
            rows.clone().flat_map(|row| starts.iter().map(move |start| (row, *start))).collect();
        let strips: Vec<(Vec<f32>, Residual, Residual, Removed)> = pieces
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
                    if let Some(colour) = setup.colour() {
                        piece.as_chunks_mut::<3>().0.iter_mut().for_each(|pixel| {
                            *pixel = colour.apply(pixel.map(f64::from)).map(|value| value as f32);
                        });
                    }
                }
            },
        );
        // Added in the order of the rows, whatever thread was first.
        let (mut residual, mut residual_of_minimum) = (Residual::default(), Residual::default());
        let mut removed = Removed::default();
        for (_, fitted, minimum, of_strip) in &strips {
            residual.add(*fitted);
            residual_of_minimum.add(*minimum);
            removed.add(*of_strip);
        }
        Tile { columns, rows, transfer, residual, residual_of_minimum, removed }
    }

    fn separate_lanes(&self, lanes: Range<usize>) -> (Vec<f32>, Residual, Residual, Removed) {
        let setup = self.setup;
        let m = setup.cells().squares();
        if matches!(setup.scheme(), Scheme::Squares) {
            let (squares, residual) = self.single_squares(lanes);
            return (squares, residual, residual, Removed::default());
        }
        let combs = self.combs(lanes);
        let mut squares = vec![0.0; m * m * combs.lanes];
        separation::separate_minimum(&combs, &mut squares);
        let of_minimum = separation::residual(&combs, &squares);
        let removed = match self.method {
            Method::Minimum => return (squares, of_minimum, of_minimum, Removed::default()),
            Method::Thresholded => separation::separate_thresholded(&combs, THRESHOLD_SIGMAS, &mut squares),
            Method::Unbiased => separation::separate_unbiased(&combs, &mut squares),
            Method::Fitted => separation::separate_fitted(&combs, &mut squares),
        };
        let residual = separation::residual(&combs, &squares);
        (squares, residual, of_minimum, removed)
    }

    fn combs(&self, lanes: Range<usize>) -> Combs<'_> {
        let setup = self.setup;
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
            noise: self.noise.as_ref().map(|noise| CombNoise {
                curve: &noise.curve,
                black: &self.black[lanes.clone()],
                black_variance: &self.black_variance[lanes.clone()],
                scale: (1.0 / (1.0 - noise.black_level)) as f32,
            }),
            lanes: lanes.len(),
        }
    }

    /// Squares that were photographed alone need no separation; only the white frame has something to say. What noise makes
    /// negative stays, lest what it makes positive add up.
    fn single_squares(&self, lanes: Range<usize>) -> (Vec<f32>, Residual) {
        let count = lanes.len();
        let mut squares = vec![0.0; self.frames.len() * count];
        for (square, frame) in squares.chunks_exact_mut(count).zip(&self.frames) {
            let Some(frame) = frame else { continue };
            square.copy_from_slice(&frame[lanes.clone()]);
        }
        let mut residual = Residual::default();
        if let (Some(white), true) = (&self.white, self.frames.iter().all(Option::is_some)) {
            for (lane, white) in white[lanes].iter().enumerate().filter(|(_, white)| !white.is_nan()) {
                let sum: f32 = squares.chunks_exact(count).map(|square| square[lane]).sum();
                residual.white_error += f64::from(sum - white).powi(2);
                residual.white_energy += f64::from(*white).powi(2);
            }
        }
        (squares, residual)
    }
}
