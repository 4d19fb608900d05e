//! Headers that promise too much are refused, and promises cost no memory.

use exr::image::Blocks;
use exr::math::Vec2;
use exr::meta::attribute::Compression;
use image::ImageFormat;

use super::super::{FileError, MAX_PIXELS, decode_picture, read_linear, read_picture};
use super::{decode, samples};

/// Small sound files whose headers were made to announce `side` × `side`.
fn announcing(side: u32) -> Vec<(&'static str, Vec<u8>)> {
    let colour = || image::RgbImage::from_pixel(13, 9, image::Rgb([1, 2, 3]));
    let png = samples::png((side, side), 8, 2, &[], &[&[1, 2, 3]]);

    let mut tiff = samples::by_image_crate(colour(), ImageFormat::Tiff);
    for tag in [256_u16, 257, 278] {
        // Width, height, rows per strip.
        // An entry: tag, type, count of one, value.
        let entry = [tag.to_le_bytes(), 4_u16.to_le_bytes()].concat();
        let at = tiff.windows(4).position(|bytes| bytes == entry).unwrap();
        tiff[at + 8..at + 12].copy_from_slice(&side.to_le_bytes());
    }

    let mut jpeg = samples::by_image_crate(colour(), ImageFormat::Jpeg);
    let frame = jpeg.windows(2).position(|bytes| bytes == [0xff, 0xc0]).unwrap();
    jpeg[frame + 5..frame + 9].copy_from_slice([(side as u16).to_be_bytes(); 2].as_flattened());

    let hdr = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {side} +X {side}\nsome pixels").into_bytes();

    let mut rows = samples::rgba_exr((13, 9), Compression::ZIP16, Blocks::ScanLines);
    announce_exr(&mut rows, side);
    let mut tiles = samples::rgba_exr((13, 9), Compression::RLE, Blocks::Tiles(Vec2(8, 8)));
    announce_exr(&mut tiles, side);
    vec![("PNG", png), ("TIFF", tiff), ("JPEG", jpeg), ("HDR", hdr), ("EXR rows", rows), ("EXR tiles", tiles)]
}

fn announce_exr(file: &mut [u8], side: u32) {
    for name in [&b"dataWindow\0box2i\0"[..], b"displayWindow\0box2i\0"] {
        let at = file.windows(name.len()).position(|bytes| bytes == name).unwrap() + name.len() + 4;
        file[at..at + 8].fill(0);
        file[at + 8..at + 16].copy_from_slice([(side - 1).to_le_bytes(); 2].as_flattened());
    }
}

#[test]
fn more_pixels_than_the_limit_are_refused_by_the_header() {
    for (name, file) in announcing(60_000) {
        let error = decode(&file).unwrap_err();
        assert!(matches!(error, FileError::TooLarge { width: 60_000, height: 60_000, .. }), "{name}: {error:?}");
        let text = "in/test: a picture of at most 268435456 pixels was expected, the header announces 60000 × 60000";
        assert_eq!(error.to_string(), text);
    }
}

#[test]
fn pixels_that_never_come_cost_no_memory() {
    let side = 16_384;
    assert_eq!(side as usize * side as usize, MAX_PIXELS);
    let before = most_memory_used();
    for (name, file) in announcing(side) {
        match decode(&file) {
            Err(FileError::Damaged { .. } | FileError::Unsupported { .. }) => {}
            other => panic!("{name}: {other:?}"),
        }
    }
    if let (Some(before), Some(after)) = (before, most_memory_used()) {
        let used = (after - before) >> 20;
        assert!(used < 1024, "{used} MiB for files of a few bytes");
    }
}

/// The largest resident size of this process so far, in bytes, where the system tells.
fn most_memory_used() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? << 10)
}

#[test]
fn absurd_tiles_are_refused() {
    let mut file = samples::rgba_exr((13, 9), Compression::RLE, Blocks::Tiles(Vec2(8, 8)));
    let name = b"tiles\0tiledesc\0";
    let at = file.windows(name.len()).position(|bytes| bytes == name).unwrap() + name.len() + 4;
    file[at..at + 8].copy_from_slice([0x3fff_fff0_u32.to_le_bytes(); 2].as_flattened());
    let error = decode(&file).unwrap_err();
    assert!(matches!(&error, FileError::Unsupported { reason, .. } if reason.starts_with("tiles of")), "{error:?}");
}

#[test]
fn counters_in_a_dwa_block_are_not_believed() {
    // Found by fuzzing: the exr crate allocated 342 TiB, and the process was ended.
    let file = samples::rgba_exr((64, 64), Compression::DWAA(None), Blocks::ScanLines);
    assert!(decode(&file).is_ok());
    let table = samples::offset_table(&file);
    let block = u64::from_le_bytes(*file[table..].first_chunk().unwrap()) as usize;
    let at = block + 8; // after the row and the size
    for counter in [1, 6, 7, 8, 9] {
        let mut file = file.clone();
        file[at + 8 * counter + 5] = 0x55;
        let error = decode(&file).unwrap_err();
        assert!(error.to_string().contains("absurd counters"), "{counter}: {error}");
    }
}

#[test]
fn what_is_no_picture_is_told_by_its_first_bytes() {
    let error = decode(b"hello, world").unwrap_err();
    let expected = "in/test: expected an OpenEXR, Radiance HDR, PNG, TIFF, JPEG or camera RAW picture, found a file \
                    that begins with the bytes 68 65 6c 6c 6f 2c 20 77";
    assert_eq!(error.to_string(), expected);
    assert!(decode(b"").unwrap_err().to_string().ends_with("found an empty file"));
}

#[test]
fn a_cut_off_file_is_damaged_not_unreadable() {
    let png = samples::by_image_crate(image::RgbImage::new(50, 50), ImageFormat::Png);
    let error = decode_picture("photographs/x.png".as_ref(), &png[..60]).unwrap_err();
    assert_eq!(error.to_string(), "photographs/x.png: not a whole PNG picture: unexpected end of file");
    assert_eq!(error.path(), std::path::Path::new("photographs/x.png"));
}

#[test]
fn a_missing_file_and_a_folder_are_unreadable_not_damaged() {
    let folder = tempfile::tempdir().unwrap();
    for path in [folder.path().join("missing.png"), folder.path().to_path_buf()] {
        assert!(matches!(read_picture(&path), Err(FileError::Read { .. })));
    }
}

#[test]
fn integers_are_not_linear() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("photograph.exr"); // the extension does not count
    std::fs::write(&path, samples::by_image_crate(image::RgbImage::new(144, 96), ImageFormat::Png)).unwrap();
    let error = read_linear(&path).unwrap_err();
    assert!(matches!(error, FileError::NotLinear { .. }));
    assert!(error.to_string().ends_with("found a 8-bit picture of 144 × 96"), "{error}");
}
