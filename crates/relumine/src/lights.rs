//! Lights as files: a description, a mosaic or a lat-long map; and mosaics written.

use std::path::Path;

use relumine_basis::{Cells, Coefficients};
use relumine_lamp::{Environment, Light, Mosaic};
use relumine_radiometry::files::{self, ExrSample};
use relumine_radiometry::{Image, Radiance};

use crate::Error;

/// What a picture given as light is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightKind {
    /// `light.toml`.
    Description,
    /// Coefficients, one pixel a cell.
    Mosaic,
    /// A lat-long environment map.
    Map,
}

/// The EXR attribute that marks a mosaic, and its value.
const MARK: (&str, &str) = ("relumine.kind", "mosaic");

/// Reads a light for `cells`: `.toml` is a description; a picture is a mosaic if it has the shape of one for these cells
/// or says so itself, and a lat-long map if it is twice as wide as high; `kind` decides what could be both.
///
/// # Errors
/// If it cannot be read or is none of these.
pub fn read_light(path: &Path, cells: &Cells, kind: Option<LightKind>) -> Result<(Light, LightKind), Error> {
    if kind == Some(LightKind::Description) || path.extension().is_some_and(|extension| extension == "toml") {
        return Ok((Light::read(path)?, LightKind::Description));
    }
    let picture: Image<Radiance> = files::read_linear(path)?.reinterpret();
    let (width, height) = picture.size();
    let (mosaic_width, mosaic_height) = cells.dark().mosaic_size();
    let marked = picture_kind(path)? == Some(LightKind::Mosaic);
    let kind = match kind {
        Some(kind) => kind,
        None if marked || (width, height) == (mosaic_width, mosaic_height) => LightKind::Mosaic,
        None if width == 2 * height => LightKind::Map,
        None => {
            let path = path.to_path_buf();
            return Err(Error::NeitherMosaicNorMap { path, width, height, mosaic_width, mosaic_height });
        }
    };
    let mut light = Light::default();
    if kind == LightKind::Mosaic {
        light.mosaic = Some(Mosaic { path: path.to_path_buf(), pixels: picture });
    } else {
        light.environment = Some(Environment::lat_long(picture));
    }
    Ok((light, kind))
}

/// What a picture says itself that it is: mosaics written by [`write_mosaic`] carry a mark.
///
/// # Errors
/// If it cannot be read.
pub fn picture_kind(path: &Path) -> Result<Option<LightKind>, Error> {
    let is_exr = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("exr"));
    let marked = is_exr && files::read_exr_attribute(path, MARK.0)?.as_deref() == Some(MARK.1);
    Ok(marked.then_some(LightKind::Mosaic))
}

/// The mosaic of a light as a picture (fig. 9).
fn mosaic_picture(coefficients: &Coefficients) -> Image<Radiance> {
    let (width, height) = coefficients.mosaic_size();
    Image::from_pixels(width, height, coefficients.to_mosaic())
}

/// Writes coefficients as a mosaic: the EXR that programs read, and beside it, with the extension `.png`, the same to look
/// at: each pixel enlarged to at least 4 × 4, brightness scaled so that the 99th percentile of lit cells is white.
///
/// # Errors
/// If a file cannot be written.
pub fn write_mosaic(path: &Path, coefficients: &Coefficients) -> Result<(), Error> {
    let mosaic = mosaic_picture(coefficients);
    files::write_exr(path, &mosaic, ExrSample::Float, &[MARK])?;
    let (width, height) = mosaic.size();
    let enlarge = (768 / width.max(1)).clamp(4, 32);
    let mut brightness: Vec<f32> =
        mosaic.pixels().iter().map(|pixel| pixel.iter().copied().fold(0.0, f32::max)).filter(|b| *b > 0.0).collect();
    brightness.sort_by(f32::total_cmp);
    let white = brightness.get(brightness.len() * 99 / 100).copied().unwrap_or(1.0);
    let shown: Vec<[f32; 3]> = (0..height * enlarge)
        .flat_map(|y| (0..width * enlarge).map(move |x| (x, y)))
        .map(|(x, y)| mosaic.pixel(x / enlarge, y / enlarge).map(|sample| sample / white))
        .collect();
    let shown = Image::<Radiance>::from_pixels(width * enlarge, height * enlarge, shown);
    let display = relumine_radiometry::Display::default();
    files::write_png8(&path.with_extension("png"), &display.encode(&shown))?;
    Ok(())
}
