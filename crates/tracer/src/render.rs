//! A picture of a scene under any light: the truth that relit pictures are held against.

use glam::DVec3;
use rayon::prelude::*;
use relumine_lamp::Light;
use relumine_radiometry::{Image, Radiance};

use crate::Scene;
use crate::lighting::{Gather, Lighting};
use crate::path::{PathOptions, walk};

/// What a renderer of light descriptions cannot do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RenderError {
    /// A mosaic is light on cells, which a scene does not have.
    #[error("a mosaic is light on the cells of a field and cannot be rendered directly")]
    Mosaic,
}

/// A rendered picture and what is known of it.
#[derive(Clone, Debug)]
pub struct Rendered {
    /// Radiance towards the camera.
    pub picture: Image<Radiance>,
    /// The standard error of each of its samples, from the spread of the paths of its pixel; paths are spread evenly, so
    /// the true error is rather smaller.
    pub standard_error: Image<Radiance>,
    /// The share of each pixel that shows the scene.
    pub coverage: Vec<f32>,
}

/// A rendering under way: an iterator over the rows of the picture, so that the caller shows progress and stops by dropping
/// it. [`Rendering::finish`] gives the picture, black where it was not reached.
pub struct Rendering<'a> {
    scene: &'a Scene,
    lighting: Lighting,
    options: PathOptions,
    next_row: usize,
    rendered: Rendered,
}

/// Rows that are rendered together: enough work for many cores.
const ROWS: usize = 16;

impl<'a> Rendering<'a> {
    /// Prepares to render `scene` under `light`, the object standing in it where the light's placement says. The camera
    /// sees lamps and sky themselves only if `lamps_seen`: relit pictures never show them.
    ///
    /// # Errors
    /// If the light has a mosaic.
    pub fn new(scene: &'a Scene, light: &Light, options: PathOptions, lamps_seen: bool) -> Result<Self, RenderError> {
        if light.mosaic.is_some() {
            return Err(RenderError::Mosaic);
        }
        let (width, height) = scene.picture_size();
        let placement = &light.placement;
        let lamps = light.lamps.iter().map(|lamp| placement.object_from_world_lamp(lamp)).collect();
        let environment = light.environment.as_ref().map(|sky| sky.clone().turned(-placement.rotation, 1.0));
        Ok(Self {
            scene,
            lighting: Lighting::new(lamps, environment, lamps_seen),
            options,
            next_row: 0,
            rendered: Rendered {
                picture: Image::black(width, height),
                standard_error: Image::black(width, height),
                coverage: vec![0.0; width * height],
            },
        })
    }

    /// Number of steps in all.
    pub fn steps(&self) -> usize {
        self.scene.picture_size().1.div_ceil(ROWS)
    }

    /// The picture as far as it has come.
    pub fn finish(self) -> Rendered {
        self.rendered
    }

    /// Runs to the end.
    pub fn run(mut self) -> Rendered {
        while self.next().is_some() {}
        self.rendered
    }
}

impl Iterator for Rendering<'_> {
    type Item = ();

    fn next(&mut self) -> Option<()> {
        let (width, height) = self.scene.picture_size();
        if self.next_row >= height {
            return None;
        }
        let rows = self.next_row..(self.next_row + ROWS).min(height);
        let (scene, lighting, options) = (self.scene, &self.lighting, &self.options);
        let pixels: Vec<Pixel> = (rows.start * width..rows.end * width)
            .into_par_iter()
            .map(|pixel| render_pixel(scene, lighting, options, (pixel % width, pixel / width)))
            .collect();
        for (pixel, rendered) in (rows.start * width..).zip(pixels) {
            self.rendered.picture.pixels_mut()[pixel] = rendered.mean.as_vec3().to_array();
            self.rendered.standard_error.pixels_mut()[pixel] = rendered.error.as_vec3().to_array();
            self.rendered.coverage[pixel] = rendered.coverage;
        }
        self.next_row = rows.end;
        Some(())
    }
}

struct Pixel {
    mean: DVec3,
    error: DVec3,
    coverage: f32,
}

fn render_pixel(scene: &Scene, lighting: &Lighting, options: &PathOptions, pixel: (usize, usize)) -> Pixel {
    let (mut sum, mut squares, mut met) = (DVec3::ZERO, DVec3::ZERO, 0);
    for sample in 0..options.samples {
        let mut gather = Gather::new(scene, lighting);
        walk(scene, pixel, sample, options, &mut gather);
        let radiance = gather.radiance.as_dvec3();
        sum += radiance;
        squares += radiance * radiance;
        met += usize::from(gather.met);
    }
    let n = options.samples.max(1) as f64;
    let mean = sum / n;
    let variance = (squares / n - mean * mean).max(DVec3::ZERO) / (n - 1.0).max(1.0);
    Pixel { mean, error: variance.map(f64::sqrt), coverage: met as f32 / n as f32 }
}
