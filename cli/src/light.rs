//! `relumine light`: light description → coefficients, as a mosaic.

use std::path::{Path, PathBuf};

use clap::Args;
use relumine::{Capture, Cells, ReflectanceField, write_mosaic};

use crate::failure::Failure;
use crate::output::{PictureFormat, refuse_existing};
use crate::progress::Talk;
use crate::projection::ProjectionArguments;

/// Project a light on the cells of a field, as a mosaic
///
/// Writes an EXR whose square at column i, row j is projector position (i, j) and whose pixels are the coefficients of that
/// position's squares, and beside it a PNG of the same to look at. Lamps inside the hemisphere are allowed: their light is
/// followed back along its own direction, as if it had come through the hemisphere. What cannot be right then: a lamp's own
/// shadow, and objects between lamp and hemisphere.
#[derive(Args)]
pub(crate) struct Arguments {
    /// light.toml, a mosaic (.exr) or a lat-long map (.hdr, .exr)
    light: PathBuf,
    /// The field, or the capture, whose cells the light is projected on
    #[arg(long = "for", value_name = "FIELD")]
    cells_of: PathBuf,
    /// The mosaic to write (.exr); the picture of it gets the extension .png
    #[arg(short, long, value_name = "L.exr")]
    output: PathBuf,
    #[command(flatten)]
    projection: ProjectionArguments,
    /// Replace the output if it is there
    #[arg(long)]
    force: bool,
}

pub(crate) fn run(arguments: &Arguments, talk: &Talk) -> Result<(), Failure> {
    if PictureFormat::of(&arguments.output)? != PictureFormat::Exr {
        return Err(Failure::usage(format!("{}: a mosaic is an .exr", arguments.output.display())));
    }
    refuse_existing(&arguments.output, arguments.force)?;
    refuse_existing(&arguments.output.with_extension("png"), arguments.force)?;
    let project = |cells: &Cells| arguments.projection.project(&arguments.light, cells, talk);
    let projected = if is_capture(&arguments.cells_of) {
        project(Capture::open(&arguments.cells_of)?.setup().cells())?
    } else {
        project(ReflectanceField::open(&arguments.cells_of)?.cells())?
    };
    write_mosaic(&arguments.output, &projected.coefficients)?;
    Ok(())
}

pub(crate) fn is_capture(path: &Path) -> bool {
    path.join("capture.toml").exists()
}
