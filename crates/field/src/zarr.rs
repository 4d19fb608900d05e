//! The Zarr v3 metadata of a field's arrays (zarr-specs, core protocol 3.0 and the `sharding_indexed` codec).

use serde_json::{Value, json};

use crate::Header;

/// Level of zstd: what it costs more above this it does not earn on noisy halves.
pub(crate) const ZSTD_LEVEL: i32 = 1;

/// The arrays of a field besides `transfer`: small, and each value is there.
pub(crate) const DIRECTION: &str = "direction";
pub(crate) const MEASURE: &str = "measure";
pub(crate) const SCALE: &str = "scale";
pub(crate) const PRESENT: &str = "present";
pub(crate) const CLIPPED: &str = "clipped";
pub(crate) const TRANSFER: &str = "transfer";
pub(crate) const PACKED: &str = "packed";

pub(crate) fn group(attributes: &Value) -> Value {
    json!({ "zarr_format": 3, "node_type": "group", "attributes": attributes })
}

fn zstd() -> Value {
    json!({ "name": "zstd", "configuration": { "level": ZSTD_LEVEL, "checksum": true } })
}

fn little_endian() -> Value {
    json!({ "name": "bytes", "configuration": { "endian": "little" } })
}

/// An array whose chunks are `chunk` large, zstd-compressed.
pub(crate) fn array(data_type: &str, shape: &[usize], chunk: &[usize], names: &[&str], unit: &str) -> Value {
    let bytes = if ["uint8", "int8"].contains(&data_type) { json!({ "name": "bytes" }) } else { little_endian() };
    json!({
        "zarr_format": 3,
        "node_type": "array",
        "shape": shape,
        "data_type": data_type,
        "chunk_grid": { "name": "regular", "configuration": { "chunk_shape": chunk } },
        "chunk_key_encoding": { "name": "default", "configuration": { "separator": "/" } },
        "fill_value": 0,
        "codecs": [bytes, zstd()],
        "dimension_names": names,
        "attributes": { "unit": unit },
    })
}

/// The file of [`rows_of_bytes`]: its one chunk.
pub(crate) const ROWS: &str = "c.0.0";

/// Bytes in rows, each compressed by itself, all in one shard: the file [`ROWS`] beside the array's metadata.
pub(crate) fn rows_of_bytes(shape: [usize; 2], names: [&str; 2], attributes: &Value) -> Value {
    let mut rows = array("uint8", &shape, &shape, &names, "");
    rows["attributes"] = attributes.clone();
    rows["chunk_key_encoding"]["configuration"]["separator"] = json!(".");
    rows["codecs"] = json!([{
        "name": "sharding_indexed",
        "configuration": {
            "chunk_shape": [1, shape[1]],
            "codecs": [{ "name": "bytes" }, zstd()],
            "index_codecs": [little_endian(), { "name": "crc32c" }],
            "index_location": "end",
        },
    }]);
    rows
}

/// The array of transfers: a shard is one tile of pixels of one position, its inner chunks are blocks of one square.
pub(crate) fn transfer(header: &Header) -> Value {
    let squares = header.squares();
    let positions = match &header.positions {
        crate::LayoutRecord::Grid { azimuths, tilts } => azimuths * tilts,
        crate::LayoutRecord::List { positions_deg } => positions_deg.len(),
    };
    let [width, height] = header.picture;
    let blocks = header.blocks();
    let ([tile_height, tile_width], [block_height, block_width]) = (blocks.tile(), blocks.block());
    json!({
        "zarr_format": 3,
        "node_type": "array",
        "shape": [positions, squares, squares, 3, height, width],
        "data_type": "float16",
        "chunk_grid": {
            "name": "regular",
            "configuration": { "chunk_shape": [1, squares, squares, 3, tile_height, tile_width] },
        },
        "chunk_key_encoding": { "name": "default", "configuration": { "separator": "/" } },
        "fill_value": 0.0,
        "codecs": [{
            "name": "sharding_indexed",
            "configuration": {
                "chunk_shape": [1, 1, 1, 3, block_height, block_width],
                "codecs": [little_endian(), zstd()],
                "index_codecs": [little_endian(), { "name": "crc32c" }],
                "index_location": "end",
            },
        }],
        "dimension_names": ["position", "v", "u", "channel", "y", "x"],
        "attributes": { "unit": Header::UNITS },
    })
}
