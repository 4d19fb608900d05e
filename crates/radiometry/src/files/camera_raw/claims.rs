//! What a RAW file claims, before a decoder believes it: rawler allocates what the tags of directories, the JPEG frames in
//! strips and tiles, and the boxes of a CR3 say, and asked for 30 GB on a damaged file.
//!
//! A sample of a lossless JPEG takes at least a bit, whatever else is decoded at least 1/512 of a byte. So every claim is held
//! against the length of the file, and a photograph against the largest that is read.

use super::RawKind;
use super::tiff_directories::{Directory, begins_like_tiff, directories_of_decoder};
use crate::files::MAX_PIXELS;
use crate::files::error::{Fault, check_size};

const WIDTH: u16 = 0x0100;
const HEIGHT: u16 = 0x0101;
const STRIP_OFFSETS: u16 = 0x0111;
const SAMPLES_PER_PIXEL: u16 = 0x0115;
const TILE_WIDTH: u16 = 0x0142;
const TILE_HEIGHT: u16 = 0x0143;
const TILE_OFFSETS: u16 = 0x0144;

/// Samples that a byte of a compressed picture may stand for.
const SAMPLES_PER_BYTE: u64 = 512;
/// Of a lossless JPEG.
const LOSSLESS_SAMPLES_PER_BYTE: u64 = 8;

/// Refuses a file that claims more than it can hold.
pub(super) fn check(kind: RawKind, bytes: &[u8]) -> Result<(), Fault> {
    match kind {
        RawKind::Cr3 => check_cr3(bytes),
        _ => check_directories(bytes),
    }
}

fn check_directories(bytes: &[u8]) -> Result<(), Fault> {
    for directory in directories_of_decoder(bytes)? {
        directory.check_lengths()?;
        // Notes of a maker that are no directory are left to the decoder, which drops them.
        if let Some(Ok(notes)) = directory.maker_notes() {
            notes.check_lengths()?;
        }
        check_directory(&directory, bytes)?;
    }
    Ok(())
}

fn check_directory(directory: &Directory<'_>, bytes: &[u8]) -> Result<(), Fault> {
    let largest = |tag: u16| directory.numbers_of_all(tag).max();
    let samples = largest(SAMPLES_PER_PIXEL).unwrap_or(1).max(1);
    for (width, height) in [(WIDTH, HEIGHT), (TILE_WIDTH, TILE_HEIGHT)] {
        if let (Some(width), Some(height)) = (largest(width), largest(height)) {
            check_claim(width, height, samples, bytes.len(), SAMPLES_PER_BYTE)?;
        }
    }
    // A tile may reach over the edges of its picture, but not far.
    if let (Some(width), Some(tile)) = (largest(WIDTH), largest(TILE_WIDTH))
        && tile > 2 * width + 1024
    {
        return Err(Fault::damaged(format!("a tile of {tile} pixels a row in a picture of {width}")));
    }
    for tag in [STRIP_OFFSETS, TILE_OFFSETS] {
        for offset in directory.numbers_of_all(tag) {
            check_jpeg(bytes.get(offset as usize..).unwrap_or_default())?;
        }
    }
    Ok(())
}

/// The frame header of a JPEG, if `bytes` begin like one (ITU T.81, annex B).
fn check_jpeg(bytes: &[u8]) -> Result<(), Fault> {
    let Some(mut rest) = bytes.strip_prefix(b"\xff\xd8") else { return Ok(()) };
    while let [0xff, marker, high, low, ..] = *rest {
        let length = usize::from(u16::from_be_bytes([high, low]));
        // Frame headers are C0 … CF, but for C4, C8 and CC; C3 is lossless.
        if let (0xc0..=0xcf, false) = (marker, matches!(marker, 0xc4 | 0xc8 | 0xcc)) {
            let Some(&[_, y1, y0, x1, x0, components]) = rest.get(4..10) else { return Err(Fault::early_end()) };
            let (width, height) = (u16::from_be_bytes([x1, x0]), u16::from_be_bytes([y1, y0]));
            let per_byte = if marker == 0xc3 { LOSSLESS_SAMPLES_PER_BYTE } else { SAMPLES_PER_BYTE };
            return check_claim(width.into(), height.into(), components.max(1).into(), bytes.len(), per_byte);
        }
        if marker == 0xda {
            return Ok(());
        }
        rest = rest.get(2 + length..).unwrap_or_default();
    }
    Ok(())
}

/// What stands in the outermost boxes of a CR3 beside the samples themselves (ISO/IEC 14496-12, §4.2).
fn check_cr3(bytes: &[u8]) -> Result<(), Fault> {
    let mut rest = bytes;
    while let Some((size, name)) = rest.first_chunk::<4>().zip(rest.get(4..8)) {
        let size = match u32::from_be_bytes(*size) as usize {
            // To the end of the file.
            0 => rest.len(),
            // A size of 64 bits follows; only samples are so large.
            1 => {
                let large = rest.get(8..).and_then(|rest| rest.first_chunk::<8>()).ok_or_else(Fault::early_end)?;
                usize::try_from(u64::from_be_bytes(*large)).unwrap_or(usize::MAX)
            }
            size => size,
        };
        let (content, after) = rest.split_at_checked(size.max(8)).unwrap_or((rest, &[]));
        if name != b"mdat" {
            check_boxes(content)?;
        }
        rest = after;
    }
    Ok(())
}

/// The boxes of a CR3 whose claims are allocated, wherever their names stand: size of the picture and of its tiles (CMP1),
/// directories of tags (CMT1 … CMT4), numbers of samples.
fn check_boxes(bytes: &[u8]) -> Result<(), Fault> {
    for (at, name) in bytes.windows(4).enumerate() {
        let number = |from_name: usize| {
            let value = bytes.get(at + from_name..)?.first_chunk::<4>()?;
            Some(u64::from(u32::from_be_bytes(*value)))
        };
        let no_more_than_bytes = |claims: &[Option<u64>]| match claims.iter().flatten().max() {
            Some(claim) if *claim > bytes.len() as u64 => Err(Fault::damaged(format!("a box claims {claim} entries"))),
            _ => Ok(()),
        };
        match name {
            b"CMP1" => {
                for (width, height) in [(12, 16), (20, 24)] {
                    let (Some(width), Some(height)) = (number(width), number(height)) else {
                        return Err(Fault::early_end());
                    };
                    check_claim(width, height, 1, bytes.len(), SAMPLES_PER_BYTE)?;
                }
            }
            b"CMT1" | b"CMT2" | b"CMT3" | b"CMT4" | b"CNOP" => {
                let size = at.checked_sub(4).and_then(|at| bytes.get(at..)?.first_chunk::<4>());
                no_more_than_bytes(&[size.map(|size| u32::from_be_bytes(*size).into())])?;
                let tags = bytes.get(at + 4..).unwrap_or_default();
                if begins_like_tiff(tags) {
                    check_directories(tags)?;
                }
            }
            b"stts" | b"stsc" | b"co64" => no_more_than_bytes(&[number(8)])?,
            b"stsz" => no_more_than_bytes(&[number(12)])?,
            b"CTMD" => no_more_than_bytes(&[number(12)])?,
            _ => {}
        }
    }
    Ok(())
}

fn check_claim(width: u64, height: u64, samples: u64, length: usize, per_byte: u64) -> Result<(), Fault> {
    check_size(width, height)?;
    let all = width * height;
    match all.checked_mul(samples) {
        Some(all) if all / per_byte <= length as u64 && all <= 4 * MAX_PIXELS as u64 => Ok(()),
        _ => Err(Fault::damaged(format!("too short for {width} × {height} pixels of {samples} samples"))),
    }
}
