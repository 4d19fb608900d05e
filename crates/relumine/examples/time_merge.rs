//! Times the merging of a bracket, without reading it: `time_merge LIST RESPONSE.csv [SECONDS]` prints JSON.
//!
//! `benches/merge_against_opencv.py` runs it beside OpenCV. It merges again and again for so many seconds with one thread, as
//! `relumine merge` does (what the photographs differ by is measured first), by the noise model alone as `develop` does, and by
//! the plain version, and reads the CPU time of the process from /proc (Linux).

use std::hint::black_box;
use std::path::Path;
use std::time::{Duration, Instant};

use relumine::radiometry::{Counts, Disagreement, Image, Linearization, Merged, NoiseModel, Response, ResponseCurve};
use relumine::radiometry::{merge_counts, merge_counts_disagreeing, merge_counts_plain, read_text};
use relumine::{Bracket, ExposureList, Levels};

type Merge = fn(&[(&Image<Counts>, f64)], &Linearization, NoiseModel) -> Merged;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [list, response, rest @ ..] = arguments.as_slice() else {
        return Err("usage: time_merge LIST RESPONSE.csv [SECONDS]".into());
    };
    let seconds: f64 = rest.first().map_or(Ok(4.0), |text| text.parse())?;
    rayon::ThreadPoolBuilder::new().num_threads(1).build_global()?;
    let bracket = Bracket::read_list(&ExposureList::read(Path::new(list), false)?, Levels::default())?;
    let curve = ResponseCurve::parse(Path::new(response), &read_text(Path::new(response))?)?;
    let camera = Linearization::new(&Response::Curve(curve), bracket.black_level, bracket.white_level);
    let exposed = bracket.exposed();
    let megapixels = exposed[0].0.pixels().len() as f64 * exposed.len() as f64 / 1e6;
    let rate = |merge: Merge| -> Result<f64, Box<dyn std::error::Error>> {
        black_box(merge(&exposed, &camera, NoiseModel::default()));
        let (started, cpu, mut rounds) = (Instant::now(), cpu_seconds()?, 0);
        while started.elapsed() < Duration::from_secs_f64(seconds) {
            black_box(merge(black_box(&exposed), &camera, NoiseModel::default()));
            rounds += 1;
        }
        Ok(megapixels * f64::from(rounds) / (cpu_seconds()? - cpu))
    };
    let bracket = rate(|exposed, camera, noise| {
        merge_counts_disagreeing(exposed, camera, noise, &Disagreement::measure(exposed, camera, noise))
    })?;
    let (model, plain) = (rate(merge_counts)?, rate(merge_counts_plain)?);
    println!(
        "{{\"fast_mpixel_exposures_per_cpu_s\": {bracket:.1}, \"by_model_alone_mpixel_exposures_per_cpu_s\": {model:.1}, \
         \"plain_mpixel_exposures_per_cpu_s\": {plain:.1}}}"
    );
    Ok(())
}

/// User and system time of the process: fields 14 and 15 of /proc/self/stat, in hundredths of a second.
fn cpu_seconds() -> Result<f64, Box<dyn std::error::Error>> {
    let stat = std::fs::read_to_string("/proc/self/stat")?;
    let after_name = stat.rsplit_once(')').ok_or("no name in /proc/self/stat")?.1;
    let fields: Vec<&str> = after_name.split_whitespace().collect();
    Ok((fields[11].parse::<f64>()? + fields[12].parse::<f64>()?) / 100.0)
}
