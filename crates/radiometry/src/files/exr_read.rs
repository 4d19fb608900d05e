//! OpenEXR in: half, float or integer samples, scan lines or tiles, every compression the `exr` crate undoes.
//!
//! The picture is the display window of the first part that has colour: the channels `R`, `G`, `B`, or a single
//! luminance `Y` as grey; where these are missing, the first layer by name that has them (`beauty.R`, …). Pixels of the
//! display window outside the data window were not rendered and are 0; pixels of the data window outside the display
//! window are overscan and are dropped. Of several resolutions the largest is read.
//!
//! Only header parsing and decompression are left to the `exr` crate. Its own readers believe sizes in tables and
//! blocks before they look at the length of the file, and asked for 10 – 46 GB on malformed ones. Here every table
//! entry and block is found in the bytes first ("OpenEXR File Layout").

use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};

use exr::block::UncompressedBlock;
use exr::block::chunk::{Chunk, CompressedBlock, CompressedScanLineBlock, CompressedTileBlock, TileCoordinates};
use exr::compression::Compression;
use exr::math::Vec2;
use exr::meta::header::Header;
use exr::meta::{BlockDescription, MetaData, compute_block_count};
use rayon::prelude::*;

use super::error::{Fault, check_size};
use super::exr_canvas::{Canvas, Channel, Window};
use crate::{Image, Linear};

/// Channels a part may have; films carry some tens.
const MAX_CHANNELS: usize = 1024;
/// Pixels along a tile.
const MAX_TILE_SIDE: usize = 1 << 15;
/// Pixels of a display window that need not be covered.
const MAX_UNCOVERED: usize = 1 << 24;
/// Unpacked bytes of one block: a tile of 8192² with RGBA halves.
const MAX_BLOCK_BYTES: usize = 1 << 29;
/// Unpacked bytes held at a time, beside the picture.
const BATCH_BYTES: usize = 1 << 26;

pub(super) fn decode(bytes: &[u8]) -> Result<Image<Linear>, Fault> {
    let mut cursor = Cursor::new(bytes);
    let meta = MetaData::read_from_buffered(&mut cursor, false).map_err(fault)?;
    MetaData::validate(&meta.headers, false).map_err(fault)?;
    let tables = usize::try_from(cursor.position()).map_err(|_| Fault::early_end())?;

    let (part, channels) = choose_part(&meta.headers)?;
    let header = &meta.headers[part];
    let block_bytes = check_header(header)?;
    let blocks = find_blocks(bytes, tables, &meta, part)?;

    let mut canvas = Canvas::new(header, channels);
    // Blocks unpack side by side, a batch at a time, and land in the order of the file: no thread changes the result.
    for batch in blocks.chunks((BATCH_BYTES / block_bytes.max(1)).clamp(1, 1024)) {
        let unpacked: Vec<_> = batch.par_iter().map(|block| unpack(block, &meta, part)).collect::<Result<_, _>>()?;
        for block in &unpacked {
            canvas.place(block);
        }
    }
    Ok(canvas.image)
}

/// Unpacks one block.
fn unpack(block: &Block, meta: &MetaData, part: usize) -> Result<UncompressedBlock, Fault> {
    let header = &meta.headers[part];
    check_counters(block, header)?;
    let unpack = || UncompressedBlock::decompress_chunk(block.to_chunk(part), meta, false).map_err(fault);
    if !matches!(header.compression, Compression::B44 | Compression::B44A) {
        return unpack();
    }
    // Found by fuzzing: the differences of B44 are meant to wrap around, as they do in C, but builds that check for
    // overflow panic in them. Nothing outside the block is touched.
    catch_unwind(AssertUnwindSafe(unpack)).unwrap_or_else(|_| Err(Fault::damaged("a B44 block that overflows")))
}

/// DWA blocks begin with eleven counters, which the exr crate believes: it allocates what they say.
fn check_counters(block: &Block, header: &Header) -> Result<(), Fault> {
    let Vec2(width, height) = block.size(header).ok_or_else(|| Fault::damaged("a block outside the picture"))?;
    let stored = block.packed.len() == width * height * header.channels.bytes_per_pixel;
    if stored || !matches!(header.compression, Compression::DWAA(_) | Compression::DWAB(_)) {
        return Ok(());
    }
    // Sizes of what is unpacked in bytes, and counts of coefficients, at most one a sample of whole 8 × 8 squares.
    let most = 8 * (width.next_multiple_of(8) * height.next_multiple_of(8) * header.channels.list.len()) + 1024;
    let absurd = [1, 6, 7, 8, 9].into_iter().any(|index: usize| {
        let counter = block.packed.get(8 * index..).and_then(<[u8]>::first_chunk);
        counter.is_some_and(|counter| u64::from_le_bytes(*counter) > most as u64)
    });
    if absurd { Err(Fault::damaged("a DWA block with absurd counters")) } else { Ok(()) }
}

fn fault(error: exr::error::Error) -> Fault {
    match error {
        exr::error::Error::NotSupported(reason) => Fault::unsupported(reason),
        exr::error::Error::Invalid(reason) if reason == "reference to missing bytes" => Fault::early_end(),
        exr::error::Error::Invalid(reason) => Fault::damaged(format!("invalid {reason}")),
        other => Fault::damaged(other.to_string()),
    }
}

/// The first part with colour, and its channels for red, green and blue.
fn choose_part(headers: &[Header]) -> Result<(usize, [Channel; 3]), Fault> {
    for (part, header) in headers.iter().enumerate() {
        if let Some(channels) = choose_channels(header)? {
            return Ok((part, channels));
        }
    }
    let names = headers.iter().flat_map(|header| &header.channels.list).map(|channel| channel.name.to_string());
    let names: Vec<_> = names.take(20).collect();
    Err(Fault::unsupported(format!("expected channels R, G, B or Y, found {}", names.join(", "))))
}

fn choose_channels(header: &Header) -> Result<Option<[Channel; 3]>, Fault> {
    let list = &header.channels.list;
    if list.len() > MAX_CHANNELS {
        return Err(Fault::unsupported(format!("{} channels, at most {MAX_CHANNELS} are expected", list.len())));
    }
    let find = |layer: &[u8], name: &[u8]| {
        let wanted = [layer, name].concat();
        let mut channels = header.channels.channels_with_byte_offset();
        let (bytes_before, channel) = channels.find(|(_, channel)| channel.name.bytes() == wanted)?;
        Some(Channel { bytes_before, sample: channel.sample_type })
    };
    // "" is the layer without a name; it comes first.
    let named = list.iter().filter_map(|channel| match channel.name.bytes() {
        [layer @ .., b'R' | b'Y'] if layer.ends_with(b".") => Some(layer),
        _ => None,
    });
    for layer in std::iter::once(&b""[..]).chain(named) {
        if let (Some(r), Some(g), Some(b)) = (find(layer, b"R"), find(layer, b"G"), find(layer, b"B")) {
            return Ok(Some([r, g, b]));
        }
        if let Some(y) = find(layer, b"Y") {
            if find(layer, b"RY").is_some() || find(layer, b"BY").is_some() {
                return Err(Fault::unsupported("colour as luminance and chroma (Y, RY, BY)"));
            }
            return Ok(Some([y; 3]));
        }
    }
    Ok(None)
}

/// Believes the sizes in the header only within bounds; gives the unpacked bytes of a block.
fn check_header(header: &Header) -> Result<usize, Fault> {
    let Vec2(width, height) = header.layer_size;
    let display = header.shared_attributes.display_window;
    check_size(width as u64, height as u64)?;
    check_size(display.size.width() as u64, display.size.height() as u64)?;

    let Vec2(block_width, block_height) = header.max_block_pixel_size();
    if header.blocks.has_tiles() && block_width.max(block_height) > MAX_TILE_SIDE {
        return Err(Fault::unsupported(format!(
            "tiles of {block_width} × {block_height}, a side of at most {MAX_TILE_SIDE} is expected"
        )));
    }
    let bytes = block_width.min(width) * block_height.min(height) * header.channels.bytes_per_pixel;
    if bytes > MAX_BLOCK_BYTES {
        return Err(Fault::unsupported(format!("blocks of {bytes} bytes, at most {MAX_BLOCK_BYTES} are expected")));
    }

    // A few bytes must not claim a picture of gigabytes: pixels that no block covers are black, and few are expected.
    let (shown, covered) = (display.size.width() * display.size.height(), width * height);
    if shown > MAX_UNCOVERED && shown / 16 > covered {
        return Err(Fault::unsupported(format!(
            "a display window of {} × {} around only {width} × {height} pixels",
            display.size.width(),
            display.size.height()
        )));
    }
    let (data, display) = (Window::of(header.data_window()), Window::of(display));
    if !data.overlaps(display) {
        return Err(Fault::damaged("its data window lies outside its display window"));
    }
    Ok(bytes)
}

/// A block as it lies in the file.
struct Block<'a> {
    place: Place,
    packed: &'a [u8],
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Place {
    /// `y` of the first row of the block, in the pixels of the data window's plane.
    Rows { y: i32 },
    /// Tile row, tile column, of the largest resolution.
    Tile { row: usize, column: usize },
}

impl Block<'_> {
    /// Columns and rows, cut off at the edge of the picture; `None` outside.
    fn size(&self, header: &Header) -> Option<Vec2<usize>> {
        let (size, block) = (header.layer_size, header.max_block_pixel_size());
        let (x, y) = match self.place {
            Place::Rows { y } => (0, usize::try_from(y.checked_sub(header.own_attributes.layer_position.y())?).ok()?),
            Place::Tile { row, column } => (column.checked_mul(block.x())?, row.checked_mul(block.y())?),
        };
        let (width, height) = (size.x().checked_sub(x)?.min(block.x()), size.y().checked_sub(y)?.min(block.y()));
        (width > 0 && height > 0).then_some(Vec2(width, height))
    }

    fn to_chunk(&self, layer_index: usize) -> Chunk {
        let compressed_pixels_le = self.packed.to_vec();
        let compressed_block = match self.place {
            Place::Rows { y } => {
                CompressedBlock::ScanLine(CompressedScanLineBlock { y_coordinate: y, compressed_pixels_le })
            }
            Place::Tile { row, column } => CompressedBlock::Tile(CompressedTileBlock {
                coordinates: TileCoordinates { tile_index: Vec2(column, row), level_index: Vec2(0, 0) },
                compressed_pixels_le,
            }),
        };
        Chunk { layer_index, compressed_block }
    }
}

/// Follows the offset table of `part` to its blocks of the largest resolution: each once, none missing.
fn find_blocks<'a>(bytes: &'a [u8], tables: usize, meta: &MetaData, part: usize) -> Result<Vec<Block<'a>>, Fault> {
    // The tables of all parts stand one after the other, 8 bytes an entry.
    let entries_before =
        meta.headers[..part].iter().try_fold(0_usize, |sum, header| sum.checked_add(header.chunk_count));
    let header = &meta.headers[part];
    let table = entries_before
        .and_then(|before| tables.checked_add(before.checked_mul(8)?))
        .and_then(|start| bytes.get(start..start.checked_add(header.chunk_count.checked_mul(8)?)?))
        .ok_or_else(Fault::early_end)?;

    let multipart = meta.requirements.has_multiple_layers;
    let mut blocks = Vec::new();
    let mut packed_bytes = 0;
    for entry in table.as_chunks::<8>().0 {
        let offset = u64::from_le_bytes(*entry);
        if offset == 0 {
            return Err(Fault::damaged("its writer did not finish: the offset table has empty entries"));
        }
        let rest = usize::try_from(offset).ok().and_then(|offset| bytes.get(offset..)).ok_or_else(Fault::early_end)?;
        let mut input = Fields { rest };
        if multipart && usize::try_from(input.int()?) != Ok(part) {
            return Err(Fault::damaged("the offset table points to a block of another part"));
        }
        let place = match header.blocks {
            BlockDescription::ScanLines => Some(Place::Rows { y: input.int()? }),
            BlockDescription::Tiles(_) => {
                let [column, row, level_x, level_y] = [input.int()?, input.int()?, input.int()?, input.int()?];
                let index = |int| usize::try_from(int).map_err(|_| Fault::damaged("a tile with a negative index"));
                let tile = Place::Tile { row: index(row)?, column: index(column)? };
                ((level_x, level_y) == (0, 0)).then_some(tile)
            }
        };
        let packed = input.sized()?;
        // Blocks that share bytes make a small file unpack for hours.
        packed_bytes += packed.len();
        if packed_bytes > bytes.len() {
            return Err(Fault::damaged("blocks that overlap"));
        }
        blocks.extend(place.map(|place| Block { place, packed }));
    }
    check_complete(header, &mut blocks)?;
    Ok(blocks)
}

fn check_complete(header: &Header, blocks: &mut [Block]) -> Result<(), Fault> {
    let expected = match header.blocks {
        BlockDescription::ScanLines => header.chunk_count,
        BlockDescription::Tiles(tiles) => {
            compute_block_count(header.layer_size.width(), tiles.tile_size.width())
                * compute_block_count(header.layer_size.height(), tiles.tile_size.height())
        }
    };
    blocks.sort_by_key(|block| block.place);
    let repeated = blocks.windows(2).any(|pair| pair[0].place == pair[1].place);
    let (top, rows) = (header.own_attributes.layer_position.y(), header.compression.scan_lines_per_block());
    let askew = blocks.iter().any(|block| match block.place {
        Place::Rows { y } => (i64::from(y) - i64::from(top)).rem_euclid(rows as i64) != 0,
        Place::Tile { .. } => false,
    });
    if repeated || askew || blocks.len() != expected {
        return Err(Fault::damaged(format!("its blocks do not cover the picture ({} of {expected})", blocks.len())));
    }
    Ok(())
}

/// The little-endian fields of a block, checked against the end of the file.
struct Fields<'a> {
    rest: &'a [u8],
}

impl<'a> Fields<'a> {
    fn int(&mut self) -> Result<i32, Fault> {
        let (field, rest) = self.rest.split_first_chunk::<4>().ok_or_else(Fault::early_end)?;
        self.rest = rest;
        Ok(i32::from_le_bytes(*field))
    }

    fn sized(&mut self) -> Result<&'a [u8], Fault> {
        let size = usize::try_from(self.int()?).map_err(|_| Fault::damaged("a block of negative size"))?;
        self.rest.get(..size).ok_or_else(Fault::early_end)
    }
}
