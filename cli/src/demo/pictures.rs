//! The pictures of the demonstration: relit, as a light map, and the truth.

use std::fs;
use std::path::Path;

use relumine::radiometry::files::{self, ExrSample};
use relumine::radiometry::{Difference, Display, Image, Radiance, difference};
use relumine::{Light, PathOptions, ProjectionOptions, ReflectanceField, Rendering, Scene, project, write_mosaic};

use crate::failure::Failure;
use crate::progress::Talk;
use crate::relight;

/// A light of the demonstration.
pub(super) struct Shown {
    /// The description, and what its pictures are called.
    pub(super) name: &'static str,
    /// Whether it is also shown as a light map.
    pub(super) light_map: bool,
}

pub(super) const LIGHTS: [Shown; 5] = [
    Shown { name: "spots", light_map: true },
    Shown { name: "shafts", light_map: true },
    Shown { name: "moved-1", light_map: false },
    Shown { name: "moved-2", light_map: false },
    Shown { name: "moved-3", light_map: false },
];

/// How far the pictures of one light are from the truth, inside the object.
pub(super) struct Figures {
    pub(super) name: &'static str,
    pub(super) relit: Difference,
    pub(super) light_map: Option<Difference>,
}

/// The folder of the pictures, inside the demonstration's.
pub(super) const FOLDER: &str = "pictures";

/// All pictures show the same brightness the same.
const STOPS: f32 = 0.8;

/// The light whose coefficients are shown: its lamp is seen from many places.
const MOSAIC: &str = "moved-1";

/// Relights the field under every light, renders the scene under it, and writes the pictures; and one mosaic.
pub(super) fn make(directory: &Path, field: &Path, scene: Scene, talk: &Talk) -> Result<Vec<Figures>, Failure> {
    let folder = directory.join(FOLDER);
    fs::create_dir_all(&folder)
        .map_err(|error| Failure::failed(format!("cannot write {}: {error}", folder.display())))?;
    let field = ReflectanceField::open(field)?;
    let (width, height) = field.picture_size();
    let scene = scene.with_picture_size(width, height);
    let lights: Vec<Light> = LIGHTS
        .iter()
        .map(|shown| Light::read(&directory.join(format!("{}.toml", shown.name))))
        .collect::<Result<_, _>>()?;

    // Light on the cells, as it is and as a light map; then one pass over the field for all of them.
    let bar = talk.bar("lights", LIGHTS.len(), 0);
    let mut coefficients = Vec::new();
    for (shown, light) in LIGHTS.iter().zip(&lights) {
        for light_map in [false, true].into_iter().take(1 + usize::from(shown.light_map)) {
            let options = ProjectionOptions { light_map, ..ProjectionOptions::default() };
            coefficients.push(project(light, field.cells(), &options)?.coefficients);
        }
        if shown.name == MOSAIC {
            write_mosaic(&folder.join("mosaic.exr"), &coefficients[coefficients.len() - 1])?;
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    let mut pictures = relight::pictures(&field, &coefficients, talk)?.into_iter();

    let mut figures = Vec::new();
    let mut all_rows = None;
    for (index, (shown, light)) in LIGHTS.iter().zip(&lights).enumerate() {
        let options = PathOptions { samples: 144, bounces: 4, seed: 1 };
        let mut rendering = Rendering::new(&scene, light, options, false)?;
        let steps = rendering.steps();
        let bar = all_rows.get_or_insert_with(|| talk.bar("rendering the truth", steps * LIGHTS.len(), 0));
        for () in &mut rendering {
            bar.inc(1);
        }
        let truth = rendering.finish();
        let mask: Vec<bool> = truth.coverage.iter().map(|coverage| *coverage >= 1.0).collect();
        let mut compared = |kind: &str| -> Result<Difference, Failure> {
            let Some(picture) = pictures.next() else {
                return Err(Failure::failed(format!("{}: picture {index} was not relit", shown.name)));
            };
            write(&folder, &format!("{}{kind}", shown.name), &picture)?;
            difference(&picture, &truth.picture, Some(&mask), false)
                .ok_or_else(|| Failure::failed(format!("the truth under {}.toml is black", shown.name)))
        };
        let relit = compared("")?;
        let light_map = if shown.light_map { Some(compared("-light-map")?) } else { None };
        write(&folder, &format!("{}-truth", shown.name), &truth.picture)?;
        figures.push(Figures { name: shown.name, relit, light_map });
    }
    if let Some(bar) = all_rows {
        bar.finish_and_clear();
    }
    Ok(figures)
}

/// A picture to look at and the same to compute with.
fn write(folder: &Path, name: &str, picture: &Image<Radiance>) -> Result<(), Failure> {
    let display = Display { exposure_stops: STOPS, ..Display::default() };
    files::write_png8(&folder.join(format!("{name}.png")), &display.encode(picture))?;
    files::write_exr(&folder.join(format!("{name}.exr")), picture, ExrSample::Float, &[])?;
    Ok(())
}
