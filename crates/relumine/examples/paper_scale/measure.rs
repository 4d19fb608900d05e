//! Seconds, bytes, memory.

use std::path::Path;
use std::time::Instant;

use rayon::prelude::*;
use serde_json::{Value, json};

use crate::Failure;

/// Milliseconds that the same thing took again and again.
#[derive(Default)]
pub(crate) struct Milliseconds(Vec<f64>);

impl Milliseconds {
    /// Does it once more.
    pub(crate) fn time<T>(&mut self, job: impl FnOnce() -> T) -> T {
        let started = Instant::now();
        let done = job();
        self.push(1e3 * started.elapsed().as_secs_f64());
        done
    }

    /// It took so long.
    pub(crate) fn push(&mut self, milliseconds: f64) {
        self.0.push(milliseconds);
    }

    pub(crate) fn least(&self) -> f64 {
        self.0.iter().copied().fold(f64::INFINITY, f64::min)
    }

    pub(crate) fn median(&self) -> f64 {
        let mut sorted = self.0.clone();
        sorted.sort_by(f64::total_cmp);
        sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
    }

    pub(crate) fn report(&self) -> Value {
        json!({ "min": rounded(self.least()), "median": rounded(self.median()), "times": self.0.len() })
    }
}

/// Four digits are enough of what was measured.
pub(crate) fn rounded(value: f64) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    let places = (3 - value.abs().log10().floor() as i32).clamp(0, 12);
    let unit = 10f64.powi(places);
    (value * unit).round() / unit
}

/// Bytes of all files in a folder.
pub(crate) fn bytes_in(folder: &Path) -> Result<u64, Failure> {
    let mut bytes = 0;
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        let metadata = entry.metadata()?;
        bytes += if metadata.is_dir() { bytes_in(&entry.path())? } else { metadata.len() };
    }
    Ok(bytes)
}

/// A line of this process's `/proc/self/status` in megabytes: `VmHWM`, the most memory it has held, or `VmRSS`, what it holds.
pub(crate) fn memory_mb(name: &str) -> Option<u64> {
    number_of("/proc/self/status", name).map(|kibibytes| kibibytes / 1024)
}

/// Bytes that this process has had read from the disk itself, not from the page cache.
pub(crate) fn bytes_read() -> Option<u64> {
    number_of("/proc/self/io", "read_bytes")
}

/// The number of a line `name: number` of a file.
fn number_of(path: &str, name: &str) -> Option<u64> {
    let text = std::fs::read_to_string(path).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(':'))?;
    line.split_whitespace().next()?.parse().ok()
}

/// Memory to read plainly, as all threads can: what no sum over so many bytes can beat.
pub(crate) struct Plain(Vec<u64>);

impl Plain {
    pub(crate) fn new(bytes: usize) -> Self {
        // Pages that nobody has written to are all the same one.
        Self((0..bytes.div_ceil(8) as u64).collect())
    }

    /// Reads so many bytes, as far as there are.
    pub(crate) fn read(&self, bytes: usize) -> u64 {
        let words = &self.0[..bytes.div_ceil(8).min(self.0.len())];
        let share = words.len().div_ceil(rayon::current_num_threads()).max(1);
        let sum = |words: &[u64]| words.iter().fold(0u64, |sum, word| sum.wrapping_add(*word));
        std::hint::black_box(words.par_chunks(share).map(sum).reduce(|| 0, u64::wrapping_add))
    }
}
