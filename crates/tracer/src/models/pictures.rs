//! Pictures of a model, each decoded once and shared by the surfaces that show it.

use std::borrow::Cow;
use std::collections::HashMap;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use relumine_radiometry::files::{MAX_PIXELS, decode_picture};
use relumine_radiometry::{Image, Linear};

use super::ModelError;
use super::file::ModelFile;

/// What has been decoded so far.
#[derive(Default)]
pub(super) struct Pictures {
    /// By file, or place in the model, and whether sRGB was decoded.
    decoded: HashMap<(PathBuf, bool), Arc<Image<Linear>>>,
    pixels: usize,
    /// By the address of the picture, which `decoded` keeps alive.
    means: HashMap<*const Image<Linear>, f32>,
}

impl Pictures {
    /// The picture called `name`, whose bytes are asked for if it is new: 0 … 1, integers decoded from sRGB if `srgb`.
    pub(super) fn get<'a>(
        &mut self,
        file: &ModelFile<'_>,
        place: impl Display,
        name: &Path,
        srgb: bool,
        bytes: impl FnOnce() -> Result<Cow<'a, [u8]>, ModelError>,
    ) -> Result<Arc<Image<Linear>>, ModelError> {
        if let Some(picture) = self.decoded.get(&(name.to_path_buf(), srgb)) {
            return Ok(picture.clone());
        }
        let picture = decode_picture(name, &bytes()?).map_err(|source| ModelError::Picture {
            path: file.path().to_path_buf(),
            place: place.to_string(),
            source,
        })?;
        let (width, height) = picture.size();
        self.pixels = self.pixels.saturating_add(width * height);
        if self.pixels > MAX_PIXELS {
            let reason = format!("at most {MAX_PIXELS} pixels were expected in all pictures together, here are more");
            return Err(file.malformed(place, reason));
        }
        let mut picture = picture.into_linear(srgb);
        // Floating-point pictures may be brighter than a surface can be.
        for sample in picture.pixels_mut().as_flattened_mut() {
            *sample = sample.clamp(0.0, 1.0);
        }
        let picture = Arc::new(picture);
        self.decoded.insert((name.to_path_buf(), srgb), picture.clone());
        Ok(picture)
    }

    /// The mean of red of a picture from [`Self::get`].
    pub(super) fn mean_red(&mut self, picture: &Arc<Image<Linear>>) -> f32 {
        *self.means.entry(Arc::as_ptr(picture)).or_insert_with(|| {
            let pixels = picture.pixels();
            (pixels.iter().map(|pixel| f64::from(pixel[0])).sum::<f64>() / pixels.len() as f64) as f32
        })
    }
}
