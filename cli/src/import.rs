//! `relumine import`: one-light-at-a-time and RTI photographs → field.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use relumine::radiometry::Response;
use relumine::{Import, ImportOptions};

use crate::failure::Failure;
use crate::output::refuse_existing;
use crate::progress::Talk;

/// Import photographs under distant lamps (RTI domes, one-light-at-a-time sets) as a field
///
/// SOURCE is an RTI .lp file; a folder with one; a folder with light_directions.txt and filenames.txt (DiLiGenT),
/// optionally light_intensities.txt; or a .csv with the header file,x,y,z or file,azimuth_deg,tilt_deg, each optionally with
/// a last column irradiance. z points from the object to the camera, and lamps stand above z = 0. Each lamp becomes one cell
/// whose patch is its Voronoi region.
#[derive(Args)]
pub(crate) struct Arguments {
    /// The list of lamps, or its folder
    source: PathBuf,
    /// The field to write
    #[arg(short, long, value_name = "FIELD")]
    output: PathBuf,
    /// What the codes of PNG, TIFF and JPEG mean; EXR and HDR are linear
    #[arg(long, value_enum, default_value_t = ResponseArgument::Srgb)]
    response: ResponseArgument,
    /// Replace FIELD if it is there
    #[arg(long)]
    force: bool,
}

#[derive(ValueEnum, Clone, Copy, Debug)]
enum ResponseArgument {
    /// Codes are proportional to light.
    Linear,
    /// Codes are sRGB-encoded, as cameras' JPEGs nearly are.
    Srgb,
}

pub(crate) fn run(arguments: &Arguments, talk: &Talk) -> Result<(), Failure> {
    refuse_existing(&arguments.output, arguments.force)?;
    let options = ImportOptions {
        response: match arguments.response {
            ResponseArgument::Linear => Response::Linear,
            ResponseArgument::Srgb => Response::Srgb,
        },
        replace: arguments.force,
    };
    let mut import = Import::start(&arguments.source, &arguments.output, &options)?;
    import.remarks().iter().for_each(|remark| talk.say(remark));
    let bar = talk.bar("lamps", import.lamps(), import.already_done().len());
    let mut outcomes = import.already_done().to_vec();
    for outcome in &mut import {
        outcomes.push(outcome?);
        bar.inc(1);
    }
    bar.finish_and_clear();
    let lamps = import.lamps();
    import.finish()?;
    talk.say(format!("{lamps} lamps imported"));
    let losses: Vec<String> = outcomes.into_iter().flat_map(|outcome| outcome.report.losses).collect();
    if losses.is_empty() {
        return Ok(());
    }
    talk.say_losses(&losses);
    Err(Failure::incomplete(format!(
        "{}: {} photographs could not be used; their cells are missing from {}",
        arguments.source.display(),
        losses.len(),
        arguments.output.display()
    ))
    .with_hint("the field can be relit; `relumine inspect` lists every loss"))
}
