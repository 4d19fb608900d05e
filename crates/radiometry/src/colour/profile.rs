//! `chart.toml`: a colour correction as a file (FORMAT.md, "Colour correction"), with what it was fitted from.

use std::io::{self, Write};
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::ColourError;
use super::correction::{Correction, Model};
use super::fit::Errors;
use super::space::inverse;
use crate::files::write_atomically;
use crate::{parse_toml, read_text};

/// Coefficients beyond it are no camera's.
const LARGEST: f64 = 1e6;

/// A colour correction with what it was fitted from.
#[derive(Clone, Debug, PartialEq)]
pub struct ColourProfile {
    /// The correction.
    pub correction: Correction,
    /// What it was fitted from; a file written by hand need not say.
    pub fitted: Option<Fitted>,
}

/// What a correction was fitted from, and how well it does.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fitted {
    /// The program and its version.
    pub program: String,
    /// The photograph's file name.
    pub photograph: String,
    /// The response that decoded it: `linear`, `srgb` or the name of a file.
    pub response: String,
    /// The chart.
    pub chart: String,
    /// Where the reference values are from.
    pub reference: String,
    /// The light they are for.
    pub illuminant: String,
    /// Where the chart lies: top left, top right, bottom right, bottom left, pixels.
    pub corners: [[f64; 2]; 4],
    /// Whether the corners were found, not given.
    pub found: bool,
    /// Whether grey was held neutral exactly.
    pub white_kept: bool,
    /// Factor from the corrected photograph to reflectance; it is not part of the correction.
    pub exposure: f64,
    /// Patches fitted.
    pub patches: usize,
    /// Patches that could not be measured, with the reason.
    pub left_out: Vec<String>,
    /// ΔE₀₀ before the correction.
    pub before: Errors,
    /// ΔE₀₀ after it.
    pub after: Errors,
    /// ΔE₀₀ of patches that the fit had not seen.
    pub held_out: Errors,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Text {
    format: String,
    model: String,
    coefficients: Vec<Vec<f64>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    fitted: Option<Fitted>,
}

impl ColourProfile {
    /// The `format` line of this version.
    pub const FORMAT: &'static str = "relumine-colour/1";

    /// Reads a profile.
    ///
    /// # Errors
    /// If it cannot be read, or as [`ColourProfile::parse`].
    pub fn read(path: &Path) -> Result<Self, ColourError> {
        Self::parse(path, &read_text(path)?)
    }

    /// Reads the text of a profile; `path` is for messages.
    ///
    /// # Errors
    /// If it is not of this format, has unknown keys, coefficients of another shape, beyond ±10⁶ or not finite, or a matrix without
    /// an inverse.
    pub fn parse(path: &Path, text: &str) -> Result<Self, ColourError> {
        let text: Text = parse_toml(path, text)?;
        let fail = |reason: String| ColourError::content(path, reason);
        if text.format != Self::FORMAT {
            return Err(fail(format!("format: expected \"{}\", found \"{}\"", Self::FORMAT, text.format)));
        }
        let model = [Model::Matrix, Model::RootPolynomial].into_iter().find(|model| model.name() == text.model);
        let model = model.ok_or_else(|| {
            fail(format!("model: expected \"matrix\" or \"root-polynomial\", found \"{}\"", text.model))
        })?;
        let correction = match model {
            Model::Matrix => {
                let matrix = rows::<3>(&text.coefficients).map_err(fail)?;
                if inverse(&matrix).is_none() {
                    return Err(fail("coefficients: the matrix has no inverse, colours would be lost".into()));
                }
                Correction::from_matrix(matrix)
            }
            Model::RootPolynomial => Correction::from_root_polynomial(rows::<6>(&text.coefficients).map_err(fail)?),
        };
        Ok(Self { correction, fitted: text.fitted })
    }

    /// The text of the file.
    ///
    /// # Errors
    /// If the profile cannot be written as TOML.
    pub fn to_text(&self) -> io::Result<String> {
        let coefficients = self.correction.coefficients().map(<[f64]>::to_vec).to_vec();
        let text = Text {
            format: Self::FORMAT.into(),
            model: self.correction.model().name().into(),
            coefficients,
            fitted: self.fitted.clone(),
        };
        toml::to_string(&text).map_err(io::Error::other)
    }

    /// Writes the file, atomically.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), crate::files::FileError> {
        write_atomically(path, |out| out.write_all(self.to_text()?.as_bytes()))
    }
}

fn rows<const N: usize>(rows: &[Vec<f64>]) -> Result<[[f64; N]; 3], String> {
    let shape = || format!("coefficients: expected 3 rows (red, green, blue) of {N} numbers");
    let rows: Vec<[f64; N]> =
        rows.iter().map(|row| row.as_slice().try_into()).collect::<Result<_, _>>().map_err(|_| shape())?;
    let rows: [[f64; N]; 3] = rows.try_into().map_err(|_| shape())?;
    match rows.iter().flatten().find(|value| value.is_nan() || value.abs() > LARGEST) {
        Some(wrong) => Err(format!("coefficients: expected numbers between −{LARGEST} and {LARGEST}, found {wrong}")),
        None => Ok(rows),
    }
}
