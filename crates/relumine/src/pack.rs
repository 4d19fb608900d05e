//! A field encoded anew: packed to an error, or as halves of every square.

use std::path::Path;

use half::f16;
use rayon::prelude::*;
use relumine_field::packed::{Keep, Kept, Patches, Sketch};
use relumine_field::{BlockBuffer, FieldError, FieldWriter, Packing, ReflectanceField};

use crate::Error;

/// How to encode a field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Encoding {
    /// Packed to an error ([`relumine_field::packed`]), a share such as 0.01.
    Packed(f64),
    /// Halves of every square, as `develop` measures them.
    Lossless,
}

impl Encoding {
    /// The range of errors that can be asked for.
    pub const ERRORS: std::ops::RangeInclusive<f64> = 1e-3..=0.2;

    pub(crate) fn packing(self) -> Option<Packing> {
        match self {
            Self::Packed(error) => Some(Packing { error }),
            Self::Lossless => None,
        }
    }
}

/// A field being encoded anew: an iterator, each step some blocks of pixels. Drop it to stop; start it again to go on.
pub struct Repacking {
    field: ReflectanceField,
    writer: FieldWriter,
    encoding: Encoding,
    steps: usize,
    /// Blocks of a packed field that are left, or tiles of positions of an unpacked one.
    left: Vec<Step>,
    together: usize,
}

#[derive(Clone, Copy)]
enum Step {
    Block([usize; 2]),
    Position(usize),
}

impl Repacking {
    /// Starts to encode the field at `from` anew as `to`, or goes on; `memory_bytes` bounds what is held of it at once.
    ///
    /// # Errors
    /// If `from` cannot be read or `to` not be written.
    pub fn start(
        from: &Path,
        to: &Path,
        encoding: Encoding,
        memory_bytes: usize,
        replace: bool,
    ) -> Result<Self, Error> {
        let field = ReflectanceField::open(from)?;
        let mut header = field.header().clone();
        header.packing = encoding.packing();
        let writer = FieldWriter::open(to, header, &format!("pack {}", field.digest()?), replace)?;
        let left: Vec<Step> = match encoding {
            Encoding::Packed(_) => writer.remaining_blocks().into_iter().map(Step::Block).collect(),
            Encoding::Lossless => writer.remaining().into_iter().map(Step::Position).collect(),
        };
        let steps = match encoding {
            Encoding::Packed(_) => writer.all_blocks().count(),
            Encoding::Lossless => field.cells().positions(),
        };
        let together = (memory_bytes / Self::bytes_a_step(&field, encoding)).clamp(1, rayon::current_num_threads());
        Ok(Self { field, writer, encoding, steps, left, together })
    }

    /// About the bytes that one step holds at once.
    fn bytes_a_step(field: &ReflectanceField, encoding: Encoding) -> usize {
        let [height, width] = field.blocks().block();
        let squares = field.cells().squares() * field.cells().squares() * 3 * height * width * 2;
        match encoding {
            Encoding::Packed(error) => {
                squares + field.cells().positions() * Sketch::most_bytes(height * width, &Keep::for_error(error))
            }
            Encoding::Lossless => squares * field.blocks().blocks_per_tile().iter().product::<usize>(),
        }
    }

    /// Number of blocks (packed) or positions (lossless) in all.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// Those that are done.
    pub fn done(&self) -> usize {
        self.steps - self.left.len()
    }

    /// Brings the field to its name.
    ///
    /// # Errors
    /// If something is left to do, or cannot be written.
    pub fn finish(self) -> Result<(), Error> {
        if let Encoding::Packed(_) = self.encoding {
            for record in self.field.records() {
                self.writer.finish_position(record.clone(), &self.field.clipped(record.position)?)?;
            }
        }
        Ok(self.writer.finish()?)
    }

    fn step(&self, step: Step) -> Result<(), Error> {
        let read = |source| FieldError::Read { path: self.field.path().to_path_buf(), source };
        let mut buffer = BlockBuffer::new(&self.field.blocks()).map_err(read)?;
        let mut values: Vec<f16> = Vec::new();
        match (step, self.encoding) {
            (Step::Block(block), Encoding::Packed(error)) => {
                let extent = self.field.blocks().block_extent(block);
                let patches = Patches::new(extent.rows.len(), extent.columns.len());
                let keep = Keep::for_error(error);
                let mut sketches = Vec::with_capacity(self.field.cells().positions());
                for position in 0..self.field.cells().positions() {
                    self.field.squares_of_block(position, block, &mut buffer, &mut values)?;
                    let (squares, scale) = (self.field.cells().squares(), self.field.scale(position));
                    sketches.push(Sketch::new(&patches, squares, &values, scale, &keep));
                }
                self.writer.write_packed(block, &sketches)?;
            }
            (Step::Position(position), _) => {
                for tile in self.field.blocks().all_tiles() {
                    let read = |extent: &relumine_field::Extent| {
                        let mut values = Vec::new();
                        let [height, width] = self.field.blocks().block();
                        let block = [extent.rows.start / height, extent.columns.start / width];
                        let done = BlockBuffer::new(&self.field.blocks()).map_err(read).and_then(|mut buffer| {
                            self.field.squares_of_block(position, block, &mut buffer, &mut values)
                        });
                        (values, done)
                    };
                    for done in self.writer.write_blocks(position, tile, read)? {
                        done?;
                    }
                }
                let record = self.field.records()[position].clone();
                self.writer.finish_position(record, &self.field.clipped(position)?)?;
            }
            (Step::Block(_), Encoding::Lossless) => unreachable!("blocks are steps of packed fields"),
        }
        Ok(())
    }
}

impl Iterator for Repacking {
    /// So many steps more are done.
    type Item = Result<usize, Error>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.left.is_empty() {
            return None;
        }
        let now: Vec<Step> = self.left.drain(..self.together.min(self.left.len())).collect();
        let done: Result<(), Error> = now.par_iter().map(|step| self.step(*step)).collect();
        Some(done.map(|()| now.len()))
    }
}

/// Where the light of a packed field went, all blocks together.
pub fn kept(field: &ReflectanceField) -> Kept {
    let mut all = Kept::default();
    field.block_records().iter().for_each(|block| all.add(&block.kept));
    all
}
