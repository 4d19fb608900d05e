//! The index at the end of a shard (Zarr codec `sharding_indexed`): offset and length of each inner chunk as little-endian
//! `u64`s, all ones for one that is not stored, then the CRC-32C of these.

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::Path;

use crate::FieldError;

/// Offset and length of an inner chunk that is not stored.
pub(crate) const NOT_STORED: [u64; 2] = [u64::MAX; 2];

const CRC_BYTES: usize = 4;
const ENTRY_BYTES: usize = 16;

/// Where the inner chunks of a shard lie: all that are stored lie before the index.
pub(crate) struct ShardIndex {
    /// Offset and length, or [`NOT_STORED`].
    pub(crate) entries: Vec<[u64; 2]>,
    /// Bytes before the index.
    pub(crate) body_bytes: u64,
}

impl ShardIndex {
    /// Reads the index of `entries` inner chunks from the shard at `path`, open as `file`.
    ///
    /// # Errors
    /// If it cannot be read, its checksum is wrong, or a chunk lies outside the file.
    pub(crate) fn read(file: &File, path: &Path, entries: usize) -> Result<Self, FieldError> {
        let read = |source| FieldError::Read { path: path.to_path_buf(), source };
        let damaged = |reason: String| FieldError::Damaged { path: path.to_path_buf(), reason };
        let length = file.metadata().map_err(read)?.len();
        let index_bytes = entries * ENTRY_BYTES + CRC_BYTES;
        let body_bytes = length
            .checked_sub(index_bytes as u64)
            .ok_or_else(|| damaged(format!("{length} bytes are too few for an index of {entries} blocks")))?;
        let mut index = vec![0; index_bytes];
        file.read_exact_at(&mut index, body_bytes).map_err(read)?;
        let (entries, checksum) = index.split_at(index_bytes - CRC_BYTES);
        if crc32c::crc32c(entries).to_le_bytes() != checksum {
            return Err(damaged("the checksum of its index is wrong".into()));
        }
        let number = |bytes: &[u8]| u64::from_le_bytes(bytes.try_into().expect("entries are two times eight bytes"));
        let entries: Vec<[u64; 2]> =
            entries.chunks_exact(ENTRY_BYTES).map(|entry| [number(&entry[..8]), number(&entry[8..])]).collect();
        for [offset, bytes] in entries.iter().filter(|entry| **entry != NOT_STORED) {
            if offset.checked_add(*bytes).is_none_or(|end| end > body_bytes) {
                return Err(damaged(format!("a block of {bytes} bytes at {offset} lies outside the file")));
            }
        }
        Ok(Self { entries, body_bytes })
    }

    /// The bytes of an index.
    pub(crate) fn to_bytes(entries: &[[u64; 2]]) -> Vec<u8> {
        let mut bytes: Vec<u8> = entries.iter().flatten().flat_map(|number| number.to_le_bytes()).collect();
        let checksum = crc32c::crc32c(&bytes);
        bytes.extend(checksum.to_le_bytes());
        bytes
    }
}
