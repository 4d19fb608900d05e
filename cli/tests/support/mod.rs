//! What the tests of the command share: running it, looking at what it leaves, and tiny captures ([`studio`]).

#![allow(dead_code)] // each test file takes its part

pub(crate) mod studio;

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use relumine::radiometry::files::{self, Picture};
use relumine::radiometry::{Image, Linear};
use relumine::{Cell, ReflectanceField};

/// Runs `relumine` with words that are `&str`, `&String` or `&PathBuf`.
macro_rules! relumine {
    ($($word:expr),+ $(,)?) => {
        crate::support::run(&[$(std::ffi::OsStr::new($word).to_os_string()),+])
    };
}
pub(crate) use relumine;

/// How a run of the command ended.
#[derive(Debug)]
pub(crate) struct Run {
    pub(crate) code: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

pub(crate) fn program() -> PathBuf {
    assert_cmd::cargo::cargo_bin!("relumine").to_path_buf()
}

pub(crate) fn run(words: &[OsString]) -> Run {
    let mut command = assert_cmd::Command::new(program());
    Run::of(&command.args(words).timeout(Duration::from_secs(60)).output().unwrap())
}

impl Run {
    pub(crate) fn of(output: &std::process::Output) -> Self {
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        let run = Self { code: output.status.code(), stdout: text(&output.stdout), stderr: text(&output.stderr) };
        assert!(!run.stderr.contains("panicked"), "the command panicked: {run:#?}");
        run
    }

    /// Exit code 0.
    #[track_caller]
    pub(crate) fn succeeds(self) -> Self {
        assert_eq!(self.code, Some(0), "{self:#?}");
        self
    }

    /// This exit code, and on stderr an error, all of `words`, and what to do.
    #[track_caller]
    pub(crate) fn fails(self, code: i32, words: &[&str]) -> Self {
        assert_eq!(self.code, Some(code), "{self:#?}");
        assert!(self.stderr.contains("error: "), "{self:#?}");
        for word in words {
            assert!(self.stderr.contains(word), "stderr lacks {word:?}: {self:#?}");
        }
        // A value that "must be" something says itself what to correct; all else needs a hint.
        let what_to_do = ["help: ", "--help", "did you mean", "must be", "expected", "remove it"];
        let says_what_to_do = what_to_do.iter().any(|words| self.stderr.contains(words));
        assert!(says_what_to_do, "the error does not say what to do: {self:#?}");
        self
    }

    /// What of a light falls on missing squares, percent, as `relight` says it; `None` if it says nothing.
    pub(crate) fn missing_percent(&self) -> Option<f64> {
        let (_, share) = self.stderr.split_once("they do not show ")?;
        share.split_whitespace().next()?.parse().ok()
    }
}

/// The shown form of a path, for messages that must name it.
pub(crate) fn shown(path: &Path) -> String {
    path.display().to_string()
}

/// Every file below a folder with its bytes.
pub(crate) fn tree(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = BTreeMap::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(inner) = folders.pop() {
        for entry in fs::read_dir(&inner).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                files.insert(path.strip_prefix(folder).unwrap().to_path_buf(), fs::read(&path).unwrap());
            }
        }
    }
    files
}

/// Both folders hold the same files with the same bytes.
#[track_caller]
pub(crate) fn assert_same_tree(found: &Path, expected: &Path) {
    let (found_files, expected_files) = (tree(found), tree(expected));
    let names = |files: &BTreeMap<PathBuf, Vec<u8>>| files.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(&found_files), names(&expected_files), "{} against {}", shown(found), shown(expected));
    // Backwards: the list of checksums, which differs with anything else, comes last.
    if let Some((name, bytes)) = found_files.iter().rev().find(|(name, bytes)| *bytes != &expected_files[*name]) {
        let lines = |bytes: &[u8]| String::from_utf8_lossy(bytes).lines().map(String::from).collect::<Vec<_>>();
        let (lines, expected_lines) = (lines(bytes), lines(&expected_files[name]));
        let first = lines.iter().zip(&expected_lines).find(|(a, b)| a != b);
        panic!("{} differs from {}, first in {first:?}", shown(&found.join(name)), shown(expected));
    }
}

/// The picture files and fields that a failed command left in a folder: names that begin like `output`, also hidden ones.
pub(crate) fn leavings(output: &Path) -> Vec<String> {
    let name = output.file_name().unwrap().to_str().unwrap();
    let names = fs::read_dir(output.parent().unwrap()).unwrap().map(|entry| entry.unwrap().file_name());
    names
        .map(|found| found.into_string().unwrap())
        .filter(|found| found.trim_start_matches('.').starts_with(name))
        .collect()
}

/// Flips one bit of a file.
pub(crate) fn flip_bit(path: &Path, byte: usize, bit: u8) {
    let mut bytes = fs::read(path).unwrap();
    bytes[byte] ^= 1 << bit;
    fs::write(path, bytes).unwrap();
}

/// A picture of linear samples.
pub(crate) fn read(path: &Path) -> Image<Linear> {
    match files::read_picture(path).unwrap() {
        Picture::Float(image) => image,
        integer @ Picture::Integer { .. } => panic!("{} is a {}", shown(path), integer.describe()),
    }
}

/// The missing cells of a field as (position, u, v).
pub(crate) fn missing_squares(field: &Path) -> Vec<(usize, usize, usize)> {
    let field = ReflectanceField::open(field).unwrap();
    let missing = (0..field.cells().len()).filter(|cell| field.is_missing(*cell));
    missing.map(|cell| field.cells().cell(cell)).map(|Cell { position, u, v }| (position, u, v)).collect()
}

/// ‖a − b‖ / ‖b‖ over all pixels and channels.
pub(crate) fn relative_l2(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    assert_eq!(a.len(), b.len());
    let pairs = || a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| (f64::from(*a), f64::from(*b)));
    let energy: f64 = pairs().map(|(_, b)| b * b).sum();
    assert!(energy > 0.0, "nothing to compare with");
    (pairs().map(|(a, b)| (a - b) * (a - b)).sum::<f64>() / energy).sqrt()
}

/// Seeded numbers without a library: splitmix64.
pub(crate) struct Numbers(pub(crate) u64);

impl Numbers {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// 0 … bound − 1.
    pub(crate) fn below(&mut self, bound: usize) -> usize {
        (self.next() % bound as u64) as usize
    }

    /// Mean 0, standard deviation 1.
    pub(crate) fn gauss(&mut self) -> f64 {
        (0..12).map(|_| (self.next() >> 11) as f64 / (1u64 << 53) as f64).sum::<f64>() - 6.0
    }
}
