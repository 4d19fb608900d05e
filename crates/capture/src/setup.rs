//! `capture.toml`: what was set up (FORMAT.md §1, contract version 1).

use std::ops::RangeInclusive;
use std::path::{Component, Path, PathBuf};

use relumine_basis::{BasisError, Cell, Cells, Layout, Partition, Pattern, Position, Reach};
use relumine_radiometry::colour::{ColourProfile, Correction};
use relumine_radiometry::files::{MAX_PIXELS, Picture};
use relumine_radiometry::{Linearization, Response, ResponseCurve, parse_toml, read_text};
use serde::Deserialize;

use crate::{CaptureError, ReferencePatch, Scheme};

/// The response that capture.toml names.
#[derive(Clone, Debug, PartialEq)]
pub enum CameraResponse {
    /// Known: linear, sRGB or a response file.
    Known(Response),
    /// To be recovered from the exposures.
    Recover,
}

/// What was set up: geometry, projector, patterns, camera.
pub struct Setup {
    title: Option<String>,
    cells: Cells,
    scheme: Scheme,
    intensity_w_sr: f64,
    square_flux: Vec<f64>,
    width: usize,
    height: usize,
    response: CameraResponse,
    response_name: String,
    colour: Option<(String, Correction)>,
    black_level: u16,
    white_level: u16,
    reference_patch: Option<ReferencePatch>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Text {
    format: String,
    title: Option<String>,
    hemisphere: HemisphereText,
    projector: ProjectorText,
    patterns: PatternsText,
    camera: CameraText,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct HemisphereText {
    radius_m: f64,
    azimuths: Option<usize>,
    tilts: Option<usize>,
    positions_deg: Option<Vec<[f64; 2]>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ProjectorText {
    squares: usize,
    half_width: f64,
    #[serde(default = "one")]
    intensity_w_sr: f64,
    square_flux: Option<Vec<Vec<f64>>>,
}

fn one() -> f64 {
    1.0
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PatternsText {
    scheme: String,
    spacing: Option<usize>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraText {
    width: usize,
    height: usize,
    #[serde(default = "linear")]
    response: String,
    colour: Option<String>,
    #[serde(default)]
    black_level: u16,
    #[serde(default = "sixteen_bits")]
    white_level: u16,
    reference_patch: Option<[usize; 4]>,
}

fn linear() -> String {
    "linear".into()
}

fn sixteen_bits() -> u16 {
    u16::MAX
}

/// Intensities and fluxes beyond this are no light that a camera sees, and their ratios leave the range of numbers.
const FLUX_RANGE: RangeInclusive<f64> = 1e-12..=1e12;

impl Setup {
    /// The `format` line of this version.
    pub const FORMAT: &'static str = "relumine-capture/1";
    /// The most pixels a side of a photograph.
    pub const MAX_SIDE: usize = 65_536;

    /// Reads the description and, if it names one, the response file beside it.
    ///
    /// # Errors
    /// If it cannot be read, has unknown keys or impossible values.
    pub fn read(path: &Path) -> Result<Self, CaptureError> {
        Self::parse(path, &read_text(path)?)
    }

    /// Reads the text of a description; a response file is looked for beside `path`.
    ///
    /// # Errors
    /// As [`Setup::read`].
    pub fn parse(path: &Path, text: &str) -> Result<Self, CaptureError> {
        let text: Text = parse_toml(path, text)?;
        let fail = |reason: String| CaptureError::Setup { path: path.to_path_buf(), reason };
        let geometry = |source: BasisError| CaptureError::Geometry { path: path.to_path_buf(), source };
        if text.format != Self::FORMAT {
            return Err(fail(format!("format: expected \"{}\", found \"{}\"", Self::FORMAT, text.format)));
        }
        let layout = match text.hemisphere {
            HemisphereText { azimuths: Some(azimuths), tilts: Some(tilts), positions_deg: None, .. } => {
                Layout::Grid { azimuths, tilts }
            }
            HemisphereText { azimuths: None, tilts: None, positions_deg: Some(positions), .. } => {
                Layout::List(positions.iter().map(|[azimuth, tilt]| Position::from_degrees(*azimuth, *tilt)).collect())
            }
            _ => return Err(fail("hemisphere: expected either azimuths and tilts, or positions_deg".into())),
        };
        let pattern = Pattern::new(text.projector.squares, text.projector.half_width).map_err(geometry)?;
        let reach = Reach::Near { radius_m: text.hemisphere.radius_m, pattern };
        let cells = Cells::new(Partition::new(layout).map_err(geometry)?, reach).map_err(geometry)?;
        let squares = pattern.squares();
        let scheme = match (text.patterns.scheme.as_str(), text.patterns.spacing) {
            // Squares farther apart than the pattern is wide stand alone.
            ("combs", spacing) => Scheme::Combs { spacing: spacing.unwrap_or(3).min(squares) },
            ("squares", None) => Scheme::Squares,
            ("squares", Some(_)) => return Err(fail("patterns: spacing belongs to the scheme \"combs\"".into())),
            (other, _) => {
                return Err(fail(format!("patterns: scheme must be \"combs\" or \"squares\", found \"{other}\"")));
            }
        };
        if let Scheme::Combs { spacing: 0 } = scheme {
            return Err(fail("patterns: spacing must be 1 or more, but is 0".into()));
        }
        let CameraText { width, height, response: response_name, colour, black_level, white_level, reference_patch } =
            text.camera;
        let side = 1..=Self::MAX_SIDE;
        if !side.contains(&width) || !side.contains(&height) || width * height > MAX_PIXELS {
            return Err(fail(format!(
                "camera: expected a picture of 1 to {} pixels a side and at most {} in all, found {width} × {height}",
                Self::MAX_SIDE,
                MAX_PIXELS
            )));
        }
        if black_level >= white_level {
            return Err(fail(format!("camera: black_level {black_level} must be below white_level {white_level}")));
        }
        let reference_patch =
            reference_patch.map(|patch| ReferencePatch::new(patch, (width, height))).transpose().map_err(fail)?;
        let intensity_w_sr = text.projector.intensity_w_sr;
        if !FLUX_RANGE.contains(&intensity_w_sr) {
            return Err(fail(format!("projector: intensity_w_sr must be 1e-12 to 1e12, but is {intensity_w_sr}")));
        }
        Ok(Self {
            title: text.title,
            square_flux: square_flux(text.projector.square_flux, squares).map_err(fail)?,
            response: read_response(path, &response_name)?,
            colour: colour.map(|name| read_colour(path, name)).transpose()?,
            cells,
            scheme,
            intensity_w_sr,
            width,
            height,
            response_name,
            black_level,
            white_level,
            reference_patch,
        })
    }

    /// The capture's title, if it has one.
    pub fn title(&self) -> Option<&str> {
        self.title.as_deref()
    }

    /// The cells of the capture.
    pub fn cells(&self) -> &Cells {
        &self.cells
    }

    /// The patterns shown.
    pub fn scheme(&self) -> Scheme {
        self.scheme
    }

    /// Pixels of a photograph, `(width, height)`.
    pub fn picture_size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// The camera's response.
    pub fn response(&self) -> &CameraResponse {
        &self.response
    }

    /// The response as capture.toml spells it.
    pub fn response_name(&self) -> &str {
        &self.response_name
    }

    /// The camera's colour correction: a matrix, from its channels to linear Rec. 709. `None` leaves the channels as they are.
    pub fn colour(&self) -> Option<&Correction> {
        self.colour.as_ref().map(|(_, correction)| correction)
    }

    /// The correction's file as capture.toml names it.
    pub fn colour_name(&self) -> Option<&str> {
        self.colour.as_ref().map(|(name, _)| name.as_str())
    }

    /// Counts without light, and counts at which a pixel is clipped.
    pub fn levels(&self) -> (u16, u16) {
        (self.black_level, self.white_level)
    }

    /// The area of the picture by which the lamp's drift is taken out, if there is one.
    pub fn reference_patch(&self) -> Option<ReferencePatch> {
        self.reference_patch
    }

    /// Radiant intensity of the projector on its axis at full white, W·sr⁻¹.
    pub fn intensity_w_sr(&self) -> f64 {
        self.intensity_w_sr
    }

    /// The table from counts to relative exposure, if the response is known.
    pub fn linearization(&self) -> Option<Linearization> {
        match &self.response {
            CameraResponse::Known(response) => Some(Linearization::new(response, self.black_level, self.white_level)),
            CameraResponse::Recover => None,
        }
    }

    /// Φ_square = I₀ (2h/M)² · square_flux, W per unit of projected white (docs/MATH.md).
    pub fn square_flux(&self, u: usize, v: usize) -> f64 {
        let Reach::Near { pattern, .. } = self.cells.reach() else { return self.intensity_w_sr };
        let side = 2.0 * pattern.half_width() / pattern.squares() as f64;
        self.intensity_w_sr * side * side * self.square_flux[v * pattern.squares() + u]
    }

    /// Bytes of memory that one position needs while it is developed, and `tile_pixels` of its squares are told apart.
    pub fn developing_bytes(&self, tile_pixels: usize) -> usize {
        let squares = self.cells.squares();
        // With black, its variance and white; one more while it is read. Squares are halves.
        let frames = self.scheme.lighting(squares).len() + 4;
        let pixels = self.width * self.height;
        let frames = frames.saturating_mul(pixels).saturating_mul(12);
        frames.saturating_add((squares * squares * 6).saturating_mul(tile_pixels.min(pixels)))
    }

    /// Holds a picture against what is promised of the camera's pictures: size, bits, whether it is linear.
    ///
    /// # Errors
    /// What was promised, what came, what to do.
    pub fn check_picture(&self, picture: &Picture) -> Result<(), String> {
        let (found_width, found_height) = picture.size();
        if (found_width, found_height) != (self.width, self.height) {
            return Err(format!(
                "capture.toml promises pictures of {} × {}, this one has {found_width} × {found_height}",
                self.width, self.height
            ));
        }
        let white_level = self.white_level;
        match picture {
            Picture::Integer { bits: 8, .. } if white_level > 255 => Err(format!(
                "an 8-bit picture, but capture.toml promises counts up to white_level = {white_level}: convert nothing to \
                 8 bits, or set white_level"
            )),
            Picture::Integer { bits: 16, .. } if white_level <= 255 => Err(format!(
                "a 16-bit picture, but in capture.toml white_level = {white_level}: set it to the counts at which the \
                 camera clips"
            )),
            Picture::Float(_) if self.response_name != "linear" => Err(format!(
                "a float picture is linear already, but capture.toml says response = \"{}\"",
                self.response_name
            )),
            _ => Ok(()),
        }
    }

    /// |Ωᵢ| / Φ_square: what a photograph of one square is multiplied with to become the transfer Rᵢ of its cell.
    pub fn transfer_per_radiance(&self, cell: Cell) -> f64 {
        self.cells.measure(self.cells.index(cell)) / self.square_flux(cell.u, cell.v)
    }
}

fn square_flux(rows: Option<Vec<Vec<f64>>>, squares: usize) -> Result<Vec<f64>, String> {
    let Some(rows) = rows else { return Ok(vec![1.0; squares * squares]) };
    if rows.len() != squares || rows.iter().any(|row| row.len() != squares) {
        return Err(format!("projector: square_flux must have {squares} rows of {squares} numbers"));
    }
    let flux: Vec<f64> = rows.into_iter().flatten().collect();
    match flux.iter().find(|value| !FLUX_RANGE.contains(*value)) {
        Some(wrong) => Err(format!("projector: square_flux must be 1e-12 to 1e12 everywhere, found {wrong}")),
        None => Ok(flux),
    }
}

fn read_response(setup: &Path, name: &str) -> Result<CameraResponse, CaptureError> {
    Ok(match name {
        "linear" => CameraResponse::Known(Response::Linear),
        "srgb" => CameraResponse::Known(Response::Srgb),
        "recover" => CameraResponse::Recover,
        file => {
            let path = inside_the_capture(setup, "a response file", file)?;
            CameraResponse::Known(Response::Curve(ResponseCurve::parse(&path, &read_text(&path)?)?))
        }
    })
}

/// A root polynomial is refused: the field adds lights up, and it does not.
fn read_colour(setup: &Path, name: String) -> Result<(String, Correction), CaptureError> {
    let path = inside_the_capture(setup, "the colour correction", &name)?;
    let correction = ColourProfile::read(&path)?.correction;
    if correction.matrix().is_some() {
        return Ok((name, correction));
    }
    let reason = format!(
        "camera: colour = \"{name}\" is a {}, which is not linear in light: under two lights together the object would not be \
         the sum of itself under each; fit a matrix (`relumine calibrate colour … --model matrix`)",
        correction.model().name()
    );
    Err(CaptureError::Setup { path: setup.to_path_buf(), reason })
}

/// Where a file lies that the description names.
fn inside_the_capture(setup: &Path, what: &str, name: &str) -> Result<PathBuf, CaptureError> {
    let file = Path::new(name);
    if file.components().next().is_none() || !file.components().all(|part| matches!(part, Component::Normal(_))) {
        let reason = format!("camera: {what} must lie inside the capture directory, found \"{name}\"");
        return Err(CaptureError::Setup { path: setup.to_path_buf(), reason });
    }
    Ok(setup.parent().unwrap_or(Path::new("")).join(file))
}
