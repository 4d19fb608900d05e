//! The field of a virtual scene, without photographs: its transfer in one pass, tile by tile into the store.

use std::collections::{BTreeMap, VecDeque};
use std::path::Path;
use std::sync::Mutex;

use half::f16;
use rayon::prelude::*;
use relumine_basis::{Cells, Coefficients, Reach};
use relumine_field::packed::{Keep, Patches, Sketch};
use relumine_field::{Extent, FieldError, FieldWriter, Header, PositionRecord};
use relumine_radiometry::{Image, Radiance};
use relumine_tracer::{Lantern, PathOptions, Paths, Scene, Share};
use serde_json::json;

use crate::{DevelopedReport, Encoding, Error};

/// A field under way: an iterator over steps, so that the caller shows progress. Memory holds the paths of one tile
/// ([`Paths::most_bytes`] of at most 256 × 256 pixels) and one block a thread: of one position, or if the field is packed of
/// all. Stopped, an unpacked field begins again; a packed one goes on where it was.
pub struct SceneField {
    scene: Scene,
    cells: Cells,
    options: PathOptions,
    encoding: Encoding,
    writer: FieldWriter,
    scales: Vec<f32>,
    /// What is left to do, tile by tile.
    left: VecDeque<Step>,
    steps: usize,
    failed: bool,
    paths: Option<([usize; 2], Paths)>,
    connections: u64,
    /// Pixels whose transfer was beyond the range of halves, by position.
    clipped: Mutex<BTreeMap<usize, Vec<u8>>>,
    witnesses: Vec<Witness>,
}

/// What can be done at once, of one tile.
#[derive(Clone, Debug)]
enum Step {
    /// A position of an unpacked field.
    Position([usize; 2], usize),
    /// A few blocks of a packed field, all positions.
    Blocks([usize; 2], Vec<[usize; 2]>),
}

/// A light, and what it shows of the field before it is stored.
struct Witness {
    light: Coefficients,
    picture: Mutex<Image<Radiance>>,
}

impl Witness {
    /// Adds what the light shows through the squares of a position, whose cells begin at `first_cell`.
    fn add(&self, first_cell: usize, extent: &Extent, shares: &[Share], transfer_per_radiance: impl Fn(usize) -> f32) {
        let mut picture = self.picture.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let width = picture.width();
        for share in shares {
            let (square, pixel) = (share.square as usize, share.pixel as usize);
            let y = extent.rows.start + pixel / extent.columns.len();
            let x = extent.columns.start + pixel % extent.columns.len();
            let factor = transfer_per_radiance(square);
            let lit = self.light.values()[first_cell + square];
            let sum = &mut picture.pixels_mut()[y * width + x];
            (0..3).for_each(|channel| sum[channel] += lit[channel] * (share.radiance[channel] * factor));
        }
    }
}

impl SceneField {
    /// Starts the field of `scene` on `cells` at `path`; `title` is for people, `input` names the scene.
    ///
    /// # Errors
    /// If the field cannot be written.
    pub fn start(
        scene: Scene,
        cells: &Cells,
        path: &Path,
        options: PathOptions,
        encoding: Encoding,
        input: &str,
        replace: bool,
    ) -> Result<Self, Error> {
        let (width, height) = scene.picture_size();
        let made = json!({
            "program": concat!("relumine ", env!("CARGO_PKG_VERSION")),
            "from": "scene",
            "samples": options.samples,
            "bounces": options.bounces,
            "seed": options.seed,
            "removed": "nothing",
        });
        let mut header = Header::new(cells, [width, height], None, made);
        header.packing = encoding.packing();
        // The same cells, to keep.
        let cells = header.cells().map_err(|source| FieldError::Geometry { path: path.to_path_buf(), source })?;
        let writer = FieldWriter::open(path, header, input, replace)?;
        let scales = (0..cells.positions()).map(|position| scale(&cells, position)).collect();
        let blocks = writer.blocks();
        let left: VecDeque<Step> = match encoding {
            Encoding::Lossless => blocks
                .all_tiles()
                .flat_map(|tile| (0..cells.positions()).map(move |position| Step::Position(tile, position)))
                .collect(),
            Encoding::Packed(_) => {
                let remaining = writer.remaining_blocks();
                let of_tile = |tile: [usize; 2]| -> Vec<[usize; 2]> {
                    remaining.iter().filter(|block| blocks.tile_of(**block).0 == tile).copied().collect()
                };
                // No more blocks at once than threads: each holds the sketches of all positions.
                let together = rayon::current_num_threads();
                let steps = |tile| {
                    let blocks = of_tile(tile);
                    blocks.chunks(together).map(|some| Step::Blocks(tile, some.to_vec())).collect::<Vec<_>>()
                };
                blocks.all_tiles().flat_map(steps).collect()
            }
        };
        let (steps, clipped) = (left.len(), Mutex::default());
        Ok(Self {
            scene,
            cells,
            options,
            encoding,
            writer,
            scales,
            left,
            steps,
            failed: false,
            paths: None,
            connections: 0,
            clipped,
            witnesses: Vec::new(),
        })
    }

    /// Also sums what each of these lights shows, from transfers as they are before they are stored: to judge the store by.
    #[must_use]
    pub fn witnessed_by(mut self, lights: &[Coefficients]) -> Self {
        let (width, height) = self.scene.picture_size();
        let witness =
            |light: &Coefficients| Witness { light: light.clone(), picture: Mutex::new(Image::black(width, height)) };
        self.witnesses = lights.iter().map(witness).collect();
        self
    }

    /// What the lights given to [`SceneField::witnessed_by`] show of the steps taken so far.
    pub fn witnessed(&self) -> Vec<Image<Radiance>> {
        let lock =
            |witness: &Witness| witness.picture.lock().unwrap_or_else(std::sync::PoisonError::into_inner).clone();
        self.witnesses.iter().map(lock).collect()
    }

    /// Number of steps in all.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// Vertices connected with positions so far.
    pub fn connections(&self) -> u64 {
        self.connections
    }

    /// Brings the field to its name.
    ///
    /// # Errors
    /// If steps are left or the field cannot be written.
    pub fn finish(self) -> Result<(), Error> {
        let (width, height) = self.scene.picture_size();
        let clipped = self.clipped.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
        if self.left.is_empty() && !self.failed {
            for (position, scale) in self.scales.iter().enumerate() {
                let counts = clipped.get(&position).cloned().unwrap_or_else(|| vec![0; width * height]);
                let pixels = counts.iter().filter(|count| **count > 0).count();
                let report = json!(DevelopedReport::unmeasured(pixels, Vec::new()));
                let record = PositionRecord { position, scale: *scale, missing: Vec::new(), report };
                self.writer.finish_position(record, &counts)?;
            }
        }
        Ok(self.writer.finish()?)
    }

    fn write(&self, paths: &Paths, step: &Step) -> Result<(), Error> {
        match step {
            Step::Position(tile, position) => {
                let block = |extent: &Extent| (self.halves(paths, *position, extent), ());
                self.writer.write_blocks(*position, *tile, block)?;
            }
            Step::Blocks(_, blocks) => {
                blocks.par_iter().map(|block| self.write_packed(paths, *block)).collect::<Result<(), Error>>()?;
            }
        }
        Ok(())
    }

    fn write_packed(&self, paths: &Paths, block: [usize; 2]) -> Result<(), Error> {
        let Encoding::Packed(error) = self.encoding else { return Ok(()) };
        let extent = self.writer.blocks().block_extent(block);
        let patches = Patches::new(extent.rows.len(), extent.columns.len());
        let (keep, m) = (Keep::for_error(error), self.cells.squares());
        let sketch = |position: usize| {
            Sketch::new(&patches, m, &self.halves(paths, position, &extent), self.scales[position], &keep)
        };
        let sketches: Vec<Sketch> = (0..self.cells.positions()).map(sketch).collect();
        self.writer.write_packed(block, &sketches)?;
        Ok(())
    }

    /// The transfers of all squares of a position over its scale, `[square][channel][row][column]`.
    fn halves(&self, paths: &Paths, position: usize, extent: &Extent) -> Vec<f16> {
        let lantern = Lantern::of_cells(&self.cells, position);
        let m2 = lantern.squares();
        let per_radiance: Vec<f32> = (0..m2)
            .map(|square| (transfer_per_radiance(&self.cells, position * m2 + square) as f32) / self.scales[position])
            .collect();
        let pixels = extent.pixels();
        let mut values = vec![f16::ZERO; 3 * m2 * pixels];
        let shares = paths.under(&self.scene, &lantern, extent.columns.clone(), extent.rows.clone());
        for share in &shares {
            let (square, pixel) = (share.square as usize, share.pixel as usize);
            for (channel, radiance) in share.radiance.iter().enumerate() {
                let value = radiance * per_radiance[square];
                if value > f16::MAX.to_f32() {
                    self.mark_clipped(position, extent, pixel);
                }
                values[(3 * square + channel) * pixels + pixel] = f16::from_f32(value.min(f16::MAX.to_f32()));
            }
        }
        for witness in &self.witnesses {
            let scale = self.scales[position];
            witness.add(position * m2, extent, &shares, |square| per_radiance[square] * scale);
        }
        values
    }

    fn mark_clipped(&self, position: usize, extent: &Extent, pixel: usize) {
        let (width, height) = self.scene.picture_size();
        let (row, column) = (pixel / extent.columns.len(), pixel % extent.columns.len());
        let mut clipped = self.clipped.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let counts = clipped.entry(position).or_insert_with(|| vec![0; width * height]);
        let count = &mut counts[(extent.rows.start + row) * width + extent.columns.start + column];
        *count = count.saturating_add(1);
    }
}

impl Iterator for SceneField {
    type Item = Result<(), Error>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.failed {
            return None;
        }
        let step = self.left.pop_front()?;
        let (Step::Position(tile, _) | Step::Blocks(tile, _)) = step;
        if self.paths.as_ref().is_none_or(|(traced, _)| *traced != tile) {
            self.paths = None;
            let extent = self.writer.blocks().tile_extent(tile);
            self.paths = Some((tile, Paths::trace(&self.scene, extent.columns, extent.rows, &self.options)));
        }
        let (_, paths) = self.paths.as_ref()?;
        if let Err(error) = self.write(paths, &step) {
            self.failed = true;
            return Some(Err(error));
        }
        self.connections += match step {
            Step::Position(..) => paths.vertices() as u64,
            // The tile's vertices, shared out over its blocks.
            Step::Blocks(tile, blocks) => {
                let all = self.writer.blocks().tile_extent(tile).pixels();
                let some: usize = blocks.iter().map(|block| self.writer.blocks().block_extent(*block).pixels()).sum();
                (paths.vertices() as f64 * some as f64 / all as f64) as u64 * self.cells.positions() as u64
            }
        };
        Some(Ok(()))
    }
}

/// |Ωᵢ|/Φ of a cell under a projector of one watt a steradian, or a distant lamp of irradiance one.
fn transfer_per_radiance(cells: &Cells, cell: usize) -> f64 {
    match cells.reach() {
        Reach::Near { pattern, .. } => {
            let side = 2.0 * pattern.half_width() / pattern.squares() as f64;
            cells.measure(cell) / (side * side)
        }
        Reach::Far => cells.measure(cell),
    }
}

/// The scale of a position: a white matte surface across the light, at the origin, lies at about 2⁵ of the 2¹⁶ that halves
/// reach, so that highlights have room above it and interreflection below.
fn scale(cells: &Cells, position: usize) -> f32 {
    let m = cells.squares();
    let middle = position * m * m + (m / 2) * m + m / 2;
    let white = match cells.reach() {
        Reach::Near { radius_m, .. } => 1.0 / (std::f64::consts::PI * radius_m * radius_m),
        Reach::Far => 1.0 / std::f64::consts::PI,
    };
    FieldWriter::scale_for(1024.0 * white * transfer_per_radiance(cells, middle))
}
