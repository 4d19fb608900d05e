//! A packed field of which one file has any bytes: it opens and gives pictures, or an error that names a file of it; and any
//! bytes as atoms. The first byte chooses.
#![no_main]

use std::fs;
use std::path::Path;
use std::sync::LazyLock;

use half::f16;
use libfuzzer_sys::fuzz_target;
use relumine_basis::{Cells, Layout, Partition, Pattern, Reach};
use relumine_field::packed::{Atoms, Ids, Keep, Patches, Sketch};
use relumine_field::{BlockBuffer, Extent, FieldWriter, Header, Packing, PositionRecord, ReflectanceField};

struct Field {
    _folder: tempfile::TempDir,
    path: std::path::PathBuf,
}

/// Nine positions, 2 × 2 squares, 20 × 3 pixels: one block of three patches.
static FIELD: LazyLock<Field> = LazyLock::new(|| {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("small.field");
    let reach = Reach::Near { radius_m: 2.0, pattern: Pattern::new(2, 0.3).expect("a pattern") };
    let layout = Layout::Grid { azimuths: 9, tilts: 1 };
    let cells = Cells::new(Partition::new(layout).expect("a partition"), reach).expect("cells");
    let mut header = Header::new(&cells, [20, 3], None, serde_json::Value::Null);
    header.packing = Some(Packing { error: 0.1 });
    let writer = FieldWriter::open(&path, header, "fuzz", false).expect("a writer");
    for position in 0..9 {
        let value = |i: usize| (i % 97 * (i / 180 % 2)) as f32 + (i % (7 + position)) as f32;
        let values: Vec<f16> = (0..4 * 3 * 20 * 3).map(|i| f16::from_f32(value(i))).collect();
        let sketch = |extent: &Extent| {
            let patches = Patches::new(extent.rows.len(), extent.columns.len());
            (Sketch::new(&patches, 2, &values, 0.5, &Keep::for_error(0.1)), ())
        };
        writer.write_sketches(position, [0, 0], sketch).expect("sketches");
        let record = PositionRecord { position, scale: 0.5, missing: vec![], report: serde_json::Value::Null };
        writer.finish_position(record, &[0; 60]).expect("a position");
    }
    writer.pack_sketched([0, 0]).expect("a block");
    writer.finish().expect("a field");
    Field { _folder: folder, path }
});

fuzz_target!(|bytes: &[u8]| {
    let Some((kind, bytes)) = bytes.split_first() else { return };
    let name = match kind {
        b'p' => return parse(bytes),
        b'g' => "zarr.json",
        b'k' => "packed/0-0/zarr.json",
        b'c' => "checksums.b3",
        _ => ROWS,
    };
    let file = FIELD.path.join(name);
    let whole = fs::read(&file).expect("a file of the field");
    let mut bytes = bytes.to_vec();
    match kind {
        b'a' | b'd' => {
            // `d`: the rows themselves, which are compressed; with the index's checksum made right in any case.
            if *kind == b'd' {
                bytes = shard(&bytes);
            }
            let index = bytes.len().saturating_sub(rows() * 16);
            bytes.extend(crc32c::crc32c(&bytes[index..]).to_le_bytes());
        }
        _ => {}
    }
    fs::write(&file, &bytes).expect("a file of the field");
    let result = check(&FIELD.path);
    fs::write(&file, whole).expect("a file of the field");
    if let Err(error) = result {
        assert!(error.contains("small.field"), "{error}");
    }
});

/// The file of the block: bases, steps and atoms.
const ROWS: &str = "packed/0-0/c.0.0";

/// Rows of the block: its bases in eights, the steps, and nine positions.
fn rows() -> usize {
    let field = ReflectanceField::open(&FIELD.path).expect("the field");
    field.block_records()[0].rank.div_ceil(8) + 1 + 9
}

/// The bytes cut in rows of the length that the field's record has, as frames that are not compressed, and their index.
fn shard(bytes: &[u8]) -> Vec<u8> {
    let field = ReflectanceField::open(&FIELD.path).expect("the field");
    let length = field.block_records()[0].bytes;
    let mut padded = bytes.to_vec();
    padded.resize(rows() * length, 0);
    let (mut shard, mut index) = (Vec::new(), Vec::new());
    for row in padded.chunks_exact(length) {
        let frame = frame(row);
        index.extend((shard.len() as u64).to_le_bytes());
        index.extend((frame.len() as u64).to_le_bytes());
        shard.extend(frame);
    }
    shard.extend(index);
    shard
}

/// A zstd frame of one raw block, without a checksum.
fn frame(raw: &[u8]) -> Vec<u8> {
    let mut frame = vec![0x28, 0xb5, 0x2f, 0xfd, 0xa0];
    frame.extend((raw.len() as u32).to_le_bytes());
    frame.extend(&((raw.len() as u32) << 3 | 1).to_le_bytes()[..3]);
    frame.extend(raw);
    frame
}

/// What is accepted can be read to the end. The first three bytes say how many patches, components and squares.
fn parse(bytes: &[u8]) {
    let Some(([patches, rank, squares], bytes)) = bytes.split_first_chunk() else { return };
    let (patches, rank) = (usize::from(*patches % 65), usize::from(*rank).min(Atoms::MOST_COEFFICIENTS));
    let ids = Ids::new(usize::from(*squares % 33));
    if let Ok(atoms) = Atoms::parse(bytes, patches, rank, ids) {
        let mut number = 0;
        for atom in (0..patches).flat_map(|patch| atoms.of(patch)) {
            assert!(usize::from(atom.id) < ids.all && atom.coefficients.len() <= rank && atom.exponent < Atoms::EXPONENTS);
            number += 1;
        }
        assert_eq!(number, atoms.len());
    }
}

fn check(path: &Path) -> Result<(), String> {
    let field = ReflectanceField::open(path).map_err(|error| error.to_string())?;
    field.verify().map_err(|error| error.to_string())?;
    // What a picture of the announced size needs is the caller's to judge.
    let (width, height) = field.picture_size();
    if width * height > 1 << 16 || field.cells().len() > 64 {
        return Ok(());
    }
    let mut buffer = BlockBuffer::new(&field.blocks()).map_err(|error| error.to_string())?;
    let mut values = Vec::new();
    for position in [0, 8].into_iter().filter(|position| *position < field.cells().positions()) {
        field.squares_of_block(position, [0, 0], &mut buffer, &mut values).map_err(|error| error.to_string())?;
        let square = field.cells().squares().pow(2) - 1;
        let cell = position * field.cells().squares().pow(2) + square;
        let picture = field.transfer(cell).map_err(|error| error.to_string())?;
        assert_eq!(picture.size(), (width, height));
    }
    Ok(())
}
