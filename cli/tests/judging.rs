//! `relumine inspect` of captures in which photographs stand in each other's place, as text and as JSON.

#![allow(clippy::unwrap_used)] // in helpers of tests too

mod support;

use serde_json::Value;
use support::relumine;
use support::studio::{Camera, Plan, Studio};

fn studio() -> Studio {
    Studio::new(&Plan { size: (40, 24), camera: Camera::Srgb8, ..Plan::default() })
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

/// Lets two patterns trade their photographs, all exposures.
fn exchange(studio: &Studio, position: usize, a: &str, b: &str) {
    let name = |pattern: &str| format!("p{position:03}/{pattern}_");
    studio.edit("photographs.csv", |text| {
        let line = |line: &str| {
            let (file, rest) = (line.split(',').nth(5).unwrap(), line.split(',').collect::<Vec<_>>());
            let other = if file.contains(&name(a)) {
                file.replace(&name(a), &name(b))
            } else if file.contains(&name(b)) {
                file.replace(&name(b), &name(a))
            } else {
                return format!("{line}\n");
            };
            format!("{},{other},\n", rest[..5].join(","))
        };
        text.lines().map(line).collect()
    });
}

#[test]
fn a_good_capture_is_reported_without_findings() {
    let studio = studio();
    let told = relumine!["inspect", &studio.capture()].succeeds().stdout;
    assert!(told.contains("whole          yes") && told.contains("findings       none"), "{told}");
    let report = json(&relumine!["inspect", &studio.capture(), "--json"].succeeds().stdout);
    assert_eq!(report["format"], "relumine-capture-report/1");
    assert_eq!((&report["whole"], &report["judged"], &report["faults"]), (&true.into(), &true.into(), &0.into()));
    assert_eq!(report["findings"], Value::Array(vec![]));
    assert_eq!(report["photographs"], 4 * 18 * 2);
    let positions = report["by_position"].as_array().unwrap();
    assert_eq!(positions.len(), 4);
    for position in positions {
        assert!((position["black_share"].as_f64().unwrap() - 0.01).abs() < 0.002, "{position}");
        assert!(position["contradiction"].as_f64().unwrap() < 0.02, "{position}");
        assert_eq!(position["patterns"].as_array().unwrap().len(), 18);
        assert_eq!(position["patterns"][0]["files"].as_array().unwrap().len(), 2);
    }
    // The description inside means the same capture.
    let again = relumine!["inspect", &studio.capture().join("capture.toml"), "--json"].succeeds();
    assert_eq!(json(&again.stdout), report);
}

#[test]
fn exchanged_photographs_are_a_fault_with_their_files() {
    let studio = studio();
    exchange(&studio, 2, "row-1-0", "column-2-1");
    let told = relumine!["inspect", &studio.capture()].fails(3, &["1 fault(s)", "photographs.csv"]);
    assert!(
        told.stdout.contains("fault          position 2, swapped: the photographs of row-1-0 and column-2-1"),
        "{told:#?}"
    );
    let run = relumine!["inspect", &studio.capture(), "--json"].fails(3, &["1 fault(s)"]);
    let report = json(&run.stdout);
    let finding = &report["findings"][0];
    assert_eq!((&finding["kind"], &finding["severity"]), (&"swapped".into(), &"fault".into()));
    assert_eq!((&finding["position"], &report["faults"]), (&2.into(), &1.into()));
    let names: Vec<&str> = finding["files"].as_array().unwrap().iter().map(|name| name.as_str().unwrap()).collect();
    let of = |pattern: &str| [0, 1].map(|exposure| format!("photographs/p002/{pattern}_e{exposure}.png"));
    assert_eq!(names, [of("column-2-1"), of("row-1-0")].concat());
    // Checksums say nothing against it.
    let told = relumine!["inspect", &studio.capture(), "--checksums-only"].succeeds().stdout;
    assert!(told.contains("judged         no"), "{told}");
}

#[test]
fn json_is_of_captures_and_what_is_not_judged_says_why() {
    let studio = studio();
    relumine!["inspect", &studio.sky(), "--json"].fails(2, &["--json", "captures"]);
    studio.edit("capture.toml", |text| {
        text.replace("response = \"srgb\"", "response = \"linear\"\nreference_patch = [0, 0, 2, 41]")
    });
    relumine!["inspect", &studio.capture()].fails(3, &["reference_patch", "40 × 24", "[0, 0, 2, 41]"]);
}
