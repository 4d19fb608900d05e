//! A packed field keeps its promise: every square within the error asked for, all squares together as bright as before, the
//! same bits however it was made, and no flipped bit that shows other light.

#![allow(clippy::unwrap_used)] // in helpers of tests too

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use half::f16;
use relumine_basis::{Cells, Layout, Partition, Pattern, Reach};
use relumine_field::packed::{Groups, Keep, Kept, PackedBlock, Patches, Sketch};
use relumine_field::{
    BlockBuffer, Damage, Extent, FieldError, FieldWriter, Header, Packing, PositionRecord, ReflectanceField,
};
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
        let sketches: Vec<Sketch> =
            (0..self.halves.len()).map(|position| self.sketch(position, &extent, error)).collect();
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

/// How far a packed field is from its world, over what all squares of a position show in a patch, root mean square over
/// positions.
struct Distance {
    /// Of the squares that show anything, in every patch: root mean square.
    squares: f64,
    /// The largest.
    worst: f64,
    /// The share of them that is off by more than the error asked for.
    over: f64,
    /// Of the sum of all squares: root mean square.
    wholes: f64,
    /// The largest.
    worst_whole: f64,
    /// Sum of the packed field less that of the world, over the latter.
    flux: f64,
    /// The same by position and block, over the largest of the world: what a single block may lose.
    worst_flux: f64,
}

fn blocks_of(field: &ReflectanceField) -> impl Iterator<Item = [usize; 2]> + use<> {
    let [down, across] = field.blocks().grid();
    (0..down).flat_map(move |row| (0..across).map(move |column| [row, column]))
}

fn distance(world: &World, field: &ReflectanceField, error: f64) -> Distance {
    let m2 = world.squares * world.squares;
    let mut buffer = BlockBuffer::new(&field.blocks()).unwrap();
    // Squared and over the mean of their patch: of squares that show anything, and of wholes.
    let (mut squares, mut wholes) = (Vec::new(), Vec::new());
    let mut fluxes = Vec::new();
    for block in blocks_of(field) {
        let extent = field.blocks().block_extent(block);
        let patches = Patches::new(extent.rows.len(), extent.columns.len());
        // By patch: power of all positions, what squares and wholes are off by.
        let mut sums = vec![(0.0f64, Vec::new(), Vec::new()); patches.len()];
        for position in 0..world.halves.len() {
            let mut found = Vec::new();
            field.squares_of_block(position, block, &mut buffer, &mut found).unwrap();
            let expected = world.cut(position, &extent);
            let mut flux = [0.0f64; 2];
            for (patch, (power, of_squares, of_wholes)) in sums.iter_mut().enumerate() {
                let (rows, columns) = patches.pixels(patch);
                let mut off = vec![(0.0f64, false); m2];
                let mut off_whole = 0.0;
                for line in (0..3 * extent.rows.len()).filter(|line| rows.contains(&(line % extent.rows.len()))) {
                    for x in columns.clone() {
                        let mut sum = [0.0f64; 2];
                        for (square, (off, shows)) in off.iter_mut().enumerate() {
                            let at = (square * 3 * extent.rows.len() + line) * extent.columns.len() + x;
                            let (found, expected) = (found[at].to_f64(), expected[at].to_f64());
                            *off += (found - expected).powi(2);
                            *shows |= expected > 0.0;
                            sum = [sum[0] + found, sum[1] + expected];
                        }
                        *power += sum[1] * sum[1];
                        off_whole += (sum[0] - sum[1]).powi(2);
                        flux = [flux[0] + sum[0], flux[1] + sum[1]];
                    }
                }
                of_squares.extend(off.iter().filter(|(off, shows)| *shows || *off > 0.0).map(|(off, _)| *off));
                of_wholes.push(off_whole);
            }
            fluxes.push(flux);
        }
        for (power, of_squares, of_wholes) in sums {
            let mean = power / world.halves.len() as f64;
            assert!(mean > 0.0 || of_squares.is_empty(), "light where there is none");
            squares.extend(of_squares.iter().map(|off| off / mean));
            wholes.extend(of_wholes.iter().filter(|_| mean > 0.0).map(|off| off / mean));
        }
    }
    let root_mean = |values: &[f64]| (values.iter().sum::<f64>() / values.len().max(1) as f64).sqrt();
    let root_largest = |values: &[f64]| values.iter().copied().fold(0.0, f64::max).sqrt();
    let over = squares.iter().filter(|off| off.sqrt() > error).count();
    let largest = fluxes.iter().map(|flux| flux[1]).fold(0.0, f64::max);
    let all = fluxes.iter().fold([0.0, 0.0], |all, flux| [all[0] + flux[0], all[1] + flux[1]]);
    Distance {
        squares: root_mean(&squares),
        worst: root_largest(&squares),
        over: over as f64 / squares.len().max(1) as f64,
        wholes: root_mean(&wholes),
        worst_whole: root_largest(&wholes),
        flux: all[0] / all[1] - 1.0,
        worst_flux: fluxes.iter().map(|flux| (flux[0] - flux[1]).abs() / largest).fold(0.0, f64::max),
    }
}

fn bytes_of(field: &ReflectanceField) -> usize {
    let files = tree(&field.path().join("packed"));
    files.iter().filter(|(name, _)| name.ends_with("/c.0.0")).map(|(_, bytes)| bytes.len()).sum()
}

#[test]
fn every_square_is_within_the_error_asked_for_and_no_light_is_dropped() {
    for squares in [4, 8] {
        let world = World::plane(squares);
        let mut last = (f64::INFINITY, 0);
        for error in [0.1, 0.03, 0.01] {
            let (_folder, field) = world.packed(error);
            let found = distance(&world, &field, error);
            let Distance { squares, worst, over, wholes, worst_whole, flux, worst_flux } = found;
            let what = format!("{squares:.5} squares, at most {worst:.5}, {over:.4} over {error}; {wholes:.5} wholes");
            assert!(squares < 0.8 * error, "{what}");
            assert!(over < 0.1, "{what}");
            // Errors add up in the main square, and a basis serves all positions: a few may be off by more.
            assert!(worst < 6.0 * error, "{what}");
            assert!(wholes < error && worst_whole < 4.0 * error, "{what}");
            assert!(flux.abs() < 0.02 * error, "{flux} of all light, {what}");
            assert!(worst_flux < 0.1 * error, "{worst_flux} of the light of a block at a position, {what}");
            let bytes = bytes_of(&field);
            assert!(squares < last.0 && bytes > last.1, "{what}, {bytes} bytes after {last:?}");
            last = (squares, bytes);
        }
        let halves: usize = 2 * world.halves.iter().map(Vec::len).sum::<usize>();
        assert!(last.1 < halves / 20, "{} bytes of {halves}", last.1);
    }
}

#[test]
fn even_the_smallest_error_is_reached_nearly() {
    let world = World::plane(4);
    let (_folder, field) = world.packed(1e-3);
    let Distance { squares, flux, .. } = distance(&world, &field, 1e-3);
    assert!(squares < 1e-3 && flux.abs() < 1e-4, "{squares}, {flux}");
    // Single precision is the end of it.
    let (_folder, field) = world.packed(1e-4);
    let Distance { squares, flux, .. } = distance(&world, &field, 1e-4);
    assert!(squares < 3e-4 && flux.abs() < 1e-4, "{squares}, {flux}");
}

#[test]
fn the_metadata_say_where_the_light_went() {
    let world = World::plane(8);
    let (_folder, field) = world.packed(0.03);
    let groups = Groups::new(8);
    let scale = f64::from(world.scale);
    let mut all = Kept::default();
    for (block, record) in blocks_of(&field).zip(field.block_records()) {
        let extent = field.blocks().block_extent(block);
        let packed = field.packed_block(block, |_| true).unwrap();
        assert_eq!(packed.rank, record.rank);
        let text =
            fs::read_to_string(field.path().join(format!("packed/{}-{}/zarr.json", block[0], block[1]))).unwrap();
        let group: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(group["attributes"]["block"], json!(record));
        let mut found = Kept::default();
        let plane = extent.pixels();
        for position in 0..POSITIONS {
            let expected = world.cut(position, &extent);
            let mut decoded = vec![f16::ZERO; expected.len()];
            packed.decode(position, &groups, world.scale, &mut decoded);
            let sum = |values: &[f16], at: usize| -> f64 {
                values.iter().skip(at).step_by(3 * plane).map(|half| half.to_f64() * scale).sum()
            };
            for at in 0..3 * plane {
                let whole = sum(&expected, at);
                found.whole += whole;
                found.power += whole * whole;
                found.residual += (whole - sum(&decoded, at)).powi(2);
            }
            for patch in 0..packed.patches.len() {
                let (rows, columns) = packed.patches.pixels(patch);
                let own: Vec<usize> = packed.atoms(position, patch).unwrap().map(|atom| usize::from(atom.id)).collect();
                for square in 0..64 {
                    let sum = |values: &[f16]| -> f64 {
                        let lines =
                            values[square * 3 * plane..][..3 * plane].chunks_exact(extent.columns.len()).enumerate();
                        let lines = lines.filter(|(line, _)| rows.contains(&(line % extent.rows.len())));
                        lines.flat_map(|(_, line)| &line[columns.clone()]).map(|half| half.to_f64() * scale).sum()
                    };
                    match own.iter().position(|id| *id == square) {
                        Some(0) => {}
                        Some(_) => found.squares += sum(&expected),
                        None => found.coarse += sum(&decoded),
                    }
                }
            }
        }
        let near = |name: &str, found: f64, said: f64, within: f64| {
            assert!((found / said - 1.0).abs() < within, "{name}: found {found}, but said is {said}");
        };
        near("whole", found.whole, record.kept.whole, 1e-5);
        near("power", found.power, record.kept.power, 1e-5);
        near("residual", found.residual, record.kept.residual, 0.02);
        near("squares", found.squares, record.kept.squares, 1e-3);
        near("coarse", found.coarse, record.kept.coarse, 1e-2);
        assert!(record.kept.squares + record.kept.coarse < record.kept.whole);
        all.add(&record.kept);
    }
    let [a, b] = field.block_records() else { panic!("two blocks") };
    assert_eq!(all.whole, a.kept.whole + b.kept.whole);
    let text = fs::read_to_string(field.path().join("zarr.json")).unwrap();
    let group: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(group["attributes"]["blocks"], json!([a, b]));
    assert_eq!(group["attributes"]["relumine"]["packing"], json!({ "error": 0.03 }));
}

#[test]
fn distant_lamps_and_darkness_survive() {
    // One square a position: all of it is its own main square.
    let lamps = Layout::Grid { azimuths: 5, tilts: 2 };
    let lit = |position: usize, _: usize, channel: usize, x: usize, y: usize| {
        let texture = 0.6 + 0.3 * ((x * y) as f64 * 0.3).sin();
        if position == 4 {
            0.0
        } else {
            1e-6 * texture * (1.0 + 0.5 * (position as f64 + 0.05 * x as f64 + channel as f64).sin())
        }
    };
    let world = World::new(lamps.clone(), Reach::Far, vec![vec![]; 10], lit);
    let (_folder, field) = world.packed(0.01);
    let found = distance(&world, &field, 0.01);
    assert!(found.worst < 0.02 && found.squares < 0.007, "{} {}", found.worst, found.squares);
    assert!(field.transfer(4).unwrap().pixels().iter().all(|pixel| *pixel == [0.0; 3]), "a lamp that shows nothing");

    let world = World::new(lamps, Reach::Far, vec![vec![]; 10], |_, _, _, _, _| 0.0);
    let (_folder, field) = world.packed(0.01);
    assert_eq!(field.verify().unwrap(), []);
    for cell in 0..10 {
        assert!(field.transfer(cell).unwrap().pixels().iter().all(|pixel| *pixel == [0.0; 3]));
    }
    assert_eq!(bytes_of(&field), 0);
}

#[test]
fn missing_squares_stay_missing_and_black_positions_black() {
    let world = World::plane(4);
    let (_folder, field) = world.packed(0.01);
    let missing: Vec<usize> = (0..field.cells().len()).filter(|cell| field.is_missing(*cell)).collect();
    assert_eq!(missing, [LOSSY * 16 + 1, LOSSY * 16 + 6]);
    for square in 0..16 {
        let picture = field.transfer(BLACK * 16 + square).unwrap();
        assert!(picture.pixels().iter().all(|pixel| *pixel == [0.0; 3]), "light where there was none");
    }
    assert_eq!(field.verify().unwrap(), []);
}

#[test]
fn all_ways_to_read_say_the_same() {
    for (squares, error) in [(4, 0.01), (8, 0.1)] {
        let world = World::plane(squares);
        let (_folder, field) = world.packed(error);
        let (groups, m2) = (Groups::new(squares), squares * squares);
        let mut buffer = BlockBuffer::new(&field.blocks()).unwrap();
        for position in [0, LOSSY, POSITIONS - 1] {
            let weights: Vec<[f32; 3]> =
                (0..m2).map(|square| [0.3, 1.0, 2.0].map(|w| w + (square % 5) as f32)).collect();
            let mut pictures = Vec::new();
            for square in 0..m2 {
                pictures.push(field.transfer(position * m2 + square).unwrap());
            }
            for block in blocks_of(&field) {
                let extent = field.blocks().block_extent(block);
                let plane = extent.pixels();
                let packed = field.packed_block(block, |wanted| wanted == position).unwrap();
                let mut values = Vec::new();
                field.squares_of_block(position, block, &mut buffer, &mut values).unwrap();
                let mut sum = vec![0.0f64; 3 * plane];
                packed.add_weighted(position, &groups, &weights, &mut sum);
                let brightest = values.iter().fold(0.0f32, |peak, half| peak.max(half.to_f32().abs())) * world.scale;
                for (at, sum) in sum.iter().enumerate() {
                    let (channel, pixel) = (at / plane, at % plane);
                    let x = extent.columns.start + pixel % extent.columns.len();
                    let y = extent.rows.start + pixel / extent.columns.len();
                    let mut of_squares = 0.0;
                    for (square, picture) in pictures.iter().enumerate() {
                        let half = values[square * 3 * plane + at].to_f32() * world.scale;
                        let transfer = picture.pixels()[y * SIZE[0] + x][channel];
                        // As halves, and single precision on the way there.
                        let within = transfer.abs() / 1024.0 + brightest * 1e-5;
                        assert!(
                            (half - transfer).abs() <= within,
                            "square {square} at {x}, {y}: {half} and {transfer}"
                        );
                        of_squares += f64::from(transfer) * f64::from(weights[square][channel]);
                    }
                    assert!((of_squares - sum).abs() <= f64::from(brightest) * 1e-4, "{of_squares} and {sum}");
                }
            }
        }
    }
}

#[test]
fn only_what_is_wanted_is_read() {
    let world = World::plane(4);
    let (_folder, field) = world.packed(0.05);
    let block = field.packed_block([0, 1], |position| position == 9).unwrap();
    assert!(block.atoms(0, 0).is_none() && block.atoms(9, 0).is_some());
    let whole = field.packed_block([0, 1], |_| true).unwrap();
    assert_eq!((&block.positions[9], &block.basis), (&whole.positions[9], &whole.basis));
}

#[test]
fn threads_do_not_change_a_bit() {
    let world = World::plane(4);
    let folder = tempfile::tempdir().unwrap();
    let [one, three] = [1, 3].map(|threads| {
        let path = folder.path().join(format!("{threads}.field"));
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| world.pack(&path, 0.02));
        tree(&path)
    });
    assert!(one == three);
}

#[test]
fn a_writer_that_was_dropped_goes_on_to_the_same_bits() {
    let world = World::plane(4);
    let folder = tempfile::tempdir().unwrap();
    let (whole, resumed) = (folder.path().join("whole.field"), folder.path().join("resumed.field"));
    world.pack(&whole, 0.02);
    let open = || FieldWriter::open(&resumed, world.packed_header(0.02), "plane", false).unwrap();
    let writer = open();
    assert_eq!(writer.remaining_blocks(), [[0, 0], [0, 1]]);
    world.pack_block(&writer, [0, 1], 0.02);
    world.finish_position(&writer, 3);
    drop(writer);
    // Torn: arrays without a record, a record cut off, and a temporary file are a block that is not done.
    let block = folder.path().join("resumed.field.partial/field/packed/0-0");
    fs::create_dir_all(&block).unwrap();
    fs::write(block.join("c.0.0"), "torn").unwrap();
    fs::write(block.join(".zarr.json.partial-1"), "torn").unwrap();
    fs::write(block.join("zarr.json"), "{\"zarr_format\": 3, \"node_type\": \"group\", \"attri").unwrap();
    let writer = open();
    assert_eq!(writer.remaining_blocks(), [[0, 0]]);
    world.pack_block(&writer, [0, 0], 0.02);
    world.finish(writer);
    assert!(tree(&resumed) == tree(&whole));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2, "something is left over");
}

#[test]
fn a_field_of_another_error_is_another_input() {
    let world = World::plane(4);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.field");
    let open = |error: f64| FieldWriter::open(&path, world.packed_header(error), "plane", false);
    world.pack_block(&open(0.1).unwrap(), [0, 0], 0.1);
    assert!(matches!(open(0.05), Err(FieldError::OtherUnfinished { .. })));
}

#[test]
fn a_field_with_blocks_to_pack_does_not_get_its_name() {
    let world = World::plane(4);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.field");
    let writer = FieldWriter::open(&path, world.packed_header(0.1), "plane", false).unwrap();
    world.pack_block(&writer, [0, 1], 0.1);
    (0..POSITIONS).for_each(|position| world.finish_position(&writer, position));
    let error = writer.finish().unwrap_err().to_string();
    assert!(error.contains("packed/0-0") && error.contains("not done") && !path.exists(), "{error}");
}

#[test]
fn sketches_that_waited_on_disk_give_the_same_bits() {
    let world = World::plane(8);
    let folder = tempfile::tempdir().unwrap();
    let (at_once, sketched) = (folder.path().join("whole.field"), folder.path().join("sketched.field"));
    world.pack(&at_once, 0.02);
    let open = || FieldWriter::open(&sketched, world.packed_header(0.02), "plane", false).unwrap();
    let write = |writer: &FieldWriter, position: usize| {
        for tile in writer.blocks().all_tiles() {
            let sketch = |extent: &Extent| (world.sketch(position, extent, 0.02), extent.columns.start);
            assert_eq!(writer.write_sketches(position, tile, sketch).unwrap(), [0, 38], "in the order of the blocks");
        }
        world.finish_position(writer, position);
    };
    let writer = open();
    (0..7).for_each(|position| write(&writer, position));
    assert!(matches!(writer.pack_sketched([0, 0]), Err(FieldError::Read { .. })), "a position has no sketch yet");
    drop(writer);
    let writer = open();
    assert_eq!(writer.remaining(), [7, 8, 9, 10, 11]);
    (7..POSITIONS).rev().for_each(|position| write(&writer, position));
    writer.pack_sketched([0, 1]).unwrap();
    drop(writer);
    let writer = open();
    assert_eq!(writer.remaining_blocks(), [[0, 0]]);
    // Packed once more after a position has changed back and forth: as if nothing had been.
    writer.forget_blocks().unwrap();
    assert_eq!(writer.remaining_blocks(), [[0, 0], [0, 1]]);
    for block in writer.remaining_blocks() {
        writer.pack_sketched(block).unwrap();
    }
    writer.finish().unwrap();
    assert!(tree(&sketched) == tree(&at_once));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2, "something is left over");
}

/// A block as far as it can be told apart.
fn block_as_read(block: &PackedBlock) -> impl PartialEq + use<> {
    let steps: Vec<u32> = block.steps.iter().map(|step| step.to_bits()).collect();
    (block.rank, block.basis.clone(), steps, block.positions.clone())
}

#[test]
fn a_flipped_bit_is_named_and_shows_no_other_light() {
    let world = World::plane(4);
    let (_folder, field) = world.packed(0.1);
    let path = field.path().to_path_buf();
    let read = |field: &ReflectanceField| -> Vec<_> {
        let blocks = blocks_of(field).map(|block| field.packed_block(block, |_| true));
        blocks.map(|block| block.map(|block| block_as_read(&block))).collect()
    };
    let whole = read(&field);
    let files = tree(&path);
    assert!(files.len() > 12);
    let mut silent = 0;
    for (name, bytes) in &files {
        // Every byte of what is small; otherwise some, and those of the end, where indices and checksums are.
        let offsets =
            (0..bytes.len()).filter(|at| bytes.len() < 100 || at + 36 >= bytes.len() || at % (bytes.len() / 40) == 3);
        let file: PathBuf = path.join(name);
        for at in offsets {
            let mut spoiled = bytes.clone();
            spoiled[at] ^= 1 << (at % 8);
            fs::write(&file, &spoiled).unwrap();
            match ReflectanceField::open(&path) {
                Err(error) => {
                    assert!(["zarr.json", "checksums.b3"].contains(&name.as_str()), "{name}: {error}");
                    assert!(error.to_string().contains("packed.field"), "{name}: {error}");
                }
                Ok(field) => {
                    match field.verify() {
                        Ok(damage) if name == "checksums.b3" => assert!(
                            !damage.is_empty() || spoiled.eq_ignore_ascii_case(bytes),
                            "byte {at} of {name} is not found"
                        ),
                        Ok(damage) => assert_eq!(damage, [Damage::Changed(name.into())]),
                        Err(error) => {
                            assert!(name == "checksums.b3" && error.to_string().contains("checksums.b3"), "{error}");
                        }
                    }
                    for (index, (found, whole)) in read(&field).into_iter().zip(&whole).enumerate() {
                        match (found, whole) {
                            (Ok(found), Ok(whole)) => assert!(found == *whole, "byte {at} of {name}: other light"),
                            (Err(error), _) => {
                                assert!(name.starts_with(&format!("packed/0-{index}/")), "{name}: {error}");
                                assert!(error.to_string().contains(name.as_str()), "{name}: {error}");
                            }
                            (Ok(_), Err(error)) => panic!("{error}"),
                        }
                        silent += 1;
                    }
                }
            }
        }
        fs::write(&file, bytes).unwrap();
    }
    assert!(silent > 500);
    assert_eq!(ReflectanceField::open(&path).unwrap().verify().unwrap(), []);
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
