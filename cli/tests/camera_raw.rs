//! Camera RAW from outside, where the program is built with it: brackets of DNG and captures of DNG. The files are of our own
//! making.

#![cfg(feature = "raw")]
#![allow(clippy::unwrap_used)] // in helpers of tests too

mod support;
#[path = "../../crates/radiometry/src/files/tests/tiff_tags.rs"]
mod tiff_tags;

use std::fs;

use relumine::radiometry::files::{self, Photograph, Picture};
use relumine::radiometry::{Counts, Image};
use support::studio::{Plan, Studio};
use support::{read, relumine};
use tempfile::TempDir;
use tiff_tags::{Value, tiff};

/// A DNG whose sensor, under a Bayer array, sees these counts.
fn dng(counts: &Image<Counts>, black: u16, white: u16, seconds: [u32; 2]) -> Vec<u8> {
    let (width, height) = counts.size();
    let colour = |x: usize, y: usize| [0, 1, 1, 2][y % 2 * 2 + x % 2];
    let sites = (0..width * height).map(|i| (i % width, i / width));
    let samples = sites.flat_map(|(x, y)| counts.pixel(x, y)[colour(x, y)].to_le_bytes()).collect();
    tiff(&[
        (0x00fe, Value::Longs(vec![0])),
        (0x0100, Value::Longs(vec![width as u32])),
        (0x0101, Value::Longs(vec![height as u32])),
        (0x0102, Value::Shorts(vec![16])),
        (0x0103, Value::Shorts(vec![1])),
        (0x0106, Value::Shorts(vec![32803])),
        (0x010f, Value::Text("Relumine")),
        (0x0110, Value::Text("Sensor on paper")),
        (0x0111, Value::Offset(samples)),
        (0x0115, Value::Shorts(vec![1])),
        (0x0116, Value::Longs(vec![height as u32])),
        (0x0117, Value::Longs(vec![(2 * width * height) as u32])),
        (0x011c, Value::Shorts(vec![1])),
        (0x828d, Value::Shorts(vec![2, 2])),
        (0x828e, Value::Bytes(vec![0, 1, 1, 2])),
        (0x8769, Value::Directory(vec![(0x829a, Value::Rationals(vec![seconds]))])),
        (0xc612, Value::Bytes(vec![1, 4, 0, 0])),
        (0xc619, Value::Shorts(vec![2, 2])),
        (0xc61a, Value::Shorts(vec![black; 4])),
        (0xc61d, Value::Longs(vec![white.into()])),
        (0xc628, Value::Rationals(vec![[1, 2], [1, 1], [2, 3]])),
    ])
}

#[test]
fn a_bracket_of_dng_is_merged_with_the_levels_of_the_files() {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name);
    let (black, white) = (512.0, 15_512.0);
    let radiance = [0.2, 0.5, 0.1];
    let shots = [[1u32, 4u32], [1, 1], [4, 1]].map(|[a, b]| {
        let count = |l: f64| (black + (white - black) * l * f64::from(a) / f64::from(b)).min(white) as u16;
        let image = Image::from_pixels(16, 12, vec![radiance.map(count); 192]);
        let path = path(&format!("{a}-{b}.dng"));
        fs::write(&path, dng(&image, black as u16, white as u16, [a, b])).unwrap();
        path
    });
    let out = path("out.exr");
    relumine!["merge", &shots[0], &shots[1], &shots[2], "-o", &out].succeeds();
    let balanced = path("balanced.exr");
    relumine!["merge", &shots[0], &shots[1], &shots[2], "-o", &balanced, "--camera-white-balance"].succeeds();
    for (pixel, balanced) in read(&out).pixels().iter().zip(read(&balanced).pixels()) {
        for channel in 0..3 {
            let truth = radiance[channel];
            assert!((f64::from(pixel[channel]) / truth - 1.0).abs() < 1e-3, "{pixel:?}");
            let factor = [2.0, 1.0, 1.5][channel];
            assert!((f64::from(balanced[channel]) / (factor * truth) - 1.0).abs() < 1e-3, "{balanced:?}");
        }
    }
}

#[test]
fn a_capture_of_dng_develops_to_the_field_of_its_counts() {
    let studio = Studio::new(&Plan { size: (40, 24), ..Plan::default() });
    let light = studio.sky();
    let relit = |name: &str| {
        let (field, out) = (studio.path(&format!("{name}.field")), studio.path(&format!("{name}.exr")));
        studio.develop(&field).succeeds();
        relumine!["relight", &field, "--light", &light, "-o", &out].succeeds();
        read(&out)
    };
    let table = studio.capture().join("photographs.csv");
    let mut lines = fs::read_to_string(&table).unwrap().lines().map(String::from).collect::<Vec<_>>();
    let listed = |lines: &[String]| fs::write(&table, lines.join("\n") + "\n").unwrap();
    let rename = |lines: &mut [String], from: &str, to: &str| {
        for line in &mut lines[1..] {
            let mut fields: Vec<_> = line.split(',').map(String::from).collect();
            // What is photographed anew has another checksum.
            (fields[5], fields[6]) = (fields[5].replace(from, to), String::new());
            *line = fields.join(",");
        }
    };
    // Beside each DNG what is read of it, as PNG.
    for line in &lines[1..] {
        let path = studio.capture().join(line.split(',').nth(5).unwrap());
        let Picture::Integer { image, .. } = files::read_picture(&path).unwrap() else { panic!("no counts") };
        fs::write(path.with_extension("dng"), dng(&image, 0, 65535, [1, 1])).unwrap();
        let Photograph::Raw(raw) = files::read_photograph(&path.with_extension("dng")).unwrap() else {
            panic!("no camera RAW")
        };
        files::write_png_counts(&path, &raw.image, 16).unwrap();
    }
    rename(&mut lines, ".png", ".png");
    listed(&lines);
    let counts = relit("counts");
    rename(&mut lines, ".png", ".dng");
    listed(&lines);
    assert_eq!(relit("raw"), counts);

    // Levels that contradict the files are an error that says which to set.
    let setup = studio.capture().join("capture.toml");
    let text = fs::read_to_string(&setup).unwrap().replace("white_level = 65535", "white_level = 65000");
    fs::write(&setup, text).unwrap();
    studio.develop(&studio.path("none.field")).fails(3, &["white_level = 65535", "65000"]);
}
