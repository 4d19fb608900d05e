//! Claims about exposures in EXIF.

use std::path::Path;

use proptest::prelude::*;

use super::super::{ExifExposure, FileError, exif_exposure, read_exif_exposure};
use super::hostile::runner;
use super::tiff_tags::{Value, jpeg_with_exif, tiff};

fn exposure(bytes: Vec<u8>) -> Result<ExifExposure, FileError> {
    exif_exposure(Path::new("p.jpg"), bytes)
}

fn whole() -> Vec<(u16, Value)> {
    vec![
        (0x829a, Value::Rationals(vec![[1, 60]])),
        (0x829d, Value::Rationals(vec![[56, 10]])),
        (0x8827, Value::Shorts(vec![400])),
    ]
}

#[test]
fn time_sensitivity_and_aperture_are_read_from_jpeg_and_tiff() {
    let expected = ExifExposure { exposure_s: 1.0 / 60.0, iso: Some(400.0), f_number: Some(5.6) };
    assert_eq!(exposure(jpeg_with_exif(whole())).unwrap(), expected);
    assert_eq!(exposure(tiff(&[(0x8769, Value::Directory(whole()))])).unwrap(), expected);
    assert!((expected.settings().relative() - 4.0 / 60.0 / (5.6 * 5.6)).abs() < 1e-12);
}

#[test]
fn apex_values_stand_in_for_numbers_that_are_missing() {
    let tags = vec![
        (0x8827, Value::Shorts(vec![65535])),
        (0x8832, Value::Longs(vec![102_400])),
        (0x9201, Value::SignedRationals(vec![[-3, 1]])),
        (0x9202, Value::Rationals(vec![[6, 1]])),
    ];
    let expected = ExifExposure { exposure_s: 8.0, iso: Some(102_400.0), f_number: Some(8.0) };
    assert_eq!(exposure(jpeg_with_exif(tags)).unwrap(), expected);
}

#[test]
fn a_lens_without_contacts_leaves_the_time_alone() {
    let tags = vec![(0x829a, Value::Rationals(vec![[2, 1]])), (0x829d, Value::Rationals(vec![[0, 0]]))];
    let found = exposure(jpeg_with_exif(tags)).unwrap();
    assert_eq!(found, ExifExposure { exposure_s: 2.0, iso: None, f_number: None });
    assert_eq!(found.settings().relative(), 2.0);
}

#[test]
fn a_photograph_without_its_time_says_so() {
    let said = |bytes: Vec<u8>| exposure(bytes).unwrap_err().to_string();
    assert!(said(jpeg_with_exif(vec![(0x8827, Value::Shorts(vec![100]))])).contains("its EXIF does not say it"));
    assert!(said(jpeg_with_exif(vec![(0x829a, Value::Rationals(vec![[1, 0]]))])).contains("does not say it"));
    let mut jpeg = std::io::Cursor::new(Vec::new());
    image::DynamicImage::new_rgb8(9, 7).write_to(&mut jpeg, image::ImageFormat::Jpeg).unwrap();
    let bare = said(jpeg.into_inner());
    assert!(bare.contains("it has no EXIF"), "{bare}");
    assert!(said(b"#?RADIANCE\n".to_vec()).contains("it has no EXIF"));
    assert!(said(Vec::new()).starts_with("p.jpg: "));
}

#[test]
fn damaged_exif_is_an_exposure_above_zero_or_an_error_that_names_the_file() {
    let files = [jpeg_with_exif(whole()), tiff(&[(0x8769, Value::Directory(whole()))])];
    let check = |bytes: Vec<u8>| match exposure(bytes) {
        Ok(ExifExposure { exposure_s, iso, f_number }) => {
            for value in [Some(exposure_s), iso, f_number].into_iter().flatten() {
                assert!(value > 0.0 && value.is_finite());
            }
        }
        Err(error) => assert!(error.to_string().starts_with("p.jpg: "), "{error}"),
    };
    for file in &files {
        (0..file.len()).for_each(|length| check(file[..length].to_vec()));
    }
    let flips = (0..files.len(), prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..5));
    runner(4000)
        .run(&flips, |(file, flips)| {
            let mut bytes = files[file].clone();
            for (index, value) in flips {
                let at = index.index(bytes.len());
                bytes[at] = value;
            }
            check(bytes);
            Ok(())
        })
        .unwrap();
}

#[test]
fn a_real_bracket_says_its_exposures() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/hdr_frobisher");
    if !folder.exists() {
        eprintln!("skipped: {} is not there, so no camera's own EXIF was read", folder.display());
        return;
    }
    for (name, time) in [("IMG_2600.jpg", 0.125), ("IMG_2601.jpg", 1.0), ("IMG_2602.jpg", 8.0)] {
        let exposure = read_exif_exposure(&folder.join(name)).unwrap();
        assert_eq!((exposure.exposure_s, exposure.f_number), (time, Some(8.0)), "{name}");
    }
}
