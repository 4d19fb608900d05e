//! A packed field keeps its promise: every square within the error asked for, all squares together as bright as before, the
//! same bits however it was made, and no flipped bit that shows other light.

#![allow(clippy::unwrap_used)] // in helpers of tests too

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use half::f16;
use relumine_basis::{Cells, Layout, Partition, Pattern, Reach};
use relumine_field::packed::{Groups, Keep, Kept, PackedBlock, Patches, Sketch};
use relumine_field::{BlockBuffer, Damage, Extent, FieldError, FieldWriter, Header, Packing, PositionRecord, ReflectanceField};
use serde_json::json;
use tempfile::TempDir;

/// What is photographed from every position through every square, as a field keeps it.
struct World {
    header: Header,
    /// M.
    squares: usize,
    scale: f32,
    /// By position: `[v · M + u][channel][row][column]`.
    halves: Vec<Vec<f16>>,
    /// By position: squares that were not photographed.
    missing: Vec<Vec<usize>>,
}

/// Two blocks side by side, their patches of 7 or 8 × 6 or 7 pixels.
const SIZE: [usize; 2] = [75, 41];
const POSITIONS: usize = 12;
/// Nothing is seen from here.
const BLACK: usize = 5;
/// Some squares are missing here.
const LOSSY: usize = 7;

impl World {
    /// A textured plane under [`POSITIONS`] positions of M × M squares. Each pixel is lit directly through one square, and the
    /// edges between squares, blurred by half a pixel, pass through patches as the position has it; a highlight goes with the
    /// position; through every square a little smooth light comes that was reflected elsewhere.
    fn plane(squares: usize) -> Self {
        let missing: Vec<Vec<usize>> =
            (0..POSITIONS).map(|position| if position == LOSSY { vec![1, squares + 2] } else { vec![] }).collect();
        let layout = Layout::Grid { azimuths: 6, tilts: 2 };
        let reach = Reach::Near { radius_m: 2.0, pattern: Pattern::new(squares, 0.3).unwrap() };
        Self::new(layout, reach, missing, |position, square, channel, x, y| {
            if position == BLACK {
                return 0.0;
            }
            let angle = 0.4 + 0.9 * position as f64;
            let (x, y) = (x as f64 - 37.0, y as f64 - 20.0);
            let texture = 0.5 + 0.3 * (x * 0.9 + channel as f64).sin() * (y * 0.7).cos() + 0.15 * (x * y * 0.31).sin();
            // Where a pixel lies in the pattern, in squares.
            let scale = squares as f64 / 92.0;
            let s = (x * angle.cos() - y * angle.sin()) * scale + squares as f64 / 2.0;
            let t = (x * angle.sin() + y * angle.cos()) * scale + squares as f64 / 2.0;
            let inside = |at: f64, index: usize| {
                let edge = |edge: f64| ((at - edge) / scale + 0.5).clamp(0.0, 1.0);
                edge(index as f64) - edge(index as f64 + 1.0)
            };
            let direct = inside(s, square % squares) * inside(t, square / squares);
            let shading = 0.3 + 0.7 * (0.5 + 0.5 * (0.02 * (x * angle.cos() + y * angle.sin()) + angle).cos());
            let apart = (x - 25.0 * angle.cos()).powi(2) + (y - 12.0 * angle.sin()).powi(2);
            let highlight = 2.0 * (-apart / 18.0).exp();
            let around = 1.0 + 0.5 * (0.05 * (x + y) + square as f64 + channel as f64).sin();
            (direct * (shading * texture + highlight) + 0.15 / (squares * squares) as f64 * around * texture) * 3e-6
        })
    }

    fn new(
        layout: Layout,
        reach: Reach,
        missing: Vec<Vec<usize>>,
        transfer: impl Fn(usize, usize, usize, usize, usize) -> f64,
    ) -> Self {
        let cells = Cells::new(Partition::new(layout).unwrap(), reach).unwrap();
        let scale = FieldWriter::scale_for(9e-6);
        let squares = cells.squares();
        let halves = (0..cells.positions())
            .map(|position| {
                let mut halves = Vec::with_capacity(squares * squares * 3 * SIZE[0] * SIZE[1]);
                for (square, channel) in (0..squares * squares).flat_map(|square| [0, 1, 2].map(|c| (square, c))) {
                    let value = |x, y| transfer(position, square, channel, x, y) / f64::from(scale);
                    let lost = missing[position].contains(&square);
                    let pixels = (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (x, y)));
                    halves.extend(pixels.map(|(x, y)| if lost { f16::ZERO } else { f16::from_f64(value(x, y)) }));
                }
                halves
            })
            .collect();
        let header = Header::new(&cells, SIZE, Some("plane".into()), json!({ "program": "test" }));
        Self { header, squares, scale, halves, missing }
    }

    fn packed_header(&self, error: f64) -> Header {
        let mut header = self.header.clone();
        header.packing = Some(Packing { error });
        header
    }

    /// The halves of a position in some pixels.
    fn cut(&self, position: usize, extent: &Extent) -> Vec<f16> {
        let rows = self.halves[position].chunks_exact(SIZE[0]).enumerate();
        let inside = rows.filter(|(row, _)| extent.rows.contains(&(row % SIZE[1])));
        inside.flat_map(|(_, row)| &row[extent.columns.clone()]).copied().collect()
    }

    fn sketch(&self, position: usize, extent: &Extent, error: f64) -> Sketch {
        let patches = Patches::new(extent.rows.len(), extent.columns.len());
        Sketch::new(&patches, self.squares, &self.cut(position, extent), self.scale, &Keep::for_error(error))
    }

    fn finish_position(&self, writer: &FieldWriter, position: usize) {
        let missing = self.missing[position].clone();
        let record = PositionRecord { position, scale: self.scale, missing, report: json!({ "seconds": 1.5 }) };
        writer.finish_position(record, &[]).unwrap();
    }

    fn finish(&self, writer: FieldWriter) {
        (0..self.halves.len()).for_each(|position| self.finish_position(&writer, position));
        writer.finish().unwrap();
    }

    fn pack_block(&self, writer: &FieldWriter, block: [usize; 2], error: f64) {
        let extent = writer.blocks().block_extent(block);
        let sketches: Vec<Sketch> = (0..self.halves.len()).map(|position| self.sketch(position, &extent, error)).collect();
        writer.write_packed(block, &sketches).unwrap();
    }

    /// Packs the world into the field at `path`.
    fn pack(&self, path: &Path, error: f64) {
        let writer = FieldWriter::open(path, self.packed_header(error), "plane", false).unwrap();
        writer.all_blocks().for_each(|block| self.pack_block(&writer, block, error));
        self.finish(writer);
    }

    fn packed(&self, error: f64) -> (TempDir, ReflectanceField) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("packed.field");
        self.pack(&path, error);
        let field = ReflectanceField::open(&path).unwrap();
        (folder, field)
    }
}

/// How far a packed field is from its world.
struct Distance {
    /// Of every square in every patch: norm of what it is off by, over what all squares of a position show there, root mean
    /// square over positions. The largest.
    worst: f64,
    /// The same, root mean square over squares that show anything.
    typical: f64,
    /// Of the sum of all squares, the largest.
    worst_whole: f64,
    /// Of the sum of all squares, all patches and positions together: relative L2.
    wholes: f64,
    /// Sum of the packed field over the sum of the world.
    flux: f64,
}

fn blocks_of(field: &ReflectanceField) -> impl Iterator<Item = [usize; 2]> + use<> {
    let [down, across] = field.blocks().grid();
    (0..down).flat_map(move |row| (0..across).map(move |column| [row, column]))
}

fn distance(world: &World, field: &ReflectanceField) -> Distance {
    let m2 = world.squares * world.squares;
    let (mut worst, mut worst_whole, mut squares, mut number) = (0.0f64, 0.0f64, 0.0, 0usize);
    let (mut off, mut power_of_all, mut flux, mut flux_of_world) = (0.0, 0.0, 0.0, 0.0);
    let mut buffer = BlockBuffer::new(&field.blocks()).unwrap();
    for block in blocks_of(field) {
        let extent = field.blocks().block_extent(block);
        let patches = Patches::new(extent.rows.len(), extent.columns.len());
        // By position and patch: of the whole, of what it is off by, and the largest of a square's.
        let mut sums = vec![vec![[0.0f64; 3]; patches.len()]; world.halves.len()];
        for (position, sums) in sums.iter_mut().enumerate() {
            let mut found = Vec::new();
            field.squares_of_block(position, block, &mut buffer, &mut found).unwrap();
            let expected = world.cut(position, &extent);
            for (patch, sums) in sums.iter_mut().enumerate() {
                let (rows, columns) = patches.pixels(patch);
                let mut of_squares = vec![(0.0f64, 0.0f64); m2];
                for (channel, y) in (0..3).flat_map(|channel| rows.clone().map(move |y| (channel, y))) {
                    for x in columns.clone() {
                        let (mut whole, mut difference) = (0.0, 0.0);
                        for (square, of_square) in of_squares.iter_mut().enumerate() {
                            let at = ((square * 3 + channel) * extent.rows.len() + y) * extent.columns.len() + x;
                            let (found, expected) = (found[at].to_f64(), expected[at].to_f64());
                            of_square.0 += (found - expected).powi(2);
                            of_square.1 += expected * expected;
                            whole += expected;
                            difference += found - expected;
                        }
                        sums[0] += whole * whole;
                        sums[1] += difference * difference;
                        flux += whole + difference;
                        flux_of_world += whole;
                    }
                }
                for (off, shown) in of_squares {
                    sums[2] = sums[2].max(off);
                    if shown > 0.0 {
                        squares += off;
                        number += 1;
                    }
                }
            }
        }
        for patch in 0..patches.len() {
            let power = sums.iter().map(|sums| sums[patch][0]).sum::<f64>();
            let mean = power / world.halves.len() as f64;
            power_of_all += power;
            for sums in &sums {
                off += sums[patch][1];
                if mean > 0.0 {
                    worst = worst.max((sums[patch][2] / mean).sqrt());
                    worst_whole = worst_whole.max((sums[patch][1] / mean).sqrt());
                } else {
                    assert!(sums[patch][1] == 0.0 && sums[patch][2] == 0.0, "light where there is none");
                }
            }
        }
    }
    // Patches are about alike, so that one mean serves them all.
    let mean = power_of_all / (world.halves.len() * 60) as f64;
    let typical = (squares / number.max(1) as f64 / mean).sqrt();
    Distance { worst, typical, worst_whole, wholes: (off / power_of_all).sqrt(), flux: flux / flux_of_world }
}

fn bytes_of(field: &ReflectanceField) -> usize {
    tree(&field.path().join("packed")).iter().filter(|(name, _)| name.contains("/c/")).map(|(_, bytes)| bytes.len()).sum()
}

#[test]
fn measure() {
    for m in [4, 8] {
        let world = World::plane(m);
        for error in [0.2, 0.1, 0.03, 0.01, 0.003, 0.001, 1e-4] {
            let start = std::time::Instant::now();
            let (_folder, field) = world.packed(error);
            let t = start.elapsed();
            let Distance { worst, typical, worst_whole, wholes, flux } = distance(&world, &field);
            println!(
                "M {m} E {error}: worst {:.3} typical {:.3} whole worst {:.3} wholes {:.3} (E) flux {flux:.6} bytes {} ranks {:?} {t:?} {:?}",
                worst / error, typical / error, worst_whole / error, wholes / error, bytes_of(&field),
                field.block_records().iter().map(|b| b.rank).collect::<Vec<_>>(), start.elapsed()
            );
        }
    }
}

/// Every file below a folder with its bytes.
fn tree(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = BTreeMap::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(inner) = folders.pop() {
        for entry in fs::read_dir(inner).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                files.insert(path.strip_prefix(folder).unwrap().to_str().unwrap().into(), fs::read(&path).unwrap());
            }
        }
    }
    files
}
