//! Reading `light.toml` (FORMAT.md §2, contract version 1).

mod text;

use std::path::{Path, PathBuf};

use glam::DVec3;
use relumine_radiometry::files::{self, FileError};
use relumine_radiometry::{DescriptionError, Image, Radiance, parse_toml, read_text};

use text::{EnvironmentText, MosaicText, RectangleText, SlideText, SpotText, Text};

use crate::{Disk, Environment, Lamp, Placement, Rectangle, Slide, Sphere};

/// Everything that shines: lamps, environment and mosaic add up; the object stands in them at `placement`.
#[derive(Clone, Debug, Default)]
pub struct Light {
    /// The lamps, in the order point, spot, sphere, rectangle, disk, sun, shaft, slide.
    pub lamps: Vec<Lamp>,
    /// Light from far away.
    pub environment: Option<Environment>,
    /// A light field as coefficients.
    pub mosaic: Option<Mosaic>,
    /// Where the object stands within all of this.
    pub placement: Placement,
}

/// A light field as coefficients, one pixel a cell.
#[derive(Clone, Debug)]
pub struct Mosaic {
    /// The file, for messages.
    pub path: PathBuf,
    /// The coefficients, laid out as FORMAT.md says.
    pub pixels: Image<Radiance>,
}

/// What is wrong with a light description.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LightError {
    /// The description cannot be read.
    #[error(transparent)]
    Description(#[from] DescriptionError),
    /// A picture it names cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// A value that cannot be.
    #[error("{}: {place}: {reason}", path.display())]
    Value {
        /// The description.
        path: PathBuf,
        /// Which lamp and key.
        place: String,
        /// What was expected and what came.
        reason: String,
    },
}

impl Light {
    /// The `format` line of this version.
    pub const FORMAT: &'static str = "relumine-light/1";

    /// Reads a description and the pictures it names, which are relative to it.
    ///
    /// # Errors
    /// If it cannot be read, has unknown keys or impossible values, or a picture cannot be read.
    pub fn read(path: &Path) -> Result<Self, LightError> {
        Self::parse(path, &read_text(path)?)
    }

    /// Reads the text of a description; pictures are looked for beside `path`.
    ///
    /// # Errors
    /// As [`Light::read`].
    pub fn parse(path: &Path, text: &str) -> Result<Self, LightError> {
        let text: Text = parse_toml(path, text)?;
        let check = Check { path };
        if text.format != Self::FORMAT {
            return check.fail("format", format!("expected \"{}\", found \"{}\"", Self::FORMAT, text.format));
        }
        let mut light = Self::default();
        let lamps = &mut light.lamps;
        for (index, lamp) in text.point.iter().enumerate() {
            let place = |key: &str| format!("point {index}: {key}");
            lamps.push(Lamp::Point {
                position: check.vector(place("position"), lamp.position)?,
                intensity: check.colour(place("intensity_w_sr"), lamp.intensity_w_sr)?,
            });
        }
        for (index, lamp) in text.spot.iter().enumerate() {
            lamps.push(check.spot(index, lamp)?);
        }
        for (index, lamp) in text.sphere.iter().enumerate() {
            let place = |key: &str| format!("sphere {index}: {key}");
            lamps.push(Lamp::Sphere(Sphere {
                center: check.vector(place("center"), lamp.center)?,
                radius_m: check.positive(place("radius_m"), lamp.radius_m)?,
                radiance: check.colour(place("radiance"), lamp.radiance)?,
            }));
        }
        for (index, lamp) in text.rectangle.iter().enumerate() {
            lamps.push(check.rectangle(index, lamp)?);
        }
        for (index, lamp) in text.disk.iter().enumerate() {
            let place = |key: &str| format!("disk {index}: {key}");
            lamps.push(Lamp::Disk(Disk {
                center: check.vector(place("center"), lamp.center)?,
                normal: check.direction(place("normal"), lamp.normal)?,
                radius_m: check.positive(place("radius_m"), lamp.radius_m)?,
                radiance: check.colour(place("radiance"), lamp.radiance)?,
            }));
        }
        for (index, lamp) in text.sun.iter().enumerate() {
            let place = |key: &str| format!("sun {index}: {key}");
            lamps.push(Lamp::Sun {
                direction: check.direction(place("direction"), lamp.direction)?,
                irradiance: check.colour(place("irradiance_w_m2"), lamp.irradiance_w_m2)?,
            });
        }
        for (index, lamp) in text.shaft.iter().enumerate() {
            let place = |key: &str| format!("shaft {index}: {key}");
            lamps.push(Lamp::Shaft {
                origin: check.vector(place("origin"), lamp.origin)?,
                direction: check.direction(place("direction"), lamp.direction)?,
                radius_m: check.positive(place("radius_m"), lamp.radius_m)?,
                irradiance: check.colour(place("irradiance_w_m2"), lamp.irradiance_w_m2)?,
            });
        }
        for (index, lamp) in text.slide.iter().enumerate() {
            lamps.push(check.slide(index, lamp)?);
        }
        light.environment = text.environment.map(|environment| check.environment(&environment)).transpose()?;
        if let Some(MosaicText { file }) = text.mosaic {
            let path = check.beside(&file);
            light.mosaic = Some(Mosaic { pixels: files::read_linear(&path)?.reinterpret(), path });
        }
        if let Some(placement) = text.placement {
            light.placement = Placement {
                translation: check.vector("placement: translate_m".into(), placement.translate_m)?,
                rotation: check.finite("placement: rotate_deg".into(), placement.rotate_deg)?.to_radians(),
            };
        }
        Ok(light)
    }
}

/// Beyond 10⁹ m squares of distances lose all meaning.
const FARTHEST_M: f64 = 1e9;

/// The unit vector along `vector`; `None` below 10⁻³⁰, where it is nothing but rounding.
fn unit(vector: DVec3) -> Option<DVec3> {
    let largest = vector.abs().max_element();
    if largest < 1e-30 { None } else { (vector / largest).try_normalize() }
}

/// Values held against their ranges.
struct Check<'a> {
    path: &'a Path,
}

impl Check<'_> {
    fn fail<T>(&self, place: impl Into<String>, reason: impl Into<String>) -> Result<T, LightError> {
        Err(LightError::Value { path: self.path.to_path_buf(), place: place.into(), reason: reason.into() })
    }

    fn finite(&self, place: String, value: f64) -> Result<f64, LightError> {
        if value.is_finite() { Ok(value) } else { self.fail(place, format!("expected a number, found {value}")) }
    }

    fn positive(&self, place: String, value: f64) -> Result<f64, LightError> {
        if value > 0.0 && value <= FARTHEST_M {
            Ok(value)
        } else {
            self.fail(place, format!("must be above 0 and at most 1e9, but is {value}"))
        }
    }

    fn vector(&self, place: String, value: [f64; 3]) -> Result<DVec3, LightError> {
        if value.iter().all(|component| component.abs() <= FARTHEST_M) {
            Ok(DVec3::from_array(value))
        } else {
            self.fail(place, format!("expected three numbers within ±1e9 m, found {value:?}"))
        }
    }

    fn direction(&self, place: String, value: [f64; 3]) -> Result<DVec3, LightError> {
        match unit(self.vector(place.clone(), value)?) {
            Some(direction) => Ok(direction),
            None => self.fail(place, format!("expected a direction of some length, found {value:?}")),
        }
    }

    fn colour(&self, place: String, value: [f64; 3]) -> Result<DVec3, LightError> {
        if value.iter().all(|component| (0.0..=1e30).contains(component)) {
            Ok(DVec3::from_array(value))
        } else {
            self.fail(place, format!("expected red, green and blue, none negative, found {value:?}"))
        }
    }

    fn beside(&self, file: &Path) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("")).join(file)
    }

    fn spot(&self, index: usize, lamp: &SpotText) -> Result<Lamp, LightError> {
        let place = |key: &str| format!("spot {index}: {key}");
        let position = self.vector(place("position"), lamp.position)?;
        let target = self.vector(place("target"), lamp.target)?;
        let (beam, cutoff) = (lamp.beam_half_angle_deg, lamp.cutoff_half_angle_deg);
        if !(beam >= 0.0 && beam <= cutoff && cutoff > 0.0 && cutoff <= 180.0) {
            return self.fail(
                place("cutoff_half_angle_deg"),
                format!("expected 0 ≤ beam ≤ cutoff ≤ 180 degrees, found a beam of {beam} and a cutoff of {cutoff}"),
            );
        }
        Ok(Lamp::Spot {
            position,
            axis: self.direction(place("target"), (target - position).to_array())?,
            intensity: self.colour(place("intensity_w_sr"), lamp.intensity_w_sr)?,
            beam_half_angle: beam.to_radians(),
            cutoff_half_angle: cutoff.to_radians(),
        })
    }

    fn rectangle(&self, index: usize, lamp: &RectangleText) -> Result<Lamp, LightError> {
        let place = |key: &str| format!("rectangle {index}: {key}");
        let edge_u = self.vector(place("edge_u"), lamp.edge_u)?;
        let edge_v = self.vector(place("edge_v"), lamp.edge_v)?;
        let spans = unit(edge_u).zip(unit(edge_v)).is_some_and(|(u, v)| u.cross(v).length() > 1e-9);
        if !spans {
            return self.fail(place("edge_v"), "edge_u and edge_v must span an area");
        }
        Ok(Lamp::Rectangle(Rectangle {
            corner: self.vector(place("corner"), lamp.corner)?,
            edge_u,
            edge_v,
            radiance: self.colour(place("radiance"), lamp.radiance)?,
        }))
    }

    fn slide(&self, index: usize, lamp: &SlideText) -> Result<Lamp, LightError> {
        let place = |key: &str| format!("slide {index}: {key}");
        let position = self.vector(place("position"), lamp.position)?;
        let target = self.vector(place("target"), lamp.target)?;
        let axis = self.direction(place("target"), (target - position).to_array())?;
        // Float pictures are linear, integer ones sRGB.
        let picture = files::read_picture(&self.beside(&lamp.picture))?.into_linear(true).reinterpret();
        let slide = Slide::new(
            position,
            axis,
            self.direction(place("up"), lamp.up)?,
            self.positive(place("half_width"), lamp.half_width)?,
            self.colour(place("intensity_w_sr"), lamp.intensity_w_sr)?,
            picture,
        );
        match slide {
            Some(slide) => Ok(Lamp::Slide(slide)),
            None => self.fail(place("up"), "must not point along the projector's axis"),
        }
    }

    fn environment(&self, environment: &EnvironmentText) -> Result<Environment, LightError> {
        let sky = match (&environment.map, environment.radiance) {
            (Some(map), None) => Environment::lat_long(files::read_linear(&self.beside(map))?.reinterpret()),
            (None, Some(radiance)) => Environment::constant(self.colour("environment: radiance".into(), radiance)?),
            _ => return self.fail("environment", "expected either `map` or `radiance`"),
        };
        let rotation = self.finite("environment: rotation_deg".into(), environment.rotation_deg)?;
        let scale = environment.scale;
        if !(0.0..=1e30).contains(&scale) {
            return self.fail("environment: scale", format!("must not be negative, but is {scale}"));
        }
        Ok(sky.turned(rotation.to_radians(), scale))
    }
}
