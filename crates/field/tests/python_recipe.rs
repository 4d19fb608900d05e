//! The NumPy recipe of FORMAT.md, run as it stands there, reads what was written.
//!
//! It needs Python with `zarr` 3 and `numpy`: the program named by RELUMINE_PYTHON, or `python3`. `scripts/test` installs them.

#![allow(clippy::unwrap_used)] // in helpers of tests too

use std::path::Path;
use std::process::Command;

use half::f16;
use relumine_basis::{Cells, Layout, Partition, Pattern, Reach};
use relumine_field::packed::{Keep, Patches, Sketch};
use relumine_field::{FieldWriter, Header, Packing, PositionRecord, ReflectanceField};
use serde_json::json;

fn recipe(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../FORMAT.md");
    let text = std::fs::read_to_string(path).unwrap();
    let fence = format!("```python {name}\n");
    let start = text.find(&fence).unwrap_or_else(|| panic!("FORMAT.md has a block {fence}")) + fence.len();
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
fn the_recipes_are_short() {
    // A packed field asks for a few more: its bytes are parsed.
    for (name, most) in [("recipe", 20), ("packed recipe", 32)] {
        let lines = recipe(name).lines().count();
        assert!(lines <= most, "{name}: {lines} lines");
    }
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
        recipe("recipe")
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

#[test]
fn python_reads_every_transfer_of_a_packed_field() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("packed");
    let (m, size) = (5, [70, 67]);
    let reach = Reach::Near { radius_m: 2.0, pattern: Pattern::new(m, 0.3).unwrap() };
    let cells = Cells::new(Partition::new(Layout::Grid { azimuths: 10, tilts: 1 }).unwrap(), reach).unwrap();
    let mut header = Header::new(&cells, size, None, json!({}));
    header.packing = Some(Packing { error: 0.02 });
    let writer = FieldWriter::open(&path, header, "", false).unwrap();
    for block in writer.all_blocks() {
        let extent = writer.blocks().block_extent(block);
        let patches = Patches::new(extent.rows.len(), extent.columns.len());
        let sketches: Vec<Sketch> = (0..10)
            .map(|position| {
                // A lit square that moves over the picture, and a little light from everywhere.
                let value = |square: usize, channel: usize, y: usize, x: usize| {
                    let lit = (x + 3 * position) / 15 % m + (y / 15 % m) * m == square;
                    let shade = 1.0 + 0.3 * ((x * y) as f32 * 0.01 + position as f32).sin();
                    f16::from_f32(shade * (1 + channel) as f32 * if lit { 8.0 } else { 0.05 })
                };
                let mut values = Vec::new();
                for index in 0..m * m * 3 {
                    for y in extent.rows.clone() {
                        values.extend(extent.columns.clone().map(|x| value(index / 3, index % 3, y, x)));
                    }
                }
                Sketch::new(&patches, m, &values, 0.5, &Keep::for_error(0.02))
            })
            .collect();
        writer.write_packed(block, &sketches).unwrap();
    }
    for position in 0..10 {
        let missing = if position == 9 { vec![24] } else { vec![] };
        writer.finish_position(PositionRecord { position, scale: 1.0, missing, report: json!({}) }, &[]).unwrap();
    }
    writer.finish().unwrap();
    let script = format!(
        "{}\nimport json, sys\nout = []\nfor p in (0, 7, 8, 9):\n  for s in (0, 7, 12, 24):\n    \
         r = packed_transfer(sys.argv[1], p, s % 5, s // 5)\n    \
         out.append(None if r is None else [float(x) for x in r.ravel()])\nprint(json.dumps(out))\n",
        recipe("packed recipe")
    );
    let output = Command::new(python).arg("-W").arg("error").args(["-c", &script]).arg(&path).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let read: Vec<Option<Vec<f32>>> = serde_json::from_slice(&output.stdout).unwrap();
    let field = ReflectanceField::open(&path).unwrap();
    let asked = [0, 7, 8, 9].into_iter().flat_map(|position| [0, 7, 12, 24].map(|square| position * m * m + square));
    for (cell, found) in asked.zip(read) {
        let Some(found) = found else {
            assert!(field.is_missing(cell));
            continue;
        };
        let picture = field.transfer(cell).unwrap();
        let brightest = picture.pixels().iter().flatten().copied().fold(0.0, f32::max);
        assert!(brightest > 0.0);
        for (ours, theirs) in picture.pixels().iter().flatten().zip(&found) {
            assert!((ours - theirs).abs() <= 1e-5 * brightest, "cell {cell}: {ours} against {theirs}");
        }
    }
}
