//! Killed, out of disk, started twice: the field comes out the same to the last bit, or there is none.

#![cfg(unix)]
#![allow(clippy::unwrap_used)] // in helpers of tests too

mod support;

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use support::studio::{Patterns, Plan, Positions, Studio};
use support::{Numbers, Run, assert_same_tree, leavings, program, relumine, shown, tree};

/// Enough positions that there is something to interrupt, noise, and a loss that must be told after all.
fn studio() -> Studio {
    let studio = Studio::new(&Plan { positions: Positions::Grid(3, 2), noise: 0.0005, ..Plan::default() });
    fs::remove_file(studio.photograph(4, "row-2-1")).unwrap();
    assert_eq!(studio.develop(&studio.path("whole.field")).code, Some(3));
    studio
}

/// Starts to develop, without waiting.
fn started(studio: &Studio, field: &Path) -> Child {
    let mut command = Command::new(program());
    command.arg("develop").arg(studio.capture()).arg("-o").arg(field).stdout(Stdio::null()).stderr(Stdio::null());
    command.spawn().unwrap()
}

/// Develops with files limited to `blocks` of 512 bytes, so that writing fails as on a full disk.
fn develop_on_a_full_disk(studio: &Studio, field: &Path, blocks: usize, force: bool) -> Run {
    let script = format!(
        "trap '' XFSZ; ulimit -f {blocks}; exec '{}' develop '{}' -o '{}' {}",
        shown(&program()),
        shown(&studio.capture()),
        shown(field),
        if force { "--force" } else { "" }
    );
    Run::of(&Command::new("sh").arg("-c").arg(script).output().unwrap())
}

/// Runs again what was interrupted, and expects the very same field as without interruption, and the same report.
#[track_caller]
fn finishes_as_if_nothing_had_been(studio: &Studio, field: &Path, words: &[&str]) {
    let mut command: Vec<_> = vec!["develop".into(), studio.capture().into_os_string(), "-o".into(), field.into()];
    command.extend(words.iter().map(Into::into));
    support::run(&command).fails(3, &["position 4, row-2-1", "2 squares are missing"]);
    assert_same_tree(field, &studio.path("whole.field"));
    assert_eq!(leavings(field), [field.file_name().unwrap().to_str().unwrap()]);
}

/// An unfinished field whose journal says that all positions are done: something stands where its metadata should go.
fn all_but_finished(studio: &Studio, field: &Path) {
    let partial = field.with_extension("field.partial");
    // Begun, so that what stands in the way is taken for a part of it.
    assert_eq!(develop_on_a_full_disk(studio, field, 1, false).code, Some(1));
    fs::create_dir_all(partial.join("field/zarr.json/in the way")).unwrap();
    let run = studio.develop(field);
    assert_eq!(run.code, Some(1), "{run:#?}");
    assert_eq!(fs::read_to_string(partial.join("journal")).unwrap().lines().count(), 6);
    fs::remove_dir_all(partial.join("field/zarr.json")).unwrap();
}

#[test]
fn a_killed_development_goes_on_to_the_same_bits() {
    let studio = studio();
    let mut numbers = Numbers(1);
    let mut unfinished = 0;
    for attempt in 0..12 {
        let field = studio.path(&format!("killed-{attempt}.field"));
        let partial = field.with_extension("field.partial");
        // Some moment after so many files have been begun; and once in three, killed twice.
        for _ in 0..=attempt % 3 / 2 {
            let (files, rest) = (numbers.below(22), Duration::from_micros(numbers.below(4000) as u64));
            let mut child = started(&studio, &field);
            let deadline = Instant::now() + Duration::from_secs(20);
            while Instant::now() < deadline
                && child.try_wait().unwrap().is_none()
                && !(partial.exists() && files_below(&partial) >= files)
            {
                std::thread::yield_now();
            }
            std::thread::sleep(rest);
            child.kill().unwrap(); // SIGKILL
            child.wait().unwrap();
        }
        if field.exists() {
            // It was too late: then it is whole.
            assert_same_tree(&field, &studio.path("whole.field"));
        } else {
            unfinished += 1;
            finishes_as_if_nothing_had_been(&studio, &field, &[]);
        }
    }
    assert!(unfinished >= 6, "only {unfinished} of 12 were killed before their end");
}

/// Files below a folder that changes meanwhile.
fn files_below(folder: &Path) -> usize {
    let Ok(entries) = fs::read_dir(folder) else { return 0 };
    entries.flatten().map(|entry| if entry.path().is_dir() { files_below(&entry.path()) } else { 1 }).sum()
}

#[test]
fn a_full_disk_is_told_and_costs_nothing() {
    let studio = studio();
    let mut failed = 0;
    for blocks in [0, 1, 2, 4, 8, 12, 16, 24, 40, 1000] {
        let field = studio.path(&format!("full-{blocks}.field"));
        let run = develop_on_a_full_disk(&studio, &field, blocks, false);
        if run.code == Some(3) {
            assert_same_tree(&field, &studio.path("whole.field"));
            continue;
        }
        failed += 1;
        let run =
            run.fails(1, &[&shown(&field.with_extension("field.partial")), "File too large", "run the same command"]);
        assert!(run.stdout.is_empty() && !field.exists(), "{blocks}");
        finishes_as_if_nothing_had_been(&studio, &field, &[]);
    }
    assert!((4..10).contains(&failed), "{failed} of 10 disks were too small");
}

#[test]
fn a_full_disk_leaves_the_older_field_as_it_was() {
    let (studio, older) = (studio(), Studio::new(&Plan::default()));
    let field = older.field();
    let before = tree(&field);
    develop_on_a_full_disk(&studio, &field, 4, true).fails(1, &["File too large"]);
    assert!(tree(&field) == before);
    finishes_as_if_nothing_had_been(&studio, &field, &["--force"]);
}

#[test]
fn a_full_disk_leaves_no_half_picture() {
    let studio = Studio::new(&Plan::default());
    let (field, light, picture) = (studio.field(), studio.sky(), studio.path("a.exr"));
    let words = format!("'{}' --light '{}' -o '{}' --samples 4096", shown(&field), shown(&light), shown(&picture));
    let script = format!("trap '' XFSZ; ulimit -f 1; exec '{}' relight {words}", shown(&program()));
    let run = Run::of(&Command::new("sh").arg("-c").arg(script).output().unwrap());
    run.fails(1, &[&shown(&picture), "File too large"]);
    assert_eq!(leavings(&picture), [""; 0]);
}

#[test]
fn threads_and_memory_do_not_change_a_bit() {
    let studio = studio();
    for words in [["--threads", "1"], ["--threads", "2"], ["--threads", "5"], ["--memory", "0"]] {
        finishes_as_if_nothing_had_been(&studio, &studio.path(&format!("{}.field", words.concat())), &words);
    }
    let squares = Studio::new(&Plan { patterns: Patterns::Squares, noise: 0.0005, ..Plan::default() });
    let one = squares.path("one.field");
    relumine!["--threads", "1", "develop", &squares.capture(), "-o", &one].succeeds();
    assert_same_tree(&one, &squares.field());
}

#[test]
fn threads_do_not_change_a_bit_of_a_picture() {
    let studio = studio();
    let lamps = "[[sphere]]\ncenter = [0.5, 0.5, 1.5]\nradius_m = 0.2\nradiance = [9, 8, 7]\n\
                 [environment]\nradiance = [0.2, 0.3, 0.4]\n";
    let (field, light) = (studio.path("whole.field"), studio.light("lamps.toml", lamps));
    let pictures = ["1", "2", "5"].map(|threads| {
        let picture = studio.path(&format!("{threads}.exr"));
        // The capture lacks a photograph: the pictures are written all the same.
        relumine!["relight", &field, "--light", &light, "--threads", threads, "-o", &picture].fails(3, &["missing"]);
        fs::read(picture).unwrap()
    });
    assert!(pictures[0] == pictures[1] && pictures[1] == pictures[2]);
}

#[test]
fn an_unfinished_field_says_so() {
    let studio = studio();
    let field = studio.path("a.field");
    all_but_finished(&studio, &field);
    let partial = field.with_extension("field.partial");
    relumine!["inspect", &partial].fails(3, &[&shown(&partial), "unfinished", "again"]);
    let run = relumine!["relight", &partial, "--light", &studio.sky(), "-o", &studio.path("a.exr")];
    assert!(run.code != Some(0) && !studio.path("a.exr").exists(), "{run:#?}");
    finishes_as_if_nothing_had_been(&studio, &field, &[]);
}

#[test]
fn an_unfinished_field_of_another_input_is_refused() {
    let studio = studio();
    let field = studio.path("a.field");
    all_but_finished(&studio, &field);
    let partial = shown(&field.with_extension("field.partial"));
    let other = Studio::new(&Plan { positions: Positions::Grid(3, 2), ..Plan::default() });
    other.develop(&field).fails(1, &[&partial, "another input", "remove it"]);
    let minimum = relumine!["develop", &studio.capture(), "-o", &field, "--separation", "minimum"];
    minimum.fails(1, &[&partial, "other options"]);
    assert!(!field.exists());
    finishes_as_if_nothing_had_been(&studio, &field, &[]);
}

#[test]
fn a_torn_journal_costs_only_the_torn_position() {
    let studio = studio();
    let field = studio.path("a.field");
    let journal = field.with_extension("field.partial").join("journal");
    for cut in [1, 100, 1000] {
        all_but_finished(&studio, &field);
        let bytes = fs::read(&journal).unwrap();
        fs::write(&journal, &bytes[..bytes.len() - cut]).unwrap();
        finishes_as_if_nothing_had_been(&studio, &field, &[]);
        fs::remove_dir_all(&field).unwrap();
    }
}

#[test]
fn a_journal_without_its_shards_is_not_believed() {
    // A process killed between renaming the field and removing the rest leaves a journal of positions that are not there.
    let studio = studio();
    let field = studio.path("a.field");
    all_but_finished(&studio, &field);
    fs::remove_dir_all(field.with_extension("field.partial").join("field")).unwrap();
    finishes_as_if_nothing_had_been(&studio, &field, &[]);
}

#[test]
fn a_journal_of_an_unknown_input_is_not_believed() {
    // Likewise, killed while removing the rest: what the journal was made from is gone, and another capture comes along.
    let (studio, other) = (studio(), Studio::new(&Plan { positions: Positions::Grid(3, 2), ..Plan::default() }));
    let field = studio.path("a.field");
    all_but_finished(&other, &field);
    fs::remove_file(field.with_extension("field.partial").join("input.b3")).unwrap();
    finishes_as_if_nothing_had_been(&studio, &field, &[]);
}

#[test]
fn a_photograph_that_is_found_again_is_developed() {
    let studio = studio();
    let field = studio.path("a.field");
    let lost = studio.photograph(2, "column-1-0");
    fs::rename(&lost, studio.path("elsewhere.png")).unwrap();
    all_but_finished(&studio, &field);
    fs::rename(studio.path("elsewhere.png"), &lost).unwrap();
    finishes_as_if_nothing_had_been(&studio, &field, &[]);
}

#[test]
fn a_field_that_another_process_is_writing_is_left_to_it() {
    let studio = studio();
    let field = studio.path("a.field");
    all_but_finished(&studio, &field);
    let partial = field.with_extension("field.partial");
    let lock = fs::File::options().write(true).open(partial.join("lock")).unwrap();
    lock.lock().unwrap();
    let run = studio.develop(&field).fails(1, &[&shown(&partial), "another process"]);
    assert!(!run.stderr.contains("space"), "the disk is not full: {run:#?}");
    assert!(!field.exists());
    drop(lock);
    finishes_as_if_nothing_had_been(&studio, &field, &[]);
}
