//! The photographs of one position, developed: its squares told apart, and how well they explain the photographs.
//!
//! The camera's colours are corrected last, on the transfers. Telling squares apart relies on what holds of the camera's own
//! channels and not of mixtures of them: they are never negative, and what one is clipped or noisy by is its own affair. The
//! matrix is linear, so that it may come after the sum that makes a square; colours outside of Rec. 709 come out with negative
//! channels, and stay so.

use std::ops::Range;

use rayon::prelude::*;
use relumine_basis::Cell;
use relumine_radiometry::MeasuredLanes;
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

/// Squares of a rectangle of pixels, told apart.
pub struct Tile<T> {
    /// Columns of the picture.
    pub columns: Range<usize>,
    /// Rows of the picture.
    pub rows: Range<usize>,
    /// Transfer, `[(v · M + u)][channel][row][column]`.
    pub transfer: Vec<T>,
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
                let combs = self.combs(None);
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
        let frames: Vec<&Vec<f32>> = self.frames.iter().flatten().chain(&self.white).collect();
        let brightest = frames.into_par_iter().map(|frame| brightest(frame)).reduce(|| 0.0, f32::max);
        let gain = setup.colour().and_then(Correction::matrix).map_or(1.0, |matrix| {
            matrix.iter().map(|row| row.iter().map(|value| value.abs()).sum::<f64>()).fold(0.0, f64::max)
        });
        f64::from(brightest) * factor * gain
    }

    /// Noise of one photograph, radiance, root mean square over the measured lanes: from the difference between the sum of the
    /// row combs and the sum of the column combs, which photograph the same light twice; for single squares from their sum
    /// and the white frame. `None` if photographs are missing.
    pub fn noise(&self) -> Option<f64> {
        let frames: Vec<&Vec<f32>> = self.frames.iter().map(Option::as_ref).collect::<Option<_>>()?;
        let squares = matches!(self.setup.scheme(), Scheme::Squares);
        let (plus, minus) = if squares { frames.split_at(frames.len()) } else { frames.split_at(frames.len() / 2) };
        let minus = if squares { vec![self.white.as_ref()?] } else { minus.to_vec() };
        let add = |frames: &[&Vec<f32>], lane: usize| frames.iter().map(|frame| f64::from(frame[lane])).sum::<f64>();
        let (mut sum, mut lanes) = (0.0, 0usize);
        for lane in MeasuredLanes::of(plus[0].len()).iter() {
            let difference = add(plus, lane) - add(&minus, lane);
            if difference.is_finite() {
                sum += difference * difference;
                lanes += 1;
            }
        }
        (lanes > 0).then(|| (sum / lanes as f64 / (plus.len() + minus.len()) as f64).sqrt())
    }

    /// Tells the squares of a rectangle of pixels apart.
    pub fn separate(&self, columns: Range<usize>, rows: Range<usize>) -> Tile<f32> {
        self.separate_as(columns, rows, |transfer, samples| samples.copy_from_slice(transfer))
    }

    /// As [`DevelopedPosition::separate`]; `convert` makes samples of transfers, a run of pixels of one channel at a time.
    pub fn separate_as<T: Clone + Default>(
        &self,
        columns: Range<usize>,
        rows: Range<usize>,
        convert: impl Fn(&[f32], &mut [T]),
    ) -> Tile<T> {
        let setup = self.setup;
        let m = setup.cells().squares();
        let (width, _) = setup.picture_size();
        let cell = |square: usize| Cell { position: self.position, u: square % m, v: square / m };
        let factors: Vec<f32> = (0..m * m).map(|square| setup.transfer_per_radiance(cell(square)) as f32).collect();
        let mut transfer = vec![T::default(); m * m * 3 * rows.len() * columns.len()];
        let (mut residual, mut residual_of_minimum) = (Residual::default(), Residual::default());
        let mut removed = Removed::default();
        let (mut strip, mut squares) = (Strip::default(), Vec::new());
        for row in rows.clone() {
            for start in columns.clone().step_by(STRIP) {
                let pixels = start..(start + STRIP).min(columns.end);
                let count = pixels.len();
                strip.load(self, row * width + pixels.start..row * width + pixels.end);
                let (fitted, minimum, of_strip) = self.separate_strip(&strip, &mut squares);
                residual.add(fitted);
                residual_of_minimum.add(minimum);
                removed.add(of_strip);
                for (square, (samples, factor)) in squares.chunks_exact_mut(3 * count).zip(&factors).enumerate() {
                    samples.iter_mut().for_each(|value| *value *= factor);
                    if let Some(colour) = setup.colour() {
                        correct(samples, colour);
                    }
                    for (channel, samples) in samples.chunks_exact(count).enumerate() {
                        let line = (square * 3 + channel) * rows.len() + row - rows.start;
                        convert(samples, &mut transfer[line * columns.len() + start - columns.start..][..count]);
                    }
                }
            }
        }
        Tile { columns, rows, transfer, residual, residual_of_minimum, removed }
    }

    /// Tells the squares of a strip apart, `squares[(v · M + u) · lanes + lane]`: how well they and their minima explain the
    /// photographs, and what was removed.
    fn separate_strip(&self, strip: &Strip, squares: &mut Vec<f32>) -> (Residual, Residual, Removed) {
        let setup = self.setup;
        let m = setup.cells().squares();
        let lanes = strip.black.len();
        squares.resize(m * m * lanes, 0.0);
        if matches!(setup.scheme(), Scheme::Squares) {
            let residual = self.single_squares(strip, squares);
            return (residual, residual, Removed::default());
        }
        let combs = self.combs(Some(strip));
        let of_minimum = separation::residual_of_minimum(&combs);
        let removed = match self.method {
            Method::Minimum => {
                separation::separate_minimum(&combs, squares);
                return (of_minimum, of_minimum, Removed::default());
            }
            Method::Thresholded => separation::separate_thresholded(&combs, THRESHOLD_SIGMAS, squares),
            Method::Unbiased => separation::separate_unbiased(&combs, squares),
            Method::Fitted => separation::separate_fitted(&combs, squares),
        };
        (separation::residual(&combs, squares), of_minimum, removed)
    }

    /// The combs of a strip, or of no lanes at all.
    fn combs<'s>(&'s self, strip: Option<&'s Strip>) -> Combs<'s> {
        let setup = self.setup;
        let Scheme::Combs { spacing } = setup.scheme() else { unreachable!("only combs have combs") };
        let m = setup.cells().squares();
        let frames: Vec<Option<&[f32]>> = (0..self.frames.len())
            .map(|frame| self.frames[frame].as_ref().map(|_| strip.map_or(&[][..], |strip| strip.frame(frame))))
            .collect();
        let (rows, columns) = frames.split_at(m * spacing);
        Combs {
            squares: m,
            spacing,
            rows: rows.to_vec(),
            columns: columns.to_vec(),
            white: strip.and_then(|strip| self.white.as_ref().map(|_| &strip.white[..])),
            noise: strip.zip(self.noise.as_ref()).map(|(strip, noise)| CombNoise {
                curve: &noise.curve,
                black: &strip.black,
                black_variance: &strip.black_variance,
                scale: (1.0 / (1.0 - noise.black_level)) as f32,
            }),
            lanes: strip.map_or(0, |strip| strip.black.len()),
        }
    }

    /// Squares that were photographed alone need no separation; only the white frame has something to say. What noise makes
    /// negative stays, lest what it makes positive add up.
    fn single_squares(&self, strip: &Strip, squares: &mut [f32]) -> Residual {
        let lanes = strip.black.len();
        for (index, (square, frame)) in squares.chunks_exact_mut(lanes).zip(&self.frames).enumerate() {
            match frame {
                Some(_) => square.copy_from_slice(strip.frame(index)),
                None => square.fill(0.0),
            }
        }
        let mut residual = Residual::default();
        if self.white.is_some() && self.frames.iter().all(Option::is_some) {
            for (lane, white) in strip.white.iter().enumerate().filter(|(_, white)| !white.is_nan()) {
                let sum: f32 = squares.chunks_exact(lanes).map(|square| square[lane]).sum();
                residual.white_error += f64::from(sum - white).powi(2);
                residual.white_energy += f64::from(*white).powi(2);
            }
        }
        residual
    }
}

relumine_radiometry::for_this_machine! {
    /// The largest of the values that are numbers; 0 if none is larger.
    fn brightest(values: &[f32]) -> f32 = brightest_together::<64>
}

#[inline(always)]
fn brightest_together<const W: usize>(values: &[f32]) -> f32 {
    let mut largest = [0.0; W];
    let (chunks, rest) = values.as_chunks::<W>();
    for chunk in chunks {
        (0..W).for_each(|lane| largest[lane] = if chunk[lane] > largest[lane] { chunk[lane] } else { largest[lane] });
    }
    largest.iter().chain(rest).fold(0.0, |largest, value| largest.max(*value))
}

/// The photographs of a run of pixels, each `[channel][pixel]`: in the order in which squares go out.
#[derive(Default)]
struct Strip {
    /// One after the other; unspecified where a photograph is missing.
    frames: Vec<f32>,
    white: Vec<f32>,
    black: Vec<f32>,
    black_variance: Vec<f32>,
}

impl Strip {
    fn load(&mut self, position: &DevelopedPosition, pixels: Range<usize>) {
        let lanes = 3 * pixels.len();
        let load = |from: &[f32], to: &mut [f32]| planar(from[3 * pixels.start..3 * pixels.end].as_chunks().0, to);
        self.frames.resize(position.frames.len() * lanes, 0.0);
        for (to, frame) in self.frames.chunks_exact_mut(lanes).zip(&position.frames) {
            frame.iter().for_each(|frame| load(frame, to));
        }
        for values in [&mut self.white, &mut self.black, &mut self.black_variance] {
            values.resize(lanes, 0.0);
        }
        position.white.iter().for_each(|white| load(white, &mut self.white));
        load(&position.black, &mut self.black);
        load(&position.black_variance, &mut self.black_variance);
    }

    fn frame(&self, index: usize) -> &[f32] {
        let lanes = self.black.len();
        &self.frames[index * lanes..][..lanes]
    }
}

relumine_radiometry::for_this_machine! {
    /// Pixels as `[channel][pixel]`.
    fn planar(pixels: &[[f32; 3]], planes: &mut [f32]) -> () = planar_plain
}

#[inline(always)]
fn planar_plain(pixels: &[[f32; 3]], planes: &mut [f32]) {
    let (red, rest) = planes.split_at_mut(pixels.len());
    let (green, blue) = rest.split_at_mut(pixels.len());
    for (((pixel, red), green), blue) in pixels.iter().zip(red).zip(green).zip(blue) {
        [*red, *green, *blue] = *pixel;
    }
}

/// Corrects the colours of pixels, `[channel][pixel]`.
fn correct(samples: &mut [f32], colour: &Correction) {
    let count = samples.len() / 3;
    for pixel in 0..count {
        let found = [0, 1, 2].map(|channel| f64::from(samples[channel * count + pixel]));
        for (channel, value) in colour.apply(found).into_iter().enumerate() {
            samples[channel * count + pixel] = value as f32;
        }
    }
}
