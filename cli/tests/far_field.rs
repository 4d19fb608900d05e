//! Photographs under distant lamps: what was photographed comes back when the lamp shines again.

#![allow(clippy::unwrap_used)] // in helpers of tests too

mod support;

use std::f64::consts::PI;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use relumine::radiometry::files;
use relumine::radiometry::{Counts, Image};
use support::{assert_same_tree, leavings, missing_squares, read, relative_l2, relumine, shown};
use tempfile::TempDir;

const SIDE: usize = 24;
const LAMPS: usize = 30;

/// Direction of a lamp, spread over the hemisphere on a spiral.
fn lamp(index: usize) -> [f64; 3] {
    let z = 1.0 - (index as f64 + 0.5) / LAMPS as f64 * 0.95;
    let (sine, cosine) = (index as f64 * PI * (3.0 - 5.0f64.sqrt())).sin_cos();
    let across = (1.0 - z * z).sqrt();
    [across * cosine, across * sine, z]
}

/// A matte sphere seen from above, under a distant lamp of irradiance 1.
fn sphere(direction: [f64; 3]) -> Vec<[f32; 3]> {
    let shade = |index: usize| {
        let along = |i: usize| (i as f64 + 0.5) / SIDE as f64 * 2.2 - 1.1;
        let (x, y) = (along(index % SIDE), -along(index / SIDE));
        let inside = 1.0 - x * x - y * y;
        let cosine =
            if inside > 0.0 { x * direction[0] + y * direction[1] + inside.sqrt() * direction[2] } else { 0.0 };
        [0.8, 0.6, 0.4].map(|albedo: f64| (albedo * cosine.max(0.0)) as f32)
    };
    (0..SIDE * SIDE).map(shade).collect()
}

fn png(pixels: &[[f32; 3]], scale: f32) -> Vec<u8> {
    let code = |value: f32| (value * scale * 65535.0).round() as u16;
    let counts = pixels.iter().map(|pixel| pixel.map(code)).collect();
    files::encode_png_counts(&Image::<Counts>::from_pixels(SIDE, SIDE, counts), 16)
}

/// A folder with photographs of the sphere and their list of lamps.
fn dome() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let mut list = format!("{LAMPS}\n");
    for index in 0..LAMPS {
        let [x, y, z] = lamp(index);
        fs::write(folder.path().join(format!("{index:02}.png")), png(&sphere(lamp(index)), 1.0)).unwrap();
        writeln!(list, "{index:02}.png {x:.12} {y:.12} {z:.12}").unwrap();
    }
    let path = folder.path().join("dome.lp");
    fs::write(&path, list).unwrap();
    (folder, path)
}

fn imported(folder: &TempDir, list: &Path) -> PathBuf {
    let field = folder.path().join("dome.field");
    relumine!["import", list, "--response", "linear", "-o", &field].succeeds();
    field
}

/// Relights under a sun in front of lamp `index`.
fn under_a_sun(folder: &TempDir, field: &Path, index: usize, irradiance: f64, between: &str) -> Vec<[f32; 3]> {
    let [x, y, z] = lamp(index).map(|component| -component);
    let (light, output) = (folder.path().join("sun.toml"), folder.path().join("sun.exr"));
    let sun = format!("[[sun]]\ndirection = [{x:.12}, {y:.12}, {z:.12}]\nirradiance_w_m2 = {:?}\n", [irradiance; 3]);
    fs::write(&light, format!("format = \"relumine-light/1\"\n{sun}")).unwrap();
    let run = relumine![
        "relight",
        field,
        "--light",
        &light,
        "--between",
        between,
        "--samples",
        "1024",
        "-o",
        &output,
        "--force"
    ];
    run.succeeds();
    read(&output).into_pixels()
}

#[test]
fn a_sun_in_the_place_of_a_lamp_gives_back_its_photograph() {
    let (folder, list) = dome();
    let field = imported(&folder, &list);
    for (index, between) in [(0, "box"), (0, "linear"), (7, "box"), (7, "linear"), (29, "box"), (29, "linear")] {
        let error = relative_l2(&under_a_sun(&folder, &field, index, 1.0, between), &sphere(lamp(index)));
        // Halves are good to 2⁻¹¹.
        assert!(error < 5e-4, "lamp {index}, {between}: {error}");
    }
    relumine!["inspect", &field].succeeds();
}

#[test]
fn lamps_of_known_irradiance_are_divided_out() {
    let (folder, _) = dome();
    let mut table = "file,x,y,z,irradiance\n".to_string();
    for index in 0..LAMPS {
        let [x, y, z] = lamp(index);
        let irradiance = 0.25 + 0.025 * index as f64;
        fs::write(folder.path().join(format!("{index:02}.png")), png(&sphere(lamp(index)), irradiance as f32)).unwrap();
        writeln!(table, "{index:02}.png,{x:.12},{y:.12},{z:.12},{irradiance}").unwrap();
    }
    let list = folder.path().join("dome.csv");
    fs::write(&list, table).unwrap();
    let field = imported(&folder, &list);
    for index in [0, 13, 29] {
        let expected: Vec<_> = sphere(lamp(index)).iter().map(|pixel| pixel.map(|sample| 2.0 * sample)).collect();
        let error = relative_l2(&under_a_sun(&folder, &field, index, 2.0, "linear"), &expected);
        assert!(error < 5e-4, "lamp {index}: {error}");
    }
}

#[test]
fn a_matte_sphere_under_a_constant_sky_shows_the_share_of_sky_it_sees() {
    let (folder, list) = dome();
    let field = imported(&folder, &list);
    let (light, output) = (folder.path().join("sky.toml"), folder.path().join("sky.exr"));
    fs::write(&light, "format = \"relumine-light/1\"\n[environment]\nradiance = [1, 1, 1]\n").unwrap();
    relumine!["relight", &field, "--light", &light, "--between", "box", "-o", &output].succeeds();
    let relit = read(&output);
    // On paper twice: the photographs weighted with the patches of their lamps, counted on a fine grid of directions; and,
    // as near as 30 lamps come, the integral: a normal at the angle θ to the zenith collects π (1 + cosθ)/2.
    let patches = patches_by_counting();
    let photographs: Vec<_> = (0..LAMPS).map(|index| sphere(lamp(index))).collect();
    let (centre, radius) = (SIDE as f64 / 2.0, SIDE as f64 / 2.2);
    for (x, y) in [(12, 12), (6, 12), (12, 4), (16, 17)] {
        let found = f64::from(relit.pixel(x, y)[1]);
        let weighted = patches.iter().zip(&photographs).map(|(patch, photo)| patch * f64::from(photo[y * SIDE + x][1]));
        let ratio = found / weighted.sum::<f64>();
        assert!((ratio - 1.0).abs() < 0.003, "pixel ({x}, {y}): {ratio} of the sum");
        let squared = ((x as f64 + 0.5 - centre).powi(2) + (y as f64 + 0.5 - centre).powi(2)) / (radius * radius);
        let ratio = found / (0.6 * PI * (1.0 + (1.0 - squared).sqrt()) / 2.0);
        assert!((ratio - 1.0).abs() < 0.05, "pixel ({x}, {y}): {ratio} of the integral");
    }
}

/// The solid angle nearest to each lamp.
fn patches_by_counting() -> Vec<f64> {
    let (lamps, points) = ((0..LAMPS).map(lamp).collect::<Vec<_>>(), 200_000);
    let mut patches = vec![0.0; LAMPS];
    for point in 0..points {
        let z = (f64::from(point) + 0.5) / f64::from(points);
        let (sine, cosine) = (f64::from(point) * PI * (3.0 - 5.0f64.sqrt())).sin_cos();
        let across = (1.0 - z * z).sqrt();
        let near = |lamp: &[f64; 3]| across * (cosine * lamp[0] + sine * lamp[1]) + z * lamp[2];
        let nearest = (0..LAMPS).max_by(|a, b| near(&lamps[*a]).total_cmp(&near(&lamps[*b]))).unwrap();
        patches[nearest] += 2.0 * PI / f64::from(points);
    }
    patches
}

#[test]
fn a_photograph_that_is_not_there_makes_its_lamp_missing() {
    let (folder, list) = dome();
    let lost = folder.path().join("11.png");
    fs::remove_file(&lost).unwrap();
    let field = folder.path().join("lossy.field");
    relumine!["import", &list, "--response", "linear", "-o", &field].fails(3, &[&shown(&lost), "missing"]);
    assert_eq!(missing_squares(&field), [(11, 0, 0)]);
    assert_eq!(relumine!["inspect", &field].code, Some(3));
    assert_eq!(relumine!["inspect", &list].code, Some(3));
    let [x, y, z] = lamp(11).map(|component| -component);
    let light = folder.path().join("sun.toml");
    let sun = format!("[[sun]]\ndirection = [{x:.12}, {y:.12}, {z:.12}]\nirradiance_w_m2 = [1, 1, 1]\n");
    fs::write(&light, format!("format = \"relumine-light/1\"\n{sun}")).unwrap();
    let run = relumine!["relight", &field, "--light", &light, "--between", "box", "-o", &folder.path().join("a.exr")];
    assert_eq!(run.missing_percent(), Some(100.0), "{run:#?}");
}

#[test]
fn a_damaged_photograph_is_lost_and_a_wrong_list_refused() {
    let (folder, list) = dome();
    let damaged = folder.path().join("03.png");
    let bytes = fs::read(&damaged).unwrap();
    fs::write(&damaged, &bytes[..bytes.len() / 2]).unwrap();
    let other_size = folder.path().join("04.png");
    fs::write(&other_size, files::encode_png_counts(&Image::<Counts>::black(SIDE, 5), 16)).unwrap();
    let field = folder.path().join("lossy.field");
    let run = relumine!["import", &list, "--response", "linear", "-o", &field];
    run.fails(3, &[&shown(&damaged), &shown(&other_size), "24 × 5"]);
    assert_eq!(missing_squares(&field), [(3, 0, 0), (4, 0, 0)]);

    let text = fs::read_to_string(&list).unwrap();
    let refused = folder.path().join("refused.field");
    for (wrong, words) in [
        (text.replacen("30\n", "31\n", 1), ["31 photographs", "30 are listed"]),
        (text.replacen("05.png ", "05.png x", 1), ["line 7", "number"]),
        (text.replacen("30\n", "", 1), ["line 1", "number of photographs"]),
        (String::new(), ["line 1", "number of photographs"]),
    ] {
        fs::write(&list, wrong).unwrap();
        let run = relumine!["import", &list, "-o", &refused];
        run.fails(3, &[&shown(&list), words[0], words[1]]);
        assert_eq!(leavings(&refused), [""; 0]);
    }
}

#[test]
fn threads_do_not_change_a_bit_of_an_import() {
    let (folder, list) = dome();
    let fields = ["1", "2", "5"].map(|threads| {
        let field = folder.path().join(format!("{threads}.field"));
        relumine!["import", &list, "-o", &field, "--threads", threads].succeeds();
        field
    });
    assert_same_tree(&fields[1], &fields[0]);
    assert_same_tree(&fields[2], &fields[0]);
}
