//! `relumine render`: a virtual scene under a light, or its field.

use std::path::{Path, PathBuf};

use clap::Args;
use relumine::radiometry::files::{self, ExrSample};
use relumine::radiometry::{Encoded, Image};
use relumine::tracer::Rendered;
use relumine::{Capture, Encoding, Light, PathOptions, Rendering, Rig, Scene, SceneField};

use crate::failure::Failure;
use crate::output::{DisplayArguments, PictureFormat, refuse_existing, write_picture};
use crate::progress::Talk;

/// Render a virtual scene directly: the truth that relit pictures are held against
///
/// SCENE is a scene.toml (FORMAT.md) or a model (.gltf, .glb, .obj), which then stands by itself before a camera. Paths are
/// traced; the command says how uncertain the picture is. Lamps are no part of the scene: they hide and reflect nothing,
/// and the camera sees them only with --show-lamps. Smooth glass throws no caustics under lamps without extent.
///
/// With --transfer the scene's reflectance field is computed instead, without photographs and without noise of a camera: the
/// transfer of every cell in one pass.
#[derive(Args)]
pub(crate) struct Arguments {
    /// The scene
    scene: PathBuf,
    /// The light, a light.toml
    #[arg(long, value_name = "LIGHT", required_unless_present = "transfer")]
    light: Option<PathBuf>,
    /// Compute the field for the cells and the camera of this rig.toml or capture
    #[arg(long, value_name = "RIG", conflicts_with_all = ["light", "size", "error", "mask", "show_lamps"])]
    transfer: Option<PathBuf>,
    /// With --transfer: pack the field to this error, as `relumine pack --error` does, without an unpacked one in between
    #[arg(long, value_name = "E", value_parser = crate::pack::error, requires = "transfer")]
    pack: Option<f64>,
    /// The picture to write (.exr and .hdr hold radiance, .png and .tif what a display shows), or the field
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// Paths a pixel; four times as many halve the noise
    #[arg(long, default_value_t = 256, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    samples: u32,
    /// How often light is scattered on its way, at most; 1 is direct light only
    #[arg(long, default_value_t = 5, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1 << 10))]
    bounces: u32,
    /// Start of the random numbers: the same gives the same picture
    #[arg(long, default_value_t = PathOptions::default().seed, value_name = "N")]
    seed: u64,
    /// Pixels of the picture, if not those of the scene's camera: 640x480
    #[arg(long, value_name = "WIDTHxHEIGHT", value_parser = size)]
    size: Option<(usize, usize)>,
    /// Let the camera see lamps and sky themselves
    #[arg(long)]
    show_lamps: bool,
    /// Also write the standard error of each pixel, .exr
    #[arg(long, value_name = "OUT")]
    error: Option<PathBuf>,
    /// Also write where the scene is, .png: white where pixels show nothing else
    #[arg(long, value_name = "OUT")]
    mask: Option<PathBuf>,
    #[command(flatten)]
    display: DisplayArguments,
    /// Replace outputs that are there
    #[arg(long)]
    force: bool,
}

fn size(text: &str) -> Result<(usize, usize), String> {
    let side = |text: &str| text.parse::<usize>().ok().filter(|side| (1..=65_536).contains(side));
    let sides = text.split_once(['x', '×']).and_then(|(width, height)| Some((side(width)?, side(height)?)));
    sides
        .filter(|(width, height)| width * height <= files::MAX_PIXELS)
        .ok_or_else(|| "expected for example 640x480".into())
}

pub(crate) fn run(arguments: &Arguments, talk: &Talk) -> Result<(), Failure> {
    let options =
        PathOptions { samples: arguments.samples as usize, bounces: arguments.bounces as usize, seed: arguments.seed };
    refuse_existing(&arguments.output, arguments.force)?;
    match (&arguments.transfer, &arguments.light) {
        (Some(rig), _) => field(arguments, rig, options, talk),
        (None, Some(light)) => picture(arguments, light, options, talk),
        (None, None) => Err(Failure::usage("give --light or --transfer")),
    }
}

fn picture(arguments: &Arguments, light: &Path, options: PathOptions, talk: &Talk) -> Result<(), Failure> {
    PictureFormat::of(&arguments.output)?;
    for (extra, format) in [(&arguments.error, PictureFormat::Exr), (&arguments.mask, PictureFormat::Png)] {
        if let Some(path) = extra {
            if PictureFormat::of(path)? != format {
                return Err(Failure::usage(format!(
                    "{}: expected a name that ends in .{}",
                    path.display(),
                    format.extension()
                )));
            }
            refuse_existing(path, arguments.force)?;
        }
    }
    let mut scene = Scene::read(&arguments.scene)?;
    if let Some((width, height)) = arguments.size {
        scene = scene.with_picture_size(width, height);
    }
    let light = Light::read(light)?;
    let mut rendering = Rendering::new(&scene, &light, options, arguments.show_lamps)?;
    let bar = talk.bar("strips", rendering.steps(), 0);
    for () in &mut rendering {
        bar.inc(1);
    }
    bar.finish_and_clear();
    let rendered = rendering.finish();
    write_picture(&arguments.output, &rendered.picture, &arguments.display)?;
    if let Some(path) = &arguments.error {
        files::write_exr(path, &rendered.standard_error, ExrSample::Float, &[])?;
    }
    if let Some(path) = &arguments.mask {
        files::write_png8(path, &mask(&rendered))?;
    }
    talk.say(format!("standard error {:.2} % (relative L2)", 100.0 * relative_error(&rendered)));
    Ok(())
}

/// White where a pixel shows nothing but the scene.
fn mask(rendered: &Rendered) -> Image<Encoded> {
    let (width, height) = rendered.picture.size();
    let whole = |coverage: &f32| if *coverage >= 1.0 { [1.0; 3] } else { [0.0; 3] };
    Image::from_pixels(width, height, rendered.coverage.iter().map(whole).collect())
}

fn relative_error(rendered: &Rendered) -> f64 {
    let energy = |samples: &[[f32; 3]]| samples.as_flattened().iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
    let all = energy(rendered.picture.pixels());
    if all > 0.0 { (energy(rendered.standard_error.pixels()) / all).sqrt() } else { 0.0 }
}

fn field(arguments: &Arguments, rig: &Path, options: PathOptions, talk: &Talk) -> Result<(), Failure> {
    let (capture, description);
    let setup = if rig.is_dir() {
        capture = Capture::open(rig)?;
        capture.setup()
    } else {
        description = Rig::read(rig)?;
        description.setup()
    };
    let (width, height) = setup.picture_size();
    let scene = Scene::read(&arguments.scene)?.with_picture_size(width, height);
    // The scene by its description: what has changed is computed anew.
    let text = std::fs::read(&arguments.scene)
        .map_err(|error| Failure::failed(format!("cannot read {}: {error}", arguments.scene.display())))?;
    let input = format!("{options:?} {text:?}");
    let shapes = scene.shapes();
    let encoding = arguments.pack.map_or(Encoding::Lossless, Encoding::Packed);
    let (output, force) = (&arguments.output, arguments.force);
    let mut field = SceneField::start(scene, setup.cells(), output, options, encoding, &input, force)?;
    let bar = talk.bar("steps", field.steps(), 0);
    let started = std::time::Instant::now();
    for step in &mut field {
        step?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    let connections = field.connections() as f64;
    field.finish()?;
    talk.say(format!(
        "{:.1} million connections to {shapes} shapes, {:.1} million a second",
        connections / 1e6,
        connections / 1e6 / started.elapsed().as_secs_f64()
    ));
    Ok(())
}
