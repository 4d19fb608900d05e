//! Reading a scene: `scene.toml` (FORMAT.md §6), or a model file by itself.

mod text;

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{Affine2, Affine3A, DVec3, EulerRot, Quat, Vec2, Vec3};
use relumine_radiometry::files::{self, FileError, MAX_PIXELS};
use relumine_radiometry::{DescriptionError, nearest, parse_toml, read_text};

use text::{CameraText, ColourText, ConductorText, LatheText, MaterialText, ObjectText, Text, VaryingText};

use crate::scene::Solid;
use crate::solids::{self, Lathe};
use crate::{Camera, Material, Mesh, ModelError, Part, Scene, Surface, Texture, TexturePicture, Up, Wrap, read_model};

/// What is wrong with a scene.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// The description cannot be read.
    #[error(transparent)]
    Description(#[from] DescriptionError),
    /// A picture it names cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// A model it names cannot be read.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A value that cannot be.
    #[error("{}: {place}: {reason}", path.display())]
    Value {
        /// The description.
        path: PathBuf,
        /// Which object or material, and which key.
        place: String,
        /// What was expected and what came.
        reason: String,
    },
}

/// Metals by the name of their element: complex indices for red, green and blue, from measured spectra.
const METALS: [(&str, [f32; 3], [f32; 3]); 4] = [
    ("Ag", [0.155_27, 0.116_73, 0.138_31], [4.828_4, 3.122_3, 2.147_0]),
    ("Al", [1.657_5, 0.880_37, 0.521_23], [9.223_8, 6.269_5, 4.837_0]),
    ("Au", [0.143_12, 0.374_96, 1.442_48], [3.983_16, 2.385_72, 1.603_22]),
    ("Cu", [0.200_44, 0.924_03, 1.102_21], [3.912_9, 2.452_8, 2.142_2]),
];

/// The largest extent and coordinate of anything, metres: single precision holds a tenth of a millimetre there.
const FARTHEST_M: f32 = 1e3;

impl Scene {
    /// The `format` line of this version.
    pub const FORMAT: &'static str = "relumine-scene/1";

    /// Reads a scene: `.toml` is a description; a model (`.gltf`, `.glb`, `.obj`) stands by itself before a camera that sees
    /// all of it from the front and above.
    ///
    /// # Errors
    /// If it or a file that it names cannot be read, has unknown keys or impossible values.
    pub fn read(path: &Path) -> Result<Self, SceneError> {
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        if matches!(extension.as_deref(), Some("gltf" | "glb" | "obj")) {
            return alone(path);
        }
        Self::parse(path, &read_text(path)?)
    }

    /// Reads the text of a description; the files it names are looked for beside `path`.
    ///
    /// # Errors
    /// As [`Scene::read`].
    pub fn parse(path: &Path, text: &str) -> Result<Self, SceneError> {
        let text: Text = parse_toml(path, text)?;
        let check = Check { path };
        if text.format != Self::FORMAT {
            return check.fail("format", format!("expected \"{}\", found \"{}\"", Self::FORMAT, text.format));
        }
        let camera = check.camera(&text.camera)?;
        let mut materials = HashMap::new();
        for material in &text.material {
            if materials.insert(material.name.as_str(), check.material(material)?).is_some() {
                return check.fail(format!("material \"{}\"", material.name), "the name is given twice");
            }
        }
        let mut solids = Vec::new();
        for (index, object) in text.object.iter().enumerate() {
            check.object(index, object, &materials, &mut solids)?;
        }
        Ok(Self::new(camera, (text.camera.width, text.camera.height), solids))
    }
}

/// A model before a camera.
fn alone(path: &Path) -> Result<Scene, SceneError> {
    let model = read_model(path, None)?;
    let check = Check { path };
    let corners = || model.parts.iter().flat_map(|part| &part.mesh.positions);
    let low = corners().fold(Vec3::INFINITY, |low, corner| low.min(*corner));
    let high = corners().fold(Vec3::NEG_INFINITY, |high, corner| high.max(*corner));
    if !(low.is_finite() && high.is_finite() && low.abs().max(high.abs()).max_element() <= FARTHEST_M) {
        return check.fail("model", format!("expected triangles within {FARTHEST_M} m of the origin"));
    }
    let (centre, radius) = ((0.5 * (low + high)).as_dvec3(), f64::from((0.5 * (high - low)).length()).max(1e-6));
    let fov = 30f64.to_radians();
    let from = DVec3::new(0.0, -0.82, 0.57).normalize();
    let camera = Camera::new(centre + from * (1.05 * radius / (0.5 * fov).sin()), centre, DVec3::Z, fov);
    let Some(camera) = camera else { return check.fail("model", "has no extent") };
    Ok(Scene::new(camera, (480, 480), model.parts.into_iter().map(Solid::Mesh).collect()))
}

/// Values held against their ranges.
struct Check<'a> {
    path: &'a Path,
}

impl Check<'_> {
    fn fail<T>(&self, place: impl Into<String>, reason: impl Into<String>) -> Result<T, SceneError> {
        Err(SceneError::Value { path: self.path.to_path_buf(), place: place.into(), reason: reason.into() })
    }

    fn beside(&self, file: &Path) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("")).join(file)
    }

    fn within(&self, place: String, value: f32, low: f32, high: f32) -> Result<f32, SceneError> {
        if (low..=high).contains(&value) {
            Ok(value)
        } else {
            self.fail(place, format!("must be {low} to {high}, but is {value}"))
        }
    }

    fn camera(&self, text: &CameraText) -> Result<Camera, SceneError> {
        if text.width == 0 || text.height == 0 || text.width.saturating_mul(text.height) > MAX_PIXELS {
            let found = format!("{} × {}", text.width, text.height);
            return self.fail("camera: width, height", format!("expected 1 to {MAX_PIXELS} pixels, found {found}"));
        }
        let vectors = [text.position, text.target, text.up].map(DVec3::from_array);
        if vectors.iter().any(|vector| !(vector.length() <= f64::from(FARTHEST_M))) {
            return self.fail("camera", format!("position, target and up must be finite and within {FARTHEST_M} m"));
        }
        let [position, target, up] = vectors;
        match Camera::new(position, target, up, text.horizontal_fov_deg.to_radians()) {
            Some(camera) => Ok(camera),
            None => self.fail(
                "camera",
                "expected a target apart from the position, an up that is not along the view, and horizontal_fov_deg \
                 above 0 and below 180",
            ),
        }
    }

    fn material(&self, text: &MaterialText) -> Result<Material, SceneError> {
        let place = |key: &str| format!("material \"{}\": {key}", text.name);
        let alpha = |value: f32| self.within(place("alpha"), value, 0.0, 1.0);
        let index = |value: f32| self.within(place("index"), value, 1.0, 4.0);
        match (&text.diffuse, &text.conductor, &text.plastic, &text.glass) {
            (Some(diffuse), None, None, None) => {
                Ok(Material::Diffuse { reflectance: self.texture(place("reflectance"), &diffuse.reflectance)? })
            }
            (None, Some(conductor), None, None) => {
                let (eta, k) = self.metal(&text.name, conductor)?;
                Ok(Material::Conductor { eta, k, alpha: alpha(conductor.alpha)? })
            }
            (None, None, Some(plastic), None) => Ok(Material::Plastic {
                diffuse: self.texture(place("diffuse"), &plastic.diffuse)?,
                index: index(plastic.index)?,
                alpha: alpha(plastic.alpha)?,
            }),
            (None, None, None, Some(glass)) => Ok(Material::Glass {
                index: index(glass.index)?,
                alpha: alpha(glass.alpha)?,
                tint: self.colour(place("tint"), glass.tint)?,
            }),
            _ => self
                .fail(format!("material \"{}\"", text.name), "expected one of diffuse, conductor, plastic and glass"),
        }
    }

    fn metal(&self, name: &str, text: &ConductorText) -> Result<(Vec3, Vec3), SceneError> {
        let place = format!("material \"{name}\": conductor");
        match (&text.metal, text.eta, text.k) {
            (Some(metal), None, None) => match METALS.iter().find(|(known, ..)| known == metal) {
                Some((_, eta, k)) => Ok((Vec3::from_array(*eta), Vec3::from_array(*k))),
                None => {
                    let known: Vec<&str> = METALS.iter().map(|(known, ..)| *known).collect();
                    self.fail(place, format!("metal must be one of {}, found \"{metal}\"", known.join(", ")))
                }
            },
            (None, Some(eta), Some(k)) => {
                let (eta, k) = (Vec3::from_array(eta), Vec3::from_array(k));
                if eta.min_element() > 0.0 && k.min_element() >= 0.0 && eta.max(k).max_element() <= 100.0 {
                    Ok((eta, k))
                } else {
                    self.fail(place, "expected eta above 0 and k from 0, at most 100")
                }
            }
            _ => self.fail(place, "expected either `metal`, or `eta` and `k`"),
        }
    }

    fn colour(&self, place: String, value: [f32; 3]) -> Result<Vec3, SceneError> {
        if value.iter().all(|component| (0.0..=1.0).contains(component)) {
            Ok(Vec3::from_array(value))
        } else {
            self.fail(place, format!("expected red, green and blue, 0 to 1, found {value:?}"))
        }
    }

    fn texture(&self, place: String, text: &ColourText) -> Result<Texture, SceneError> {
        match text {
            ColourText::Constant(colour) => Ok(Texture::Constant(self.colour(place, *colour)?)),
            ColourText::Varying(VaryingText { checkerboard: Some([even, odd]), fields, picture: None }) => {
                let fields = Vec2::from_array(fields.unwrap_or([8.0; 2]));
                if !(fields.min_element() > 0.0 && fields.max_element() <= 1e4) {
                    return self.fail(place, format!("fields must be above 0 and at most 10000, found {fields}"));
                }
                let (even, odd) = (self.colour(place.clone(), *even)?, self.colour(place, *odd)?);
                Ok(Texture::Checkerboard { even, odd, fields })
            }
            ColourText::Varying(VaryingText { checkerboard: None, fields: None, picture: Some(file) }) => {
                // Float pictures are linear, integer ones sRGB.
                let picture = files::read_picture(&self.beside(file))?.into_linear(true);
                Ok(Texture::Picture(TexturePicture {
                    picture: Arc::new(picture),
                    factor: Vec3::ONE,
                    wrap: [Wrap::Repeat; 2],
                    picture_from_mesh: Affine2::IDENTITY,
                }))
            }
            ColourText::Varying(_) => self.fail(place, "expected a colour, { checkerboard, fields } or { picture }"),
        }
    }

    fn object(
        &self,
        index: usize,
        text: &ObjectText,
        materials: &HashMap<&str, Material>,
        solids: &mut Vec<Solid>,
    ) -> Result<(), SceneError> {
        let name = text.name.clone().unwrap_or_else(|| index.to_string());
        let place = |key: &str| format!("object \"{name}\": {key}");
        let scale = self.within(place("scale"), text.scale, 1e-6, 1e6)?;
        let [x, y, z] = text.rotate_deg.map(f32::to_radians);
        let translation = Vec3::from_array(text.translate_m);
        if !([x, y, z].iter().all(|angle| angle.is_finite()) && translation.abs().max_element() <= FARTHEST_M) {
            return self
                .fail(place("translate_m"), format!("expected finite angles, and places within {FARTHEST_M} m"));
        }
        let turn = Quat::from_euler(EulerRot::ZYX, z, y, x);
        let world_from_object = Affine3A::from_scale_rotation_translation(Vec3::splat(scale), turn, translation);
        let material = match &text.material {
            None => None,
            Some(wanted) => match materials.get(wanted.as_str()) {
                Some(material) => Some(material.clone()),
                None => {
                    let known: Vec<&str> = materials.keys().copied().collect();
                    let near =
                        nearest(wanted, &known).map_or(String::new(), |near| format!("; did you mean \"{near}\"?"));
                    return self.fail(place("material"), format!("there is no material \"{wanted}\"{near}"));
                }
            },
        };
        let needed = |material: Option<Material>| match material {
            Some(material) => Ok(Surface::from(material)),
            None => self.fail(place("material"), "is lacking: only models bring their own"),
        };
        let mut add = |mesh: Mesh, surface: Surface| -> Result<(), SceneError> {
            let mesh = placed(mesh, world_from_object, turn);
            if mesh.positions.iter().any(|corner| !(corner.abs().max_element() <= FARTHEST_M)) {
                return self.fail(place("translate_m"), format!("reaches beyond {FARTHEST_M} m"));
            }
            solids.push(Solid::Mesh(Part { name: name.clone(), mesh, surface }));
            Ok(())
        };
        match (&text.model, &text.sphere, &text.plane, &text.cuboid, &text.lathe) {
            (Some(model), None, None, None, None) => {
                let up = match model.up.as_deref() {
                    None => None,
                    Some("y") => Some(Up::Y),
                    Some("z") => Some(Up::Z),
                    Some(other) => return self.fail(place("up"), format!("must be \"y\" or \"z\", found \"{other}\"")),
                };
                for part in read_model(&self.beside(&model.file), up)?.parts {
                    let surface = material.clone().map_or(part.surface, Surface::from);
                    add(part.mesh, surface)?;
                }
                Ok(())
            }
            (None, Some(sphere), None, None, None) => {
                let radius = self.within(place("radius_m"), sphere.radius_m, 1e-6, FARTHEST_M)? * scale;
                solids.push(Solid::Ball { centre: translation, radius, surface: needed(material)? });
                Ok(())
            }
            (None, None, Some(plane), None, None) => {
                let size = Vec2::from_array(plane.size_m);
                self.within(place("size_m"), size.min_element(), 1e-6, FARTHEST_M)?;
                add(solids::rectangle(size), needed(material)?)
            }
            (None, None, None, Some(cuboid), None) => {
                let size = Vec3::from_array(cuboid.size_m);
                self.within(place("size_m"), size.min_element(), 1e-6, FARTHEST_M)?;
                add(solids::cuboid(size), needed(material)?)
            }
            (None, None, None, None, Some(lathe)) => add(self.lathe(place("profile_m"), lathe)?, needed(material)?),
            _ => self.fail(format!("object \"{name}\""), "expected one of model, sphere, plane, box and lathe"),
        }
    }

    fn lathe(&self, place: String, text: &LatheText) -> Result<Mesh, SceneError> {
        let sound = text.profile_m.iter().all(|[r, z]| (0.0..=FARTHEST_M).contains(r) && z.abs() <= FARTHEST_M);
        if !sound || !(2..=10_000).contains(&text.profile_m.len()) {
            return self.fail(place, "expected 2 to 10000 points [radius, height], no radius below 0");
        }
        if !(3..=4096).contains(&text.segments) {
            return self.fail(place, format!("segments must be 3 to 4096, found {}", text.segments));
        }
        Ok(Lathe { profile: &text.profile_m, smooth: text.smooth, segments: text.segments }.turn())
    }
}

fn placed(mut mesh: Mesh, world_from_object: Affine3A, turn: Quat) -> Mesh {
    for position in &mut mesh.positions {
        *position = world_from_object.transform_point3(*position);
    }
    // The scale is even, so normals only turn.
    for normal in &mut mesh.normals {
        *normal = turn * *normal;
    }
    mesh
}
