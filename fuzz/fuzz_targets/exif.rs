//! Exposures in EXIF: any bytes give numbers above zero, or an error that names the file.
#![no_main]

use std::path::Path;

use libfuzzer_sys::fuzz_target;
use relumine_radiometry::files::exif_exposure;

fuzz_target!(|bytes: &[u8]| {
    match exif_exposure(Path::new("photograph"), bytes.to_vec()) {
        Ok(exif) => {
            for value in [Some(exif.exposure_s), exif.iso, exif.f_number].into_iter().flatten() {
                assert!(value > 0.0 && value.is_finite(), "{exif:?}");
            }
        }
        Err(error) => assert!(error.to_string().starts_with("photograph: "), "{error}"),
    }
});
