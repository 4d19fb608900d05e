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
    /// By file, and whether z was said to point up.
    models: HashMap<(PathBuf, Option<bool>), Model>,
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

    /// The parts of a model.
    pub(super) fn model(&mut self, path: PathBuf, up: Option<Up>) -> Result<&[Part], ModelError> {
        let key = (path, up.map(|up| up == Up::Z));
        if !self.models.contains_key(&key) {
            let model = read_model(&key.0, up)?;
            self.models.insert(key.clone(), model);
        }
        Ok(&self.models[&key].parts)
    }
}
