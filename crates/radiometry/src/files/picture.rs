//! Reading: which format the content is, what it held, and whether every sample is a number.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;

use super::camera_raw::{RawKind, RawPhotograph, decode_raw};
use super::{FileError, exr_read, jpeg, raster, rgbe};
use crate::{Counts, Image, Linear, Linearity, srgb_decode};

/// What a picture file held. What the numbers mean, the caller says.
#[derive(Clone, Debug, PartialEq)]
pub enum Picture {
    /// Integers as stored: PNG, JPEG, integer TIFF; of camera RAW those of [`RawPhotograph::image`].
    Integer {
        /// 0 … 255 or 0 … 65535, not scaled from one to the other.
        image: Image<Counts>,
        /// 8 or 16: the range. Grey of 1, 2 or 4 bits was stretched to 8.
        bits: u8,
    },
    /// Finite linear samples: OpenEXR, Radiance HDR, float TIFF.
    Float(Image<Linear>),
}

impl Picture {
    /// Linear samples: floats as they are, integers as fractions of their largest code, decoded from sRGB if `srgb`.
    pub fn into_linear(self, srgb: bool) -> Image<Linear> {
        match self {
            Self::Float(image) => image,
            Self::Integer { image, bits } => {
                let white = f64::from((1u32 << bits) - 1);
                let decode = |code: u16| {
                    let fraction = f64::from(code) / white;
                    (if srgb { srgb_decode(fraction) } else { fraction }) as f32
                };
                let pixels = image.pixels().iter().map(|pixel| pixel.map(decode)).collect();
                Image::from_pixels(image.width(), image.height(), pixels)
            }
        }
    }

    /// `(width, height)`.
    pub fn size(&self) -> (usize, usize) {
        match self {
            Self::Integer { image, .. } => image.size(),
            Self::Float(image) => image.size(),
        }
    }

    /// For messages: "8-bit picture of 144 × 96".
    pub fn describe(&self) -> String {
        let (width, height) = self.size();
        match self {
            Self::Integer { bits, .. } => format!("{bits}-bit picture of {width} × {height}"),
            Self::Float(_) => format!("floating-point picture of {width} × {height}"),
        }
    }
}

/// Reads a picture file of any known format.
///
/// # Errors
/// See [`FileError`]; a missing or unreadable file is [`FileError::Read`], bad content one of the others.
pub fn read_picture(path: &Path) -> Result<Picture, FileError> {
    decode_picture(path, &read_known(path)?)
}

/// Reads a file if it begins like a picture, else its first bytes.
fn read_known(path: &Path) -> Result<Vec<u8>, FileError> {
    let failed = |source| FileError::Read { path: path.to_path_buf(), source };
    // Looked at before it is opened: opening a pipe would wait for its writer.
    if !fs::metadata(path).map_err(failed)?.is_file() {
        return Err(failed(io::Error::other("not a regular file")));
    }
    let mut file = File::open(path).map_err(failed)?;

    // The first bytes decide: a film or a disk image is refused without being loaded.
    let mut bytes = Vec::new();
    file.by_ref().take(Format::LONGEST_MAGIC as u64).read_to_end(&mut bytes).map_err(failed)?;
    if Format::of(&bytes).is_some() {
        file.read_to_end(&mut bytes).map_err(failed)?;
    }
    Ok(bytes)
}

/// A picture, or a camera's RAW with what it says of itself.
#[derive(Clone, Debug, PartialEq)]
pub enum Photograph {
    /// A file that holds a picture.
    Picture(Picture),
    /// A camera's RAW.
    Raw(RawPhotograph),
}

/// Reads a picture file of any known format; what a camera's RAW says of its levels is kept.
///
/// # Errors
/// As [`read_picture`].
pub fn read_photograph(path: &Path) -> Result<Photograph, FileError> {
    decode_photograph(path, &read_known(path)?)
}

/// Decodes the content of a picture file; `path_for_messages` is not opened.
///
/// # Errors
/// As [`decode_picture`].
pub fn decode_photograph(path_for_messages: &Path, bytes: &[u8]) -> Result<Photograph, FileError> {
    match RawKind::of(bytes) {
        Some(kind) => decode_raw(kind, bytes)
            .map(Photograph::Raw)
            .map_err(|fault| fault.at(path_for_messages, Format::CameraRaw(kind))),
        None => decode_picture(path_for_messages, bytes).map(Photograph::Picture),
    }
}

/// Decodes the content of a picture file; `path_for_messages` is not opened.
///
/// # Errors
/// See [`FileError`]; never [`FileError::Read`] or [`FileError::Write`].
pub fn decode_picture(path_for_messages: &Path, bytes: &[u8]) -> Result<Picture, FileError> {
    let path = path_for_messages;
    let Some(format) = Format::of(bytes) else {
        return Err(FileError::Unrecognised { path: path.to_path_buf(), start: beginning(bytes) });
    };
    let format = RawKind::of(bytes).map_or(format, Format::CameraRaw);
    let decoded = match format {
        Format::OpenExr => exr_read::decode(bytes).map(Picture::Float),
        Format::RadianceHdr => rgbe::decode(bytes).map(Picture::Float),
        Format::Png => raster::decode_png(bytes),
        Format::Tiff => raster::decode_tiff(bytes),
        Format::Jpeg => jpeg::decode(bytes),
        Format::CameraRaw(kind) => decode_raw(kind, bytes).map(|raw| Picture::Integer { image: raw.image, bits: 16 }),
    };
    let picture = decoded.map_err(|fault| fault.at(path, format))?;
    if let Picture::Float(image) = &picture {
        check_finite(path, image)?;
    }
    Ok(picture)
}

/// Reads a picture of linear floating-point samples: OpenEXR, Radiance HDR or float TIFF.
///
/// # Errors
/// [`FileError::NotLinear`] for an integer picture; otherwise as [`read_picture`].
pub fn read_linear(path: &Path) -> Result<Image<Linear>, FileError> {
    match read_picture(path)? {
        Picture::Float(image) => Ok(image),
        integer @ Picture::Integer { .. } => {
            Err(FileError::NotLinear { path: path.to_path_buf(), found: integer.describe() })
        }
    }
}

/// The door to and from float files: no NaN, no infinity.
pub(super) fn check_finite<Q: Linearity>(path: &Path, image: &Image<Q>) -> Result<(), FileError> {
    let samples = image.pixels().as_flattened();
    let Some(first) = samples.iter().position(|sample| !sample.is_finite()) else { return Ok(()) };
    let count = samples[first..].iter().filter(|sample| !sample.is_finite()).count();
    let (x, y, channel) = place(first, image.width());
    Err(FileError::NotFinite { path: path.to_path_buf(), x, y, channel, count })
}

/// Column, row and channel of the sample with this index.
pub(super) fn place(sample: usize, width: usize) -> (usize, usize, char) {
    (sample / 3 % width, sample / 3 / width, ['R', 'G', 'B'][sample % 3])
}

/// How a content that is no picture begins.
fn beginning(bytes: &[u8]) -> String {
    if bytes.is_empty() {
        return "an empty file".to_owned();
    }
    let codes: Vec<_> = bytes.iter().take(8).map(|byte| format!("{byte:02x}")).collect();
    format!("a file that begins with the bytes {}", codes.join(" "))
}

/// The formats that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    OpenExr,
    RadianceHdr,
    Png,
    Tiff,
    Jpeg,
    CameraRaw(RawKind),
}

impl Format {
    const LONGEST_MAGIC: usize = 16;

    /// Tells the format by its first bytes.
    pub(super) fn of(bytes: &[u8]) -> Option<Self> {
        const MAGICS: [(&[u8], Format); 9] = [
            (b"\x76\x2f\x31\x01", Format::OpenExr),
            (b"#?RADIANCE", Format::RadianceHdr),
            (b"#?RGBE", Format::RadianceHdr),
            (b"\x89PNG\r\n\x1a\n", Format::Png),
            (b"II\x2a\0", Format::Tiff),
            (b"MM\0\x2a", Format::Tiff),
            (b"II\x2b\0", Format::Tiff), // BigTIFF
            (b"MM\0\x2b", Format::Tiff),
            (b"\xff\xd8\xff", Format::Jpeg),
        ];
        if bytes.get(4..12) == Some(b"ftypcrx ") {
            return Some(Format::CameraRaw(RawKind::Cr3));
        }
        MAGICS.into_iter().find_map(|(magic, format)| bytes.starts_with(magic).then_some(format))
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::OpenExr => "OpenEXR",
            Self::RadianceHdr => "Radiance HDR",
            Self::Png => "PNG",
            Self::Tiff => "TIFF",
            Self::Jpeg => "JPEG",
            Self::CameraRaw(kind) => kind.name(),
        }
    }
}
