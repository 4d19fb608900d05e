//! Directories of TIFF tags written by hand, little endian: EXIF, and what a camera's RAW is made of (TIFF 6.0, §2).

#![allow(dead_code)] // each test file takes its part

/// The value of a tag.
pub(super) enum Value {
    Bytes(Vec<u8>),
    Text(&'static str),
    Shorts(Vec<u16>),
    Longs(Vec<u32>),
    Rationals(Vec<[u32; 2]>),
    SignedRationals(Vec<[i32; 2]>),
    /// Another directory.
    Directory(Vec<(u16, Value)>),
    /// Bytes that lie elsewhere in the file, by their offset: strips of pixels.
    Offset(Vec<u8>),
}

/// A TIFF file whose first directory has these tags, which must be sorted.
pub(super) fn tiff(tags: &[(u16, Value)]) -> Vec<u8> {
    let mut file = b"II\x2a\0\x08\0\0\0".to_vec();
    write_directory(&mut file, tags);
    file
}

/// A JPEG of nothing but EXIF with these tags, and an end.
pub(super) fn jpeg_with_exif(tags: Vec<(u16, Value)>) -> Vec<u8> {
    let exif = [b"Exif\0\0".to_vec(), tiff(&[(0x8769, Value::Directory(tags))])].concat();
    let length = u16::try_from(exif.len() + 2).unwrap();
    let header = [&[0xff, 0xd8, 0xff, 0xe1], &length.to_be_bytes()[..]].concat();
    [header, exif, vec![0xff, 0xd9]].concat()
}

fn write_directory(file: &mut Vec<u8>, tags: &[(u16, Value)]) {
    let start = file.len();
    file.extend((tags.len() as u16).to_le_bytes());
    file.resize(start + 2 + 12 * tags.len() + 4, 0);
    for (index, (tag, value)) in tags.iter().enumerate() {
        let (kind, count, bytes) = encode(file, value);
        let entry = start + 2 + 12 * index;
        let field: [u8; 4] = if bytes.len() <= 4 {
            std::array::from_fn(|i| bytes.get(i).copied().unwrap_or(0))
        } else {
            let offset = file.len() as u32;
            file.extend(&bytes);
            file.resize(file.len().next_multiple_of(2), 0);
            offset.to_le_bytes()
        };
        file[entry..entry + 2].copy_from_slice(&tag.to_le_bytes());
        file[entry + 2..entry + 4].copy_from_slice(&u16::to_le_bytes(kind));
        file[entry + 4..entry + 8].copy_from_slice(&(count as u32).to_le_bytes());
        file[entry + 8..entry + 12].copy_from_slice(&field);
    }
}

/// Type, number of values and bytes; what is elsewhere is written to the file first.
fn encode(file: &mut Vec<u8>, value: &Value) -> (u16, usize, Vec<u8>) {
    match value {
        Value::Bytes(bytes) => (1, bytes.len(), bytes.clone()),
        Value::Text(text) => (2, text.len() + 1, [text.as_bytes(), &[0]].concat()),
        Value::Shorts(values) => (3, values.len(), values.iter().flat_map(|value| value.to_le_bytes()).collect()),
        Value::Longs(values) => (4, values.len(), values.iter().flat_map(|value| value.to_le_bytes()).collect()),
        Value::Rationals(values) => {
            (5, values.len(), values.iter().flatten().flat_map(|value| value.to_le_bytes()).collect())
        }
        Value::SignedRationals(values) => {
            (10, values.len(), values.iter().flatten().flat_map(|value| value.to_le_bytes()).collect())
        }
        Value::Directory(tags) => {
            let offset = file.len() as u32;
            write_directory(file, tags);
            (4, 1, offset.to_le_bytes().to_vec())
        }
        Value::Offset(bytes) => {
            let offset = file.len() as u32;
            file.extend(bytes);
            file.resize(file.len().next_multiple_of(2), 0);
            (4, 1, offset.to_le_bytes().to_vec())
        }
    }
}
