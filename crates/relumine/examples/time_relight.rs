//! Times relighting a field under one light, from memory and from disk: `time_relight FIELD LIGHT [REPEAT]` prints JSON.
//!
//! `benches/compare_with_numpy.py` runs it beside NumPy. Times are wall-clock; compare them within one run only.

use std::path::Path;
use std::time::Instant;

use relumine::{ProjectionOptions, ReflectanceField, Relighting, ResidentField, project, read_light};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [path, light, rest @ ..] = arguments.as_slice() else {
        return Err("usage: time_relight FIELD LIGHT [REPEAT]".into());
    };
    let repeat: usize = rest.first().map_or(Ok(20), |text| text.parse())?;
    let field = ReflectanceField::open(Path::new(path))?;
    let (light, _) = read_light(Path::new(light), field.cells(), None)?;
    let started = Instant::now();
    let lights = [project(&light, field.cells(), &ProjectionOptions::default())?.coefficients];
    let project_seconds = started.elapsed().as_secs_f64();
    let mut disk = Vec::new();
    for _ in 0..repeat.min(5) {
        let started = Instant::now();
        Relighting::new(&field, &lights)?.run()?;
        disk.push(started.elapsed().as_secs_f64());
    }
    let started = Instant::now();
    let resident = ResidentField::load(field)?;
    let load_seconds = started.elapsed().as_secs_f64();
    let mut memory = Vec::new();
    for _ in 0..repeat {
        let started = Instant::now();
        Relighting::new(&resident, &lights)?.run()?;
        memory.push(started.elapsed().as_secs_f64());
    }
    let figures = |mut seconds: Vec<f64>| {
        seconds.sort_by(f64::total_cmp);
        format!("{{\"best\": {:.5}, \"median\": {:.5}}}", seconds[0], seconds[seconds.len() / 2])
    };
    println!(
        "{{\"threads\": {}, \"project_seconds\": {project_seconds:.4}, \"load_seconds\": {load_seconds:.4}, \
         \"resident_bytes\": {}, \"from_disk_seconds\": {}, \"from_memory_seconds\": {}}}",
        rayon::current_num_threads(),
        resident.bytes(),
        figures(disk),
        figures(memory)
    );
    Ok(())
}
