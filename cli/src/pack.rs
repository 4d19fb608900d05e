//! `relumine pack`: a field encoded anew.

use std::path::PathBuf;

use clap::Args;
use relumine::{Encoding, ReflectanceField, Repacking, kept};

use crate::failure::Failure;
use crate::output::refuse_existing;
use crate::progress::Talk;

/// Encode a field anew: small at a bounded error, or lossless
///
/// A packed field keeps for every 8 × 8 pixels a basis of its own and a few coefficients for each position: a fraction of
/// the bytes. What is too weak to be kept square by square is kept coarsely, never dropped. `relumine inspect FIELD --against
/// OTHER` measures what was lost. Interrupted at any moment, the same command goes on where it was.
#[derive(Args)]
pub(crate) struct Arguments {
    /// The field
    field: PathBuf,
    /// The field to write
    #[arg(short, long, value_name = "FIELD")]
    output: PathBuf,
    #[command(flatten)]
    encoding: EncodingArguments,
    /// About how much memory blocks under way may take, MiB; one block is always done
    #[arg(long, default_value_t = 1024, value_name = "MIB")]
    memory: usize,
    /// Replace the output if it is there
    #[arg(long)]
    force: bool,
}

/// How a field is to be encoded.
#[derive(Args)]
#[group(required = true, multiple = false)]
pub(crate) struct EncodingArguments {
    /// Pack to this error: about what pictures of single squares are off by, patch for patch, over what all squares of a
    /// position show there; 0.01 is one percent
    #[arg(long, value_name = "E", value_parser = error)]
    error: Option<f64>,
    /// Keep every square as halves
    #[arg(long)]
    lossless: bool,
}

impl EncodingArguments {
    /// Packed if an error is given.
    pub(crate) fn encoding(&self) -> Encoding {
        self.error.map_or(Encoding::Lossless, Encoding::Packed)
    }
}

/// Reads an error to pack to.
pub(crate) fn error(text: &str) -> Result<f64, String> {
    let range = Encoding::ERRORS;
    let error: f64 = text.parse().map_err(|_| format!("expected a share such as 0.01, found \"{text}\""))?;
    if range.contains(&error) {
        return Ok(error);
    }
    Err(format!("expected a share between {} and {}, found {error}", range.start(), range.end()))
}

pub(crate) fn run(arguments: &Arguments, talk: &Talk) -> Result<(), Failure> {
    refuse_existing(&arguments.output, arguments.force)?;
    let encoding = arguments.encoding.encoding();
    let memory = arguments.memory.saturating_mul(1 << 20);
    let mut repacking = Repacking::start(&arguments.field, &arguments.output, encoding, memory, arguments.force)?;
    if repacking.done() > 0 {
        talk.say(format!("going on: {} of {} are done", repacking.done(), repacking.steps()));
    }
    let unit = if encoding == Encoding::Lossless { "positions" } else { "blocks" };
    let bar = talk.bar(unit, repacking.steps(), repacking.done());
    for step in repacking.by_ref() {
        bar.inc(step? as u64);
    }
    bar.finish_and_clear();
    repacking.finish()?;
    let packed = ReflectanceField::open(&arguments.output)?;
    if let Some(kept) = kept_in_words(&packed) {
        talk.say(format!("of the light: {kept}"));
    }
    Ok(())
}

/// Where the light of a packed field went; `None` if it is not packed or shows nothing.
pub(crate) fn kept_in_words(field: &ReflectanceField) -> Option<String> {
    let kept = kept(field);
    let percent = |part: f64| 100.0 * part / kept.whole;
    (kept.whole > 0.0 && kept.power > 0.0).then(|| {
        format!(
            "{:.2} % in main squares, {:.2} % in other squares, {:.2} % shared out in coarse squares; wholes are off by {:.3} % \
             (relative L2)",
            100.0 - percent(kept.squares) - percent(kept.coarse),
            percent(kept.squares),
            percent(kept.coarse),
            100.0 * (kept.residual / kept.power).sqrt()
        )
    })
}
