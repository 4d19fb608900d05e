//! The text attributes in the header of an OpenEXR file, without a look at its pixels.
//!
//! A header is a row of attributes, each `name\0 type\0 size value`, ended by an empty name ("OpenEXR File Layout",
//! section Header). It is walked here byte by byte, so that a wrong size costs a seek and not an allocation.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

use super::FileError;
use super::error::Fault;
use super::picture::Format;

/// Longest attribute name of the format, with its end.
const LONGEST_NAME: u64 = 256;
/// Longest text that is read: a manifest fits, a mistaken size does not.
const LONGEST_TEXT: u64 = 1 << 26;

/// The text attribute `name` in the first part of an OpenEXR file, `None` where there is no text of this name.
///
/// # Errors
/// [`FileError::Read`], or [`FileError::Damaged`] where the header cannot be followed up to the attribute.
pub fn read_exr_attribute(path: &Path, name: &str) -> Result<Option<String>, FileError> {
    let found = File::open(path).and_then(|file| find_text(&mut BufReader::new(file), name));
    found.map_err(|source| match source.kind() {
        io::ErrorKind::UnexpectedEof => Fault::early_end().at(path, Format::OpenExr),
        io::ErrorKind::InvalidData => Fault::damaged(source.to_string()).at(path, Format::OpenExr),
        _ => FileError::Read { path: path.to_path_buf(), source },
    })
}

fn find_text(input: &mut impl BufRead, wanted: &str) -> io::Result<Option<String>> {
    let mut start = [0; 8];
    input.read_exact(&mut start)?;
    if Format::of(&start) != Some(Format::OpenExr) {
        return Err(invalid("it does not begin as one"));
    }
    loop {
        let name = until_nul(input)?;
        if name.is_empty() {
            return Ok(None);
        }
        let kind = until_nul(input)?;
        let mut size = [0; 4];
        input.read_exact(&mut size)?;
        let size = u64::from(u32::from_le_bytes(size));
        let mut value = input.by_ref().take(size);
        if name == wanted.as_bytes() && kind == b"string" {
            if size > LONGEST_TEXT {
                return Err(invalid("a text attribute of absurd length"));
            }
            let mut text = Vec::new();
            if value.read_to_end(&mut text)? as u64 != size {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
            return Ok(Some(String::from_utf8_lossy(&text).into_owned()));
        }
        if io::copy(&mut value, &mut io::sink())? != size {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
    }
}

fn until_nul(input: &mut impl BufRead) -> io::Result<Vec<u8>> {
    let mut name = Vec::new();
    input.by_ref().take(LONGEST_NAME).read_until(0, &mut name)?;
    match name.pop() {
        Some(0) => Ok(name),
        Some(_) if name.len() as u64 + 1 == LONGEST_NAME => Err(invalid("an attribute name without end")),
        _ => Err(io::ErrorKind::UnexpectedEof.into()),
    }
}

fn invalid(reason: &'static str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, reason)
}
