//! `relumine demo`: the whole job on the virtual rig, with nothing but this program.

mod page;
mod pictures;

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use relumine::rig::{Rig, Run, drivers, lay_out};
use relumine::{DevelopOptions, Development, Scene};

use crate::failure::Failure;
use crate::progress::Talk;

/// Do the whole job on a virtual rig: capture, field, relit pictures beside the truth
///
/// Builds a chess-like board of Relumine's own models, photographs it under a moving projector with noise, black level and
/// two exposures, develops the photographs into a reflectance field, relights it, and renders the same directly to compare.
/// DIR/index.html explains the pictures; everything that led to them lies beside it, to go on with. It takes about a minute
/// and 600 MB of disk. Interrupted, the same command goes on where it was; done, it says so and does nothing again.
#[derive(Args)]
pub(crate) struct Arguments {
    /// Where the pictures land
    #[arg(value_name = "DIR", default_value = "relumine-demo")]
    directory: PathBuf,
}

/// What is photographed, and how.
const RIG: [(&str, &str); 2] = [
    ("rig.toml", include_str!("../../examples/chess/rig.toml")),
    ("scene.toml", include_str!("../../examples/chess/scene.toml")),
];

/// What it is shown under.
const LIGHTS: [(&str, &str); 5] = [
    ("spots.toml", include_str!("../../examples/chess/spots.toml")),
    ("shafts.toml", include_str!("../../examples/chess/shafts.toml")),
    ("moved-1.toml", include_str!("../../examples/chess/moved-1.toml")),
    ("moved-2.toml", include_str!("../../examples/chess/moved-2.toml")),
    ("moved-3.toml", include_str!("../../examples/chess/moved-3.toml")),
];

/// The field, inside DIR.
const FIELD: &str = "chess.field";

pub(crate) fn run(arguments: &Arguments, talk: &Talk) -> Result<(), Failure> {
    let directory = &arguments.directory;
    let page = directory.join(page::NAME);
    if page.is_file() && directory.join(FIELD).is_dir() {
        talk.say(format!("already there: open {}", page.display()));
        return Ok(());
    }
    let began = Instant::now();
    prepare(directory)?;
    photograph(directory, talk)?;
    develop(directory, talk)?;
    let scene = Scene::read(&directory.join("scene.toml"))?;
    let figures = pictures::make(directory, &directory.join(FIELD), scene, talk)?;
    page::write(&page, &figures)?;
    talk.say(format!("done in {:.0} s: open {}", began.elapsed().as_secs_f64(), page.display()));
    Ok(())
}

/// Writes the descriptions that are not there yet; refuses a folder that holds anything else, such as a demonstration of
/// another version.
fn prepare(directory: &Path) -> Result<(), Failure> {
    let cannot = |path: &Path, error: std::io::Error| {
        Failure::failed(format!("cannot write {}: {error}", path.display())).with_hint("choose another folder")
    };
    fs::create_dir_all(directory).map_err(|error| cannot(directory, error))?;
    let begun =
        RIG.iter().all(|(name, text)| fs::read_to_string(directory.join(name)).is_ok_and(|found| found == *text));
    if !begun {
        for entry in fs::read_dir(directory).map_err(|error| cannot(directory, error))?.flatten() {
            let name = entry.file_name();
            if LIGHTS.iter().chain(&RIG).all(|(ours, _)| *ours != name) {
                let message = format!("{}: something else lies there: {}", directory.display(), name.to_string_lossy());
                return Err(Failure::failed(message).with_hint("choose another folder, or remove it"));
            }
        }
    }
    // Once begun, a light may have been changed since: it stays.
    for (name, text) in LIGHTS.iter().chain(&RIG) {
        let path = directory.join(name);
        if !(begun && path.exists()) {
            fs::write(&path, text).map_err(|error| cannot(&path, error))?;
        }
    }
    Ok(())
}

fn photograph(directory: &Path, talk: &Talk) -> Result<(), Failure> {
    let capture = directory.join("capture");
    if !capture.exists() {
        lay_out(&Rig::read(&directory.join("rig.toml"))?, &capture, false)?;
    }
    let rig = Rig::read(&capture.join("rig.toml"))?;
    let mut run = Run::open(&capture, drivers::open(&rig, &capture)?)?;
    let bar = talk.bar("photographs", run.total(), run.already_done());
    for taken in &mut run {
        taken?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    talk.say(format!("{} photographs in {}", run.total(), capture.display()));
    Ok(())
}

fn develop(directory: &Path, talk: &Talk) -> Result<(), Failure> {
    let field = directory.join(FIELD);
    if !field.exists() {
        let options = DevelopOptions { memory_bytes: 256 << 20, ..DevelopOptions::default() };
        let mut development = Development::start(&directory.join("capture"), &field, &options)?;
        let bar = talk.bar("positions", development.positions(), development.already_done().len());
        for position in &mut development {
            position?;
            bar.inc(1);
        }
        bar.finish_and_clear();
        development.finish()?;
    }
    talk.say(format!("the field in {}", field.display()));
    Ok(())
}
