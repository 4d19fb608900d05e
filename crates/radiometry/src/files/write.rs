//! PNG and TIFF out: display codes for eyes, counts for tests and for other programs.

use std::io::{self, Cursor, Write};
use std::path::Path;

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::codecs::tiff::TiffEncoder;
use image::error::ImageError;
use image::{ExtendedColorType, ImageEncoder};

use super::{FileError, write_atomically};
use crate::{Counts, Encoded, Image};

/// Writes display codes as 8-bit PNG: to the nearest of 256 steps, clamped to 0 … 1, NaN as 0.
///
/// # Errors
/// [`FileError::Write`], also for a picture without pixels.
pub fn write_png8(path: &Path, image: &Image<Encoded>) -> Result<(), FileError> {
    let samples: Vec<u8> = samples(image).map(|code| (code.clamp(0.0, 1.0) * 255.0).round() as u8).collect();
    write_atomically(path, |out| encode_png(out, image.size(), &samples, ExtendedColorType::Rgb8))
}

/// Writes display codes as 16-bit PNG: to the nearest of 65536 steps, clamped to 0 … 1, NaN as 0.
///
/// # Errors
/// [`FileError::Write`], also for a picture without pixels.
pub fn write_png16(path: &Path, image: &Image<Encoded>) -> Result<(), FileError> {
    let samples = sixteen_bits(image);
    write_atomically(path, |out| encode_png(out, image.size(), &samples, ExtendedColorType::Rgb16))
}

/// Writes display codes as 16-bit TIFF without compression: to the nearest of 65536 steps, clamped to 0 … 1, NaN as 0.
///
/// # Errors
/// [`FileError::Write`], also for a picture without pixels.
pub fn write_tiff16(path: &Path, image: &Image<Encoded>) -> Result<(), FileError> {
    let samples = sixteen_bits(image);
    write_atomically(path, |out| {
        let (width, height) = size_of_file(image.size())?;
        TiffEncoder::new(out).write_image(&samples, width, height, ExtendedColorType::Rgb16).map_err(io_error)
    })
}

/// Writes counts as PNG: as bytes for `bits` up to 8, counts above 255 as 255; otherwise with 16 bits.
///
/// # Errors
/// [`FileError::Write`], also for a picture without pixels.
pub fn write_png_counts(path: &Path, image: &Image<Counts>, bits: u8) -> Result<(), FileError> {
    write_atomically(path, |out| encode_counts(out, image, bits))
}

/// The content of the file that [`write_png_counts`] writes.
///
/// # Panics
/// If the picture has no pixels: there is no such PNG.
pub fn encode_png_counts(image: &Image<Counts>, bits: u8) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    if let Err(error) = encode_counts(&mut bytes, image, bits) {
        panic!("a PNG of {:?} pixels: {error}", image.size());
    }
    bytes.into_inner()
}

fn encode_counts(out: &mut impl Write, image: &Image<Counts>, bits: u8) -> io::Result<()> {
    let counts = image.pixels().as_flattened().iter();
    if bits <= 8 {
        let samples: Vec<u8> = counts.map(|count| u8::try_from(*count).unwrap_or(u8::MAX)).collect();
        encode_png(out, image.size(), &samples, ExtendedColorType::Rgb8)
    } else {
        let samples: Vec<u8> = counts.flat_map(|count| count.to_ne_bytes()).collect();
        encode_png(out, image.size(), &samples, ExtendedColorType::Rgb16)
    }
}

fn encode_png(out: &mut impl Write, size: (usize, usize), samples: &[u8], kind: ExtendedColorType) -> io::Result<()> {
    let (width, height) = size_of_file(size)?;
    // "Fast" packs 16-bit pictures some eighteen times faster than the default, and hardly worse.
    let encoder = PngEncoder::new_with_quality(out, CompressionType::Fast, FilterType::Adaptive);
    encoder.write_image(samples, width, height, kind).map_err(io_error)
}

fn samples(image: &Image<Encoded>) -> impl Iterator<Item = f32> {
    image.pixels().as_flattened().iter().copied()
}

/// In the byte order of this machine, as the encoders want it.
fn sixteen_bits(image: &Image<Encoded>) -> Vec<u8> {
    let codes = samples(image).map(|code| (code.clamp(0.0, 1.0) * 65535.0).round() as u16);
    codes.flat_map(u16::to_ne_bytes).collect()
}

fn size_of_file((width, height): (usize, usize)) -> io::Result<(u32, u32)> {
    match (u32::try_from(width), u32::try_from(height)) {
        (Ok(width @ 1..), Ok(height @ 1..)) => Ok((width, height)),
        _ => Err(io::Error::new(io::ErrorKind::InvalidInput, format!("a picture of {width} × {height} pixels"))),
    }
}

fn io_error(error: ImageError) -> io::Error {
    match error {
        ImageError::IoError(source) => source,
        other => io::Error::other(other),
    }
}
