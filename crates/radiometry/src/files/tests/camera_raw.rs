//! Claims about camera RAW: it is told from the TIFF it resembles, claims are held against the bytes, and (with the feature
//! `raw`) the counts of a DNG of our own making come back.

use std::path::Path;

use proptest::prelude::*;

use super::super::{
    FileError, Photograph, READS_CAMERA_RAW, RawKind, decode_photograph, decode_picture, exif_exposure,
};
use super::hostile::runner;
use super::tiff_tags::{Value, tiff};

/// A sensor of 16 bits, uncompressed.
struct Sensor {
    width: usize,
    height: usize,
    /// 0 red, 1 green, 2 blue at [row][column], from the active area on.
    pattern: [u8; 4],
    /// Of the four sites of the pattern.
    blacks: [u16; 4],
    white: u16,
    /// Top, left, bottom, right.
    active: Option<[u32; 4]>,
}

const SENSOR: Sensor =
    Sensor { width: 24, height: 18, pattern: [0, 1, 1, 2], blacks: [512; 4], white: 15_000, active: None };

impl Sensor {
    fn site(&self, x: usize, y: usize) -> usize {
        let [top, left, ..] = self.active.unwrap_or_default();
        let (x, y) = (x + left as usize % 2, y + top as usize % 2);
        y % 2 * 2 + x % 2
    }

    /// A DNG of this sensor that sees `light` (above black) at column, row and colour.
    fn dng(&self, light: impl Fn(usize, usize, usize) -> f64) -> Vec<u8> {
        let sites = (0..self.width * self.height).map(|i| (i % self.width, i / self.width));
        let samples = sites.flat_map(|(x, y)| {
            let site = self.site(x, y);
            let value = light(x, y, self.pattern[site].into()) + f64::from(self.blacks[site]);
            (value.round().clamp(0.0, self.white.into()) as u16).to_le_bytes()
        });
        let exif = vec![(0x829a, Value::Rationals(vec![[1, 50]])), (0x8827, Value::Shorts(vec![200]))];
        let mut tags = vec![
            (0x00fe, Value::Longs(vec![0])),
            (0x0100, Value::Longs(vec![self.width as u32])),
            (0x0101, Value::Longs(vec![self.height as u32])),
            (0x0102, Value::Shorts(vec![16])),
            (0x0103, Value::Shorts(vec![1])),
            (0x0106, Value::Shorts(vec![32803])),
            (0x010f, Value::Text("Relumine")),
            (0x0110, Value::Text("Sensor on paper")),
            (0x0111, Value::Offset(samples.collect())),
            (0x0115, Value::Shorts(vec![1])),
            (0x0116, Value::Longs(vec![self.height as u32])),
            (0x0117, Value::Longs(vec![(2 * self.width * self.height) as u32])),
            (0x011c, Value::Shorts(vec![1])),
            (0x828d, Value::Shorts(vec![2, 2])),
            (0x828e, Value::Bytes(self.pattern.to_vec())),
            (0x8769, Value::Directory(exif)),
            (0xc612, Value::Bytes(vec![1, 4, 0, 0])),
            (0xc619, Value::Shorts(vec![2, 2])),
            (0xc61a, Value::Shorts(self.blacks.to_vec())),
            (0xc61d, Value::Longs(vec![self.white.into()])),
            (0xc628, Value::Rationals(vec![[1, 2], [1, 1], [2, 3]])),
        ];
        if let Some(active) = self.active {
            tags.push((0xc68d, Value::Longs(active.to_vec())));
        }
        tiff(&tags)
    }
}

fn photograph(bytes: &[u8]) -> Result<Photograph, FileError> {
    decode_photograph(Path::new("p.dng"), bytes)
}

#[test]
fn raw_files_are_told_from_the_tiff_that_they_resemble() {
    let dng = SENSOR.dng(|_, _, _| 100.0);
    assert_eq!(RawKind::of(&dng), Some(RawKind::Dng));
    // What stands first in a NEF or ARW is a preview; the sensor's samples lie in a directory below.
    let of_make = |make: &'static str, compression: u16, photometric: u16| {
        let below = vec![(0x0103, Value::Shorts(vec![compression])), (0x0106, Value::Shorts(vec![photometric]))];
        RawKind::of(&tiff(&[
            (0x0100, Value::Longs(vec![160])),
            (0x0106, Value::Shorts(vec![2])),
            (0x010f, Value::Text(make)),
            (0x014a, Value::Directory(below)),
        ]))
    };
    assert_eq!(of_make("NIKON CORPORATION", 34713, 32803), Some(RawKind::Nef));
    assert_eq!(of_make("SONY", 32767, 32803), Some(RawKind::Arw));
    assert_eq!(of_make("PENTAX", 1, 32803), Some(RawKind::Other));
    assert_eq!(of_make("NIKON CORPORATION", 1, 2), None, "an ordinary TIFF with a smaller copy of itself");
    assert_eq!(RawKind::of(b"II\x2a\0\x10\0\0\0CR\x02\0rest"), Some(RawKind::Cr2));
    assert_eq!(RawKind::of(b"\0\0\0\x18ftypcrx \0\0\0\x01"), Some(RawKind::Cr3));
    assert_eq!(RawKind::of(b"II\x2a\0\x08\0\0\0"), None);
    // A colour profile is no directory and 0 no place, whatever the decoder makes of them.
    let with_profile = [
        (0x8825, Value::Longs(vec![0])),
        (0x8773, Value::Bytes(vec![255; 600])),
        (0xc612, Value::Bytes(vec![1, 4, 0, 0])),
    ];
    assert_eq!(RawKind::of(&tiff(&with_profile)), Some(RawKind::Dng));
    // What the decoder would take for a JPEG of a camera, for a Minolta's RAW, for a Canon's of before CR2.
    for other in [&b"\xff\xd8\xff\xe1ftypcrx \0\0\x80\x01"[..], b"\0MRMftypcrx \0\0\0\x01"] {
        assert_eq!(RawKind::of(other), None);
    }
    let mut canon = [&b"MM\0\x2a\0\0HEAPCCDR"[..], &[0; 20_000]].concat();
    let version = [0, 1, 0xc6, 0x12, 0, 4, 0, 0, 0, 1, 1, 4, 0, 0];
    canon[0x4845..][..version.len()].copy_from_slice(&version);
    assert_eq!(RawKind::of(&canon), None);
    canon[6..8].copy_from_slice(&[0x48, 0x45]);
    canon[13] = b'S';
    assert_eq!(RawKind::of(&canon), Some(RawKind::Dng), "but for its name");
}

#[test]
fn a_dng_says_its_exposure() {
    let exposure = exif_exposure(Path::new("p.dng"), SENSOR.dng(|_, _, _| 100.0)).unwrap();
    assert_eq!((exposure.exposure_s, exposure.iso), (0.02, Some(200.0)));
}

#[test]
fn claims_that_the_bytes_cannot_hold_are_refused_before_decoding() {
    let huge = |tags: &[(u16, Value)]| match photograph(&tiff(tags)) {
        Err(error) => error.to_string(),
        Ok(_) => panic!("a photograph out of nothing"),
    };
    let sized = |width: u32, height: u32, more: Vec<(u16, Value)>| {
        let mut tags = vec![(0x0100, Value::Longs(vec![width])), (0x0101, Value::Longs(vec![height]))];
        tags.extend(more);
        tags.push((0xc612, Value::Bytes(vec![1, 4, 0, 0])));
        huge(&tags)
    };
    assert!(sized(60_000, 60_000, vec![]).contains("at most"));
    assert!(sized(10_000, 10_000, vec![]).contains("too short for 10000 × 10000"));
    // A lossless JPEG of 60,000 × 60,000 in a strip of thirty bytes.
    let frame = [&[0xff, 0xd8, 0xff, 0xc3, 0, 11, 14, 0xea, 0x60, 0xea, 0x60, 2][..], &[0; 20]].concat();
    let strip = vec![(0x0103, Value::Shorts(vec![7])), (0x0111, Value::Offset(frame))];
    assert!(sized(20, 20, strip).contains("60000 × 60000"));
    let circle = [b"II\x2a\0\x08\0\0\0\x01\0\x12\xc6\x01\0\x04\0\0\0\x01\x04\0\0".to_vec(), vec![8, 0, 0, 0]].concat();
    let error = photograph(&circle).map(|_| ()).map_err(|error| error.to_string());
    assert!(RawKind::of(&circle).is_none() && error.is_err(), "a circle of directories: {error:?}");
    let cr3 = [
        &b"\0\0\0\x18ftypcrx "[..],
        &[0; 12],
        b"\0\0\0\x24CMP1",
        &[0; 8],
        &[0, 0, 0xea, 0x60, 0, 0, 0xea, 0x60],
        &[0; 8],
    ];
    let error = photograph(&cr3.concat()).unwrap_err().to_string();
    assert!(error.contains("60000 × 60000"), "{error}");
}

#[test]
fn claims_are_found_where_only_the_decoder_looks_for_them() {
    let entry = |tag: u16, kind: u16, count: u32, value: u32| {
        let numbers = [tag.to_le_bytes(), kind.to_le_bytes()].concat();
        [numbers, count.to_le_bytes().to_vec(), value.to_le_bytes().to_vec()].concat()
    };
    let directory = |entries: &[Vec<u8>]| [(entries.len() as u16).to_le_bytes().to_vec(), entries.concat()].concat();
    let dng = |nested: Vec<u8>| {
        let first = directory(&[nested, entry(0xc612, 4, 1, 0x0401)]);
        // 38 bytes, then a directory that claims gigabytes; it breaks off behind its first entry.
        let second = [&[9, 0][..], &entry(0x0100, 1, 0xe800_0000, 0)].concat();
        [&b"II\x2a\0\x08\0\0\0"[..], &first, &[0; 4], &second].concat()
    };
    // The EXIF and sub-directories as bytes and of no known type, a colour profile; 38 in every reading.
    for nested in [entry(0x8769, 7, 9, 38), entry(0x014a, 0x24, 1, 38), entry(0x8773, 7, 9, 38)] {
        let bytes = dng(nested);
        assert_eq!(RawKind::of(&bytes), Some(RawKind::Dng));
        let error = photograph(&bytes).unwrap_err().to_string();
        assert!(error.contains("a tag with 3892314112 values"), "{error}");
    }
    // Nowhere, which is the beginning of the file: "II" entries, one of which claims two gigabytes.
    let nowhere = [
        &b"II\x2a\0\x08\0\0\0"[..],
        &directory(&[entry(0x8769, 4, 1, 0), entry(0xc612, 4, 1, 1)]),
        &[0; 4],
        &[0x86; 600],
    ];
    let error = photograph(&nowhere.concat()).unwrap_err().to_string();
    assert!(error.contains("a tag with"), "{error}");
    // A width that stands there twice.
    let twice = [entry(0x0100, 4, 1, 20), entry(0x0100, 4, 1, 9000), entry(0x0101, 4, 1, 9000), entry(0xc612, 4, 1, 1)];
    let error =
        photograph(&[&b"II\x2a\0\x08\0\0\0"[..], &directory(&twice), &[0; 4]].concat()).unwrap_err().to_string();
    assert!(error.contains("too short for 9000 × 9000"), "{error}");
}

#[test]
fn without_the_feature_a_raw_file_says_how_to_build_it() {
    let bytes = SENSOR.dng(|_, _, _| 100.0);
    if READS_CAMERA_RAW {
        assert!(photograph(&bytes).is_ok());
        return;
    }
    for error in [photograph(&bytes).unwrap_err(), decode_picture(Path::new("p.dng"), &bytes).unwrap_err()] {
        let said = error.to_string();
        assert!(
            said.contains("DNG") && said.contains("without camera RAW") && said.contains("--features raw"),
            "{said}"
        );
    }
}

#[test]
fn damaged_raw_files_are_photographs_or_errors_that_name_the_file() {
    let whole = SENSOR.dng(|x, y, c| (100 * x + 10 * y + c) as f64);
    let check = |bytes: &[u8]| {
        if let Err(error) = photograph(bytes) {
            assert!(error.to_string().starts_with("p.dng: "), "{error}");
        }
    };
    (0..whole.len()).step_by(3).for_each(|length| check(&whole[..length]));
    let flips = prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4);
    runner(1500)
        .run(&flips, |flips| {
            let mut bytes = whole.clone();
            // In the directories, behind the strip of pixels; those are any numbers anyway.
            for (index, value) in flips {
                let at = index.index(bytes.len() - 2 * SENSOR.width * SENSOR.height);
                let at = if at < 300 { at } else { at + 2 * SENSOR.width * SENSOR.height };
                bytes[at] = value;
            }
            check(&bytes);
            Ok(())
        })
        .unwrap();
}

#[cfg(feature = "raw")]
mod decoded {
    use super::super::super::{RawLevels, RawPhotograph};
    use super::*;

    fn raw(sensor: &Sensor, light: impl Fn(usize, usize, usize) -> f64) -> RawPhotograph {
        match photograph(&sensor.dng(light)).unwrap() {
            Photograph::Raw(raw) => raw,
            Photograph::Picture(picture) => panic!("a {}", picture.describe()),
        }
    }

    #[test]
    fn an_even_colour_comes_back_under_every_array() {
        let colour = [3000.0, 5000.0, 1200.0];
        for pattern in [[0, 1, 1, 2], [2, 1, 1, 0], [1, 0, 2, 1], [1, 2, 0, 1]] {
            let sensor = Sensor { pattern, ..SENSOR };
            let raw = raw(&sensor, |_, _, c| colour[c]);
            assert_eq!(raw.levels, RawLevels { black: 512, white: 15_000 });
            assert_eq!(raw.image.size(), (24, 18));
            assert!(raw.image.pixels().iter().all(|pixel| *pixel == [3512, 5512, 1712]), "{pattern:?}");
        }
    }

    #[test]
    fn blacks_that_differ_from_site_to_site_become_one() {
        let sensor = Sensor { blacks: [500, 512, 508, 490], ..SENSOR };
        let raw = raw(&sensor, |_, _, _| 1000.0);
        assert_eq!(raw.levels, RawLevels { black: 512, white: 15_000 });
        assert!(raw.image.pixels().iter().all(|pixel| *pixel == [1512; 3]));
    }

    #[test]
    fn an_active_area_that_begins_at_an_odd_site_keeps_its_colours() {
        let colour = [3000.0, 5000.0, 1200.0];
        for active in [[1, 1, 17, 23], [1, 2, 17, 24], [2, 3, 18, 23]] {
            let sensor = Sensor { active: Some(active), blacks: [500, 512, 508, 490], ..SENSOR };
            let raw = raw(&sensor, |_, _, c| colour[c]);
            let [top, left, bottom, right] = active.map(|edge| edge as usize);
            assert_eq!(raw.image.size(), (right - left, bottom - top));
            assert!(raw.image.pixels().iter().all(|pixel| *pixel == [3512, 5512, 1712]), "{active:?}");
        }
    }

    #[test]
    fn a_ramp_is_interpolated_exactly_away_from_the_edges() {
        let ramp = |x: usize, y: usize, c: usize| 1000.0 + 40.0 * x as f64 + 20.0 * y as f64 + 500.0 * c as f64;
        let raw = raw(&SENSOR, ramp);
        for y in 2..SENSOR.height - 2 {
            for x in 2..SENSOR.width - 2 {
                let expected = [0, 1, 2].map(|c| ramp(x, y, c) as u16 + 512);
                assert_eq!(raw.image.pixel(x, y), expected, "({x}, {y})");
            }
        }
    }

    #[test]
    fn a_clipped_site_clips_what_is_interpolated_from_it_and_nothing_else() {
        // One red site far above white, in even grey.
        let raw = raw(&SENSOR, |x, y, _| if (x, y) == (8, 8) { 1e6 } else { 2000.0 });
        for y in 0..SENSOR.height {
            for x in 0..SENSOR.width {
                // Red reaches one site in all eight directions by its means.
                let reached = x.abs_diff(8) <= 1 && y.abs_diff(8) <= 1;
                let red = if reached { 15_000 } else { 2512 };
                assert_eq!(raw.image.pixel(x, y), [red, 2512, 2512], "({x}, {y})");
            }
        }
    }

    #[test]
    fn the_white_balance_is_told_and_not_applied() {
        let raw = raw(&SENSOR, |_, _, _| 1000.0);
        let [red, green, blue] = raw.white_balance.unwrap();
        assert!((red - 2.0).abs() < 1e-6 && green == 1.0 && (blue - 1.5).abs() < 1e-6);
    }
}
