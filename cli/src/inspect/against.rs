//! Holding a field against another.

use std::io::Write;
use std::path::{Path, PathBuf};

use relumine::{ReflectanceField, TestLight, differences, test_lights};

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
    let mut out = std::io::stdout().lock();
    printed(writeln!(out, "{:<24} {:>11} {:>15} {:>9}", "light", "relative L2", "ratio of means", "PSNR dB"))?;
    for (light, difference) in all.iter().zip(&found) {
        let name = &light.name;
        printed(match difference {
            Some(difference) => writeln!(
                out,
                "{name:<24} {:>11.5} {:>15.5} {:>9.2}",
                difference.relative_l2, difference.ratio_of_means, difference.psnr_db
            ),
            None => writeln!(out, "{name:<24} {:>11}", "black"),
        })?;
    }
    let worst = found.iter().flatten().map(|difference| difference.relative_l2).fold(0.0, f64::max);
    printed(writeln!(out, "{:<24} {worst:>11.5}", "worst"))
}
