//! OpenEXR out: scan lines, ZIP in blocks of 16 rows, channels R G B.

use std::io::{self, Cursor, Write};
use std::path::Path;

use exr::image::write::WritableImage;
use exr::image::{Encoding, IntoSample, SpecificChannels};
use exr::math::Vec2;
use exr::meta::MetaData;
use exr::meta::header::standard_names;
use half::f16;

use super::picture::{check_finite, place};
use super::{FileError, write_atomically};
use crate::{Image, Linearity};

/// The sample type of an OpenEXR file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExrSample {
    /// 16 bits: relative error up to 2⁻¹¹, values up to 65504.
    Half,
    /// 32 bits: exactly what the picture holds.
    Float,
}

/// Below this a picture is packed by the calling thread: starting threads would take longer.
const PARALLEL_PIXELS: usize = 1 << 18;

/// Standard attributes that are texts on which nothing in the format depends.
const FREE_STANDARD_NAMES: [&str; 4] = ["owner", "comments", "capDate", "software"];

/// Writes a linear picture as OpenEXR, with text `attributes` (name, UTF-8 text) in its header.
///
/// The same picture and attributes give the same bytes.
///
/// # Errors
/// [`FileError::NotFinite`] for NaN and infinity, [`FileError::OutOfRange`] for what does not fit a half,
/// [`FileError::Write`] for attribute names that are empty, repeated, longer than 31 bytes or kept by OpenEXR for
/// itself, for a picture without pixels, and for what the operating system says.
pub fn write_exr<Q: Linearity>(
    path: &Path,
    image: &Image<Q>,
    sample: ExrSample,
    attributes: &[(&str, &str)],
) -> Result<(), FileError> {
    check_finite(path, image)?;
    if sample == ExrSample::Half {
        check_halves(path, image)?;
    }
    let failed = |source| FileError::Write { path: path.to_path_buf(), source };
    let attributes = attribute_bytes(attributes).map_err(failed)?;
    let encoded = encode(image, sample).map_err(failed)?;
    write_atomically(path, |out| write_with_attributes(out, &encoded, &attributes))
}

fn check_halves<Q: Linearity>(path: &Path, image: &Image<Q>) -> Result<(), FileError> {
    let samples = image.pixels().as_flattened();
    let Some(first) = samples.iter().position(|sample| !f16::from_f32(*sample).is_finite()) else { return Ok(()) };
    let (x, y, channel) = place(first, image.width());
    let (value, limit) = (samples[first], f16::MAX.to_f32());
    Err(FileError::OutOfRange { path: path.to_path_buf(), x, y, channel, value, format: "a half", limit })
}

/// The whole file, but for attributes of our own.
fn encode<Q: Linearity>(image: &Image<Q>, sample: ExrSample) -> io::Result<Vec<u8>> {
    let (width, height) = image.size();
    if width == 0 || height == 0 {
        return Err(invalid(format!("a picture of {width} × {height} has no pixels")));
    }
    match sample {
        ExrSample::Half => pack(image.size(), |Vec2(x, y)| image.pixel(x, y).map(f16::from_f32).into()),
        ExrSample::Float => pack(image.size(), |Vec2(x, y)| image.pixel(x, y).into()),
    }
}

fn pack<S: IntoSample>(size: (usize, usize), pixel: impl Fn(Vec2<usize>) -> (S, S, S) + Sync) -> io::Result<Vec<u8>> {
    let mut bytes = Cursor::new(Vec::new());
    let channels = SpecificChannels::rgb(pixel);
    let picture = exr::image::Image::from_encoded_channels(size, Encoding::SMALL_LOSSLESS, channels);
    let packed = if size.0 * size.1 < PARALLEL_PIXELS {
        picture.write().non_parallel().to_buffered(&mut bytes)
    } else {
        picture.write().to_buffered(&mut bytes)
    };
    packed.map_err(other)?;
    Ok(bytes.into_inner())
}

/// The attributes as they stand in a header: `name\0 string\0 size text`.
fn attribute_bytes(attributes: &[(&str, &str)]) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    for (index, (name, text)) in attributes.iter().enumerate() {
        let reserved = standard_names::ALL.contains(&name.as_bytes()) && !FREE_STANDARD_NAMES.contains(name);
        let repeated = attributes[..index].iter().any(|(earlier, _)| earlier == name);
        let short = (1..=31).contains(&name.len()) && !name.contains('\0');
        if reserved || repeated || !short {
            let rule = "a name of 1 to 31 bytes, used once and not kept by OpenEXR for itself, was expected";
            return Err(invalid(format!("attribute `{}`: {rule}", name.escape_debug())));
        }
        let size = i32::try_from(text.len()).map_err(|_| invalid(format!("attribute `{name}`: text over 2 GiB")))?;
        bytes.extend_from_slice(name.as_bytes());
        bytes.extend_from_slice(b"\0string\0");
        bytes.extend_from_slice(&size.to_le_bytes());
        bytes.extend_from_slice(text.as_bytes());
    }
    Ok(bytes)
}

/// Writes the file `encoded` with more attributes at the end of its header.
///
/// The exr crate keeps attributes in a hash map and writes them in another order every time; put in here, they stand in
/// the order given. What follows the header moves by their length, so every offset in the table grows by it.
fn write_with_attributes(out: &mut impl Write, encoded: &[u8], attributes: &[u8]) -> io::Result<()> {
    let mut cursor = Cursor::new(encoded);
    let meta = MetaData::read_from_buffered(&mut cursor, true).map_err(other)?;
    let table = usize::try_from(cursor.position()).map_err(io::Error::other)?;
    let blocks = table + 8 * meta.headers[0].chunk_count;

    out.write_all(&encoded[..table - 1])?;
    out.write_all(attributes)?;
    out.write_all(b"\0")?; // the end of the header
    for entry in encoded[table..blocks].as_chunks::<8>().0 {
        let offset = u64::from_le_bytes(*entry) + attributes.len() as u64;
        out.write_all(&offset.to_le_bytes())?;
    }
    out.write_all(&encoded[blocks..])
}

fn other(error: exr::error::Error) -> io::Error {
    match error {
        exr::error::Error::Io(source) => source,
        error => io::Error::other(error.to_string()),
    }
}

fn invalid(reason: String) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, reason)
}
