//! How small the paper's own storage makes a field: a noise filter, run lengths, and Huffman's code.
//!
//! ```text
//! rle_huffman FIELD --light LIGHT… [--thresholds A,B,…] [--error E,…] [--codings NAME,…] [--check]
//! ```
//!
//! *Relighting with 4D Incident Light Fields* (Masselus, Peers, Dutré, Willems, SIGGRAPH 2003) stores its basis images after a
//! noise filter that sets what is dark to zero, run-length encoded, and Huffman coded on top of that. This is the baseline that
//! another encoding of a field is held against. It reads a lossless field, writes no file, and prints JSON.
//!
//! * **Noise filter.** What is below a threshold becomes zero. Thresholds are relative to one number of the field, its
//!   `reference`: the root mean square, over positions, pixels and channels, of what unit radiance through all squares of a
//!   position shows.
//! * **Eight bits.** The paper does not say how high dynamic range becomes bytes. Several ways are tried ([`Coding`]): RGBE, and
//!   square roots with a scale a picture and 255 levels or fewer. The baseline's size at an error is that of the best of them.
//! * **Run lengths.** Plane by plane in scan order: runs of zeros, of another byte, and literals. A dark basis image is one byte.
//! * **Huffman.** One canonical code of bytes for the field or one a position, whichever is smaller, with the table. Bits are
//!   counted; `--check` also writes and reads them back for what was found with `--error`.
//!
//! Not counted, in favour of the baseline: file headers, and an index to find positions or squares by. `errors` are relative L2
//! differences of the picture relit with the coded field against the one relit with the field as it is, for each light; `null` is
//! a light that shows nothing.
//!
//! `--thresholds` measures every coding at these; `--error` looks for the largest threshold at which every light is within E, to
//! [`STEP`], starting from these thresholds or from a ladder of its own. Lights that hardly touch the picture have large errors:
//! which lights count is for `--light` to say.

#[path = "rle_huffman/coding.rs"]
mod coding;
#[path = "rle_huffman/huffman.rs"]
mod huffman;
#[path = "rle_huffman/passes.rs"]
mod passes;

use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Instant;

use relumine::{Coefficients, ProjectionOptions, ReflectanceField, project, read_light};
use serde_json::{Value, json};

use coding::Coding;
use passes::{Measured, Truth, check, measure};

/// The ratio to which a threshold is found.
const STEP: f64 = 1.03;

/// Thresholds that are tried at once between two.
const BETWEEN: i32 = 5;

const USAGE: &str =
    "usage: rle_huffman FIELD --light LIGHT… [--thresholds A,B,…] [--error E,…] [--codings NAME,…] [--check]";

struct Arguments {
    field: PathBuf,
    lights: Vec<PathBuf>,
    thresholds: Vec<f64>,
    errors: Vec<f64>,
    codings: Vec<Coding>,
    check: bool,
}

impl Arguments {
    fn parse(arguments: impl Iterator<Item = String>) -> Result<Self, Box<dyn Error>> {
        let mut parsed = Self {
            field: PathBuf::new(),
            lights: Vec::new(),
            thresholds: Vec::new(),
            errors: Vec::new(),
            codings: Coding::ALL.to_vec(),
            check: false,
        };
        let mut fields = Vec::new();
        let mut arguments = arguments.peekable();
        while let Some(argument) = arguments.next() {
            let mut value = || arguments.next().ok_or(USAGE);
            match argument.as_str() {
                "--thresholds" => parsed.thresholds = positive_numbers(&value()?)?,
                "--error" => parsed.errors = positive_numbers(&value()?)?,
                "--codings" => parsed.codings = value()?.split(',').map(str::parse).collect::<Result<_, _>>()?,
                "--check" => parsed.check = true,
                "--light" => {
                    parsed.lights.push(value()?.into());
                    while let Some(light) = arguments.next_if(|argument| !argument.starts_with("--")) {
                        parsed.lights.push(light.into());
                    }
                }
                _ if argument.starts_with("--") => return Err(USAGE.into()),
                _ => fields.push(argument),
            }
        }
        let [field] = fields.as_slice() else { return Err(USAGE.into()) };
        parsed.field = field.into();
        if parsed.lights.is_empty() || (parsed.thresholds.is_empty() && parsed.errors.is_empty()) {
            return Err(USAGE.into());
        }
        parsed.thresholds.sort_by(f64::total_cmp);
        Ok(parsed)
    }
}

fn positive_numbers(text: &str) -> Result<Vec<f64>, Box<dyn Error>> {
    let number = |text: &str| match text.parse::<f64>() {
        Ok(number) if number > 0.0 && number.is_finite() => Ok(number),
        _ => Err(format!("\"{text}\" is not a positive number").into()),
    };
    text.split(',').map(number).collect()
}

fn main() -> Result<(), Box<dyn Error>> {
    let started = Instant::now();
    let arguments = Arguments::parse(std::env::args().skip(1))?;
    let field = ReflectanceField::open(&arguments.field)?;
    if field.is_packed() {
        return Err("the field is packed: a baseline begins with a lossless one".into());
    }
    let lights: Vec<Coefficients> =
        arguments.lights.iter().map(|path| coefficients(path, &field)).collect::<Result<_, _>>()?;
    let truth = Truth::of(&field, &lights)?;
    let names: Vec<String> = arguments.lights.iter().map(|path| name(path)).collect();
    let report = |measured: &Measured| describe(measured, &field, &names);

    let ladder = match arguments.thresholds.as_slice() {
        [] => (0..9).map(|step| 4e-6 * 4f64.powi(step)).collect(),
        thresholds => thresholds.to_vec(),
    };
    let everywhere = |coding: &Coding| ladder.iter().map(move |threshold| (*coding, *threshold)).collect::<Vec<_>>();
    let asked: Vec<(Coding, f64)> = arguments.codings.iter().flat_map(everywhere).collect();
    let mut measured = measure(&field, &lights, &truth, &asked)?;
    let at_thresholds: Vec<Value> =
        if arguments.thresholds.is_empty() { Vec::new() } else { measured.iter().map(report).collect() };

    let searches: Vec<(Coding, f64)> =
        arguments.errors.iter().flat_map(|error| arguments.codings.iter().map(|coding| (*coding, *error))).collect();
    loop {
        let mut asked: Vec<(Coding, f64)> = Vec::new();
        for (coding, error) in &searches {
            let more = closer(&measured, *coding, *error);
            asked.extend(more.into_iter().map(|threshold| (*coding, threshold)));
        }
        if asked.is_empty() {
            break;
        }
        measured.extend(measure(&field, &lights, &truth, &asked)?);
    }

    let mut within = Vec::new();
    for error in &arguments.errors {
        let found: Vec<&Measured> =
            arguments.codings.iter().filter_map(|coding| largest_within(&measured, *coding, *error)).collect();
        let best = found.iter().min_by_key(|measured| measured.huffman_bytes());
        let checked = match best {
            Some(best) if arguments.check => Some(check(&field, &truth, best)?),
            _ => None,
        };
        if checked == Some(false) {
            return Err(format!("the bytes counted for an error of {error} are not those written").into());
        }
        within.push(json!({
            "error": error,
            "best": best.map(|measured| report(measured)),
            "checked": checked.is_some(),
            "codings": found.iter().map(|measured| report(measured)).collect::<Vec<_>>(),
        }));
    }
    let (width, height) = field.picture_size();
    let output = json!({
        "picture": [width, height],
        "positions": field.cells().positions(),
        "cells": field.cells().len(),
        "reference": truth.reference,
        "at_thresholds": at_thresholds,
        "within": within,
        "threads": rayon::current_num_threads(),
        "seconds": started.elapsed().as_secs_f64(),
    });
    println!("{}", serde_json::to_string_pretty(&output)?);
    Ok(())
}

fn coefficients(path: &Path, field: &ReflectanceField) -> Result<Coefficients, Box<dyn Error>> {
    let (light, _) = read_light(path, field.cells(), None)?;
    Ok(project(&light, field.cells(), &ProjectionOptions::default())?.coefficients)
}

fn name(path: &Path) -> String {
    path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

/// What was measured of a coding with the largest threshold that is within the error.
fn largest_within(measured: &[Measured], coding: Coding, error: f64) -> Option<&Measured> {
    let within = measured.iter().filter(|measured| measured.coding == coding && measured.is_within(error));
    within.max_by(|a, b| a.threshold.total_cmp(&b.threshold))
}

/// Thresholds to try between the largest within the error and the next; none if these are near enough, or there are no two.
fn closer(measured: &[Measured], coding: Coding, error: f64) -> Vec<f64> {
    let Some(within) = largest_within(measured, coding, error) else { return Vec::new() };
    let above = measured.iter().filter(|other| other.coding == coding && other.threshold > within.threshold);
    let Some(next) = above.map(|other| other.threshold).min_by(f64::total_cmp) else { return Vec::new() };
    let ratio = next / within.threshold;
    if ratio <= STEP {
        return Vec::new();
    }
    // No more than are needed.
    let between = BETWEEN.min((ratio.ln() / STEP.ln()).ceil() as i32 - 1).max(1);
    (1..=between).map(|step| within.threshold * ratio.powf(f64::from(step) / f64::from(between + 1))).collect()
}

fn describe(measured: &Measured, field: &ReflectanceField, lights: &[String]) -> Value {
    let (width, height) = field.picture_size();
    let pixels = (width * height) as f64;
    let each = |bytes: u64| bytes as f64 / pixels / field.cells().positions() as f64;
    let errors: serde_json::Map<String, Value> =
        lights.iter().cloned().zip(measured.errors.iter().map(|error| json!(error))).collect();
    json!({
        "coding": measured.coding.to_string(),
        "threshold": measured.threshold,
        "rle_bytes": measured.rle_bytes,
        "rle_huffman_bytes": measured.huffman_bytes(),
        "rle_bytes_per_pixel_and_position": each(measured.rle_bytes),
        "rle_huffman_bytes_per_pixel_and_position": each(measured.huffman_bytes()),
        "huffman_tables": if measured.huffman_field_bytes <= measured.huffman_position_bytes { "field" } else { "position" },
        "lit_pictures": measured.lit_pictures,
        "lit_share": measured.lit_samples as f64 / (3.0 * pixels * field.cells().len() as f64),
        "errors": errors,
        "largest_error": measured.worst_light().map(|light| &lights[light]),
    })
}
