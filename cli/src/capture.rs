//! `relumine capture`: take the photographs that are still missing.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use indicatif::HumanDuration;
use relumine::rig::{Hands, RigError, Taken, drivers};
use relumine::{Rig, Run};

use crate::failure::Failure;
use crate::progress::Talk;

/// Take the photographs that are still missing
///
/// Moves, shows and photographs as the capture's rig.toml says, position by position. Each photograph is on disk before the
/// next is taken: stopped at any moment, by q, by Ctrl-C or by a power cut, the same command goes on where it was. Rigs
/// served by hand say what to do and wait for Enter; the camera's pictures are found in the watched folder. The exit code is
/// 3 if photographs are missing at the end.
#[derive(Args)]
pub(crate) struct Arguments {
    /// The capture directory that `relumine plan` laid out
    capture: PathBuf,
    /// Read all photographs that are there, and take those again that have changed
    #[arg(long)]
    verify: bool,
}

pub(crate) fn run(arguments: &Arguments, talk: &Talk) -> Result<(), Failure> {
    let directory = &arguments.capture;
    let rig = Rig::read(&directory.join("rig.toml"))?;
    let mut run = Run::open(directory, drivers::open(&rig, directory)?)?;
    run.capture().remarks().iter().for_each(|remark| talk.say(remark.to_string()));
    if arguments.verify {
        run.verify();
    }
    if !run.lost().is_empty() {
        talk.say(format!("{} listed photographs are gone or have changed and are taken again:", run.lost().len()));
        let lost: Vec<String> = run.lost().iter().map(|file| file.display().to_string()).collect();
        talk.say_some(&lost, 20);
    }
    if run.already_done() > 0 {
        talk.say(format!("going on: {} of {} photographs are there", run.already_done(), run.total()));
    }
    let by_hand = rig.hands() == Hands::Manual;
    // A bar would draw over the questions.
    let bar = (!by_hand).then(|| talk.bar("photographs", run.total(), run.already_done()));
    let (began, mut taken, mut bytes, mut stopped) = (Instant::now(), 0, 0, false);
    while let Some(photograph) = run.next() {
        match photograph {
            Ok(Taken { bytes: more, .. }) => bytes += more,
            Err(RigError::Stopped) => {
                stopped = true;
                break;
            }
            Err(error) => return Err(error.into()),
        }
        taken += 1;
        match &bar {
            Some(bar) => bar.inc(1),
            None if run.missing() > 0 => {
                let left = began.elapsed() / taken * u32::try_from(run.missing()).unwrap_or(u32::MAX);
                talk.say(format!(
                    "{} of {} photographs, about {} left",
                    run.total() - run.missing(),
                    run.total(),
                    HumanDuration(left)
                ));
            }
            None => {}
        }
    }
    if let Some(bar) = bar {
        bar.finish_and_clear();
    }
    talk.say(format!(
        "{taken} photographs taken ({:.1} MB); {} of {} are there",
        bytes as f64 / 1e6,
        run.total() - run.missing(),
        run.total()
    ));
    if run.missing() == 0 {
        return Ok(());
    }
    let what = if stopped { "stopped; " } else { "" };
    Err(Failure::incomplete(format!("{}: {what}{} photographs are missing", directory.display(), run.missing()))
        .with_hint("the same command goes on where it was"))
}
