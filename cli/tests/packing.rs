//! Packing from outside: packed fields relight like the unpacked ones, come out the same however often the command is killed,
//! and never show damage as light.

#![cfg(unix)]
#![allow(clippy::unwrap_used)] // in helpers of tests too

mod support;

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use relumine::{ReflectanceField, kept, write_mosaic};
use support::studio::{Plan, Positions, Studio};
use support::{Numbers, assert_same_tree, flip_bit, leavings, program, read, relative_l2, relumine, shown, tree};

/// Ten positions, so that atoms lie in two chunks; pictures of two blocks.
fn studio() -> Studio {
    Studio::new(&Plan { positions: Positions::Grid(5, 2), size: (70, 33), ..Plan::default() })
}

/// Packs the developed field of a studio.
fn packed(studio: &Studio, error: &str) -> PathBuf {
    let field = studio.path(&format!("packed-{error}.field"));
    relumine!["pack", &studio.field(), "-o", &field, "--error", error].succeeds();
    field
}

/// A mosaic that lights some positions.
fn lighting(studio: &Studio, name: &str, positions: std::ops::Range<usize>) -> PathBuf {
    let field = ReflectanceField::open(&studio.field()).unwrap();
    let mut light = field.cells().dark();
    let squares = field.cells().squares().pow(2);
    for (index, value) in light.values_mut().iter_mut().enumerate() {
        if positions.contains(&(index / squares)) {
            *value = [0.5 + (index % 3) as f32, 1.0, 2.0];
        }
    }
    let path = studio.path(name);
    write_mosaic(&path, &light).unwrap();
    path
}

/// Files of the arrays of a packed field and all else in it.
fn files_of(field: &Path) -> Vec<String> {
    tree(field).into_keys().map(|name| name.to_str().unwrap().to_string()).collect()
}

#[test]
fn a_packed_field_relights_like_the_unpacked_one() {
    let studio = studio();
    let whole = studio.field();
    let lights = [studio.sky(), lighting(&studio, "some.exr", 2..4)];
    let size = |field: &Path| tree(field).values().map(Vec::len).sum::<usize>();
    let mut last = (1.0, 0);
    for error in ["0.1", "0.01"] {
        let field = packed(&studio, error);
        let [sky, some] = [0, 1].map(|index| {
            let relit = |field: &Path| studio.relit(field, &lights[index], &[]);
            relative_l2(relit(&field).pixels(), relit(&whole).pixels())
        });
        let error: f64 = error.parse().unwrap();
        assert!(sky < 0.5 * error && some < 2.0 * error && sky < last.0, "{sky} and {some} for {error}");
        assert!(size(&field) > last.1 && size(&field) < size(&whole), "{error}: {} bytes", size(&field));
        last = (sky, size(&field));
        let told = relumine!["inspect", &field].succeeds();
        assert!(told.stdout.contains("whole          yes"), "{told:#?}");
        // What `inspect --against` says is what was measured here.
        let told = relumine!["inspect", &field, "--against", &whole, "--light", &lights[1]].succeeds();
        let line = told.stdout.lines().find(|line| line.contains("some.exr")).unwrap();
        let said: f64 =
            line.split(&shown(&lights[1])).nth(1).unwrap().split_whitespace().next().unwrap().parse().unwrap();
        assert!((said - some).abs() < 2e-5, "{said} and {some}");
        for light in ["uniform", "smooth sky", "every cell at random", "two spots 1", "single cell 1", "worst"] {
            assert!(told.stdout.contains(light), "{light}: {told:#?}");
        }
    }
    let run = relumine!["pack", &whole, "-o", &studio.path("again.field"), "--error", "0.01"].succeeds();
    assert!(run.stderr.contains("in main squares"), "{run:#?}");
    let open = ReflectanceField::open(&studio.path("again.field")).unwrap();
    let kept = kept(&open);
    assert!(kept.squares + kept.coarse < kept.whole && kept.whole > 0.0, "{kept:?}");
    assert_same_tree(&studio.path("again.field"), &studio.path("packed-0.01.field"));
}

#[test]
fn lossless_loses_nothing() {
    let studio = studio();
    let (whole, copy) = (studio.field(), studio.path("copy.field"));
    relumine!["pack", &whole, "-o", &copy, "--lossless"].succeeds();
    assert_same_tree(&copy, &whole);
    // Of a packed field: its light, as halves.
    let (field, unpacked) = (packed(&studio, "0.05"), studio.path("unpacked.field"));
    relumine!["pack", &field, "-o", &unpacked, "--lossless"].succeeds();
    assert!(!ReflectanceField::open(&unpacked).unwrap().is_packed());
    for light in [studio.sky(), lighting(&studio, "some.exr", 1..2)] {
        let (a, b) = (studio.relit(&unpacked, &light, &[]), studio.relit(&field, &light, &[]));
        let off = relative_l2(a.pixels(), b.pixels());
        assert!(off < 1.0 / 2048.0, "{}: {off}", shown(&light));
    }
}

#[test]
fn developing_and_packing_at_once_is_the_same() {
    let studio = studio();
    let (field, at_once) = (packed(&studio, "0.02"), studio.path("once.field"));
    relumine!["develop", &studio.capture(), "-o", &at_once, "--error", "0.02"].succeeds();
    let arrays = |field: &Path| {
        let mut files = tree(field);
        // The list of digests holds those of the metadata.
        files.retain(|name, _| !name.ends_with("zarr.json") && !name.ends_with("checksums.b3"));
        files
    };
    assert_eq!(files_of(&at_once), files_of(&field));
    assert!(arrays(&at_once).len() >= 6, "{:?}", files_of(&at_once));
    assert!(arrays(&at_once) == arrays(&field), "other arrays");
    let light = studio.sky();
    assert_eq!(studio.relit(&at_once, &light, &[]), studio.relit(&field, &light, &[]));
}

#[test]
fn threads_and_memory_do_not_change_a_bit_of_a_packed_field() {
    let studio = studio();
    let field = packed(&studio, "0.02");
    for words in [["--threads", "1"], ["--threads", "5"], ["--memory", "0"]] {
        let other = studio.path(&format!("{}.field", words.concat()));
        relumine!["pack", &studio.field(), "-o", &other, "--error", "0.02", words[0], words[1]].succeeds();
        assert_same_tree(&other, &field);
    }
}

/// Runs a command that writes `output`, killed at ten moments of its time on the way, and expects it to end as `whole`.
#[track_caller]
fn killed_again_and_again(words: &[OsString], output: &Path, whole: &Path, seed: u64) {
    let mut numbers = Numbers(seed);
    let begin = Instant::now();
    support::run(words).succeeds();
    let unbroken = begin.elapsed();
    assert_same_tree(output, whole);
    fs::remove_dir_all(output).unwrap();
    let mut unfinished = 0;
    for kill in 0..10 {
        let mut command = Command::new(program());
        let mut child = command.args(words).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        std::thread::sleep(unbroken.mul_f64(numbers.below(1000) as f64 / 1000.0));
        child.kill().unwrap(); // SIGKILL
        child.wait().unwrap();
        if output.exists() {
            // It was too late: then it is whole, and the next begins anew.
            assert_same_tree(output, whole);
            fs::remove_dir_all(output).unwrap();
        } else {
            unfinished += 1;
        }
        if kill % 4 == 3 {
            support::run(words).succeeds();
            assert_same_tree(output, whole);
            assert_eq!(leavings(output), [output.file_name().unwrap().to_str().unwrap()]);
            fs::remove_dir_all(output).unwrap();
        }
    }
    assert!(unfinished > 0, "none of the kills came in time");
    support::run(words).succeeds();
    assert_same_tree(output, whole);
    assert_eq!(leavings(output), [output.file_name().unwrap().to_str().unwrap()]);
}

#[test]
fn a_killed_packing_goes_on_to_the_same_bits() {
    let studio = studio();
    let output = studio.path("killed.field");
    let words = |words: [&str; 3]| -> Vec<OsString> {
        let mut command = vec!["pack".into(), studio.field().into_os_string(), "-o".into(), output.clone().into()];
        command.extend(words.iter().filter(|word| !word.is_empty()).map(Into::into));
        command
    };
    let whole = packed(&studio, "0.01");
    // One block after the other, so that some are done and some are not.
    killed_again_and_again(&words(["--error", "0.01", "--memory=0"]), &output, &whole, 1);
    fs::remove_dir_all(&output).unwrap();
    killed_again_and_again(&words(["--lossless", "", ""]), &output, &studio.field(), 2);
}

#[test]
fn a_killed_development_to_a_packed_field_goes_on_to_the_same_bits() {
    let studio =
        Studio::new(&Plan { positions: Positions::Grid(3, 2), size: (70, 33), noise: 0.0005, ..Plan::default() });
    let (whole, output) = (studio.path("once.field"), studio.path("killed.field"));
    relumine!["develop", &studio.capture(), "-o", &whole, "--error", "0.01"].succeeds();
    let words = [
        "develop".into(),
        studio.capture().into_os_string(),
        "-o".into(),
        output.clone().into(),
        "--error".into(),
        "0.01".into(),
    ];
    killed_again_and_again(&words, &output, &whole, 3);
}

#[test]
fn a_photograph_that_is_found_again_is_packed() {
    let studio = Studio::new(&Plan { size: (70, 33), ..Plan::default() });
    let (whole, output) = (studio.path("once.field"), studio.path("a.field"));
    let develop = |output: &Path| relumine!["develop", &studio.capture(), "-o", output, "--error", "0.02"];
    develop(&whole).succeeds();
    let lost = studio.photograph(2, "column-1-0");
    fs::rename(&lost, studio.path("elsewhere.png")).unwrap();
    // Begun, on a disk that is full at once; then something stands where the metadata should go, so that all is packed, but
    // the field does not get its name.
    let script = format!(
        "trap '' XFSZ; ulimit -f 1; exec '{}' develop '{}' -o '{}' --error 0.02",
        shown(&program()),
        shown(&studio.capture()),
        shown(&output)
    );
    assert_eq!(Command::new("sh").arg("-c").arg(script).output().unwrap().status.code(), Some(1));
    let partial = studio.path("a.field.partial");
    fs::create_dir_all(partial.join("field/zarr.json/in the way")).unwrap();
    assert_eq!(develop(&output).code, Some(1));
    assert_eq!(fs::read_to_string(partial.join("journal")).unwrap().lines().count(), 4);
    assert!(partial.join("field/packed/0-1/zarr.json").exists());
    fs::remove_dir_all(partial.join("field/zarr.json")).unwrap();
    fs::rename(studio.path("elsewhere.png"), &lost).unwrap();
    develop(&output).succeeds();
    assert_same_tree(&output, &whole);
    assert_eq!(leavings(&output), ["a.field"]);
}

/// Where the atoms of a position begin in the file of a block.
fn atoms_of(file: &Path, position: usize) -> usize {
    let bytes = fs::read(file).unwrap();
    let text = fs::read_to_string(file.with_file_name("zarr.json")).unwrap();
    let array: serde_json::Value = serde_json::from_str(&text).unwrap();
    let number = |value: &serde_json::Value| usize::try_from(value.as_u64().unwrap()).unwrap();
    let (rows, rank) = (number(&array["shape"][0]), number(&array["attributes"]["block"]["rank"]));
    let entry = bytes.len() - 4 - 16 * (rows - (rank.div_ceil(8) + 1 + position));
    usize::try_from(u64::from_le_bytes(bytes[entry..entry + 8].try_into().unwrap())).unwrap()
}

#[test]
fn damage_is_named_and_costs_only_its_own_light() {
    let studio = studio();
    let field = packed(&studio, "0.05");
    let (all, last) = (studio.sky(), lighting(&studio, "last.exr", 8..10));
    let whole = studio.relit(&field, &last, &[]);
    let arrays: Vec<String> =
        files_of(&field).into_iter().filter(|name| name.starts_with("packed/") && name.ends_with("/c.0.0")).collect();
    assert_eq!(arrays.len(), 2, "{arrays:?}");
    let mut numbers = Numbers(4);
    for name in &arrays {
        let file = field.join(name);
        let bytes = fs::read(&file).unwrap();
        for _ in 0..4 {
            flip_bit(&file, 16 + numbers.below(bytes.len() - 16), numbers.below(8) as u8);
            let told = relumine!["inspect", &field];
            assert_eq!(told.code, Some(3), "{told:#?}");
            assert!(told.stdout.contains(&format!("damage         {name}: changed")), "{told:#?}");
            assert!(told.stderr.contains("1 files are damaged"), "{told:#?}");
            let output = studio.path("damaged.exr");
            let run = relumine!["relight", &field, "--light", &all, "--samples", "4096", "-o", &output];
            run.fails(3, &[&shown(&file), "damaged"]);
            assert_eq!(leavings(&output), [""; 0]);
            fs::write(&file, &bytes).unwrap();
        }
        // The atoms of position 0: light of the others does not need them.
        flip_bit(&file, atoms_of(&file, 0) + 20, 2);
        relumine!["relight", &field, "--light", &all, "--samples", "4096", "-o", &studio.path("damaged.exr")]
            .fails(3, &[&shown(&file), "position 0"]);
        assert_eq!(studio.relit(&field, &last, &[]), whole);
        // Nor is a damaged field packed or unpacked as if it were whole.
        let output = studio.path("repacked.field");
        relumine!["pack", &field, "-o", &output, "--lossless"].fails(3, &[&shown(&file), "damaged"]);
        assert!(!output.exists());
        fs::remove_dir_all(studio.path("repacked.field.partial")).unwrap();
        fs::write(&file, &bytes).unwrap();
        // Cut off, and gone.
        fs::write(&file, &bytes[..bytes.len() / 2]).unwrap();
        relumine!["relight", &field, "--light", &last, "-o", &studio.path("damaged.exr")].fails(3, &[&shown(&file)]);
        fs::remove_file(&file).unwrap();
        relumine!["relight", &field, "--light", &last, "-o", &studio.path("damaged.exr")].fails(3, &[&shown(&file)]);
        fs::write(&file, &bytes).unwrap();
    }
    assert_eq!(studio.relit(&field, &last, &[]), whole);
}

#[test]
fn wrong_words_are_told() {
    let studio = Studio::new(&Plan::default());
    let (field, output) = (studio.field(), studio.path("a.field"));
    for error in ["0", "2", "nan", "-1", "inf", "1 %", "0.00001"] {
        let word = format!("--error={error}");
        relumine!["pack", &field, "-o", &output, &word].fails(2, &["--error", "expected a share"]);
        relumine!["develop", &studio.capture(), "-o", &output, &word].fails(2, &["--error", "expected a share"]);
    }
    relumine!["pack", &field, "-o", &output].fails(2, &["--error", "--lossless"]);
    relumine!["pack", &field, "-o", &output, "--error", "0.1", "--lossless"].fails(2, &["--error", "--lossless"]);
    let run = relumine!["develop", &studio.capture(), "-o", &output, "--error", "0.1", "--lossless"];
    run.fails(2, &["--error", "--lossless"]);
    relumine!["inspect", &field, "--light", &studio.sky()].fails(2, &["--against"]);
    assert_eq!(leavings(&output), [""; 0]);

    // What is no field, or not there.
    for other in [studio.capture(), studio.path("nowhere.field")] {
        relumine!["pack", &other, "-o", &output, "--error", "0.1"].fails(3, &[&shown(&other)]);
        relumine!["inspect", &field, "--against", &other.join("photographs")].fails(3, &[&shown(&other)]);
    }
    assert_eq!(leavings(&output), [""; 0]);
    relumine!["pack", &field, "-o", &studio.path("nowhere/a.field"), "--error", "0.1"].fails(1, &["nowhere"]);
    // Over something that is there, itself included.
    let before = tree(&field);
    relumine!["pack", &field, "-o", &field, "--error", "0.1"].fails(1, &[&shown(&field), "--force"]);
    relumine!["pack", &field, "-o", &studio.capture(), "--error", "0.1", "--force"]
        .fails(3, &["only a field is replaced"]);
    assert!(tree(&field) == before && studio.table().exists());
    // Another field's cells.
    let other = Studio::new(&Plan { positions: Positions::Grid(3, 2), ..Plan::default() });
    let run = relumine!["inspect", &field, "--against", &other.field()];
    assert_eq!(run.code, Some(1), "{run:#?}");
    assert!([&*shown(&field), "96 cells", "64 cells"].iter().all(|word| run.stderr.contains(word)), "{run:#?}");
    // An unfinished one that was packed from something else.
    let partial = studio.path("a.field.partial");
    fs::create_dir_all(partial.join("field")).unwrap();
    fs::write(partial.join("input.b3"), "another").unwrap();
    relumine!["pack", &field, "-o", &output, "--error", "0.1"].fails(1, &[&shown(&partial), "--force"]);
    relumine!["pack", &field, "-o", &output, "--error", "0.1", "--force"].succeeds();
    assert_eq!(leavings(&output), ["a.field"]);
}

#[test]
fn a_packed_field_replaces_what_it_was_packed_from() {
    let studio = studio();
    let (whole, expected) = (studio.field(), packed(&studio, "0.02"));
    relumine!["pack", &whole, "-o", &whole, "--error", "0.02", "--force"].succeeds();
    assert_same_tree(&whole, &expected);
    assert_eq!(leavings(&whole), ["whole.field"]);
    assert_eq!(
        read(&{
            let picture = studio.path("a.exr");
            relumine!["relight", &whole, "--light", &studio.sky(), "--samples", "4096", "-o", &picture].succeeds();
            picture
        })
        .size(),
        (70, 33)
    );
}
