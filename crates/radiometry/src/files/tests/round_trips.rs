//! What our writers write, our readers give back.

use std::fs;

use super::super::{
    ExrSample, FileError, Picture, encode_png_counts, read_exr_attribute, read_linear, read_picture, write_exr,
    write_hdr, write_png_counts, write_png8, write_png16, write_tiff16,
};
use super::spread;
use crate::{Counts, Encoded, Image, Linear, Radiance, Transfer};

fn names(folder: &std::path::Path) -> Vec<String> {
    fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
}

fn counts(width: usize, height: usize, limit: usize) -> Image<Counts> {
    let sample = |index: usize| (index * 257 % limit) as u16;
    let pixels = (0..width * height).map(|pixel| [sample(3 * pixel), sample(3 * pixel + 1), (limit - 1) as u16]);
    Image::from_pixels(width, height, pixels.collect())
}

#[test]
fn exr_floats_come_back_exactly() {
    let folder = tempfile::tempdir().unwrap();
    // Below and above the size at which threads take part.
    for (width, height) in [(1, 1), (37, 23), (601, 500)] {
        let path = folder.path().join("floats.exr");
        let image = spread(width, height).reinterpret::<Radiance>();
        write_exr(&path, &image, ExrSample::Float, &[]).unwrap();
        assert_eq!(read_linear(&path).unwrap().reinterpret::<Radiance>(), image);
    }
}

#[test]
fn exr_halves_come_back_within_half_a_step() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("halves.exr");
    let image = spread(37, 23).reinterpret::<Transfer>();
    write_exr(&path, &image, ExrSample::Half, &[]).unwrap();
    let back = read_linear(&path).unwrap();
    for (written, read) in image.pixels().as_flattened().iter().zip(back.pixels().as_flattened()) {
        // The step of subnormal halves is 2⁻²⁴.
        let tolerance = (written.abs() * 2_f32.powi(-11)).max(2_f32.powi(-25));
        assert!((written - read).abs() <= tolerance, "{written} came back as {read}");
    }
}

#[test]
fn exr_attributes_come_back_and_do_not_disturb_the_picture() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("attributes.exr");
    let image = spread(20, 40);
    let attributes = [("relumine.scene", "Läufer ♞ e4"), ("relumine.empty", ""), ("comments", "two\nlines")];
    write_exr(&path, &image, ExrSample::Float, &attributes).unwrap();
    assert_eq!(read_linear(&path).unwrap(), image);
    for (name, text) in attributes {
        assert_eq!(read_exr_attribute(&path, name).unwrap().as_deref(), Some(text));
    }
    assert_eq!(read_exr_attribute(&path, "relumine").unwrap(), None);
    assert_eq!(read_exr_attribute(&path, "compression").unwrap(), None, "present, but no text");
    assert_eq!(read_exr_attribute(&path, "type").unwrap().as_deref(), Some("scanlineimage"));
    // The exr crate, whose table of offsets was moved, finds its blocks too.
    let theirs = exr::prelude::read_first_flat_layer_from_file(&path).unwrap();
    assert_eq!(theirs.layer_data.size, exr::math::Vec2(20, 40));
    assert_eq!(theirs.layer_data.attributes.comments.unwrap().to_string(), "two\nlines");
}

#[test]
fn the_same_picture_and_attributes_give_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let attributes = ["a", "b", "c", "d", "e", "f", "g"].map(|name| (name, "text"));
    let files: Vec<_> = (0..4)
        .map(|index| {
            let path = folder.path().join(format!("{index}.exr"));
            write_exr(&path, &spread(600, 500), ExrSample::Half, &attributes).unwrap();
            fs::read(path).unwrap()
        })
        .collect();
    assert!(files.windows(2).all(|pair| pair[0] == pair[1]));
}

#[test]
fn attribute_names_the_format_depends_on_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("attributes.exr");
    let long = "x".repeat(32);
    let bad: [&[(&str, &str)]; 5] =
        [&[("channels", "x")], &[("", "x")], &[("a\0b", "x")], &[(&long, "x")], &[("a", "x"), ("a", "y")]];
    for attributes in bad {
        let error = write_exr(&path, &spread(2, 2), ExrSample::Half, attributes).unwrap_err();
        assert!(error.to_string().contains("attribute `"), "{error}");
        assert!(names(folder.path()).is_empty());
    }
}

#[test]
fn the_writers_refuse_what_the_readers_refuse_and_leave_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bad.exr");
    let with = |bad: f32| {
        let mut image = spread(5, 4);
        image.pixels_mut()[13][1] = bad;
        image
    };
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let error = write_exr(&path, &with(bad), ExrSample::Float, &[]).unwrap_err();
        assert!(matches!(error, FileError::NotFinite { x: 3, y: 2, channel: 'G', count: 1, .. }), "{error:?}");
        let error = write_hdr(&path, &with(bad).reinterpret()).unwrap_err();
        assert!(matches!(error, FileError::NotFinite { x: 3, y: 2, channel: 'G', count: 1, .. }), "{error:?}");
    }
    let error = write_exr(&path, &with(70_000.0), ExrSample::Half, &[]).unwrap_err();
    assert!(matches!(error, FileError::OutOfRange { x: 3, y: 2, channel: 'G', .. }), "{error:?}");
    assert!(error.to_string().ends_with("does not fit a half, which ends at 65504"), "{error}");
    assert!(matches!(write_hdr(&path, &with(3e38).reinterpret()), Err(FileError::OutOfRange { .. })));
    assert!(names(folder.path()).is_empty());
}

#[test]
fn pictures_without_pixels_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("empty");
    let empty = Image::<Encoded>::black(0, 5);
    let written = [
        write_exr(&path, &Image::<Linear>::black(0, 5), ExrSample::Half, &[]),
        write_hdr(&path, &Image::black(0, 5)),
        write_png8(&path, &empty),
        write_png16(&path, &empty),
        write_tiff16(&path, &empty),
        write_png_counts(&path, &Image::black(5, 0), 8),
    ];
    assert!(written.iter().all(|result| matches!(result, Err(FileError::Write { .. }))), "{written:?}");
    assert!(names(folder.path()).is_empty());
}

#[test]
fn png_counts_come_back_exactly() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("counts.png");
    for (bits, limit) in [(8, 256), (16, 65536)] {
        let image = counts(31, 17, limit);
        write_png_counts(&path, &image, bits).unwrap();
        assert_eq!(fs::read(&path).unwrap(), encode_png_counts(&image, bits));
        assert_eq!(read_picture(&path).unwrap(), Picture::Integer { image, bits });
    }
}

#[test]
fn counts_too_large_for_a_byte_saturate() {
    let image = Image::<Counts>::from_pixels(1, 1, vec![[255, 256, 65535]]);
    let back = super::decode_counts(&encode_png_counts(&image, 8), 8);
    assert_eq!(back.pixels(), [[255; 3]]);
}

#[test]
fn display_codes_round_to_the_nearest_step() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("codes");
    let codes = [[0.0, 1.0, 0.5], [-3.0, 7.0, f32::NAN], [0.499 / 255.0, 0.501 / 255.0, 100.4 / 65535.0]];
    let image = Image::<Encoded>::from_pixels(3, 1, codes.to_vec());

    write_png8(&path, &image).unwrap();
    let expected = vec![[0, 255, 128], [0, 255, 0], [0, 1, 0]];
    assert_eq!(read_picture(&path).unwrap(), Picture::Integer { image: Image::from_pixels(3, 1, expected), bits: 8 });

    let expected = vec![[0, 65535, 32768], [0, 65535, 0], [128, 129, 100]];
    for write in [write_png16, write_tiff16] {
        write(&path, &image).unwrap();
        let image = Image::from_pixels(3, 1, expected.clone());
        assert_eq!(read_picture(&path).unwrap(), Picture::Integer { image, bits: 16 });
    }
}

#[test]
fn hdr_comes_back_within_a_percent() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("picture.hdr");
    // Rows too short for the run-length code, just long enough, and with runs of all lengths.
    for (width, height) in [(7, 9), (8, 3), (700, 3)] {
        let mut image = spread(width, height).reinterpret::<Radiance>();
        for (index, pixel) in image.pixels_mut().iter_mut().enumerate() {
            *pixel = if index % 400 > 30 { [0.25, 3e4, 1e-3] } else { pixel.map(f32::abs) };
        }
        write_hdr(&path, &image).unwrap();
        let back = read_linear(&path).unwrap();
        for (written, read) in image.pixels().iter().zip(back.pixels()) {
            let largest = written.iter().copied().fold(0.0, f32::max);
            let error = (0..3).map(|channel| (written[channel] - read[channel]).abs()).fold(0.0, f32::max);
            assert!(error <= 0.004 * largest, "{written:?} came back as {read:?}");
        }
    }
}

#[test]
fn a_folder_that_is_not_there_is_a_write_error_with_the_path() {
    let error = write_png8("no/such/folder/x.png".as_ref(), &Image::black(1, 1)).unwrap_err();
    assert!(matches!(&error, FileError::Write { source, .. } if source.kind() == std::io::ErrorKind::NotFound));
    assert!(error.to_string().starts_with("no/such/folder/x.png: could not be written: "), "{error}");
}
