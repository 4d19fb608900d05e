//! Relighting straight from disk.

use std::time::Instant;

use relumine::{ReflectanceField, Relighting};
use serde_json::{Value, json};

use crate::Failure;
use crate::measure::{Milliseconds, bytes_read, rounded};
use crate::words::{USAGE, Words};

/// What one relighting took.
struct Times {
    open_ms: f64,
    relight_ms: f64,
    from_disk: Option<u64>,
}

pub(crate) fn run(words: &Words) -> Result<Value, Failure> {
    let [path] = words.paths()?;
    if words.lights.len() != 1 {
        return Err(USAGE.into());
    }
    let repeat: usize = words.option("--repeat")?.unwrap_or(5);
    let mut light = None;
    let once = |light: &mut Option<_>| -> Result<Times, Failure> {
        let before = bytes_read();
        let started = Instant::now();
        let field = ReflectanceField::open(path)?;
        let open_ms = 1e3 * started.elapsed().as_secs_f64();
        // Which cells there are only the field says: the light is projected once, off the clock.
        let light = match light {
            Some(light) => light,
            none => none.insert(crate::lights::read(&words.lights, field.cells())?.remove(0)),
        };
        let started = Instant::now();
        let picture = Relighting::new(&field, std::slice::from_ref(&light.coefficients))?.run()?;
        let relight_ms = 1e3 * started.elapsed().as_secs_f64();
        std::hint::black_box(picture);
        let from_disk = bytes_read().zip(before).map(|(after, before)| after - before);
        Ok(Times { open_ms, relight_ms, from_disk })
    };
    let first = once(&mut light)?;
    let mut again = Milliseconds::default();
    for _ in 0..repeat {
        let times = once(&mut light)?;
        again.push(times.open_ms + times.relight_ms);
    }
    let (positions, cells) = light.as_ref().map_or((0, 0), |light| crate::lights::lit(&light.coefficients));
    Ok(json!({
        "light": light.map(|light| light.name),
        "lit_positions": positions,
        "lit_cells": cells,
        "threads": rayon::current_num_threads(),
        "first": {
            "open_ms": rounded(first.open_ms),
            "read_and_relight_ms": rounded(first.relight_ms),
            "ms": rounded(first.open_ms + first.relight_ms),
            "bytes_read_from_disk": first.from_disk,
        },
        "again_ms": again.report(),
    }))
}
