//! `relumine plan`: what a capture costs, and its directory.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use relumine::rig::{Estimate, Plan, PlanWarning};
use relumine::{Development, Rig, lay_out};
use serde_json::json;

use crate::failure::{Failure, printed};
use crate::output::refuse_existing;
use crate::progress::Talk;

/// Lay out a capture: photographs, hours, bytes
///
/// Reads the description of a rig (FORMAT.md §5) and says how many photographs it will take, for how long and of what size.
/// With CAPTURE, lays out the directory that `relumine capture` fills: capture.toml, rig.toml, an empty photographs.csv, and,
/// for a projector that is served by hand, the pictures of the patterns. Without, nothing is written.
#[derive(Args)]
pub(crate) struct Arguments {
    /// The description of the rig
    rig: PathBuf,
    /// The capture directory to lay out: a new name or an empty directory
    capture: Option<PathBuf>,
    /// Replace CAPTURE if nothing has been photographed into it
    #[arg(long)]
    force: bool,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(arguments: &Arguments, talk: &Talk) -> Result<(), Failure> {
    let rig = Rig::read(&arguments.rig)?;
    if let Some(directory) = &arguments.capture {
        // Whether it may be replaced is seen when it is laid out; here, whether there is a folder for it.
        refuse_existing(directory, true)?;
        lay_out(&rig, directory, arguments.force)?;
    }
    let plan = Plan::of(&rig);
    let estimate = Estimate::of(&rig, &plan);
    let developing = Development::bytes_per_position(rig.setup()) as u64;
    let warnings = PlanWarning::all(&rig, &estimate, arguments.capture.as_deref(), developing);
    if arguments.json { print_json(&plan, &estimate, developing, &warnings) } else { print(&rig) }?;
    warnings.iter().for_each(|warning| talk.say(format!("warning: {warning}")));
    if let Some(directory) = &arguments.capture {
        talk.say(format!("laid out; `relumine capture {}` takes the photographs", directory.display()));
    }
    Ok(())
}

/// What a rig will take, in words.
pub(crate) fn print(rig: &Rig) -> Result<(), Failure> {
    let plan = Plan::of(rig);
    let estimate = Estimate::of(rig, &plan);
    let developing = Development::bytes_per_position(rig.setup()) as u64;
    let mut out = std::io::stdout().lock();
    let mut line = |name: &str, value: String| printed(writeln!(out, "{name:<14} {value}"));
    line("rig", rig.setup().title().unwrap_or("(no title)").into())?;
    line("positions", plan.positions().to_string())?;
    line("patterns", format!("{} a position", plan.patterns().len()))?;
    line(
        "photographs",
        format!(
            "{} a position ({} of each pattern), {} in all",
            plan.per_position(),
            plan.exposures().len(),
            plan.len()
        ),
    )?;
    let hours = estimate.hours.map_or_else(|| "none: a virtual rig".into(), |hours| format!("{hours:.1}"));
    line("hours", hours)?;
    let each = estimate.reckoned_bits.map_or_else(
        || format!("{} a photograph", megabytes(estimate.bytes_per_photograph)),
        |bits| format!("{} a photograph, {bits} bits uncompressed", megabytes(estimate.bytes_per_photograph)),
    );
    line("bytes", format!("{} ({}; {each})", estimate.bytes, megabytes(estimate.bytes)))?;
    line("developing", format!("{} of memory a position", megabytes(developing)))
}

fn print_json(plan: &Plan, estimate: &Estimate, developing: u64, warnings: &[PlanWarning]) -> Result<(), Failure> {
    let text = json!({
        "positions": plan.positions(),
        "patterns_per_position": plan.patterns().len(),
        "photographs_per_position": plan.per_position(),
        "photographs": plan.len(),
        "hours": estimate.hours,
        "bytes_per_photograph": estimate.bytes_per_photograph,
        "bytes": estimate.bytes,
        "developing_bytes_per_position": developing,
        "warnings": warnings.iter().map(ToString::to_string).collect::<Vec<_>>(),
    });
    printed(writeln!(std::io::stdout(), "{text:#}"))
}

fn megabytes(bytes: u64) -> String {
    match bytes {
        0..1_000_000_000 => format!("{:.1} MB", bytes as f64 / 1e6),
        _ => format!("{:.1} GB", bytes as f64 / 1e9),
    }
}
