//! `relumine develop`: photographs → reflectance field.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use relumine::radiometry::ChannelFit;
use relumine::{DevelopOptions, Development, Encoding, PositionOutcome, Separation};

use crate::failure::Failure;
use crate::output::refuse_existing;
use crate::progress::Talk;

/// Develop a capture into a reflectance field
///
/// Reads the photographs of each position, merges their exposures, subtracts the black frame, separates the squares of the
/// combs, and writes one transfer image a cell. Interrupted at any moment, the same command goes on where it was. A
/// photograph that is missing or damaged makes its squares missing, never black: they are listed, the rest is developed, and
/// the exit code is 3.
#[derive(Args)]
pub(crate) struct Arguments {
    /// The capture directory: capture.toml, photographs.csv and photographs
    capture: PathBuf,
    /// The field to write
    #[arg(short, long, value_name = "FIELD")]
    output: PathBuf,
    /// How squares are told apart
    #[arg(long, value_enum, default_value_t = SeparationArgument::Fitted)]
    separation: SeparationArgument,
    /// The projector's black level, the share of white that black still shines; measured at each position if not given
    #[arg(long, value_name = "B")]
    black_level: Option<f64>,
    /// Pack the field to this error, as `relumine pack --error` does; without it every square is kept as halves
    #[arg(long, value_name = "E", value_parser = crate::pack::error, conflicts_with = "lossless")]
    error: Option<f64>,
    /// Keep every square as halves: what happens without --error
    #[arg(long)]
    lossless: bool,
    /// About how much memory photographs may take, MiB; one position is always developed
    #[arg(long, default_value_t = 1024, value_name = "MIB")]
    memory: usize,
    /// Replace FIELD if it is there
    #[arg(long)]
    force: bool,
}

#[derive(ValueEnum, Clone, Copy, Debug)]
enum SeparationArgument {
    /// Minimum of row comb and column comb, the paper's (§5), nothing cut off: too bright where several squares light a
    /// point, and too dark by noise everywhere.
    Minimum,
    /// The minimum, black below three standard deviations of a photograph without light: the paper's noise filter.
    Thresholded,
    /// The minimum with the bias of the minimum of two noisy values subtracted.
    Unbiased,
    /// The minimum fitted to every comb photograph and to the white frame as far as the noise of each lets it: right in sum
    /// everywhere, and what noise hides in single squares is spread, not lost.
    Fitted,
}

pub(crate) fn run(arguments: &Arguments, talk: &Talk) -> Result<(), Failure> {
    if let Some(b) = arguments.black_level.filter(|b| !(0.0..1.0).contains(b)) {
        return Err(Failure::usage(format!("--black-level must be at least 0 and below 1, but is {b}")));
    }
    refuse_existing(&arguments.output, arguments.force)?;
    let options = DevelopOptions {
        separation: match arguments.separation {
            SeparationArgument::Minimum => Separation::Minimum,
            SeparationArgument::Thresholded => Separation::Thresholded,
            SeparationArgument::Unbiased => Separation::Unbiased,
            SeparationArgument::Fitted => Separation::Fitted,
        },
        black_level: arguments.black_level,
        memory_bytes: arguments.memory.saturating_mul(1 << 20),
        encoding: arguments.error.map_or(Encoding::Lossless, Encoding::Packed),
        replace: arguments.force,
    };
    let mut development = Development::start(&arguments.capture, &arguments.output, &options)?;
    development.remarks().iter().for_each(|remark| talk.say(remark.to_string()));
    if let Some(fits) = development.recovered() {
        say_recovered(fits, talk);
    }
    let mut outcomes = development.already_done().to_vec();
    if !outcomes.is_empty() {
        talk.say(format!("going on: {} of {} positions are done", outcomes.len(), development.positions()));
    }
    let bar = talk.bar("positions", development.positions(), outcomes.len());
    for outcome in &mut development {
        outcomes.push(outcome?);
        bar.inc(1);
    }
    bar.finish_and_clear();
    outcomes.sort_by_key(|outcome| outcome.position);
    let (positions, squares) = (development.positions(), development.squares());
    let blocks = development.blocks_to_pack();
    if blocks > 0 {
        let bar = talk.bar("blocks packed", blocks, 0);
        development.pack(|| bar.inc(1))?;
        bar.finish_and_clear();
    }
    development.finish()?;
    summarise(&outcomes, positions, squares, talk);
    let missing: usize = outcomes.iter().map(|outcome| outcome.missing_squares).sum();
    let losses: Vec<String> = outcomes.iter().flat_map(|outcome| outcome.report.losses.clone()).collect();
    if losses.is_empty() {
        return Ok(());
    }
    talk.say_losses(&losses);
    Err(Failure::incomplete(format!(
        "{}: {} photographs could not be used; {missing} squares are missing from {}",
        arguments.capture.display(),
        losses.len(),
        arguments.output.display()
    ))
    .with_hint("the field can be relit; `relumine inspect` lists every loss"))
}

/// How well the photographs agree with the response that they told, for all of the development.
fn say_recovered(fits: &[ChannelFit; 3], talk: &Talk) {
    let each = |value: &dyn Fn(&ChannelFit) -> String| fits.each_ref().map(value).join(", ");
    talk.say(format!(
        "response recovered from the capture's exposures (red, green, blue): {} pixels, residual of exposure {} % rms, codes \
         seen {} % of the range",
        each(&|fit| fit.pixels.to_string()),
        each(&|fit| format!("{:.2}", 100.0 * fit.rms_log_exposure)),
        each(&|fit| format!("{:.0} to {:.0}", 100.0 * fit.seen.0, 100.0 * fit.seen.1)),
    ));
}

/// Photographs of the same light that disagree by more than this share, beyond their noise, contradict each other.
const CONTRADICTION: f64 = 0.2;

/// No projector shows a black as bright as this share of its white.
const AMBIENT: f64 = 0.03;

/// Residuals and noise over all positions; the field keeps them for each.
fn summarise(outcomes: &[PositionOutcome], positions: usize, squares: usize, talk: &Talk) {
    talk.say(format!("{positions} positions developed"));
    let line = |name: &str, unit: f64, digits: usize, value: &dyn Fn(&PositionOutcome) -> Option<f64>| {
        let mut values: Vec<f64> = outcomes.iter().filter_map(value).collect();
        values.sort_by(f64::total_cmp);
        if let (Some(first), Some(last)) = (values.first(), values.last()) {
            let median = values[values.len() / 2];
            talk.say(format!(
                "  {name:<44} median {:.digits$}, {:.digits$} to {:.digits$}",
                median * unit,
                first * unit,
                last * unit
            ));
        }
    };
    line("residual against the comb photographs, %", 100.0, 3, &|outcome| outcome.report.residual_combs);
    line("  the same for the minimum alone, %", 100.0, 3, &|outcome| outcome.report.residual_combs_of_minimum);
    line("residual against the white frame, %", 100.0, 4, &|outcome| outcome.report.residual_white);
    line("black level of the projector, %", 100.0, 3, &|outcome| outcome.report.black_level);
    line("noise of one photograph, radiance", 1.0, 6, &|outcome| outcome.report.noise);
    line("light below the threshold, cut off, %", 100.0, 3, &|outcome| outcome.report.cut);
    line("bias of minima, subtracted, %", 100.0, 3, &|outcome| outcome.report.bias_subtracted);
    line("light that noise hides, spread, %", 100.0, 3, &|outcome| outcome.report.spread);
    let unmeasured = outcomes.iter().filter_map(|outcome| outcome.report.photograph_noise.as_ref());
    let unmeasured = unmeasured.filter(|noise| !noise.is_measured).count();
    if unmeasured > 0 {
        talk.say(format!(
            "  the noise of {unmeasured} positions could not be measured, since no light was photographed twice there: that of \
             a common camera is taken"
        ));
    }
    let brightest_black = outcomes.iter().filter_map(|outcome| outcome.report.black_level).fold(0.0, f64::max);
    if brightest_black > AMBIENT {
        talk.say(format!(
            "  black is {:.1} % of white: was there other light in the room? It is subtracted, but squares then come out \
             too bright by as much; give the projector's own with --black-level",
            100.0 * brightest_black
        ));
    }
    let contradicts = outcomes
        .iter()
        .filter(|outcome| outcome.report.disagreement.is_some_and(|disagreement| disagreement > CONTRADICTION));
    let contradicts: Vec<String> = contradicts.map(|outcome| outcome.position.to_string()).collect();
    if !contradicts.is_empty() {
        talk.say(format!(
            "  the photographs of positions {} contradict each other: is an exposure wrong, a pattern swapped, the white \
             frame of another exposure than listed?",
            contradicts.join(", ")
        ));
    }
    let developed = outcomes.iter().filter(|outcome| outcome.missing_squares < squares);
    let unknown = developed.filter(|outcome| outcome.report.black_level.is_none()).count();
    if unknown > 0 {
        talk.say(format!(
            "  the projector's black level could not be measured at {unknown} positions: give --black-level"
        ));
    }
    let clipped: usize = outcomes.iter().map(|outcome| outcome.report.clipped_pixels).sum();
    if clipped > 0 {
        talk.say(format!("  {clipped} pixels (over all positions) are clipped in every exposure of some photograph"));
    }
}
