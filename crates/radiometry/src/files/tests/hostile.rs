//! No bytes make the readers panic: cut, flipped and invented files give a picture or an error.

use std::fs;

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::test_runner::{RngAlgorithm, TestRng, TestRunner};

use super::super::{FileError, read_exr_attribute};
use super::{decode, samples};

/// The same cases every time; `RELUMINE_CASES` asks for more than a test run has time for.
pub(super) fn runner(cases: u32) -> TestRunner {
    let cases = std::env::var("RELUMINE_CASES").ok().and_then(|cases| cases.parse().ok()).unwrap_or(cases);
    let config = ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() };
    let seed = std::env::var("RELUMINE_SEED").ok().and_then(|seed| seed.parse().ok()).unwrap_or(7);
    TestRunner::new_with_rng(config, TestRng::from_seed(RngAlgorithm::ChaCha, &[seed; 32]))
}

#[test]
fn a_file_cut_off_anywhere_is_an_error_or_the_picture() {
    for (name, bytes) in samples::all() {
        let whole = decode(&bytes).unwrap_or_else(|error| panic!("{name}: {error}"));
        for length in 0..bytes.len() {
            match decode(&bytes[..length]) {
                Ok(picture) => assert_eq!(picture, whole, "{name} cut off at {length} of {}", bytes.len()),
                Err(FileError::Unrecognised { .. } | FileError::Damaged { .. } | FileError::Unsupported { .. }) => {}
                Err(error) => panic!("{name} cut off at {length}: {error:?}"),
            }
        }
    }
}

#[test]
fn flipped_bytes_do_not_panic() {
    let files = samples::all();
    let flips = (0..files.len(), vec((any::<prop::sample::Index>(), any::<u8>()), 1..4));
    runner(3000)
        .run(&flips, |(file, flips)| {
            let mut bytes = files[file].1.clone();
            for (index, value) in flips {
                let at = index.index(bytes.len());
                bytes[at] = value;
            }
            let _ = decode(&bytes);
            Ok(())
        })
        .unwrap();
}

#[test]
fn every_byte_of_the_headers_may_be_extreme() {
    for (_, bytes) in samples::all() {
        for at in 0..bytes.len().min(400) {
            for value in [0x00, 0x7f, 0x80, 0xff] {
                let mut changed = bytes.clone();
                changed[at] = value;
                if !has_a_vast_window(&changed) {
                    let _ = decode(&changed);
                }
            }
        }
    }
}

/// A display window of millions of black pixels is sound, but takes a second.
fn has_a_vast_window(bytes: &[u8]) -> bool {
    let meta = exr::meta::MetaData::read_from_buffered(bytes, false);
    let vast = |header: &exr::meta::header::Header| header.shared_attributes.display_window.size.area() > 1 << 20;
    meta.is_ok_and(|meta| meta.headers.iter().any(vast))
}

#[test]
fn invented_bytes_behind_a_true_beginning_do_not_panic() {
    let beginnings: Vec<_> = samples::all().into_iter().map(|(_, bytes)| bytes).collect();
    let cases = (0..beginnings.len(), any::<prop::sample::Index>(), vec(any::<u8>(), 0..600));
    runner(3000)
        .run(&cases, |(file, kept, invented)| {
            let file = &beginnings[file];
            let mut bytes = file[..kept.index(file.len())].to_vec();
            bytes.extend(invented);
            let _ = decode(&bytes);
            Ok(())
        })
        .unwrap();
}

#[test]
fn attributes_of_a_broken_header_are_an_error_or_text() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("broken.exr");
    let whole = samples::rgba_exr((3, 3), exr::prelude::Compression::RLE, exr::image::Blocks::ScanLines);
    for length in 0..whole.len() {
        fs::write(&path, &whole[..length]).unwrap();
        match read_exr_attribute(&path, "no such text") {
            Ok(None) | Err(FileError::Damaged { .. }) => {}
            other => panic!("cut off at {length}: {other:?}"),
        }
    }
}
