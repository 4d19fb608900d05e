//! PNG, TIFF and JPEG of other writers: grey, palettes, few bits, alpha, floats.

use image::{DynamicImage, ImageFormat, RgbImage, buffer::ConvertBuffer};

use super::super::FileError;
use super::samples::{by_image_crate, png};
use super::{decode, decode_counts, decode_float};

#[test]
fn grey_of_few_bits_is_stretched_to_eight() {
    // 2 bits: 0, 1, 2, 3 in one byte.
    assert_eq!(
        decode_counts(&png((4, 1), 2, 0, &[], &[&[0b00_01_10_11]]), 8).pixels(),
        [0, 85, 170, 255].map(|v| [v; 3])
    );
    assert_eq!(decode_counts(&png((3, 1), 1, 0, &[], &[&[0b1010_0000]]), 8).pixels(), [255, 0, 255].map(|v| [v; 3]));
    assert_eq!(decode_counts(&png((2, 1), 4, 0, &[], &[&[0x1f]]), 8).pixels(), [17, 255].map(|v| [v; 3]));
}

#[test]
fn palettes_are_looked_up_and_their_transparency_dropped() {
    let palette: (&[u8; 4], &[u8]) = (b"PLTE", &[1, 2, 3, 40, 50, 60, 7, 8, 9]);
    let transparency: (&[u8; 4], &[u8]) = (b"tRNS", &[0, 128]);
    for chunks in [&[palette][..], &[palette, transparency]] {
        let image = decode_counts(&png((3, 2), 8, 3, chunks, &[&[2, 0, 1], &[1, 1, 1]]), 8);
        assert_eq!(image.pixels()[..3], [[7, 8, 9], [1, 2, 3], [40, 50, 60]]);
    }
    assert_eq!(decode_counts(&png((2, 1), 4, 3, &[palette], &[&[0x21]]), 8).pixels(), [[7, 8, 9], [40, 50, 60]]);
}

#[test]
fn sixteen_bits_keep_their_range() {
    let image = decode_counts(&png((2, 1), 16, 2, &[], &[&[0, 1, 2, 3, 4, 5, 255, 255, 0, 0, 1, 0]]), 16);
    assert_eq!(image.pixels(), [[1, 515, 1029], [65535, 0, 256]]);
    let image = decode_counts(&png((1, 1), 16, 4, &[], &[&[1, 2, 0, 0]]), 16);
    assert_eq!(image.pixels(), [[258; 3]], "grey with alpha 0");
}

#[test]
fn alpha_is_dropped_not_applied() {
    assert_eq!(decode_counts(&png((1, 1), 8, 6, &[], &[&[9, 8, 7, 0]]), 8).pixels(), [[9, 8, 7]]);
    let tiff = by_image_crate(image::RgbaImage::from_pixel(2, 1, image::Rgba([9, 8, 7, 0])), ImageFormat::Tiff);
    assert_eq!(decode_counts(&tiff, 8).pixels(), [[9, 8, 7]; 2]);
}

#[test]
fn a_wrong_checksum_is_damage() {
    let mut file = png((4, 1), 8, 0, &[], &[&[1, 2, 3, 4]]);
    let at = file.len() - 12 - 4 - 6; // in the compressed rows, before checksums and the last chunk
    file[at] ^= 1;
    assert!(matches!(decode(&file), Err(FileError::Damaged { format: "PNG", .. })));
}

#[test]
fn tiff_of_every_depth() {
    let colour = RgbImage::from_fn(5, 3, |x, y| image::Rgb([x as u8, y as u8, 200]));
    let image = decode_counts(&by_image_crate(colour.clone(), ImageFormat::Tiff), 8);
    assert_eq!(image.pixel(4, 2), [4, 2, 200]);
    let deep = by_image_crate(DynamicImage::from(colour.clone()).to_rgb16(), ImageFormat::Tiff);
    assert_eq!(decode_counts(&deep, 16).pixel(4, 2), [4, 2, 200].map(|value| value * 257));
    let grey = image::GrayImage::from_pixel(2, 2, image::Luma([77]));
    assert_eq!(decode_counts(&by_image_crate(grey, ImageFormat::Tiff), 8).pixels(), [[77; 3]; 4]);
}

#[test]
fn float_tiff_is_linear_and_must_be_finite() {
    let mut float = image::Rgb32FImage::from_fn(5, 3, |x, y| image::Rgb([x as f32, -0.5, 1e9 * y as f32]));
    assert_eq!(decode_float(&by_image_crate(float.clone(), ImageFormat::Tiff)).pixel(4, 2), [4.0, -0.5, 2e9]);
    float.put_pixel(1, 2, image::Rgb([0.0, f32::NAN, f32::NAN]));
    let error = decode(&by_image_crate(float, ImageFormat::Tiff)).unwrap_err();
    assert!(matches!(error, FileError::NotFinite { x: 1, y: 2, channel: 'G', count: 2, .. }), "{error:?}");
}

#[test]
fn jpeg_is_near_and_a_cut_off_one_is_no_photograph() {
    let colour = RgbImage::from_fn(64, 48, |x, y| image::Rgb([(2 * x) as u8, (3 * y) as u8, 90]));
    let file = by_image_crate(colour.clone(), ImageFormat::Jpeg);
    let image = decode_counts(&file, 8);
    for (pixel, expected) in image.pixels().iter().zip(colour.pixels()) {
        for (value, expected) in pixel.iter().zip(expected.0) {
            assert!(value.abs_diff(expected.into()) < 25, "{pixel:?} for {expected:?}");
        }
    }
    let error = decode(&file[..file.len() * 3 / 4]).unwrap_err();
    assert!(error.to_string().ends_with("no end-of-image marker"), "{error}");

    let grey: image::GrayImage = colour.convert();
    let image = decode_counts(&by_image_crate(grey, ImageFormat::Jpeg), 8);
    assert!(image.pixels().iter().all(|[r, g, b]| r == g && g == b));
}
