//! `relumine calibrate projector` on photographs of a card whose light is known.

#![allow(clippy::unwrap_used)] // in helpers of tests too

mod support;

use std::fs;

use relumine::radiometry::files::write_png_counts;
use relumine::radiometry::{Counts, Image, srgb_encode};
use support::relumine;
use support::studio::{Plan, Studio};

const SIZE: (usize, usize) = (120, 90);

/// What the projector shines at (s, t) of its pattern: falls off to the right.
fn shone(s: f64) -> f64 {
    1.0 - 0.4 * s
}

/// A card that fills pixels 10 … 110 and 5 … 85, of 16 bits, linear.
fn card(path: &std::path::Path, level: f64) {
    let pixels = (0..SIZE.0 * SIZE.1).map(|index| {
        let s = ((index % SIZE.0) as f64 + 0.5 - 10.0) / 100.0;
        [0.9, 1.0, 0.5].map(|colour| (60_000.0 * level * colour * shone(s)).round() as u16)
    });
    write_png_counts(path, &Image::<Counts>::from_pixels(SIZE.0, SIZE.1, pixels.collect()), 16).unwrap();
}

const CORNERS: [&str; 4] = ["10,5", "110,5", "110,85", "10,85"];

#[test]
fn a_flat_field_goes_into_the_capture() {
    let studio = Studio::new(&Plan::default());
    let (white, black, toml) = (studio.path("white.png"), studio.path("black.png"), studio.path("flat.toml"));
    card(&white, 0.8);
    // Exposed ten times as long.
    card(&black, 0.008 * 10.0);
    let [a, b, c, d] = CORNERS;
    let measure = || {
        relumine![
            "calibrate",
            "projector",
            "--white-card",
            &white,
            &white,
            "--black",
            &black,
            "--black-longer",
            "10",
            "--corners",
            a,
            b,
            c,
            d,
            "--squares",
            "4",
            "-o",
            &toml
        ]
    };
    let told = measure().succeeds();
    assert!(told.stderr.contains("contrast 100 : 1"), "{told:#?}");
    let text = fs::read_to_string(&toml).unwrap();
    assert!(
        text.contains("# white balance (gains that make white grey of the same luminance): 1.0474 0.9426 1.8853"),
        "{text}"
    );
    let rows: Vec<Vec<f64>> = text
        .lines()
        .filter(|line| line.trim_start().starts_with('['))
        .map(|line| {
            line.trim().trim_matches(['[', ']', ',']).split(',').map(|number| number.trim().parse().unwrap()).collect()
        })
        .collect();
    assert_eq!(rows.len(), 4);
    for row in &rows {
        for (u, found) in row.iter().enumerate() {
            let expected = shone((u as f64 + 0.5) / 4.0) / shone(0.5);
            assert!((found - expected).abs() < 1e-3, "square {u}: {found}, not {expected}");
        }
    }
    studio.edit("capture.toml", |setup| setup.replace("[patterns]", &format!("{text}\n[patterns]")));
    relumine!["inspect", &studio.capture()].succeeds();
    let capture = relumine::Capture::open(&studio.capture()).unwrap();
    let ratio = capture.setup().square_flux(3, 1) / capture.setup().square_flux(0, 1);
    assert!((ratio - shone(0.875) / shone(0.125)).abs() < 1e-3);
    measure().fails(1, &["flat.toml exists already", "--force"]);
}

#[test]
fn a_ramp_becomes_a_response_and_a_contrast() {
    let studio = Studio::new(&Plan::default());
    let light = |level: f64| 0.002 + 0.998 * (level / 255.0).powf(2.2);
    let levels = [0.0, 64.0, 128.0, 255.0];
    let mut list = String::from("# grey levels\n");
    for level in levels {
        // 8 bits, sRGB.
        let code = (srgb_encode(0.9 * light(level)) * 255.0).round() as u16;
        let picture = Image::<Counts>::from_pixels(40, 30, vec![[code; 3]; 1200]);
        write_png_counts(&studio.path(&format!("level {level}.png")), &picture, 8).unwrap();
        list += &format!("level {level}.png {level}\n");
    }
    let (path, csv) = (studio.path("ramp.txt"), studio.path("projector-response.csv"));
    fs::write(&path, &list).unwrap();
    relumine!["calibrate", "projector", "--ramp", &path, "--ramp-output", &csv, "--response", "srgb"].succeeds();
    let text = fs::read_to_string(&csv).unwrap();
    let rows: Vec<Vec<f64>> =
        text.lines().skip(1).map(|line| line.split(',').map(|number| number.parse().unwrap()).collect()).collect();
    assert_eq!(text.lines().next(), Some("level,red,green,blue"));
    for (row, level) in rows.iter().zip(levels) {
        assert!((row[0] - level / 255.0).abs() < 1e-5);
        // What 8 bits can say.
        assert!((row[1] - light(level)).abs() < 0.005, "{level}: {row:?}");
    }
    fs::write(&path, list.replace("64\n", "sixty\n")).unwrap();
    relumine!["calibrate", "projector", "--ramp", &path, "--ramp-output", &csv, "--force"]
        .fails(3, &["ramp.txt:3: expected a photograph and its level"]);
}

#[test]
fn what_measures_nothing_is_refused() {
    let studio = Studio::new(&Plan::default());
    let white = studio.path("white.png");
    card(&white, 1.2);
    let [a, b, c, d] = CORNERS;
    let measure = |corners: [&str; 4], squares: &str| {
        let [a, b, c, d] = corners;
        relumine!["calibrate", "projector", "--white-card", &white, "--corners", a, b, c, d, "--squares", squares]
    };
    measure(CORNERS, "4").fails(3, &["white.png", "clipped"]);
    card(&white, 0.5);
    measure([a, c, b, d], "4").fails(2, &["corners", "convex"]);
    measure([a, "180,5", "180,85", d], "4").fails(3, &["outside the photograph of 120 × 90"]);
    measure([a, b, c, "10"], "4").code.filter(|code| *code == 2).expect("usage");
    let absent = studio.path("none.png");
    let none = relumine!["calibrate", "projector", "--white-card", &absent, "--corners", a, b, c, d, "--squares", "4"];
    assert!(none.code == Some(3) && none.stderr.contains("none.png"), "{none:#?}");
}
