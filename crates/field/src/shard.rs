//! One shard: all squares of one tile of pixels at one position, in one file (Zarr codec `sharding_indexed`).
//!
//! The file holds the zstd frames of its blocks, then the index: offset and length of each block as little-endian `u64`s
//! in the order [v][u][block row][block column], all ones for a block that is not stored, then the CRC-32C of the index.

use std::fs::File;
use std::io::{self, Write};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use half::f16;
use half::slice::HalfFloatSliceExt;
use relumine_radiometry::files::write_atomically;

use crate::journal::Digest;
use crate::shard_index::{NOT_STORED, ShardIndex};
use crate::{Blocks, Extent, FieldError, zarr};

/// The zstd frame of each square of one block; `None` for a square without light there. `values` are
/// `[square][channel][row][column]` of the pixels in `extent`, which the block may overhang.
pub(crate) fn compress(blocks: &Blocks, extent: &Extent, values: &[f16]) -> io::Result<Frames> {
    let [height, width] = blocks.block();
    let mut raw = vec![0u8; 3 * height * width * 2];
    let mut compressor = zstd::bulk::Compressor::new(zarr::ZSTD_LEVEL)?;
    compressor.include_checksum(true)?;
    values
        .chunks_exact(3 * extent.pixels())
        .map(|square| {
            if square.iter().all(|value| value.to_bits() == 0) {
                return Ok(None);
            }
            pad(square, extent, [height, width], &mut raw);
            compressor.compress(&raw).map(Some)
        })
        .collect()
}

/// Copies the pixels of one square's block into `raw`, zeros where the block overhangs the picture.
fn pad(square: &[f16], extent: &Extent, [height, width]: [usize; 2], raw: &mut [u8]) {
    raw.fill(0);
    for (index, row) in square.chunks_exact(extent.columns.len()).enumerate() {
        let (channel, y) = (index / extent.rows.len(), index % extent.rows.len());
        let to = (channel * height + y) * width * 2;
        for (bits, bytes) in row.reinterpret_cast().iter().zip(raw[to..].as_chunks_mut::<2>().0) {
            *bytes = bits.to_le_bytes();
        }
    }
}

/// The compressed squares of a block; `None` for those without light.
pub(crate) type Frames = Vec<Option<Vec<u8>>>;

/// Writes a shard: the frames of all blocks, `[block][square]` with the blocks in row-major order, and their index. Frees each
/// frame that is written.
fn write(out: &mut impl Write, squares: usize, mut frames: Vec<Frames>) -> io::Result<()> {
    let mut index = Vec::with_capacity(squares * frames.len());
    let mut offset = 0u64;
    for square in 0..squares {
        for block in &mut frames {
            index.push(match block.get_mut(square).and_then(Option::take) {
                Some(frame) => {
                    out.write_all(&frame)?;
                    offset += frame.len() as u64;
                    [offset - frame.len() as u64, frame.len() as u64]
                }
                None => NOT_STORED,
            });
        }
    }
    out.write_all(&ShardIndex::to_bytes(&index))
}

/// Writes a shard to its file; gives the digest of what was written, which is not read for it again.
pub(crate) fn write_file(path: &Path, squares: usize, frames: Vec<Frames>) -> Result<Digest, FieldError> {
    let mut hasher = blake3::Hasher::new();
    write_atomically(path, |file| write(&mut Hashed { out: file, hasher: &mut hasher }, squares, frames))?;
    forget_pages(path);
    Ok(Digest(hasher.finalize()))
}

/// What takes the digest of what passes.
struct Hashed<'a, W> {
    out: W,
    hasher: &'a mut blake3::Hasher,
}

impl<W: Write> Write for Hashed<'_, W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.out.write(bytes)?;
        self.hasher.update(&bytes[..written]);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

/// Bytes from which a file is large.
const LARGE: u64 = 1 << 24;

/// Tells the system that a large file, which is on disk, will not be read soon: its pages serve what is written next, instead of
/// new ones for every byte of the field. It is advice, so failing it is no failure.
fn forget_pages(path: &Path) {
    #[cfg(target_os = "linux")]
    if let Ok(file) = File::open(path)
        && file.metadata().is_ok_and(|metadata| metadata.len() >= LARGE)
    {
        let _ = rustix::fs::fadvise(&file, 0, None, rustix::fs::Advice::DontNeed);
    }
    #[cfg(not(target_os = "linux"))]
    let _ = path;
}

/// A shard open for reading: its index is in memory, its blocks are read when they are asked for.
pub struct Shard {
    path: PathBuf,
    blocks: Blocks,
    squares: usize,
    file: File,
    /// All blocks' bytes, if read at once.
    body: Option<Vec<u8>>,
    index: Vec<[u64; 2]>,
}

impl Shard {
    /// Opens a shard file; `at_once` reads the whole file now, for callers who want most of its blocks.
    pub(crate) fn open(path: &Path, blocks: Blocks, squares: usize, at_once: bool) -> Result<Self, FieldError> {
        let read = |source| FieldError::Read { path: path.to_path_buf(), source };
        let damaged = |reason: String| FieldError::Damaged { path: path.to_path_buf(), reason };
        let file = File::open(path).map_err(read)?;
        let [down, across] = blocks.blocks_per_tile();
        let entries = squares * down * across;
        let ShardIndex { entries: index, body_bytes } = ShardIndex::read(&file, path, entries)?;
        // A block never grows by more than zstd's own bound: a longer file is not a shard of this field.
        let [block_height, block_width] = blocks.block();
        let longest = (entries * zstd::zstd_safe::compress_bound(3 * block_height * block_width * 2)) as u64;
        if body_bytes > longest {
            return Err(damaged(format!("{body_bytes} bytes are more than {entries} blocks can have")));
        }
        let body = if at_once {
            let mut body = vec![0; body_bytes as usize];
            file.read_exact_at(&mut body, 0).map_err(read)?;
            Some(body)
        } else {
            None
        };
        Ok(Self { path: path.to_path_buf(), blocks, squares, file, body, index })
    }

    /// Reads one block of one square into `values`, `[channel][row][column]` of the padded block; `false` (and `values`
    /// untouched) if the block has no light.
    ///
    /// # Errors
    /// If the block cannot be read or its checksum is wrong.
    ///
    /// # Panics
    /// If there is no such square or block.
    pub fn block(&self, square: usize, block: [usize; 2], buffer: &mut BlockBuffer) -> Result<bool, FieldError> {
        let [down, across] = self.blocks.blocks_per_tile();
        assert!(square < self.squares && block[0] < down && block[1] < across, "no such block");
        let [offset, length] = self.index[(square * down + block[0]) * across + block[1]];
        if [offset, length] == NOT_STORED {
            return Ok(false);
        }
        let frame = match &self.body {
            Some(body) => &body[offset as usize..][..length as usize],
            None => {
                buffer.frame.resize(length as usize, 0);
                self.file
                    .read_exact_at(&mut buffer.frame, offset)
                    .map_err(|source| FieldError::Read { path: self.path.clone(), source })?;
                &buffer.frame
            }
        };
        let damaged = |reason: String| FieldError::Damaged { path: self.path.clone(), reason };
        let where_ = || format!("square ({}, {}), block {block:?}", square % self.side(), square / self.side());
        let bytes = bytes_of(&mut buffer.values);
        let written = buffer
            .decompressor
            .decompress_to_buffer(frame, bytes)
            .map_err(|error| damaged(format!("{}: {error}", where_())))?;
        if written != bytes.len() {
            return Err(damaged(format!("{}: {written} bytes instead of {}", where_(), bytes.len())));
        }
        if cfg!(target_endian = "big") {
            buffer.values.iter_mut().for_each(|value| *value = f16::from_bits(u16::from_le(value.to_bits())));
        }
        Ok(true)
    }

    fn side(&self) -> usize {
        self.squares.isqrt()
    }
}

/// The room that reading a block needs; one a thread.
pub struct BlockBuffer {
    values: Vec<f16>,
    frame: Vec<u8>,
    decompressor: zstd::bulk::Decompressor<'static>,
}

impl BlockBuffer {
    /// Room for the blocks of `blocks`.
    ///
    /// # Errors
    /// If zstd has no memory.
    pub fn new(blocks: &Blocks) -> io::Result<Self> {
        let [height, width] = blocks.block();
        Ok(Self {
            values: vec![f16::ZERO; 3 * height * width],
            frame: Vec::new(),
            decompressor: zstd::bulk::Decompressor::new()?,
        })
    }

    /// The block last read, `[channel][row][column]`.
    pub fn values(&self) -> &[f16] {
        &self.values
    }
}

/// The memory of halves as bytes, to decompress into.
#[allow(unsafe_code)]
fn bytes_of(values: &mut [f16]) -> &mut [u8] {
    // SAFETY: f16 is a transparent u16: every byte pattern is a value, and it has no padding.
    unsafe { std::slice::from_raw_parts_mut(values.as_mut_ptr().cast(), std::mem::size_of_val(values)) }
}
