//! `relumine calibrate`: what a camera and a projector do to light, measured once.

mod response;

use clap::{Args, Subcommand};

use crate::failure::Failure;
use crate::progress::Talk;

/// Measure once what the camera and the projector do to light
#[derive(Args)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    Response(response::Arguments),
}

pub(crate) fn run(arguments: &Arguments, talk: &Talk) -> Result<(), Failure> {
    match &arguments.what {
        What::Response(arguments) => response::run(arguments, talk),
    }
}
