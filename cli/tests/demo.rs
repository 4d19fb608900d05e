//! The README's first command, whole: it ends, explains its pictures, and does nothing twice.

#![allow(clippy::unwrap_used)]

mod support;

use std::fs;
use std::time::{Duration, SystemTime};

use relumine::radiometry::files::{self};
use relumine::radiometry::{Difference, Image, Radiance, difference};
use support::{Run, program, relumine};

#[test]
fn the_demonstration_is_whole_goes_on_after_a_kill_and_is_done_once() {
    let folder = tempfile::tempdir().unwrap();
    let demo = folder.path().join("demo");
    // Killed while it photographs.
    let mut child = std::process::Command::new(program()).arg("demo").arg(&demo).arg("--quiet").spawn().unwrap();
    let table = demo.join("capture/photographs.csv");
    let patience = SystemTime::now() + Duration::from_secs(120);
    while fs::metadata(&table).map_or(0, |table| table.len()) < 100_000 && SystemTime::now() < patience {
        std::thread::sleep(Duration::from_millis(20));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(!demo.join("index.html").exists(), "it was over before it could be killed");

    let run = |words: &[&str]| {
        let output = std::process::Command::new(program()).arg("demo").arg(&demo).args(words).output().unwrap();
        Run::of(&output)
    };
    let said = run(&[]).succeeds().stderr;
    assert!(said.contains("11008 photographs") && said.contains("done in"), "{said}");
    let page = fs::read_to_string(demo.join("index.html")).unwrap();
    // Every picture and file that the page names is there.
    for kind in ["src=\"", "href=\""] {
        for name in page.split(kind).skip(1).map(|rest| rest.split('"').next().unwrap()) {
            assert!(demo.join(name).is_file(), "index.html names {name}");
        }
    }
    // What the page says of the pictures is so: the light field is near the truth, the light map is not.
    let picture = |name: &str| -> Image<Radiance> {
        files::read_linear(&demo.join(format!("pictures/{name}.exr"))).unwrap().reinterpret()
    };
    let off = |name: &str, truth: &str| -> Difference {
        difference(&picture(name), &picture(&format!("{truth}-truth")), None, false).unwrap()
    };
    for name in ["spots", "shafts", "moved-1", "moved-2", "moved-3"] {
        let found = off(name, name);
        println!("{name}: {:.3} relative L2, ratio of means {:.3}", found.relative_l2, found.ratio_of_means);
        assert!(found.relative_l2 < 0.45 && (found.ratio_of_means - 1.0).abs() < 0.06, "{name}: {found:?}");
    }
    for name in ["spots", "shafts"] {
        assert!(off(&format!("{name}-light-map"), name).relative_l2 > 1.0, "{name} as a light map");
    }
    // Done once.
    let before = fs::metadata(demo.join("index.html")).unwrap().modified().unwrap();
    let said = run(&[]).succeeds().stderr;
    assert!(said.contains("already there"), "{said}");
    assert_eq!(fs::metadata(demo.join("index.html")).unwrap().modified().unwrap(), before);

    // And the photographs are whole, as far as anybody can tell.
    relumine!("inspect", &demo.join("capture")).succeeds();
}

#[test]
fn a_folder_with_something_else_in_it_is_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("thesis.tex"), "years of work").unwrap();
    relumine!("demo", &folder.path().to_path_buf()).fails(1, &["something else lies there"]);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}
