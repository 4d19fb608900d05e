//! PNG and TIFF in, by the decoders of the image crate, under limits that follow from the announced size.

use std::io::Cursor;

use image::codecs::png::PngDecoder;
use image::codecs::tiff::TiffDecoder;
use image::error::ImageError;
use image::{DynamicImage, ImageDecoder, Limits};

use super::Picture;
use super::error::{Fault, check_size};
use crate::{Counts, Image};

/// Memory a decoder may take beside the pixels: row buffers, tables, colour profiles.
const SPARE_BYTES: u64 = 1 << 26;

pub(super) fn decode_png(bytes: &[u8]) -> Result<Picture, Fault> {
    // Signature, length and type of the first chunk, then width and height: known before the decoder starts.
    let header = bytes.get(8..24).ok_or_else(Fault::early_end)?;
    let &[_, _, _, _, b'I', b'H', b'D', b'R', w3, w2, w1, w0, h3, h2, h1, h0] = header else {
        return Err(Fault::damaged("its first chunk is not the header"));
    };
    let (width, height) = (u32::from_be_bytes([w3, w2, w1, w0]), u32::from_be_bytes([h3, h2, h1, h0]));
    check_size(width.into(), height.into())?;
    let limits = limits(width.into(), height.into());
    let decoder = PngDecoder::with_limits(Cursor::new(bytes), limits.clone()).map_err(fault)?;
    picture_of(decoder, limits)
}

pub(super) fn decode_tiff(bytes: &[u8]) -> Result<Picture, Fault> {
    // The header is read under the decoder's own limits, far below those for pixels.
    let decoder = TiffDecoder::new(Cursor::new(bytes)).map_err(fault)?;
    let (width, height) = decoder.dimensions();
    check_size(width.into(), height.into())?;
    picture_of(decoder, limits(width.into(), height.into()))
}

/// Room for the picture twice, at the 16 bytes of a pixel with four floats, and something beside.
pub(super) fn limits(width: u64, height: u64) -> Limits {
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(width * height * 32 + SPARE_BYTES);
    limits
}

pub(super) fn picture_of(mut decoder: impl ImageDecoder, limits: Limits) -> Result<Picture, Fault> {
    decoder.set_limits(limits).map_err(fault)?;
    let size = decoder.dimensions();
    let picture = match DynamicImage::from_decoder(decoder).map_err(fault)? {
        DynamicImage::ImageLuma8(image) => integer(size, 8, image.iter().map(|grey| [u16::from(*grey); 3])),
        DynamicImage::ImageLumaA8(image) => {
            integer(size, 8, pixels(&image).map(|[grey, _]: [u8; 2]| [u16::from(grey); 3]))
        }
        DynamicImage::ImageRgb8(image) => integer(size, 8, pixels(&image).map(|rgb: [u8; 3]| rgb.map(u16::from))),
        DynamicImage::ImageRgba8(image) => {
            integer(size, 8, pixels(&image).map(|[r, g, b, _]: [u8; 4]| [r, g, b].map(u16::from)))
        }
        DynamicImage::ImageLuma16(image) => integer(size, 16, image.iter().map(|grey| [*grey; 3])),
        DynamicImage::ImageLumaA16(image) => integer(size, 16, pixels(&image).map(|[grey, _]: [u16; 2]| [grey; 3])),
        DynamicImage::ImageRgb16(image) => integer(size, 16, pixels(&image)),
        DynamicImage::ImageRgba16(image) => integer(size, 16, pixels(&image).map(|[r, g, b, _]: [u16; 4]| [r, g, b])),
        DynamicImage::ImageRgb32F(image) => float(size, pixels(&image)),
        DynamicImage::ImageRgba32F(image) => float(size, pixels(&image).map(|[r, g, b, _]: [f32; 4]| [r, g, b])),
        other => return Err(Fault::unsupported(format!("pixels of kind {:?}", other.color()))),
    };
    Ok(picture)
}

/// The samples in groups of `N`.
fn pixels<T: Copy, const N: usize>(samples: &[T]) -> impl Iterator<Item = [T; N]> {
    samples.as_chunks().0.iter().copied()
}

fn integer((width, height): (u32, u32), bits: u8, pixels: impl Iterator<Item = [u16; 3]>) -> Picture {
    let image = Image::<Counts>::from_pixels(width as usize, height as usize, pixels.collect());
    Picture::Integer { image, bits }
}

fn float((width, height): (u32, u32), pixels: impl Iterator<Item = [f32; 3]>) -> Picture {
    Picture::Float(Image::from_pixels(width as usize, height as usize, pixels.collect()))
}

pub(super) fn fault(error: ImageError) -> Fault {
    match error {
        ImageError::IoError(source) if source.kind() == std::io::ErrorKind::UnexpectedEof => Fault::early_end(),
        ImageError::Unsupported(reason) => Fault::unsupported(reason.to_string()),
        ImageError::Limits(_) => Fault::damaged("it asks for more memory than a picture of its size needs"),
        other => Fault::damaged(other.to_string()),
    }
}
