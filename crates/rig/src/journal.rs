//! The table of photographs as the journal of a capture under way: the picture first, then its line.
//!
//! A line in `photographs.csv` says that its picture is whole under its name. Killed between the two, the picture is there
//! without a line: it is taken again under the same name. Killed inside a line, the line is cut off.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use relumine_capture::{Capture, PhotographRow};
use sha2::{Digest, Sha256};

use crate::RigError;
use crate::devices::Photograph;
use crate::plan::Planned;

/// The file that a capture under way is locked by. It stays: removing it would let two in at once.
pub(crate) const LOCK: &str = ".lock";

/// Keeps every other process from photographing into `capture` as long as the file is held.
pub(crate) fn lock(capture: &Path) -> Result<File, RigError> {
    let path = capture.join(LOCK);
    let write = |source| RigError::Write { path: path.clone(), source };
    let file = OpenOptions::new().create(true).truncate(false).write(true).open(&path).map_err(write)?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => Err(RigError::Busy { path: capture.to_path_buf() }),
        Err(TryLockError::Error(error)) => Err(write(error)),
    }
}

/// Writes pictures and their lines.
pub(crate) struct Journal {
    directory: PathBuf,
    table: File,
    durable: bool,
}

impl Journal {
    /// Opens the table of `capture`, which must be locked, and sees to its end: a torn line is cut off, a whole one without
    /// its newline gets it.
    pub(crate) fn open(capture: &Capture, durable: bool) -> Result<Self, RigError> {
        let directory = capture.directory().to_path_buf();
        let path = directory.join("photographs.csv");
        let write = |source| RigError::Write { path: path.clone(), source };
        let mut table = OpenOptions::new().read(true).append(true).open(&path).map_err(write)?;
        let mut text = Vec::new();
        table.read_to_end(&mut text).map_err(|source| RigError::Read { path: path.clone(), source })?;
        if text.last().is_some_and(|byte| *byte != b'\n') {
            if capture.photographs().torn_line.is_some() {
                let whole = text.iter().rposition(|byte| *byte == b'\n').map_or(0, |newline| newline + 1);
                table.set_len(whole as u64).map_err(write)?;
            } else {
                table.write_all(b"\n").map_err(write)?;
            }
            table.sync_data().map_err(write)?;
        }
        table.seek(SeekFrom::End(0)).map_err(write)?;
        Ok(Self { directory, table, durable })
    }

    /// Puts a photograph into the capture. Returns its row.
    pub(crate) fn append(&mut self, planned: &Planned, photograph: &Photograph) -> Result<PhotographRow, RigError> {
        let stem = planned.stem();
        let file = PathBuf::from(format!("{stem}.{}", photograph.extension));
        self.write_picture(&stem, &file, &photograph.bytes)?;
        let sha256 = Some(Sha256::digest(&photograph.bytes).into());
        let row = PhotographRow { exposure: planned.exposure, file, sha256, line: 0 };
        let line = row.csv_line(planned.position, planned.pattern);
        // One call for one line, so that nobody who reads along sees half of it for long.
        self.table
            .write_all(line.as_bytes())
            .and_then(|()| if self.durable { self.table.sync_data() } else { Ok(()) })
            .map_err(|source| RigError::Write { path: self.directory.join("photographs.csv"), source })?;
        Ok(row)
    }

    /// The picture appears under its name whole or not at all.
    fn write_picture(&self, stem: &str, file: &Path, bytes: &[u8]) -> Result<(), RigError> {
        let path = self.directory.join(file);
        let folder = path.parent().unwrap_or(&self.directory);
        // The same for any extension, so that the next attempt at this photograph clears away what a killed one left.
        let partial = self.directory.join(stem).with_extension("partial");
        let written = self.make_folder(folder).and_then(|()| {
            let mut out = File::create(&partial)?;
            out.write_all(bytes)?;
            if self.durable {
                out.sync_all()?;
            }
            drop(out);
            fs::rename(&partial, &path)?;
            self.sync_folder(folder)
        });
        written.map_err(|source| {
            // Nothing better can be done about a failure here, and the first error is the one to tell.
            let _ = fs::remove_file(&partial);
            RigError::Write { path, source }
        })
    }

    fn make_folder(&self, folder: &Path) -> std::io::Result<()> {
        if folder.is_dir() {
            return Ok(());
        }
        fs::create_dir_all(folder)?;
        folder
            .ancestors()
            .skip(1)
            .take_while(|above| above.starts_with(&self.directory))
            .try_for_each(|above| self.sync_folder(above))
    }

    /// The new name is safe only when the folder is on the disk too.
    fn sync_folder(&self, folder: &Path) -> std::io::Result<()> {
        if !(self.durable && cfg!(unix)) {
            return Ok(());
        }
        match File::open(folder)?.sync_all() {
            // Some network file systems know no fsync of a folder.
            Err(error)
                if matches!(error.kind(), std::io::ErrorKind::InvalidInput | std::io::ErrorKind::Unsupported) =>
            {
                Ok(())
            }
            other => other,
        }
    }
}
