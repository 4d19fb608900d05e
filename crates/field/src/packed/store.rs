//! The files of packed blocks: for each a Zarr group `packed/ROW-COLUMN` with its bases, steps and atoms.

use std::fs::{self, File};
use std::io::{self, Write};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use relumine_radiometry::files::write_atomically;
use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::packed::atoms::Writing;
use crate::packed::coder::OwnedAtom;
use crate::packed::encode::{PackedPatch, pack_patch};
use crate::packed::{Atom, Atoms, Groups, Kept, POSITIONS_A_CHUNK, PackedBlock, Patches, Sketch};
use crate::shard_index::{NOT_STORED, ShardIndex};
use crate::{Extent, FieldError, zarr};

/// How packed blocks are compressed. They are nearly noise to a matcher: without short matches they come out smaller, and
/// decompress two to four times as fast.
const ZSTD_LEVEL: i32 = 17;
const SHORTEST_MATCH: u32 = 7;

/// The most bytes that the atoms of one chunk may take.
const MOST_BYTES: usize = 1 << 27;

/// What is known of a packed block besides its arrays.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BlockRecord {
    /// Components of its longest basis; 0 if it shows nothing.
    pub rank: usize,
    /// Bytes of the atoms of each chunk of positions, with padding.
    pub bytes: usize,
    /// Where its light went.
    pub kept: Kept,
}

impl BlockRecord {
    /// Whether a block can be so.
    pub(crate) fn is_possible(&self) -> bool {
        self.rank <= Atoms::MOST_COEFFICIENTS && self.bytes <= MOST_BYTES
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
    let chunks: Vec<Vec<u8>> = (0..sketches.len())
        .collect::<Vec<_>>()
        .chunks(POSITIONS_A_CHUNK)
        .map(|positions| {
            let mut writing = Writing::default();
            for position in positions {
                for patch in &packed {
                    writing.begin_patch();
                    for OwnedAtom { id, exponent, coefficients } in &patch.atoms[*position] {
                        writing.push(Atom { id: *id, exponent: *exponent, coefficients });
                    }
                }
            }
            writing.finish()
        })
        .collect();
    Packed { patches, rank, basis, steps, chunks, kept }
}

/// A packed block, to be written.
pub(crate) struct Packed {
    patches: Patches,
    rank: usize,
    basis: Vec<i8>,
    steps: Vec<f32>,
    chunks: Vec<Vec<u8>>,
    kept: Kept,
}

impl Packed {
    /// Writes the block into `folder`: its record last, so that a block with a record is whole.
    pub(crate) fn write(self, folder: &Path) -> Result<BlockRecord, FieldError> {
        let write = |source| FieldError::Write { path: folder.to_path_buf(), source };
        let bytes = if self.rank == 0 { 0 } else { self.chunks.iter().map(Vec::len).max().unwrap_or(0) };
        if bytes > MOST_BYTES {
            return Err(write(io::Error::other(format!("{bytes} bytes of atoms: pack with a larger error"))));
        }
        let record = BlockRecord { rank: self.rank, bytes, kept: self.kept };
        fs::create_dir_all(folder).map_err(write)?;
        if self.rank > 0 {
            let ([height, width], [down, across]) = (self.patches.block(), self.patches.counts());
            let shape = [self.rank, 3, height, width];
            let names = ["component", "channel", "y", "x"];
            let basis = zarr::array("int8", &shape, &shape, &names, "vectors of the patches' bases");
            write_file(&folder.join("basis/c/0/0/0/0"), &compress(&to_bytes(&self.basis)).map_err(write)?)?;
            write_json(&folder.join("basis/zarr.json"), &basis)?;
            let shape = [self.rank, down, across];
            let names = ["component", "patch_y", "patch_x"];
            let steps = zarr::array("float32", &shape, &shape, &names, "transfer per unit of coefficient and vector");
            let raw: Vec<u8> = self.steps.iter().flat_map(|step| step.to_le_bytes()).collect();
            write_file(&folder.join("steps/c/0/0/0"), &compress(&raw).map_err(write)?)?;
            write_json(&folder.join("steps/zarr.json"), &steps)?;
            let shard = shard(&self.chunks, bytes).map_err(write)?;
            write_file(&folder.join("atoms/c/0/0"), &shard)?;
            let unit = "atoms of 8 positions, as FORMAT.md describes";
            let atoms = zarr::rows_of_bytes([self.chunks.len(), bytes], ["positions", "byte"], unit);
            write_json(&folder.join("atoms/zarr.json"), &atoms)?;
        }
        write_json(&folder.join("zarr.json"), &zarr::group(&json!({ "block": record })))?;
        Ok(record)
    }
}

#[derive(Deserialize)]
struct Group {
    attributes: Attributes,
}

#[derive(Deserialize)]
struct Attributes {
    block: BlockRecord,
}

/// The record of a block that is written; `None` if it is not.
pub(crate) fn record(folder: &Path) -> Option<BlockRecord> {
    let text = fs::read_to_string(folder.join("zarr.json")).ok()?;
    serde_json::from_str::<Group>(&text).ok().map(|group| group.attributes.block)
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
    let rank = record.rank;
    let ids = squares * squares + Groups::new(squares).len();
    let mut chunks = vec![None; positions.div_ceil(POSITIONS_A_CHUNK)];
    let size_of = |chunk: usize| POSITIONS_A_CHUNK.min(positions - chunk * POSITIONS_A_CHUNK);
    if rank == 0 {
        let none = |chunk: usize| {
            let mut writing = Writing::default();
            (0..size_of(chunk) * patches.len()).for_each(|_| writing.begin_patch());
            Atoms::parse(writing.finish(), size_of(chunk), patches.len(), 0, ids).ok()
        };
        let chunks = (0..chunks.len()).map(none).collect();
        return Ok(PackedBlock { extent, patches, rank, basis: Vec::new(), steps: Vec::new(), chunks });
    }
    let basis = decompress_file(&folder.join("basis/c/0/0/0/0"), rank * 3 * height * width)?;
    let steps = decompress_file(&folder.join("steps/c/0/0/0"), rank * patches.len() * 4)?;
    let path = folder.join("atoms/c/0/0");
    let read = |source| FieldError::Read { path: path.clone(), source };
    let damaged = |reason: String| FieldError::Damaged { path: path.clone(), reason };
    let file = File::open(&path).map_err(read)?;
    let index = ShardIndex::read(&file, &path, chunks.len())?.entries;
    for (chunk, entry) in index.into_iter().enumerate() {
        let first = chunk * POSITIONS_A_CHUNK;
        if !(first..first + size_of(chunk)).any(&wanted) {
            continue;
        }
        if entry == NOT_STORED {
            return Err(damaged(format!("the atoms of positions {first} and on are not there")));
        }
        let [offset, bytes] = entry;
        let mut frame = vec![0; bytes as usize];
        file.read_exact_at(&mut frame, offset).map_err(read)?;
        let of_chunk =
            |reason: String| damaged(format!("positions {first} to {}: {reason}", first + size_of(chunk) - 1));
        let raw = decompress(&frame, record.bytes).map_err(of_chunk)?;
        let atoms = Atoms::parse(raw, size_of(chunk), patches.len(), rank, ids).map_err(of_chunk)?;
        chunks[chunk] = Some(atoms);
    }
    let basis = basis.into_iter().map(|byte| i8::from_le_bytes([byte])).collect();
    let steps = steps.chunks_exact(4).map(|four| f32::from_le_bytes([four[0], four[1], four[2], four[3]])).collect();
    Ok(PackedBlock { extent, patches, rank, basis, steps, chunks })
}

fn to_bytes(values: &[i8]) -> Vec<u8> {
    values.iter().map(|value| value.to_le_bytes()[0]).collect()
}

fn compress(raw: &[u8]) -> io::Result<Vec<u8>> {
    let mut compressor = zstd::bulk::Compressor::new(ZSTD_LEVEL)?;
    compressor.include_checksum(true)?;
    compressor.set_parameter(zstd::zstd_safe::CParameter::MinMatch(SHORTEST_MATCH))?;
    compressor.compress(raw)
}

/// The chunks, each padded to `bytes`, and their index.
fn shard(chunks: &[Vec<u8>], bytes: usize) -> io::Result<Vec<u8>> {
    let frames: Vec<Vec<u8>> = chunks
        .par_iter()
        .map(|chunk| {
            let mut padded = chunk.clone();
            padded.resize(bytes, 0);
            compress(&padded)
        })
        .collect::<io::Result<_>>()?;
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
