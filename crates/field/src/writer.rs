//! Writing a field: position by position, into a temporary place, renamed when whole.
//!
//! `NAME.partial/` holds the growing field in `field/`, the journal of finished positions, and the digest of what the field
//! is made from, so that a later run goes on with the same input only.

mod packed;

use std::collections::BTreeMap;
use std::fs::{self, File, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread::ScopedJoinHandle;

use half::f16;
use rayon::prelude::*;
use relumine_basis::Cells;
use relumine_radiometry::files::write_atomically;
use serde_json::json;

use crate::journal::{Digest, Entry, Journal};
use crate::{Blocks, Extent, FieldError, Header, Packing, PositionRecord, manifest, shard, zarr};

/// What an old field is called while a new one takes its name.
const REPLACED: &str = ".replaced";

/// What a job found out when it began, beside its unfinished field.
const KEPT: &str = "kept.json";

/// Writes one field. Positions may be written from several threads at once, each position by one.
pub struct FieldWriter {
    path: PathBuf,
    partial: PathBuf,
    field: PathBuf,
    header: Header,
    cells: Cells,
    blocks: Blocks,
    journal: Mutex<(Journal, BTreeMap<usize, Entry>)>,
    /// By position and name: the digests of shards that are on disk, of positions that are not done.
    shards: Mutex<BTreeMap<usize, BTreeMap<String, Digest>>>,
    /// Held as long as the writer lives: two writers of one field would spoil it.
    _lock: File,
}

impl FieldWriter {
    /// Starts the field that will be at `path`, or goes on with an unfinished one made from the same `input`, any text
    /// that names what the field is made from and how.
    ///
    /// # Errors
    /// If there is something at `path` and not `replace`, if an unfinished field was made from something else or another
    /// process is writing it, or if nothing can be written.
    pub fn open(path: &Path, header: Header, input: &str, replace: bool) -> Result<Self, FieldError> {
        let geometry = |source| FieldError::Geometry { path: path.to_path_buf(), source };
        if header.packing.is_some() && header.squares() > Packing::MOST_SQUARES {
            let (most, found) = (Packing::MOST_SQUARES, header.squares());
            let reason = format!("packed fields have at most {most} squares a side, but these are {found}");
            return Err(FieldError::NotAField { path: path.to_path_buf(), reason });
        }
        // A writer killed while it renamed: the old field goes back to its name, or away if the new one has it.
        let replaced = beside(path, REPLACED);
        if replaced.exists() {
            let write = |source| FieldError::Write { path: replaced.clone(), source };
            if path.exists() { fs::remove_dir_all(&replaced) } else { fs::rename(&replaced, path) }.map_err(write)?;
        }
        let is_field = path.join("zarr.json").is_file() && path.join(manifest::NAME).is_file();
        if path.exists() && replace && !is_field {
            let reason = "only a field is replaced; remove it, or choose another name".into();
            return Err(FieldError::NotAField { path: path.to_path_buf(), reason });
        }
        if path.exists() && !replace {
            return Err(FieldError::Exists { path: path.to_path_buf() });
        }
        let partial = beside(path, ".partial");
        let write = |source| FieldError::Write { path: partial.clone(), source };
        let field = partial.join("field");
        fs::create_dir_all(&partial).map_err(write)?;
        let lock = File::create(partial.join("lock")).map_err(write)?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(FieldError::Busy { path: partial });
            }
            Err(TryLockError::Error(error)) => return Err(write(error)),
        }
        let header_text = serde_json::to_string(&header).map_err(|error| write(error.into()))?;
        let input = blake3::hash(format!("{header_text}\n{input}").as_bytes()).to_hex();
        let input_file = partial.join("input.b3");
        // A writer killed while it cleared away may have left a journal of shards that are gone or of an input unknown; one
        // that made something else is to be replaced, if anything is.
        let same_input = fs::read_to_string(&input_file).is_ok_and(|found| found == input.as_str());
        if !(field.is_dir() && input_file.exists()) || (replace && !same_input) {
            let gone = |result: io::Result<()>| match result {
                Err(error) if error.kind() != io::ErrorKind::NotFound => Err(write(error)),
                _ => Ok(()),
            };
            gone(fs::remove_file(partial.join("journal")))?;
            gone(fs::remove_file(&input_file))?;
            gone(fs::remove_file(partial.join(KEPT)))?;
            gone(fs::remove_dir_all(&field))?;
            gone(fs::remove_dir_all(partial.join("sketches")))?;
        }
        fs::create_dir_all(&field).map_err(write)?;
        match fs::read_to_string(&input_file) {
            Ok(found) if found == input.as_str() => {}
            Ok(_) => return Err(FieldError::OtherUnfinished { path: partial }),
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                write_atomically(&input_file, |file| file.write_all(input.as_bytes()))?;
            }
            Err(source) => return Err(FieldError::Read { path: input_file, source }),
        }
        let (journal, entries) = Journal::open(&partial.join("journal"))?;
        let cells = header.cells().map_err(geometry)?;
        let done = entries.into_iter().map(|entry| (entry.record.position, entry)).collect();
        Ok(Self {
            path: path.to_path_buf(),
            field,
            blocks: header.blocks(),
            header,
            cells,
            journal: Mutex::new((journal, done)),
            shards: Mutex::default(),
            partial,
            _lock: lock,
        })
    }

    /// What an unfinished field at `path` keeps of the job with this `input` ([`FieldWriter::keep`]); `None` if it keeps
    /// nothing, or of another job.
    pub fn kept(path: &Path, input: &str) -> Option<serde_json::Value> {
        let text = fs::read_to_string(beside(path, ".partial").join(KEPT)).ok()?;
        let (of, value) = serde_json::from_str::<(String, serde_json::Value)>(&text).ok()?;
        (of == input).then_some(value)
    }

    /// Keeps a value that was found out when the job began, under `key` of the field's `made`: whoever goes on with the job finds
    /// it with [`FieldWriter::kept`] and gives it here again.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn keep(&mut self, input: &str, key: &str, value: serde_json::Value) -> Result<(), FieldError> {
        let path = self.partial.join(KEPT);
        let text = json!([input, value]).to_string();
        if fs::read_to_string(&path).ok().as_deref() != Some(&text) {
            write_atomically(&path, |file| file.write_all(text.as_bytes()))?;
        }
        self.header.made[key] = value;
        Ok(())
    }

    /// How the pictures are cut.
    pub fn blocks(&self) -> Blocks {
        self.blocks
    }

    /// The records of positions that are done.
    pub fn done(&self) -> Vec<PositionRecord> {
        self.journal().1.values().map(|entry| entry.record.clone()).collect()
    }

    fn journal(&self) -> MutexGuard<'_, (Journal, BTreeMap<usize, Entry>)> {
        self.journal.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Positions that are not done yet.
    pub fn remaining(&self) -> Vec<usize> {
        let done: Vec<usize> = self.done().iter().map(|record| record.position).collect();
        (0..self.cells.positions()).filter(|position| done.binary_search(position).is_err()).collect()
    }

    /// The scale of a position whose transfers reach `bound`: a power of two that puts them just below 2¹⁵, where halves
    /// are finest.
    pub fn scale_for(bound: f64) -> f32 {
        if bound > 0.0 && bound.is_finite() {
            let exponent = (bound.log2().ceil() - 15.0).clamp(-120.0, 100.0);
            2f32.powi(exponent as i32)
        } else {
            1.0
        }
    }

    /// Writes one tile of a position: `values` are transfers over the position's scale,
    /// `[v · M + u][channel][row][column]` of the tile's own pixels.
    ///
    /// # Errors
    /// As [`FieldWriter::write_blocks`].
    ///
    /// # Panics
    /// If there are more or fewer values.
    pub fn write_tile(&self, position: usize, tile: [usize; 2], values: &[f16]) -> Result<(), FieldError> {
        let all = self.blocks.tile_extent(tile);
        let planes = 3 * self.cells.squares() * self.cells.squares();
        assert_eq!(values.len(), planes * all.pixels(), "a tile needs every pixel of every square");
        let block_of = |extent: &Extent| {
            let rows = extent.rows.start - all.rows.start..extent.rows.end - all.rows.start;
            let columns = extent.columns.start - all.columns.start..extent.columns.end - all.columns.start;
            let mut block = Vec::with_capacity(planes * extent.pixels());
            for plane in values.chunks_exact(all.pixels()) {
                for row in plane.chunks_exact(all.columns.len()).skip(rows.start).take(rows.len()) {
                    block.extend_from_slice(&row[columns.clone()]);
                }
            }
            (block, ())
        };
        self.write_blocks(position, tile, block_of).map(|_| ())
    }

    /// Writes one tile of a position, block by block, several at once: `values_of` gives the transfers over the position's
    /// scale of a block of pixels, `[v · M + u][channel][row][column]`, and whatever else the caller wants to know of the
    /// block, which comes back in the order of the blocks.
    ///
    /// # Errors
    /// If it cannot be written; then the position is not done and can be written again.
    pub fn write_blocks<T: Send>(
        &self,
        position: usize,
        tile: [usize; 2],
        values_of: impl Fn(&Extent) -> (Vec<f16>, T) + Sync,
    ) -> Result<Vec<T>, FieldError> {
        let (frames, known) = self.compress_tile(position, tile, values_of)?;
        self.write_shard(position, tile, frames)?;
        Ok(known)
    }

    /// Writes all tiles of a position, each as [`FieldWriter::write_blocks`] does; while one goes to the disk the next one
    /// is made.
    ///
    /// # Errors
    /// As [`FieldWriter::write_blocks`].
    pub fn write_all_blocks<T: Send>(
        &self,
        position: usize,
        values_of: impl Fn(&Extent) -> (Vec<f16>, T) + Sync,
    ) -> Result<Vec<T>, FieldError> {
        std::thread::scope(|scope| {
            let mut all = Vec::new();
            let mut earlier: Option<ScopedJoinHandle<Result<(), FieldError>>> = None;
            for tile in self.blocks.all_tiles() {
                let (frames, known) = self.compress_tile(position, tile, &values_of)?;
                all.extend(known);
                earlier.take().map_or(Ok(()), written)?;
                earlier = Some(scope.spawn(move || self.write_shard(position, tile, frames)));
            }
            earlier.map_or(Ok(()), written)?;
            Ok(all)
        })
    }

    /// The compressed squares of the blocks of a tile.
    fn compress_tile<T: Send>(
        &self,
        position: usize,
        tile: [usize; 2],
        values_of: impl Fn(&Extent) -> (Vec<f16>, T) + Sync,
    ) -> Result<(Vec<shard::Frames>, Vec<T>), FieldError> {
        let compressed: Vec<_> = self
            .blocks
            .in_tile(tile)
            .into_par_iter()
            .map(|extent| {
                if extent.pixels() == 0 {
                    return Ok((Vec::new(), None));
                }
                let (values, known) = values_of(&extent);
                Ok((shard::compress(&self.blocks, &extent, &values)?, Some(known)))
            })
            .collect::<io::Result<_>>()
            .map_err(|source| FieldError::Write { path: shard_path(&self.field, position, tile), source })?;
        let (frames, known): (Vec<_>, Vec<_>) = compressed.into_iter().unzip();
        Ok((frames, known.into_iter().flatten().collect()))
    }

    fn write_shard(&self, position: usize, tile: [usize; 2], frames: Vec<shard::Frames>) -> Result<(), FieldError> {
        let name = shard_name(position, tile);
        let path = self.field.join(&name);
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(|source| FieldError::Write { path: path.clone(), source })?;
        }
        let squares = self.cells.squares() * self.cells.squares();
        let digest = shard::write_file(&path, squares, frames)?;
        let mut shards = self.shards.lock().unwrap_or_else(PoisonError::into_inner);
        shards.entry(position).or_default().insert(name, digest);
        Ok(())
    }

    /// Writes how often each pixel of a position was clipped, and then that the position is done.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn finish_position(&self, record: PositionRecord, clipped: &[u8]) -> Result<(), FieldError> {
        let chunk = format!("{}/c/{}/0/0", zarr::CLIPPED, record.position);
        if clipped.iter().any(|count| *count > 0) {
            self.write_chunk(&chunk, clipped)?;
        } else if self.field.join(&chunk).exists() {
            // From an earlier go at the same position.
            let path = self.field.join(&chunk);
            fs::remove_file(&path).map_err(|source| FieldError::Write { path, source })?;
        }
        let shards = self.shards.lock().unwrap_or_else(PoisonError::into_inner).remove(&record.position);
        let entry = Entry { record, shards: shards.unwrap_or_default() };
        let mut journal = self.journal();
        journal.0.append(&entry)?;
        journal.1.insert(entry.record.position, entry);
        Ok(())
    }

    /// Writes the metadata and the list of digests, and renames the field to its name.
    ///
    /// # Errors
    /// If a position is not done or something cannot be written.
    pub fn finish(self) -> Result<(), FieldError> {
        let records = self.done();
        let write = |path: &Path, source| FieldError::Write { path: path.to_path_buf(), source };
        if records.len() != self.cells.positions() {
            let reason = format!("{} of {} positions are not done", self.remaining().len(), self.cells.positions());
            return Err(write(&self.partial, io::Error::other(reason)));
        }
        let [width, height] = self.header.picture;
        let (positions, m) = (self.cells.positions(), self.cells.squares());
        let cells = [positions, m, m];
        let names = ["position", "v", "u"];
        let directions: Vec<f64> = self
            .cells
            .partition()
            .positions()
            .iter()
            .flat_map(|position| [position.azimuth.to_degrees(), position.tilt.to_degrees()])
            .collect();
        let measures: Vec<f64> = (0..self.cells.len()).map(|cell| self.cells.measure(cell)).collect();
        let scales: Vec<f32> = records.iter().map(|record| record.scale).collect();
        let mut present = vec![1u8; self.cells.len()];
        for record in &records {
            for missing in &record.missing {
                present[record.position * m * m + missing] = 0;
            }
        }
        let square_meters = if matches!(self.header.lamps, crate::Lamps::Distant { .. }) { "sr" } else { "m² sr" };
        self.write_array(
            zarr::DIRECTION,
            &zarr::array(
                "float64",
                &[positions, 2],
                &[positions, 2],
                &["position", "angle"],
                "azimuth, tilt [degrees]",
            ),
            "c/0/0",
            &bytes(&directions, f64::to_le_bytes),
        )?;
        self.write_array(
            zarr::MEASURE,
            &zarr::array(
                "float64",
                &cells,
                &cells,
                &names,
                &format!("measure of the cell |Omega_i| [{square_meters}]"),
            ),
            "c/0/0/0",
            &bytes(&measures, f64::to_le_bytes),
        )?;
        self.write_array(
            zarr::SCALE,
            &zarr::array("float32", &[positions], &[positions], &names[..1], "transfer per stored unit"),
            "c/0",
            &bytes(&scales, f32::to_le_bytes),
        )?;
        self.write_array(
            zarr::PRESENT,
            &zarr::array("uint8", &cells, &cells, &names, "1 where the cell was photographed, 0 where it is missing"),
            "c/0/0/0",
            &present,
        )?;
        let clipped = zarr::array(
            "uint8",
            &[positions, height, width],
            &[1, height, width],
            &["position", "y", "x"],
            "photographs in which every exposure of the pixel is clipped",
        );
        self.write_json(&format!("{}/zarr.json", zarr::CLIPPED), &clipped)?;
        let mut attributes = json!({ "relumine": self.header, "positions": records });
        if self.header.packing.is_some() {
            attributes["blocks"] = json!(self.block_records()?);
            self.write_json(&format!("{}/zarr.json", zarr::PACKED), &zarr::group(&json!({})))?;
        } else {
            self.write_json(&format!("{}/zarr.json", zarr::TRANSFER), &zarr::transfer(&self.header))?;
        }
        self.write_json("zarr.json", &zarr::group(&attributes))?;
        remove_leavings(&self.field).map_err(|source| write(&self.field, source))?;
        let known = self.journal().1.values().flat_map(|entry| entry.shards.clone()).collect();
        manifest::write(&self.field, &known)?;
        self.rename().map_err(|source| write(&self.path, source))
    }

    fn rename(&self) -> io::Result<()> {
        let replaced = beside(&self.path, REPLACED);
        if self.path.exists() {
            fs::rename(&self.path, &replaced)?;
        }
        fs::rename(&self.field, &self.path)?;
        let folder = self.path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        File::open(folder)?.sync_all()?;
        if replaced.exists() {
            fs::remove_dir_all(&replaced)?;
        }
        fs::remove_dir_all(&self.partial)
    }

    fn write_array(
        &self,
        name: &str,
        metadata: &serde_json::Value,
        chunk: &str,
        bytes: &[u8],
    ) -> Result<(), FieldError> {
        self.write_json(&format!("{name}/zarr.json"), metadata)?;
        self.write_chunk(&format!("{name}/{chunk}"), bytes)
    }

    fn write_json(&self, name: &str, value: &serde_json::Value) -> Result<(), FieldError> {
        let path = self.field.join(name);
        let write = |source: io::Error| FieldError::Write { path: path.clone(), source };
        let mut text = serde_json::to_string_pretty(value).map_err(|error| write(error.into()))?;
        text.push('\n');
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(write)?;
        }
        write_atomically(&path, |file| file.write_all(text.as_bytes()))?;
        Ok(())
    }

    fn write_chunk(&self, name: &str, raw: &[u8]) -> Result<(), FieldError> {
        let path = self.field.join(name);
        let write = |source: io::Error| FieldError::Write { path: path.clone(), source };
        let mut compressor = zstd::bulk::Compressor::new(zarr::ZSTD_LEVEL).map_err(write)?;
        compressor.include_checksum(true).map_err(write)?;
        let frame = compressor.compress(raw).map_err(write)?;
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(write)?;
        }
        write_atomically(&path, |file| file.write_all(&frame))?;
        Ok(())
    }
}

/// What came of a tile that another thread wrote.
fn written(writing: ScopedJoinHandle<Result<(), FieldError>>) -> Result<(), FieldError> {
    writing.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

/// The file of one tile of one position.
pub(crate) fn shard_path(field: &Path, position: usize, tile: [usize; 2]) -> PathBuf {
    field.join(shard_name(position, tile))
}

/// Its name below the field: the key that Zarr gives the shard.
fn shard_name(position: usize, [row, column]: [usize; 2]) -> String {
    format!("{}/c/{position}/0/0/0/{row}/{column}", zarr::TRANSFER)
}

fn beside(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(suffix);
    path.with_file_name(name)
}

fn bytes<T: Copy, const N: usize>(values: &[T], encode: impl Fn(T) -> [u8; N]) -> Vec<u8> {
    values.iter().flat_map(|value| encode(*value)).collect()
}

/// Removes temporary files that a killed writer left behind.
fn remove_leavings(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            remove_leavings(&entry.path())?;
        } else if entry.file_name().to_string_lossy().contains(".partial-") {
            fs::remove_file(entry.path())?;
        }
    }
    Ok(())
}
