//! A packed field of a scene, streamed, and how near it is to what was packed.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::Instant;

use relumine::radiometry::files::{ExrSample, write_exr};
use relumine::radiometry::{Image, Radiance, difference};
use relumine::rig::Plan;
use relumine::{Coefficients, Encoding, PathOptions, ReflectanceField, Relighting, Rig, Scene, SceneField, kept};
use serde_json::{Value, json};

use crate::Failure;
use crate::lights::{self, Named};
use crate::measure::{bytes_in, memory_mb, rounded};
use crate::words::Words;

pub(crate) fn run(words: &Words) -> Result<Value, Failure> {
    let [scene_path, rig_path, field_path] = words.paths()?;
    let error = words.option("--error")?.unwrap_or(0.01);
    if !Encoding::ERRORS.contains(&error) {
        return Err(format!("--error: expected {:?}, found {error}", Encoding::ERRORS).into());
    }
    let options = PathOptions {
        samples: words.option("--samples")?.unwrap_or(16),
        bounces: words.option("--bounces")?.unwrap_or(2),
        seed: words.option("--seed")?.unwrap_or(PathOptions::default().seed),
    };
    let beside = |ending: &str| {
        let mut name: OsString = field_path.file_stem().unwrap_or_default().into();
        name.push(ending);
        field_path.with_file_name(name)
    };
    let pictures: PathBuf = words.option("--pictures")?.unwrap_or_else(|| beside(".witnessed"));
    let mut partial = field_path.as_os_str().to_owned();
    partial.push(".partial");
    for path in [field_path, Path::new(&partial)] {
        // What an earlier run has packed, nobody would be witness to.
        if path.exists() {
            return Err(format!("{} is there: remove it, or choose another name", path.display()).into());
        }
    }

    let rig = Rig::read(rig_path)?;
    let (width, height) = match words.option::<String>("--size")? {
        Some(size) => sides(&size).ok_or("--size: expected for example 640x480")?,
        None => rig.setup().picture_size(),
    };
    let scene = Scene::read(scene_path)?.with_picture_size(width, height);
    let shapes = scene.shapes();
    let cells = rig.setup().cells();
    let lights = lights::read(&words.lights, cells)?;
    let coefficients: Vec<Coefficients> = lights.iter().map(|light| light.coefficients.clone()).collect();
    let input = format!("paper_scale {options:?} {}", std::fs::read_to_string(scene_path)?);

    let started = Instant::now();
    let mut field = SceneField::start(scene, cells, field_path, options, Encoding::Packed(error), &input, false)?
        .witnessed_by(&coefficients);
    let steps = field.steps();
    for done in 1..=steps {
        field.next().ok_or("steps are missing")??;
        if done * 20 / steps > (done - 1) * 20 / steps {
            eprintln!("{done} of {steps} steps, {:.0} s", started.elapsed().as_secs_f64());
        }
    }
    let (connections, witnessed) = (field.connections(), field.witnessed());
    field.finish()?;
    let seconds = started.elapsed().as_secs_f64();
    let peak_mb = memory_mb("VmHWM");

    std::fs::create_dir_all(&pictures)?;
    for (light, picture) in lights.iter().zip(&witnessed) {
        write_exr(&pictures.join(format!("{}.exr", light.name)), picture, ExrSample::Float, &[])?;
    }
    let started = Instant::now();
    let field = ReflectanceField::open(field_path)?;
    let relit = Relighting::new(&field, &coefficients)?.run()?;
    let relighting_seconds = started.elapsed().as_secs_f64();

    let pixels = (width * height) as f64;
    let bytes = bytes_in(field_path)?;
    let each = pixels * cells.positions() as f64;
    let kept = kept(&field);
    let share = |part: f64| rounded(part / kept.whole);
    let ranks: Vec<usize> = field.block_records().iter().map(|block| block.rank).collect();
    Ok(json!({
        "picture": [width, height],
        "positions": cells.positions(),
        "squares": cells.squares(),
        "cells": cells.len(),
        "shapes": shapes,
        "samples": options.samples,
        "bounces": options.bounces,
        "error": error,
        "threads": rayon::current_num_threads(),
        "seconds": rounded(seconds),
        "connections": connections,
        "connections_per_s": (connections as f64 / seconds).round(),
        "cells_times_pixels_per_s": (cells.len() as f64 * pixels / seconds).round(),
        "photographs_per_position": Plan::of(&rig).per_position(),
        "photographs_equivalent_per_s": rounded(Plan::of(&rig).len() as f64 / seconds),
        "bytes": bytes,
        "bytes_per_pixel_and_position": rounded(bytes as f64 / each),
        "largest_rank": ranks.iter().max(),
        "light_in_squares": share(kept.squares),
        "light_in_coarse_squares": share(kept.coarse),
        "peak_rss_mb": peak_mb,
        "relighting_from_disk_s": rounded(relighting_seconds),
        "against_unpacked": compared(&lights, &relit, &witnessed),
    }))
}

fn sides(text: &str) -> Option<(usize, usize)> {
    let (width, height) = text.split_once('x')?;
    let side = |text: &str| text.parse().ok().filter(|side| (1..=16_384).contains(side));
    Some((side(width)?, side(height)?))
}

/// How far pictures relit from the field are from what its light shows unpacked; `null` where that is nothing.
fn compared(lights: &[Named], relit: &[Image<Radiance>], witnessed: &[Image<Radiance>]) -> Value {
    let differences: Vec<_> =
        relit.iter().zip(witnessed).map(|(relit, seen)| difference(relit, seen, None, false)).collect();
    let of_light = |(light, difference): (&Named, &Option<relumine::radiometry::Difference>)| {
        let figures = difference
            .map(|found| json!({ "relative_l2": rounded(found.relative_l2), "ratio_of_means": found.ratio_of_means }));
        (light.name.clone(), json!(figures))
    };
    let worst = differences.iter().flatten().map(|found| found.relative_l2).fold(0.0, f64::max);
    let each: serde_json::Map<String, Value> = lights.iter().zip(&differences).map(of_light).collect();
    json!({ "lights": each, "worst_relative_l2": rounded(worst) })
}
