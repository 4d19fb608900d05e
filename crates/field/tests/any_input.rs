//! A damaged field is found out: a flipped bit or a torn file gives an error or the light that was written, never other
//! light and never a panic.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{LazyLock, Mutex, PoisonError};

use half::f16;
use proptest::prelude::*;
use proptest::sample::Index;
use relumine_basis::{Cells, Layout, Partition, Pattern, Reach};
use relumine_field::packed::{Atoms, Ids, Keep, Patches, Sketch};
use relumine_field::{Damage, FieldError, FieldWriter, Header, Packing, PositionRecord, ReflectanceField};
use relumine_radiometry::{Image, Transfer};
use tempfile::TempDir;

/// Two positions, 2 × 2 squares, 70 × 5 pixels: two blocks a square, one tile.
const SIZE: [usize; 2] = [70, 5];

struct Written {
    /// All files with their bytes, by name.
    files: Vec<(String, Vec<u8>)>,
    transfers: Vec<Image<Transfer>>,
}

/// With halves of every square, and the same packed.
static WRITTEN: LazyLock<Written> = LazyLock::new(|| Written::new(None));
static PACKED: LazyLock<Written> = LazyLock::new(|| Written::new(Some(Packing { error: 0.02 })));

impl Written {
    fn new(packing: Option<Packing>) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("small.field");
        let reach = Reach::Near { radius_m: 2.0, pattern: Pattern::new(2, 0.3).expect("a pattern") };
        let cells = Cells::new(Partition::new(Layout::Grid { azimuths: 2, tilts: 1 }).expect("a partition"), reach);
        let mut header = Header::new(&cells.expect("cells"), SIZE, Some("small".into()), serde_json::Value::Null);
        header.packing = packing;
        let writer = FieldWriter::open(&path, header, "any input", false).expect("a writer");
        let plane = SIZE[0] * SIZE[1];
        for position in 0..2 {
            // Noise in most squares; one is dark and has no block.
            let value = |i: usize| if i / (3 * plane) == 1 { 0.0 } else { ((i * 7919 + position) % 1009) as f32 / 8.0 };
            let values: Vec<f16> = (0..4 * 3 * plane).map(|i| f16::from_f32(value(i))).collect();
            match packing {
                None => writer.write_tile(position, [0, 0], &values).expect("a tile"),
                Some(Packing { error }) => {
                    let sketch = |extent: &relumine_field::Extent| {
                        let rows = values.chunks_exact(SIZE[0]).flat_map(|row| &row[extent.columns.clone()]);
                        let patches = Patches::new(extent.rows.len(), extent.columns.len());
                        (
                            Sketch::new(&patches, 2, &rows.copied().collect::<Vec<_>>(), 0.25, &Keep::for_error(error)),
                            (),
                        )
                    };
                    writer.write_sketches(position, [0, 0], sketch).expect("sketches");
                }
            }
            let missing = if position == 1 { vec![3] } else { vec![] };
            let record =
                PositionRecord { position, scale: 0.25, missing, report: serde_json::json!({ "seconds": 1.5 }) };
            let mut clipped = vec![0; plane];
            clipped[17] = 2;
            writer.finish_position(record, &clipped).expect("a position");
        }
        if packing.is_some() {
            writer.all_blocks().for_each(|block| {
                writer.pack_sketched(block).expect("a block");
            });
        }
        writer.finish().expect("a field");
        let field = ReflectanceField::open(&path).expect("the field");
        let transfers = (0..field.cells().len()).map(|cell| field.transfer(cell).expect("a transfer")).collect();
        let mut files = Vec::new();
        list(&path, "", &mut files);
        files.sort();
        assert_eq!(files[0].0, "checksums.b3");
        Self { files, transfers }
    }
}

fn list(field: &Path, below: &str, files: &mut Vec<(String, Vec<u8>)>) {
    for entry in fs::read_dir(field.join(below)).expect("a folder") {
        let entry = entry.expect("an entry");
        let name = entry.file_name().into_string().expect("a name");
        let name = if below.is_empty() { name } else { format!("{below}/{name}") };
        if entry.path().is_dir() {
            list(field, &name, files);
        } else {
            files.push((name, fs::read(entry.path()).expect("a file")));
        }
    }
}

/// A copy of the field for one test.
struct Spoiled {
    _folder: TempDir,
    path: PathBuf,
}

impl Spoiled {
    fn new(written: &Written) -> Mutex<Self> {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("copy.field");
        for (name, whole) in &written.files {
            let file = path.join(name);
            fs::create_dir_all(file.parent().expect("a folder")).expect("a folder");
            fs::write(&file, whole).expect("a file");
        }
        Mutex::new(Self { _folder: folder, path })
    }

    /// Calls `look` while one file has other bytes, or is not there.
    fn with_file(&self, (name, whole): &(String, Vec<u8>), bytes: Option<&[u8]>, look: impl FnOnce(&Path)) {
        let file = self.path.join(name);
        match bytes {
            Some(bytes) => fs::write(&file, bytes).expect("a file"),
            None => fs::remove_file(&file).expect("a file"),
        }
        let _mended = Mended { file, whole };
        look(&self.path);
    }
}

/// Puts a file back, also after a failure.
struct Mended<'a> {
    file: PathBuf,
    whole: &'a [u8],
}

impl Drop for Mended<'_> {
    fn drop(&mut self) {
        let _ = fs::write(&self.file, self.whole);
    }
}

/// All transfers, as far as they can be read.
fn transfers(path: &Path) -> Result<Vec<Image<Transfer>>, FieldError> {
    let field = ReflectanceField::open(path)?;
    (0..field.cells().len()).map(|cell| field.transfer(cell)).collect()
}

/// Holds a field in which the file `name` is damaged against the one that was written.
fn check(written: &Written, path: &Path, name: &str, what: &str) {
    match transfers(path) {
        Ok(found) => {
            // The metadata are not held against their digest when a field is opened: `verify` does that.
            assert!(name == "zarr.json" || found == written.transfers, "{name}, {what}: other light, and no error");
        }
        Err(error) => assert!(error.to_string().contains("copy.field"), "{name}, {what}: {error}"),
    }
    // Whatever a reader makes of it, the list of digests finds it, unless the metadata cannot be read at all.
    let Ok(field) = ReflectanceField::open(path) else { return };
    match field.verify() {
        // A digest in capitals says the same.
        Ok(damage) if name == "checksums.b3" => {
            let (found, whole) = (fs::read(path.join(name)).expect("the list"), &written.files[0].1);
            assert!(!damage.is_empty() || found.eq_ignore_ascii_case(whole), "{what}");
        }
        Ok(damage) => assert_eq!(damage, [Damage::Changed(name.into())], "{what}"),
        Err(error) => assert!(name == "checksums.b3" && error.to_string().contains(name), "{name}, {what}: {error}"),
    }
}

/// The same cases every time.
fn seeded(cases: u32) -> ProptestConfig {
    let rng_seed = proptest::test_runner::RngSeed::Fixed(2003);
    ProptestConfig { cases, rng_seed, failure_persistence: None, ..ProptestConfig::default() }
}

/// A field of either kind, and the copy that is spoiled. One test at a time spoils it.
fn of_kind(packed: bool) -> (&'static Written, &'static Mutex<Spoiled>) {
    static COPIES: [LazyLock<Mutex<Spoiled>>; 2] =
        [LazyLock::new(|| Spoiled::new(&WRITTEN)), LazyLock::new(|| Spoiled::new(&PACKED))];
    (if packed { &PACKED } else { &WRITTEN }, &COPIES[usize::from(packed)])
}

proptest! {
    #![proptest_config(seeded(600))]

    #[test]
    fn a_flipped_bit_is_never_silent(packed in any::<bool>(), file in any::<Index>(), at in any::<Index>(), bit in 0..8_u8) {
        let (written, copy) = of_kind(packed);
        let file = file.get(&written.files);
        let mut bytes = file.1.clone();
        let at = at.index(bytes.len());
        bytes[at] ^= 1_u8 << bit;
        let what = format!("bit {bit} of byte {at} flipped");
        let copy = copy.lock().unwrap_or_else(PoisonError::into_inner);
        copy.with_file(file, Some(&bytes), |path| check(written, path, &file.0, &what));
    }

    #[test]
    fn a_torn_or_overwritten_file_is_never_silent(
        packed in any::<bool>(), file in any::<Index>(), at in any::<Index>(), tail in any::<Option<Vec<u8>>>()
    ) {
        let (written, copy) = of_kind(packed);
        let file = file.get(&written.files);
        let at = at.index(file.1.len());
        let bytes = [&file.1[..at], &tail.unwrap_or_default()].concat();
        prop_assume!(bytes != file.1);
        let what = format!("other bytes from {at} on");
        let copy = copy.lock().unwrap_or_else(PoisonError::into_inner);
        copy.with_file(file, Some(&bytes), |path| check(written, path, &file.0, &what));
    }
}

#[test]
fn every_byte_of_a_shard_counts() {
    let copy = Spoiled::new(&WRITTEN).into_inner().expect("a copy");
    let file = WRITTEN.files.iter().find(|(name, _)| name == "transfer/c/0/0/0/0/0/0").expect("a shard");
    let mut bytes = file.1.clone();
    // Every byte near the end, where the index is, and some of the blocks.
    for at in (0..bytes.len()).filter(|at| at + 200 > file.1.len() || at % 61 == 0) {
        bytes[at] ^= 1_u8 << (at % 8);
        copy.with_file(file, Some(&bytes), |path| {
            if let Ok(found) = transfers(path) {
                assert!(found == WRITTEN.transfers, "byte {at}: other light, and no error");
            }
        });
        bytes[at] = file.1[at];
    }
}

#[test]
fn every_byte_of_a_packed_block_counts() {
    let copy = Spoiled::new(&PACKED).into_inner().expect("a copy");
    for file in PACKED.files.iter().filter(|(name, _)| name == "packed/0-1/c.0.0") {
        let mut bytes = file.1.clone();
        let every = bytes.len() / 150 + 1;
        for at in (0..bytes.len()).filter(|at| at + 40 > file.1.len() || at % every == 0) {
            bytes[at] ^= 1_u8 << (at % 8);
            copy.with_file(file, Some(&bytes), |path| match transfers(path) {
                Ok(found) => assert!(found == PACKED.transfers, "byte {at} of {}: other light, and no error", file.0),
                Err(error) => assert!(error.to_string().contains(&file.0), "byte {at} of {}: {error}", file.0),
            });
            bytes[at] = file.1[at];
        }
    }
}

proptest! {
    #![proptest_config(seeded(2000))]

    /// What [`Atoms::parse`] accepts can be read to the end: as many atoms as announced, each within what was asked.
    #[test]
    fn any_bytes_are_atoms_or_an_error(
        bytes in proptest::collection::vec(prop_oneof![3 => 0..3_u8, 1 => any::<u8>()], 0..200),
        patches in 0..4_usize, rank in 0..5_usize, squares in 0..5_usize
    ) {
        let ids = Ids::new(squares);
        if let Ok(atoms) = Atoms::parse(&bytes, patches, rank, ids) {
            let all: Vec<_> = (0..patches).flat_map(|patch| atoms.of(patch)).collect();
            prop_assert_eq!(all.len(), atoms.len());
            let mut wholes = (0..patches).filter_map(|patch| atoms.of(patch).next());
            prop_assert!(wholes.all(|whole| usize::from(whole.id) < ids.squares));
            for atom in all {
                prop_assert!(usize::from(atom.id) < ids.all && atom.coefficients.len() <= rank);
                prop_assert!(atom.exponent < Atoms::EXPONENTS);
            }
        }
    }
}

#[test]
fn a_file_that_is_not_there_is_found() {
    for written in [&WRITTEN, &PACKED] {
        let copy = Spoiled::new(written).into_inner().expect("a copy");
        for file in &written.files {
            copy.with_file(file, None, |path| {
                if let Ok(found) = transfers(path) {
                    assert!(found == written.transfers, "without {}: other light, and no error", file.0);
                }
                let Ok(field) = ReflectanceField::open(path) else { return };
                match field.verify() {
                    Ok(damage) => assert_eq!(damage, [Damage::Missing((&file.0).into())]),
                    Err(_) => assert_eq!(file.0, "checksums.b3"),
                }
            });
        }
        copy.with_file(&written.files[0], Some(&written.files[0].1), |path| {
            let field = ReflectanceField::open(path).expect("the field");
            assert_eq!(field.verify().expect("the digests"), []);
        });
    }
}

#[test]
fn a_changed_scale_is_found_when_the_field_is_opened() {
    let copy = Spoiled::new(&WRITTEN).into_inner().expect("a copy");
    let file = WRITTEN.files.iter().find(|(name, _)| name == "zarr.json").expect("the metadata");
    let text = String::from_utf8_lossy(&file.1).replace("0.25", "0.26");
    assert_ne!(text.as_bytes(), file.1);
    copy.with_file(file, Some(text.as_bytes()), |path| {
        assert!(transfers(path).is_err(), "other light, and no error");
    });
}

#[test]
fn a_picture_larger_than_any_is_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("large.field");
    let cells = Cells::new(Partition::new(Layout::Grid { azimuths: 1, tilts: 1 }).expect("a partition"), Reach::Far);
    let header = Header::new(&cells.expect("cells"), [65_536, 65_536], None, serde_json::Value::Null);
    // Nothing but metadata: no tile is written.
    if let Ok(writer) = FieldWriter::open(&path, header, "a claim", false) {
        let record = PositionRecord { position: 0, scale: 1.0, missing: vec![], report: serde_json::Value::Null };
        writer.finish_position(record, &[]).expect("a position");
        writer.finish().expect("a field");
        assert!(ReflectanceField::open(&path).is_err(), "a picture of 2³² pixels");
    }
}
