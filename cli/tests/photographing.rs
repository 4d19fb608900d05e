//! Plans in words and numbers, and a capture photographed by hand at a real terminal.

#![cfg(unix)]
#![allow(clippy::unwrap_used)] // in helpers of tests too

mod support;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use relumine::radiometry::files::encode_png_counts;
use relumine::radiometry::{Counts, Image};
use rexpect::session::{PtySession, spawn_command};
use support::{Numbers, Run, assert_same_tree, program, relumine};

/// 1 position, 2 × 2 squares, each alone: 6 photographs.
const RIG: &str = r#"format = "relumine-rig/1"
title = "two by two"
[hemisphere]
radius_m = 2.0
azimuths = 1
tilts = 1
[projector]
squares = 2
half_width = 0.25
[patterns]
scheme = "squares"
[camera]
width = 8
height = 6
exposures_s = [0.5]
[drivers]
stage = "manual"
projector = "manual"
camera = "watched-folder"
[manual]
settle_s = 0.05
"#;

const PATTERNS: [&str; 6] = ["black", "white", "square-0-0", "square-1-0", "square-0-1", "square-1-1"];

struct Studio {
    folder: tempfile::TempDir,
}

impl Studio {
    fn new() -> Self {
        let studio = Self { folder: tempfile::tempdir().unwrap() };
        fs::write(studio.rig(), RIG).unwrap();
        studio
    }

    fn rig(&self) -> PathBuf {
        self.folder.path().join("rig.toml")
    }

    fn capture(&self) -> PathBuf {
        self.folder.path().join("capture")
    }

    /// `relumine capture` at a terminal, which is searched for ASCII only.
    fn terminal(&self) -> PtySession {
        let mut command = Command::new(program());
        command.arg("capture").arg(self.capture()).current_dir(self.folder.path());
        spawn_command(command, Some(20_000)).unwrap()
    }

    /// What the camera's program does.
    fn take(&self, name: &str, width: usize, count: u16) {
        let picture = Image::<Counts>::from_pixels(width, 6, vec![[count; 3]; width * 6]);
        fs::write(self.capture().join("incoming").join(name), encode_png_counts(&picture, 16)).unwrap();
    }
}

/// Answers the request to show a pattern, and hears that a picture is waited for.
fn show(terminal: &mut PtySession, pattern: &str) {
    terminal.exp_string(&format!("show {pattern} full screen: ")).unwrap();
    terminal.exp_string(&format!("patterns/{pattern}.png; then press Enter")).unwrap();
    terminal.send_line("").unwrap();
    terminal.exp_string("photograph with 0.5 s: waiting for a new picture in").unwrap();
}

#[track_caller]
fn ends(terminal: &PtySession, code: i32) {
    let status = format!("{:?}", terminal.process().wait().unwrap());
    assert!(status.starts_with("Exited(") && status.ends_with(&format!(", {code})")), "{status}");
}

fn listed(capture: &Path) -> usize {
    fs::read_to_string(capture.join("photographs.csv")).unwrap().lines().count() - 1
}

#[test]
fn a_capture_by_hand_is_stopped_and_gone_on_with() {
    let studio = Studio::new();
    relumine!["plan", &studio.rig(), &studio.capture()].succeeds();
    let mut terminal = studio.terminal();
    terminal.exp_string("position 1 of 1 (p000): bring the projector to azimuth 180.00").unwrap();
    terminal.send_line("").unwrap();
    show(&mut terminal, "black");
    studio.take("wrong.png", 7, 5);
    terminal.exp_string("wrong.png cannot be used: capture.toml promises pictures of 8").unwrap();
    studio.take("IMG_0.png", 8, 0);
    terminal.exp_string("took IMG_0.png").unwrap();
    terminal.exp_string("1 of 6 photographs").unwrap();
    show(&mut terminal, "white");
    studio.take("IMG_1.png", 8, 1000);
    terminal.exp_string("took IMG_1.png").unwrap();
    // Stopped at a question.
    terminal.exp_string("show square-0-0").unwrap();
    terminal.send_line("q").unwrap();
    terminal.exp_string("stopped; 4 photographs are missing").unwrap();
    terminal.exp_string("the same command goes on where it was").unwrap();
    ends(&terminal, 3);
    assert_eq!(listed(&studio.capture()), 2);

    // Stopped while the camera is waited for.
    let mut terminal = studio.terminal();
    terminal.exp_string("going on: 2 of 6 photographs are there").unwrap();
    terminal.exp_string("bring the projector").unwrap();
    terminal.send_line("").unwrap();
    show(&mut terminal, PATTERNS[2]);
    terminal.send_line("q").unwrap();
    terminal.exp_string("stopped; 4 photographs are missing").unwrap();
    ends(&terminal, 3);

    let mut terminal = studio.terminal();
    terminal.exp_string("bring the projector").unwrap();
    terminal.send_line("").unwrap();
    for (index, pattern) in PATTERNS.iter().enumerate().skip(2) {
        show(&mut terminal, pattern);
        studio.take(&format!("IMG_{index}.png"), 8, 250);
        terminal.exp_string(&format!("took IMG_{index}.png")).unwrap();
    }
    terminal.exp_string("4 photographs taken").unwrap();
    terminal.exp_string("6 of 6 are there").unwrap();
    ends(&terminal, 0);
    relumine!["inspect", &studio.capture()].succeeds();
    relumine!["develop", &studio.capture(), "-o", &studio.folder.path().join("field")].succeeds();
    // With nothing to do, nothing is asked.
    let run = relumine!["capture", &studio.capture(), "--verify"].succeeds();
    assert!(run.stderr.contains("0 photographs taken") && !run.stderr.contains("bring"), "{run:#?}");
}

#[test]
fn without_anybody_at_the_rig_the_capture_is_incomplete() {
    let studio = Studio::new();
    relumine!["plan", &studio.rig(), &studio.capture()].succeeds();
    let mut command = Command::new(program());
    let output = command.arg("capture").arg(studio.capture()).stdin(Stdio::null()).output().unwrap();
    Run::of(&output).fails(3, &["stopped; 6 photographs are missing"]);
}

#[test]
fn a_plan_says_what_it_costs_and_writes_only_what_it_is_told_to() {
    let studio = Studio::new();
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/paper-rig.toml");
    let run = relumine!["plan", &example].succeeds();
    for words in ["224", "97 a position (1 of each pattern), 21728 in all", "41.1", "16 bits uncompressed"] {
        assert!(run.stdout.contains(words), "{words}: {run:#?}");
    }
    let run = relumine!["plan", &studio.rig(), "--json"].succeeds();
    for words in ["\"photographs\": 6", "\"bytes_per_photograph\": 288", "\"warnings\": []"] {
        assert!(run.stdout.contains(words), "{words}: {run:#?}");
    }
    assert!(!studio.capture().exists());
    relumine!["plan", &studio.rig(), &studio.folder.path().join("no/capture")].fails(1, &["no is not there"]);
    relumine!["plan", &studio.rig(), &studio.capture()].succeeds();
    relumine!["plan", &studio.rig(), &studio.capture()].fails(1, &["exists already", "--force"]);
    relumine!["plan", &studio.rig(), &studio.capture(), "--force"].succeeds();
    studio.take("IMG_0.png", 8, 0);
    relumine!["plan", &studio.rig(), &studio.capture(), "--force"].fails(1, &["incoming/IMG_0.png"]);
    fs::write(studio.rig(), RIG.replace("exposures_s", "exposure_s")).unwrap();
    relumine!["plan", &studio.rig()].fails(3, &["did you mean `exposures_s`"]);
    relumine!["capture", &studio.folder.path().join("nowhere")].fails(3, &["rig.toml", "relumine plan"]);
}

const SCENE: &str = r#"format = "relumine-scene/1"
[camera]
position = [0, -2, 1.6]
target = [0, 0, 0.05]
horizontal_fov_deg = 20
width = 12
height = 8
[[material]]
name = "grey"
diffuse.reflectance = [0.5, 0.5, 0.5]
[[object]]
material = "grey"
plane.size_m = [0.8, 0.8]
[[object]]
material = "grey"
sphere.radius_m = 0.12
translate_m = [0, 0, 0.12]
"#;

/// A virtual rig of 4 positions, 6 photographs of 2 exposures each.
fn virtual_rig() -> Studio {
    let studio = Studio::new();
    fs::write(studio.folder.path().join("scene.toml"), SCENE).unwrap();
    let rig = RIG
        .replace("\"manual\"", "\"simulated\"")
        .replace("watched-folder", "simulated")
        .replace("tilts = 1", "tilts = 4")
        .replace("width = 8\nheight = 6", "width = 12\nheight = 8")
        .replace("[0.5]", "[0.5, 4]");
    fs::write(studio.rig(), rig + "[simulated]\nscene = \"scene.toml\"\nsamples = 8\nprojector_black = 0.01\n")
        .unwrap();
    studio
}

#[test]
fn a_killed_capture_goes_on_to_the_same_bits() {
    let studio = virtual_rig();
    let captured = |name: &str| {
        let capture = studio.folder.path().join(name);
        relumine!["plan", &studio.rig(), &capture].succeeds();
        capture
    };
    let whole = captured("whole");
    relumine!["capture", &whole].succeeds();
    assert_eq!(listed(&whole), 48);
    let (mut numbers, mut unfinished) = (Numbers(3), 0);
    for attempt in 0..20 {
        let capture = captured(&format!("killed-{attempt}"));
        // Some moment after so many photographs; and once in three, killed twice.
        for _ in 0..=attempt % 3 / 2 {
            let (photographs, rest) = (numbers.below(48), Duration::from_micros(numbers.below(3000) as u64));
            let mut command = Command::new(program());
            command.arg("capture").arg(&capture).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
            let mut child = command.spawn().unwrap();
            while child.try_wait().unwrap().is_none() && listed(&capture) < photographs {
                std::thread::yield_now();
            }
            std::thread::sleep(rest);
            child.kill().unwrap(); // SIGKILL
            child.wait().unwrap();
        }
        unfinished += usize::from(listed(&capture) < 48);
        relumine!["capture", &capture].succeeds();
        assert_same_tree(&capture, &whole);
    }
    assert!(unfinished >= 3, "only {unfinished} of 20 were killed in time");
}
