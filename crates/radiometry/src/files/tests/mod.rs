//! Claims about files: what is written comes back, what others write is understood, what is broken is refused.

mod camera_raw;
mod exif;
mod hostile;
mod integer_formats;
mod limits;
mod openexr;
mod radiance;
mod real;
mod round_trips;
mod samples;
mod tiff_tags;

use std::path::Path;

use super::{FileError, Picture, decode_picture};
use crate::{Counts, Image, Linear};

fn decode(bytes: &[u8]) -> Result<Picture, FileError> {
    decode_picture(Path::new("in/test"), bytes)
}

fn decode_float(bytes: &[u8]) -> Image<Linear> {
    match decode(bytes) {
        Ok(Picture::Float(image)) => image,
        other => panic!("a float picture was expected, not {other:?}"),
    }
}

fn decode_counts(bytes: &[u8], expected_bits: u8) -> Image<Counts> {
    match decode(bytes) {
        Ok(Picture::Integer { image, bits }) if bits == expected_bits => image,
        other => panic!("a {expected_bits}-bit picture was expected, not {other:?}"),
    }
}

/// Samples of both signs and many magnitudes, all of which fit a half.
fn spread(width: usize, height: usize) -> Image<Linear> {
    let sample = |index: usize| ((index % 997) as f32 - 20.5) * 1.618_f32.powi((index % 17) as i32 - 8);
    let pixels = (0..width * height).map(|pixel| [0, 1, 2].map(|channel| sample(3 * pixel + channel)));
    Image::from_pixels(width, height, pixels.collect())
}
