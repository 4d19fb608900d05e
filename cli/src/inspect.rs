//! `relumine inspect`: what it is, what is in it, whether it is whole.

mod against;
mod capture;
mod capture_json;
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
///
/// A capture is judged photograph by photograph: what is over- or under-exposed, a black frame that is too bright, photographs
/// that stand in each other's place, a pattern that was not shown, a camera that moved, a lamp that drifted. Each finding names
/// its photographs. Faults, after which a field would be wrong, make the exit code 3; warnings do not.
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
    /// Print JSON (of a capture; FORMAT.md describes it)
    #[arg(long, conflicts_with = "against")]
    json: bool,
    /// Of a capture: verify checksums only, without decoding and judging its photographs
    #[arg(long, conflicts_with = "against")]
    checksums_only: bool,
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
            if arguments.projection.are_given() {
                return Err(Failure::usage("how light is projected matters with --against FIELD only"));
            }
            return against::a_capture(path, reference);
        }
        return against::another_field(path, reference, &arguments.lights, &arguments.projection, talk);
    }
    if arguments.projection.are_given() {
        return Err(Failure::usage("how light is projected matters with --against FIELD only"));
    }
    if !path.exists() {
        return Err(Failure::failed(format!("{} is not there", path.display())));
    }
    if let Some(capture) = capture_of(path) {
        let look = capture::Look { json: arguments.json, checksums_only: arguments.checksums_only };
        return capture::inspect(capture, look, talk);
    }
    if arguments.json || arguments.checksums_only {
        let path = path.display();
        return Err(Failure::usage(format!("{path}: --json and --checksums-only are for captures, and this is none")));
    }
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
    if path.is_dir() {
        return if path.join("zarr.json").exists() {
            field::inspect(path)
        } else if path.join("journal").exists() {
            field::inspect_unfinished(path)
        } else {
            let path = path.display();
            Err(Failure::incomplete(format!("{path}: neither a capture (capture.toml) nor a field (zarr.json)")))
        };
    }
    match extension.as_deref() {
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

/// The capture that is meant by a path: the directory, or its capture.toml.
fn capture_of(path: &Path) -> Option<&Path> {
    if path.is_dir() {
        return is_capture(path).then_some(path);
    }
    let named = path.file_name().is_some_and(|name| name == "capture.toml") && path.exists();
    named.then(|| path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new(".")))
}
