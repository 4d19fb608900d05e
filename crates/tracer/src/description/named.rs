//! The files that a description names: each is read once, however often it is named.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use relumine_radiometry::files::{self, FileError};
use relumine_radiometry::{Image, Linear};

use crate::{Model, ModelError, Part, Up, read_model};

/// What has been read so far.
#[derive(Default)]
pub(super) struct Named {
    pictures: HashMap<PathBuf, Arc<Image<Linear>>>,
    pixels: usize,
    models: Vec<(PathBuf, Option<Up>, Model)>,
    triangles: usize,
}

impl Named {
    /// A picture of colours, 0 … 1: float pictures are linear, integer ones sRGB.
    pub(super) fn picture(&mut self, path: &Path) -> Result<Arc<Image<Linear>>, FileError> {
        if let Some(picture) = self.pictures.get(path) {
            return Ok(picture.clone());
        }
        let mut picture = files::read_picture(path)?.into_linear(true);
        let (width, height) = picture.size();
        self.pixels = self.pixels.saturating_add(width * height);
        // Floating-point pictures may be brighter than a surface can be.
        for sample in picture.pixels_mut().as_flattened_mut() {
            *sample = sample.clamp(0.0, 1.0);
        }
        let picture = Arc::new(picture);
        self.pictures.insert(path.to_path_buf(), picture.clone());
        Ok(picture)
    }

    /// Pixels of all pictures so far.
    pub(super) fn pixels(&self) -> usize {
        self.pixels
    }

    /// The parts of a model, and the triangles of all models so far, each counted as often as it was asked for.
    pub(super) fn model(&mut self, path: &Path, up: Option<Up>) -> Result<(&[Part], usize), ModelError> {
        let known = self.models.iter().position(|(known, its_up, _)| known == path && *its_up == up);
        let index = match known {
            Some(index) => index,
            None => {
                self.models.push((path.to_path_buf(), up, read_model(path, up)?));
                self.models.len() - 1
            }
        };
        let parts = &self.models[index].2.parts;
        let triangles: usize = parts.iter().map(|part| part.mesh.triangles.len()).sum();
        self.triangles = self.triangles.saturating_add(triangles);
        Ok((parts, self.triangles))
    }
}
