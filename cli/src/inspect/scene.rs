//! Looking at virtual scenes and at descriptions of rigs.

use std::io::Write;
use std::path::Path;

use relumine::Scene;
use relumine::rig::Rig;

use crate::failure::{Failure, printed};
use crate::plan;

/// What a `.toml` says it is in its line `format`, up to the version; nothing if there is none.
pub(super) fn format_of(path: &Path) -> Result<String, Failure> {
    let text = std::fs::read_to_string(path)
        .map_err(|error| Failure::incomplete(format!("cannot read {}: {error}", path.display())))?;
    let line = text.lines().find_map(|line| line.trim().strip_prefix("format")?.trim().strip_prefix('='));
    Ok(line.and_then(|value| value.trim().trim_matches('"').split('/').next()).unwrap_or_default().into())
}

pub(super) fn inspect(path: &Path) -> Result<(), Failure> {
    let scene = Scene::read(path)?;
    let (width, height) = scene.picture_size();
    let mut out = std::io::stdout().lock();
    printed(writeln!(out, "scene          {} triangles and balls", scene.shapes()))?;
    printed(writeln!(out, "extent         within {:.3} m of the centre", scene.radius_m()))?;
    printed(writeln!(out, "camera         at {:.3} m, {width} × {height} pixels", scene.camera().position()))
}

pub(super) fn inspect_rig(path: &Path) -> Result<(), Failure> {
    plan::print(&Rig::read(path)?)
}
