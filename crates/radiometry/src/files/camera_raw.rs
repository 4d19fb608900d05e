//! Photographs as the sensor counted them: CR2, CR3, NEF, ARW and DNG.
//!
//! Telling such a file from a TIFF, whose first bytes it has, is always built: else a preview would pass for the photograph.
//! Decoding is built with the cargo feature `raw`, by the crate rawler, which is LGPL-2.1; without it a RAW file is refused
//! with words that say so.

mod claims;
#[cfg(feature = "raw")]
mod decode;
#[cfg(feature = "raw")]
mod demosaic;
mod tiff_directories;

use super::error::Fault;
use crate::{Counts, Image};
use tiff_directories::{Directory, directories};

/// The kind of a camera's RAW file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RawKind {
    /// Adobe Digital Negative.
    Dng,
    /// Canon, before 2018.
    Cr2,
    /// Canon, since 2018.
    Cr3,
    /// Nikon.
    Nef,
    /// Sony.
    Arw,
    /// A TIFF with samples under a colour filter array, of another maker.
    Other,
}

impl RawKind {
    /// Tells by content whether a file is a camera's RAW; `bytes` is the whole file.
    pub fn of(bytes: &[u8]) -> Option<Self> {
        // The first box of a CR3 is short. Where its size stands other formats have their names, and the decoder takes them so.
        if bytes.get(..3) == Some(&[0; 3]) && bytes.get(4..12) == Some(b"ftypcrx ") {
            return Some(Self::Cr3);
        }
        if !tiff_directories::begins_like_tiff(bytes) || bytes.get(6..14) == Some(b"HEAPCCDR") {
            return None;
        }
        if bytes.get(8..10) == Some(b"CR") {
            return Some(Self::Cr2);
        }
        let directories = directories(bytes).ok()?;
        let first = directories.first()?;
        if first.has(DNG_VERSION) {
            return Some(Self::Dng);
        }
        if !directories.iter().any(holds_sensor_samples) {
            return None;
        }
        let make = first.text(MAKE).unwrap_or_default().to_ascii_uppercase();
        let makers = [("NIKON", Self::Nef), ("SONY", Self::Arw), ("CANON", Self::Cr2)];
        Some(makers.into_iter().find(|(name, _)| make.starts_with(name)).map_or(Self::Other, |(_, kind)| kind))
    }

    /// For messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Dng => "DNG",
            Self::Cr2 => "CR2",
            Self::Cr3 => "CR3",
            Self::Nef => "NEF",
            Self::Arw => "ARW",
            Self::Other => "camera RAW",
        }
    }
}

const MAKE: u16 = 0x010f;
const DNG_VERSION: u16 = 0xc612;
const COMPRESSION: u16 = 0x0103;
const PHOTOMETRIC: u16 = 0x0106;

/// Photometric interpretation "colour filter array" (TIFF/EP), or a compression only cameras use: Sony's and Nikon's.
fn holds_sensor_samples(directory: &Directory<'_>) -> bool {
    directory.number(PHOTOMETRIC) == Some(32803) || matches!(directory.number(COMPRESSION), Some(32767 | 34713))
}

/// Counts without light, and counts at which a pixel is clipped, as a RAW file says them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RawLevels {
    /// Counts without light.
    pub black: u16,
    /// Counts at which a pixel is clipped.
    pub white: u16,
}

/// A camera's RAW, demosaiced and nothing else: the camera's own primaries, no white balance, no curve.
#[derive(Clone, Debug, PartialEq)]
pub struct RawPhotograph {
    /// Counts as stored, shifted so that all sites of the colour filters have one black level. A channel that is interpolated
    /// from a clipped sample is at the white level.
    pub image: Image<Counts>,
    /// Of `image`.
    pub levels: RawLevels,
    /// Factors of red, green and blue that the camera would have applied to make grey grey, green 1; if it says.
    pub white_balance: Option<[f64; 3]>,
}

/// Whether this program was built to decode camera RAW.
pub const READS_CAMERA_RAW: bool = cfg!(feature = "raw");

/// Decodes a RAW file that [`RawKind::of`] knows.
#[cfg(feature = "raw")]
pub(super) fn decode_raw(kind: RawKind, bytes: &[u8]) -> Result<RawPhotograph, Fault> {
    claims::check(kind, bytes)?;
    decode::decode(kind, bytes)
}

/// Says that this program was built without camera RAW.
#[cfg(not(feature = "raw"))]
pub(super) fn decode_raw(kind: RawKind, bytes: &[u8]) -> Result<RawPhotograph, Fault> {
    claims::check(kind, bytes)?;
    Err(Fault::unsupported(
        "this program was built without camera RAW; build it with `cargo build --release -p relumine-cli --features raw` \
         (that adds the crate rawler, LGPL-2.1), or convert the photograph to a linear 16-bit TIFF",
    ))
}
