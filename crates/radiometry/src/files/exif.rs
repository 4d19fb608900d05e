//! The exposure that a camera wrote into its photograph: EXIF of JPEG, TIFF, PNG and camera RAW (CIPA DC-008, §4.6.5), by the
//! crate nom-exif.

use std::fs::{self, File};
use std::io::{self, Read};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use nom_exif::{Exif, ExifTag, IfdIndex, MediaParser, MediaSource};

use super::FileError;
use crate::{ExposureSettings, Gain};

/// Shutter, sensitivity and aperture as a photograph's EXIF has them. Times and f-numbers are nominal there: 1/60 s may be
/// 1/64 s (see [`refine_exposures`](crate::refine_exposures)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExifExposure {
    /// Shutter time, seconds, above 0.
    pub exposure_s: f64,
    /// ISO sensitivity, above 0, if it is said.
    pub iso: Option<f64>,
    /// The f-number, above 0, if it is said; a lens without contacts does not.
    pub f_number: Option<f64>,
}

impl ExifExposure {
    /// The exposure with sensitivity and aperture if both are said, else the time alone.
    pub fn settings(&self) -> ExposureSettings {
        let gain = self.iso.zip(self.f_number).map(|(iso, f_number)| Gain { iso, f_number });
        ExposureSettings { exposure_s: self.exposure_s, gain }
    }
}

/// Larger files are no photographs.
const LARGEST_FILE: u64 = 1 << 30;

/// Reads the exposure of a photograph.
///
/// # Errors
/// [`FileError::Read`] if the file cannot be read, [`FileError::NoExposure`] if it does not say its exposure time.
pub fn read_exif_exposure(path: &Path) -> Result<ExifExposure, FileError> {
    let failed = |source| FileError::Read { path: path.to_path_buf(), source };
    // Looked at before it is opened: opening a pipe would wait for its writer.
    let metadata = fs::metadata(path).map_err(failed)?;
    if !metadata.is_file() || metadata.len() > LARGEST_FILE {
        let reason = if metadata.is_file() { "too large for a photograph" } else { "not a regular file" };
        return Err(failed(io::Error::other(reason)));
    }
    let mut bytes = Vec::new();
    File::open(path).and_then(|file| file.take(LARGEST_FILE).read_to_end(&mut bytes)).map_err(failed)?;
    exif_exposure(path, bytes)
}

/// The exposure of the photograph with this content; `path_for_messages` is not opened.
///
/// # Errors
/// [`FileError::NoExposure`].
pub fn exif_exposure(path_for_messages: &Path, bytes: Vec<u8>) -> Result<ExifExposure, FileError> {
    let missing = |reason: String| FileError::NoExposure { path: path_for_messages.to_path_buf(), reason };
    // The parser is a stranger's and reads what strangers wrote; it touches nothing but its own memory.
    let parsed = catch_unwind(AssertUnwindSafe(|| {
        let exif: Exif = MediaParser::new().parse_exif(MediaSource::from_memory(bytes)?)?.into();
        Ok(exposure_of(&exif))
    }));
    let exposure = match parsed {
        Ok(Ok(exposure)) => exposure,
        Ok(Err(nom_exif::Error::UnsupportedFormat | nom_exif::Error::ExifNotFound)) => {
            return Err(missing("it has no EXIF".into()));
        }
        Ok(Err(error)) => return Err(missing(format!("its EXIF is damaged: {error}"))),
        Err(_) => return Err(missing("its EXIF is damaged".into())),
    };
    exposure.ok_or_else(|| missing("its EXIF does not say it".into()))
}

/// Sensitivity as the camera recommends it, where ISOSpeedRatings ends at 65535 (CIPA DC-008, table 9).
const RECOMMENDED_EXPOSURE_INDEX: u16 = 0x8832;

fn exposure_of(exif: &Exif) -> Option<ExifExposure> {
    let positive = |value: f64| (value.is_finite() && value > 0.0).then_some(value);
    let number = |tag| {
        let value = exif.get(tag)?;
        // A list of sensitivities: the first.
        let first = value.as_u16_slice().and_then(<[u16]>::first).map(|first| f64::from(*first));
        first.or_else(|| value.try_as_float())
    };
    // APEX: time value Tv = −log₂ t, aperture value Av = 2 log₂ f.
    let time = number(ExifTag::ExposureTime).and_then(positive);
    let time = time.or_else(|| number(ExifTag::ShutterSpeedValue).and_then(|value| positive((-value).exp2())));
    let aperture = number(ExifTag::FNumber).and_then(positive);
    let aperture = aperture.or_else(|| number(ExifTag::ApertureValue).and_then(|value| positive((value / 2.0).exp2())));
    let iso = number(ExifTag::ISOSpeedRatings).and_then(positive).filter(|iso| *iso < 65535.0);
    let recommended = || exif.get_by_code(IfdIndex::MAIN, RECOMMENDED_EXPOSURE_INDEX)?.try_as_float();
    Some(ExifExposure { exposure_s: time?, iso: iso.or_else(|| recommended().and_then(positive)), f_number: aperture })
}
