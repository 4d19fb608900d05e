//! `relumine inspect`: what it is, what is in it, whether it is whole.

mod against;
mod capture;
mod field;
mod picture;
mod scene;

use std::path::{Path, PathBuf};

use clap::Args;

use crate::failure::Failure;
use crate::light::is_capture;
use crate::progress::Talk;
use crate::projection::ProjectionArguments;

/// Say what something is, what is in it, and whether it is whole
///
/// PATH is a capture, a field (finished or not), the description of a light, a rig or a scene, a model, a list of lamps or a
/// picture. Checksums are verified; the exit code is 3 if anything is damaged or missing.
#[derive(Args)]
pub(crate) struct Arguments {
    /// What to look at
    path: PathBuf,
    /// Hold a field against another one: how pictures relit from them differ, under lights drawn at random, always the same;
    /// or against a capture: how it relights what some photographs show
    #[arg(long, value_name = "CAPTURE_OR_FIELD")]
    against: Option<PathBuf>,
    /// With --against: a further light to compare under; may be given several times
    #[arg(long = "light", value_name = "LIGHT", requires = "against")]
    lights: Vec<PathBuf>,
    #[command(flatten)]
    projection: ProjectionArguments,
}

pub(crate) fn run(arguments: &Arguments, talk: &Talk) -> Result<(), Failure> {
    let path = &arguments.path;
    if let Some(reference) = &arguments.against {
        if is_capture(reference) {
            if !arguments.lights.is_empty() {
                let reason = "--light goes with --against FIELD: a capture has its own lights, the patterns";
                return Err(Failure::usage(reason));
            }
            return against::a_capture(path, reference);
        }
        return against::another_field(path, reference, &arguments.lights, &arguments.projection, talk);
    }
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
    if !path.exists() {
        return Err(Failure::failed(format!("{} is not there", path.display())));
    }
    if path.is_dir() {
        return if is_capture(path) {
            capture::inspect(path)
        } else if path.join("zarr.json").exists() {
            field::inspect(path)
        } else if path.join("journal").exists() {
            field::inspect_unfinished(path)
        } else {
            let path = path.display();
            Err(Failure::incomplete(format!("{path}: neither a capture (capture.toml) nor a field (zarr.json)")))
        };
    }
    match extension.as_deref() {
        Some("toml") if path.file_name().is_some_and(|name| name == "capture.toml") => {
            capture::inspect(path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new(".")))
        }
        Some("toml") => match scene::format_of(path)?.as_str() {
            "relumine-scene" => scene::inspect(path),
            "relumine-rig" => scene::inspect_rig(path),
            _ => picture::inspect_light(path),
        },
        Some("gltf" | "glb" | "obj") => scene::inspect(path),
        Some("lp" | "csv") => picture::inspect_lamps(path),
        _ => picture::inspect(path),
    }
}
