//! The camera's response: recovered from a bracket, and from a capture's own exposures.

#![allow(clippy::unwrap_used)] // in helpers of tests too

mod support;

use std::fs;
use std::path::PathBuf;

use relumine::ReflectanceField;
use relumine::radiometry::files;
use relumine::radiometry::{Counts, Image, srgb_encode};
use support::studio::{Camera, Plan, Positions, Studio, truth};
use support::{leavings, relative_l2, relumine, shown};
use tempfile::TempDir;

const SIZE: (usize, usize) = (80, 48);

/// A capture of 8-bit sRGB photographs at exposures 1 and 4, whose description says "recover".
fn studio() -> Studio {
    let plan =
        Plan { positions: Positions::Grid(2, 1), camera: Camera::Srgb8, size: SIZE, noise: 0.0005, ..Plan::default() };
    Studio::photographing(&plan, &|position, u, v| {
        let pixels = 0..SIZE.0 * SIZE.1;
        pixels.map(|pixel| truth(position, u, v, pixel % SIZE.0 / 4, pixel / SIZE.0 / 4)).collect()
    })
}

fn recovering(studio: &Studio) {
    studio.edit("capture.toml", |text| text.replace("\"srgb\"", "\"recover\""));
}

#[test]
fn a_capture_tells_its_own_response() {
    let studio = studio();
    let given = studio.field();
    recovering(&studio);
    let field = studio.path("recovered.field");
    let run = studio.develop(&field).succeeds();
    assert!(run.stderr.contains("response recovered from the capture's exposures"), "{run:#?}");
    let [with_given, with_recovered] = [&given, &field].map(|field| studio.relit(field, &studio.sky(), &[]));
    let scale =
        |image: &Image<_>| image.pixels().as_flattened().iter().map(|value: &f32| f64::from(*value)).sum::<f64>();
    let ratio = scale(&with_recovered) / scale(&with_given);
    let difference = relative_l2(with_recovered.pixels(), with_given.pixels());
    println!("relit with the recovered response: ratio of means {ratio:.4}, relative L2 {difference:.4}");
    assert!(difference < 0.05, "{difference}");
    // What is developed again is the same to the bit, and `inspect --against` uses the curve of the field.
    let again = studio.path("again.field");
    studio.develop(&again).succeeds();
    support::assert_same_tree(&again, &field);
    relumine!["inspect", &field, "--against", &studio.capture()].succeeds();
}

#[cfg(unix)]
#[test]
fn a_development_that_goes_on_uses_the_curve_that_was_kept() {
    let studio = studio();
    recovering(&studio);
    let field = studio.path("chess.field");
    let partial = studio.path("chess.field.partial");
    // A full disk ends it soon after it began: files of at most 256 KiB do for the curve, not for a shard.
    let script = format!(
        "trap '' XFSZ; ulimit -f 512; exec '{}' develop '{}' -o '{}'",
        shown(&support::program()),
        shown(&studio.capture()),
        shown(&field)
    );
    let output = std::process::Command::new("sh").arg("-c").arg(script).output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", String::from_utf8_lossy(&output.stderr));
    let kept = partial.join("kept.json");
    let text = fs::read_to_string(&kept).unwrap();
    // Another number in the report, by which to know it again.
    let pixels = text.split("\"pixels\":").nth(1).unwrap().split([',', '}']).next().unwrap();
    fs::write(&kept, text.replacen(&format!("\"pixels\":{pixels}"), "\"pixels\":4711", 1)).unwrap();
    let run = studio.develop(&field).succeeds();
    assert!(run.stderr.contains("4711"), "{run:#?}");
    let made = ReflectanceField::open(&field).unwrap().header().made["recovered_response"].clone();
    assert_eq!(made["fit"][0]["pixels"], 4711);
    // What is kept and no curve is not used.
    let field = studio.path("other.field");
    fs::create_dir_all(studio.path("other.field.partial")).unwrap();
    fs::write(studio.path("other.field.partial/kept.json"), text.replace("rows", "lines")).unwrap();
    let run = studio.develop(&field).succeeds();
    assert!(!run.stderr.contains("4711"), "{run:#?}");
}

#[test]
fn a_capture_with_one_exposure_a_pattern_is_refused_and_leaves_nothing() {
    let studio = Studio::new(&Plan::default());
    studio.edit("capture.toml", |text| text.replace("\"linear\"", "\"recover\""));
    let field = studio.path("x.field");
    studio.develop(&field).fails(3, &["one exposure a pattern", "relumine calibrate response", "capture.toml"]);
    assert!(leavings(&field).is_empty(), "{:?}", leavings(&field));
}

/// Five 8-bit photographs of a ramp through the sRGB curve.
fn bracket() -> (TempDir, Vec<PathBuf>, Vec<f64>) {
    let folder = tempfile::tempdir().unwrap();
    let times = vec![0.25, 0.5, 1.0, 2.0, 4.0];
    let files = times.iter().enumerate().map(|(index, t)| {
        let pixels = (0..128 * 64).map(|pixel| {
            let (x, y) = (f64::from(pixel % 128), f64::from(pixel / 128));
            let radiance = 10f64.powf(-2.5 + 2.5 * x / 128.0 + 0.3 * y / 64.0);
            [1.0, 0.8, 0.6].map(|gain| (255.0 * srgb_encode((gain * radiance * t).min(1.0))).round() as u16)
        });
        let image = Image::<Counts>::from_pixels(128, 64, pixels.collect());
        let path = folder.path().join(format!("{index}.png"));
        files::write_png_counts(&path, &image, 8).unwrap();
        path
    });
    let files = files.collect();
    (folder, files, times)
}

fn calibrate(files: &[PathBuf], words: &[&str]) -> support::Run {
    let mut command: Vec<std::ffi::OsString> = vec!["calibrate".into(), "response".into()];
    command.extend(files.iter().map(Into::into));
    command.extend(words.iter().map(Into::into));
    support::run(&command)
}

#[test]
fn a_bracket_gives_a_response_file_a_plot_and_figures() {
    let (folder, files, times) = bracket();
    let path = |name: &str| shown(&folder.path().join(name));
    let mut srgb = "relative_exposure,red,green,blue\n".to_owned();
    for row in 0..=1000 {
        let x = f64::from(row) / 1000.0;
        srgb += &format!("{x},{0},{0},{0}\n", srgb_encode(x));
    }
    fs::write(path("srgb.csv"), srgb).unwrap();
    let exposures = times.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
    let (out, plot, true_curve) = (path("response.csv"), path("curve.svg"), path("srgb.csv"));
    let words = ["--exposures", &exposures, "-o", &out, "--plot", &plot, "--beside", &true_curve];
    let run = calibrate(&files, &[&words[..], &["--json"]].concat()).succeeds();
    let figures: serde_json::Value = serde_json::from_str(&run.stdout).unwrap();
    for channel in 0..3 {
        let difference = figures["largest_difference"][channel].as_f64().unwrap();
        assert!(difference < 0.01, "channel {channel}: {figures}");
    }
    assert!(figures["channels"]["red"]["pixels"].as_u64().unwrap() > 1000, "{figures}");
    assert!(fs::read_to_string(&plot).unwrap().contains("srgb.csv"));
    // The text says the same, the same list of times gives the same file, and nothing is replaced unasked.
    let first = fs::read(&out).unwrap();
    calibrate(&files, &words).fails(1, &["response.csv exists already", "--force"]);
    let list: String = files.iter().zip(&times).map(|(file, t)| format!("{} {}\n", shown(file), 1.0 / t)).collect();
    fs::write(path("list.txt"), list).unwrap();
    let list = path("list.txt");
    let run = calibrate(&[], &["--list", &list, "--reciprocal", "-o", &out, "--threads", "1", "--force"]).succeeds();
    assert!(run.stdout.contains("residual of exposure, rms, %"), "{run:#?}");
    assert_eq!(fs::read(&out).unwrap(), first);
    // And what merges with it is as bright as what merges with the curve itself.
    let merged = [&out, &true_curve].map(|response| {
        let picture = path("merged.exr");
        relumine!["merge", "--list", &list, "--reciprocal", "--response", response, "-o", &picture, "--force"]
            .succeeds();
        support::read(picture.as_ref())
    });
    let difference = relative_l2(merged[0].pixels(), merged[1].pixels());
    assert!(difference < 0.02, "{difference}");
}

#[test]
fn a_bracket_that_tells_nothing_is_refused() {
    let (folder, files, times) = bracket();
    let path = |name: &str| shown(&folder.path().join(name));
    let out = path("response.csv");
    calibrate(&files, &["--exposures", "1,2", "-o", &out]).fails(2, &["one for each of the 5 pictures"]);
    calibrate(&files, &["--exposures", "1,2,-3,4,5", "-o", &out]).fails(2, &["positive numbers"]);
    calibrate(&files, &["-o", &path("response.txt")]).fails(2, &["ends in .csv"]);
    calibrate(&files, &["-o", &out]).fails(3, &["0.png"]);
    let reversed = times.iter().rev().map(f64::to_string).collect::<Vec<_>>().join(",");
    calibrate(&files, &["--exposures", &reversed, "-o", &out]).fails(3, &["longer exposure are not brighter"]);
    for code in [0, 255] {
        let flat = Image::<Counts>::from_pixels(128, 64, vec![[code; 3]; 128 * 64]);
        files.iter().for_each(|file| files::write_png_counts(file, &flat, 8).unwrap());
        calibrate(&files, &["--exposures", "1,2,3,4,5", "-o", &out]).fails(3, &["all black or all white"]);
    }
    assert!(!folder.path().join("response.csv").exists());
}
