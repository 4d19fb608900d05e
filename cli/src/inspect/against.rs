//! Holding a field against another, or against photographs.

use std::io::Write;
use std::path::{Path, PathBuf};

use relumine::radiometry::Difference;
use relumine::{Capture, ReflectanceField, TestLight, differences, differences_from_photographs, test_lights};

use crate::failure::{Failure, printed};
use crate::progress::Talk;
use crate::projection::ProjectionArguments;

/// Prints how pictures relit from the field at `path` differ from those of the one at `reference`, under drawn lights and
/// under `lights`.
pub(super) fn another_field(
    path: &Path,
    reference: &Path,
    lights: &[PathBuf],
    projection: &ProjectionArguments,
    talk: &Talk,
) -> Result<(), Failure> {
    let (field, reference) = (ReflectanceField::open(path)?, ReflectanceField::open(reference)?);
    let mut all = test_lights(field.cells());
    for light in lights {
        let coefficients = projection.project(light, field.cells(), talk)?.coefficients;
        all.push(TestLight { name: light.display().to_string(), coefficients });
    }
    let found = differences(&field, &reference, &all)?;
    print(all.iter().map(|light| &light.name[..]).zip(found))
}

/// Prints how pictures relit from the field at `path` differ from photographs of the capture at `capture`.
pub(super) fn a_capture(path: &Path, capture: &Path) -> Result<(), Failure> {
    let field = ReflectanceField::open(path)?;
    let found = differences_from_photographs(&field, Capture::open(capture)?, PHOTOGRAPHS)?;
    print(found.iter().map(|(name, difference)| (&name[..], *difference)))
}

/// So many photographs are compared.
const PHOTOGRAPHS: usize = 16;

fn print<'a>(found: impl Iterator<Item = (&'a str, Option<Difference>)>) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    printed(writeln!(out, "{:<28} {:>11} {:>15} {:>9}", "light", "relative L2", "ratio of means", "PSNR dB"))?;
    let mut worst = 0.0f64;
    for (name, difference) in found {
        printed(match difference {
            Some(Difference { relative_l2, ratio_of_means, psnr_db, .. }) => {
                worst = worst.max(relative_l2);
                writeln!(out, "{name:<28} {relative_l2:>11.5} {ratio_of_means:>15.5} {psnr_db:>9.2}")
            }
            None => writeln!(out, "{name:<28} {:>11}", "black"),
        })?;
    }
    printed(writeln!(out, "{:<28} {worst:>11.5}", "worst"))
}
