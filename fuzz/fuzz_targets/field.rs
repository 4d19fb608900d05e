//! A field of which one file has any bytes: it opens and gives pictures, or an error that names a file of it. The first
//! byte chooses the file.
#![no_main]

use std::fs;
use std::path::Path;
use std::sync::LazyLock;

use half::f16;
use libfuzzer_sys::fuzz_target;
use relumine_basis::{Cells, Layout, Partition, Pattern, Reach};
use relumine_field::{FieldWriter, Header, PositionRecord, ReflectanceField};

struct Field {
    _folder: tempfile::TempDir,
    path: std::path::PathBuf,
}

/// Two positions, 2 × 2 squares, 70 × 3 pixels: two blocks a square, one shard a position.
static FIELD: LazyLock<Field> = LazyLock::new(|| {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("small.field");
    let reach = Reach::Near { radius_m: 2.0, pattern: Pattern::new(2, 0.3).expect("a pattern") };
    let layout = Layout::Grid { azimuths: 2, tilts: 1 };
    let cells = Cells::new(Partition::new(layout).expect("a partition"), reach).expect("cells");
    let header = Header::new(&cells, [70, 3], None, serde_json::Value::Null);
    let writer = FieldWriter::open(&path, header, "fuzz", false).expect("a writer");
    for position in 0..2 {
        let values: Vec<f16> = (0..4 * 3 * 70 * 3).map(|i| f16::from_f32((i % 97 * (i / 630 % 2)) as f32)).collect();
        writer.write_tile(position, [0, 0], &values).expect("a tile");
        let record = PositionRecord { position, scale: 0.5, missing: vec![], report: serde_json::Value::Null };
        writer.finish_position(record, &[0; 210]).expect("a position");
    }
    writer.finish().expect("a field");
    Field { _folder: folder, path }
});

fuzz_target!(|bytes: &[u8]| {
    let Some((kind, bytes)) = bytes.split_first() else { return };
    let shard = "transfer/c/0/0/0/0/0/0";
    let name = match kind {
        b'g' => "zarr.json",
        b'a' => "transfer/zarr.json",
        b'c' => "checksums.b3",
        _ => shard,
    };
    let file = FIELD.path.join(name);
    let whole = fs::read(&file).expect("a file of the field");
    let mut bytes = bytes.to_vec();
    if *kind == b's' {
        // With the index's checksum made right: two blocks of four squares, 16 bytes an entry.
        let index = bytes.len().saturating_sub(4 * 2 * 16);
        bytes.extend(crc32c::crc32c(&bytes[index..]).to_le_bytes());
    }
    fs::write(&file, &bytes).expect("a file of the field");
    let result = check(&FIELD.path);
    fs::write(&file, whole).expect("a file of the field");
    if let Err(error) = result {
        assert!(error.contains("small.field"), "{error}");
    }
});

fn check(path: &Path) -> Result<(), String> {
    let field = ReflectanceField::open(path).map_err(|error| error.to_string())?;
    field.verify().map_err(|error| error.to_string())?;
    // What a picture of the announced size needs is the caller's to judge.
    let (width, height) = field.picture_size();
    if width * height > 1 << 16 || field.cells().len() > 64 {
        return Ok(());
    }
    for cell in 0..field.cells().len() {
        let picture = field.transfer(cell).map_err(|error| error.to_string())?;
        assert_eq!(picture.size(), (width, height));
    }
    Ok(())
}
