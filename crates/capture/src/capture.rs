//! A capture directory: its set-up and its photographs, and what of them is missing.

use std::fmt;
use std::path::{Path, PathBuf};

use crate::{CaptureError, PhotographRow, Photographs, Setup, ShownPattern};

/// A capture as it lies on disk.
pub struct Capture {
    directory: PathBuf,
    setup: Setup,
    photographs: Photographs,
}

/// Something about a capture that a person should know and that stops nothing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Remark {
    /// The same photograph is listed twice; the later row is used.
    Replaced {
        /// The line that is not used.
        line: u64,
        /// The line that is.
        by: u64,
    },
    /// The table ends inside a line.
    Torn {
        /// The line.
        line: u64,
    },
}

impl fmt::Display for Remark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Replaced { line, by } => {
                write!(f, "photographs.csv: line {line} is replaced by line {by} (same position, pattern, exposure)")
            }
            Self::Torn { line } => {
                write!(f, "photographs.csv: line {line} is torn: taken as a photograph not taken yet")
            }
        }
    }
}

impl Capture {
    /// Reads `capture.toml` and `photographs.csv` of `directory`; pictures are not opened.
    ///
    /// # Errors
    /// If either cannot be read, or a row names a position or pattern that the set-up does not have.
    pub fn open(directory: &Path) -> Result<Self, CaptureError> {
        let setup = Setup::read(&directory.join("capture.toml"))?;
        let table = directory.join("photographs.csv");
        let photographs = Photographs::read(&table)?;
        let positions = setup.cells().positions();
        let squares = setup.cells().squares();
        for ((position, pattern), rows) in &photographs.rows {
            let fail = |reason: String| Err(CaptureError::Row { path: table.clone(), line: rows[0].line, reason });
            if *position >= positions {
                return fail(format!(
                    "position {position}: capture.toml has {positions} positions, 0 to {}",
                    positions - 1
                ));
            }
            if !setup.scheme().contains(*pattern, squares) {
                return fail(format!(
                    "pattern {pattern}: not one of the scheme \"{}\" with {squares} × {squares} squares",
                    setup.scheme().name()
                ));
            }
        }
        Ok(Self { directory: directory.to_path_buf(), setup, photographs })
    }

    /// Where it lies.
    pub fn directory(&self) -> &Path {
        &self.directory
    }

    /// What was set up.
    pub fn setup(&self) -> &Setup {
        &self.setup
    }

    /// What was taken.
    pub fn photographs(&self) -> &Photographs {
        &self.photographs
    }

    /// The exposures of one pattern at one position, shortest first; empty if none was taken.
    pub fn exposures(&self, position: usize, pattern: ShownPattern) -> &[PhotographRow] {
        self.photographs.rows.get(&(position, pattern)).map_or(&[], Vec::as_slice)
    }

    /// What the table has that a person should know.
    pub fn remarks(&self) -> Vec<Remark> {
        let replaced = self.photographs.replaced.iter().map(|(line, by)| Remark::Replaced { line: *line, by: *by });
        replaced.chain(self.photographs.torn_line.map(|line| Remark::Torn { line })).collect()
    }

    /// Patterns of the scheme, `black` included, that have no photograph in the table at `position`.
    pub fn missing(&self, position: usize) -> Vec<ShownPattern> {
        std::iter::once(ShownPattern::Black)
            .chain(self.setup.scheme().lighting(self.setup.cells().squares()))
            .filter(|pattern| self.exposures(position, *pattern).is_empty())
            .collect()
    }
}
