//! JPEG in: the decoder of the image crate, after a walk that finds the end of the picture.
//!
//! The decoder forgives a file that was cut off and paints what is missing grey. A half-copied photograph must not pass
//! for a photograph, so the markers are followed first, up to the end of the image (ITU T.81, annex B). What a flipped
//! bit does between them nobody can see: JPEG has no checksum.

use std::io::Cursor;

use image::codecs::jpeg::JpegDecoder;

use super::Picture;
use super::error::{Fault, check_size};
use super::raster::{fault, limits, picture_of};

pub(super) fn decode(bytes: &[u8]) -> Result<Picture, Fault> {
    let (width, height) = walk(bytes)?;
    check_size(width.into(), height.into())?;
    // A square of 8 × 8 pixels takes a bit at least, or the file is a promise without pixels.
    if u64::from(width) * u64::from(height) / (64 * 8) > bytes.len() as u64 {
        return Err(Fault::damaged(format!("too short for {width} × {height} pixels")));
    }
    picture_of(JpegDecoder::new(Cursor::new(bytes)).map_err(fault)?, limits(width.into(), height.into()))
}

/// Follows the markers to the end of the image; gives the size in the frame header.
fn walk(bytes: &[u8]) -> Result<(u16, u16), Fault> {
    let mut rest = bytes.get(2..).ok_or_else(Fault::early_end)?;
    let mut size = None;
    loop {
        let (marker, after) = next_marker(rest)?;
        rest = after;
        match marker {
            END_OF_IMAGE => return size.ok_or_else(|| Fault::damaged("no frame header")),
            // Restart markers, start of image, TEM: alone, without a segment.
            0xd0..=0xd8 | 0x01 => {}
            _ => {
                let length = rest.first_chunk().map(|length| usize::from(u16::from_be_bytes(*length)));
                let segment = length.and_then(|length| rest.get(..length)).ok_or_else(Fault::early_end)?;
                // Frame headers are C0 … CF, but for C4, C8 and CC.
                if let (0xc0..=0xcf, false) = (marker, matches!(marker, 0xc4 | 0xc8 | 0xcc)) {
                    let &[_, _, _, y1, y0, x1, x0, ..] = segment else {
                        return Err(Fault::damaged("a frame header that is too short"));
                    };
                    size = Some((u16::from_be_bytes([x1, x0]), u16::from_be_bytes([y1, y0])));
                }
                rest = &rest[segment.len()..];
            }
        }
    }
}

const END_OF_IMAGE: u8 = 0xd9;

/// Skips coded samples, in which FF is followed by 00, and fill bytes FF.
fn next_marker(bytes: &[u8]) -> Result<(u8, &[u8]), Fault> {
    let marker = bytes.windows(2).position(|pair| pair[0] == 0xff && !matches!(pair[1], 0x00 | 0xff));
    let at = marker.ok_or_else(|| Fault::damaged("unexpected end of file: no end-of-image marker"))?;
    Ok((bytes[at + 1], &bytes[at + 2..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_end_of_a_thumbnail_is_not_the_end_of_the_picture() {
        let mut bytes = vec![0xff, 0xd8];
        bytes.extend([0xff, 0xe1, 0, 6, 0xff, 0xd8, 0xff, 0xd9]); // APP1 with a thumbnail
        bytes.extend([0xff, 0xc0, 0, 8, 8, 0, 3, 0, 5, 0]); // frame of 5 × 3
        bytes.extend([0xff, 0xda, 0, 2, 1, 2, 0xff, 0, 3, 0xff, 0xd0, 4]); // scan with a stuffed FF and a restart
        assert!(matches!(walk(&bytes), Err(Fault::Damaged(reason)) if reason.contains("end-of-image")));
        bytes.extend([0xff, 0xd9]);
        assert_eq!(walk(&bytes), Ok((5, 3)));
    }

    #[test]
    fn a_segment_past_the_end_is_an_early_end() {
        assert_eq!(walk(&[0xff, 0xd8, 0xff, 0xe0, 0xff, 0xff, 0]), Err(Fault::early_end()));
    }
}
