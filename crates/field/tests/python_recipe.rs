//! The NumPy recipe of FORMAT.md, run as it stands there, reads what was written.
//!
//! It needs Python with `zarr` 3 and `numpy`: the program named by RELUMINE_PYTHON, or `python3`. `scripts/test` installs them.

#![allow(clippy::unwrap_used)] // in helpers of tests too

use std::path::Path;
use std::process::Command;

use half::f16;
use relumine_basis::{Cells, Layout, Partition, Pattern, Reach};
use relumine_field::{FieldWriter, Header, PositionRecord, ReflectanceField};
use serde_json::json;

fn recipe() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../FORMAT.md");
    let text = std::fs::read_to_string(path).unwrap();
    let start =
        text.find("```python recipe\n").expect("FORMAT.md has a block ```python recipe") + "```python recipe\n".len();
    let end = start + text[start..].find("```").unwrap();
    text[start..end].to_string()
}

/// Python with zarr, if there is one.
fn python() -> Option<String> {
    let program = std::env::var("RELUMINE_PYTHON").unwrap_or_else(|_| "python3".into());
    let found = Command::new(&program).args(["-c", "import numpy, zarr; assert zarr.__version__ >= '3'"]).output();
    if found.is_ok_and(|output| output.status.success()) {
        return Some(program);
    }
    eprintln!(
        "skipped: {program} has no zarr 3 and numpy, so the recipe of FORMAT.md is not run (scripts/test installs them)"
    );
    None
}

#[test]
fn the_recipe_is_at_most_twenty_lines() {
    assert!(recipe().lines().count() <= 20, "{} lines", recipe().lines().count());
}

#[test]
fn python_reads_every_transfer_and_knows_what_is_missing() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("field");
    let reach = Reach::Near { radius_m: 2.0, pattern: Pattern::new(2, 0.3).unwrap() };
    let cells = Cells::new(Partition::new(Layout::Grid { azimuths: 3, tilts: 1 }).unwrap(), reach).unwrap();
    let writer = FieldWriter::open(&path, Header::new(&cells, [270, 75], None, json!({})), "", false).unwrap();
    for position in 0..3 {
        for tile in writer.blocks().all_tiles() {
            let extent = writer.blocks().tile_extent(tile);
            let values: Vec<f16> = (0..4 * 3 * extent.pixels())
                .map(|i| {
                    f16::from_f32(if i % 4000 < 1500 { 0.0 } else { (i % 977 + position * 100 + tile[1] * 7) as f32 })
                })
                .collect();
            writer.write_tile(position, tile, &values).unwrap();
        }
        let missing = if position == 1 { vec![2] } else { vec![] };
        let record = PositionRecord { position, scale: 2f32.powi(-(position as i32)), missing, report: json!({}) };
        writer.finish_position(record, &[]).unwrap();
    }
    writer.finish().unwrap();
    // Sums and single values of every cell, as Python sees them.
    let script = format!(
        "{}\nimport json, sys\nout = []\nfor p in range(3):\n  for v in range(2):\n    for u in range(2):\n      \
         r = transfer(sys.argv[1], p, u, v)\n      out.append(None if r is None else [list(r.shape), float(r.sum(dtype='f8')), \
         [float(x) for x in r[70, 260]], [float(x) for x in r[3, 11]]])\nm = zarr.open_group(sys.argv[1], mode='r')\n\
         print(json.dumps([out, m['measure'][2].tolist(), m['direction'][:].tolist(), m.attrs['relumine']['format'], \
         int(m['clipped'][:].sum())]))\n",
        recipe()
    );
    let output = Command::new(python).arg("-W").arg("error").args(["-c", &script]).arg(&path).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let read: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let field = ReflectanceField::open(&path).unwrap();
    for cell in 0..12 {
        if cell == 4 + 2 {
            assert!(read[0][cell].is_null());
            continue;
        }
        let picture = field.transfer(cell).unwrap();
        let sum: f64 = picture.pixels().iter().flatten().map(|value| f64::from(*value)).sum();
        assert_eq!(read[0][cell][0], json!([75, 270, 3]));
        assert!((read[0][cell][1].as_f64().unwrap() / sum - 1.0).abs() < 1e-12);
        assert_eq!(read[0][cell][2], json!(picture.pixel(260, 70).map(f64::from)));
        assert_eq!(read[0][cell][3], json!(picture.pixel(11, 3).map(f64::from)));
    }
    assert_eq!(read[1][1][0], json!(cells.measure(10)));
    assert!((read[2][1][0].as_f64().unwrap() - 180.0).abs() < 1e-9);
    assert_eq!((&read[3], &read[4]), (&json!("relumine-field/1"), &json!(0)));
}
