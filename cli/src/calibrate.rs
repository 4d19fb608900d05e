//! `relumine calibrate`: what must be measured once of a rig.

mod projector;

use clap::{Args, Subcommand};

use crate::failure::Failure;
use crate::progress::Talk;

/// Measure what a rig does to light
#[derive(Args)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    Projector(projector::Arguments),
}

pub(crate) fn run(arguments: &Arguments, talk: &Talk) -> Result<(), Failure> {
    match &arguments.what {
        What::Projector(arguments) => projector::run(arguments, talk),
    }
}
