//! Small sound files of every kind, made by other hands than ours where there are any.

use std::io::Cursor;

use exr::image::write::WritableImage;
use exr::image::{AnyChannel, AnyChannels, Blocks, Encoding, FlatSamples, Image as ExrImage, Layer, Layers, Levels};
use exr::math::{RoundingMode, Vec2};
use exr::meta::attribute::{Compression, LineOrder, Text};
use exr::meta::header::{ImageAttributes, LayerAttributes};
use half::f16;
use image::{DynamicImage, ImageFormat};

pub(super) const COMPRESSIONS: [Compression; 10] = [
    Compression::Uncompressed,
    Compression::RLE,
    Compression::ZIP1,
    Compression::ZIP16,
    Compression::PIZ,
    Compression::PXR24,
    Compression::B44,
    Compression::B44A,
    Compression::DWAA(None),
    Compression::DWAB(None),
];

pub(super) fn encoding(compression: Compression, blocks: Blocks) -> Encoding {
    Encoding { compression, blocks, line_order: LineOrder::Increasing }
}

pub(super) fn floats(size: (usize, usize), value: impl Fn(usize, usize) -> f32) -> FlatSamples {
    FlatSamples::F32(grid(size, value))
}

pub(super) fn halves(size: (usize, usize), value: impl Fn(usize, usize) -> f32) -> FlatSamples {
    FlatSamples::F16(grid(size, |x, y| f16::from_f32(value(x, y))))
}

pub(super) fn integers(size: (usize, usize), value: impl Fn(usize, usize) -> u32) -> FlatSamples {
    FlatSamples::U32(grid(size, value))
}

fn grid<T>((width, height): (usize, usize), value: impl Fn(usize, usize) -> T) -> Vec<T> {
    (0..width * height).map(|index| value(index % width, index / width)).collect()
}

pub(super) fn layer(
    size: (usize, usize),
    encoding: Encoding,
    attributes: LayerAttributes,
    channels: Vec<(&str, FlatSamples)>,
) -> Layer<AnyChannels<FlatSamples>> {
    let channels = channels.into_iter().map(|(name, samples)| AnyChannel::new(name, samples)).collect();
    Layer::new(size, attributes, encoding, AnyChannels::sort(channels))
}

pub(super) fn exr_file(size: (usize, usize), encoding: Encoding, channels: Vec<(&str, FlatSamples)>) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let layer = layer(size, encoding, LayerAttributes::default(), channels);
    ExrImage::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

/// Where the offset table begins.
pub(super) fn offset_table(file: &[u8]) -> usize {
    let mut cursor = Cursor::new(file);
    exr::meta::MetaData::read_from_buffered(&mut cursor, true).unwrap();
    cursor.position() as usize
}

/// RGB halves with alpha in front of them.
pub(super) fn rgba_exr(size: (usize, usize), compression: Compression, blocks: Blocks) -> Vec<u8> {
    let ramp = |factor: f32| move |x: usize, y: usize| factor * (x * x + 7 * y) as f32;
    let channels = vec![
        ("R", halves(size, ramp(1.0))),
        ("G", floats(size, ramp(0.5))),
        ("B", halves(size, ramp(0.25))),
        ("A", halves(size, |_, _| 1.0)),
    ];
    exr_file(size, encoding(compression, blocks), channels)
}

/// Level 0 is 1, level 1 is 2, …; tiles of 4 × 4.
pub(super) fn mip_mapped_exr((width, height): (usize, usize)) -> Vec<u8> {
    let levels = |factor: f32| {
        let sizes = exr::meta::mip_map_levels(RoundingMode::Down, Vec2(width, height));
        let level_data = sizes.map(|(level, Vec2(w, h))| floats((w, h), |_, _| factor * (level + 1) as f32)).collect();
        Levels::Mip { rounding_mode: RoundingMode::Down, level_data }
    };
    let channels = ["R", "G", "B"].into_iter().zip([1.0, 10.0, 100.0]);
    let channels = channels.map(|(name, factor)| AnyChannel::new(name, levels(factor))).collect();
    let encoding = encoding(Compression::RLE, Blocks::Tiles(Vec2(4, 4)));
    let layer = Layer::new((width, height), LayerAttributes::default(), encoding, AnyChannels::sort(channels));
    let mut bytes = Cursor::new(Vec::new());
    ExrImage::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

/// Three parts: depth only, red 1 + y, green 2 + y, blue 3 + y, and something else in colour.
pub(super) fn parts_exr(size: (usize, usize)) -> Vec<u8> {
    let part = |name: &str, channels: &[(&'static str, f32)]| {
        let attributes = LayerAttributes { layer_name: Some(Text::from(name)), ..LayerAttributes::default() };
        let channels = channels.iter().map(|(name, value)| (*name, floats(size, |_, y| value + y as f32)));
        layer(size, encoding(Compression::ZIP16, Blocks::ScanLines), attributes, channels.collect())
    };
    let depth = part("depth", &[("Z", 9.0)]);
    let first = part("first", &[("R", 1.0), ("G", 2.0), ("B", 3.0)]);
    let second = part("second", &[("R", 4.0), ("G", 5.0), ("B", 6.0)]);
    let layers: Layers<AnyChannels<FlatSamples>> = [depth, first, second].into_iter().collect();
    let mut bytes = Cursor::new(Vec::new());
    let image = ExrImage::from_layers(ImageAttributes::with_size(size), layers);
    image.write().non_parallel().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

pub(super) fn by_image_crate(image: impl Into<DynamicImage>, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    image.into().write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

/// A PNG put together by hand, for the kinds no encoder at hand writes: `rows` packed as the standard says.
pub(super) fn png(size: (u32, u32), depth: u8, colour: u8, chunks: &[(&[u8; 4], &[u8])], rows: &[&[u8]]) -> Vec<u8> {
    let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
    let size = [size.0.to_be_bytes(), size.1.to_be_bytes()];
    png_chunk(&mut file, b"IHDR", &[size.as_flattened(), &[depth, colour, 0, 0, 0]].concat());
    for (kind, content) in chunks {
        png_chunk(&mut file, kind, content);
    }
    let raw: Vec<u8> = rows.iter().flat_map(|row| std::iter::once(&0).chain(*row)).copied().collect();
    let length = raw.len() as u16;
    let mut zlib = vec![0x78, 0x01, 0x01]; // one stored block
    zlib.extend(length.to_le_bytes());
    zlib.extend((!length).to_le_bytes());
    zlib.extend(&raw);
    let (a, b) = raw.iter().fold((1_u32, 0_u32), |(a, b), byte| {
        let a = (a + u32::from(*byte)) % 65521;
        (a, (b + a) % 65521)
    });
    zlib.extend((b << 16 | a).to_be_bytes());
    png_chunk(&mut file, b"IDAT", &zlib);
    png_chunk(&mut file, b"IEND", &[]);
    file
}

fn png_chunk(file: &mut Vec<u8>, kind: &[u8; 4], content: &[u8]) {
    file.extend((content.len() as u32).to_be_bytes());
    let start = file.len();
    file.extend(kind);
    file.extend(content);
    let crc = file[start..].iter().fold(u32::MAX, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 })
    });
    file.extend((!crc).to_be_bytes());
}

/// One small sound file of every kind, for mistreatment.
pub(super) fn all() -> Vec<(String, Vec<u8>)> {
    let mut files = Vec::new();
    let size = (13, 9);
    for compression in COMPRESSIONS {
        for (name, blocks) in [("rows", Blocks::ScanLines), ("tiles", Blocks::Tiles(Vec2(8, 8)))] {
            files.push((format!("exr {compression:?} {name}"), rgba_exr(size, compression, blocks)));
        }
    }
    let integer = vec![("Y", integers(size, |x, y| (x * y) as u32))];
    files.push(("exr integers".to_owned(), exr_file(size, encoding(Compression::PIZ, Blocks::ScanLines), integer)));
    files.push(("exr parts".to_owned(), parts_exr(size)));
    files.push(("exr resolutions".to_owned(), mip_mapped_exr(size)));

    let grey = image::GrayImage::from_fn(13, 9, |x, y| image::Luma([(x * 19 + y) as u8]));
    let colour = image::RgbImage::from_fn(13, 9, |x, y| image::Rgb([x as u8 * 19, y as u8 * 28, 77]));
    let alpha = DynamicImage::from(colour.clone()).to_rgba8();
    let deep = DynamicImage::from(colour.clone()).to_rgb16();
    let float = DynamicImage::from(colour.clone()).to_rgb32f();
    for format in [ImageFormat::Png, ImageFormat::Tiff] {
        files.push((format!("{format:?} grey"), by_image_crate(grey.clone(), format)));
        files.push((format!("{format:?} colour"), by_image_crate(colour.clone(), format)));
        files.push((format!("{format:?} alpha"), by_image_crate(alpha.clone(), format)));
        files.push((format!("{format:?} deep"), by_image_crate(deep.clone(), format)));
    }
    files.push(("Tiff float".to_owned(), by_image_crate(float.clone(), ImageFormat::Tiff)));
    files.push(("Hdr".to_owned(), by_image_crate(float, ImageFormat::Hdr)));
    files.push(("Jpeg grey".to_owned(), by_image_crate(grey, ImageFormat::Jpeg)));
    files.push(("Jpeg colour".to_owned(), by_image_crate(colour, ImageFormat::Jpeg)));
    files
}
