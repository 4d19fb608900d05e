//! The field of a virtual scene, without photographs: its transfer in one pass, tile by tile into the store.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Mutex;

use half::f16;
use relumine_basis::{Cells, Reach};
use relumine_field::{Extent, FieldError, FieldWriter, Header, PositionRecord};
use relumine_tracer::{Lantern, PathOptions, Paths, Scene};
use serde_json::json;

use crate::{DevelopedReport, Error};

/// A field under way: an iterator over tiles and positions, so that the caller shows progress. Memory holds the paths of one
/// tile ([`Paths::most_bytes`] of at most 256 × 256 pixels) and one block of one position a thread. Stopped, it begins again.
pub struct SceneField {
    scene: Scene,
    cells: Cells,
    options: PathOptions,
    writer: FieldWriter,
    scales: Vec<f32>,
    tiles: Vec<[usize; 2]>,
    next: (usize, usize),
    paths: Option<Paths>,
    connections: u64,
    /// Pixels whose transfer was beyond the range of halves, by position.
    clipped: Mutex<BTreeMap<usize, Vec<u8>>>,
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
        let header = Header::new(cells, [width, height], None, made);
        // The same cells, to keep.
        let cells = header.cells().map_err(|source| FieldError::Geometry { path: path.to_path_buf(), source })?;
        let writer = FieldWriter::open(path, header, input, replace)?;
        let scales = (0..cells.positions()).map(|position| scale(&cells, position)).collect();
        let tiles = writer.blocks().all_tiles().collect();
        let clipped = Mutex::default();
        Ok(Self { scene, cells, options, writer, scales, tiles, next: (0, 0), paths: None, connections: 0, clipped })
    }

    /// Number of steps in all.
    pub fn steps(&self) -> usize {
        self.tiles.len() * self.cells.positions()
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
        if self.next.0 == self.tiles.len() {
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

    fn write(&self, paths: &Paths, tile: [usize; 2], position: usize) -> Result<(), Error> {
        let lantern = Lantern::of_cells(&self.cells, position);
        let m2 = lantern.squares();
        let per_radiance: Vec<f32> = (0..m2)
            .map(|square| (transfer_per_radiance(&self.cells, position * m2 + square) as f32) / self.scales[position])
            .collect();
        let block = |extent: &Extent| {
            let pixels = extent.pixels();
            let mut values = vec![f16::ZERO; 3 * m2 * pixels];
            for share in paths.under(&self.scene, &lantern, extent.columns.clone(), extent.rows.clone()) {
                let (square, pixel) = (share.square as usize, share.pixel as usize);
                for (channel, radiance) in share.radiance.iter().enumerate() {
                    let value = radiance * per_radiance[square];
                    if value > f16::MAX.to_f32() {
                        self.mark_clipped(position, extent, pixel);
                    }
                    values[(3 * square + channel) * pixels + pixel] = f16::from_f32(value.min(f16::MAX.to_f32()));
                }
            }
            (values, ())
        };
        self.writer.write_blocks(position, tile, block)?;
        Ok(())
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
        let (tile_index, position) = self.next;
        let tile = *self.tiles.get(tile_index)?;
        let paths = self.paths.take().unwrap_or_else(|| {
            let extent = self.writer.blocks().tile_extent(tile);
            Paths::trace(&self.scene, extent.columns, extent.rows, &self.options)
        });
        if let Err(error) = self.write(&paths, tile, position) {
            self.next = (self.tiles.len() + 1, 0);
            return Some(Err(error));
        }
        self.connections += paths.vertices() as u64;
        self.next = (tile_index, position + 1);
        if self.next.1 == self.cells.positions() {
            self.next = (tile_index + 1, 0);
        } else {
            self.paths = Some(paths);
        }
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
