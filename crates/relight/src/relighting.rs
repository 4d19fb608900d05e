//! The fast version: blocks of pixels, all cores, several lights in one pass.

use half::f16;
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use relumine_basis::Coefficients;
use relumine_field::{BlockBuffer, FieldError, ReflectanceField};
use relumine_radiometry::{Image, Radiance};

use crate::packed::{LightWeights, PackedError, relight_block};
use crate::{TransferSource, kernel};

/// Squares that are added in one pass over the sum: it is read and written once for all of them.
const TOGETHER: usize = 8;

/// Blocks of a packed field in one step.
const BLOCKS_AT_ONCE: usize = 256;

/// Threads for each core that read blocks of a packed field: while some wait for the disk, others work.
const READERS_A_CORE: usize = 4;

/// Why a field cannot be relit.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RelightError {
    /// The field cannot be read.
    #[error(transparent)]
    Field(#[from] FieldError),
    /// A packed field cannot be relit.
    #[error(transparent)]
    Packed(#[from] PackedError),
    /// A light for other cells.
    #[error("the light has {found} coefficients, but the field has {expected} cells")]
    OtherCells {
        /// Cells of the field.
        expected: usize,
        /// Coefficients of the light.
        found: usize,
    },
}

/// Relights a field under several lights at once, tile of pixels by tile: an iterator, so that the caller shows progress
/// and stops by dropping it. [`Relighting::pictures`] are whole when it has ended.
pub struct Relighting<'a, S: TransferSource> {
    source: &'a S,
    lights: &'a [Coefficients],
    /// Positions that some light shines from, in groups whose sums are added in order: the groups depend on the light
    /// alone, so the result does not depend on the number of threads.
    groups: Vec<Vec<usize>>,
    /// By light, if the field is packed.
    weights: Vec<LightWeights>,
    /// For packed fields; without them, if they cannot be had, the threads that there are.
    readers: Option<ThreadPool>,
    steps: Vec<Step>,
    next: usize,
    pictures: Vec<Image<Radiance>>,
}

/// What is relit at once.
#[derive(Clone, Debug)]
enum Step {
    /// A tile of halves.
    Tile([usize; 2]),
    /// Some blocks of a packed field, of the whole picture.
    Blocks(Vec<[usize; 2]>),
}

impl<'a, S: TransferSource> Relighting<'a, S> {
    /// Prepares to relight; reads nothing yet.
    ///
    /// # Errors
    /// If a light is for other cells.
    pub fn new(source: &'a S, lights: &'a [Coefficients]) -> Result<Self, RelightError> {
        let field = source.field();
        let expected = field.cells().len();
        for light in lights {
            let found = light.values().len();
            if found != expected || light.squares() != field.cells().squares() {
                return Err(RelightError::OtherCells { expected, found });
            }
        }
        let lit: Vec<usize> = (0..field.cells().positions())
            .filter(|position| lights.iter().any(|light| !light.is_position_dark(*position)))
            .collect();
        // Groups enough for many cores, long enough that few partial sums are added up.
        let longest = lit.len().div_ceil(32).max(1);
        let (width, height) = field.picture_size();
        let (mut weights, mut steps) = (Vec::new(), Vec::new());
        let mut readers = None;
        if field.is_packed() {
            let threads = READERS_A_CORE * rayon::current_num_threads();
            readers = ThreadPoolBuilder::new().num_threads(threads).build().ok();
            let (squares, positions) = (field.cells().squares(), field.cells().positions());
            weights =
                lights.iter().map(|light| LightWeights::new(light, squares, positions)).collect::<Result<_, _>>()?;
            let [down, across] = field.blocks().grid();
            let blocks: Vec<[usize; 2]> =
                (0..down).flat_map(|row| (0..across).map(move |column| [row, column])).collect();
            steps.extend(blocks.chunks(BLOCKS_AT_ONCE).map(|some| Step::Blocks(some.to_vec())));
        } else {
            steps.extend(field.blocks().all_tiles().map(Step::Tile));
        }
        Ok(Self {
            source,
            lights,
            groups: lit.chunks(longest).map(<[usize]>::to_vec).collect(),
            weights,
            readers,
            steps,
            next: 0,
            pictures: lights.iter().map(|_| Image::black(width, height)).collect(),
        })
    }

    /// Number of steps in all.
    pub fn steps(&self) -> usize {
        self.steps.len()
    }

    /// The relit pictures, one a light, in their order; black where not reached yet.
    pub fn pictures(self) -> Vec<Image<Radiance>> {
        self.pictures
    }

    /// Runs to the end.
    ///
    /// # Errors
    /// If the field cannot be read.
    pub fn run(mut self) -> Result<Vec<Image<Radiance>>, RelightError> {
        self.by_ref().collect::<Result<(), RelightError>>()?;
        Ok(self.pictures)
    }

    /// Reads and relights some blocks of a packed field.
    fn relight_packed(&mut self, blocks: &[[usize; 2]]) -> Result<(), RelightError> {
        let field = self.source.field();
        let lit: Vec<usize> = self.groups.iter().flatten().copied().collect();
        let weights = &self.weights;
        let relight = |block: &[usize; 2]| {
            let block = field.packed_block(*block, |position| lit.binary_search(&position).is_ok())?;
            let pictures = relight_block(&block, weights)?;
            Ok((block.extent, pictures))
        };
        let relight_all = || blocks.par_iter().map(relight).collect::<Result<Vec<_>, RelightError>>();
        let relit = match &self.readers {
            Some(readers) => readers.install(relight_all),
            None => relight_all(),
        };
        for (extent, of_block) in relit? {
            for (picture, block) in self.pictures.iter_mut().zip(of_block) {
                let width = picture.width();
                for (y, row) in extent.rows.clone().zip(block.pixels().chunks_exact(extent.columns.len())) {
                    picture.pixels_mut()[y * width..][extent.columns.clone()].copy_from_slice(row);
                }
            }
        }
        Ok(())
    }

    fn relight_tile(&mut self, tile: [usize; 2]) -> Result<(), RelightError> {
        let partial_sums: Vec<Vec<f32>> =
            self.groups.par_iter().map(|group| self.sum_of_group(group, tile)).collect::<Result<_, RelightError>>()?;
        let field = self.source.field();
        let blocks = field.blocks();
        let (width, _) = field.picture_size();
        let extent = blocks.tile_extent(tile);
        let [block_height, block_width] = blocks.block();
        let [down, across] = blocks.blocks_per_tile();
        let pixels_a_block = block_height * block_width;
        for (light, picture) in self.pictures.iter_mut().enumerate() {
            for (index, block) in (0..down).flat_map(|j| (0..across).map(move |i| [j, i])).enumerate() {
                let inner = blocks.block_in_tile(&extent, block);
                let start = (light * down * across + index) * 3 * pixels_a_block;
                for (row, y) in inner.rows.clone().enumerate() {
                    for (column, x) in inner.columns.clone().enumerate() {
                        let sample = |channel: usize| {
                            let at = start + channel * pixels_a_block + row * block_width + column;
                            partial_sums.iter().map(|sum| f64::from(sum[at])).sum::<f64>() as f32
                        };
                        let pixel = (extent.rows.start + y) * width + extent.columns.start + x;
                        picture.pixels_mut()[pixel] = [sample(0), sample(1), sample(2)];
                    }
                }
            }
        }
        Ok(())
    }

    /// Σ lᵢ Rᵢ over the cells of some positions, `[light][block][channel][row][column]`.
    fn sum_of_group(&self, group: &[usize], tile: [usize; 2]) -> Result<Vec<f32>, RelightError> {
        let field = self.source.field();
        let blocks = field.blocks();
        let [down, across] = blocks.blocks_per_tile();
        let m2 = field.cells().squares() * field.cells().squares();
        let new_buffer = |_| BlockBuffer::new(&blocks);
        let mut buffers: Vec<BlockBuffer> = (0..TOGETHER)
            .map(new_buffer)
            .collect::<Result<_, _>>()
            .map_err(|source| FieldError::Read { path: field.path().to_path_buf(), source })?;
        let values_a_block = buffers[0].values().len();
        let mut sums = vec![0.0f32; self.lights.len() * down * across * values_a_block];
        for &position in group {
            let first_cell = position * m2;
            let lit: Vec<usize> = (0..m2)
                .filter(|square| self.lights.iter().any(|light| light.values()[first_cell + square] != [0.0; 3]))
                .collect();
            let source = self.source.tile(position, tile, lit.len())?;
            let scale = field.scale(position);
            for (index, block) in (0..down).flat_map(|j| (0..across).map(move |i| [j, i])).enumerate() {
                for squares in lit.chunks(TOGETHER) {
                    let mut terms: Vec<(usize, &[f16])> = Vec::with_capacity(TOGETHER);
                    for (square, buffer) in squares.iter().zip(&mut buffers) {
                        if let Some(halves) = S::block(&source, *square, block, buffer)? {
                            terms.push((first_cell + square, halves));
                        }
                    }
                    for (light, coefficients) in self.lights.iter().enumerate() {
                        let start = (light * down * across + index) * values_a_block;
                        add_block(&mut sums[start..start + values_a_block], &terms, coefficients, scale);
                    }
                }
            }
        }
        Ok(sums)
    }
}

/// Adds lᵢ Rᵢ of some cells to one block, `[channel][row][column]`.
fn add_block(sum: &mut [f32], terms: &[(usize, &[f16])], light: &Coefficients, scale: f32) {
    let plane = sum.len() / 3;
    for (channel, sum) in sum.chunks_exact_mut(plane).enumerate() {
        let mut weighted: [(f32, &[f16]); TOGETHER] = [(0.0, &[]); TOGETHER];
        let mut count = 0;
        for (cell, halves) in terms {
            let weight = light.values()[*cell][channel] * scale;
            if weight != 0.0 {
                weighted[count] = (weight, &halves[channel * plane..(channel + 1) * plane]);
                count += 1;
            }
        }
        kernel::add_weighted(sum, &weighted[..count]);
    }
}

impl<S: TransferSource> Iterator for Relighting<'_, S> {
    /// A tile or some blocks are relit, or the field could not be read.
    type Item = Result<(), RelightError>;

    fn next(&mut self) -> Option<Self::Item> {
        let step = self.steps.get(self.next)?.clone();
        self.next += 1;
        Some(match step {
            Step::Tile(tile) => self.relight_tile(tile),
            Step::Blocks(blocks) => self.relight_packed(&blocks),
        })
    }
}

/// The share of a light's flux that falls on cells the field lacks: what a relit picture does not show.
pub fn missing_share(field: &ReflectanceField, light: &Coefficients) -> f64 {
    let (mut missing, mut all) = (0.0, 0.0);
    for (cell, value) in light.values().iter().enumerate() {
        let flux = value.iter().map(|component| f64::from(*component)).sum::<f64>() * field.cells().measure(cell);
        all += flux;
        if field.is_missing(cell) {
            missing += flux;
        }
    }
    if all > 0.0 { missing / all } else { 0.0 }
}
