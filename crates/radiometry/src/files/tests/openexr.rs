//! OpenEXR files of other writers: channel orders and names, tiles, resolutions, parts, windows.

use std::io::Cursor;

use exr::image::write::WritableImage;
use exr::image::{AnyChannels, Blocks, FlatSamples, Image as ExrImage, Layer};
use exr::math::Vec2;
use exr::meta::attribute::{Compression, IntegerBounds};
use exr::meta::header::{ImageAttributes, LayerAttributes};

use super::super::FileError;
use super::samples::{self, encoding, exr_file, floats, halves, integers};
use super::{decode, decode_float};

const SIZE: (usize, usize) = (21, 19);

fn rows() -> exr::image::Encoding {
    encoding(Compression::ZIP16, Blocks::ScanLines)
}

#[test]
fn every_lossless_compression_in_rows_and_tiles_gives_the_same_picture() {
    let expected = |x: usize, y: usize| [1.0, 0.5, 0.25].map(|factor| factor * (x * x + 7 * y) as f32);
    for compression in samples::COMPRESSIONS.into_iter().filter(|compression| !compression.may_loose_data()) {
        for blocks in [Blocks::ScanLines, Blocks::Tiles(Vec2(8, 4)), Blocks::Tiles(Vec2(64, 64))] {
            let image = decode_float(&samples::rgba_exr(SIZE, compression, blocks));
            assert_eq!(image.size(), SIZE);
            for (index, pixel) in image.pixels().iter().enumerate() {
                let place = (index % SIZE.0, index / SIZE.0);
                assert_eq!(*pixel, expected(place.0, place.1), "{compression:?} {blocks:?} at {place:?}");
            }
        }
    }
}

#[test]
fn lossy_compressions_are_near() {
    let smooth = |x: usize, y: usize| 1.0 + 0.1 * (x + 2 * y) as f32;
    for compression in samples::COMPRESSIONS.into_iter().filter(|compression| compression.may_loose_data()) {
        let channels = vec![("R", halves(SIZE, smooth)), ("G", halves(SIZE, smooth)), ("B", halves(SIZE, smooth))];
        let image = decode_float(&exr_file(SIZE, encoding(compression, Blocks::ScanLines), channels));
        for (index, [_, green, _]) in image.pixels().iter().enumerate() {
            let value = smooth(index % SIZE.0, index / SIZE.0);
            assert!((green - value).abs() < 0.02 * value, "{compression:?}: {green} for {value}");
        }
    }
}

#[test]
fn luminance_alone_is_grey_and_integers_are_numbers() {
    let file = exr_file(
        (3, 2),
        rows(),
        vec![("Y", integers((3, 2), |x, y| (10 * y + x) as u32)), ("Z", floats((3, 2), |_, _| 9.0))],
    );
    assert_eq!(decode_float(&file).pixels(), [0.0, 1.0, 2.0, 10.0, 11.0, 12.0].map(|grey| [grey; 3]));
}

#[test]
fn a_named_layer_is_read_where_there_is_no_plain_one() {
    let value = |value: f32| floats((2, 2), move |_, _| value);
    let layer =
        vec![("diffuse.R", value(1.0)), ("diffuse.G", value(2.0)), ("diffuse.B", value(3.0)), ("Z", value(9.0))];
    assert_eq!(decode_float(&exr_file((2, 2), rows(), layer.clone())).pixel(1, 1), [1.0, 2.0, 3.0]);
    let both = [layer, vec![("R", value(4.0)), ("G", value(5.0)), ("B", value(6.0))]].concat();
    assert_eq!(decode_float(&exr_file((2, 2), rows(), both)).pixel(1, 1), [4.0, 5.0, 6.0]);
}

#[test]
fn without_colour_the_channels_are_named() {
    let file = exr_file((2, 2), rows(), vec![("U", floats((2, 2), |_, _| 0.0)), ("V", floats((2, 2), |_, _| 0.0))]);
    let error = decode(&file).unwrap_err();
    assert_eq!(
        error.to_string(),
        "in/test: this kind of OpenEXR picture is not read here: expected channels R, G, B or Y, found U, V"
    );
}

#[test]
fn luminance_with_chroma_is_not_taken_for_grey() {
    let value = || floats((2, 2), |_, _| 0.0);
    let file = exr_file((2, 2), rows(), vec![("BY", value()), ("RY", value()), ("Y", value())]);
    assert!(matches!(decode(&file), Err(FileError::Unsupported { .. })));
}

#[test]
fn of_several_resolutions_the_largest_is_read() {
    let image = decode_float(&samples::mip_mapped_exr((13, 9)));
    assert_eq!(image.size(), (13, 9));
    assert!(image.pixels().iter().all(|pixel| *pixel == [1.0, 10.0, 100.0]));
}

#[test]
fn of_several_parts_the_first_with_colour_is_read() {
    let image = decode_float(&samples::parts_exr((5, 40)));
    assert_eq!((image.pixel(0, 0), image.pixel(4, 39)), ([1.0, 2.0, 3.0], [40.0, 41.0, 42.0]));
}

/// A data window of 4 × 3 at `position`, whose red is 1 + x and green 1 + y of the data, in a display window of 6 × 5.
fn windowed(position: (i32, i32)) -> Vec<u8> {
    let attributes = LayerAttributes { layer_position: position.into(), ..LayerAttributes::default() };
    let channels = vec![
        ("R", floats((4, 3), |x, _| 1.0 + x as f32)),
        ("G", floats((4, 3), |_, y| 1.0 + y as f32)),
        ("B", floats((4, 3), |_, _| 1.0)),
    ];
    let layer: Layer<AnyChannels<FlatSamples>> = samples::layer((4, 3), rows(), attributes, channels);
    // The display window does not begin at 0 either.
    let display = IntegerBounds::new(Vec2(-10, 20), Vec2(6, 5));
    let mut bytes = Cursor::new(Vec::new());
    ExrImage::new(ImageAttributes::new(display), layer).write().non_parallel().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

#[test]
fn the_picture_is_the_display_window() {
    // By how far the data window is moved from the display window's corner.
    for (dx, dy) in [(0, 0), (1, 2), (-1, -1), (4, 3), (-3, 0), (3, -2)] {
        let image = decode_float(&windowed((-10 + dx, 20 + dy)));
        assert_eq!(image.size(), (6, 5));
        for y in 0..5 {
            for x in 0..6 {
                let (u, v) = (x as i32 - dx, y as i32 - dy);
                let inside = (0..4).contains(&u) && (0..3).contains(&v);
                let expected = if inside { [1.0 + u as f32, 1.0 + v as f32, 1.0] } else { [0.0; 3] };
                assert_eq!(image.pixel(x, y), expected, "data moved by ({dx}, {dy}), pixel ({x}, {y})");
            }
        }
    }
}

#[test]
fn windows_apart_are_an_error() {
    let error = decode(&windowed((-4, 20))).unwrap_err();
    assert!(error.to_string().ends_with("its data window lies outside its display window"), "{error}");
}

#[test]
fn nan_is_found_and_named() {
    let red = floats(SIZE, |x, y| if (x, y) == (7, 11) { f32::INFINITY } else { 0.0 });
    let blue = halves(SIZE, |x, y| if y == 11 && x >= 7 { f32::NAN } else { 0.0 });
    let file = exr_file(SIZE, rows(), vec![("R", red), ("G", halves(SIZE, |_, _| 1.0)), ("B", blue)]);
    let error = decode(&file).unwrap_err();
    assert!(matches!(error, FileError::NotFinite { x: 7, y: 11, channel: 'R', count: 15, .. }), "{error:?}");
    let text =
        "in/test: every sample must be finite, but 15 are NaN or infinite, the first in channel R of pixel (7, 11)";
    assert_eq!(error.to_string(), text);
}

#[test]
fn a_writer_that_did_not_finish_is_told_so() {
    let mut file = samples::rgba_exr(SIZE, Compression::ZIP1, Blocks::ScanLines);
    let table = samples::offset_table(&file);
    file[table + 8..table + 16].fill(0);
    let error = decode(&file).unwrap_err();
    assert!(error.to_string().contains("its writer did not finish"), "{error}");
    // A block given twice instead of another one.
    file.copy_within(table..table + 8, table + 8);
    let error = decode(&file).unwrap_err();
    assert!(error.to_string().contains("do not cover the picture"), "{error}");
}
