//! `relumine merge`: exposures → one radiance picture.

use std::path::{Path, PathBuf};

use clap::Args;
use relumine::radiometry::files::{self, ExrSample};
use relumine::radiometry::{Counts, Image, Linear, Merged, NoiseModel, Visibility};
use relumine::{Bracket, BracketResponse, ExposureList, Levels, MergedBracket};

use crate::failure::Failure;
use crate::output::{PictureFormat, refuse_existing};
use crate::progress::Talk;
use crate::response;

/// Merge photographs of one view at several exposures into one radiance picture
///
/// PICTURES are JPEG, TIFF, PNG or camera RAW with their exposures in EXIF; or --list names them. Radiance is in the unit of
/// 1/exposure: seconds, or seconds · iso/100 / f² where every photograph says its sensitivity and aperture. Weights are those
/// of photon noise, read noise, rounding and of what the photographs are found to differ by; clipped pixels never enter.
#[derive(Args)]
pub(crate) struct Arguments {
    /// Photographs with their exposures in EXIF
    #[arg(required_unless_present = "list", conflicts_with = "list")]
    pictures: Vec<PathBuf>,
    /// The radiance picture to write, .exr or .hdr
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// A text file with `name seconds` of a photograph a line; names relative to it, # begins a comment
    #[arg(long, value_name = "LIST")]
    list: Option<PathBuf>,
    /// The list has 1/seconds
    #[arg(long, requires = "list")]
    reciprocal: bool,
    /// How counts follow exposure: `recover` from the photographs themselves, `srgb`, `linear`, or a response file [default:
    /// linear for camera RAW, else recover]
    #[arg(long, value_name = "recover|srgb|linear|FILE")]
    response: Option<String>,
    /// Counts without light [default: what a camera RAW says, else 0]
    #[arg(long, value_name = "COUNTS")]
    black_level: Option<u16>,
    /// Counts at which a pixel is clipped [default: what a camera RAW says, else 255 or 65535]
    #[arg(long, value_name = "COUNTS")]
    white_level: Option<u16>,
    /// Multiply red and blue with what a camera RAW says would make grey grey
    #[arg(long)]
    camera_white_balance: bool,
    /// Measure the ratios of the exposures in the photographs, since 1/60 s may be 1/64 s
    #[arg(long)]
    refine_exposures: bool,
    /// Electrons of a pixel at the white level, for weights and variance
    #[arg(long, default_value_t = NoiseModel::default().full_well_electrons, value_name = "E")]
    full_well: f64,
    /// Standard deviation of a pixel without light, electrons
    #[arg(long, default_value_t = NoiseModel::default().read_noise_electrons, value_name = "E")]
    read_noise: f64,
    /// Write the variance of every sample (radiance²); where clipped in every exposure, the largest float
    #[arg(long, value_name = "OUT.exr")]
    variance: Option<PathBuf>,
    /// Write what was seen: white; dark grey where black in every exposure, black where clipped in every exposure
    #[arg(long, value_name = "OUT.png")]
    mask: Option<PathBuf>,
    /// Replace outputs that are there
    #[arg(long)]
    force: bool,
}

pub(crate) fn run(arguments: &Arguments, talk: &Talk) -> Result<(), Failure> {
    check_outputs(arguments)?;
    let noise = noise(arguments)?;
    let levels = Levels { black: arguments.black_level, white: arguments.white_level };
    let bracket = match &arguments.list {
        Some(list) => Bracket::read_list(&ExposureList::read(list, arguments.reciprocal)?, levels)?,
        None => Bracket::read(&arguments.pictures, levels)?,
    };
    let response = response_of(arguments.response.as_deref(), &bracket)?;
    let balance = balance(arguments, &bracket)?;
    let mut result = bracket.merge(&response, noise, arguments.refine_exposures)?;
    apply(balance, &mut result.merged);
    say(&bracket, &result, talk);
    write(arguments, &result.merged)?;
    let unseen = result.merged.visibility.iter().all(|visibility| *visibility != Visibility::Seen);
    if unseen {
        return Err(Failure::incomplete(format!(
            "{}: no exposure saw anything: every pixel is black or clipped in all of them",
            bracket.photographs[0].file.display()
        ))
        .with_hint("give longer or shorter exposures, or set --black-level and --white-level to those of the camera"));
    }
    Ok(())
}

fn check_outputs(arguments: &Arguments) -> Result<(), Failure> {
    let expected = |path: &Path, formats: &[PictureFormat], words: &str| {
        if formats.contains(&PictureFormat::of(path)?) {
            return refuse_existing(path, arguments.force);
        }
        Err(Failure::usage(format!("{}: expected a name that ends in {words}", path.display())))
    };
    expected(&arguments.output, &[PictureFormat::Exr, PictureFormat::Hdr], ".exr or .hdr")?;
    if let Some(path) = &arguments.variance {
        expected(path, &[PictureFormat::Exr], ".exr")?;
    }
    if let Some(path) = &arguments.mask {
        expected(path, &[PictureFormat::Png], ".png")?;
    }
    let outputs: Vec<_> =
        [Some(&arguments.output), arguments.variance.as_ref(), arguments.mask.as_ref()].into_iter().flatten().collect();
    match outputs.iter().enumerate().find(|(index, path)| outputs[..*index].contains(path)) {
        Some((_, twice)) => Err(Failure::usage(format!("{} is to be written twice", twice.display()))),
        None => Ok(()),
    }
}

fn noise(arguments: &Arguments) -> Result<NoiseModel, Failure> {
    let (full_well_electrons, read_noise_electrons) = (arguments.full_well, arguments.read_noise);
    if !(1.0..=1e9).contains(&full_well_electrons) {
        return Err(Failure::usage(format!("--full-well must be 1 to 1e9 electrons, but is {full_well_electrons}")));
    }
    if !(0.0..=full_well_electrons).contains(&read_noise_electrons) {
        return Err(Failure::usage(format!(
            "--read-noise must be 0 to {full_well_electrons} electrons, but is {read_noise_electrons}"
        )));
    }
    Ok(NoiseModel { full_well_electrons, read_noise_electrons })
}

fn response_of(name: Option<&str>, bracket: &Bracket) -> Result<BracketResponse, Failure> {
    let unsaid = if bracket.is_raw { "linear" } else { "recover" };
    Ok(match name.unwrap_or(unsaid) {
        "recover" => BracketResponse::Recover,
        name => BracketResponse::Known(response::named(name)?),
    })
}

fn balance(arguments: &Arguments, bracket: &Bracket) -> Result<Option<[f32; 3]>, Failure> {
    match (arguments.camera_white_balance, bracket.white_balance) {
        (false, _) => Ok(None),
        (true, Some(factors)) => Ok(Some(factors.map(|factor| factor as f32))),
        (true, None) => Err(Failure::failed(format!(
            "{}: a camera RAW that says its white balance was expected",
            bracket.photographs[0].file.display()
        ))
        .with_hint("leave out --camera-white-balance")),
    }
}

fn apply(balance: Option<[f32; 3]>, merged: &mut Merged) {
    let Some(factors) = balance else { return };
    for pixel in merged.radiance.pixels_mut() {
        (0..3).for_each(|channel| pixel[channel] *= factors[channel]);
    }
    for pixel in &mut merged.variance {
        (0..3).for_each(|channel| pixel[channel] *= factors[channel] * factors[channel]);
    }
}

fn say(bracket: &Bracket, result: &MergedBracket, talk: &Talk) {
    if let Some(recovered) = &result.recovered {
        let rms = recovered.report.map(|channel| format!("{:.2} %", 100.0 * channel.rms_log_exposure)).join(", ");
        talk.say(format!("response recovered; the photographs agree with it within {rms} (red, green, blue; rms)"));
    }
    for (index, photograph) in bracket.photographs.iter().enumerate() {
        let refined = match &result.refined {
            Some(refined) => format!(", measured {:.6}", refined.exposures[index]),
            None => String::new(),
        };
        let (file, used) = (photograph.file.display(), 100.0 * result.merged.used[index]);
        talk.say(format!("{file}: exposure {:.6}{refined}, {used:.1} % of it used", photograph.exposure));
    }
    let middle = result.disagreement.at_middle().map(|share| format!("{:.1} %", 100.0 * share)).join(", ");
    talk.say(format!("single photographs are off from all by {middle} at middle codes (red, green, blue; typically)"));
    for ratio in result.refined.iter().flat_map(|refined| &refined.ratios).filter(|ratio| ratio.samples == 0) {
        talk.say(format!("a ratio of exposures of {:.4} could not be measured and stays", ratio.nominal));
    }
    let share = |kind| {
        let count = result.merged.visibility.iter().filter(|visibility| **visibility == kind).count();
        100.0 * count as f64 / result.merged.visibility.len().max(1) as f64
    };
    let (seen, clipped, black) = (share(Visibility::Seen), share(Visibility::Clipped), share(Visibility::Black));
    talk.say(format!(
        "{seen:.2} % of the pixels seen, {clipped:.2} % clipped in every exposure, {black:.2} % black in every exposure"
    ));
}

fn write(arguments: &Arguments, merged: &Merged) -> Result<(), Failure> {
    let (width, height) = merged.radiance.size();
    match PictureFormat::of(&arguments.output)? {
        PictureFormat::Exr => files::write_exr(&arguments.output, &merged.radiance, ExrSample::Float, &[])?,
        _ => files::write_hdr(&arguments.output, &merged.radiance)?,
    }
    if let Some(path) = &arguments.variance {
        let pixels = merged.variance.iter().map(|pixel| pixel.map(|variance| variance.min(f32::MAX))).collect();
        files::write_exr(path, &Image::<Linear>::from_pixels(width, height, pixels), ExrSample::Float, &[])?;
    }
    if let Some(path) = &arguments.mask {
        let code = |visibility: &Visibility| match visibility {
            Visibility::Seen => [255; 3],
            Visibility::Black => [64; 3],
            Visibility::Clipped => [0; 3],
        };
        let pixels = merged.visibility.iter().map(code).collect();
        files::write_png_counts(path, &Image::<Counts>::from_pixels(width, height, pixels), 8)?;
    }
    Ok(())
}
