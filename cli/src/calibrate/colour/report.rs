//! What `relumine calibrate colour` prints.

use std::io::Write;

use relumine::radiometry::colour::{ColourFit, ColourProfile, Errors, Fitted};
use serde_json::json;

use crate::failure::{Failure, printed};

pub(super) fn print(fitted: &Fitted, fit: &ColourFit) -> Result<(), Failure> {
    let mut text = format!("{}, {} patches, {}\n\n", fitted.chart, fitted.patches, fit.correction.model().name());
    for row in fit.correction.coefficients() {
        row.iter().for_each(|value| text += &format!("{value:9.4}"));
        text += "\n";
    }
    text += "\nΔE00         mean  median     max\n";
    for (name, errors) in [("before", &fitted.before), ("after", &fitted.after), ("held out", &fitted.held_out)] {
        let Errors { mean, median, max, worst } = errors;
        text += &format!("{name:9}{mean:8.2}{median:8.2}{max:8.2} ({worst})\n");
    }
    text += "\npatch    before   after  held out\n";
    for patch in &fit.patches {
        let (name, before, after, held_out) =
            (&patch.name, patch.error_before, patch.error_after, patch.error_held_out);
        text += &format!("{name:7}{before:8.2}{after:8.2}{held_out:10.2}\n");
    }
    printed(std::io::stdout().lock().write_all(text.as_bytes()))
}

pub(super) fn print_json(profile: &ColourProfile, fitted: &Fitted, fit: &ColourFit) -> Result<(), Failure> {
    let patches: Vec<_> = fit
        .patches
        .iter()
        .map(|patch| {
            json!({
                "name": patch.name,
                "camera": patch.camera,
                "reference_lab": patch.reference,
                "before_lab": patch.before,
                "after_lab": patch.after,
                "before": patch.error_before,
                "after": patch.error_after,
                "held_out": patch.error_held_out,
            })
        })
        .collect();
    let errors = |errors: &Errors| json!({ "mean": errors.mean, "median": errors.median, "max": errors.max, "worst": errors.worst });
    let report = json!({
        "model": profile.correction.model().name(),
        "coefficients": profile.correction.coefficients(),
        "exposure": fitted.exposure,
        "chart": fitted.chart,
        "reference": fitted.reference,
        "corners": fitted.corners,
        "found": fitted.found,
        "left_out": fitted.left_out,
        "delta_e_2000": {
            "before": errors(&fitted.before),
            "after": errors(&fitted.after),
            "held_out": errors(&fitted.held_out),
        },
        "patches": patches,
    });
    printed(writeln!(std::io::stdout().lock(), "{report:#}"))
}
