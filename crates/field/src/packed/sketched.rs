//! Sketches on disk, between the developing of positions and the packing of blocks: one file a position and tile.
//!
//! ```text
//! u64 × B   bytes of the zstd frame of each block of the tile, 0 for a block outside the picture
//! …         the frames
//! ```
//! They lie in the unfinished field only and belong to the program that wrote them.

use std::fs;
use std::path::{Path, PathBuf};

use half::f16;
use relumine_radiometry::files::write_atomically;

use crate::FieldError;
use crate::packed::Sketch;
use crate::packed::sketch::PatchSketch;

/// The file of a position and tile.
pub(crate) fn path_of(folder: &Path, position: usize, [row, column]: [usize; 2]) -> PathBuf {
    folder.join(format!("{position}/{row}-{column}"))
}

/// Writes the sketches of the blocks of a tile; `None` outside the picture.
pub(crate) fn write(path: &Path, sketches: &[Option<Vec<u8>>]) -> Result<(), FieldError> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder).map_err(|source| FieldError::Write { path: path.to_path_buf(), source })?;
    }
    let frames = || sketches.iter().map(|frame| frame.as_deref().unwrap_or_default());
    write_atomically(path, |file| {
        use std::io::Write;
        frames().try_for_each(|frame| file.write_all(&(frame.len() as u64).to_le_bytes()))?;
        frames().try_for_each(|frame| file.write_all(frame))
    })?;
    Ok(())
}

/// Reads the sketch of one of `blocks` blocks of a tile.
pub(crate) fn read(path: &Path, blocks: usize, block: usize) -> Result<Sketch, FieldError> {
    use std::os::unix::fs::FileExt;
    let read = |source| FieldError::Read { path: path.to_path_buf(), source };
    let damaged = |reason: &str| FieldError::Damaged { path: path.to_path_buf(), reason: reason.into() };
    let file = fs::File::open(path).map_err(read)?;
    let length = file.metadata().map_err(read)?.len();
    let mut sizes = vec![0; 8 * blocks];
    file.read_exact_at(&mut sizes, 0).map_err(read)?;
    let sizes: Vec<u64> =
        sizes.chunks_exact(8).map(|size| u64::from_le_bytes(size.try_into().expect("eight bytes"))).collect();
    let start = sizes.len() as u64 * 8 + sizes[..block].iter().fold(0u64, |sum, size| sum.saturating_add(*size));
    if start.checked_add(sizes[block]).is_none_or(|end| end > length) {
        return Err(damaged("a block lies outside the file"));
    }
    let mut frame = vec![0; sizes[block] as usize];
    file.read_exact_at(&mut frame, start).map_err(read)?;
    let raw = zstd::bulk::decompress(&frame, MOST_BYTES).map_err(|error| damaged(&error.to_string()))?;
    from_bytes(&raw).ok_or_else(|| damaged("a sketch is cut off"))
}

/// No sketch is larger: 64 × 64 pixels, 32 squares and all groups.
const MOST_BYTES: usize = 1 << 24;

/// A sketch as a zstd frame.
pub(crate) fn to_frame(sketch: &Sketch) -> std::io::Result<Vec<u8>> {
    let mut compressor = zstd::bulk::Compressor::new(1)?;
    compressor.include_checksum(true)?;
    compressor.compress(&to_bytes(sketch))
}

fn to_bytes(sketch: &Sketch) -> Vec<u8> {
    let mut bytes = Vec::new();
    bytes.extend((sketch.patches.len() as u32).to_le_bytes());
    for patch in &sketch.patches {
        bytes.extend((patch.whole.len() as u16).to_le_bytes());
        bytes.extend((patch.squares.len() as u16).to_le_bytes());
        bytes.extend((patch.rest.len() as u16).to_le_bytes());
        bytes.extend(patch.main.to_le_bytes());
        bytes.extend(patch.scale.to_le_bytes());
        patch.whole.iter().chain(&patch.rest).for_each(|value| bytes.extend(value.to_le_bytes()));
        for (square, values) in &patch.squares {
            bytes.extend(square.to_le_bytes());
            values.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
        }
    }
    bytes
}

fn from_bytes(bytes: &[u8]) -> Option<Sketch> {
    struct Rest<'a>(&'a [u8]);
    impl Rest<'_> {
        fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
            let (first, rest) = self.0.split_first_chunk::<N>()?;
            self.0 = rest;
            Some(*first)
        }
        fn number(&mut self) -> Option<usize> {
            self.take().map(|two| usize::from(u16::from_le_bytes(two)))
        }
        fn floats(&mut self, count: usize) -> Option<Vec<f32>> {
            (0..count).map(|_| self.take().map(f32::from_le_bytes)).collect()
        }
    }
    let mut rest = Rest(bytes);
    let patches = u32::from_le_bytes(rest.take()?);
    let patches = (0..patches)
        .map(|_| {
            let [whole, squares, remainder] = [rest.number()?, rest.number()?, rest.number()?];
            let main = u16::from_le_bytes(rest.take()?);
            let scale = f32::from_le_bytes(rest.take()?);
            let (values, remainder) = (rest.floats(whole)?, rest.floats(remainder)?);
            let squares = (0..squares)
                .map(|_| {
                    let square = u16::from_le_bytes(rest.take()?);
                    let halves: Option<Vec<f16>> = (0..whole).map(|_| rest.take().map(f16::from_le_bytes)).collect();
                    Some((square, halves?))
                })
                .collect::<Option<_>>()?;
            Some(PatchSketch { whole: values, main, squares, rest: remainder, scale })
        })
        .collect::<Option<_>>()?;
    Some(Sketch { patches })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::packed::{Keep, Patches};

    #[test]
    fn a_sketch_comes_back_from_disk_and_a_spoiled_one_does_not() {
        let folder = tempfile::tempdir().unwrap();
        let values: Vec<f16> =
            (0..16 * 3 * 9 * 11).map(|i| f16::from_f32((i % 97) as f32 / (1 + i / 300) as f32)).collect();
        let sketch = Sketch::new(&Patches::new(9, 11), 4, &values, 0.5, &Keep { share: 0.01, most: 4 });
        assert!(
            sketch.patches.iter().any(|patch| !patch.squares.is_empty() && patch.rest.iter().any(|sum| *sum > 0.0))
        );
        let path = path_of(folder.path(), 3, [0, 1]);
        write(&path, &[None, Some(to_frame(&sketch).unwrap())]).unwrap();
        assert_eq!(read(&path, 2, 1).unwrap(), sketch);
        let whole = fs::read(&path).unwrap();
        for index in 0..whole.len() {
            let mut spoiled = whole.clone();
            spoiled[index] ^= 0x10;
            fs::write(&path, spoiled).unwrap();
            // zstd does not use every bit of its own header; what it gives is then the sketch all the same.
            assert!(read(&path, 2, 1).is_ok_and(|found| found == sketch) || read(&path, 2, 1).is_err(), "byte {index}");
        }
    }
}
