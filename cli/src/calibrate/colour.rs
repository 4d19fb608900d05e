//! `relumine calibrate colour`: a colour correction from a photographed chart.

mod report;

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use relumine::radiometry::Response;
use relumine::radiometry::colour::{
    Chart, ColourError, ColourFit, ColourProfile, Fitted, Illuminant, LeftOut, Measurement, Model, Photograph,
    Reference, measure,
};
use relumine::radiometry::files;

use crate::failure::Failure;
use crate::output::{PictureFormat, refuse_existing};
use crate::progress::Talk;
use crate::response;

/// Fit a camera's colour correction to a photograph of a ColorChecker
///
/// Finds the chart (or takes its corners), measures its patches, and fits the matrix or root polynomial that brings them
/// nearest to the reference (least ΔE₀₀, after linear least squares). The result, chart.toml, is named as the colour of a camera by
/// capture.toml. Prints ΔE₀₀ before the correction, after it, and of patches held out of the fit.
#[derive(Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Arguments {
    /// The photograph: PNG, TIFF or JPEG with --response, or a linear EXR or HDR
    photograph: PathBuf,
    /// The correction to write
    #[arg(short, long, value_name = "CHART.toml")]
    output: PathBuf,
    /// The chart: 24, sg, dc, or a .cht file of ArgyllCMS
    #[arg(long, default_value = "24", value_name = "CHART")]
    chart: String,
    /// Reference values: a CGATS table (.cie, .ti2, .ti3, .txt) or a .cht file; without it those of the .cht chart, and for 24 those that
    /// X-Rite publishes for charts made before November 2014
    #[arg(long, value_name = "FILE")]
    reference: Option<PathBuf>,
    /// The light that the reference values are for: D50, D65, C, A, or lightest-patch (its colour is the light's)
    #[arg(long, default_value = "D50", value_name = "LIGHT")]
    illuminant: Illuminant,
    /// Where the chart lies, pixels: top left, top right, bottom right, bottom left, as its names can be read. For 24, sg and dc the outer
    /// corners of the corner patches, for a .cht file its fiducial marks. Without them the chart is searched for
    #[arg(long, value_name = "X,Y,X,Y,X,Y,X,Y", value_parser = corners, allow_hyphen_values = true)]
    corners: Option<Corners>,
    /// How the camera's codes follow from light: linear, srgb, or a response file
    #[arg(long, value_name = "RESPONSE")]
    response: Option<String>,
    /// Counts without light
    #[arg(long, default_value_t = 0, value_name = "COUNTS")]
    black_level: u16,
    /// Counts at which a pixel is clipped; the largest of the file's range if not given
    #[arg(long, value_name = "COUNTS")]
    white_level: Option<u16>,
    /// What is fitted. Only a matrix may be applied to a field
    #[arg(long, value_enum, default_value_t = ModelArgument::Matrix)]
    model: ModelArgument,
    /// Hold grey neutral exactly: the fit then has two unknowns less
    #[arg(long)]
    keep_white: bool,
    /// Write a picture: of each patch the left third as photographed, the middle corrected, the right the reference
    #[arg(long, value_name = "SIDE.png")]
    picture: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Replace the outputs if they are there
    #[arg(long)]
    force: bool,
}

const AFTER_HELP: &str = "\
Examples:
  relumine calibrate colour chart.jpg --response srgb -o chart.toml --picture side.png
  relumine calibrate colour sg.png --response response.csv --chart sg --reference ColorCheckerSG.ti2 \\
      --corners 303,171,1630,163,1634,1110,306,1112 -o chart.toml";

#[derive(ValueEnum, Clone, Copy, Debug)]
enum ModelArgument {
    /// 3 × 3
    Matrix,
    /// Of degree 2 (Finlayson, Mackiewicz, Hurlbert 2015): twice as bright stays twice as bright, but it is not linear in light
    RootPolynomial,
}

pub(crate) fn run(arguments: &Arguments, talk: &Talk) -> Result<(), Failure> {
    refuse_existing(&arguments.output, arguments.force)?;
    if let Some(picture) = &arguments.picture {
        if PictureFormat::of(picture)? != PictureFormat::Png {
            return Err(Failure::usage(format!("{}: the picture is written as .png", picture.display())));
        }
        refuse_existing(picture, arguments.force)?;
    }
    let chart = chart(&arguments.chart)?;
    let reference = reference(arguments, &chart)?;
    let photograph = photograph(arguments)?;
    let about_photograph = |error: ColourError| about(&arguments.photograph, error);
    let (corners, found) = match &arguments.corners {
        Some(Corners(corners)) => (*corners, false),
        None => {
            let found = chart.find(&photograph, &reference).map_err(about_photograph)?;
            talk.say(format!(
                "{} found: {} of its {} patches stand out, their colours agree to {:.1} %",
                chart.name(),
                found.patches,
                chart.patches().len(),
                100.0 * found.agreement
            ));
            (found.corners, true)
        }
    };
    let (measured, left_out) = measure(&photograph, &chart, corners).map_err(about_photograph)?;
    for LeftOut { name, reason } in &left_out {
        talk.say(format!("patch {name} is left out: {reason}"));
    }
    say_what_is_odd(&measured, &reference, talk);
    let model = match arguments.model {
        ModelArgument::Matrix => Model::Matrix,
        ModelArgument::RootPolynomial => Model::RootPolynomial,
    };
    let fit = ColourFit::new(&measured, &reference, model, arguments.keep_white).map_err(about_photograph)?;
    let name_of = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let fitted = Fitted {
        program: concat!("relumine ", env!("CARGO_PKG_VERSION")).into(),
        photograph: name_of(&arguments.photograph),
        response: arguments.response.as_deref().map_or("linear".into(), |response| name_of(Path::new(response))),
        chart: chart.name().into(),
        reference: reference.name().into(),
        illuminant: arguments.illuminant.to_string(),
        corners: corners.map(|corner| corner.map(|value| (value * 100.0).round() / 100.0)),
        found,
        white_kept: arguments.keep_white,
        exposure: fit.exposure,
        patches: fit.patches.len(),
        left_out: left_out.iter().map(|patch| format!("{}: {}", patch.name, patch.reason)).collect(),
        before: fit.errors(|patch| patch.error_before),
        after: fit.errors(|patch| patch.error_after),
        held_out: fit.errors(|patch| patch.error_held_out),
    };
    let profile = ColourProfile { correction: fit.correction, fitted: Some(fitted.clone()) };
    if let Some(picture) = &arguments.picture {
        files::write_png8(picture, &fit.side_by_side(&chart))?;
    }
    profile.write(&arguments.output)?;
    if arguments.json { report::print_json(&profile, &fitted, &fit) } else { report::print(&fitted, &fit) }
}

/// Where the chart lies: top left, top right, bottom right, bottom left, pixels.
#[derive(Clone, Copy, Debug)]
struct Corners([[f64; 2]; 4]);

fn corners(text: &str) -> Result<Corners, String> {
    let numbers: Option<Vec<f64>> =
        text.split(',').map(|word| word.trim().parse().ok().filter(|number: &f64| number.is_finite())).collect();
    match numbers.as_deref() {
        Some([a, b, c, d, e, f, g, h]) => Ok(Corners([[*a, *b], [*c, *d], [*e, *f], [*g, *h]])),
        _ => Err("expected four points, eight numbers with commas between them".into()),
    }
}

fn chart(name: &str) -> Result<Chart, Failure> {
    match name {
        "24" => Ok(Chart::colorchecker_24()),
        "sg" => Ok(Chart::colorchecker_sg()),
        "dc" => Ok(Chart::colorchecker_dc()),
        file if file.to_lowercase().ends_with(".cht") => Ok(Chart::read_cht(Path::new(file))?),
        other => {
            Err(Failure::usage(format!("--chart: expected 24, sg, dc or the name of a .cht file, found \"{other}\"")))
        }
    }
}

fn reference(arguments: &Arguments, chart: &Chart) -> Result<Reference, Failure> {
    let illuminant = arguments.illuminant;
    if let Some(path) = &arguments.reference {
        return Ok(Reference::read(path, illuminant)?);
    }
    if let Some(expected) =
        Reference::of_chart(chart, illuminant).map_err(|error| about(Path::new(&arguments.chart), error))?
    {
        return Ok(expected);
    }
    match arguments.chart.as_str() {
        "24" if illuminant == Illuminant::D50 => Ok(Reference::colorchecker_24()),
        "24" => Err(Failure::usage("--illuminant belongs to a --reference: the values for 24 are for D50")),
        other => Err(Failure::usage(format!("--chart {other} has no values of its own: give --reference FILE"))),
    }
}

fn photograph(arguments: &Arguments) -> Result<Photograph, Failure> {
    let path = &arguments.photograph;
    let picture = files::read_picture(path)?;
    let response = match (arguments.response.as_deref(), &picture) {
        (Some(name), _) => response::named(name)?,
        (None, files::Picture::Float(_)) => Response::Linear,
        (None, files::Picture::Integer { .. }) => {
            return Err(Failure::usage(format!(
                "{}: a {} does not say how its codes follow from light: give --response linear, srgb or a response file",
                path.display(),
                picture.describe()
            )));
        }
    };
    Photograph::new(&picture, &response, arguments.black_level, arguments.white_level)
        .map_err(|error| about(path, error))
}

/// What the library says of a photograph or a chart, with its name.
fn about(path: &Path, error: ColourError) -> Failure {
    match error {
        ColourError::NotFound(reason) => Failure::incomplete(format!("{}: {reason}", path.display()))
            .with_hint("give its corners with --corners, or see that --chart and --reference are right"),
        ColourError::Patches(reason) => Failure::incomplete(format!("{}: {reason}", path.display())),
        other => other.into(),
    }
}

fn say_what_is_odd(measured: &[Measurement], reference: &Reference, talk: &Talk) {
    let without: Vec<&str> =
        measured.iter().map(|patch| patch.name.as_str()).filter(|name| reference.xyz(name).is_none()).collect();
    if !without.is_empty() {
        talk.say(format!("{} has no values for {}", reference.name(), without.join(", ")));
    }
    if let Some((name, chroma)) = reference.lightest().filter(|(_, chroma)| *chroma > 5.0) {
        talk.say(format!(
            "the lightest patch of {}, {name}, has C* = {chroma:.1}: if it should be white, the values are for another light \
             (--illuminant)",
            reference.name()
        ));
    }
}
