//! The binary container (§4): a header, a chunk of JSON, a chunk of bytes.

use super::{ModelError, ModelFile};

const HEADER: usize = 12;
const CHUNK_HEADER: usize = 8;

/// The JSON text, and the bytes beside it. A file that does not begin with `glTF` is all text.
pub(super) fn split<'a>(file: &ModelFile<'_>, bytes: &'a [u8]) -> Result<(&'a [u8], Option<&'a [u8]>), ModelError> {
    if !bytes.starts_with(b"glTF") {
        return Ok((bytes, None));
    }
    let version = word(bytes, 4);
    if version != Some(2) {
        return Err(file.unsupported("the header", format!("version 2 was expected, found {version:?}")));
    }
    let length = word(bytes, 8).map_or(0, |length| length as usize);
    if length < HEADER || length > bytes.len() {
        let reason = format!("it announces {length} bytes, the file has {}", bytes.len());
        return Err(file.malformed("the header", reason));
    }
    let rest = &bytes[HEADER..length];
    let (json, rest) = chunk(file, rest, "JSON", *b"JSON")?;
    // Further chunks are for extensions, and so is a second one of another type.
    if rest.len() < CHUNK_HEADER || rest[4..8] != *b"BIN\0" {
        return Ok((json, None));
    }
    let (binary, _) = chunk(file, rest, "BIN", *b"BIN\0")?;
    Ok((json, Some(binary)))
}

fn chunk<'a>(
    file: &ModelFile<'_>,
    bytes: &'a [u8],
    name: &str,
    kind: [u8; 4],
) -> Result<(&'a [u8], &'a [u8]), ModelError> {
    let place = format!("the chunk {name}");
    let length = word(bytes, 0).filter(|_| bytes.get(4..8) == Some(&kind));
    let Some(length) = length else { return Err(file.malformed(place, "it was expected here and is not")) };
    let bytes = &bytes[CHUNK_HEADER..];
    bytes
        .split_at_checked(length as usize)
        .ok_or_else(|| file.malformed(place, format!("it announces {length} bytes, only {} are there", bytes.len())))
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    let bytes = bytes.get(at..at + 4)?;
    Some(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
}
