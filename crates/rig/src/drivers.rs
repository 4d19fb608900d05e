//! From a description to a rig that is ready.

use std::io::{self, BufReader, IsTerminal};
use std::path::Path;
use std::rc::Rc;

use crate::devices::Drivers;
use crate::manual::{ManualProjector, ManualStage, Operator, TypedEarly, WatchedFolder};
use crate::{Hands, Rig, RigError};

/// Makes the drivers of `rig` ready for the capture at `directory`. Manual ones ask on stderr and are answered on stdin.
///
/// # Errors
/// If a driver cannot be made ready.
pub fn open(rig: &Rig, directory: &Path) -> Result<Drivers, RigError> {
    match rig.hands() {
        Hands::Manual => {
            // An Enter typed while nothing was asked is no answer to the next question; a script's is.
            let early = if io::stdin().is_terminal() { TypedEarly::Forget } else { TypedEarly::Keep };
            let operator = Operator::new(BufReader::new(io::stdin()), io::stderr(), early)?;
            manual(rig, directory, operator)
        }
        Hands::Simulated => simulated(rig),
    }
}

/// Manual drivers that ask `operator`.
///
/// # Errors
/// If the watched folder cannot be made or read.
pub fn manual(rig: &Rig, directory: &Path, operator: Operator) -> Result<Drivers, RigError> {
    let operator = Rc::new(operator);
    Ok(Drivers {
        stage: Box::new(ManualStage::new(operator.clone(), rig.setup().cells().positions())),
        projector: Box::new(ManualProjector::new(operator.clone(), directory)),
        camera: Box::new(WatchedFolder::open(operator, rig.shared_setup(), directory, rig.manual())?),
        durable: true,
    })
}

/// The virtual rig.
fn simulated(rig: &Rig) -> Result<Drivers, RigError> {
    match rig.simulated() {
        Some(settings) => crate::simulated::open(settings, rig.shared_setup()),
        None => {
            let reason = "simulated drivers need the section [simulated], which is missing".into();
            Err(RigError::Rig { path: rig.path().to_path_buf(), reason })
        }
    }
}
