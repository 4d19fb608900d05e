//! The fast sum against the plain one, and what a sum must be: linear, the same on any number of threads.

#![allow(clippy::unwrap_used)] // in helpers of tests too

use std::path::Path;

use half::f16;
use relumine_basis::{Cells, Coefficients, Layout, Partition, Pattern, Reach};
use relumine_field::{FieldWriter, Header, PositionRecord, ReflectanceField};
use relumine_radiometry::{Image, Radiance, difference};
use relumine_relight::{RelightError, Relighting, ResidentField, TOLERANCE, missing_share, relight_reference};
use serde_json::json;

/// A field of noise with holes: 35 positions of 3 × 3 squares, 90 × 70 pixels.
fn noisy_field(path: &Path) -> ReflectanceField {
    let reach = Reach::Near { radius_m: 2.0, pattern: Pattern::new(3, 0.3).unwrap() };
    let cells = Cells::new(Partition::new(Layout::Grid { azimuths: 7, tilts: 5 }).unwrap(), reach).unwrap();
    let writer = FieldWriter::open(path, Header::new(&cells, [90, 70], None, json!({})), "", false).unwrap();
    let mut state = 1u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1u64 << 24) as f32
    };
    for position in 0..35 {
        for tile in writer.blocks().all_tiles() {
            let pixels = writer.blocks().tile_extent(tile).pixels();
            let mut values = Vec::new();
            for _square in 0..9 {
                let lit = next() > 0.3;
                values.extend((0..3 * pixels).map(|_| if lit { f16::from_f32(next() * 1000.0) } else { f16::ZERO }));
            }
            writer.write_tile(position, tile, &values).unwrap();
        }
        let missing = if position == 2 { vec![0, 4] } else { vec![] };
        let record = PositionRecord { position, scale: 2f32.powi(position as i32 - 20), missing, report: json!({}) };
        writer.finish_position(record, &[]).unwrap();
    }
    writer.finish().unwrap();
    ReflectanceField::open(path).unwrap()
}

fn light(field: &ReflectanceField, seed: usize, every: usize) -> Coefficients {
    let mut light = field.cells().dark();
    for (cell, value) in light.values_mut().iter_mut().enumerate().filter(|(cell, _)| cell % every == 0) {
        *value = [0, 1, 2].map(|channel| ((cell * 31 + seed * 17 + channel * 7) % 101) as f32 / 50.0);
    }
    light
}

fn assert_within(a: &Image<Radiance>, b: &Image<Radiance>, tolerance: f64, what: &str) {
    let error = difference(a, b, None, false).unwrap().relative_l2;
    assert!(error <= tolerance, "{what}: relative L2 {error:e}");
}

#[test]
fn the_fast_sum_is_the_plain_sum() {
    let folder = tempfile::tempdir().unwrap();
    let field = noisy_field(&folder.path().join("field"));
    // All cells, some cells, one position, one cell: long reads and short ones.
    let mut one_cell = field.cells().dark();
    one_cell.values_mut()[100] = [1.0, 0.0, 0.5];
    let mut one_position = field.cells().dark();
    one_position.values_mut()[27..36].fill([0.3; 3]);
    let lights = [light(&field, 1, 1), light(&field, 2, 5), one_position, one_cell];
    let fast = Relighting::new(&field, &lights).unwrap().run().unwrap();
    for (index, (light, fast)) in lights.iter().zip(&fast).enumerate() {
        let plain = relight_reference(&field, light).unwrap();
        assert_within(fast, &plain, TOLERANCE, &format!("light {index}"));
        // Alone or together with others, from disk or from memory: the same sum.
        let alone = Relighting::new(&field, std::slice::from_ref(light)).unwrap().run().unwrap();
        assert_within(&alone[0], &plain, TOLERANCE, &format!("light {index} alone"));
    }
    let resident = ResidentField::load(ReflectanceField::open(field.path()).unwrap()).unwrap();
    assert!(resident.bytes() > 0);
    assert_eq!(Relighting::new(&resident, &lights).unwrap().run().unwrap(), fast);
}

#[test]
fn relit_pictures_add_as_lights_do() {
    let folder = tempfile::tempdir().unwrap();
    let field = noisy_field(&folder.path().join("field"));
    let (a, b) = (light(&field, 1, 1), light(&field, 2, 3));
    let mut both = a.clone();
    for (sum, term) in both.values_mut().iter_mut().zip(b.values()) {
        (0..3).for_each(|channel| sum[channel] += term[channel]);
    }
    let mut pictures = Relighting::new(&field, &[a, b, both]).unwrap().run().unwrap();
    let (of_both, of_b) = (pictures.pop().unwrap(), pictures.pop().unwrap());
    let mut sum = pictures.pop().unwrap();
    sum.add_scaled(&of_b, [1.0; 3]);
    assert_within(&sum, &of_both, 1e-6, "A + B");
}

#[test]
fn the_number_of_threads_does_not_change_a_bit() {
    let folder = tempfile::tempdir().unwrap();
    let field = noisy_field(&folder.path().join("field"));
    let lights = [light(&field, 3, 1)];
    let with_threads = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Relighting::new(&field, &lights).unwrap().run().unwrap())
    };
    assert_eq!(with_threads(1), with_threads(7));
}

#[test]
fn no_light_is_black_and_a_light_for_other_cells_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let field = noisy_field(&folder.path().join("field"));
    let dark = [field.cells().dark()];
    let black = Relighting::new(&field, &dark).unwrap().run().unwrap();
    assert!(black[0].pixels().iter().all(|pixel| *pixel == [0.0; 3]));
    let other = [Coefficients::dark(2, 7, 5)];
    assert!(matches!(Relighting::new(&field, &other), Err(RelightError::OtherCells { expected: 315, found: 140 })));
}

#[test]
fn light_on_missing_cells_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let field = noisy_field(&folder.path().join("field"));
    let mut light = field.cells().dark();
    light.values_mut()[2 * 9 + 4] = [1.0; 3];
    assert_eq!(missing_share(&field, &light), 1.0);
    light.values_mut()[2 * 9 + 5] = [1.0; 3];
    let share = missing_share(&field, &light);
    assert!(share > 0.4 && share < 0.6, "{share}");
    assert_eq!(missing_share(&field, &field.cells().dark()), 0.0);
}
