//! `relumine calibrate response`: the camera's response from a bracket.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use relumine::radiometry::files::write_atomically;
use relumine::radiometry::{ChannelFit, RecoveredResponse, Response, ResponseCurve, recover_response, response_plot};
use relumine::{Bracket, ExposureList, Levels};
use serde_json::json;

use crate::failure::{Failure, printed};
use crate::output::refuse_existing;
use crate::progress::Talk;
use crate::response::read_curve;

/// Recover the camera's response from photographs of one view at several exposures
///
/// PICTURES are JPEG, TIFF, PNG or camera RAW with their exposures in EXIF; or --list names them with their times, or
/// --exposures gives these. Writes a response file for `response` in capture.toml and for `relumine merge --response`; prints
/// how well the photographs agree with it. After Debevec & Malik 1997. Best are a still view with flat surfaces from dark to
/// bright, a camera on manual, and five or more exposures a factor 2 apart (at most 4: what lies between is guessed).
#[derive(Args)]
pub(crate) struct Arguments {
    /// Photographs of one view
    #[arg(required_unless_present = "list", conflicts_with = "list")]
    pictures: Vec<PathBuf>,
    /// The response file to write
    #[arg(short, long, value_name = "RESPONSE.csv")]
    output: PathBuf,
    /// A text file with `name seconds` of a photograph a line; names relative to it, # begins a comment
    #[arg(long, value_name = "LIST")]
    list: Option<PathBuf>,
    /// The list has 1/seconds
    #[arg(long, requires = "list")]
    reciprocal: bool,
    /// The exposure of each of PICTURES, in their order, where EXIF does not tell: 0.1,0.2,0.4
    #[arg(long, value_name = "T,…", value_delimiter = ',', conflicts_with = "list")]
    exposures: Vec<f64>,
    /// Counts without light [default: what a camera RAW says, else 0]
    #[arg(long, value_name = "COUNTS")]
    black_level: Option<u16>,
    /// Counts at which a pixel is clipped [default: what a camera RAW says, else 255 or 65535]
    #[arg(long, value_name = "COUNTS")]
    white_level: Option<u16>,
    /// Draw the curve: exposure in stops against code
    #[arg(long, value_name = "CURVE.svg")]
    plot: Option<PathBuf>,
    /// Another response file to hold the curve against, and to draw beside it
    #[arg(long, value_name = "FILE")]
    beside: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Replace outputs that are there
    #[arg(long)]
    force: bool,
}

pub(crate) fn run(arguments: &Arguments, talk: &Talk) -> Result<(), Failure> {
    check_outputs(arguments)?;
    let beside = arguments.beside.as_deref().map(|path| read_curve(path, "--beside")).transpose()?;
    let levels = Levels { black: arguments.black_level, white: arguments.white_level };
    let bracket = match &arguments.list {
        Some(list) => Bracket::read_list(&ExposureList::read(list, arguments.reciprocal)?, levels)?,
        None if arguments.exposures.is_empty() => Bracket::read(&arguments.pictures, levels)?,
        None => Bracket::read_exposed(&arguments.pictures, &arguments.exposures, levels)?,
    };
    if bracket.is_raw {
        talk.say("camera RAW is linear: expect a straight line, or something is wrong with the exposures");
    }
    let (black, white) = (f64::from(bracket.black_level), f64::from(bracket.white_level));
    let recovered = recover_response(&bracket.exposed(), black, white).map_err(|error| {
        let file = bracket.photographs[0].file.display();
        Failure::incomplete(format!("{file} and the photographs beside it: {error}")).with_hint(
            "a good bracket: a still view with dark and bright surfaces, five exposures or more a factor 2 apart",
        )
    })?;
    let Response::Curve(curve) = &recovered.response else {
        return Err(Failure::failed("a recovered response is a curve, but another came"));
    };
    write_text(&arguments.output, &curve.to_csv())?;
    if let Some(plot) = &arguments.plot {
        let name = arguments.beside.as_deref().and_then(Path::file_name).map(|name| name.to_string_lossy());
        let beside = beside.as_ref().zip(name.as_deref()).map(|(curve, name)| (name, curve));
        let title = format!("Response from {} photographs", bracket.photographs.len());
        let seen = recovered.report.map(|fit| fit.seen);
        write_text(plot, &response_plot(curve, Some(seen), beside, &title))?;
    }
    print(&recovered, curve, beside.as_ref(), arguments.json)
}

fn check_outputs(arguments: &Arguments) -> Result<(), Failure> {
    let expected = |path: &Path, extension: &str| {
        if path.extension().is_some_and(|found| found.eq_ignore_ascii_case(extension)) {
            return refuse_existing(path, arguments.force);
        }
        Err(Failure::usage(format!("{}: expected a name that ends in .{extension}", path.display())))
    };
    expected(&arguments.output, "csv")?;
    if let Some(plot) = &arguments.plot {
        expected(plot, "svg")?;
    }
    match arguments.exposures.iter().find(|exposure| !(exposure.is_finite() && **exposure > 0.0)) {
        Some(wrong) => Err(Failure::usage(format!("--exposures are positive numbers, but {wrong} came"))),
        None if !arguments.exposures.is_empty() && arguments.exposures.len() != arguments.pictures.len() => {
            let (exposures, pictures) = (arguments.exposures.len(), arguments.pictures.len());
            Err(Failure::usage(format!(
                "--exposures needs one for each of the {pictures} pictures, but {exposures} came"
            )))
        }
        None => Ok(()),
    }
}

fn write_text(path: &Path, text: &str) -> Result<(), Failure> {
    write_atomically(path, |file| file.write_all(text.as_bytes()))?;
    Ok(())
}

/// The largest difference of f where the other curve is between 5 % and 95 % of the range, per channel.
fn largest_difference(curve: &ResponseCurve, beside: &ResponseCurve) -> [f64; 3] {
    std::array::from_fn(|channel| {
        (0..=4000)
            .map(|step| (f64::from(step) / 4000.0).powi(2))
            .map(|x| (curve.fraction(channel, x), beside.fraction(channel, x)))
            .filter(|(_, beside)| (0.05..=0.95).contains(beside))
            .map(|(found, beside)| (found - beside).abs())
            .fold(0.0, f64::max)
    })
}

fn print(
    recovered: &RecoveredResponse,
    curve: &ResponseCurve,
    beside: Option<&ResponseCurve>,
    json: bool,
) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    let differences = beside.map(|beside| largest_difference(curve, beside));
    if json {
        let channels = ["red", "green", "blue"].iter().zip(&recovered.report).map(|(name, fit)| (*name, json!(fit)));
        let channels: serde_json::Map<_, _> = channels.map(|(name, fit)| (name.to_owned(), fit)).collect();
        return printed(writeln!(out, "{}", json!({ "channels": channels, "largest_difference": differences })));
    }
    printed(writeln!(out, "{:<46}{:>9}{:>9}{:>9}", "", "red", "green", "blue"))?;
    let mut line = |name: &str, value: &dyn Fn(usize) -> String| {
        let [red, green, blue] = [0, 1, 2].map(value);
        printed(writeln!(out, "{name:<46}{red:>9}{green:>9}{blue:>9}"))
    };
    let fit = |channel: usize| -> &ChannelFit { &recovered.report[channel] };
    line("pixels used", &|channel| fit(channel).pixels.to_string())?;
    line("pixels that darken with longer exposure", &|channel| fit(channel).contradicting_pixels.to_string())?;
    line("observations used", &|channel| fit(channel).observations.to_string())?;
    line("observations far off, left out", &|channel| fit(channel).outliers.to_string())?;
    line("residual of exposure, rms, %", &|channel| format!("{:.2}", 100.0 * fit(channel).rms_log_exposure))?;
    line("range seen from, % of codes", &|channel| format!("{:.1}", 100.0 * fit(channel).seen.0))?;
    line("range seen to, % of codes", &|channel| format!("{:.1}", 100.0 * fit(channel).seen.1))?;
    line("smallest slope d ln f / d ln X", &|channel| format!("{:.3}", fit(channel).smallest_gamma))?;
    line("largest slope d ln f / d ln X", &|channel| format!("{:.3}", fit(channel).largest_gamma))?;
    if let Some(differences) = differences {
        line("largest difference of f, 5 % to 95 % of codes", &|channel| format!("{:.4}", differences[channel]))?;
    }
    Ok(())
}
