//! Running a plan: in order, resumed from anything that can be left behind, to the same bits.

#![allow(clippy::unwrap_used)] // in helpers of tests too

mod support;

use std::fs::{self, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use relumine_capture::{Capture, csv_header};
use relumine_rig::{Drivers, RigError, Run, lay_out};
use support::{Fault, fake, rig, tree};
use tempfile::TempDir;

fn sound() -> Drivers {
    fake(Fault::None).0
}

/// A capture laid out, in a folder of its own.
fn laid_out() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let capture = folder.path().join("capture");
    lay_out(&rig(), &capture, false).unwrap();
    (folder, capture)
}

/// Takes at most `most` photographs.
fn photograph(capture: &Path, most: usize) -> usize {
    Run::open(capture, sound()).unwrap().take(most).map(Result::unwrap).count()
}

fn append(path: &Path, bytes: &[u8]) {
    OpenOptions::new().append(true).open(path).unwrap().write_all(bytes).unwrap();
}

#[test]
fn a_run_takes_every_photograph_and_moves_and_shows_no_more_than_needed() {
    let (_folder, capture) = laid_out();
    let (drivers, log) = fake(Fault::None);
    let mut run = Run::open(&capture, drivers).unwrap();
    assert_eq!((run.total(), run.already_done(), run.missing()), (144, 0, 144));
    assert_eq!(run.by_ref().map(Result::unwrap).count(), 144);
    assert_eq!(run.missing(), 0);
    let log = log.borrow();
    assert_eq!(log[..6], ["m0", "s black", "p 0.25", "p 1", "s white", "p 0.25"]);
    let count = |letter: char| log.iter().filter(|entry| entry.starts_with(letter)).count();
    assert_eq!((count('m'), count('s'), count('p')), (4, 4 * 18, 144));
    let open = Capture::open(&capture).unwrap();
    assert_eq!(open.photographs().len(), 144);
    assert_eq!(open.remarks(), []);
    assert!((0..4).all(|position| open.missing(position).is_empty()));
    assert!(capture.join("photographs/p003/column-3-1_e1.png").is_file());
}

#[test]
fn stopped_anywhere_a_run_goes_on_to_the_same_bits() {
    let (_whole_folder, whole) = laid_out();
    photograph(&whole, usize::MAX);
    for durable in [false, true] {
        let (_folder, capture) = laid_out();
        let mut sum = 0;
        while sum < 144 {
            let mut drivers = sound();
            drivers.durable = durable;
            let taken = Run::open(&capture, drivers).unwrap().take(23).map(Result::unwrap).count();
            assert!(taken > 0);
            sum += taken;
        }
        assert_eq!(tree(&capture), tree(&whole));
    }
}

#[test]
fn killed_at_any_step_of_a_photograph_a_run_goes_on_to_the_same_bits() {
    let (_whole_folder, whole) = laid_out();
    photograph(&whole, usize::MAX);
    let table = fs::read_to_string(whole.join("photographs.csv")).unwrap();
    let line = table.lines().nth(6).unwrap();
    let (name, torn): (&str, &[u8]) = ("photographs/p000/row-0-0_e1.png", &[1, 2, 3]);
    assert!(line.contains(name));
    let cuts = (0..line.len()).step_by(7).chain([line.len() - 1, line.len()]).map(|cut| cut + 2);
    for step in [0, 1].into_iter().chain(cuts) {
        let (_folder, capture) = laid_out();
        photograph(&capture, 5);
        let table = capture.join("photographs.csv");
        match step {
            // A part of the picture under its temporary name, the picture without a line, or a part of the line.
            0 => fs::write(capture.join("photographs/p000/row-0-0_e1.partial"), torn).unwrap(),
            1 => fs::write(capture.join(name), fs::read(whole.join(name)).unwrap()).unwrap(),
            _ => {
                fs::write(capture.join(name), fs::read(whole.join(name)).unwrap()).unwrap();
                append(&table, &line.as_bytes()[..step - 2]);
            }
        }
        let mut run = Run::open(&capture, sound()).unwrap();
        // All but its newline is all that there is to say.
        assert_eq!(run.already_done(), if step == line.len() + 2 { 6 } else { 5 });
        // The rest of the first position is enough: the table is compared up to there.
        run.by_ref().take(2).for_each(|taken| drop(taken.unwrap()));
        drop(run);
        let (found, expected) = (tree(&capture), tree(&whole));
        let (found_table, expected_table) =
            (&found[Path::new("photographs.csv")], &expected[Path::new("photographs.csv")]);
        assert!(expected_table.starts_with(found_table), "step {step}");
        for (file, bytes) in found.iter().filter(|(file, _)| file.starts_with("photographs")) {
            assert_eq!(Some(bytes), expected.get(file), "step {step}: {}", file.display());
        }
    }
}

#[test]
fn photographs_that_are_gone_or_changed_are_taken_again() {
    let (_folder, capture) = laid_out();
    photograph(&capture, usize::MAX);
    let [gone, empty, changed] = ["p000/black_e0", "p001/white_e1", "p003/row-2-1_e0"]
        .map(|name| capture.join(format!("photographs/{name}.png")));
    let sound_bytes = [&gone, &empty, &changed].map(|path| fs::read(path).unwrap());
    fs::remove_file(&gone).unwrap();
    fs::write(&empty, "").unwrap();
    fs::write(&changed, "other").unwrap();
    let mut run = Run::open(&capture, sound()).unwrap();
    assert_eq!((run.missing(), run.lost().len()), (2, 2));
    run.verify();
    assert_eq!((run.missing(), run.already_done(), run.lost().len()), (3, 141, 3));
    assert_eq!(run.by_ref().map(Result::unwrap).count(), 3);
    drop(run);
    assert_eq!([&gone, &empty, &changed].map(|path| fs::read(path).unwrap()), sound_bytes);
    let open = Capture::open(&capture).unwrap();
    assert_eq!((open.photographs().len(), open.photographs().replaced.len()), (144, 3));
}

#[test]
fn two_runs_of_one_capture_keep_out_of_each_others_way() {
    let (_folder, capture) = laid_out();
    let run = Run::open(&capture, sound()).unwrap();
    assert!(matches!(Run::open(&capture, sound()), Err(RigError::Busy { .. })));
    assert!(matches!(lay_out(&rig(), &capture, true), Err(RigError::Busy { .. })));
    drop(run);
    Run::open(&capture, sound()).unwrap();
}

#[test]
fn what_is_wrong_at_the_rig_ends_the_run_and_can_be_put_right() {
    let (_folder, capture) = laid_out();
    let mut run = Run::open(&capture, fake(Fault::FailingStage).0).unwrap();
    let failed: Vec<RigError> = run.by_ref().filter_map(Result::err).collect();
    assert!(matches!(failed[..], [RigError::Device { .. }]), "{failed:?}");
    assert_eq!(run.missing(), 72);
    drop(run);
    for fault in [Fault::Size, Fault::Torn] {
        let mut run = Run::open(&capture, fake(fault).0).unwrap();
        let error = run.next().unwrap().unwrap_err().to_string();
        assert!(error.starts_with("position 2, black: the camera's picture cannot be used"), "{error}");
        assert!(run.next().is_none());
    }
    assert_eq!(photograph(&capture, usize::MAX), 72);
}

#[test]
fn a_capture_of_another_rig_is_refused() {
    let (_folder, capture) = laid_out();
    photograph(&capture, 4);
    let change = |name: &str, from: &str, to: &str| {
        let text = fs::read_to_string(capture.join(name)).unwrap();
        assert!(text.contains(from), "{text}");
        fs::write(capture.join(name), text.replace(from, to)).unwrap();
    };
    let refused = || Run::open(&capture, sound()).err().unwrap().to_string();
    change("rig.toml", "tilts = 2", "tilts = 3");
    assert!(refused().contains("positions: not what rig.toml says"), "{}", refused());
    change("rig.toml", "tilts = 3", "tilts = 2");
    change("rig.toml", "[1.0, 0.25]", "[1.0, 0.5]");
    assert!(refused().contains("line 2: an exposure of 0.25 s"), "{}", refused());
    change("rig.toml", "[1.0, 0.5]", "[1.0, 0.25]");
    // Emptied by hand, header and all but its newline, it begins anew.
    fs::write(capture.join("photographs.csv"), csv_header().trim_end()).unwrap();
    assert_eq!(photograph(&capture, usize::MAX), 144);
}
