//! Looking at a capture.

use std::io::Write;
use std::path::Path;

use relumine::{Capture, CaptureCheck};

use crate::failure::{Failure, printed};

pub(super) fn inspect(path: &Path) -> Result<(), Failure> {
    let capture = Capture::open(path)?;
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
    let CaptureCheck { missing, damaged, verified, unlisted } = CaptureCheck::of(&capture);
    line("checksums", format!("{verified} photographs verified, {unlisted} without a checksum"))?;
    for (position, pattern) in &missing {
        line("missing", format!("position {position}, {pattern}"))?;
    }
    for damage in &damaged {
        line("damaged", damage.clone())?;
    }
    if missing.is_empty() && damaged.is_empty() {
        return line("whole", "yes".into());
    }
    Err(Failure::incomplete(format!(
        "{}: {} photographs are missing, {} damaged",
        path.display(),
        missing.len(),
        damaged.len()
    ))
    .with_hint("`relumine develop` develops what is there and lists the rest"))
}
