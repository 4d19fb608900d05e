//! Radiance HDR of other writers: old and new run lengths, orientations, odd headers.

use super::super::FileError;
use super::samples::by_image_crate;
use super::{decode, decode_float};

fn file(size: &str, pixels: &[u8]) -> Vec<u8> {
    [format!("#?RADIANCE\n# comment\nEXPOSURE=2\nFORMAT=32-bit_rle_rgbe\n\n{size}\n").as_bytes(), pixels].concat()
}

/// Mantissas 128 … 131 at exponent 129: 1 + 1/128 a step.
const FLAT: [u8; 16] = [128, 0, 0, 129, 129, 0, 0, 129, 130, 0, 0, 129, 131, 0, 0, 129];

fn reds(bytes: &[u8]) -> Vec<f32> {
    decode_float(bytes).pixels().iter().map(|[red, _, _]| (red - 1.0) * 128.0).collect()
}

#[test]
fn rows_and_columns_are_turned_the_right_way() {
    assert_eq!(reds(&file("-Y 2 +X 2", &FLAT)), [0.0, 1.0, 2.0, 3.0]);
    assert_eq!(reds(&file("+Y 2 +X 2", &FLAT)), [2.0, 3.0, 0.0, 1.0]);
    assert_eq!(reds(&file("-Y 2 -X 2", &FLAT)), [1.0, 0.0, 3.0, 2.0]);
    assert_eq!(reds(&file("+Y 2 -X 2", &FLAT)), [3.0, 2.0, 1.0, 0.0]);
}

#[test]
fn columns_before_rows_are_not_read() {
    let error = decode(&file("+X 2 -Y 2", &FLAT)).unwrap_err();
    let text = "in/test: this kind of Radiance HDR picture is not read here: rows of columns (±Y, ±X) were expected, \
                found `+X 2 -Y 2`";
    assert_eq!(error.to_string(), text);
}

#[test]
fn old_run_lengths_repeat_and_multiply() {
    let mut pixels = vec![128, 0, 0, 129, 1, 1, 1, 3]; // one pixel, three more
    pixels.extend([129, 0, 0, 129, 1, 1, 1, 2, 1, 1, 1, 1]); // another, 2 + 256 more
    let width = 4 + 1 + 2 + 256;
    let reds = reds(&file(&format!("-Y 1 +X {width}"), &pixels));
    assert_eq!((&reds[..4], &reds[4..]), (&[0.0; 4][..], &[1.0; 259][..]));
}

#[test]
fn new_run_lengths_repeat_and_copy() {
    let mut pixels = vec![2, 2, 0, 9];
    pixels.extend([128 + 5, 128, 4, 129, 130, 131, 132]); // red: five times 128, four as they are
    pixels.extend([128 + 9, 0, 128 + 9, 0, 128 + 9, 129]);
    assert_eq!(reds(&file("-Y 1 +X 9", &pixels)), [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 4.0]);
}

#[test]
fn in_rows_too_short_for_runs_a_dark_pixel_is_a_pixel() {
    let pixels = [2, 2, 0, 4, 128, 0, 0, 129];
    assert_eq!(decode_float(&file("-Y 1 +X 2", &pixels)).pixel(1, 0), [1.0, 0.0, 0.0]);
}

#[test]
fn exposure_is_left_to_the_caller() {
    assert_eq!(decode_float(&file("-Y 1 +X 1", &FLAT)).pixel(0, 0), [1.0, 0.0, 0.0]);
}

#[test]
fn the_exponent_reaches_from_zero_to_the_end() {
    let pixels = [255, 255, 255, 0, 128, 0, 0, 1, 255, 0, 0, 255];
    let image = decode_float(&file("-Y 1 +X 3", &pixels));
    assert_eq!(image.pixel(0, 0), [0.0; 3]);
    assert_eq!(image.pixel(1, 0), [2_f32.powi(-128), 0.0, 0.0]);
    assert_eq!(image.pixel(2, 0), [255.0 * 2_f32.powi(119), 0.0, 0.0]);
}

#[test]
fn runs_out_of_line_are_damage() {
    let bad: [(&str, &[u8]); 6] = [
        ("-Y 1 +X 2", &[1, 1, 1, 1, 128, 0, 0, 129]),
        ("-Y 1 +X 3", &[128, 0, 0, 129, 1, 1, 1, 3]),
        ("-Y 1 +X 9", &[2, 2, 0, 8, 0, 0, 0, 0]),
        ("-Y 1 +X 9", &[2, 2, 0, 9, 128 + 10, 1]),
        ("-Y 1 +X 0", &FLAT),
        ("-Y one +X 1", &FLAT),
    ];
    for (size, pixels) in bad {
        assert!(matches!(decode(&file(size, pixels)), Err(FileError::Damaged { .. })), "{size} {pixels:?}");
    }
    let mut endless = vec![128, 0, 0, 129];
    endless.extend([1, 1, 1, 0].repeat(20));
    assert!(matches!(decode(&file("-Y 1 +X 2", &endless)), Err(FileError::Damaged { .. })));
}

#[test]
fn xyz_is_not_taken_for_rgb() {
    let error = decode(b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n\0\0\0\0").unwrap_err();
    assert!(matches!(error, FileError::Unsupported { .. }), "{error:?}");
}

#[test]
fn the_other_first_line_and_line_ends_are_known() {
    let bytes = b"#?RGBE\r\nFORMAT= 32-bit_rle_rgbe\r\n\r\n-Y 1 +X 1\r\n\x80\x00\x00\x81";
    assert_eq!(decode_float(bytes).pixel(0, 0), [1.0, 0.0, 0.0]);
}

#[test]
fn files_of_the_image_crate_are_understood() {
    let image = image::Rgb32FImage::from_fn(40, 20, |x, y| image::Rgb([x as f32, (x / 9) as f32, 100.0 + y as f32]));
    let back = decode_float(&by_image_crate(image.clone(), image::ImageFormat::Hdr));
    for (read, written) in back.pixels().iter().zip(image.pixels()) {
        // Its mantissas are cut off: up to a whole step.
        assert!((0..3).all(|channel| (read[channel] - written[channel]).abs() <= written[2] / 128.0));
    }
}
