//! Manual drivers: a person moves the projector and shows the patterns, the camera's own program puts its pictures in a folder.

mod operator;
mod watched_folder;

use std::path::{Path, PathBuf};
use std::rc::Rc;

use relumine_basis::Position;
use relumine_capture::ShownPattern;

use crate::RigError;
use crate::devices::{Projector, Stage};
use crate::layout::pattern_file;

pub use operator::{Operator, TypedEarly};
pub use watched_folder::WatchedFolder;

/// A stage that is moved by hand.
pub struct ManualStage {
    operator: Rc<Operator>,
    positions: usize,
}

impl ManualStage {
    /// Asks `operator` to move; `positions` is how many there are.
    pub fn new(operator: Rc<Operator>, positions: usize) -> Self {
        Self { operator, positions }
    }
}

impl Stage for ManualStage {
    fn move_to(&mut self, index: usize, position: Position) -> Result<(), RigError> {
        self.operator.ask(&format!(
            "position {} of {} (p{index:03}): bring the projector to azimuth {:.2}°, tilt {:.2}°",
            index + 1,
            self.positions,
            position.azimuth.to_degrees(),
            position.tilt.to_degrees()
        ))
    }
}

/// A projector whose patterns are shown by hand.
pub struct ManualProjector {
    operator: Rc<Operator>,
    capture: PathBuf,
}

impl ManualProjector {
    /// Asks `operator` to show the patterns that were laid out in `capture`.
    pub fn new(operator: Rc<Operator>, capture: &Path) -> Self {
        Self { operator, capture: capture.to_path_buf() }
    }
}

impl Projector for ManualProjector {
    fn show(&mut self, pattern: ShownPattern) -> Result<(), RigError> {
        let file = self.capture.join(pattern_file(pattern));
        self.operator.ask(&format!("show {pattern} full screen: {}", file.display()))
    }
}
