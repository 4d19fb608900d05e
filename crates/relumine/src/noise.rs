//! What a developed field says of the noise of its photographs.

use relumine_capture::separation::Method;
use relumine_field::ReflectanceField;
use relumine_relight::{FieldNoise, PhotographNoise, SeparationNoise};

use crate::{DevelopedReport, Error};

/// What the photographs of a field are uncertain by, for [`relumine_relight::StandardErrors`].
///
/// # Errors
/// If the field does not carry it: it was imported, rendered, packed, corrected in colour, developed by an older program, or separated by a
/// minimum, whose errors are mostly not noise.
pub fn field_noise(field: &ReflectanceField) -> Result<FieldNoise, Error> {
    let path = field.path().to_path_buf();
    let none = |reason: String| Error::NoNoise { path: path.clone(), reason };
    let made = &field.header().made;
    let text = |key: &str| made.get(key).and_then(serde_json::Value::as_str).unwrap_or("");
    if field.is_packed() {
        return Err(none("packing rounds squares in the dark, which a standard error needs".into()));
    }
    if text("from") != "capture" {
        return Err(none("it was not developed from a capture".into()));
    }
    if !text("colour").is_empty() {
        return Err(none("its colours were corrected, and its noise is of the camera's channels".into()));
    }
    let number = |value: &serde_json::Value| value.as_f64().filter(|flux| flux.is_finite() && *flux > 0.0);
    let flux: Option<Vec<f64>> = made
        .get("square_flux_w")
        .and_then(serde_json::Value::as_array)
        .and_then(|all| all.iter().map(number).collect());
    let Some(mut square_flux) = flux else {
        return Err(none("it was developed by a version that did not measure noise".into()));
    };
    let squares = field.cells().squares();
    if square_flux.len() == 1 {
        square_flux.resize(squares * squares, square_flux[0]);
    }
    if square_flux.len() != squares * squares {
        return Err(none(format!("it has the flux of {} squares, not of {}", square_flux.len(), squares * squares)));
    }
    let separation = match (text("scheme"), text("separation")) {
        ("squares", _) => SeparationNoise::Alone,
        ("combs", method) if method == Method::Fitted.name() => {
            let spacing = made.get("spacing").and_then(serde_json::Value::as_u64).unwrap_or(0) as usize;
            if !(1..=squares).contains(&spacing) {
                return Err(none(format!("its combs have a spacing of {spacing} in {squares} squares")));
            }
            SeparationNoise::Fitted { spacing }
        }
        (_, method) => {
            return Err(none(format!("its squares were separated by \"{method}\", whose errors are mostly bias")));
        }
    };
    let positions = field.records().iter().map(|record| {
        let all_missing = record.missing.len() == squares * squares;
        let report = DevelopedReport::of(record).filter(|report| all_missing || report.photograph_noise.is_some());
        let report = report.ok_or_else(|| none(format!("position {} says nothing of its noise", record.position)))?;
        let Some(noise) = report.photograph_noise else { return Ok(None) };
        let shares = [noise.black_level, noise.black_from_white];
        if shares.iter().any(|share| !(0.0..=1.0).contains(share)) || noise.black_level >= 1.0 {
            return Err(none(format!("the black level of position {} cannot be", record.position)));
        }
        Ok(Some(PhotographNoise {
            curve: noise.curve,
            black_level: noise.black_level,
            black_from_white: noise.black_from_white,
            has_white: noise.has_white,
        }))
    });
    let positions = positions.collect::<Result<_, Error>>()?;
    Ok(FieldNoise { separation, square_flux, positions })
}
