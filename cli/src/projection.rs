//! The options with which light is projected on cells, shared by `light` and `relight`.

use std::path::Path;

use clap::{Args, ValueEnum};
use relumine::{Cells, LightKind, Projected, ProjectionOptions, Reconstruction, project, read_light};

use crate::failure::Failure;
use crate::progress::Talk;

#[derive(Args, Clone, Debug)]
pub(crate) struct ProjectionArguments {
    /// What happens to light between projector positions
    ///
    /// Linear splits a ray over the positions around it. It halves the error of most lights (spots, sun, windows, near
    /// lamps, skies) and changes nothing for a lamp at a captured position; a hard shadow between positions becomes up to
    /// four faint ones. Box gives each ray to the position whose patch it enters, as the paper does: the beam is turned by
    /// up to half a patch, so that a narrow spot lands elsewhere, but shadows stay single and hard. Take box for a constant
    /// sky, to reproduce the paper, or where one crisp shadow matters more than its place.
    #[arg(long, value_enum, default_value_t = Between::Linear)]
    between: Between,
    /// Collapse the light to what arrives at the centre of the hemisphere, the same at every point
    ///
    /// What an environment map can do (figures 1 and 10 of the paper, bottom): to compare with.
    #[arg(long)]
    light_map: bool,
    /// Rays for each lamp and samples for an environment
    ///
    /// The command says how uncertain the coefficients are; four times the samples halve that, or better.
    #[arg(long, default_value_t = ProjectionOptions::default().samples, value_name = "N")]
    samples: usize,
    /// Leave out light that passes the centre at a greater distance than this, metres
    ///
    /// By default every cell is filled whole.
    #[arg(long, value_name = "METRES")]
    object_radius: Option<f64>,
    /// What a picture given as light is, if it could be both
    #[arg(long = "as", value_enum, value_name = "KIND")]
    kind: Option<Kind>,
}

#[derive(ValueEnum, Clone, Copy, Debug)]
enum Between {
    /// Bilinear between the centres of a grid, barycentric on a triangulation of a list.
    Linear,
    /// The nearest patch alone: the paper's.
    Box,
}

#[derive(ValueEnum, Clone, Copy, Debug)]
enum Kind {
    /// Coefficients, one pixel a cell.
    Mosaic,
    /// A lat-long environment map.
    Map,
}

impl ProjectionArguments {
    /// Whether any of them says something else than it does by default.
    pub(crate) fn are_given(&self) -> bool {
        let Self { between, light_map, samples, object_radius, kind } = self;
        !matches!(between, Between::Linear)
            || *light_map
            || *samples != ProjectionOptions::default().samples
            || object_radius.is_some()
            || kind.is_some()
    }

    /// Reads a light and projects it, saying what a person should know.
    pub(crate) fn project(&self, light: &Path, cells: &Cells, talk: &Talk) -> Result<Projected, Failure> {
        if self.object_radius.is_some_and(|radius| radius.is_nan() || radius <= 0.0) {
            return Err(Failure::usage("--object-radius must be above 0"));
        }
        if self.samples == 0 || self.samples > 1 << 28 {
            return Err(Failure::usage("--samples must be 1 to 268435456"));
        }
        let kind = self.kind.map(|kind| match kind {
            Kind::Mosaic => LightKind::Mosaic,
            Kind::Map => LightKind::Map,
        });
        let (description, kind) = read_light(light, cells, kind)?;
        let options = ProjectionOptions {
            between: match self.between {
                Between::Linear => Reconstruction::Linear,
                Between::Box => Reconstruction::Box,
            },
            light_map: self.light_map,
            samples: self.samples,
            object_radius_m: self.object_radius,
            ..ProjectionOptions::default()
        };
        let projected = project(&description, cells, &options)?;
        let [red, green, blue] = projected.flux;
        let what = match kind {
            LightKind::Description => "",
            LightKind::Mosaic => ", read as a mosaic",
            LightKind::Map => ", read as a lat-long map",
        };
        let unit = if cells.covered_radius_m().is_infinite() { "W/m²" } else { "W" };
        talk.say(format!(
            "{}{what}: flux {red:.5} {green:.5} {blue:.5} {unit}, standard error of the coefficients {:.2} %",
            light.display(),
            100.0 * projected.relative_error
        ));
        for (share, why) in [
            (projected.lost.below_horizon, "comes from below the horizon"),
            (projected.lost.outside_pattern, "passes outside the projector's pattern"),
        ] {
            if share > 1e-4 {
                talk.say(format!(
                    "  {:.2} % of what its lamps and the highlights of its sky send to the object {why} and is lost",
                    100.0 * share
                ));
            }
        }
        if projected.flux == [0.0; 3] {
            talk.say("  no light reaches the object: the picture will be black");
        }
        Ok(projected)
    }
}
