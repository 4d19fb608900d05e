//! Fields of the paper's size from the virtual rig, and what it takes to relight them. Each command prints JSON.
//!
//! ```text
//! paper_scale generate SCENE RIG FIELD --light LIGHT… [--error E] [--samples N] [--bounces B] [--seed S] [--size WIDTHxHEIGHT]
//!                      [--pictures FOLDER]
//! paper_scale time FIELD --light LIGHT… [--repeat N] [--brief]
//! paper_scale disk FIELD --light LIGHT [--repeat N]
//! paper_scale dense FIELD FOLDER --light LIGHT…
//! ```
//!
//! * `generate` computes a packed field of a scene on the cells of a rig, and sums beside it, from transfers as they are before
//!   they are packed, what each light shows (EXR pictures in FOLDER). Then it relights the field from disk and compares.
//! * `time` holds a field in memory and times lights that change in many and in few places, a spot that moves, and how the time
//!   grows with pixels and lit cells; beside each, in turn with it, a plain read of as many bytes as the sum may touch.
//! * `disk` relights a field from disk, once and then again: what the first time costs is for the caller to prepare.
//! * `dense` writes every Rᵢ of a small field as `basis.npy`, float32 `[channel, cell, pixel]`, the lights as `lights.npy`,
//!   `[light, channel, cell]`, and their pictures as `pictures.npy`, `[light, channel, pixel]`, for another program to sum.
//!
//! `benches/paper_scale.py` runs all of them and writes a dated run file. Times are wall-clock; compare them within one run only.

#[path = "paper_scale/dense.rs"]
mod dense;
#[path = "paper_scale/disk.rs"]
mod disk;
#[path = "paper_scale/generate.rs"]
mod generate;
#[path = "paper_scale/lights.rs"]
mod lights;
#[path = "paper_scale/linear.rs"]
mod linear;
#[path = "paper_scale/measure.rs"]
mod measure;
#[path = "paper_scale/time.rs"]
mod time;
#[path = "paper_scale/words.rs"]
mod words;

use words::{USAGE, Words};

/// Whatever went wrong: it ends the program.
type Failure = Box<dyn std::error::Error + Send + Sync>;

fn main() -> Result<(), Failure> {
    let mut arguments = std::env::args().skip(1);
    let command = arguments.next().ok_or(USAGE)?;
    let words = Words::parse(arguments)?;
    let report = match command.as_str() {
        "generate" => generate::run(&words)?,
        "time" => time::run(&words)?,
        "disk" => disk::run(&words)?,
        "dense" => dense::run(&words)?,
        _ => return Err(USAGE.into()),
    };
    println!("{}", serde_json::to_string_pretty(&report)?);
    Ok(())
}
