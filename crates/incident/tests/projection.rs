//! Claims about light on cells.

#![allow(clippy::unwrap_used)] // in helpers of tests too

use std::path::Path;

use relumine_basis::{Cell, Cells, Layout, Partition, Pattern, Position, Reach};
use relumine_incident::{Options, Projected, Reconstruction, project};
use relumine_lamp::Light;

fn chess_like(squares: usize) -> Cells {
    let reach = Reach::Near { radius_m: 4.0, pattern: Pattern::new(squares, 0.3).unwrap() };
    Cells::new(Partition::new(Layout::Grid { azimuths: 12, tilts: 4 }).unwrap(), reach).unwrap()
}

fn dome() -> Cells {
    let positions = (0..40)
        .map(|i| Position { azimuth: f64::from(i) * 2.4, tilt: (1.0 - (f64::from(i) + 0.5) / 45.0).acos() })
        .collect();
    Cells::new(Partition::new(Layout::List(positions)).unwrap(), Reach::Far).unwrap()
}

fn light(text: &str) -> Light {
    Light::parse(Path::new("l.toml"), &format!("format = \"relumine-light/1\"\n{text}")).unwrap()
}

fn options(between: Reconstruction) -> Options {
    Options { between, samples: 1 << 17, ..Options::default() }
}

fn projected(text: &str, cells: &Cells, between: Reconstruction) -> Projected {
    project(&light(text), cells, &options(between)).unwrap()
}

const SPOT: &str = "[[spot]]\nposition = [-1.7, -2.9, 3.7]\ntarget = [-0.2, 0, 0.2]\nintensity_w_sr = [30, 24, 15]\n\
                    beam_half_angle_deg = 4\ncutoff_half_angle_deg = 5.5\n";
const SUN: &str = "[[sun]]\ndirection = [0.5, 0.6, -0.64]\nirradiance_w_m2 = [3, 2.8, 2.4]\n";

#[test]
fn under_a_constant_sky_every_cell_that_looks_down_has_coefficient_one() {
    let cells = chess_like(8);
    let box_ = projected("[environment]\nradiance = [1, 1, 1]\n", &cells, Reconstruction::Box);
    for cell in 0..cells.len() {
        let value = box_.coefficients.values()[cell][0];
        let Cell { position, v, .. } = cells.cell(cell);
        // Rays of the upper squares of the lowest ring rise: what comes from below the horizon is not sky.
        if position / 12 < 3 || v >= 4 {
            assert!((value - 1.0).abs() < 1e-5, "cell {cell}: {value}");
        } else if v == 0 {
            assert!(value > 0.0 && value < 0.9, "cell {cell}: {value}");
        }
    }
    let far = projected("[environment]\nradiance = [1, 1, 1]\n", &dome(), Reconstruction::Box);
    assert!(far.coefficients.values().iter().all(|value| (value[1] - 1.0).abs() < 1e-6));
    assert!((far.flux[0] / std::f64::consts::TAU - 1.0).abs() < 1e-6);
}

#[test]
fn flux_is_the_same_whatever_happens_between_positions() {
    for cells in [chess_like(8), dome()] {
        for text in [SPOT, SUN, "[environment]\nradiance = [1, 2, 3]\n"] {
            let [a, b] = [Reconstruction::Box, Reconstruction::Linear].map(|r| projected(text, &cells, r).flux);
            for channel in 0..3 {
                assert!(a[channel] > 0.0 && (a[channel] / b[channel] - 1.0).abs() < 1e-5, "{text}: {a:?} {b:?}");
            }
        }
    }
}

#[test]
fn a_spot_inside_the_hemispheres_view_keeps_all_its_flux() {
    // Intensity × solid angle: full to 4°, then linear to 5.5°.
    let (beam, cutoff) = (4f64.to_radians(), 5.5f64.to_radians());
    let n = 100_000;
    let expected: f64 = (0..n)
        .map(|i| {
            let angle = (f64::from(i) + 0.5) / f64::from(n) * cutoff;
            let fall = ((cutoff - angle) / (cutoff - beam)).min(1.0);
            30.0 * fall * std::f64::consts::TAU * angle.sin() * cutoff / f64::from(n)
        })
        .sum();
    let found = projected(SPOT, &chess_like(8), Reconstruction::Linear);
    assert!((found.flux[0] / expected - 1.0).abs() < 2e-3, "{} against {expected}", found.flux[0]);
    assert_eq!(found.lost.outside_pattern, 0.0);
}

#[test]
fn a_sun_at_the_object_has_the_flux_of_its_beam() {
    // Within a ball of 1 m, all of it covered: E π r².
    let cells = chess_like(8);
    let within = Options { object_radius_m: Some(1.0), ..options(Reconstruction::Box) };
    let found = project(&light(SUN), &cells, &within).unwrap();
    assert!((found.flux[0] / (3.0 * std::f64::consts::PI) - 1.0).abs() < 2e-3, "{}", found.flux[0]);
    assert_eq!(found.lost.below_horizon, 0.0);
    // From below it cannot come.
    let from_below = light("[[sun]]\ndirection = [0, 0, 1]\nirradiance_w_m2 = [1, 1, 1]\n");
    let lost = project(&from_below, &cells, &within).unwrap();
    assert_eq!((lost.flux, lost.lost.below_horizon), ([0.0; 3], 1.0));
    // A ball that the pattern does not cover loses light, and the loss is said.
    let too_large = Options { object_radius_m: Some(1.5), ..options(Reconstruction::Box) };
    assert!(project(&light(SUN), &cells, &too_large).unwrap().lost.outside_pattern > 0.1);
}

#[test]
fn a_sun_from_a_dome_lamp_is_that_lamp_alone() {
    let cells = dome();
    let towards = cells.partition().positions()[17].direction();
    let text =
        format!("[[sun]]\ndirection = [{}, {}, {}]\nirradiance_w_m2 = [2, 2, 2]\n", -towards.x, -towards.y, -towards.z);
    for between in [Reconstruction::Box, Reconstruction::Linear] {
        let found = projected(&text, &cells, between);
        for (cell, value) in found.coefficients.values().iter().enumerate() {
            let expected = if cell == 17 { 2.0 / cells.measure(17) } else { 0.0 };
            assert!((f64::from(value[0]) - expected).abs() < 1e-5 * expected.max(1.0), "{between:?}, cell {cell}");
        }
    }
}

#[test]
fn moving_the_object_is_moving_the_light_the_other_way() {
    let cells = chess_like(8);
    let moved = format!("{SPOT}[placement]\ntranslate_m = [0.3, -0.2, 0.1]\nrotate_deg = 30\n");
    let (sine, cosine) = 30f64.to_radians().sin_cos();
    let back = |p: [f64; 3]| {
        let (x, y) = (p[0] - 0.3, p[1] + 0.2);
        format!("[{}, {}, {}]", cosine * x + sine * y, cosine * y - sine * x, p[2] - 0.1)
    };
    let by_hand =
        SPOT.replace("[-1.7, -2.9, 3.7]", &back([-1.7, -2.9, 3.7])).replace("[-0.2, 0, 0.2]", &back([-0.2, 0.0, 0.2]));
    assert_close(
        &projected(&moved, &cells, Reconstruction::Linear),
        &projected(&by_hand, &cells, Reconstruction::Linear),
        1e-5,
    );
    // A quarter turn of a sky is three positions of twelve.
    let folder = std::env::temp_dir().join(format!("relumine-sky-{}.exr", std::process::id()));
    let sky = relumine_radiometry::Image::<relumine_radiometry::Radiance>::from_pixels(
        24,
        12,
        (0..288)
            .map(|i| [1.0 + (i as f32 % 24.0 * std::f32::consts::TAU / 24.0).cos(), (i / 24) as f32, 1.0])
            .collect(),
    );
    relumine_radiometry::files::write_exr(&folder, &sky, relumine_radiometry::files::ExrSample::Float, &[]).unwrap();
    let map = format!("[environment]\nmap = \"{}\"\n", folder.display());
    let fine = Options { samples: 1 << 20, ..options(Reconstruction::Box) };
    let straight = project(&light(&map), &cells, &fine).unwrap();
    let turned = project(&light(&format!("{map}[placement]\nrotate_deg = 90\n")), &cells, &fine).unwrap();
    std::fs::remove_file(&folder).unwrap();
    let mut by_hand = straight.clone();
    for cell in 0..cells.len() {
        let Cell { position, u, v } = cells.cell(cell);
        let (ring, azimuth) = (position / 12, position % 12);
        let from = cells.index(Cell { position: ring * 12 + (azimuth + 3) % 12, u, v });
        by_hand.coefficients.values_mut()[cell] = straight.coefficients.values()[from];
    }
    // Noise of samples; turned the wrong way the relative L2 is about one.
    assert_close(&turned, &by_hand, 0.04);
}

fn assert_close(a: &Projected, b: &Projected, tolerance: f64) {
    let (mut error, mut energy) = (0.0, 0.0);
    for (a, b) in a.coefficients.values().iter().zip(b.coefficients.values()) {
        for channel in 0..3 {
            error += f64::from(a[channel] - b[channel]).powi(2);
            energy += f64::from(b[channel]).powi(2);
        }
    }
    assert!(energy > 0.0 && (error / energy).sqrt() <= tolerance, "relative L2 {}", (error / energy).sqrt());
}

#[test]
fn light_that_varies_in_space_is_the_same_everywhere_as_a_light_map() {
    let cells = chess_like(8);
    let map = Options { light_map: true, ..options(Reconstruction::Box) };
    // A sun is a light map already.
    let sun = light(SUN);
    assert_close(&project(&sun, &cells, &map).unwrap(), &projected(SUN, &cells, Reconstruction::Box), 0.02);
    // A point lamp becomes the sun that it looks like from the centre.
    let lamp = light("[[point]]\nposition = [0, -2, 2]\nintensity_w_sr = [8, 8, 8]\n");
    let same = light("[[sun]]\ndirection = [0, 1, -1]\nirradiance_w_m2 = [1, 1, 1]\n");
    assert_close(&project(&lamp, &cells, &map).unwrap(), &project(&same, &cells, &map).unwrap(), 1e-5);
    // A spot that misses the centre lights nothing.
    let aside = SPOT.replace("target = [-0.2, 0, 0.2]", "target = [0.8, 0, 0.2]");
    assert_eq!(project(&light(&aside), &cells, &map).unwrap().flux, [0.0; 3]);
}

#[test]
fn a_lamp_outside_that_shines_away_lights_nothing() {
    let away =
        "[[rectangle]]\ncorner = [1.3, -0.2, 0.8]\nedge_u = [0, 0.4, 0]\nedge_v = [0, 0, 0.4]\nradiance = [9, 9, 9]\n";
    let within = Options { object_radius_m: Some(1.0), ..options(Reconstruction::Box) };
    assert_eq!(project(&light(away), &chess_like(8), &within).unwrap().flux, [0.0; 3]);
    let towards = away
        .replace("edge_u = [0, 0.4, 0]", "edge_u = [0, 0, 0.4]")
        .replace("edge_v = [0, 0, 0.4]", "edge_v = [0, 0.4, 0]");
    assert!(project(&light(&towards), &chess_like(8), &within).unwrap().flux[0] > 0.1);
}

#[test]
fn the_error_estimate_is_honest() {
    // The spread over seeds is what each run says of itself.
    let cells = chess_like(4);
    let runs: Vec<Projected> = (0..8)
        .map(|seed| {
            project(&light(SPOT), &cells, &Options { seed, samples: 1 << 14, ..options(Reconstruction::Linear) })
                .unwrap()
        })
        .collect();
    let n = runs.len() as f64;
    let (mut variance, mut energy) = (0.0, 0.0);
    for cell in 0..cells.len() {
        let values = || runs.iter().map(|run| f64::from(run.coefficients.values()[cell][0]));
        let mean = values().sum::<f64>() / n;
        variance += cells.measure(cell) * values().map(|value| (value - mean).powi(2)).sum::<f64>() / (n - 1.0);
        energy += cells.measure(cell) * mean * mean;
    }
    let (spread, said) = ((variance / energy).sqrt(), runs.iter().map(|run| run.relative_error).sum::<f64>() / n);
    assert!(said / spread > 0.6 && said / spread < 1.6, "spread {spread}, said {said}");
}

#[test]
fn the_same_light_gives_the_same_bits_whatever_the_number_of_threads() {
    let cells = chess_like(4);
    let both = format!("{SPOT}{SUN}[environment]\nradiance = [0.1, 0.1, 0.2]\n");
    let with_threads = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| projected(&both, &cells, Reconstruction::Linear).coefficients)
    };
    assert_eq!(with_threads(1), with_threads(5));
}

#[test]
fn a_far_lamp_is_as_bright_as_its_distance_says() {
    // Intensity grows with the square of the distance: the flux at the object stays, up to what the lamp's nearness adds.
    let flux = |distance: f64| {
        let (position, intensity) = (distance / 2f64.sqrt(), distance * distance);
        let text =
            format!("[[point]]\nposition = [0, {}, {position}]\nintensity_w_sr = [{intensity}, 0, 0]\n", -position);
        let within = Options { object_radius_m: Some(0.5), ..options(Reconstruction::Box) };
        project(&light(&text), &chess_like(4), &within).unwrap().flux[0]
    };
    let expected = std::f64::consts::PI * 0.25;
    for distance in [1e2, 1e4, 1e6, 1e8, 5e8] {
        assert!((flux(distance) / expected - 1.0).abs() < 3e-3, "{distance} m: {} W, not {expected}", flux(distance));
    }
}

#[test]
fn a_mosaic_turned_by_whole_patches_is_only_renumbered() {
    let cells = chess_like(2);
    let (width, height) = cells.dark().mosaic_size();
    let pixels = (0..width * height).map(|i| [(i % 17) as f32, (i % 5) as f32, 1.0]).collect();
    let mosaic = relumine_lamp::Mosaic {
        path: "painted.exr".into(),
        pixels: relumine_radiometry::Image::from_pixels(width, height, pixels),
    };
    let mut painted = Light { mosaic: Some(mosaic), ..Light::default() };
    let straight = project(&painted, &cells, &options(Reconstruction::Linear)).unwrap();
    assert_eq!(straight.coefficients.to_mosaic(), painted.mosaic.as_ref().unwrap().pixels.pixels());
    painted.placement.rotation = 120f64.to_radians();
    let turned = project(&painted, &cells, &options(Reconstruction::Linear)).unwrap();
    let mut by_hand = straight.clone();
    for cell in 0..cells.len() {
        let Cell { position, u, v } = cells.cell(cell);
        let from = cells.index(Cell { position: position / 12 * 12 + (position % 12 + 4) % 12, u, v });
        by_hand.coefficients.values_mut()[cell] = straight.coefficients.values()[from];
    }
    assert_close(&turned, &by_hand, 1e-4);
}

#[test]
fn a_mosaic_of_distant_lamps_is_a_light_map_already() {
    let cells = dome();
    let pixels: Vec<[f32; 3]> = (0..40).map(|i| [i as f32, 1.0, 0.0]).collect();
    let mosaic = relumine_lamp::Mosaic {
        path: "painted.exr".into(),
        pixels: relumine_radiometry::Image::from_pixels(40, 1, pixels.clone()),
    };
    let painted = Light { mosaic: Some(mosaic), ..Light::default() };
    let map = Options { light_map: true, ..options(Reconstruction::Linear) };
    assert_eq!(project(&painted, &cells, &map).unwrap().coefficients.values(), pixels);
}
