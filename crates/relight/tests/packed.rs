//! Relighting of the packed encoding against the plain sum, and what a sum must be. `full_scale` times it:
//! `cargo test --release -p relumine-relight --test packed -- --ignored --nocapture`

#![allow(clippy::unwrap_used)] // in helpers of tests too

#[path = "../src/packed/synthetic.rs"]
mod synthetic;

use std::time::Instant;

use rayon::prelude::*;
use relumine_basis::Coefficients;
use relumine_field::packed::{Groups, PackedBlock};
use relumine_radiometry::{Image, Radiance, difference};
use relumine_relight::{
    Incremental, LightWeights, PackedError, ResidentBlock, ResidentPacked, Step, TOLERANCE, relight_block,
};
use synthetic::{Kind, Noise, Noisy};

/// Blocks cut at the right and below, odd sizes, lists of all kinds.
const WILD: Noisy = Noisy { picture: [91, 71], positions: 37, squares: 4, rank: [1, 30], kind: Kind::Wild };

fn resident(noisy: &Noisy, blocks: &[PackedBlock]) -> ResidentPacked {
    ResidentPacked::new(blocks.to_vec(), noisy.picture, noisy.positions, noisy.squares).unwrap()
}

/// Light of which one cell in `every` is lit.
fn light(noisy: &Noisy, seed: u64, every: usize) -> Coefficients {
    let mut noise = Noise(seed);
    let mut light = Coefficients::dark(noisy.squares, noisy.positions, 1);
    let chosen = light.values_mut().iter_mut().step_by(every);
    chosen.for_each(|value| *value = [noise.unit(), 2.0 * noise.unit(), 3.0 * noise.unit()]);
    light
}

fn only(light: &Coefficients, cells: std::ops::Range<usize>) -> Coefficients {
    let mut only = light.clone();
    let dark = only.values_mut().iter_mut().enumerate().filter(|(cell, _)| !cells.contains(cell));
    dark.for_each(|(_, value)| *value = [0.0; 3]);
    only
}

/// The plain version, in double precision.
fn plain(noisy: &Noisy, blocks: &[PackedBlock], light: &Coefficients) -> Image<Radiance> {
    let [width, height] = noisy.picture;
    let groups = Groups::new(noisy.squares);
    let m2 = noisy.squares * noisy.squares;
    let mut picture = Image::black(width, height);
    for block in blocks {
        let [block_height, block_width] = block.patches.block();
        let mut sum = vec![0.0; 3 * block_height * block_width];
        for (position, weights) in light.values().chunks_exact(m2).enumerate() {
            if weights.iter().any(|weight| *weight != [0.0; 3]) {
                block.add_weighted(position, &groups, weights, &mut sum);
            }
        }
        for (row, y) in block.extent.rows.clone().enumerate() {
            for (column, x) in block.extent.columns.clone().enumerate() {
                let value = |channel: usize| sum[(channel * block_height + row) * block_width + column] as f32;
                picture.pixels_mut()[y * width + x] = [value(0), value(1), value(2)];
            }
        }
    }
    picture
}

fn error(a: &Image<Radiance>, b: &Image<Radiance>) -> f64 {
    if a == b { 0.0 } else { difference(a, b, None, false).unwrap().relative_l2 }
}

fn assert_within(a: &Image<Radiance>, b: &Image<Radiance>, what: &str) {
    let error = error(a, b);
    assert!(error <= TOLERANCE, "{what}: relative L2 {error:e}");
}

#[test]
fn the_packed_sum_is_the_plain_sum() {
    let one_square = Noisy { picture: [20, 13], positions: 9, squares: 1, rank: [1, 12], kind: Kind::Wild };
    let long = Noisy { picture: [20, 13], positions: 10, squares: 3, rank: [150, 192], kind: Kind::Wild };
    let paper = Noisy { picture: [17, 15], positions: 224, squares: 16, rank: [20, 30], kind: Kind::Scene };
    let empty = Noisy { picture: [9, 9], positions: 3, squares: 2, rank: [0, 0], kind: Kind::Wild };
    for (index, noisy) in [WILD, one_square, long, paper, empty].iter().enumerate() {
        let blocks = noisy.blocks(index as u64);
        let field = resident(noisy, &blocks);
        let m2 = noisy.squares * noisy.squares;
        let all = light(noisy, 7, 1);
        let mut even = all.clone();
        even.values_mut().fill([0.7, 0.1, 3.0]);
        let mut smooth = all.clone();
        smooth.values_mut().iter_mut().for_each(|value| *value = value.map(|value| 1.0 + 0.001 * value));
        let lights = [
            ("all", all.clone()),
            ("even", even),
            ("nearly even", smooth),
            ("every fifth", light(noisy, 8, 5)),
            ("one position", only(&all, 2 * m2..3 * m2)),
            ("one cell", only(&all, 2 * m2..2 * m2 + 1)),
            ("none", only(&all, 0..0)),
        ];
        for (name, light) in lights {
            let picture = field.relight(&light).unwrap();
            assert_within(&picture, &plain(noisy, &blocks, &light), &format!("field {index}, {name}"));
            // Over an old picture as well.
            let mut over = Image::from_pixels(
                noisy.picture[0],
                noisy.picture[1],
                vec![[f32::NAN; 3]; noisy.picture[0] * noisy.picture[1]],
            );
            field.relight_into(&light, &mut over).unwrap();
            assert_eq!(over, picture);
        }
    }
}

#[test]
fn packed_pictures_have_the_same_bits_on_any_number_of_threads() {
    let field = resident(&WILD, &WILD.blocks(1));
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut incremental = Incremental::new(&field, &light(&WILD, 1, 1)).unwrap();
            incremental.update(&field, &light(&WILD, 2, 3)).unwrap();
            (field.relight(&light(&WILD, 3, 1)).unwrap(), incremental.picture().clone())
        })
    };
    let one = on(1);
    assert!(on(2) == one && on(7) == one);
}

#[test]
fn packed_pictures_add_as_lights_do() {
    let field = resident(&WILD, &WILD.blocks(2));
    let (a, b) = (light(&WILD, 1, 1), light(&WILD, 2, 4));
    let mut both = a.clone();
    for (sum, b) in both.values_mut().iter_mut().zip(b.values()) {
        (0..3).for_each(|channel| sum[channel] = 0.5 * sum[channel] + b[channel]);
    }
    let mut sum = field.relight(&b).unwrap();
    sum.add_scaled(&field.relight(&a).unwrap(), [0.5; 3]);
    assert_within(&field.relight(&both).unwrap(), &sum, "the sum");
}

#[test]
fn a_packed_block_as_read_gives_the_bits_of_one_in_memory() {
    let blocks = WILD.blocks(3);
    let field = resident(&WILD, &blocks);
    let all = light(&WILD, 4, 1);
    let few = only(&all, 9 * 16..11 * 16 + 3);
    let lights = [few.clone(), only(&all, 0..0), light(&WILD, 5, 50), all];
    let weights: Vec<LightWeights> = lights.iter().map(|light| field.weights(light).unwrap()).collect();
    let pictures: Vec<Image<Radiance>> = lights.iter().map(|light| field.relight(light).unwrap()).collect();
    for mut block in blocks {
        let shown = relight_block(&block, &weights).unwrap();
        // All positions of the first light.
        let lit = 9..12;
        block.positions.iter_mut().enumerate().filter(|(p, _)| !lit.contains(p)).for_each(|(_, atoms)| *atoms = None);
        assert_eq!(relight_block(&block, &weights[..2]).unwrap(), shown[..2]);
        assert_eq!(relight_block(&block, &weights).unwrap_err(), PackedError::Unread { position: 0 });
        for (shown, picture) in shown.iter().zip(&pictures) {
            for (row, y) in block.extent.rows.clone().enumerate() {
                for (column, x) in block.extent.columns.clone().enumerate() {
                    assert_eq!(shown.pixel(column, row), picture.pixel(x, y));
                }
            }
        }
    }
}

#[test]
fn packed_pictures_follow_a_moving_spot() {
    let noisy = Noisy { picture: [40, 30], positions: 30, squares: 6, rank: [5, 30], kind: Kind::Wild };
    let field = resident(&noisy, &noisy.blocks(4));
    for (name, around) in [("in the dark", 0.0), ("in dim light", 1e-3), ("in bright light", 1.0)] {
        let mut light = light(&noisy, 6, 1);
        light.values_mut().as_flattened_mut().iter_mut().for_each(|value| *value *= around);
        let still = light.clone();
        let mut incremental = Incremental::new(&field, &light).unwrap();
        assert_within(incremental.picture(), &field.relight(&light).unwrap(), name);
        let mut noise = Noise(9);
        let mut differences = 0;
        for step in 0..400 {
            light.clone_from(&still);
            let (position, square) = (noise.within(0, 28), noise.within(0, 25));
            // Mostly as bright as all the rest, at times much brighter: nothing of that may stay behind.
            let brightness = if step % 50 == 7 { 1e5 } else { 10.0 };
            for cell in (0..2).flat_map(|p| (0..10).map(move |s| (position + p) * 36 + square + s)) {
                light.values_mut()[cell] = [brightness, noise.unit(), brightness * noise.unit()];
            }
            let update = incremental.update(&field, &light).unwrap();
            differences += usize::from(!update.anew);
            if step % 9 == 0 || step % 50 == 8 {
                let what = format!("{name}, step {step}, {update:?}");
                assert_within(incremental.picture(), &field.relight(&light).unwrap(), &what);
            }
        }
        assert!(around == 0.0 || differences > 300, "{differences} updates took differences");
        let update = incremental.update(&field, &light).unwrap();
        assert_eq!((update.positions, update.patches), (0, 0));
        light.values_mut().fill([0.0; 3]);
        incremental.update(&field, &light).unwrap();
        assert_eq!(*incremental.picture(), Image::black(40, 30));
        assert_eq!(*incremental.light(), light);
    }
}

#[test]
fn packed_pictures_follow_a_spot_after_any_light_before_it() {
    // Few positions are lit: many patches then show their first components only.
    let noisy = Noisy { picture: [64, 60], positions: 40, squares: 6, rank: [5, 40], kind: Kind::Wild };
    let field = resident(&noisy, &noisy.blocks(14));
    let all = light(&noisy, 6, 1);
    let scenes = [0, 12, 25].map(|first| only(&all, first * 36..(first + 9) * 36));
    let mut incremental = Incremental::new(&field, &scenes[0]).unwrap();
    let mut noise = Noise(19);
    let mut ways = [0; 3];
    for step in 0..200 {
        // From time to time all is lit otherwise, and back again to what was.
        let mut light = scenes[(step / 5) % 2 + usize::from(step % 15 == 14)].clone();
        let position = noise.within(0, 38);
        light.values_mut()[position * 36 + noise.within(0, 35)] = [noise.unit(); 3];
        let update = incremental.update(&field, &light).unwrap();
        ways[if !update.anew {
            0
        } else if update.patches_anew == update.patches {
            1
        } else {
            2
        }] += 1;
        assert_within(incremental.picture(), &field.relight(&light).unwrap(), &format!("step {step}, {update:?}"));
    }
    assert!(ways[0] > 40 && ways[1] > 40 && ways[2] == 0, "{ways:?}");
}

#[test]
fn a_light_that_goes_out_leaves_nothing_behind_in_packed_pictures() {
    let field = resident(&WILD, &WILD.blocks(8));
    let dim = light(&WILD, 1, 1);
    let mut bright = dim.clone();
    bright.values_mut()[40] = [1e9; 3];
    let mut incremental = Incremental::new(&field, &bright).unwrap();
    let update = incremental.update(&field, &dim).unwrap();
    assert!(update.anew, "1e9 is too much for differences");
    assert_within(incremental.picture(), &field.relight(&dim).unwrap(), "gone out");
}

#[test]
fn packed_pictures_that_come_step_by_step_end_with_the_exact_one() {
    for noisy in [WILD, Noisy { kind: Kind::Scene, picture: [300, 250], positions: 9, rank: [8, 20], ..WILD }] {
        let field = resident(&noisy, &noisy.blocks(5));
        let light = light(&noisy, 1, 1);
        let exact = field.relight(&light).unwrap();
        let mut progressive = field.progressive(&light).unwrap();
        assert_eq!(progressive.next(), Some(Step::Coarse));
        assert!(progressive.picture().pixels().iter().any(|pixel| *pixel != [0.0; 3]));
        let of = noisy.extents().len();
        let mut before = 0;
        for step in progressive.by_ref() {
            let Step::Exact { blocks, of: all } = step else { panic!("coarse once") };
            assert!(blocks > before && blocks <= all && all == of);
            before = blocks;
        }
        assert_eq!(before, of);
        assert_eq!(*progressive.picture(), exact);
        assert_eq!(field.progressive(&light).unwrap().finish(), exact);
    }
    // Where a basis is short and light the same everywhere, the coarse picture is all there is.
    let noisy = Noisy { rank: [1, 8], ..WILD };
    let field = resident(&noisy, &noisy.blocks(6));
    let mut even = light(&noisy, 1, 1);
    even.values_mut().fill([1.0, 0.5, 0.25]);
    let mut progressive = field.progressive(&even).unwrap();
    progressive.next();
    assert_within(progressive.picture(), &field.relight(&even).unwrap(), "coarse under even light");
}

#[test]
fn packed_blocks_that_do_not_fit_are_refused() {
    let blocks = WILD.blocks(7);
    let new = |blocks: Vec<PackedBlock>, picture, positions, squares| {
        ResidentPacked::new(blocks, picture, positions, squares).map(|_| ()).unwrap_err()
    };
    assert_eq!(new(blocks.clone(), [90, 71], 37, 4), PackedError::Misplaced { column: 64, row: 0 });
    assert_eq!(
        new([&blocks[..], &blocks[..1]].concat(), [91, 71], 37, 4),
        PackedError::Misplaced { column: 0, row: 0 }
    );
    assert_eq!(new(blocks.clone(), [91, 71], 38, 4), PackedError::Positions { expected: 38, found: 37 });
    assert!(matches!(new(blocks.clone(), [91, 71], 37, 3), PackedError::NoSuchSquare { ids: 18, .. }));
    let mut unread = blocks.clone();
    unread[2].positions[8] = None;
    assert_eq!(new(unread, [91, 71], 37, 4), PackedError::Unread { position: 8 });
    let mut torn = blocks.clone();
    torn[0].steps.pop();
    assert!(matches!(new(torn, [91, 71], 37, 4), PackedError::Shape { .. }));
    let field = resident(&WILD, &blocks);
    let other = Coefficients::dark(4, 36, 1);
    assert_eq!(field.relight(&other).unwrap_err(), PackedError::OtherCells { expected: 592, found: 576 });
    assert!(Incremental::new(&field, &other).is_err());
}

/// Milliseconds of the fastest of some runs, their median, and the processor time of a run on each of two cores, which other
/// programs on the machine disturb less.
fn time(runs: usize, mut run: impl FnMut()) -> [f64; 3] {
    let processor_time = || -> f64 {
        let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
        let fields = stat.rsplit(')').next().unwrap_or_default().split_whitespace();
        fields.skip(11).take(2).map(|ticks| ticks.parse::<f64>().unwrap() * 10.0).sum()
    };
    let before = processor_time();
    let mut times: Vec<f64> = (0..runs)
        .map(|_| {
            let start = Instant::now();
            run();
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    let spent = (processor_time() - before) / 2.0 / runs as f64;
    times.sort_by(f64::total_cmp);
    [times[0], times[runs / 2], spent]
}

#[test]
#[ignore = "takes gigabytes and a minute; for timing with --release"]
fn full_scale() {
    let noisy = Noisy { picture: [1440, 960], positions: 224, squares: 16, rank: [20, 30], kind: Kind::Scene };
    let start = Instant::now();
    let blocks: Vec<ResidentBlock> = noisy
        .extents()
        .into_par_iter()
        .map(|extent| ResidentBlock::new(&noisy.block(extent, 1), noisy.squares).unwrap())
        .collect();
    let field = ResidentPacked::from_resident(blocks, noisy.picture, noisy.positions, noisy.squares).unwrap();
    let bytes = field.bytes();
    println!(
        "{} blocks, {:.1} MB, made in {:.1} s",
        noisy.extents().len(),
        bytes as f64 / 1e6,
        start.elapsed().as_secs_f64()
    );
    let show = |what: &str, [best, median, spent]: [f64; 3]| {
        println!("{what:<44} {best:7.2} ms, median {median:7.2}, processor time of two cores {spent:7.2}");
    };
    let words = vec![1u64; bytes / 8];
    let read = || words.par_chunks(1 << 16).map(|words| words.iter().fold(0, |sum: u64, word| sum.wrapping_add(*word)));
    show("reading as many bytes", time(20, || assert!(read().sum::<u64>() > 0)));
    let mut picture = Image::black(1440, 960);
    let all = light(&noisy, 1, 1);
    show("weights of all", time(20, || drop(field.weights(&all).unwrap())));
    show("all cells", time(50, || field.relight_into(&all, &mut picture).unwrap()));
    show("all cells, another picture", time(50, || drop(field.relight(&all).unwrap())));
    let some = |positions: usize| {
        let mut some = all.clone();
        let dark =
            some.values_mut().chunks_exact_mut(256).enumerate().filter(|(p, _)| p % 5 > 0 || *p >= 5 * positions);
        dark.for_each(|(_, values)| values.fill([0.0; 3]));
        some
    };
    for positions in [1, 2, 8, 16] {
        let light = some(positions);
        show(&format!("{positions} positions"), time(200, || field.relight_into(&light, &mut picture).unwrap()));
    }
    let spot = |light: &mut Coefficients, step: usize, radiance: f32| {
        for cell in (0..2).flat_map(|p| (0..10).map(move |s| ((40 + p) * 16 + s / 5 + 3) * 16 + s % 5 + step % 10)) {
            light.values_mut()[cell] = [radiance, 0.5 * radiance, radiance];
        }
    };
    let spot_light = only(&all, 0..0);
    for (name, around) in [("in the dark", spot_light), ("in light from all cells", all.clone())] {
        let mut light = around.clone();
        spot(&mut light, 0, 1.0);
        show(&format!("a spot {name}, full"), time(200, || field.relight_into(&light, &mut picture).unwrap()));
        let mut incremental = Incremental::new(&field, &light).unwrap();
        let (mut step, mut update) = (0, None);
        let run = || {
            step += 1;
            light.clone_from(&around);
            spot(&mut light, step, 1.0);
            update = Some(incremental.update(&field, &light).unwrap());
        };
        show(&format!("a spot moves {name}"), time(200, run));
        println!("    {update:?}, relative L2 {:e}", error(incremental.picture(), &field.relight(&light).unwrap()));
    }
    show("the coarse picture", time(50, || assert!(field.progressive(&all).unwrap().next().is_some())));
    let mut progressive = field.progressive(&all).unwrap();
    progressive.next();
    let coarse = progressive.picture().clone();
    progressive.by_ref().for_each(drop);
    println!("    the coarse picture: relative L2 {:.3}", error(&coarse, progressive.picture()));
    assert_eq!(*progressive.picture(), field.relight(&all).unwrap());
    let block = noisy.block(noisy.extents()[30].clone(), 1);
    let weights = [field.weights(&all).unwrap()];
    show("one block as read", time(20, || drop(relight_block(&block, &weights).unwrap())));
}
