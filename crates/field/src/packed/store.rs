//! The files of packed blocks: for each a Zarr array `packed/ROW-COLUMN`, one file of rows of bytes, each compressed by itself:
//! first the bases, eight components a row, then one row of steps, then the atoms of each position.
//!
//! Everything in one file, since from a cold disk opening a file costs as much as reading half a block.

use std::fs::{self, File};
use std::io::{self, Write};
#[cfg(target_os = "linux")]
use std::num::NonZero;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use relumine_radiometry::files::write_atomically;
use serde::{Deserialize, Serialize};
use serde_json::json;
use zstd::bulk::Decompressor;

use crate::packed::atoms::Writing;
use crate::packed::coder::OwnedAtom;
use crate::packed::encode::{PackedPatch, pack_patch};
use crate::packed::{Atom, Atoms, Ids, Kept, PackedBlock, Patches, Sketch};
use crate::shard_index::{NOT_STORED, ShardIndex};
use crate::{Extent, FieldError, zarr};

/// How packed blocks are compressed. They are nearly noise to a matcher: without short matches they come out smaller, and
/// decompress two to four times as fast. Level 17 saves 1 to 2 % more of noisy rows and 3 to 4 % of clean ones, for five times the work.
const ZSTD_LEVEL: i32 = 9;
const SHORTEST_MATCH: u32 = 7;

/// The most bytes of a row.
const MOST_BYTES: usize = 1 << 27;
/// Components of the bases in one row.
const COMPONENTS_A_ROW: usize = 8;

/// What is known of a packed block besides its arrays.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BlockRecord {
    /// Components of its longest basis; 0 if it shows nothing.
    pub rank: usize,
    /// Bytes of each of its rows, with padding.
    pub bytes: usize,
    /// Where its light went.
    pub kept: Kept,
}

impl BlockRecord {
    /// Whether a block can be so.
    pub(crate) fn is_possible(&self) -> bool {
        self.rank <= Atoms::MOST_COEFFICIENTS && self.bytes <= MOST_BYTES
    }

    /// Rows before those of the positions.
    fn rows_of_bases(&self) -> usize {
        self.rank.div_ceil(COMPONENTS_A_ROW) + 1
    }
}

/// Where a block lies in a field.
pub(crate) fn folder_of(field: &Path, [row, column]: [usize; 2]) -> PathBuf {
    field.join(format!("{}/{row}-{column}", zarr::PACKED))
}

/// Packs a block from the sketches of all positions.
pub(crate) fn pack(extent: &Extent, squares: usize, sketches: &[Sketch], error: f64) -> Packed {
    let patches = Patches::new(extent.rows.len(), extent.columns.len());
    let packed: Vec<PackedPatch> = (0..patches.len())
        .into_par_iter()
        .map(|patch| {
            let (rows, columns) = patches.pixels(patch);
            let sketches: Vec<_> = sketches.iter().map(|sketch| &sketch.patches[patch]).collect();
            pack_patch([rows.len(), columns.len()], squares, &sketches, error)
        })
        .collect();
    let rank = packed.iter().map(|patch| patch.vectors.len()).max().unwrap_or(0);
    let [height, width] = patches.block();
    let mut basis = vec![0i8; rank * 3 * height * width];
    let mut steps = vec![0.0f32; rank * patches.len()];
    let mut kept = Kept::default();
    for (index, patch) in packed.iter().enumerate() {
        let (rows, columns) = patches.pixels(index);
        kept.add(&patch.kept);
        for (component, (vector, step)) in patch.vectors.iter().zip(&patch.steps).enumerate() {
            steps[component * patches.len() + index] = *step;
            for (row, values) in vector.chunks_exact(columns.len()).enumerate() {
                let (channel, y) = (row / rows.len(), rows.start + row % rows.len());
                let to = ((component * 3 + channel) * height + y) * width;
                basis[to..][columns.clone()].copy_from_slice(values);
            }
        }
    }
    let positions = (0..sketches.len())
        .map(|position| {
            let mut writing = Writing::default();
            for patch in &packed {
                writing.begin_patch();
                for OwnedAtom { id, exponent, coefficients } in &patch.atoms[position] {
                    writing.push(Atom { id: *id, exponent: *exponent, coefficients });
                }
            }
            writing.finish()
        })
        .collect();
    Packed { patches, rank, basis, steps, positions, kept }
}

/// A packed block, to be written.
pub(crate) struct Packed {
    patches: Patches,
    rank: usize,
    basis: Vec<i8>,
    steps: Vec<f32>,
    /// The atoms of each position.
    positions: Vec<Vec<u8>>,
    kept: Kept,
}

impl Packed {
    /// Writes the block into `folder`: its record last, so that a block with a record is whole.
    pub(crate) fn write(self, folder: &Path) -> Result<BlockRecord, FieldError> {
        let write = |source| FieldError::Write { path: folder.to_path_buf(), source };
        if self.rank == 0 {
            let record = BlockRecord { rank: 0, bytes: 0, kept: self.kept };
            write_json(&folder.join("zarr.json"), &zarr::group(&json!({ "block": record })))?;
            return Ok(record);
        }
        let [height, width] = self.patches.block();
        let basis: Vec<u8> = self.basis.iter().map(|value| value.to_le_bytes()[0]).collect();
        let steps: Vec<u8> = self.steps.iter().flat_map(|step| step.to_le_bytes()).collect();
        let of_components = COMPONENTS_A_ROW * 3 * height * width;
        let mut rows: Vec<&[u8]> = basis.chunks(of_components).collect();
        rows.push(&steps);
        rows.extend(self.positions.iter().map(Vec::as_slice));
        // Rows of bases are whole even where the last components are not there.
        let bytes = rows.iter().map(|row| row.len()).max().unwrap_or(0).max(of_components);
        if bytes > MOST_BYTES {
            return Err(write(io::Error::other(format!("{bytes} bytes of atoms: pack with a larger error"))));
        }
        let record = BlockRecord { rank: self.rank, bytes, kept: self.kept };
        fs::create_dir_all(folder).map_err(write)?;
        write_file(&folder.join(zarr::ROWS), &shard(&rows, bytes).map_err(write)?)?;
        let unit = "bases, steps and atoms, as FORMAT.md describes";
        let attributes = json!({ "unit": unit, "block": record });
        write_json(&folder.join("zarr.json"), &zarr::rows_of_bytes([rows.len(), bytes], ["row", "byte"], &attributes))?;
        Ok(record)
    }
}

#[derive(Deserialize)]
struct Node {
    attributes: Attributes,
}

#[derive(Deserialize)]
struct Attributes {
    block: BlockRecord,
}

/// The record of a block that is written; `None` if it is not.
pub(crate) fn record(folder: &Path) -> Option<BlockRecord> {
    let text = fs::read_to_string(folder.join("zarr.json")).ok()?;
    serde_json::from_str::<Node>(&text).ok().map(|node| node.attributes.block)
}

/// Reads a block: of its atoms those of positions that are `wanted`.
pub(crate) fn read(
    folder: &Path,
    record: &BlockRecord,
    extent: Extent,
    squares: usize,
    positions: usize,
    wanted: impl Fn(usize) -> bool,
) -> Result<PackedBlock, FieldError> {
    let patches = Patches::new(extent.rows.len(), extent.columns.len());
    let [height, width] = patches.block();
    let (rank, ids) = (record.rank, Ids::new(squares));
    if rank == 0 {
        let mut dark = Writing::default();
        (0..patches.len()).for_each(|_| dark.begin_patch());
        let dark = Atoms::parse(&dark.finish(), patches.len(), 0, ids).ok();
        let positions = vec![dark; positions];
        return Ok(PackedBlock { extent, patches, rank, basis: Vec::new(), steps: Vec::new(), positions });
    }
    let first = record.rows_of_bases();
    let mut rows = Rows::open(folder, record, first + positions, |row| row < first || wanted(row - first))?;
    let of_components = COMPONENTS_A_ROW * 3 * height * width;
    if record.bytes < of_components.max(rank * patches.len() * 4) {
        return Err(rows.damaged(format!("rows of {} bytes are too short", record.bytes)));
    }
    // One row after the other, the next over the padding of the one before.
    let mut basis = vec![0; (first - 1) * of_components + record.bytes - of_components];
    for row in 0..first - 1 {
        let to = &mut basis[row * of_components..][..record.bytes];
        rows.next_into(to, &format!("components {} and on", row * COMPONENTS_A_ROW))?;
    }
    basis.truncate(rank * 3 * height * width);
    let basis = basis.into_iter().map(|byte| i8::from_le_bytes([byte])).collect();
    let of_row = &rows.next("the steps")?[..rank * patches.len() * 4];
    let steps = of_row.chunks_exact(4).map(|four| f32::from_le_bytes([four[0], four[1], four[2], four[3]])).collect();
    let read = |position: usize| {
        if !wanted(position) {
            return Ok(None);
        }
        let atoms = Atoms::parse(rows.next(&format!("position {position}"))?, patches.len(), rank, ids);
        atoms.map(Some).map_err(|reason| rows.damaged(format!("position {position}: {reason}")))
    };
    let positions = (0..positions).map(read).collect::<Result<_, _>>()?;
    Ok(PackedBlock { extent, patches, rank, basis, steps, positions })
}

/// Rows of a block, read in their order.
struct Rows {
    path: PathBuf,
    /// Their frames, one behind the other.
    frames: Vec<u8>,
    lengths: std::vec::IntoIter<usize>,
    at: usize,
    decompressor: Decompressor<'static>,
    bytes: usize,
    row: Vec<u8>,
}

impl Rows {
    /// Reads the frames of the rows that are wanted: those that lie together at once.
    fn open(
        folder: &Path,
        record: &BlockRecord,
        number: usize,
        wanted: impl Fn(usize) -> bool,
    ) -> Result<Self, FieldError> {
        let path = folder.join(zarr::ROWS);
        let read = |source| FieldError::Read { path: path.clone(), source };
        let file = File::open(&path).map_err(read)?;
        // Rows are small and lie apart: what follows one is read for nothing. It is advice, so failing it is no failure.
        #[cfg(target_os = "linux")]
        let _ = rustix::fs::fadvise(&file, 0, None, rustix::fs::Advice::Random);
        let index = ShardIndex::read(&file, &path, number)?.entries;
        let mut lengths = Vec::new();
        let mut together: Vec<[u64; 2]> = Vec::new();
        for (row, entry) in index.into_iter().enumerate().filter(|(row, _)| wanted(*row)) {
            if entry == NOT_STORED {
                return Err(FieldError::Damaged { path, reason: format!("row {row} is not there") });
            }
            let [offset, length] = entry;
            lengths.push(length as usize);
            match together.last_mut() {
                Some([begin, all]) if *begin + *all == offset => *all += length,
                _ => together.push(entry),
            }
        }
        // All are asked for before the first is waited for.
        #[cfg(target_os = "linux")]
        for [offset, length] in &together {
            let _ = rustix::fs::fadvise(&file, *offset, NonZero::new(*length), rustix::fs::Advice::WillNeed);
        }
        let mut frames = Vec::with_capacity(together.iter().map(|[_, length]| *length as usize).sum());
        for [offset, length] in together {
            let begin = frames.len();
            frames.resize(begin + length as usize, 0);
            file.read_exact_at(&mut frames[begin..], offset).map_err(read)?;
        }
        let decompressor = Decompressor::new().map_err(read)?;
        let bytes = record.bytes;
        Ok(Self { path, frames, lengths: lengths.into_iter(), at: 0, decompressor, bytes, row: Vec::new() })
    }

    /// The next row; `what` it holds, for messages.
    fn next(&mut self, what: &str) -> Result<&[u8], FieldError> {
        let mut row = std::mem::take(&mut self.row);
        row.resize(self.bytes.min(MOST_BYTES), 0);
        let done = self.next_into(&mut row, what);
        self.row = row;
        done.map(|()| &self.row[..])
    }

    /// The next row into `to`, which is as long.
    fn next_into(&mut self, to: &mut [u8], what: &str) -> Result<(), FieldError> {
        let length = self.lengths.next().unwrap_or(0);
        let frame = &self.frames[self.at..self.at + length];
        self.at += length;
        match self.decompressor.decompress_to_buffer(frame, to) {
            Ok(found) if found == self.bytes => Ok(()),
            Ok(found) => Err(self.damaged(format!("{what}: {found} bytes instead of {}", self.bytes))),
            Err(error) => Err(self.damaged(format!("{what}: {error}"))),
        }
    }

    fn damaged(&self, reason: String) -> FieldError {
        FieldError::Damaged { path: self.path.clone(), reason }
    }
}

/// A row, padded to `bytes`.
fn compress(row: &[u8], bytes: usize) -> io::Result<Vec<u8>> {
    let mut padded = row.to_vec();
    padded.resize(bytes, 0);
    let mut compressor = zstd::bulk::Compressor::new(ZSTD_LEVEL)?;
    compressor.include_checksum(true)?;
    compressor.set_parameter(zstd::zstd_safe::CParameter::MinMatch(SHORTEST_MATCH))?;
    compressor.compress(&padded)
}

/// The rows, each padded to `bytes`, and their index.
fn shard(rows: &[&[u8]], bytes: usize) -> io::Result<Vec<u8>> {
    let frames: Vec<Vec<u8>> = rows.par_iter().map(|row| compress(row, bytes)).collect::<io::Result<_>>()?;
    let mut index = Vec::with_capacity(frames.len());
    let mut shard = Vec::new();
    for frame in &frames {
        index.push([shard.len() as u64, frame.len() as u64]);
        shard.extend_from_slice(frame);
    }
    shard.extend(ShardIndex::to_bytes(&index));
    Ok(shard)
}

/// Exactly `bytes` bytes.
pub(crate) fn decompress(frame: &[u8], bytes: usize) -> Result<Vec<u8>, String> {
    let raw = zstd::bulk::decompress(frame, bytes.min(MOST_BYTES)).map_err(|error| error.to_string())?;
    if raw.len() == bytes { Ok(raw) } else { Err(format!("{} bytes instead of {bytes}", raw.len())) }
}

pub(crate) fn decompress_file(path: &Path, bytes: usize) -> Result<Vec<u8>, FieldError> {
    let frame = fs::read(path).map_err(|source| FieldError::Read { path: path.to_path_buf(), source })?;
    decompress(&frame, bytes).map_err(|reason| FieldError::Damaged { path: path.to_path_buf(), reason })
}

fn write_file(path: &Path, bytes: &[u8]) -> Result<(), FieldError> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder).map_err(|source| FieldError::Write { path: path.to_path_buf(), source })?;
    }
    Ok(write_atomically(path, |file| file.write_all(bytes))?)
}

fn write_json(path: &Path, value: &serde_json::Value) -> Result<(), FieldError> {
    write_file(path, format!("{value:#}\n").as_bytes())
}
