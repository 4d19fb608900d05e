//! Looking at a capture: what was set up, whether its photographs are there, and what they show.

use std::io::Write;
use std::path::Path;

use relumine::{Capture, CaptureCheck, CaptureJudgement, Error, Severity};

use crate::failure::{Failure, printed};
use crate::progress::Talk;

/// How a capture is looked at.
#[derive(Clone, Copy)]
pub(super) struct Look {
    /// Whether the report is JSON.
    pub(super) json: bool,
    /// Whether pictures are left undecoded.
    pub(super) checksums_only: bool,
}

/// A capture and what there is to say of it.
pub(super) struct Report {
    pub(super) capture: Capture,
    pub(super) check: CaptureCheck,
    /// Or why it was not judged.
    pub(super) judgement: Result<CaptureJudgement, String>,
}

impl Report {
    fn of(path: &Path, look: Look, talk: &Talk) -> Result<Self, Failure> {
        let capture = Capture::open(path)?;
        if look.checksums_only {
            let check = CaptureCheck::of(&capture);
            return Ok(Self { capture, check, judgement: Err("--checksums-only".into()) });
        }
        let bar = talk.bar("positions judged", capture.setup().cells().positions(), 0);
        let judged = CaptureJudgement::of(Capture::open(path)?, || bar.inc(1));
        bar.finish_and_clear();
        match judged {
            Ok(judgement) => Ok(Self { capture, check: judgement.check.clone(), judgement: Ok(judgement) }),
            Err(error @ Error::Capture(_)) => {
                let check = CaptureCheck::of(&capture);
                Ok(Self { capture, check, judgement: Err(error.to_string()) })
            }
            Err(error) => Err(error.into()),
        }
    }

    pub(super) fn faults(&self) -> usize {
        let findings = self.judgement.iter().flat_map(|judgement| &judgement.findings);
        findings.filter(|finding| finding.severity == Severity::Fault).count()
    }

    pub(super) fn is_whole(&self) -> bool {
        self.check.missing.is_empty() && self.check.damaged.is_empty()
    }
}

pub(super) fn inspect(path: &Path, look: Look, talk: &Talk) -> Result<(), Failure> {
    let report = Report::of(path, look, talk)?;
    if look.json {
        let text = super::capture_json::report(&report);
        printed(writeln!(std::io::stdout().lock(), "{text:#}"))?;
    } else {
        print(&report)?;
    }
    let (missing, damaged) = (report.check.missing.len(), report.check.damaged.len());
    if !report.is_whole() {
        return Err(Failure::incomplete(format!(
            "{}: {missing} photographs are missing, {damaged} damaged",
            path.display()
        ))
        .with_hint("`relumine develop` develops what is there and lists the rest"));
    }
    match report.faults() {
        0 => Ok(()),
        faults => Err(Failure::incomplete(format!(
            "{}: {faults} fault(s) in its photographs: a field developed from them is wrong there",
            path.display()
        ))
        .with_hint("correct photographs.csv, or take the named photographs again")),
    }
}

fn print(report: &Report) -> Result<(), Failure> {
    let capture = &report.capture;
    let setup = capture.setup();
    let cells = setup.cells();
    let (width, height) = setup.picture_size();
    let (black, white) = setup.levels();
    let mut out = std::io::stdout().lock();
    let mut line = |name: &str, value: String| printed(writeln!(out, "{name:<14} {value}"));
    line("capture", setup.title().unwrap_or("(no title)").into())?;
    line("positions", super::field::positions(cells.partition().layout()))?;
    line("squares", format!("{0} × {0}, scheme \"{1}\"", cells.squares(), setup.scheme().name()))?;
    line("cells", cells.len().to_string())?;
    line("pictures", format!("{width} × {height}, response \"{}\", counts {black} to {white}", setup.response_name()))?;
    line("photographs", capture.photographs().len().to_string())?;
    for remark in capture.remarks() {
        line("remark", remark.to_string())?;
    }
    let CaptureCheck { missing, damaged, verified, unlisted } = &report.check;
    line("checksums", format!("{verified} photographs verified, {unlisted} without a checksum"))?;
    for (position, pattern) in missing {
        line("missing", format!("position {position}, {pattern}"))?;
    }
    for damage in damaged {
        line("damaged", damage.clone())?;
    }
    if report.is_whole() {
        line("whole", "yes".into())?;
    }
    match &report.judgement {
        Err(reason) => line("judged", format!("no: {reason}")),
        Ok(judgement) => print_judgement(judgement, &mut line),
    }
}

fn print_judgement(
    judgement: &CaptureJudgement,
    line: &mut dyn FnMut(&str, String) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let percent = |values: Vec<f64>| spread(values.into_iter().map(|value| 100.0 * value).collect());
    let positions = &judgement.positions;
    for (name, figures, unit) in [
        ("black", percent(positions.iter().filter_map(|position| position.black_share).collect()), "% of white"),
        (
            "contradiction",
            percent(positions.iter().filter_map(|position| position.contradiction).collect()),
            "% of the combs' light that does not add up",
        ),
        (
            "lamp",
            percent(positions.iter().filter_map(|position| position.drift).collect()),
            "% change within a position",
        ),
    ] {
        if let Some(figures) = figures {
            line(name, format!("{figures} {unit}"))?;
        }
    }
    let unregistered = positions.iter().filter(|position| position.shifts.iter().all(Option::is_none)).count();
    if unregistered > 0 {
        let of = positions.len();
        line(
            "not told",
            format!("whether the camera moved at {unregistered} of {of} positions: too few edges in common"),
        )?;
    }
    let unadded = positions.iter().filter(|position| position.contradiction.is_none()).count();
    if unadded > 0 {
        let of = positions.len();
        line(
            "not told",
            format!("whether photographs add up at {unadded} of {of} positions: too many missing or clipped"),
        )?;
    }
    for finding in &judgement.findings {
        line(finding.severity.name(), finding.to_string())?;
    }
    line("findings", if judgement.findings.is_empty() { "none".into() } else { judgement.findings.len().to_string() })
}

/// Median and range.
fn spread(mut values: Vec<f64>) -> Option<String> {
    values.sort_by(f64::total_cmp);
    let (first, last) = (values.first()?, values.last()?);
    Some(format!("median {:.3}, {first:.3} to {last:.3}", values[values.len() / 2]))
}
