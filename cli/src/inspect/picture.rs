//! Looking at pictures, lights and lists of lamps.

use std::io::Write;
use std::path::Path;

use relumine::radiometry::files::{self, Picture};
use relumine::{LampList, Light, LightKind, picture_kind};

use crate::failure::{Failure, printed};

pub(super) fn inspect(path: &Path) -> Result<(), Failure> {
    let picture = files::read_picture(path)?;
    let mut out = std::io::stdout().lock();
    let marked = picture_kind(path)? == Some(LightKind::Mosaic);
    let what = if marked { "mosaic (coefficients), " } else { "" };
    printed(writeln!(out, "picture        {what}{}", picture.describe()))?;
    let pixels: Vec<[f32; 3]> = match &picture {
        Picture::Integer { image, .. } => image.pixels().iter().map(|pixel| pixel.map(f32::from)).collect(),
        Picture::Float(image) => image.pixels().to_vec(),
    };
    for (channel, name) in ["red", "green", "blue"].into_iter().enumerate() {
        let samples = || pixels.iter().map(|pixel| pixel[channel]);
        let (low, high) = samples().fold((f32::MAX, f32::MIN), |(low, high), s| (low.min(s), high.max(s)));
        let mean = samples().map(f64::from).sum::<f64>() / pixels.len() as f64;
        printed(writeln!(out, "{name:<14} {low} to {high}, mean {mean:.6}"))?;
    }
    Ok(())
}

pub(super) fn inspect_light(path: &Path) -> Result<(), Failure> {
    let light = Light::read(path)?;
    let mut out = std::io::stdout().lock();
    printed(writeln!(out, "light          {} lamps", light.lamps.len()))?;
    for lamp in &light.lamps {
        let words = format!("{lamp:?}");
        let name = words.split([' ', '(', '{']).next().unwrap_or_default().to_lowercase();
        printed(writeln!(out, "lamp           {name}"))?;
    }
    if light.environment.is_some() {
        printed(writeln!(out, "environment    yes"))?;
    }
    if let Some(mosaic) = &light.mosaic {
        let (width, height) = mosaic.pixels.size();
        printed(writeln!(out, "mosaic         {} ({width} × {height})", mosaic.path.display()))?;
    }
    if !light.placement.is_identity() {
        let (move_by, turn) = (light.placement.translation, light.placement.rotation.to_degrees());
        printed(writeln!(out, "placement      moved by {move_by} m, turned by {turn}°"))?;
    }
    Ok(())
}

pub(super) fn inspect_lamps(path: &Path) -> Result<(), Failure> {
    let list = LampList::read(path)?;
    let mut out = std::io::stdout().lock();
    printed(writeln!(out, "lamps          {}", list.lamps.len()))?;
    for remark in &list.remarks {
        printed(writeln!(out, "remark         {remark}"))?;
    }
    let gone: Vec<_> = list.lamps.iter().filter(|lamp| !lamp.file.exists()).collect();
    for lamp in &gone {
        printed(writeln!(out, "missing        {}", lamp.file.display()))?;
    }
    if gone.is_empty() {
        return printed(writeln!(out, "whole          yes: every photograph is there"));
    }
    Err(Failure::incomplete(format!("{}: {} photographs are missing", path.display(), gone.len())))
}
