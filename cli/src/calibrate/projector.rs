//! `relumine calibrate projector`: flat field, black level, colour and response of a projector from photographs of a white card.

use std::fmt::Write as _;
use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use relumine::CardPhotographs;
use relumine::radiometry::files::write_atomically;
use relumine::radiometry::projector::{FlatField, LevelRamp, PatternView, RampEntry};
use relumine::radiometry::read_bounded;

use crate::failure::{Failure, printed};
use crate::output::refuse_existing;
use crate::progress::Talk;
use crate::response;

/// Measure a projector from photographs of a flat, matte, white card that fills its pattern, across its axis
///
/// From the card under full white: the relative flux of each square (`square_flux`, the flat field), and the gains that make the
/// projector's white grey. With the card under black: the black level b. From a ramp of grey levels: the response of each channel, and
/// the contrast. The flux of a square is the mean radiance of its area on the card; neither the projector's angle nor the camera's
/// place weighs in it, but what the camera's lens darkens towards its corners does: keep the card in the middle of the picture.
///
/// What capture.toml understands is printed as TOML, to be put into its section projector; the rest stands there as comments.
#[derive(Args)]
pub(crate) struct Arguments {
    /// Photographs of the card under full white, all of one exposure; several are averaged
    #[arg(long, value_name = "PHOTO", num_args = 1.., required_unless_present = "ramp", requires_all = ["corners", "squares"])]
    white_card: Vec<PathBuf>,
    /// Photographs of the card under black
    #[arg(long, value_name = "PHOTO", num_args = 1.., requires = "white_card")]
    black: Vec<PathBuf>,
    /// How many times as long the black photographs were exposed as the white ones
    #[arg(long, value_name = "TIMES", default_value_t = 1.0, requires = "black")]
    black_longer: f64,
    /// The corners of the pattern in the photographs, pixels: upper left, upper right, lower right, lower left as the projector sees
    /// the card
    #[arg(long, value_name = "X,Y", value_parser = corner, num_args = 4)]
    corners: Vec<[f64; 2]>,
    /// M: the pattern is M × M squares
    #[arg(long, value_name = "M")]
    squares: Option<usize>,
    /// A list of photographs of a ramp, all of one exposure: a line `PHOTO LEVEL` for each; photographs lie beside the list
    #[arg(long, value_name = "LIST", requires = "ramp_output")]
    ramp: Option<PathBuf>,
    /// Write the response as CSV: level, and the light of red, green and blue, relative to the highest level
    #[arg(long, value_name = "CSV", requires = "ramp")]
    ramp_output: Option<PathBuf>,
    /// The camera's response: linear, srgb, or a response file
    #[arg(long, default_value = "linear")]
    response: String,
    /// Counts without light
    #[arg(long, default_value_t = 0, value_name = "COUNTS")]
    black_level: u16,
    /// Counts at which a pixel is clipped; by default the largest of the picture's bits
    #[arg(long, value_name = "COUNTS")]
    white_level: Option<u16>,
    /// Write the TOML to a file instead of printing it
    #[arg(short, long, value_name = "TOML", requires = "white_card")]
    output: Option<PathBuf>,
    /// Replace outputs if they are there
    #[arg(long)]
    force: bool,
}

/// A list of levels is short.
const LONGEST_LIST: u64 = 4 << 20;

fn corner(text: &str) -> Result<[f64; 2], String> {
    let numbers: Option<Vec<f64>> =
        text.split(',').map(|number| number.trim().parse().ok().filter(|value: &f64| value.is_finite())).collect();
    match numbers.as_deref() {
        Some(&[x, y]) => Ok([x, y]),
        _ => Err("expected X,Y in pixels, as 120.5,88".into()),
    }
}

pub(crate) fn run(arguments: &Arguments, talk: &Talk) -> Result<(), Failure> {
    if !(1e-3..=1e6).contains(&arguments.black_longer) {
        return Err(Failure::usage(format!(
            "--black-longer must be 0.001 to 1000000, but is {}",
            arguments.black_longer
        )));
    }
    for output in [&arguments.output, &arguments.ramp_output].into_iter().flatten() {
        refuse_existing(output, arguments.force)?;
    }
    let photographs = CardPhotographs {
        response: response::named(&arguments.response)?,
        black_level: arguments.black_level,
        white_level: arguments.white_level,
    };
    let view = match &arguments.corners[..] {
        &[a, b, c, d] => {
            Some(PatternView::from_corners([a, b, c, d]).map_err(|error| Failure::usage(error.to_string()))?)
        }
        _ => None,
    };
    if let (Some(view), Some(squares)) = (view, arguments.squares.filter(|_| !arguments.white_card.is_empty())) {
        let black = Some(&arguments.black[..]).filter(|black| !black.is_empty());
        let found = photographs.flat_field(&arguments.white_card, black, arguments.black_longer, view, squares)?;
        let text = snippet(&found);
        match &arguments.output {
            Some(path) => write_atomically(path, |out| out.write_all(text.as_bytes()))?,
            None => printed(std::io::stdout().lock().write_all(text.as_bytes()))?,
        }
        say(&found, talk);
    }
    if let (Some(list), Some(output)) = (&arguments.ramp, &arguments.ramp_output) {
        ramp(list, output, &photographs, view, talk)?;
    }
    Ok(())
}

/// The flat field as a part of capture.toml.
fn snippet(found: &FlatField) -> String {
    let mut text =
        String::from("# Measured by `relumine calibrate projector`: put this under [projector] in capture.toml.\n");
    let [red, green, blue] = found.white_balance;
    // Comments: capture.toml has no keys for these.
    let _ = writeln!(
        text,
        "# white balance (gains that make white grey of the same luminance): {red:.4} {green:.4} {blue:.4}"
    );
    if let Some(b) = found.black_level {
        let _ =
            writeln!(text, "# black level b: {b:.6} (`develop` measures it at each position, or takes --black-level)");
    }
    text.push_str("square_flux = [\n");
    for row in &found.square_flux {
        let numbers: Vec<String> = row.iter().map(|value| format!("{value:.5}")).collect();
        let _ = writeln!(text, "    [{}],", numbers.join(", "));
    }
    text.push_str("]\n");
    text
}

fn say(found: &FlatField, talk: &Talk) {
    let flux = || found.square_flux.iter().flatten().copied();
    let (least, most) = (flux().fold(f64::INFINITY, f64::min), flux().fold(0.0, f64::max));
    talk.say(format!("flux of squares {least:.3} to {most:.3} of that on the axis"));
    if found.colour_spread > 0.02 {
        talk.say(format!(
            "the projector's colour differs by up to {:.1} % from square to square, which one flux a square does not undo",
            100.0 * found.colour_spread
        ));
    }
    if let Some(b) = found.black_level {
        talk.say(format!("black level {:.3} %, contrast {:.0} : 1", 100.0 * b, 1.0 / b.max(1e-9)));
    }
}

fn ramp(
    list: &Path,
    output: &Path,
    photographs: &CardPhotographs,
    view: Option<PatternView>,
    talk: &Talk,
) -> Result<(), Failure> {
    let text = read_bounded(list, LONGEST_LIST)
        .map_err(|error| Failure::incomplete(format!("cannot read {}: {error}", list.display())))?;
    let entries = RampEntry::parse_list(list, &text).map_err(|error| {
        Failure::incomplete(error.to_string()).with_hint("a list has a line `PHOTO LEVEL` for each photograph")
    })?;
    let found: LevelRamp = photographs.ramp(list, &entries, view)?;
    write_atomically(output, |out| out.write_all(found.csv().as_bytes()))?;
    let [red, green, blue] = found.contrast.map(f64::round);
    talk.say(format!(
        "{} levels; the highest is {red}, {green}, {blue} times as bright as the lowest (R, G, B)",
        entries.len()
    ));
    for level in &found.falls {
        talk.say(format!(
            "  level {level} is darker than the one before: is its photograph another one, or another exposure?"
        ));
    }
    Ok(())
}
