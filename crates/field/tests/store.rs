//! What is written is read back, resumed where it stopped, and never silently damaged.

#![allow(clippy::unwrap_used)] // in helpers of tests too

use std::fs;
use std::path::{Path, PathBuf};

use half::f16;
use relumine_basis::{Cells, Layout, Partition, Pattern, Reach};
use relumine_field::{Damage, FieldError, FieldWriter, Header, PositionRecord, ReflectanceField};
use serde_json::json;

const WIDTH: usize = 150;
const HEIGHT: usize = 70;

fn header() -> Header {
    let reach = Reach::Near { radius_m: 2.0, pattern: Pattern::new(2, 0.3).unwrap() };
    let cells = Cells::new(Partition::new(Layout::Grid { azimuths: 2, tilts: 2 }).unwrap(), reach).unwrap();
    Header::new(&cells, [WIDTH, HEIGHT], Some("test".into()), json!({ "program": "test" }))
}

/// A value that names its place; square 3 of every position has no light, and square 2 only in the left part.
fn value(position: usize, square: usize, channel: usize, x: usize, y: usize) -> f16 {
    if square == 3 || (square == 2 && x > 20) {
        return f16::ZERO;
    }
    f16::from_f32((1 + position * 4 + square) as f32 + channel as f32 * 0.25 + (x * 7 + y * 3) as f32 / 64.0)
}

fn write_position(writer: &FieldWriter, position: usize) {
    for tile in writer.blocks().all_tiles() {
        let extent = writer.blocks().tile_extent(tile);
        let mut values = Vec::new();
        for square in 0..4 {
            for channel in 0..3 {
                for y in extent.rows.clone() {
                    values.extend(extent.columns.clone().map(|x| value(position, square, channel, x, y)));
                }
            }
        }
        writer.write_tile(position, tile, &values).unwrap();
    }
    let missing = if position == 1 { vec![3] } else { vec![] };
    let mut clipped = vec![0; WIDTH * HEIGHT];
    clipped[position] = 5;
    writer.finish_position(PositionRecord { position, scale: 0.125, missing, report: json!({}) }, &clipped).unwrap();
}

fn write_whole(path: &Path) {
    let writer = FieldWriter::open(path, header(), "input", false).unwrap();
    (0..4).for_each(|position| write_position(&writer, position));
    writer.finish().unwrap();
}

/// Every file below a folder with its bytes.
fn tree(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() { folders.push(path) } else { files.push((path.clone(), fs::read(&path).unwrap())) }
        }
    }
    files.sort();
    files.into_iter().map(|(path, bytes)| (path.strip_prefix(folder).unwrap().to_path_buf(), bytes)).collect()
}

#[test]
fn every_transfer_comes_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("field");
    write_whole(&path);
    let field = ReflectanceField::open(&path).unwrap();
    assert_eq!(field.picture_size(), (WIDTH, HEIGHT));
    for cell in 0..field.cells().len() {
        let picture = field.transfer(cell).unwrap();
        for (index, pixel) in picture.pixels().iter().enumerate() {
            for (channel, found) in pixel.iter().enumerate() {
                let expected = value(cell / 4, cell % 4, channel, index % WIDTH, index / WIDTH).to_f32() * 0.125;
                assert_eq!(*found, expected, "cell {cell}, pixel {index}, channel {channel}");
            }
        }
        assert_eq!(field.is_missing(cell), cell == 7);
    }
    assert_eq!(field.verify().unwrap(), []);
    assert!(!folder.path().join("field.partial").exists());
}

#[test]
fn blocks_without_light_are_not_stored() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("field");
    let writer = FieldWriter::open(&path, header(), "input", false).unwrap();
    for position in 0..4 {
        for tile in writer.blocks().all_tiles() {
            let pixels = writer.blocks().tile_extent(tile).pixels();
            writer.write_tile(position, tile, &vec![f16::ZERO; 4 * 3 * pixels]).unwrap();
        }
        let record = PositionRecord { position, scale: 1.0, missing: vec![], report: json!({}) };
        writer.finish_position(record, &[]).unwrap();
    }
    writer.finish().unwrap();
    // 4 squares × 6 blocks: an index of 16 bytes each and its checksum.
    assert_eq!(fs::metadata(path.join("transfer/c/0/0/0/0/0/0")).unwrap().len(), 4 * 6 * 16 + 4);
}

#[test]
fn a_field_written_in_two_goes_is_the_same_to_the_bit() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, resumed) = (folder.path().join("whole"), folder.path().join("resumed"));
    write_whole(&whole);
    let first = FieldWriter::open(&resumed, header(), "input", false).unwrap();
    write_position(&first, 2);
    drop(first);
    // A torn line of the journal is a position that is not done; a left-over temporary file is nothing.
    let journal = folder.path().join("resumed.partial/journal");
    let mut text = fs::read(&journal).unwrap();
    text.extend_from_slice(&text.clone()[..40]);
    fs::write(&journal, text).unwrap();
    fs::write(folder.path().join("resumed.partial/field/.x.partial-1"), "torn").unwrap();
    let second = FieldWriter::open(&resumed, header(), "input", false).unwrap();
    assert_eq!(second.remaining(), [0, 1, 3]);
    assert!(!resumed.exists());
    for position in [3, 0, 1] {
        write_position(&second, position);
    }
    second.finish().unwrap();
    assert_eq!(tree(&resumed), tree(&whole));
}

#[test]
fn what_happens_to_a_shard_before_the_field_is_finished_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("field");
    let shard = folder.path().join("field.partial/field/transfer/c/1/0/0/0/0/0");
    let writer = FieldWriter::open(&path, header(), "input", false).unwrap();
    write_position(&writer, 1);
    drop(writer);
    // A shard that is gone: nothing gets the name of a whole field.
    let bytes = fs::read(&shard).unwrap();
    fs::remove_file(&shard).unwrap();
    let writer = FieldWriter::open(&path, header(), "input", false).unwrap();
    for position in [0, 2, 3] {
        write_position(&writer, position);
    }
    let error = writer.finish().unwrap_err().to_string();
    assert!(error.contains("transfer/c/1/0/0/0/0/0") && error.contains("--force"), "{error}");
    assert!(!path.exists());
    // One of which a bit has flipped: its digest is that of what was written.
    let mut spoiled = bytes;
    spoiled[77] ^= 4;
    fs::write(&shard, spoiled).unwrap();
    FieldWriter::open(&path, header(), "input", false).unwrap().finish().unwrap();
    let damage = ReflectanceField::open(&path).unwrap().verify().unwrap();
    assert_eq!(damage, [Damage::Changed("transfer/c/1/0/0/0/0/0".into())]);
}

#[test]
fn what_is_there_is_not_overwritten_unasked() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("field");
    write_whole(&path);
    assert!(matches!(FieldWriter::open(&path, header(), "input", false), Err(FieldError::Exists { .. })));
    let writer = FieldWriter::open(&path, header(), "other input", true).unwrap();
    // Until the new one is whole, the old one stays.
    assert_eq!(ReflectanceField::open(&path).unwrap().verify().unwrap(), []);
    assert!(matches!(FieldWriter::open(&path, header(), "other input", true), Err(FieldError::Busy { .. })), "locked");
    write_position(&writer, 0);
    drop(writer);
    let writer = FieldWriter::open(&path, header(), "other input", true).unwrap();
    assert_eq!(writer.remaining(), [1, 2, 3], "the same input goes on");
    drop(writer);
    let writer = FieldWriter::open(&path, header(), "third", true).unwrap();
    assert_eq!(writer.remaining(), [0, 1, 2, 3], "another one starts afresh");
    (0..4).for_each(|position| write_position(&writer, position));
    writer.finish().unwrap();
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn an_unfinished_field_does_not_get_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("field");
    let writer = FieldWriter::open(&path, header(), "input", false).unwrap();
    write_position(&writer, 0);
    assert!(writer.finish().unwrap_err().to_string().contains("3 of 4 positions are not done"));
    assert!(!path.exists());
}

#[test]
fn verify_names_every_kind_of_damage() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("field");
    write_whole(&path);
    let shard = path.join("transfer/c/0/0/0/0/0/0");
    let mut bytes = fs::read(&shard).unwrap();
    bytes[100] ^= 1;
    fs::write(&shard, bytes).unwrap();
    fs::remove_file(path.join("transfer/c/1/0/0/0/0/0")).unwrap();
    fs::write(path.join("stray"), "").unwrap();
    let field = ReflectanceField::open(&path).unwrap();
    let damage = field.verify().unwrap();
    assert_eq!(
        damage,
        [
            Damage::Changed("transfer/c/0/0/0/0/0/0".into()),
            Damage::Missing("transfer/c/1/0/0/0/0/0".into()),
            Damage::Unlisted("stray".into())
        ]
    );
    assert!(matches!(field.transfer(0), Err(FieldError::Damaged { .. })), "a flipped bit is not silent");
    assert!(matches!(field.transfer(4), Err(FieldError::Read { .. })), "a missing shard is not black");
    assert!(field.transfer(8).is_ok());
}

#[test]
fn the_scale_puts_the_brightest_transfer_where_halves_are_finest() {
    for bound in [1e-9, 3e-5, 0.1, 1.0, 77.0, 1e6] {
        let scale = f64::from(FieldWriter::scale_for(bound));
        assert!(bound / scale <= 32768.0 && bound / scale > 16383.0, "{bound}: {scale}");
        assert_eq!(scale.log2().fract(), 0.0);
    }
    assert_eq!(FieldWriter::scale_for(0.0), 1.0);
    assert_eq!(FieldWriter::scale_for(f64::NAN), 1.0);
}

#[test]
fn a_writer_killed_while_it_renamed_loses_neither_field() {
    let folder = tempfile::tempdir().unwrap();
    let (path, replaced) = (folder.path().join("field"), folder.path().join("field.replaced"));
    write_whole(&path);
    // Killed between the two renames: the old field has no name. It gets it back.
    fs::rename(&path, &replaced).unwrap();
    assert!(matches!(FieldWriter::open(&path, header(), "new", false), Err(FieldError::Exists { .. })));
    assert_eq!(ReflectanceField::open(&path).unwrap().verify().unwrap(), []);
    // Killed before the old one was cleared away: the next writer clears it.
    fs::create_dir(&replaced).unwrap();
    fs::write(replaced.join("left"), "over").unwrap();
    let writer = FieldWriter::open(&path, header(), "new", true).unwrap();
    (0..4).for_each(|position| write_position(&writer, position));
    writer.finish().unwrap();
    assert!(!replaced.exists());
}

#[test]
fn an_unfinished_field_of_another_input_is_not_mixed_in() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("field");
    write_position(&FieldWriter::open(&path, header(), "one", false).unwrap(), 0);
    assert!(matches!(FieldWriter::open(&path, header(), "two", false), Err(FieldError::OtherUnfinished { .. })));
}
