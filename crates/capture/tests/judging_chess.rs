//! The chess capture, rendered and photographed by a renderer that is not ours, is without fault; defects put into a copy are found.
//!
//! The capture lies beside the project, in `../shared/data`; without it these tests say so and pass.

#![cfg(unix)]
#![allow(clippy::unwrap_used)] // in helpers of tests too

use std::fs;
use std::path::{Path, PathBuf};

use relumine_capture::separation::Method;
use relumine_capture::{Capture, Developer, Finding, FindingKind, Judge, PositionJudgement};
use relumine_radiometry::files::{self, Picture};
use relumine_radiometry::{Counts, Image};

fn data() -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/chess-capture");
    if path.join("capture.toml").exists() {
        return Some(path.canonicalize().unwrap());
    }
    eprintln!("skipped: {} is not there, so no capture of another program is judged", path.display());
    None
}

/// A capture of the chess photographs whose table can be changed.
struct Copy {
    folder: tempfile::TempDir,
    data: PathBuf,
    table: String,
}

impl Copy {
    fn of(data: &Path) -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::os::unix::fs::symlink(data.join("photographs"), folder.path().join("photographs")).unwrap();
        fs::create_dir(folder.path().join("changed")).unwrap();
        for name in ["capture.toml", "response.csv"] {
            fs::copy(data.join(name), folder.path().join(name)).unwrap();
        }
        let table = fs::read_to_string(data.join("photographs.csv")).unwrap();
        Self { folder, data: data.to_path_buf(), table }
    }

    /// Puts other files in the places of files. Checksums go with the names, so that they stay right.
    fn rename(&mut self, change: &dyn Fn(&str) -> Option<String>) {
        let line = |line: &str| {
            let fields: Vec<&str> = line.split(',').collect();
            match change(fields[5]) {
                Some(file) => format!("{},{file},\n", fields[..5].join(",")),
                None => format!("{},\n", fields[..6].join(",")),
            }
        };
        let (header, rows) = self.table.split_once('\n').unwrap();
        self.table = format!("{header}\n{}", rows.lines().map(line).collect::<String>());
    }

    fn exchange(&mut self, a: &str, b: &str) {
        self.rename(&|file| {
            [(a, b), (b, a)].iter().find(|(from, _)| file.contains(from)).map(|(from, to)| file.replace(from, to))
        });
    }

    /// Replaces the photographs whose name contains `name` by changed ones.
    fn change(&mut self, name: &str, change: impl Fn(&Image<Counts>, usize, usize) -> [u16; 3]) {
        let files: Vec<String> =
            self.table.lines().skip(1).map(|line| line.split(',').nth(5).unwrap().into()).collect();
        for file in files.iter().filter(|file| file.contains(name)) {
            let Picture::Integer { image, .. } = files::read_picture(&self.data.join(file)).unwrap() else { panic!() };
            let (width, height) = image.size();
            let pixels = (0..width * height).map(|pixel| change(&image, pixel % width, pixel / width)).collect();
            let changed = Image::<Counts>::from_pixels(width, height, pixels);
            let to = self.folder.path().join("changed").join(file.replace('/', "_"));
            files::write_png_counts(&to, &changed, 8).unwrap();
        }
        self.rename(&|file| file.contains(name).then(|| format!("changed/{}", file.replace('/', "_"))));
    }

    fn judge(&self) -> Vec<Finding> {
        fs::write(self.folder.path().join("photographs.csv"), &self.table).unwrap();
        findings(self.folder.path())
    }
}

fn findings(capture: &Path) -> Vec<Finding> {
    let developer = Developer::new(Capture::open(capture).unwrap(), Method::default(), None).unwrap();
    let judge = Judge::new(&developer);
    let positions = 0..judge.capture().setup().cells().positions();
    let judgements: Vec<PositionJudgement> = positions.map(|position| judge.position(position)).collect();
    let across = judge.across(&judgements);
    assert!(judgements.iter().all(|judgement| judgement.damaged.is_empty()));
    let figure = |value: &dyn Fn(&PositionJudgement) -> Option<f64>| {
        let mut values: Vec<f64> = judgements.iter().filter_map(value).collect();
        values.sort_by(f64::total_cmp);
        (values[0], values[values.len() / 2], values[values.len() - 1])
    };
    println!("contradiction {:.4?}", figure(&|judgement| judgement.contradiction));
    println!("drift {:.5?}", figure(&|judgement| judgement.drift));
    println!("black share {:.5?}", figure(&|judgement| judgement.black_share));
    println!("shift {:.2?}", figure(&|judgement| judgement.shifts[0].map(|(dx, dy)| dx.hypot(dy))));
    let found: Vec<Finding> = judgements.into_iter().flat_map(|judgement| judgement.findings).chain(across).collect();
    found.iter().for_each(|finding| println!("{finding}"));
    found
}

fn names(finding: &Finding) -> Vec<String> {
    finding.files.iter().map(|file| file.display().to_string()).collect()
}

#[test]
fn nothing_is_wrong_with_the_chess_capture() {
    let Some(data) = data() else { return };
    assert_eq!(findings(&data), []);
}

#[test]
fn defects_put_into_a_copy_are_found_and_nothing_else() {
    let Some(data) = data() else { return };
    let mut copy = Copy::of(&data);
    // A row comb and a column comb, both exposures; two combs that no sum tells apart; one photograph of each of two patterns.
    copy.exchange("p003/row-4-1", "p003/column-2-0");
    copy.exchange("p010/row-1-1", "p010/row-4-1");
    copy.exchange("p020/row-3-2_e1", "p020/column-5-0_e1");
    copy.change("p030/", |image, x, y| image.pixel((x + 142) % 144, y));
    copy.change("p000/", |image, x, y| image.pixel(x, (y + 1) % 96));
    copy.change("p040/column-4-1_", |_, _, _| [0; 3]);
    copy.change("p041/row-4-1_e1", |_, _, _| [0; 3]);
    let found = copy.judge();
    let mut told: Vec<(usize, FindingKind, Vec<String>)> =
        found.iter().map(|finding| (finding.position, finding.kind, names(finding))).collect();
    told.sort();
    let files = |names: &[&str]| names.iter().map(|name| format!("photographs/{name}.png")).collect::<Vec<_>>();
    let changed =
        |names: &[&str]| names.iter().map(|name| format!("changed/photographs_{name}.png")).collect::<Vec<_>>();
    let expected = vec![
        (0, FindingKind::CameraMoved, changed(&["p000_white_e0", "p000_white_e1"])),
        (
            3,
            FindingKind::Swapped,
            files(&["p003/column-2-0_e0", "p003/column-2-0_e1", "p003/row-4-1_e0", "p003/row-4-1_e1"]),
        ),
        (
            10,
            FindingKind::Swapped,
            files(&["p010/row-4-1_e0", "p010/row-4-1_e1", "p010/row-1-1_e0", "p010/row-1-1_e1"]),
        ),
        (20, FindingKind::Swapped, files(&["p020/column-5-0_e1", "p020/row-3-2_e1"])),
        (30, FindingKind::CameraMoved, changed(&["p030_white_e0", "p030_white_e1"])),
        (40, FindingKind::Blank, changed(&["p040_column-4-1_e0", "p040_column-4-1_e1"])),
        (41, FindingKind::Blank, changed(&["p041_row-4-1_e1"])),
    ];
    assert_eq!(told, expected);
    let moved = found.iter().find(|finding| finding.position == 30).unwrap();
    assert!((moved.measured - 2.0).abs() < 0.3, "{moved}");
}
