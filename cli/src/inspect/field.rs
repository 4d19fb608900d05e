//! Looking at a field.

use std::io::Write;
use std::path::Path;

use relumine::basis::{Layout, Reach};
use relumine::{DevelopedReport, ReflectanceField};

use crate::failure::{Failure, printed};

pub(super) fn inspect(path: &Path) -> Result<(), Failure> {
    let field = ReflectanceField::open(path)?;
    let cells = field.cells();
    let (width, height) = field.picture_size();
    let mut out = std::io::stdout().lock();
    let mut line = |name: &str, value: String| printed(writeln!(out, "{name:<14} {value}"));
    line("field", field.header().title.clone().unwrap_or_else(|| "(no title)".into()))?;
    line("positions", positions(cells.partition().layout()))?;
    match cells.reach() {
        Reach::Near { radius_m, pattern } => {
            let (m, h) = (pattern.squares(), pattern.half_width());
            line("squares", format!("{m} × {m}, half width {h}, hemisphere of {radius_m} m"))?;
        }
        Reach::Far => line("lamps", "distant, one cell a lamp".into())?,
    }
    line("cells", cells.len().to_string())?;
    line("pictures", format!("{width} × {height}"))?;
    line("made", field.header().made.to_string())?;
    if let Some(packing) = field.header().packing {
        line(
            "packed",
            format!("to {} % of what all squares of a position show, patch for patch", 100.0 * packing.error),
        )?;
        if let Some(kept) = crate::pack::kept_in_words(&field) {
            line("light", kept)?;
        }
    }
    let reports: Vec<DevelopedReport> =
        field.records().iter().map(|record| DevelopedReport::of(record).unwrap_or_default()).collect();
    for (name, value) in [
        ("combs, %", (|report| report.residual_combs) as fn(&DevelopedReport) -> Option<f64>),
        ("white, %", |report| report.residual_white),
    ] {
        let values: Vec<f64> = reports.iter().filter_map(value).collect();
        if !values.is_empty() {
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let worst = values.iter().copied().fold(0.0, f64::max);
            line("residual", format!("{name:<9} mean {:.3}, worst {:.3}", 100.0 * mean, 100.0 * worst))?;
        }
    }
    for (name, value) in [
        ("cut off below the threshold", (|report| report.cut) as fn(&DevelopedReport) -> Option<f64>),
        ("bias of minima, subtracted", |report| report.bias_subtracted),
        ("hidden by noise, spread", |report| report.spread),
    ] {
        let values: Vec<f64> = reports.iter().filter_map(value).collect();
        if !values.is_empty() {
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let (least, most) =
                values.iter().fold((f64::MAX, f64::MIN), |(a, b), value| (a.min(*value), b.max(*value)));
            line(
                "removed",
                format!("{name}: mean {:.3} % of the light, {:.3} to {:.3}", 100.0 * mean, 100.0 * least, 100.0 * most),
            )?;
        }
    }
    line("per position", "azimuth°  tilt°  black %  combs %  white %  noise     removed %  clipped  missing".into())?;
    for (record, report) in field.records().iter().zip(&reports) {
        let position = cells.partition().positions()[record.position];
        let percent = |value: Option<f64>| value.map_or("–".into(), |value| format!("{:.3}", 100.0 * value));
        line(
            &format!("{:>12}", record.position),
            format!(
                "{:>8.2} {:>6.2} {:>8} {:>8} {:>8}  {:<9} {:>9} {:>8} {:>8}",
                position.azimuth.to_degrees(),
                position.tilt.to_degrees(),
                percent(report.black_level),
                percent(report.residual_combs),
                percent(report.residual_white),
                report.noise.map_or("–".into(), |noise| format!("{noise:.2e}")),
                percent(report.cut.or(report.bias_subtracted).or(report.spread)),
                report.clipped_pixels,
                record.missing.len()
            ),
        )?;
    }
    let missing: usize = field.records().iter().map(|record| record.missing.len()).sum();
    line("missing", format!("{missing} of {} cells", cells.len()))?;
    for loss in reports.iter().flat_map(|report| &report.losses) {
        line("loss", loss.clone())?;
    }
    let damage = field.verify()?;
    for damage in &damage {
        line("damage", damage.to_string())?;
    }
    if damage.is_empty() && missing == 0 {
        return line("whole", "yes: every file has its checksum".into());
    }
    Err(Failure::incomplete(if damage.is_empty() {
        format!("{}: every file is whole, but {missing} cells were not photographed", path.display())
    } else {
        format!("{}: {} files are damaged", path.display(), damage.len())
    }))
}

pub(super) fn inspect_unfinished(path: &Path) -> Result<(), Failure> {
    Err(Failure::incomplete(format!("{} is an unfinished field", path.display()))
        .with_hint("run the command that was making it again: it goes on where it was"))
}

/// The positions in words.
pub(super) fn positions(layout: &Layout) -> String {
    match layout {
        Layout::Grid { azimuths, tilts } => format!("{} ({azimuths} azimuths × {tilts} tilts)", azimuths * tilts),
        Layout::List(positions) => format!("{} (a list)", positions.len()),
    }
}
