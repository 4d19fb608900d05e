//! How fast paths are followed and connected: `time_connections SCENE [WIDTH] [SAMPLES] [BOUNCES] [EVERY]` prints one line
//! of JSON. The positions are every so-manieth of the paper's 32 × 7, with 16 × 16 squares.

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use relumine_basis::{Cells, Layout, Partition, Pattern, Reach};
use relumine_tracer::{Lantern, PathOptions, Paths, Scene};

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let number = |index: usize, default: usize| words.get(index).map_or(Ok(default), |word| word.parse::<usize>());
    let path = words.first().ok_or("which scene?")?;
    let width = number(1, 120)?;
    let options = PathOptions { samples: number(2, 16)?, bounces: number(3, 2)?, seed: 1 };
    let started = Instant::now();
    let scene = Scene::read(Path::new(path))?;
    let (w, h) = scene.picture_size();
    let height = width * h / w;
    let scene = scene.with_picture_size(width, height);
    let reading_s = started.elapsed().as_secs_f64();
    let partition = Partition::new(Layout::Grid { azimuths: 32, tilts: 7 })?;
    let cells = Cells::new(partition, Reach::Near { radius_m: 4.0, pattern: Pattern::new(16, 0.3)? })?;
    let started = Instant::now();
    let paths = Paths::trace(&scene, 0..width, 0..height, &options);
    let tracing_s = started.elapsed().as_secs_f64();
    let started = Instant::now();
    let every = number(4, 1)?.max(1);
    let shares: usize = (0..cells.positions())
        .step_by(every)
        .map(|position| paths.under(&scene, &Lantern::of_cells(&cells, position), 0..width, 0..height).len())
        .sum();
    let connecting_s = started.elapsed().as_secs_f64();
    let connections = paths.vertices() * cells.positions().div_ceil(every);
    println!(
        "{{\"shapes\": {}, \"pixels\": {}, \"vertices\": {}, \"connections\": {connections}, \"shares\": {shares}, \
         \"reading_s\": {reading_s:.3}, \"tracing_s\": {tracing_s:.3}, \"connecting_s\": {connecting_s:.3}, \
         \"million_connections_a_second\": {:.3}}}",
        scene.shapes(),
        width * height,
        paths.vertices(),
        connections as f64 / connecting_s / 1e6
    );
    Ok(())
}
