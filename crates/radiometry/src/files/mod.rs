//! Picture files in and out.
//!
//! A [`Picture`] is what a file held and no more: integers with their depth, or linear floating-point samples. Whether
//! the integers are counts of a camera or display codes, and whether the floats are radiance, only the caller knows.
//! Formats are told by content, never by extension. Samples come as they are stored: no gamma or ICC profile is undone,
//! no EXIF or TIFF rotation applied, no Radiance `EXPOSURE` divided out, alpha is dropped, grey becomes three equal
//! channels.
//!
//! Files come from anywhere, so nothing in them is trusted: a header is believed up to [`MAX_PIXELS`], NaN and infinity
//! are refused, and bytes of any kind give a picture or a [`FileError`], not a panic. Every writer goes through
//! [`write_atomically`], and refuses what the reader would refuse.
//!
//! A camera's RAW is told from the TIFF that it resembles, and decoded where the cargo feature `raw` is on.
//!
//! Not here: deep or chroma-subsampled OpenEXR, XYZE pictures of Radiance.

mod atomic;
mod camera_raw;
mod error;
mod exif;
mod exr_canvas;
mod exr_header;
mod exr_read;
mod exr_write;
mod jpeg;
mod picture;
mod raster;
mod rgbe;
mod write;

#[cfg(test)]
mod tests;

pub use atomic::write_atomically;
pub use camera_raw::{READS_CAMERA_RAW, RawKind, RawLevels, RawPhotograph};
pub use error::FileError;
pub use exif::{ExifExposure, exif_exposure, read_exif_exposure};
pub use exr_header::read_exr_attribute;
pub use exr_write::{ExrSample, write_exr};
use picture::Format;
pub use picture::{Photograph, Picture, decode_photograph, decode_picture, read_linear, read_photograph, read_picture};
pub use rgbe::write_hdr;
pub use write::{encode_png_counts, write_png_counts, write_png8, write_png16, write_tiff16};

/// The largest picture a file may announce: 2²⁸ pixels, 16384 × 16384, which is 3 GiB as [`Image`](crate::Image) of
/// floats. Checked in the header, before pixels are allocated.
pub const MAX_PIXELS: usize = 1 << 28;
