//! What there is to say of a capture, as JSON (FORMAT.md §7).

use std::path::Path;

use relumine::{Finding, PositionJudgement};
use serde_json::{Value, json};

use super::capture::Report;

/// The report of a capture.
pub(super) fn report(report: &Report) -> Value {
    let capture = &report.capture;
    let setup = capture.setup();
    let (width, height) = setup.picture_size();
    let missing = report.check.missing.iter();
    let judged = report.judgement.as_ref();
    json!({
        "format": "relumine-capture-report/1",
        "title": setup.title(),
        "positions": setup.cells().positions(),
        "squares": setup.cells().squares(),
        "scheme": setup.scheme().name(),
        "picture": [width, height],
        "photographs": capture.photographs().len(),
        "remarks": capture.remarks().iter().map(ToString::to_string).collect::<Vec<_>>(),
        "checksums": { "verified": report.check.verified, "unlisted": report.check.unlisted },
        "missing": missing.map(|(position, pattern)| json!({ "position": position, "pattern": pattern.to_string() }))
            .collect::<Vec<_>>(),
        "damaged": report.check.damaged,
        "whole": report.is_whole(),
        "judged": judged.is_ok(),
        "not_judged_because": judged.err(),
        "faults": report.faults(),
        "findings": judged.map_or(&[][..], |judgement| &judgement.findings).iter().map(finding).collect::<Vec<_>>(),
        "by_position": judged.map_or(&[][..], |judgement| &judgement.positions).iter().map(position).collect::<Vec<_>>(),
    })
}

fn finding(finding: &Finding) -> Value {
    json!({
        "kind": finding.kind.name(),
        "severity": finding.severity.name(),
        "position": finding.position,
        "patterns": finding.patterns.iter().map(ToString::to_string).collect::<Vec<_>>(),
        "files": finding.files.iter().map(|file| name(file)).collect::<Vec<_>>(),
        "measured": finding.measured,
        "expected": finding.expected,
        "unit": finding.kind.unit(),
        "text": finding.text,
    })
}

fn position(judgement: &PositionJudgement) -> Value {
    let patterns = judgement.patterns.iter().map(|exposure| {
        json!({
            "pattern": exposure.pattern.to_string(),
            "over_exposed": exposure.over_exposed,
            "under_exposed": exposure.under_exposed,
            "files": exposure.files.iter().map(|file| name(file)).collect::<Vec<_>>(),
        })
    });
    json!({
        "position": judgement.position,
        "black_share": judgement.black_share,
        "contradiction": judgement.contradiction,
        "drift": judgement.drift,
        "patch_drift": judgement.patch_drift,
        "shifts": judgement.shifts,
        "patterns": patterns.collect::<Vec<_>>(),
    })
}

/// With the separator that every system reads, as photographs.csv has it.
fn name(file: &Path) -> String {
    file.iter().map(|part| part.to_string_lossy()).collect::<Vec<_>>().join("/")
}
