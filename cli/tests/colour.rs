//! A camera's colours from outside: a photographed chart becomes a correction, and the correction makes a field true.

#![allow(clippy::unwrap_used)] // in helpers of tests too

mod support;

use std::fs;
use std::path::{Path, PathBuf};

use relumine::radiometry;
use relumine::radiometry::colour::space::{inverse, transform};
use relumine::radiometry::colour::{Chart, Reference};
use relumine::radiometry::files::{ExrSample, read_picture, write_exr, write_png_counts};
use relumine::radiometry::{Image, Radiance};
use relumine::{Cell, Coefficients, ReflectanceField, relight_reference};
use support::{leavings, relumine};

#[path = "../../crates/radiometry/tests/support/chart.rs"]
mod virtual_chart;
use virtual_chart::{CROSSTALK, Scene, display_codes};

const SIDE: usize = 16;

/// A chart as a linear file and as a camera stores it for a display.
fn photographs(folder: &Path) -> (PathBuf, PathBuf) {
    let (chart, reference) = (Chart::colorchecker_24(), Reference::colorchecker_24());
    let picture = Scene { noise: 0.01, ..Scene::plain() }.photograph(&chart, &reference);
    let (linear, display) = (folder.join("chart.exr"), folder.join("chart.png"));
    write_exr(&linear, &picture, ExrSample::Float, &[]).unwrap();
    write_png_counts(&display, &display_codes(&picture), 8).unwrap();
    (linear, display)
}

/// What each of four squares shows of the object: smooth, coloured, in a corner a green that no display shows.
fn truth(square: usize, x: usize, y: usize) -> [f64; 3] {
    let (s, t) = (x as f64 / SIDE as f64, y as f64 / SIDE as f64);
    let shade = 0.3 + 0.1 * square as f64;
    let colour = if x < 4 && y < 4 { [-0.12, 0.9, 0.4] } else { [0.2 + 0.7 * s, 0.3 + 0.4 * t, 0.8 - 0.5 * s * t] };
    colour.map(|value| shade * value)
}

fn capture(folder: &Path, colour: &str) -> PathBuf {
    let capture = folder.join("capture");
    fs::create_dir_all(&capture).unwrap();
    let setup = format!(
        "format = \"relumine-capture/1\"\n[hemisphere]\nradius_m = 2\nazimuths = 1\ntilts = 1\n[projector]\nsquares = 2\nhalf_width = \
         0.3\n[patterns]\nscheme = \"squares\"\n[camera]\nwidth = {SIDE}\nheight = {SIDE}\n{colour}\n"
    );
    fs::write(capture.join("capture.toml"), setup).unwrap();
    let mut table = String::from("position,pattern,exposure_s,iso,f_number,file,sha256\n");
    let mut photograph = |pattern: &str, square: Option<usize>| {
        let pixels = (0..SIDE * SIDE).map(|index| {
            let shown = square.map_or([0.0; 3], |square| truth(square, index % SIDE, index / SIDE));
            transform(&CROSSTALK, shown).map(|value| value as f32)
        });
        let picture = Image::<Radiance>::from_pixels(SIDE, SIDE, pixels.collect());
        write_exr(&capture.join(format!("{pattern}.exr")), &picture, ExrSample::Float, &[]).unwrap();
        table += &format!("0,{pattern},1,,,{pattern}.exr,\n");
    };
    photograph("black", None);
    for square in 0..4 {
        photograph(&format!("square-{}-{}", square % 2, square / 2), Some(square));
    }
    fs::write(capture.join("photographs.csv"), table).unwrap();
    capture
}

/// Relative L2 of what the field shows of the squares from the truth, and the lowest value shown.
fn off(field: &Path) -> (f64, f32) {
    let field = ReflectanceField::open(field).unwrap();
    let cells = field.cells();
    // |Ω|/Φ of a square: what makes a transfer of a radiance.
    let side: f64 = 2.0 * 0.3 / 2.0;
    let (mut error, mut energy, mut lowest) = (0.0, 0.0, 0.0f32);
    for square in 0..4 {
        let index = cells.index(Cell { position: 0, u: square % 2, v: square / 2 });
        let factor = cells.measure(index) / (side * side);
        for (pixel, found) in field.transfer(index).unwrap().pixels().iter().enumerate() {
            for (found, known) in found.iter().zip(truth(square, pixel % SIDE, pixel / SIDE)) {
                error += (f64::from(*found) - factor * known).powi(2);
                energy += (factor * known).powi(2);
                lowest = lowest.min(*found);
            }
        }
    }
    ((error / energy).sqrt(), lowest)
}

#[test]
fn a_camera_whose_channels_mix_is_calibrated_and_its_field_is_true() {
    let folder = tempfile::tempdir().unwrap();
    let (linear, _) = photographs(folder.path());
    let correction = capture(folder.path(), "").join("chart.toml");
    let side = folder.path().join("side.png");
    let run = relumine!["calibrate", "colour", &linear, "-o", &correction, "--picture", &side, "--json"].succeeds();
    assert!(run.stderr.contains("ColorChecker 24 found"), "{run:#?}");
    let report: serde_json::Value = serde_json::from_str(&run.stdout).unwrap();
    let expected = inverse(&CROSSTALK).unwrap();
    for (row, expected) in expected.iter().enumerate() {
        for (column, expected) in expected.iter().enumerate() {
            let found = report["coefficients"][row][column].as_f64().unwrap();
            assert!((found - expected).abs() < 0.02, "{report:#}");
        }
    }
    let mean = |name: &str| report["delta_e_2000"][name]["mean"].as_f64().unwrap();
    assert!(mean("before") > 4.0 && mean("after") < 0.4 && mean("held_out") < 0.6, "{report:#}");
    assert_eq!(report["patches"].as_array().unwrap().len(), 24);
    assert_eq!(read_picture(&side).unwrap().size().0, 1200);

    let (plain, corrected, packed) =
        (folder.path().join("plain.field"), folder.path().join("true.field"), folder.path().join("packed.field"));
    let capture_of = |colour| capture(folder.path(), colour);
    relumine!["develop", &capture_of(""), "-o", &plain].succeeds();
    relumine!["develop", &capture_of("colour = \"chart.toml\""), "-o", &corrected].succeeds();
    relumine!["develop", &capture_of("colour = \"chart.toml\""), "-o", &packed, "--error", "0.002"].succeeds();
    let (without, cut) = off(&plain);
    assert!(without > 0.05 && cut >= 0.0, "{without} {cut}");
    for field in [&corrected, &packed] {
        let (with, lowest) = off(field);
        assert!(with < 0.01, "{}: {with}", field.display());
        assert!(lowest < 0.0, "{}: what no display shows stays negative", field.display());
    }
    // Under all squares together the colour outside of the gamut is still there.
    let field = ReflectanceField::open(&corrected).unwrap();
    let mut light: Coefficients = field.cells().dark();
    light.values_mut().fill([1.0; 3]);
    assert!(relight_reference(&field, &light).unwrap().pixel(1, 1)[0] < 0.0);

    // Another correction is another field: what was begun with the first is not gone on with.
    let text = fs::read_to_string(&correction).unwrap();
    assert!(text.contains("format = \"relumine-colour/1\"") && text.contains("photograph = \"chart.exr\""), "{text}");
    let made = field.header().made["input_sha256"].clone();
    fs::write(&correction, text.replace("patches = 24", "patches = 23")).unwrap();
    relumine!["develop", &capture_of("colour = \"chart.toml\""), "-o", &corrected, "--force"].succeeds();
    assert_ne!(ReflectanceField::open(&corrected).unwrap().header().made["input_sha256"], made);

    let roots = folder.path().join("capture/roots.toml");
    relumine!["calibrate", "colour", &linear, "-o", &roots, "--model", "root-polynomial"].succeeds();
    let capture = capture_of("colour = \"roots.toml\"");
    let words = ["capture.toml: camera: colour = \"roots.toml\"", "not linear in light", "--model matrix"];
    let run = relumine!["develop", &capture, "-o", &folder.path().join("no.field")];
    assert_eq!(run.code, Some(3), "{run:#?}");
    assert!(words.iter().all(|word| run.stderr.contains(word)), "{run:#?}");
}

#[test]
fn a_chart_stored_for_a_display_is_placed_by_its_corners_or_found() {
    let folder = tempfile::tempdir().unwrap();
    let (_, display) = photographs(folder.path());
    let scene = Scene::plain();
    let corners = scene.corners.as_flattened().iter().map(f64::to_string).collect::<Vec<_>>().join(",");
    let [placed, found] = ["placed.toml", "found.toml"].map(|name| folder.path().join(name));
    let given = relumine!["calibrate", "colour", &display, "--response", "srgb", "--corners", &corners, "-o", &placed];
    let given = given.succeeds();
    let searched =
        relumine!["calibrate", "colour", &display, "--response", "srgb", "-o", &found, "--keep-white"].succeeds();
    for text in [&given.stdout, &searched.stdout] {
        let after = text.lines().find(|line| line.starts_with("after")).unwrap();
        let mean: f64 = after.split_whitespace().nth(1).unwrap().parse().unwrap();
        assert!(mean < 1.0, "{text}");
        assert!(text.lines().any(|line| line.starts_with("C3 ")), "every patch is told:\n{text}");
    }
    assert!(fs::read_to_string(&placed).unwrap().contains("found = false"));
    assert!(fs::read_to_string(&found).unwrap().contains("white_kept = true"));

    // Corners that begin at another corner are of a chart that lies otherwise: the colours cannot be brought to agree.
    let mut turned = scene.corners;
    turned.rotate_left(2);
    let turned = turned.as_flattened().iter().map(f64::to_string).collect::<Vec<_>>().join(",");
    let run = relumine![
        "calibrate",
        "colour",
        &display,
        "--response",
        "srgb",
        "--corners",
        &turned,
        "-o",
        &placed,
        "--force"
    ];
    let after = run.stdout.lines().find(|line| line.starts_with("after")).unwrap_or("after 99");
    assert!(after.split_whitespace().nth(1).unwrap().parse::<f64>().unwrap() > 8.0, "{run:#?}");
}

#[test]
fn what_cannot_be_calibrated_says_why_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (linear, display) = photographs(folder.path());
    let output = folder.path().join("chart.toml");
    let black = folder.path().join("black.exr");
    write_exr(&black, &Image::<Radiance>::black(200, 100), ExrSample::Float, &[]).unwrap();
    let bad = folder.path().join("bad.cie");
    fs::write(&bad, "BEGIN_DATA_FORMAT\nSAMPLE_ID RGB_R\nEND_DATA_FORMAT\nBEGIN_DATA\nA1 3\nEND_DATA\n").unwrap();
    let line = "1,1,2,2,3,3,4,4";
    for (words, code, reasons) in [
        (vec![display.to_str().unwrap()], 2, vec!["8-bit picture", "--response linear, srgb or a response file"]),
        (vec![linear.to_str().unwrap(), "--response", "srgb"], 3, vec!["linear already"]),
        (vec![black.to_str().unwrap()], 3, vec!["was not found", "--corners"]),
        (vec![linear.to_str().unwrap(), "--corners", line], 3, vec!["span no quadrilateral"]),
        (vec![linear.to_str().unwrap(), "--corners", "1,2,3"], 2, vec!["--corners"]),
        (vec![linear.to_str().unwrap(), "--chart", "sg"], 2, vec!["give --reference FILE"]),
        (vec![linear.to_str().unwrap(), "--chart", "36"], 2, vec!["expected 24, sg, dc"]),
        (vec![linear.to_str().unwrap(), "--chart", "none.cht"], 3, vec!["cannot read none.cht"]),
        (
            vec![linear.to_str().unwrap(), "--reference", bad.to_str().unwrap()],
            3,
            vec!["bad.cie:4: expected the fields"],
        ),
        (vec![linear.to_str().unwrap(), "--illuminant", "D65"], 2, vec!["--illuminant belongs to a --reference"]),
        (vec![linear.to_str().unwrap(), "--illuminant", "D55"], 2, vec!["expected one of D50"]),
        (vec![linear.to_str().unwrap(), "--picture", "side.jpg"], 2, vec!["side.jpg"]),
        (vec![display.to_str().unwrap(), "--response", "linear", "--white-level", "256"], 3, vec!["at most 255"]),
    ] {
        let mut all = vec!["calibrate".into(), "colour".into(), "-o".into(), output.clone().into_os_string()];
        all.extend(words.iter().map(Into::into));
        let run = support::run(&all);
        assert_eq!(run.code, Some(code), "{words:?}: {run:#?}");
        assert!(reasons.iter().all(|reason| run.stderr.contains(reason)), "{words:?}: {run:#?}");
        assert!(run.stdout.is_empty(), "{run:#?}");
    }
    assert!(leavings(&output).is_empty());
    fs::write(&output, "mine").unwrap();
    relumine!["calibrate", "colour", &linear, "-o", &output].fails(1, &["exists already"]);
    assert_eq!(fs::read_to_string(&output).unwrap(), "mine");
}
