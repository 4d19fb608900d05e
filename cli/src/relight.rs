//! `relumine relight`: field × light → picture.

use std::path::PathBuf;

use clap::Args;
use relumine::radiometry::{Image, Radiance};
use relumine::{Coefficients, FieldNoise, ReflectanceField, Relighting, StandardErrors, field_noise, missing_share};

use crate::failure::Failure;
use crate::output::{DisplayArguments, PictureFormat, refuse_existing, write_picture};
use crate::progress::Talk;
use crate::projection::ProjectionArguments;

/// Show a field under a light
///
/// LIGHT is a light.toml, a mosaic .exr, or a lat-long .hdr or .exr. Give --light and -o several times, in the same order,
/// to relight under several lights in one pass over the field.
#[derive(Args)]
pub(crate) struct Arguments {
    /// The field
    field: PathBuf,
    /// The light; may be given several times
    #[arg(long = "light", value_name = "LIGHT", required = true)]
    lights: Vec<PathBuf>,
    /// The picture to write, one for each light: .exr and .hdr hold radiance, .png and .tif what a display shows
    #[arg(short, long = "output", value_name = "OUT", required = true)]
    outputs: Vec<PathBuf>,
    /// Write the standard error of the picture too, one for each light: .exr or .hdr
    ///
    /// What the noise of the photographs leaves uncertain in every pixel, as radiance: two of them cover what the picture is
    /// off by in about 95 % of the pixels. It has nothing of what cells, crosstalk of combs, misplaced positions and the
    /// coefficients cost. The field must be developed by this program, fitted or of single squares, and not packed.
    #[arg(long = "error", value_name = "ERROR")]
    errors: Vec<PathBuf>,
    #[command(flatten)]
    projection: ProjectionArguments,
    #[command(flatten)]
    display: DisplayArguments,
    /// Replace outputs that are there
    #[arg(long)]
    force: bool,
}

/// The field under each light, with a bar.
pub(crate) fn pictures(
    field: &ReflectanceField,
    lights: &[Coefficients],
    talk: &Talk,
) -> Result<Vec<Image<Radiance>>, Failure> {
    let mut relighting = Relighting::new(field, lights)?;
    let bar = talk.bar("tiles", relighting.steps(), 0);
    for step in &mut relighting {
        step?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(relighting.pictures())
}

/// The standard error of each of them, with a bar.
fn standard_errors(
    field: &ReflectanceField,
    noise: &FieldNoise,
    lights: &[Coefficients],
    talk: &Talk,
) -> Result<Vec<Image<Radiance>>, Failure> {
    let mut errors = StandardErrors::new(field, noise, lights)?;
    let bar = talk.bar("blocks of standard errors", errors.steps(), 0);
    for step in &mut errors {
        step?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(errors.pictures())
}

pub(crate) fn run(arguments: &Arguments, talk: &Talk) -> Result<(), Failure> {
    let (lights, outputs, errors) = (&arguments.lights, &arguments.outputs, &arguments.errors);
    if lights.len() != outputs.len() {
        return Err(Failure::usage(format!(
            "{} lights, but {} outputs: give one -o for each",
            lights.len(),
            outputs.len()
        )));
    }
    if !errors.is_empty() && errors.len() != lights.len() {
        return Err(Failure::usage(format!(
            "{} lights, but {} standard errors: give one --error for each, or none",
            lights.len(),
            errors.len()
        )));
    }
    for error in errors {
        if !matches!(PictureFormat::of(error)?, PictureFormat::Exr | PictureFormat::Hdr) {
            let error = error.display();
            return Err(Failure::usage(format!("{error}: a standard error is radiance: expected .exr or .hdr")));
        }
    }
    let written: Vec<&PathBuf> = outputs.iter().chain(errors).collect();
    for (index, output) in written.iter().enumerate() {
        PictureFormat::of(output)?;
        refuse_existing(output, arguments.force)?;
        if written[..index].contains(output) {
            return Err(Failure::usage(format!("{} is given twice", output.display())));
        }
    }
    let field = ReflectanceField::open(&arguments.field)?;
    let noise = if errors.is_empty() { None } else { Some(field_noise(&field)?) };
    let mut coefficients = Vec::with_capacity(lights.len());
    let mut incomplete = Vec::new();
    for light in lights {
        let projected = arguments.projection.project(light, field.cells(), talk)?;
        let missing = missing_share(&field, &projected.coefficients);
        if missing > 0.0 {
            incomplete.push(format!("{:.2} % of {}", 100.0 * missing, light.display()));
        }
        coefficients.push(projected.coefficients);
    }
    for (output, picture) in outputs.iter().zip(pictures(&field, &coefficients, talk)?) {
        write_picture(output, &picture, &arguments.display)?;
    }
    if let Some(noise) = noise {
        for (error, picture) in errors.iter().zip(standard_errors(&field, &noise, &coefficients, talk)?) {
            write_picture(error, &picture, &arguments.display)?;
        }
    }
    if incomplete.is_empty() {
        return Ok(());
    }
    Err(Failure::incomplete(format!(
        "{}: squares are missing from the field; the pictures are written, but they do not show {}",
        arguments.field.display(),
        incomplete.join(", ")
    ))
    .with_hint("`relumine inspect` lists what is missing and why"))
}
