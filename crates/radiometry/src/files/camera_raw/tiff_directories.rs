//! The directories of a TIFF file and the numbers in them (TIFF 6.0, §2), as far as telling RAW files needs: every offset is
//! looked at before it is followed.

use crate::files::error::Fault;

/// No photograph has more.
const MOST_DIRECTORIES: usize = 64;
/// Tags whose values are offsets of further directories: SubIFDs, EXIF, GPS.
const NESTED: [u16; 3] = [0x014a, 0x8769, 0x8825];
/// The colour profile, which is no directory, but which the decoder takes for one.
const COLOUR_PROFILE: u16 = 0x8773;

/// One directory: the bytes of its entries, twelve each.
pub(super) struct Directory<'a> {
    file: Bytes<'a>,
    offset: usize,
    entries: &'a [u8],
}

#[derive(Clone, Copy)]
struct Bytes<'a> {
    bytes: &'a [u8],
    little_endian: bool,
}

pub(super) fn begins_like_tiff(bytes: &[u8]) -> bool {
    matches!(bytes.get(..4), Some(b"II\x2a\0" | b"MM\0\x2a"))
}

/// All directories, those of the file's own chain and those nested in them, the first one first. A chain that comes back to a
/// directory of its own is an error: a decoder may follow it for ever.
pub(super) fn directories(bytes: &[u8]) -> Result<Vec<Directory<'_>>, Fault> {
    walk(bytes, false)
}

/// The same, and whatever else the decoder takes for a directory, as far as the file has it: what it claims, the decoder will
/// believe.
pub(super) fn directories_of_decoder(bytes: &[u8]) -> Result<Vec<Directory<'_>>, Fault> {
    walk(bytes, true)
}

fn walk(bytes: &[u8], as_decoder: bool) -> Result<Vec<Directory<'_>>, Fault> {
    let file = Bytes { bytes, little_endian: bytes.starts_with(b"II") };
    let mut chain = Vec::new();
    let mut next = file.u32(4).ok_or_else(Fault::early_end)? as usize;
    while next != 0 {
        if chain.contains(&next) || chain.len() == MOST_DIRECTORIES {
            return Err(Fault::damaged("its directories run in a circle"));
        }
        chain.push(next);
        // A last one may lack the offset of the next.
        next = file.u32(next + 2 + Directory::at(file, next)?.entries.len()).unwrap_or(0) as usize;
    }
    let (mut waiting, mut seen, mut found) = (chain, Vec::new(), Vec::new());
    waiting.reverse();
    while let Some(offset) = waiting.pop() {
        if seen.contains(&offset) {
            continue;
        }
        if found.len() == MOST_DIRECTORIES {
            return Err(Fault::damaged(format!("more than {MOST_DIRECTORIES} directories")));
        }
        seen.push(offset);
        let Some(directory) = Directory::at_most(file, offset) else { continue };
        for nested in directory.nested().take(MOST_DIRECTORIES) {
            match nested {
                Nested::Offset(place) => waiting.push(Directory::at(file, place).map(|_| place)?),
                Nested::Misread(place) if as_decoder => waiting.push(place),
                Nested::Misread(_) => {}
            }
        }
        found.push(directory);
    }
    Ok(found)
}

/// Where a directory may lie.
enum Nested {
    /// The file says so.
    Offset(usize),
    /// Only the decoder looks there.
    Misread(usize),
}

impl<'a> Directory<'a> {
    fn at(file: Bytes<'a>, offset: usize) -> Result<Self, Fault> {
        let count = usize::from(file.u16(offset).ok_or_else(Fault::early_end)?);
        let entries = file.bytes.get(offset + 2..).and_then(|rest| rest.get(..12 * count));
        Ok(Self { file, offset, entries: entries.ok_or_else(Fault::early_end)? })
    }

    /// As much of a directory as the file has.
    fn at_most(file: Bytes<'a>, offset: usize) -> Option<Self> {
        let count = usize::from(file.u16(offset)?);
        let rest = &file.bytes[offset + 2..];
        Some(Self { file, offset, entries: &rest[..12 * count.min(rest.len() / 12)] })
    }

    /// Where directories lie in this one, and where the decoder looks for some.
    fn nested(&self) -> impl Iterator<Item = Nested> + use<'a> {
        let (file, first) = (self.file, self.offset + 2);
        self.entries.chunks_exact(12).enumerate().flat_map(move |(index, entry)| {
            let tag = file.number(3, &entry[..2]).unwrap_or_default() as u16;
            let kind = file.number(3, &entry[2..4]).unwrap_or_default();
            let (is_nested, is_profile) = (NESTED.contains(&tag), tag == COLOUR_PROFILE);
            let said = file.numbers_of(entry).filter_map(move |offset| match offset as usize {
                // 0 says that there is none.
                place if is_nested && place != 0 => Some(Nested::Offset(place)),
                place => (kind == 4).then_some(Nested::Misread(place)),
            });
            let is_inside = file.number(4, &entry[4..8]).is_some_and(|count| count <= 4);
            let value = first + 12 * index + 8;
            let place = if is_inside { value } else { file.u32(value).unwrap_or(0) as usize };
            let misread = match kind {
                // Of bytes it takes the place, of a type that it does not know the first byte.
                7 => Some(place),
                1..=12 => None,
                _ => file.bytes.get(place).map(|first| usize::from(*first)),
            };
            said.chain(misread.map(Nested::Misread)).filter(move |_| is_nested || is_profile)
        })
    }

    /// The directory that a maker wrote into the EXIF, if this is the EXIF and the maker one whose notes are known: Canon's
    /// begin with it, Sony's after twelve bytes of their name, Nikon's in a TIFF of its own after ten.
    pub(super) fn maker_notes(&self) -> Option<Result<Self, Fault>> {
        const MAKER_NOTE: u16 = 0x927c;
        let entry = self.entry(MAKER_NOTE)?;
        let start = self.file.number(4, &entry[8..12])? as usize;
        let notes = self.file.bytes.get(start..)?;
        if notes.starts_with(b"Nikon\0") {
            let little_endian = notes.get(10..12)? == b"II";
            return Some(Self::at(Bytes { bytes: self.file.bytes, little_endian }, start + 18));
        }
        let header = if notes.starts_with(b"SONY") { 12 } else { 0 };
        Some(Self::at(self.file, start + header))
    }

    /// Refuses values that are longer than the file: a decoder may allocate them before it reads them.
    pub(super) fn check_lengths(&self) -> Result<(), Fault> {
        for entry in self.entries.chunks_exact(12) {
            let (kind, count) = (self.file.number(3, &entry[2..4]), self.file.number(4, &entry[4..8]));
            let (kind, count) = (kind.unwrap_or_default(), count.unwrap_or_default());
            // Rationals and doubles take eight bytes; kinds that are not known count as bytes.
            let size = match kind {
                3 | 8 => 2,
                4 | 9 | 11 | 13 => 4,
                5 | 10 | 12 => 8,
                _ => 1,
            };
            if count * size > self.file.bytes.len() as u64 {
                return Err(Fault::damaged(format!("a tag with {count} values of {size} bytes in a smaller file")));
            }
        }
        Ok(())
    }

    pub(super) fn has(&self, tag: u16) -> bool {
        self.entry(tag).is_some()
    }

    /// The first of the numbers of a tag.
    pub(super) fn number(&self, tag: u16) -> Option<u64> {
        self.numbers(tag).next()
    }

    /// The numbers of a tag, bytes, shorts or longs; none where it is not there, is of another type or lies outside of the file.
    pub(super) fn numbers(&self, tag: u16) -> impl Iterator<Item = u64> + use<'a> {
        let file = self.file;
        self.entries_of(tag).take(1).flat_map(move |entry| file.numbers_of(entry))
    }

    /// The numbers of a tag, of every entry that has it: a decoder may take the last.
    pub(super) fn numbers_of_all(&self, tag: u16) -> impl Iterator<Item = u64> + use<'a> {
        let file = self.file;
        self.entries_of(tag).flat_map(move |entry| file.numbers_of(entry))
    }

    /// The text of a tag, up to its first zero.
    pub(super) fn text(&self, tag: u16) -> Option<String> {
        let (_, values) = self.file.values_of(self.entry(tag)?).filter(|(kind, _)| *kind == 2)?;
        let end = values.iter().position(|byte| *byte == 0).unwrap_or(values.len());
        Some(String::from_utf8_lossy(&values[..end]).trim().to_owned())
    }

    fn entry(&self, tag: u16) -> Option<&'a [u8]> {
        self.entries_of(tag).next()
    }

    fn entries_of(&self, tag: u16) -> impl Iterator<Item = &'a [u8]> + use<'a> {
        let file = self.file;
        self.entries.chunks_exact(12).filter(move |entry| file.number(3, &entry[..2]) == Some(tag.into()))
    }
}

/// 0 for types that no tag here has.
fn size_of_type(kind: u16) -> usize {
    match kind {
        1 | 2 => 1,
        3 => 2,
        4 | 13 => 4,
        _ => 0,
    }
}

impl<'a> Bytes<'a> {
    /// Type and bytes of the values of an entry.
    fn values_of(&self, entry: &'a [u8]) -> Option<(u16, &'a [u8])> {
        let kind = self.number(3, &entry[2..4])? as u16;
        let count = self.number(4, &entry[4..8])? as usize;
        let length = count.checked_mul(size_of_type(kind))?;
        if length <= 4 {
            return Some((kind, &entry[8..8 + length]));
        }
        let offset = self.number(4, &entry[8..12])? as usize;
        Some((kind, self.bytes.get(offset..)?.get(..length)?))
    }

    /// The numbers of an entry, bytes, shorts or longs; none if they are of another type or lie outside of the file.
    fn numbers_of(self, entry: &'a [u8]) -> impl Iterator<Item = u64> + use<'a> {
        let (kind, values) = self.values_of(entry).unwrap_or_default();
        values.chunks_exact(size_of_type(kind).max(1)).filter_map(move |value| self.number(kind, value))
    }

    fn u16(&self, at: usize) -> Option<u16> {
        self.number(3, self.bytes.get(at..)?.get(..2)?).map(|value| value as u16)
    }

    fn u32(&self, at: usize) -> Option<u32> {
        self.number(4, self.bytes.get(at..)?.get(..4)?).map(|value| value as u32)
    }

    fn number(&self, kind: u16, value: &[u8]) -> Option<u64> {
        let mut number = 0;
        for index in 0..value.len() {
            let byte = if self.little_endian { value[value.len() - 1 - index] } else { value[index] };
            number = number << 8 | u64::from(byte);
        }
        matches!((kind, value.len()), (1, 1) | (3, 2) | (4 | 13, 4)).then_some(number)
    }
}
