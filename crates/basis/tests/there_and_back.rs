//! Every mapping is sent home again, and measures add up to what geometry says.

#![allow(clippy::unwrap_used)] // in helpers of tests too

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use relumine_basis::{Cell, Cells, Entry, Layout, Partition, Pattern, Position, Reach};

fn seeded() -> ProptestConfig {
    ProptestConfig { rng_seed: RngSeed::Fixed(2003), cases: 300, ..Default::default() }
}

fn near_cells(layout: Layout, squares: usize) -> Cells {
    let reach = Reach::Near { radius_m: 4.0, pattern: Pattern::new(squares, 0.3).unwrap() };
    Cells::new(Partition::new(layout).unwrap(), reach).unwrap()
}

/// Directions spread evenly over the hemisphere (Fibonacci).
fn spread(count: usize) -> Vec<Position> {
    (0..count)
        .map(|i| {
            let z = 1.0 - (i as f64 + 0.5) / count as f64;
            Position { azimuth: (i as f64 * 2.399_963).rem_euclid(TAU), tilt: z.acos() }
        })
        .collect()
}

proptest! {
    #![proptest_config(seeded())]

    #[test]
    fn a_position_is_where_its_direction_points(azimuth in 0.0..TAU, tilt in 0.001..PI / 2.0) {
        let home = Position::from_direction(Position { azimuth, tilt }.direction());
        prop_assert!((home.azimuth - azimuth).abs() < 1e-9 && (home.tilt - tilt).abs() < 1e-9);
    }

    #[test]
    fn projector_coordinates_go_there_and_back(
        azimuth in 0.0..TAU, tilt in 0.0..PI / 2.0, s in -3.0..3.0f64, t in -3.0..3.0f64,
    ) {
        let frame = Position { azimuth, tilt }.frame();
        prop_assert!(frame.right.cross(frame.up).distance(frame.outward) < 1e-12, "right-handed");
        let direction = frame.world_from_projector(s, t);
        prop_assert!((direction.length() - 1.0).abs() < 1e-12);
        let (s2, t2) = frame.projector_from_world(direction).unwrap();
        prop_assert!((s - s2).abs() < 1e-9 && (t - t2).abs() < 1e-9);
        prop_assert!(frame.projector_from_world(-direction).is_none(), "nothing shines backwards");
    }

    #[test]
    fn a_point_of_a_square_lies_in_it(
        m in 1usize..40, h in 0.01..5.0f64, u in 0usize..40, v in 0usize..40, a in 0.01..0.99f64, b in 0.01..0.99f64,
    ) {
        let pattern = Pattern::new(m, h).unwrap();
        let (u, v) = (u % m, v % m);
        let (s, t) = pattern.point_in_square(u, v, a, b);
        prop_assert_eq!(pattern.square_at(s, t), Some((u, v)));
        prop_assert_eq!(pattern.square_at(s + 2.0 * h, t), None);
    }

    #[test]
    fn a_cell_has_one_index(azimuths in 1usize..7, tilts in 1usize..5, m in 1usize..9, pick in 0usize..10_000) {
        let cells = near_cells(Layout::Grid { azimuths, tilts }, m);
        let index = pick % cells.len();
        prop_assert_eq!(cells.index(cells.cell(index)), index);
    }

    #[test]
    fn a_ray_from_a_cell_enters_through_it(
        grid in any::<bool>(), pick in 0usize..100_000,
        a in 0.001..0.999f64, b in 0.001..0.999f64, c in 0.01..0.99f64, d in 0.01..0.99f64, further in 0.0..20.0f64,
    ) {
        let layout = if grid { Layout::Grid { azimuths: 12, tilts: 4 } } else { Layout::List(spread(37)) };
        let cells = near_cells(layout, 8);
        let Cell { position, u, v } = cells.cell(pick % cells.len());
        let outward = cells.partition().sample(position, a, b);
        prop_assert_eq!(cells.partition().owner(outward), position);
        let Reach::Near { radius_m, pattern } = cells.reach() else { unreachable!() };
        let (s, t) = pattern.point_in_square(u, v, c, d);
        let direction = Position::from_direction(outward).frame().world_from_projector(s, t);
        // Wherever on the line the light is seen, outside the hemisphere, in it or beyond: it came in here.
        let seen = radius_m * outward + (further - 10.0) * direction;
        match cells.entry(seen, direction) {
            Entry::Square { outward: entered, u: entered_u, v: entered_v } => {
                prop_assert!(entered.distance(outward) < 1e-9);
                prop_assert_eq!((entered_u, entered_v), (u, v));
            }
            other => prop_assert!(false, "{:?}", other),
        }
    }

    #[test]
    fn shares_between_positions_add_to_one(grid in any::<bool>(), azimuth in 0.0..TAU, tilt in 0.0..PI / 2.0) {
        let layout = if grid { Layout::Grid { azimuths: 12, tilts: 4 } } else { Layout::List(spread(37)) };
        let partition = Partition::new(layout).unwrap();
        let shares = partition.between(Position { azimuth, tilt }.direction());
        let sum: f64 = shares.shares().iter().map(|(_, share)| share).sum();
        prop_assert!((sum - 1.0).abs() < 1e-12 && shares.shares().iter().all(|(_, share)| *share > 0.0));
    }

    #[test]
    fn a_mosaic_goes_there_and_back(azimuths in 1usize..6, tilts in 1usize..4, m in 1usize..5, seed in any::<u32>()) {
        let cells = near_cells(Layout::Grid { azimuths, tilts }, m);
        let mut light = cells.dark();
        for (i, value) in light.values_mut().iter_mut().enumerate() {
            *value = [i as f32, (seed % 97) as f32, -(i as f32)];
        }
        let (width, height) = light.mosaic_size();
        prop_assert_eq!((width, height), (azimuths * m, tilts * m));
        let mut home = cells.dark();
        home.set_mosaic(width, height, &light.to_mosaic()).unwrap();
        prop_assert_eq!(&home, &light);
        prop_assert!(home.set_mosaic(width + 1, height, &light.to_mosaic()).is_err());
    }
}

#[test]
fn at_a_captured_position_all_goes_to_it() {
    for layout in [Layout::Grid { azimuths: 12, tilts: 4 }, Layout::List(spread(37))] {
        let partition = Partition::new(layout).unwrap();
        for (index, position) in partition.positions().iter().enumerate() {
            assert_eq!(partition.owner(position.direction()), index);
            let shares = partition.between(position.direction());
            let own = shares.shares().iter().find(|(p, _)| *p == index).map_or(0.0, |(_, share)| *share);
            assert!((own - 1.0).abs() < 1e-9, "position {index} keeps {own}");
        }
    }
}

#[test]
fn patches_cover_the_hemisphere_and_squares_the_pattern() {
    for layout in
        [Layout::Grid { azimuths: 12, tilts: 4 }, Layout::Grid { azimuths: 1, tilts: 1 }, Layout::List(spread(37))]
    {
        let cells = near_cells(layout, 8);
        let whole: f64 = (0..cells.positions()).map(|p| cells.partition().solid_angle(p)).sum();
        assert!((whole / TAU - 1.0).abs() < 1e-9);
        // Σ |Ωᵢ| = 2πR² · ∫ cos⁴a over the pattern.
        let pattern = Pattern::new(1, 0.3).unwrap().projected_solid_angle(0, 0);
        let measure: f64 = (0..cells.len()).map(|cell| cells.measure(cell)).sum();
        assert!((measure / (TAU * 16.0 * pattern) - 1.0).abs() < 1e-9);
    }
}

#[test]
fn the_mosaic_of_a_grid_is_the_figure_of_the_paper() {
    let cells = near_cells(Layout::Grid { azimuths: 3, tilts: 2 }, 2);
    let mut light = cells.dark();
    // Position 4 stands at column 1, row 1; its square u = 1, v = 0.
    light.values_mut()[cells.index(Cell { position: 4, u: 1, v: 0 })] = [1.0; 3];
    let (width, _) = light.mosaic_size();
    let lit = light.to_mosaic().iter().position(|pixel| *pixel != [0.0; 3]);
    assert_eq!(lit, Some(2 * width + 3));
}

#[test]
fn impossible_geometry_is_refused_with_its_name() {
    let message = |result: Result<Cells, relumine_basis::BasisError>| result.err().unwrap().to_string();
    let pattern = Pattern::new(4, 0.3).unwrap();
    let cells = |layout, radius_m| {
        Partition::new(layout).and_then(|partition| Cells::new(partition, Reach::Near { radius_m, pattern }))
    };
    assert!(message(cells(Layout::Grid { azimuths: 0, tilts: 4 }, 1.0)).contains("azimuths × tilts"));
    assert!(message(cells(Layout::Grid { azimuths: usize::MAX, tilts: 2 }, 1.0)).contains("65536"));
    assert!(message(cells(Layout::Grid { azimuths: 2, tilts: 2 }, f64::NAN)).contains("radius_m"));
    assert!(message(cells(Layout::List(vec![]), 1.0)).contains("positions_deg"));
    assert!(message(cells(Layout::List(vec![Position::from_degrees(0.0, 100.0)]), 1.0)).contains("tilt of 0 to 90"));
    let twice = vec![Position::from_degrees(10.0, 20.0); 2];
    assert!(message(cells(Layout::List(twice), 1.0)).contains("do not divide the hemisphere"));
    assert!(Pattern::new(0, 0.3).is_err() && Pattern::new(8, -1.0).is_err() && Pattern::new(8, f64::NAN).is_err());
    assert_eq!(DVec3::Z, Position { azimuth: 0.0, tilt: 0.0 }.direction());
}
