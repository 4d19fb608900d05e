//! Running a plan: an iterator over the photographs that are still missing. Drop it to stop; open it again to go on.

use std::collections::HashSet;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

use relumine_capture::{Capture, PhotographRow, Setup, ShownPattern};
use relumine_radiometry::files::decode_picture;
use sha2::{Digest, Sha256};

use crate::devices::{Drivers, Photograph};
use crate::journal::{Journal, lock};
use crate::plan::{Plan, Planned};
use crate::{Rig, RigError};

/// A capture being filled.
pub struct Run {
    capture: Capture,
    plan: Plan,
    drivers: Drivers,
    journal: Journal,
    /// The photographs that are there, by their number in the plan.
    done: HashSet<usize>,
    /// Listed ones that are gone or have changed.
    lost: Vec<PathBuf>,
    already_done: usize,
    next: usize,
    at: Option<usize>,
    shown: Option<ShownPattern>,
    failed: bool,
    /// Held as long as the run lives: two would spoil the table.
    _lock: File,
}

/// A photograph that was taken and is on disk.
#[derive(Clone, Debug, PartialEq)]
pub struct Taken {
    /// Which one.
    pub planned: Planned,
    /// The picture, relative to the capture directory.
    pub file: PathBuf,
    /// Size of the picture file.
    pub bytes: usize,
}

impl Run {
    /// Goes on with the capture at `directory`, which [`crate::lay_out`] made.
    ///
    /// Photographs are there if they are listed and their file is; [`Run::verify`] looks closer.
    ///
    /// # Errors
    /// If the capture cannot be read, is not the one that its `rig.toml` describes, or another process is filling it.
    pub fn open(directory: &Path, drivers: Drivers) -> Result<Self, RigError> {
        let rig = Rig::read(&directory.join("rig.toml"))?;
        // The table is read under the lock: nobody appends between.
        let lock = lock(directory)?;
        let capture = Capture::open(directory)?;
        agree(&capture, &rig)?;
        let plan = Plan::of(&rig);
        let journal = Journal::open(&capture, drivers.durable)?;
        let mut run = Self {
            done: HashSet::new(),
            lost: Vec::new(),
            already_done: 0,
            next: 0,
            at: None,
            shown: None,
            failed: false,
            capture,
            plan,
            drivers,
            journal,
            _lock: lock,
        };
        run.find_done()?;
        Ok(run)
    }

    /// The plan.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The capture as it was when the run was opened.
    pub fn capture(&self) -> &Capture {
        &self.capture
    }

    /// Photographs in all.
    pub fn total(&self) -> usize {
        self.plan.len()
    }

    /// Photographs that were there when the run began.
    pub fn already_done(&self) -> usize {
        self.already_done
    }

    /// Photographs that are still to be taken.
    pub fn missing(&self) -> usize {
        self.total() - self.done.len()
    }

    /// Listed photographs whose file is gone or, after [`Run::verify`], has changed: they are taken again.
    pub fn lost(&self) -> &[PathBuf] {
        &self.lost
    }

    /// Reads every photograph that is there and holds it against its checksum; those that have changed are taken again.
    /// Photographs without a checksum are believed. For before the first photograph is taken.
    pub fn verify(&mut self) {
        let directory = self.capture.directory();
        let changed = |row: &PhotographRow| {
            let bytes = fs::read(directory.join(&row.file)).unwrap_or_default();
            row.sha256.is_some_and(|listed| Sha256::digest(&bytes)[..] != listed)
        };
        for number in 0..self.plan.len() {
            if self.done.contains(&number)
                && let Some(row) = self.row(number).filter(|row| changed(row))
            {
                let file = row.file.clone();
                self.lost.push(file);
                self.done.remove(&number);
            }
        }
        self.already_done = self.done.len();
    }

    /// The row of a photograph in the table as it was when the run was opened.
    fn row(&self, number: usize) -> Option<&PhotographRow> {
        let Planned { position, pattern, exposure, .. } = self.plan.photograph(number);
        self.capture.exposures(position, pattern).iter().find(|row| row.exposure == exposure)
    }

    fn find_done(&mut self) -> Result<(), RigError> {
        for number in 0..self.plan.len() {
            let Some(row) = self.row(number) else { continue };
            let there = fs::metadata(self.capture.directory().join(&row.file));
            if there.is_ok_and(|file| file.is_file() && file.len() > 0) {
                self.done.insert(number);
            } else {
                let file = row.file.clone();
                self.lost.push(file);
            }
        }
        // A row with an exposure that is not planned would lose its file to a planned one of the same number.
        let table = self.capture.directory().join("photographs.csv");
        let rows = self.capture.photographs().rows.values().flatten();
        if let Some(row) = rows.into_iter().find(|row| !self.plan.exposures().contains(&row.exposure)) {
            let found = row.exposure.exposure_s;
            let reason = format!(
                "line {}: an exposure of {found} s, which rig.toml does not have: the exposures of a capture cannot change \
                 while it goes on",
                row.line
            );
            return Err(RigError::Contradiction { path: table, reason });
        }
        self.already_done = self.done.len();
        Ok(())
    }

    fn take(&mut self, planned: Planned) -> Result<Taken, RigError> {
        let Planned { position, pattern, exposure, .. } = planned;
        let setup = self.capture.setup();
        if self.at != Some(position) {
            // Where it stands after a failure is not known.
            self.at = None;
            self.drivers.stage.move_to(position, setup.cells().partition().positions()[position])?;
            self.at = Some(position);
        }
        if self.shown != Some(pattern) {
            self.shown = None;
            self.drivers.projector.show(pattern)?;
            self.shown = Some(pattern);
        }
        let photograph = self.drivers.camera.photograph(&exposure)?;
        check(setup, &photograph).map_err(|reason| RigError::Photograph { position, pattern, reason })?;
        let row = self.journal.append(&planned, &photograph)?;
        Ok(Taken { planned, file: row.file, bytes: photograph.bytes.len() })
    }
}

impl Iterator for Run {
    type Item = Result<Taken, RigError>;

    /// Takes the next photograph that is missing. After an error there is none: what is wrong at the rig must be put right
    /// first.
    fn next(&mut self) -> Option<Self::Item> {
        while !self.failed && self.next < self.plan.len() {
            let number = self.next;
            if self.done.contains(&number) {
                self.next += 1;
                continue;
            }
            let taken = self.take(self.plan.photograph(number));
            if taken.is_ok() {
                self.done.insert(number);
                self.next += 1;
            } else {
                self.failed = true;
            }
            return Some(taken);
        }
        None
    }
}

/// Holds a photograph against what the set-up promises: whether it is a whole picture of the right size and bits.
///
/// # Errors
/// What was promised and what came.
pub(crate) fn check(setup: &Setup, photograph: &Photograph) -> Result<(), String> {
    let name = PathBuf::from(format!("photograph.{}", photograph.extension));
    let picture = decode_picture(&name, &photograph.bytes).map_err(|error| error.to_string())?;
    setup.check_picture(&picture)
}

/// `capture.toml` is what the photographs are developed by: it must be of the rig that takes them.
fn agree(capture: &Capture, rig: &Rig) -> Result<(), RigError> {
    let (found, expected) = (capture.setup(), rig.setup());
    let differing = [
        ("positions", found.cells().partition().layout() != expected.cells().partition().layout()),
        ("radius or pattern", found.cells().reach() != expected.cells().reach()),
        ("scheme", found.scheme() != expected.scheme()),
        ("picture size", found.picture_size() != expected.picture_size()),
        ("levels", found.levels() != expected.levels()),
    ];
    match differing.iter().find(|(_, differs)| *differs) {
        None => Ok(()),
        Some((what, _)) => Err(RigError::Contradiction {
            path: capture.directory().join("capture.toml"),
            reason: format!("{what}: not what rig.toml says; the two must say the same"),
        }),
    }
}
