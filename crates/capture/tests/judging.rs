//! Defects put one at a time into a capture of a known world are found and named, and nothing else is accused.

#![allow(clippy::unwrap_used)] // in helpers of tests too

#[path = "support/painted.rs"]
mod painted;

use std::fs;

use painted::{Painted, World};
use relumine_capture::separation::Method;
use relumine_capture::{Capture, Developer, Finding, FindingKind, Judge, PositionJudgement, Severity};

fn judged(capture: &Painted) -> (Vec<PositionJudgement>, Vec<Finding>) {
    let developer = Developer::new(Capture::open(capture.path()).unwrap(), Method::default(), None).unwrap();
    let judge = Judge::new(&developer);
    let positions = 0..judge.capture().setup().cells().positions();
    let judgements: Vec<PositionJudgement> = positions.map(|position| judge.position(position)).collect();
    let own = judgements.iter().flat_map(|judgement| judgement.findings.clone());
    let found: Vec<Finding> = own.chain(judge.across(&judgements)).collect();
    found.iter().for_each(|finding| println!("{finding}"));
    (judgements, found)
}

/// What was found: kind, severity, position, patterns in the order of their names.
fn told(capture: &Painted) -> Vec<(FindingKind, Severity, usize, String)> {
    let (judgements, found) = judged(capture);
    assert!(judgements.iter().all(|judgement| judgement.damaged.is_empty()));
    found
        .iter()
        .map(|finding| {
            let mut patterns: Vec<String> = finding.patterns.iter().map(ToString::to_string).collect();
            patterns.sort();
            // Every finding about patterns names files, and files of these patterns only.
            for file in &finding.files {
                let file = file.display().to_string();
                let of = |pattern: &String| file.contains(&format!("p{:03}/{pattern}_", finding.position));
                let exchanged = finding.kind == FindingKind::Swapped || finding.kind == FindingKind::Exposures;
                assert!(exchanged || patterns.iter().any(of), "{finding}");
            }
            assert_eq!(patterns.is_empty(), finding.files.is_empty(), "{finding}");
            (finding.kind, finding.severity, finding.position, patterns.join(" "))
        })
        .collect()
}

/// Exactly one finding.
#[track_caller]
fn is_told(capture: &Painted, kind: FindingKind, severity: Severity, position: usize, patterns: &str) {
    assert_eq!(told(capture), [(kind, severity, position, patterns.to_string())]);
}

use FindingKind::{
    BlackFrame, Blank, CameraMoved, Contradiction, Exposures, LampDrift, OverExposed, Swapped, UnderExposed,
};
use Severity::{Fault, Warning};

#[test]
fn nothing_is_wrong_with_a_good_capture() {
    for world in [World::default(), World::squares(), World { spacing: 1, ..World::default() }] {
        assert_eq!(told(&world.photographed()), []);
    }
}

#[test]
fn exchanged_photographs_are_found_whatever_they_are() {
    let capture = World::default().photographed();
    for (a, b) in [
        ("column-2-1", "row-3-0"),
        ("row-1-0", "row-4-2"),
        ("column-0-1", "column-5-0"),
        // No sum tells these apart: same columns, rows 3 apart.
        ("row-1-2", "row-4-2"),
        ("column-2-0", "column-5-0"),
        ("black", "row-2-1"),
        ("column-3-1", "white"),
        ("black", "white"),
    ] {
        let exchanged = capture.copy();
        exchanged.exchange(1, a, b);
        println!("{a} and {b}");
        is_told(&exchanged, Swapped, Fault, 1, &format!("{a} {b}"));
    }
}

#[test]
fn rows_exchanged_where_combs_are_whole_rows_are_found() {
    let capture = World { spacing: 1, ..World::default() }.photographed();
    capture.exchange(0, "row-1-0", "row-3-0");
    is_told(&capture, Swapped, Fault, 0, "row-1-0 row-3-0");
}

#[test]
fn single_squares_exchanged_are_found() {
    let capture = World::squares().photographed();
    let exchanged = capture.copy();
    exchanged.exchange(2, "square-1-1", "square-3-2");
    is_told(&exchanged, Swapped, Fault, 2, "square-1-1 square-3-2");
    let exchanged = capture.copy();
    exchanged.exchange(2, "square-1-1", "white");
    is_told(&exchanged, Swapped, Fault, 2, "square-1-1 white");
}

#[test]
fn two_pairs_exchanged_in_one_position_are_both_found() {
    let capture = World::default().photographed();
    capture.exchange(1, "column-2-1", "row-3-0");
    capture.exchange(1, "column-4-2", "row-1-1");
    let mut found = told(&capture);
    found.sort();
    let swapped = |patterns: &str| (Swapped, Fault, 1, patterns.to_string());
    assert_eq!(found, [swapped("column-2-1 row-3-0"), swapped("column-4-2 row-1-1")]);
}

#[test]
fn one_exposure_of_each_of_two_patterns_exchanged_is_found_with_its_files() {
    let capture = World::default().photographed();
    capture.exchange_files("p002/row-2-0_e1", "p002/column-3-1_e1");
    let (_, found) = judged(&capture);
    let [finding] = &found[..] else { panic!("{found:?}") };
    let mut files: Vec<String> = finding.files.iter().map(|file| file.display().to_string()).collect();
    files.sort();
    assert_eq!(finding.kind, Swapped);
    assert_eq!(files, ["photographs/p002/column-3-1_e1.png", "photographs/p002/row-2-0_e1.png"]);
}

#[test]
fn a_pattern_that_was_not_shown_is_found() {
    let capture = World::default().photographed();
    for pattern in ["row-3-1", "column-0-2", "white"] {
        let blank = capture.copy();
        blank.replace(1, pattern, "black");
        is_told(&blank, Blank, Fault, 1, pattern);
    }
    let blank = World::squares().photographed();
    blank.replace(1, "square-2-2", "black");
    is_told(&blank, Blank, Fault, 1, "square-2-2");
}

#[test]
fn one_exposure_that_was_not_lit_is_found_with_its_file() {
    let capture = World::default().photographed();
    capture.replace_file("p001/row-3-1_e1", "p001/black_e1");
    let (_, found) = judged(&capture);
    let [finding] = &found[..] else { panic!("{found:?}") };
    assert_eq!((finding.kind, finding.files.len()), (Blank, 1));
    assert_eq!(finding.patterns[0].to_string(), "row-3-1");
}

#[test]
fn light_in_the_room_is_told_from_light_in_the_black_frame() {
    let alone = World::default().photographed_with(&|place, radiance| {
        if place.is(1, "black") { radiance.map(|value| value + 0.004) } else { radiance }
    });
    is_told(&alone, BlackFrame, Fault, 1, "black");
    let (judgements, found) = judged(&alone);
    // Black shows 0.5 % of white; the others say so.
    assert!((found[0].expected - 0.005).abs() < 0.001, "{}", found[0]);
    assert!(found[0].measured > 0.01 && judgements[0].black_share.unwrap() < 0.006);
    let all_the_time = World::default().photographed_with(&|place, radiance| {
        if place.position == 1 { radiance.map(|value| value + 0.004) } else { radiance }
    });
    is_told(&all_the_time, BlackFrame, Warning, 1, "black");
}

#[test]
fn a_wrong_exposure_time_is_found() {
    let one = World::default().photographed();
    one.edit(|table| table.replacen("1,row-2-1,6,", "1,row-2-1,12,", 1));
    is_told(&one, Exposures, Fault, 1, "row-2-1");
    let both = World::default().photographed();
    both.edit(|table| table.replacen("1,row-2-1,6,", "1,row-2-1,12,", 1).replacen("1,row-2-1,1,", "1,row-2-1,2,", 1));
    is_told(&both, Contradiction, Fault, 1, "row-2-1");
    assert!((judged(&both).1[0].measured - 0.5).abs() < 0.02);
    let white = World::default().photographed();
    white.edit(|table| table.replacen("1,white,6,", "1,white,9,", 1).replacen("1,white,1,", "1,white,1.5,", 1));
    is_told(&white, Contradiction, Fault, 1, "white");
}

#[test]
fn a_photograph_of_another_position_is_found() {
    let capture = World::default().photographed();
    capture.replace_from(1, "row-2-1", 3);
    is_told(&capture, Contradiction, Fault, 1, "row-2-1");
}

#[test]
fn a_camera_that_moved_is_found() {
    for (position, dx, dy) in [(0, 1.0, 0.5), (2, 0.0, 1.0), (4, -2.0, 1.0)] {
        let world = World { moved: Some((position, "", [dx, dy])), ..World::default() };
        let capture = world.photographed();
        is_told(&capture, CameraMoved, Fault, position, "white");
        let moved = f64::hypot(dx, dy);
        assert!((judged(&capture).1[0].measured - moved).abs() < 0.3);
    }
    // Between the row combs and the column combs.
    let capture = World { moved: Some((3, "column", [1.0, 0.0])), ..World::default() }.photographed();
    let found = told(&capture);
    assert_eq!(found.iter().filter(|found| found.0 == CameraMoved && found.2 == 3).count(), 1, "{found:?}");
    assert!(found.iter().all(|found| found.2 == 3));
}

#[test]
fn a_lamp_that_drifts_is_found_and_measured() {
    for drift in [0.04, -0.02] {
        let capture = World { drift: Some((2, drift)), ..World::default() }.photographed();
        is_told(&capture, LampDrift, Warning, 2, "");
        let measured = judged(&capture).1[0].measured;
        assert!((measured / drift - 1.0).abs() < 0.15, "{measured} of {drift}");
    }
}

#[test]
fn over_and_under_exposed_photographs_are_named() {
    let over = World::default().photographed_with(&|place, radiance| {
        if place.is(1, "white") || place.is(1, "row-2-1") { radiance.map(|value| 3.0 * value) } else { radiance }
    });
    let found = told(&over);
    assert_eq!(found[0], (OverExposed, Warning, 1, "row-2-1 white".into()), "{found:?}");
    let under = World::default().photographed_with(&|_, radiance| radiance.map(|value| 0.004 * value));
    let found = told(&under);
    assert_eq!(found.iter().filter(|found| found.0 == UnderExposed && found.3 == "white").count(), 5, "{found:?}");
}

#[test]
fn a_photograph_that_does_not_decode_is_damaged_and_accuses_nothing() {
    let capture = World::default().photographed();
    fs::write(capture.path().join("photographs/p001/row-2-1_e0.png"), b"no picture").unwrap();
    capture.edit(|table| table.lines().map(|line| format!("{}\n", painted::without_sum(line))).collect());
    let (judgements, found) = judged(&capture);
    assert_eq!(found, []);
    assert_eq!(judgements[1].damaged.len(), 1);
    assert!(judgements[1].damaged[0].to_string().contains("row-2-1"), "{}", judgements[1].damaged[0]);
}

#[test]
fn the_judgement_does_not_depend_on_the_number_of_threads() {
    let capture = World { drift: Some((2, 0.03)), ..World::default() }.photographed();
    capture.exchange(1, "row-1-2", "row-4-2");
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| format!("{:?}", judged(&capture)))
    };
    assert_eq!(on(1), on(3));
}
