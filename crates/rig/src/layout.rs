//! Laying out a capture: the directory that `relumine capture` fills.

use std::ffi::OsString;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use relumine_capture::{Capture, Scheme, Setup, ShownPattern, csv_header};
use relumine_radiometry::files::encode_png_counts;
use relumine_radiometry::{Counts, Image};

use crate::journal::lock;
use crate::{Hands, Plan, Rig, RigError};

/// The folder of the pictures that a manual projector shows.
const PATTERNS: &str = "patterns";
/// About so many pixels a side has the picture of a pattern.
const PATTERN_PIXELS: usize = 1024;

/// Writes the capture directory of a rig: `capture.toml`, the rig's description, an empty `photographs.csv`, and for manual
/// drivers the pictures of the patterns and the watched folder. It appears whole or not at all.
///
/// `replace` replaces a capture that has no photographs.
///
/// # Errors
/// If there is something at `directory` that may not be replaced, or it cannot be written.
pub fn lay_out(rig: &Rig, directory: &Path, replace: bool) -> Result<(), RigError> {
    // "." has no name that another could stand beside.
    let directory =
        &std::path::absolute(directory).map_err(|source| RigError::Read { path: directory.to_path_buf(), source })?;
    let old = !is_free(directory)?;
    // Held until the end: nobody photographs into what is replaced.
    let _lock = match (old, replace) {
        (false, _) => None,
        (true, false) => return Err(RigError::Exists { path: directory.to_path_buf() }),
        (true, true) => {
            refuse_precious(directory)?;
            Some(lock(directory)?)
        }
    };
    let partial = beside(directory, ".partial");
    let write = |path: &Path| {
        let path = path.to_path_buf();
        move |source| RigError::Write { path, source }
    };
    let replaced = beside(directory, ".replaced");
    // What a killed one left: nothing that anybody has photographed.
    for leaving in [&partial, &replaced].into_iter().filter(|leaving| leaving.exists()) {
        fs::remove_dir_all(leaving).map_err(write(leaving))?;
    }
    fs::create_dir_all(&partial).map_err(write(&partial))?;
    let written = fill(rig, &partial).and_then(|()| {
        if old {
            fs::rename(directory, &replaced).map_err(write(&replaced))?;
        } else if directory.exists() {
            fs::remove_dir(directory).map_err(write(directory))?;
        }
        fs::rename(&partial, directory).map_err(write(directory))?;
        if old { fs::remove_dir_all(&replaced).map_err(write(&replaced)) } else { Ok(()) }
    });
    if written.is_err() {
        // The first error is the one to tell.
        let _ = fs::remove_dir_all(&partial);
    }
    written
}

/// The picture of a pattern: squares of equal size, square (0, 0) at the top left, as the projector sees the object.
pub fn pattern_picture(setup: &Setup, pattern: ShownPattern) -> Image<Counts> {
    let squares = setup.cells().squares();
    let spacing = if let Scheme::Combs { spacing } = setup.scheme() { spacing } else { 1 };
    let side = (PATTERN_PIXELS / squares).max(1);
    let width = side * squares;
    let mut pixels = vec![[0; 3]; width * width];
    for (u, v) in pattern.lit(squares, spacing) {
        for row in v * side..(v + 1) * side {
            pixels[row * width + u * side..][..side].fill([255; 3]);
        }
    }
    Image::from_pixels(width, width, pixels)
}

fn fill(rig: &Rig, directory: &Path) -> Result<(), RigError> {
    let write = |name: &Path, bytes: &[u8]| {
        let path = directory.join(name);
        let folder = path.parent().unwrap_or(directory);
        let written = fs::create_dir_all(folder).and_then(|()| fs::write(&path, bytes));
        written.map_err(|source| RigError::Write { path: path.clone(), source })
    };
    write(Path::new("rig.toml"), rig.text_for_elsewhere()?.as_bytes())?;
    write(Path::new("capture.toml"), rig.capture_toml().as_bytes())?;
    write(Path::new("photographs.csv"), csv_header().as_bytes())?;
    for name in rig.named_files() {
        let path = rig.path().parent().unwrap_or(Path::new("")).join(name);
        write(name, &fs::read(&path).map_err(|source| RigError::Read { path, source })?)?;
    }
    if rig.hands() == Hands::Manual {
        let patterns = Plan::of(rig).patterns().to_vec();
        patterns.into_par_iter().try_for_each(|pattern| {
            let picture = encode_png_counts(&pattern_picture(rig.setup(), pattern), 8);
            write(&pattern_file(pattern), &picture)
        })?;
        let folder = &rig.manual().folder;
        if folder.is_relative() {
            let path = directory.join(folder);
            fs::create_dir_all(&path).map_err(|source| RigError::Write { path, source })?;
        }
    }
    // What is in it already reads as a capture: whatever is wrong shows now, not at the rig.
    Capture::open(directory)?;
    Ok(())
}

/// The picture of a pattern, relative to the capture directory.
pub(crate) fn pattern_file(pattern: ShownPattern) -> PathBuf {
    Path::new(PATTERNS).join(format!("{pattern}.png"))
}

/// Whether there is nothing at `directory`, or an empty directory.
fn is_free(directory: &Path) -> Result<bool, RigError> {
    match fs::read_dir(directory) {
        Ok(mut entries) => Ok(entries.next().is_none()),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(true),
        Err(error) if error.kind() == io::ErrorKind::NotADirectory => Ok(false),
        Err(source) => Err(RigError::Read { path: directory.to_path_buf(), source }),
    }
}

/// Only a capture that nobody has photographed into is replaced.
fn refuse_precious(directory: &Path) -> Result<(), RigError> {
    let refuse = |reason: String| Err(RigError::Precious { path: directory.to_path_buf(), reason });
    // A description that says nothing anybody can read, or a table that is none, is somebody's work too.
    let Ok(capture) = Capture::open(directory) else {
        return refuse("it is not a capture".into());
    };
    match capture.photographs().len() {
        0 => {}
        listed => return refuse(format!("its photographs.csv lists {listed} photographs")),
    }
    let setup = capture.setup();
    let named = std::iter::once(setup.response_name()).chain(setup.colour_name());
    let ours: Vec<PathBuf> = std::iter::once(PATTERNS).chain(named).map(PathBuf::from).collect();
    let first = first_file(directory, Path::new(""), &ours);
    match first.map_err(|source| RigError::Read { path: directory.to_path_buf(), source })? {
        Some(file) => refuse(format!("it has the file {}", file.display())),
        None => Ok(()),
    }
}

/// Some file in the folders of a capture that the lay-out has not written.
fn first_file(directory: &Path, folder: &Path, ours: &[PathBuf]) -> io::Result<Option<PathBuf>> {
    const OURS: [&str; 4] = ["capture.toml", "rig.toml", "photographs.csv", crate::journal::LOCK];
    for entry in fs::read_dir(directory.join(folder))? {
        let name = folder.join(entry?.file_name());
        if ours.contains(&name) || OURS.iter().any(|our| name == Path::new(our)) {
            continue;
        }
        if !directory.join(&name).is_dir() {
            return Ok(Some(name));
        }
        if let Some(file) = first_file(directory, &name, ours)? {
            return Ok(Some(file));
        }
    }
    Ok(None)
}

fn beside(path: &Path, suffix: &str) -> PathBuf {
    let mut name: OsString = ".".into();
    name.push(path.file_name().unwrap_or_default());
    name.push(suffix);
    path.with_file_name(name)
}
