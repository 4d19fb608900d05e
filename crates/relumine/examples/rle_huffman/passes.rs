//! Passes over a field: position by position, some squares at a time, for many listeners at once.

use half::f16;
use half::slice::HalfFloatSliceExt;
use rayon::prelude::*;
use relumine::{Coefficients, ReflectanceField};
use relumine_field::{BlockBuffer, FieldError, Shard};

use crate::coding::{Coded, Coding, Picture, RunLength, decode};
use crate::huffman::{Code, Histogram, TABLE_BYTES, count};

/// Pixels of the basis images that are in memory at a time.
const PIXELS_AT_ONCE: usize = 1 << 22;

/// What hears every basis image of a field, in the order of the cells.
pub(crate) trait Listener: Send {
    /// Some successive cells, the first of them `cell`.
    fn hear(&mut self, cell: usize, pictures: &[Picture]);

    /// The position is complete.
    fn position_done(&mut self) {}
}

/// Reads the field once. Samples below `floor` may be left out.
///
/// # Errors
/// If the field cannot be read or is damaged.
pub(crate) fn pass<L: Listener>(field: &ReflectanceField, floor: f32, listeners: &mut [L]) -> Result<(), FieldError> {
    let (width, height) = field.picture_size();
    let squares = field.cells().squares() * field.cells().squares();
    let at_once = (PIXELS_AT_ONCE / (width * height)).clamp(1, squares);
    for position in 0..field.cells().positions() {
        let shards: Vec<Shard> = field
            .blocks()
            .all_tiles()
            .map(|tile| field.shard(position, tile, true))
            .collect::<Result<_, FieldError>>()?;
        for first in (0..squares).step_by(at_once) {
            let pictures: Vec<Picture> = (first..(first + at_once).min(squares))
                .into_par_iter()
                .map_init(
                    || Room::new(field),
                    |room, square| {
                        let room = room.as_mut().map_err(|source| FieldError::Read {
                            path: field.path().to_path_buf(),
                            source: std::io::Error::new(source.kind(), source.to_string()),
                        })?;
                        room.read(field, &shards, square)?;
                        Ok(room.picture(field.scale(position), floor))
                    },
                )
                .collect::<Result<_, FieldError>>()?;
            listeners.par_iter_mut().for_each(|listener| listener.hear(position * squares + first, &pictures));
        }
        listeners.par_iter_mut().for_each(Listener::position_done);
    }
    Ok(())
}

/// The room of a thread that reads.
struct Room {
    buffer: BlockBuffer,
    /// One whole basis image, `[channel][pixel]`.
    halves: Vec<f16>,
    floats: Vec<f32>,
}

impl Room {
    fn new(field: &ReflectanceField) -> std::io::Result<Self> {
        let (width, height) = field.picture_size();
        let samples = 3 * width * height;
        let buffer = BlockBuffer::new(&field.blocks())?;
        Ok(Self { buffer, halves: vec![f16::ZERO; samples], floats: vec![0.0; samples] })
    }

    /// Puts the blocks of a square together.
    fn read(&mut self, field: &ReflectanceField, shards: &[Shard], square: usize) -> Result<(), FieldError> {
        let (width, height) = field.picture_size();
        let blocks = field.blocks();
        let ([block_height, block_width], [down, across]) = (blocks.block(), blocks.blocks_per_tile());
        self.halves.fill(f16::ZERO);
        for (tile, shard) in blocks.all_tiles().zip(shards) {
            let extent = blocks.tile_extent(tile);
            for block in (0..down).flat_map(|j| (0..across).map(move |i| [j, i])) {
                let inner = blocks.block_in_tile(&extent, block);
                if inner.pixels() == 0 || !shard.block(square, block, &mut self.buffer)? {
                    continue;
                }
                let left = extent.columns.start + inner.columns.start;
                for channel in 0..3 {
                    for (row, y) in inner.rows.clone().enumerate() {
                        let from = (channel * block_height + row) * block_width;
                        let to = (channel * height + extent.rows.start + y) * width + left;
                        self.halves[to..][..inner.columns.len()]
                            .copy_from_slice(&self.buffer.values()[from..][..inner.columns.len()]);
                    }
                }
            }
        }
        Ok(())
    }

    fn picture(&mut self, scale: f32, floor: f32) -> Picture {
        self.halves.convert_to_f32_slice(&mut self.floats);
        let pixels = self.floats.len() / 3;
        let (red, rest) = self.floats.split_at(pixels);
        let (green, blue) = rest.split_at(pixels);
        let mut picture = Picture::default();
        for (pixel, ((red, green), blue)) in red.iter().zip(green).zip(blue).enumerate() {
            let largest = red.max(*green).max(*blue) * scale;
            if largest > 0.0 && largest >= floor {
                picture.pixels.push(pixel as u32);
                picture.values.push([red * scale, green * scale, blue * scale]);
                picture.peak = picture.peak.max(largest);
            }
        }
        picture
    }
}

/// A picture that grows: `[channel][pixel]`.
struct Sum {
    channels: [Vec<f64>; 3],
}

impl Sum {
    fn new(pixels: usize) -> Self {
        Self { channels: std::array::from_fn(|_| vec![0.0; pixels]) }
    }

    fn add(&mut self, weights: [f32; 3], picture: &Picture) {
        for (channel, sum) in self.channels.iter_mut().enumerate() {
            let weight = f64::from(weights[channel]);
            if weight != 0.0 {
                for (pixel, value) in picture.pixels.iter().zip(&picture.values) {
                    sum[*pixel as usize] += weight * f64::from(value[channel]);
                }
            }
        }
    }

    fn add_coded(&mut self, weights: [f32; 3], coded: &Coded) {
        for (channel, sum) in self.channels.iter_mut().enumerate() {
            let weight = f64::from(weights[channel]);
            if weight != 0.0 {
                for (pixel, value) in &coded.shown[channel] {
                    sum[*pixel as usize] += weight * f64::from(*value);
                }
            }
        }
    }

    fn squared_norm(&self) -> f64 {
        self.channels.iter().flatten().map(|sample| sample * sample).sum()
    }

    fn squared_distance(&self, other: &Self) -> f64 {
        let samples = self.channels.iter().flatten().zip(other.channels.iter().flatten());
        samples.map(|(a, b)| (a - b).powi(2)).sum()
    }
}

/// What the field itself shows: its relit pictures, and how bright it is on the whole.
pub(crate) struct Truth {
    relit: Vec<Sum>,
    /// Root mean square, over positions, pixels and channels, of what unit light through a whole position shows.
    pub(crate) reference: f64,
}

enum TruthListener<'a> {
    Relit { light: &'a Coefficients, sum: Sum },
    WholePositions { sum: Sum, squares: f64 },
}

impl Listener for TruthListener<'_> {
    fn hear(&mut self, first: usize, pictures: &[Picture]) {
        for (cell, picture) in (first..).zip(pictures) {
            match self {
                Self::Relit { light, sum } => sum.add(light.values()[cell], picture),
                Self::WholePositions { sum, .. } => sum.add([1.0; 3], picture),
            }
        }
    }

    fn position_done(&mut self) {
        if let Self::WholePositions { sum, squares } = self {
            *squares += sum.squared_norm();
            sum.channels.iter_mut().for_each(|channel| channel.fill(0.0));
        }
    }
}

impl Truth {
    /// One pass over the field.
    ///
    /// # Errors
    /// If the field cannot be read or is damaged.
    pub(crate) fn of(field: &ReflectanceField, lights: &[Coefficients]) -> Result<Self, FieldError> {
        let (width, height) = field.picture_size();
        let pixels = width * height;
        let mut listeners: Vec<TruthListener<'_>> =
            lights.iter().map(|light| TruthListener::Relit { light, sum: Sum::new(pixels) }).collect();
        listeners.push(TruthListener::WholePositions { sum: Sum::new(pixels), squares: 0.0 });
        pass(field, 0.0, &mut listeners)?;
        let mut truth = Self { relit: Vec::new(), reference: 0.0 };
        for listener in listeners {
            match listener {
                TruthListener::Relit { sum, .. } => truth.relit.push(sum),
                TruthListener::WholePositions { squares, .. } => {
                    truth.reference = (squares / (3 * pixels * field.cells().positions()) as f64).sqrt();
                }
            }
        }
        Ok(truth)
    }
}

/// The size and the errors of a field that is coded in one way.
#[derive(Clone)]
pub(crate) struct Measured {
    pub(crate) coding: Coding,
    /// Relative to [`Truth::reference`].
    pub(crate) threshold: f64,
    pub(crate) rle_bytes: u64,
    /// One Huffman table for the whole field, its bits filled up to bytes at every position.
    pub(crate) huffman_field_bytes: u64,
    /// One Huffman table a position.
    pub(crate) huffman_position_bytes: u64,
    /// Basis images with any light left.
    pub(crate) lit_pictures: u64,
    /// Samples other than zero, of all channels.
    pub(crate) lit_samples: u64,
    /// Relative L2 error of each relit picture; `None` for a light that shows nothing.
    pub(crate) errors: Vec<Option<f64>>,
    histogram: Histogram,
}

impl Measured {
    pub(crate) fn huffman_bytes(&self) -> u64 {
        self.huffman_field_bytes.min(self.huffman_position_bytes)
    }

    pub(crate) fn is_within(&self, error: f64) -> bool {
        self.errors.iter().flatten().all(|found| *found <= error)
    }

    /// The light with the largest error.
    pub(crate) fn worst_light(&self) -> Option<usize> {
        let errors = self.errors.iter().enumerate().filter_map(|(light, error)| Some((light, (*error)?)));
        errors.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(light, _)| light)
    }
}

struct Candidate<'a> {
    measured: Measured,
    threshold: f32,
    pixels: usize,
    lights: &'a [Coefficients],
    relit: Vec<Sum>,
    /// Of the position under way.
    histogram: Histogram,
    /// Of the positions before it.
    histograms: Vec<Histogram>,
    coded: Coded,
    run_length: RunLength,
    code: Vec<u8>,
}

impl Listener for Candidate<'_> {
    fn hear(&mut self, first: usize, pictures: &[Picture]) {
        let coding = self.measured.coding;
        for (cell, picture) in (first..).zip(pictures) {
            self.coded.make(coding, self.threshold, picture, self.pixels);
            self.code.clear();
            self.run_length.encode(&self.coded.bytes, coding.planes() * self.pixels, &mut self.code);
            count(&self.code, &mut self.histogram);
            if !self.coded.bytes.is_empty() {
                self.measured.lit_pictures += 1;
            }
            self.measured.lit_samples += self.coded.shown.iter().map(|shown| shown.len() as u64).sum::<u64>();
            for (light, relit) in self.lights.iter().zip(&mut self.relit) {
                relit.add_coded(light.values()[cell], &self.coded);
            }
        }
    }

    fn position_done(&mut self) {
        self.histograms.push(std::mem::replace(&mut self.histogram, [0; 256]));
    }
}

impl Candidate<'_> {
    fn finish(self, truth: &Truth) -> Measured {
        let mut measured = self.measured;
        for histogram in &self.histograms {
            measured.histogram.iter_mut().zip(histogram).for_each(|(sum, count)| *sum += count);
        }
        let beside = measured.lit_pictures * measured.coding.bytes_beside();
        measured.rle_bytes = beside + measured.histogram.iter().sum::<u64>();
        let field_code = Code::for_histogram(&measured.histogram);
        let bytes = |code: &Code, histogram: &Histogram| code.bits(histogram).div_ceil(8);
        measured.huffman_field_bytes =
            beside + TABLE_BYTES + self.histograms.iter().map(|histogram| bytes(&field_code, histogram)).sum::<u64>();
        let own = |histogram: &Histogram| TABLE_BYTES + bytes(&Code::for_histogram(histogram), histogram);
        measured.huffman_position_bytes = beside + self.histograms.iter().map(own).sum::<u64>();
        measured.errors = truth
            .relit
            .iter()
            .zip(&self.relit)
            .map(|(truth, relit)| {
                let norm = truth.squared_norm();
                (norm > 0.0).then(|| (relit.squared_distance(truth) / norm).sqrt())
            })
            .collect();
        measured
    }
}

/// Bytes that the pictures of all candidates of a pass may take.
const SUMS_AT_ONCE: usize = 2 << 30;

/// Measures each coding at its threshold, relative to the field's own brightness: one pass for as many as fit into memory.
///
/// # Errors
/// If the field cannot be read or is damaged.
pub(crate) fn measure(
    field: &ReflectanceField,
    lights: &[Coefficients],
    truth: &Truth,
    asked: &[(Coding, f64)],
) -> Result<Vec<Measured>, FieldError> {
    let (width, height) = field.picture_size();
    let pixels = width * height;
    let sums = lights.len().max(1) * 3 * pixels * size_of::<f64>();
    let mut all = Vec::new();
    for asked in asked.chunks((SUMS_AT_ONCE / sums).max(1)) {
        let mut candidates: Vec<Candidate<'_>> = asked
            .iter()
            .map(|(coding, threshold)| Candidate {
                measured: Measured {
                    coding: *coding,
                    threshold: *threshold,
                    rle_bytes: 0,
                    huffman_field_bytes: 0,
                    huffman_position_bytes: 0,
                    lit_pictures: 0,
                    lit_samples: 0,
                    errors: Vec::new(),
                    histogram: [0; 256],
                },
                threshold: absolute(*threshold, truth),
                pixels,
                lights,
                relit: lights.iter().map(|_| Sum::new(pixels)).collect(),
                histogram: [0; 256],
                histograms: Vec::new(),
                coded: Coded::default(),
                run_length: RunLength::default(),
                code: Vec::new(),
            })
            .collect();
        let floor = candidates.iter().map(|candidate| candidate.threshold).fold(f32::INFINITY, f32::min);
        pass(field, floor, &mut candidates)?;
        all.extend(candidates.into_iter().map(|candidate| candidate.finish(truth)));
    }
    Ok(all)
}

/// A threshold as a transfer.
fn absolute(threshold: f64, truth: &Truth) -> f32 {
    ((threshold * truth.reference) as f32).max(f32::MIN_POSITIVE)
}

/// Writes a position for real, reads it back and compares.
struct Check {
    coding: Coding,
    threshold: f32,
    pixels: usize,
    /// The field's code; without one, each position has its own.
    code: Option<Code>,
    runs: Vec<u8>,
    pictures: Vec<Vec<(usize, u8)>>,
    bytes: u64,
    differs: bool,
}

impl Listener for Check {
    fn hear(&mut self, _: usize, pictures: &[Picture]) {
        let (mut coded, mut run_length) = (Coded::default(), RunLength::default());
        for picture in pictures {
            coded.make(self.coding, self.threshold, picture, self.pixels);
            run_length.encode(&coded.bytes, self.coding.planes() * self.pixels, &mut self.runs);
            if !coded.bytes.is_empty() {
                self.bytes += self.coding.bytes_beside();
            }
            self.pictures.push(std::mem::take(&mut coded.bytes));
        }
    }

    fn position_done(&mut self) {
        let code = self.code.unwrap_or_else(|| {
            let mut histogram = [0; 256];
            count(&self.runs, &mut histogram);
            self.bytes += TABLE_BYTES;
            Code::for_histogram(&histogram)
        });
        let bits = code.encode(&self.runs);
        self.bytes += bits.len() as u64;
        self.differs |= !self.comes_back(&code, &bits);
        self.runs.clear();
        self.pictures.clear();
    }
}

impl Check {
    fn comes_back(&self, code: &Code, bits: &[u8]) -> bool {
        let Some(runs) = code.decode(bits, self.runs.len()) else { return false };
        let mut rest = runs.as_slice();
        for picture in &self.pictures {
            let Some((planes, after)) = decode(rest, self.coding.planes() * self.pixels) else { return false };
            if !planes.into_iter().enumerate().filter(|(_, byte)| *byte != 0).eq(picture.iter().copied()) {
                return false;
            }
            rest = after;
        }
        rest.is_empty()
    }
}

/// Whether a field coded in this way has really as many bytes as were counted, and comes back from them.
///
/// # Errors
/// If the field cannot be read or is damaged.
pub(crate) fn check(field: &ReflectanceField, truth: &Truth, measured: &Measured) -> Result<bool, FieldError> {
    let (width, height) = field.picture_size();
    let code = (measured.huffman_field_bytes <= measured.huffman_position_bytes)
        .then(|| Code::for_histogram(&measured.histogram));
    let mut check = [Check {
        coding: measured.coding,
        threshold: absolute(measured.threshold, truth),
        pixels: width * height,
        bytes: if code.is_some() { TABLE_BYTES } else { 0 },
        code,
        runs: Vec::new(),
        pictures: Vec::new(),
        differs: false,
    }];
    pass(field, check[0].threshold, &mut check)?;
    Ok(!check[0].differs && check[0].bytes == measured.huffman_bytes())
}
