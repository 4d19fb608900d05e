//! Relighting of a field in memory.

use std::time::Instant;

use rayon::prelude::*;
use relumine::radiometry::{Image, Radiance, difference};
use relumine::{Coefficients, Incremental, ReflectanceField, ResidentPacked};
use relumine_field::packed::PackedBlock;
use relumine_relight::{RelightError, ResidentBlock, TOLERANCE};
use serde_json::{Value, json};

use crate::Failure;
use crate::lights;
use crate::linear;
use crate::measure::{Milliseconds, Plain, memory_mb, rounded};
use crate::words::Words;

/// Frames of the spot that moves.
const FRAMES: usize = 24;
/// Coefficients that lie together in memory.
const TOGETHER: usize = 8;
/// Bytes of one component of the basis of a patch in memory: 8 × 8 pixels of three channels, and its step. They lie in pairs.
const COMPONENT_BYTES: usize = 3 * 64 + 4;

pub(crate) fn run(words: &Words) -> Result<Value, Failure> {
    let [path] = words.paths()?;
    let repeat: usize = words.option("--repeat")?.unwrap_or(11).max(1);
    let field = ReflectanceField::open(path)?;
    let cells = field.cells();
    let started = Instant::now();
    drop(ResidentPacked::load(&field)?);
    let load_s = started.elapsed().as_secs_f64();
    // Once more by hand: what is counted and cut here must not be on the clock.
    let (blocks, bases, groups) = blocks(&field)?;
    let every = lights::spread(cells, cells.positions());
    let curve = if words.brief { Value::Null } else { linear::curve(&field, &blocks, repeat)? };
    let (width, height) = field.picture_size();
    let resident = ResidentPacked::from_resident(blocks, [width, height], cells.positions(), cells.squares())?;
    let rss_mb = memory_mb("VmRSS");

    let touched = Touched { bases, atoms: resident.bytes() - bases, groups };
    let mut timing = Timing { resident: &resident, plain: Plain::new(resident.bytes()), touched, repeat };
    let mut cases = Vec::new();
    let two = |positions: &[usize]| vec![lights::random(cells, positions, 3), lights::random(cells, positions, 4)];
    cases.push(timing.case("every coefficient changed", &two(&every))?);
    if !words.brief {
        cases.push(timing.case("8 positions", &two(&lights::spread(cells, 8)))?);
    }
    for light in lights::read(&words.lights, cells)? {
        cases.push(timing.case(&light.name, &[light.coefficients])?);
    }
    let mut moving = Vec::new();
    if !words.brief {
        let started = Instant::now();
        let alone = lights::moving_spot(cells, FRAMES)?;
        let project_ms = 1e3 * started.elapsed().as_secs_f64() / FRAMES as f64;
        let mut dim = cells.dark();
        dim.values_mut().fill([0.05; 3]);
        let lit: Vec<Coefficients> = alone.iter().map(|spot| lights::sum(spot, &dim)).collect();
        moving.push(timing.moving("a spot in the dark", &alone, project_ms)?);
        moving.push(timing.moving("a spot in a dim room", &lit, project_ms)?);
    }
    Ok(json!({
        "picture": [width, height],
        "positions": cells.positions(),
        "squares": cells.squares(),
        "threads": rayon::current_num_threads(),
        "load_s": rounded(load_s),
        "resident_bytes": resident.bytes(),
        "resident_bytes_of_bases": bases,
        "resident_bytes_per_pixel_and_position":
            rounded(resident.bytes() as f64 / (width * height * cells.positions()) as f64),
        "rss_mb": rss_mb,
        "lights": cases,
        "moving": moving,
        "curve": curve,
    }))
}

/// The blocks of a field laid out for the sum, about the bytes of their bases, and by position the groups of coefficients.
fn blocks(field: &ReflectanceField) -> Result<(Vec<ResidentBlock>, usize, Vec<u64>), Failure> {
    let ([down, across], positions) = (field.blocks().grid(), field.cells().positions());
    let read = |index: usize| {
        let block: PackedBlock = field.packed_block([index / across, index % across], |_| true)?;
        let mut groups = vec![0u64; positions];
        let mut longest = vec![0usize; block.patches.len()];
        for (position, groups) in groups.iter_mut().enumerate() {
            for (patch, longest) in longest.iter_mut().enumerate() {
                for atom in block.atoms(position, patch).into_iter().flatten() {
                    *groups += atom.coefficients.len().div_ceil(TOGETHER).max(1) as u64;
                    *longest = atom.coefficients.len().max(*longest);
                }
            }
        }
        let bases = longest.iter().map(|longest| longest.next_multiple_of(2)).sum::<usize>() * COMPONENT_BYTES;
        Ok((ResidentBlock::new(&block, field.cells().squares())?, bases, groups))
    };
    let read: Vec<_> = (0..down * across).into_par_iter().map(read).collect::<Result<_, RelightError>>()?;
    let mut groups = vec![0u64; positions];
    for (sum, more) in read.iter().flat_map(|(_, _, groups)| groups.iter().enumerate()) {
        groups[sum] += more;
    }
    let bases = read.iter().map(|(_, bases, _)| bases).sum();
    Ok((read.into_iter().map(|(block, _, _)| block).collect(), bases, groups))
}

/// What a light may touch of a field in memory.
struct Touched {
    bases: usize,
    atoms: usize,
    /// Groups of coefficients by position.
    groups: Vec<u64>,
}

impl Touched {
    /// The bases, and of the atoms the share of the lit positions: at most so many bytes are read.
    fn bytes(&self, light: &Coefficients) -> usize {
        let lit = self.groups.iter().enumerate().filter(|(position, _)| !light.is_position_dark(*position));
        let (lit, all): (u64, u64) = (lit.map(|(_, groups)| groups).sum(), self.groups.iter().sum());
        self.bases + (self.atoms as f64 * lit as f64 / all.max(1) as f64) as usize
    }
}

struct Timing<'a> {
    resident: &'a ResidentPacked,
    plain: Plain,
    touched: Touched,
    repeat: usize,
}

impl Timing<'_> {
    /// Lights in turn, and in turn with them plain reads of as many bytes.
    fn case(&mut self, name: &str, lights: &[Coefficients]) -> Result<Value, Failure> {
        let (width, height) = self.resident.picture_size();
        let bytes = self.touched.bytes(&lights[0]);
        let mut picture = Image::black(width, height);
        let (mut relit, mut plain) = (Milliseconds::default(), Milliseconds::default());
        for light in lights.iter().cycle().take(self.repeat.max(2)) {
            relit.time(|| self.resident.relight_into(light, &mut picture))?;
            plain.time(|| self.plain.read(bytes));
        }
        let (positions, cells) = lights::lit(&lights[0]);
        Ok(json!({
            "light": name,
            "lit_positions": positions,
            "lit_cells": cells,
            "ms": relit.report(),
            "bytes_touched_at_most": bytes,
            "plain_read_ms": plain.report(),
            "times_plain_read": rounded(relit.least() / plain.least()),
            "ns_per_pixel": rounded(1e6 * relit.least() / (width * height) as f64),
        }))
    }

    /// A light that goes from frame to frame there and back; beside it, each frame relit anew.
    fn moving(&mut self, name: &str, frames: &[Coefficients], project_ms: f64) -> Result<Value, Failure> {
        let mut incremental = Incremental::new(self.resident, &frames[0])?;
        let (width, height) = self.resident.picture_size();
        let mut picture: Image<Radiance> = Image::black(width, height);
        let (mut updates, mut whole) = (Milliseconds::default(), Milliseconds::default());
        let (mut positions, mut patches, mut anew) = (0, 0, 0);
        for frame in frames[1..].iter().chain(frames.iter().rev().skip(1)) {
            let update = updates.time(|| incremental.update(self.resident, frame))?;
            whole.time(|| self.resident.relight_into(frame, &mut picture))?;
            positions += update.positions;
            patches += update.patches;
            anew += usize::from(update.anew);
        }
        let number = (2 * (frames.len() - 1)) as f64;
        let off = difference(incremental.picture(), &picture, None, false).map(|off| off.relative_l2);
        if off.is_none_or(|off| off > TOLERANCE) {
            return Err(format!(
                "{name}: the picture that followed the light is off by {off:?} from the one relit anew"
            )
            .into());
        }
        Ok(json!({
            "light": name,
            "update_ms": updates.report(),
            "relit_anew_ms": whole.report(),
            "positions_changed": rounded(positions as f64 / number),
            "patches_made_anew": rounded(patches as f64 / number),
            "summed_anew": rounded(anew as f64 / number),
            "off_at_the_end": off,
            "projecting_ms": rounded(project_ms),
        }))
    }
}
