//! The command `relumine`: words first, then their meaning; data on stdout, talk on stderr.
//!
//! Exit codes: 0 done, 1 failed, 2 wrong usage, 3 the input is damaged or incomplete.

mod calibrate;
mod capture;
mod compare;
mod demo;
mod develop;
mod failure;
mod import;
mod inspect;
mod light;
mod merge;
mod output;
mod pack;
mod plan;
mod progress;
mod projection;
mod relight;
mod render;
mod response;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

use failure::Failure;

/// Relight a photographed object with 4D incident light fields.
///
/// A capture (photographs of an object under a moving projector) is developed into a reflectance field once; the field is
/// then shown under any light.
#[derive(Parser)]
#[command(name = "relumine", version, max_term_width = 100, after_help = AFTER_HELP)]
struct Command {
    #[command(subcommand)]
    verb: Verb,
    /// Threads to use; 0 means one a core. The result does not depend on it.
    #[arg(long, global = true, default_value_t = 0, value_name = "N")]
    threads: usize,
    /// No progress and no remarks on stderr; errors still come.
    #[arg(long, short, global = true)]
    quiet: bool,
}

const AFTER_HELP: &str = "\
Exit codes: 0 done, 1 failed, 2 wrong usage, 3 the input is damaged or incomplete (what could be done is done).

Examples:
  relumine demo                                        the whole job on a virtual rig, about a minute
  relumine develop chess -o chess.field
  relumine relight chess.field --light spots.toml -o spots.png";

#[derive(Subcommand)]
enum Verb {
    Demo(demo::Arguments),
    Plan(plan::Arguments),
    Capture(capture::Arguments),
    Develop(develop::Arguments),
    Import(import::Arguments),
    Light(light::Arguments),
    Relight(relight::Arguments),
    Render(render::Arguments),
    Merge(merge::Arguments),
    Compare(compare::Arguments),
    Calibrate(calibrate::Arguments),
    Inspect(inspect::Arguments),
    Pack(pack::Arguments),
}

fn main() -> ExitCode {
    let command = Command::parse();
    if let Err(error) = rayon::ThreadPoolBuilder::new().num_threads(command.threads).build_global() {
        return Failure::failed(format!("cannot start {} threads: {error}", command.threads)).report();
    }
    let talk = progress::Talk::new(command.quiet);
    let done = match command.verb {
        Verb::Demo(arguments) => demo::run(&arguments, &talk),
        Verb::Plan(arguments) => plan::run(&arguments, &talk),
        Verb::Capture(arguments) => capture::run(&arguments, &talk),
        Verb::Develop(arguments) => develop::run(&arguments, &talk),
        Verb::Import(arguments) => import::run(&arguments, &talk),
        Verb::Light(arguments) => light::run(&arguments, &talk),
        Verb::Relight(arguments) => relight::run(&arguments, &talk),
        Verb::Render(arguments) => render::run(&arguments, &talk),
        Verb::Merge(arguments) => merge::run(&arguments, &talk),
        Verb::Compare(arguments) => compare::run(&arguments),
        Verb::Calibrate(arguments) => calibrate::run(&arguments, &talk),
        Verb::Inspect(arguments) => inspect::run(&arguments, &talk),
        Verb::Pack(arguments) => pack::run(&arguments, &talk),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}
