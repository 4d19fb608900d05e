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

/// What lies in DIR before anything is photographed.
const FILES: [(&str, &str); 7] = [
    ("scene.toml", include_str!("../../examples/chess/scene.toml")),
    ("rig.toml", include_str!("../../examples/chess/rig.toml")),
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
    if page.is_file() && is_ours(directory) {
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

/// Whether every file of the demonstration is there as this version writes it.
fn is_ours(directory: &Path) -> bool {
    FILES.iter().all(|(name, text)| fs::read_to_string(directory.join(name)).is_ok_and(|found| found == *text))
}

/// Writes the descriptions; refuses a folder that holds anything else.
fn prepare(directory: &Path) -> Result<(), Failure> {
    let cannot = |path: &Path, error: std::io::Error| {
        Failure::failed(format!("cannot write {}: {error}", path.display())).with_hint("choose another folder")
    };
    let empty = match fs::read_dir(directory) {
        Ok(mut entries) => entries.next().is_none(),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => true,
        Err(error) => return Err(cannot(directory, error)),
    };
    // scene.toml is written last: with it there, all others are.
    if !empty && !is_ours(directory) && directory.join(FILES[0].0).exists() {
        let message =
            format!("{}: a demonstration of another version, or changed since, lies there", directory.display());
        return Err(Failure::failed(message).with_hint("choose another folder, or remove it"));
    }
    let foreign = |name: &str| FILES.iter().all(|(ours, _)| *ours != name);
    if !empty && !is_ours(directory) {
        let names = fs::read_dir(directory).map_err(|error| cannot(directory, error))?;
        if names.flatten().any(|entry| foreign(&entry.file_name().to_string_lossy())) {
            let message = format!("{}: something else lies there", directory.display());
            return Err(Failure::failed(message).with_hint("choose another folder"));
        }
    }
    fs::create_dir_all(directory).map_err(|error| cannot(directory, error))?;
    for (name, text) in FILES.iter().rev() {
        let path = directory.join(name);
        fs::write(&path, text).map_err(|error| cannot(&path, error))?;
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
