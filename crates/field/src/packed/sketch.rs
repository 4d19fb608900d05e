//! What packing keeps of one position of one block until all positions are known.

use std::ops::Range;

use half::f16;
use half::slice::HalfFloatSliceExt;

use crate::packed::{Groups, Patches};

/// Values of a group's remainder: 2 × 2 quarters of a patch, three channels.
pub(crate) const QUARTERS: usize = 4;

/// One position of one block: for every patch the sum of all squares, the strongest squares by themselves, and the rest as
/// means of quarters of patches for every group of squares. A few percent of the bytes of the squares.
#[derive(Clone, Debug, PartialEq)]
pub struct Sketch {
    pub(crate) patches: Vec<PatchSketch>,
}

/// One patch of a [`Sketch`]. Vectors are `[channel][row][column]`.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct PatchSketch {
    /// The sum over all squares; empty if nothing is seen.
    pub(crate) whole: Vec<f32>,
    /// The square that shows most: not kept by itself.
    pub(crate) main: u16,
    /// Strong squares, by number.
    pub(crate) squares: Vec<(u16, Vec<f16>)>,
    /// The sum of all other squares of each group, `[group][channel][quarter]`.
    pub(crate) rest: Vec<f32>,
    /// What the halves of `squares` are multiplied with.
    pub(crate) scale: f32,
}

/// Which squares a sketch keeps by themselves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Keep {
    /// Those that show more than this share of the whole, as norms over a patch.
    pub share: f32,
    /// At most so many besides the main square, the strongest first.
    pub most: usize,
}

impl Keep {
    /// What packing to `error` asks of a sketch.
    pub fn for_error(error: f64) -> Self {
        // The smaller the error, the more squares are needed by themselves.
        let most = (0.32 / error).clamp(32.0, 1024.0) as usize;
        Self { share: (super::encode::SQUARE_SHARE * error) as f32, most }
    }
}

/// Which quarter of a patch of `height` × `width` a pixel lies in.
pub(crate) fn quarter(row: usize, height: usize, column: usize, width: usize) -> usize {
    2 * usize::from(2 * row >= height) + usize::from(2 * column >= width)
}

impl Sketch {
    /// Of a position that shows nothing.
    pub fn black(patches: &Patches) -> Self {
        Self { patches: vec![PatchSketch::default(); patches.len()] }
    }

    /// About the most bytes of a sketch of a block of so many pixels.
    pub fn most_bytes(pixels: usize, keep: &Keep) -> usize {
        // Every patch full of strong squares is not to be expected: a third of the most.
        pixels * 3 * (4 + 2 * keep.most / 3) + pixels / 64 * 16 * 3 * QUARTERS * 4
    }

    /// Of `values` × `scale`, `[square][channel][row][column]` of the block that `patches` cuts, for M = `squares`.
    ///
    /// # Panics
    /// If there are more or fewer values.
    pub fn new(patches: &Patches, squares: usize, values: &[f16], scale: f32, keep: &Keep) -> Self {
        let [height, width] = patches.block();
        let [down, across] = patches.counts();
        let plane = height * width;
        assert_eq!(values.len(), squares * squares * 3 * plane, "a block needs every pixel of every square");
        let groups = Groups::new(squares);
        let row_of: Vec<usize> = runs((0..down).map(|j| patches.pixels(j * across).0.len()));
        // The columns that lie in one quarter: patch by patch its left and its right half.
        let halves_of: Vec<Range<usize>> = (0..across)
            .flat_map(|i| {
                let columns = patches.pixels(i).1;
                let middle = columns.start + columns.len().div_ceil(2);
                [columns.start..middle, middle..columns.end]
            })
            .collect();
        let mut whole = vec![0.0f32; 3 * plane];
        let mut norms = vec![0.0f32; squares * squares * patches.len()];
        // `[square][patch][channel][quarter]`
        let mut sums = vec![0.0f32; squares * squares * patches.len() * 3 * QUARTERS];
        let mut line = vec![0.0f32; width];
        for (square, of_square) in values.chunks_exact(3 * plane).enumerate() {
            if of_square.iter().all(|value| value.to_bits() == 0) {
                continue;
            }
            let norms = &mut norms[square * patches.len()..][..patches.len()];
            let sums = &mut sums[square * patches.len() * 3 * QUARTERS..][..patches.len() * 3 * QUARTERS];
            for (index, halves) in of_square.chunks_exact(width).enumerate() {
                halves.convert_to_f32_slice(&mut line);
                whole[index * width..][..width].iter_mut().zip(&line).for_each(|(sum, value)| *sum += value);
                let (channel, y) = (index / height, index % height);
                let rows = patches.pixels(row_of[y] * across).0;
                let lower = quarter(y - rows.start, rows.len(), 0, 1) / 2;
                for (half, columns) in halves_of.iter().enumerate() {
                    let patch = row_of[y] * across + half / 2;
                    let (mut sum, mut norm) = (0.0, 0.0);
                    for value in &line[columns.clone()] {
                        sum += value;
                        norm += value * value;
                    }
                    norms[patch] += norm;
                    sums[(patch * 3 + channel) * QUARTERS + 2 * lower + half % 2] += sum;
                }
            }
        }
        let all = 0..squares * squares;
        let patches = (0..patches.len())
            .map(|patch| {
                let (rows, columns) = patches.pixels(patch);
                let norm = |square: usize| norms[square * patches.len() + patch];
                let gather = |from: &dyn Fn(usize) -> f32| -> Vec<f32> {
                    let pixels = (0..3 * height).filter(|index| rows.contains(&(index % height)));
                    pixels.flat_map(|index| columns.clone().map(move |x| index * width + x)).map(from).collect()
                };
                let whole = gather(&|at| whole[at] * scale);
                let strength: f32 = whole.iter().map(|value| value * value).sum();
                if strength == 0.0 {
                    return PatchSketch::default();
                }
                let mut order: Vec<usize> = all.clone().filter(|square| norm(*square) > 0.0).collect();
                order.sort_by(|a, b| norm(*b).total_cmp(&norm(*a)).then(a.cmp(b)));
                let least = keep.share * keep.share * strength / (scale * scale);
                let strong = order[1..].iter().take(keep.most).take_while(|square| norm(**square) > least).count();
                let mut kept: Vec<usize> = order[1..=strong].to_vec();
                kept.sort_unstable();
                let squares = kept
                    .into_iter()
                    .map(|square| {
                        let of_square = &values[square * 3 * plane..][..3 * plane];
                        let mut halves = Vec::with_capacity(3 * rows.len() * columns.len());
                        for plane in of_square.chunks_exact(plane) {
                            for row in plane.chunks_exact(width).take(rows.end).skip(rows.start) {
                                halves.extend_from_slice(&row[columns.clone()]);
                            }
                        }
                        (square as u16, halves)
                    })
                    .collect();
                let mut rest = vec![0.0f32; groups.len() * 3 * QUARTERS];
                for square in &order[1 + strong..] {
                    let rest = &mut rest[groups.of(*square) * 3 * QUARTERS..][..3 * QUARTERS];
                    let sums = &sums[(square * patches.len() + patch) * 3 * QUARTERS..][..3 * QUARTERS];
                    rest.iter_mut().zip(sums).for_each(|(rest, sum)| *rest += sum);
                }
                let sizes = quarter_sizes(rows.len(), columns.len());
                for (index, value) in rest.iter_mut().enumerate() {
                    *value *= scale / sizes[index % QUARTERS].max(1) as f32;
                }
                PatchSketch { whole, main: order[0] as u16, squares, rest, scale }
            })
            .collect();
        Self { patches }
    }
}

/// Pixels in each quarter of a patch.
pub(crate) fn quarter_sizes(height: usize, width: usize) -> [usize; QUARTERS] {
    let mut sizes = [0; QUARTERS];
    for row in 0..height {
        (0..width).for_each(|column| sizes[quarter(row, height, column, width)] += 1);
    }
    sizes
}

fn runs(lengths: impl Iterator<Item = usize>) -> Vec<usize> {
    lengths.enumerate().flat_map(|(index, length)| std::iter::repeat_n(index, length)).collect()
}
