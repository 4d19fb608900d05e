//! Response files named on the command line.

use std::path::Path;

use relumine::radiometry::{Response, ResponseCurve, read_text};

use crate::failure::Failure;

/// The curve in a file; `option` is what named it.
pub(crate) fn read_curve(path: &Path, option: &str) -> Result<ResponseCurve, Failure> {
    let text = read_text(path).map_err(|error| {
        let hint = format!("FORMAT.md describes the response files that {option} takes, and --help what else");
        Failure::failed(error.to_string()).with_hint(hint)
    })?;
    ResponseCurve::parse(path, &text)
        .map_err(|error| Failure::incomplete(error.to_string()).with_hint("FORMAT.md describes response files"))
}

/// What `--response` names: `linear`, `srgb`, or a file.
pub(crate) fn named(name: &str) -> Result<Response, Failure> {
    Ok(match name {
        "linear" => Response::Linear,
        "srgb" => Response::Srgb,
        file => Response::Curve(read_curve(Path::new(file), "--response")?),
    })
}
