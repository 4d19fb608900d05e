//! Reading a scene: `scene.toml` (FORMAT.md §6), or a model file by itself.

mod named;
mod text;

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use glam::{Affine2, Affine3A, DVec3, EulerRot, Quat, Vec2, Vec3};
use relumine_radiometry::files::{FileError, MAX_PIXELS};
use relumine_radiometry::{DescriptionError, nearest, parse_toml, read_text};

use named::Named;
use text::{CameraText, ColourText, ConductorText, LatheText, MaterialText, ModelText, ObjectText, Text, VaryingText};

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

/// The largest coordinate of anything, metres: single precision holds a tenth of a millimetre there.
const FARTHEST_M: f32 = 1e3;

/// The smallest length of anything before it is scaled, metres.
const SMALLEST_M: f32 = 1e-6;

/// The most materials: the clear coat of each plastic is tabulated, which takes some milliseconds.
const MAX_MATERIALS: usize = 4096;

/// The most triangles of a scene, as of one model.
const MAX_TRIANGLES: usize = 1 << 26;

/// The most triangles that all lathes of a scene may turn: a line of text asks for thousands of them.
const MAX_TURNED: usize = 1 << 22;

/// The least index of rough glass: with none, no facet bends light.
const LEAST_ROUGH_INDEX: f32 = 1.01;

/// Letters of an object's name that are kept: every part of a model carries it.
const NAME_LETTERS: usize = 80;

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
        check.claims(&text)?;
        let mut named = Named::default();
        let mut materials = HashMap::new();
        for material in &text.material {
            if materials.insert(material.name.as_str(), check.material(material, &mut named)?).is_some() {
                return check.fail(format!("material \"{}\"", material.name), "the name is given twice");
            }
        }
        check.models(&text, &mut named)?;
        let mut solids = Vec::new();
        for (index, object) in text.object.iter().enumerate() {
            check.object(index, object, &materials, &mut named, &mut solids)?;
        }
        Ok(Self::new(camera, (text.camera.width, text.camera.height), solids))
    }
}

/// A model before a camera.
fn alone(path: &Path) -> Result<Scene, SceneError> {
    let model = read_model(path, None)?;
    let check = Check { path };
    let corners = || model.parts.iter().flat_map(|part| &part.mesh.positions);
    if let Some(far) = corners().find(|corner| !is_near(**corner)) {
        return check
            .fail("model", format!("expected triangles within {FARTHEST_M} m of the origin, found one at {far}"));
    }
    let low = corners().fold(Vec3::INFINITY, |low, corner| low.min(*corner));
    let high = corners().fold(Vec3::NEG_INFINITY, |high, corner| high.max(*corner));
    let (centre, radius) = ((0.5 * (low + high)).as_dvec3(), f64::from((0.5 * (high - low)).length()).max(1e-6));
    let fov = 30f64.to_radians();
    let from = DVec3::new(0.0, -0.82, 0.57).normalize();
    let camera = Camera::new(centre + from * (1.05 * radius / (0.5 * fov).sin()), centre, DVec3::Z, fov);
    let Some(camera) = camera else { return check.fail("model", "has no extent") };
    Ok(Scene::new(camera, (480, 480), model.parts.into_iter().map(Solid::Mesh).collect()))
}

/// Whether a point lies within reach; what is not a number does not.
fn is_near(point: Vec3) -> bool {
    point.is_finite() && point.abs().max_element() <= FARTHEST_M
}

/// About x, then y, then z, the axes of the world.
fn turn(rotate_deg: [f32; 3]) -> Quat {
    let [x, y, z] = rotate_deg.map(f32::to_radians);
    Quat::from_euler(EulerRot::ZYX, z, y, x)
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
            self.fail(place, format!("expected {low} to {high}, found {value}"))
        }
    }

    fn camera(&self, text: &CameraText) -> Result<Camera, SceneError> {
        if text.width == 0 || text.height == 0 || text.width.saturating_mul(text.height) > MAX_PIXELS {
            let found = format!("{} × {}", text.width, text.height);
            return self.fail("camera: width, height", format!("expected 1 to {MAX_PIXELS} pixels, found {found}"));
        }
        for (key, vector) in [("position", text.position), ("target", text.target), ("up", text.up)] {
            let length = DVec3::from_array(*vector).length();
            if !length.is_finite() || length > f64::from(FARTHEST_M) {
                let reason = format!("expected at most {FARTHEST_M} m from the origin, found {:?}", *vector);
                return self.fail(format!("camera: {key}"), reason);
            }
        }
        let fov = text.horizontal_fov_deg;
        if !(fov > 0.0 && fov < 180.0) {
            return self.fail("camera: horizontal_fov_deg", format!("expected above 0 and below 180, found {fov}"));
        }
        let [position, target, up] = [text.position, text.target, text.up].map(|vector| DVec3::from_array(*vector));
        if (target - position).try_normalize().is_none() {
            return self.fail("camera: target", format!("expected apart from the position, found {:?}", *text.target));
        }
        match Camera::new(position, target, up, fov.to_radians()) {
            Some(camera) => Ok(camera),
            None => self.fail("camera: up", format!("expected not along the view, found {:?}", *text.up)),
        }
    }

    /// What a few words ask for, before anything is made of it.
    fn claims(&self, text: &Text) -> Result<(), SceneError> {
        let materials = text.material.len();
        if materials > MAX_MATERIALS {
            return self.fail("material", format!("expected at most {MAX_MATERIALS}, found {materials}"));
        }
        let lathes = text.object.iter().filter_map(|object| object.lathe.as_ref());
        let turned = lathes.map(most_triangles).fold(0, usize::saturating_add);
        if turned > MAX_TURNED {
            return self.fail(
                "lathe",
                format!(
                    "expected at most {MAX_TURNED} triangles of all lathes, found {turned}: fewer segments or points \
                     make fewer"
                ),
            );
        }
        Ok(())
    }

    /// Reads all models and counts their triangles, each as often as it stands in the scene, before copies are made.
    fn models(&self, text: &Text, named: &mut Named) -> Result<(), SceneError> {
        let mut triangles = 0usize;
        for (index, object) in text.object.iter().enumerate() {
            let Some(model) = &object.model else { continue };
            let place = |key: &str| format!("object \"{}\": {key}", named_or_numbered(object, index));
            let parts = named.model(self.beside(&model.file), self.up(place("model.up"), model)?)?;
            triangles = parts.iter().map(|part| part.mesh.triangles.len()).fold(triangles, usize::saturating_add);
            if triangles > MAX_TRIANGLES {
                let reason =
                    format!("expected at most {MAX_TRIANGLES} triangles of it and the models before, found more");
                return self.fail(place("model"), reason);
            }
        }
        Ok(())
    }

    fn up(&self, place: String, text: &ModelText) -> Result<Option<Up>, SceneError> {
        match text.up.as_deref() {
            None => Ok(None),
            Some("y") => Ok(Some(Up::Y)),
            Some("z") => Ok(Some(Up::Z)),
            Some(other) => self.fail(place, format!("expected \"y\" or \"z\", found \"{other}\"")),
        }
    }

    fn material(&self, text: &MaterialText, named: &mut Named) -> Result<Material, SceneError> {
        let place = |key: &str| format!("material \"{}\": {key}", text.name);
        let alpha = |key: &str, value: f32| self.within(place(key), value, 0.0, 1.0);
        match (&text.diffuse, &text.conductor, &text.plastic, &text.glass) {
            (Some(diffuse), None, None, None) => Ok(Material::Diffuse {
                reflectance: self.texture(place("diffuse.reflectance"), &diffuse.reflectance, named)?,
            }),
            (None, Some(conductor), None, None) => {
                let (eta, k) = self.metal(place("conductor"), conductor)?;
                Ok(Material::Conductor { eta, k, alpha: alpha("conductor.alpha", conductor.alpha)? })
            }
            (None, None, Some(plastic), None) => Ok(Material::Plastic {
                diffuse: self.texture(place("plastic.diffuse"), &plastic.diffuse, named)?,
                index: self.within(place("plastic.index"), plastic.index, 1.0, 4.0)?,
                alpha: alpha("plastic.alpha", plastic.alpha)?,
            }),
            (None, None, None, Some(glass)) => {
                let alpha = alpha("glass.alpha", glass.alpha)?;
                let least = if alpha > 0.0 { LEAST_ROUGH_INDEX } else { 1.0 };
                Ok(Material::Glass {
                    index: self.within(place("glass.index"), glass.index, least, 4.0)?,
                    alpha,
                    tint: self.colour(place("glass.tint"), *glass.tint)?,
                })
            }
            (diffuse, conductor, plastic, glass) => {
                let given = [
                    ("diffuse", diffuse.is_some()),
                    ("conductor", conductor.is_some()),
                    ("plastic", plastic.is_some()),
                    ("glass", glass.is_some()),
                ];
                self.one_of(format!("material \"{}\"", text.name), &given)
            }
        }
    }

    /// Fails: not one of the kinds is given, but none or several.
    fn one_of<T>(&self, place: String, kinds: &[(&str, bool)]) -> Result<T, SceneError> {
        let known: Vec<&str> = kinds.iter().map(|(kind, _)| *kind).collect();
        let given: Vec<&str> = kinds.iter().filter(|(_, given)| *given).map(|(kind, _)| *kind).collect();
        let found = if given.is_empty() { "none".to_owned() } else { given.join(" and ") };
        self.fail(place, format!("expected one of {}, found {found}", known.join(", ")))
    }

    fn metal(&self, place: String, text: &ConductorText) -> Result<(Vec3, Vec3), SceneError> {
        match (&text.metal, text.eta, text.k) {
            (Some(metal), None, None) => match METALS.iter().find(|(known, ..)| known == metal) {
                Some((_, eta, k)) => Ok((Vec3::from_array(*eta), Vec3::from_array(*k))),
                None => {
                    let known: Vec<&str> = METALS.iter().map(|(known, ..)| *known).collect();
                    self.fail(place, format!("expected a metal of {}, found \"{metal}\"", known.join(", ")))
                }
            },
            (None, Some(eta), Some(k)) => {
                if eta.iter().all(|eta| *eta > 0.0 && *eta <= 100.0) && k.iter().all(|k| (0.0..=100.0).contains(k)) {
                    Ok((Vec3::from_array(*eta), Vec3::from_array(*k)))
                } else {
                    self.fail(
                        place,
                        format!("expected eta above 0 and k from 0, both at most 100, found {:?} and {:?}", *eta, *k),
                    )
                }
            }
            (metal, eta, k) => {
                let given = [("metal", metal.is_some()), ("eta", eta.is_some()), ("k", k.is_some())];
                let given: Vec<&str> = given.iter().filter(|(_, given)| *given).map(|(key, _)| *key).collect();
                let found = if given.is_empty() { "none".to_owned() } else { given.join(" and ") };
                self.fail(place, format!("expected either metal, or eta and k, found {found}"))
            }
        }
    }

    fn colour(&self, place: String, value: [f32; 3]) -> Result<Vec3, SceneError> {
        if value.iter().all(|component| (0.0..=1.0).contains(component)) {
            Ok(Vec3::from_array(value))
        } else {
            self.fail(place, format!("expected red, green and blue, 0 to 1, found {value:?}"))
        }
    }

    fn texture(&self, place: String, text: &ColourText, named: &mut Named) -> Result<Texture, SceneError> {
        match text {
            ColourText::Constant(colour) => Ok(Texture::Constant(self.colour(place, **colour)?)),
            ColourText::Varying(VaryingText { checkerboard: Some(colours), fields, picture: None }) => {
                let fields = fields.map_or([8.0; 2], |fields| *fields);
                let [even, odd] = **colours;
                if !fields.iter().all(|count| *count > 0.0 && *count <= 1e4) {
                    return self.fail(place, format!("expected fields above 0 and at most 10000, found {fields:?}"));
                }
                let (even, odd) = (self.colour(place.clone(), *even)?, self.colour(place, *odd)?);
                Ok(Texture::Checkerboard { even, odd, fields: Vec2::from_array(fields) })
            }
            ColourText::Varying(VaryingText { checkerboard: None, fields: None, picture: Some(file) }) => {
                let picture = named.picture(&self.beside(file))?;
                if named.pixels() > MAX_PIXELS {
                    let reason = format!("expected at most {MAX_PIXELS} pixels in all pictures together, found more");
                    return self.fail(place, reason);
                }
                Ok(Texture::Picture(TexturePicture {
                    picture,
                    factor: Vec3::ONE,
                    wrap: [Wrap::Repeat; 2],
                    picture_from_mesh: Affine2::IDENTITY,
                }))
            }
            ColourText::Varying(_) => {
                self.fail(place, "expected a colour, or { checkerboard } with or without fields, or { picture }")
            }
        }
    }

    fn object(
        &self,
        index: usize,
        text: &ObjectText,
        materials: &HashMap<&str, Material>,
        named: &mut Named,
        solids: &mut Vec<Solid>,
    ) -> Result<(), SceneError> {
        let name = named_or_numbered(text, index);
        let place = |key: &str| format!("object \"{name}\": {key}");
        let scale = self.within(place("scale"), text.scale, 1e-6, 1e6)?;
        if !text.rotate_deg.iter().all(|angle| angle.is_finite()) {
            return self.fail(place("rotate_deg"), format!("expected three angles, found {:?}", *text.rotate_deg));
        }
        let translation = Vec3::from_array(*text.translate_m);
        if !is_near(translation) {
            let reason = format!("expected -{FARTHEST_M} to {FARTHEST_M}, found {:?}", *text.translate_m);
            return self.fail(place("translate_m"), reason);
        }
        let turn = turn(*text.rotate_deg);
        let world_from_object = Affine3A::from_scale_rotation_translation(Vec3::splat(scale), turn, translation);
        let material = match &text.material {
            None => None,
            Some(wanted) => match materials.get(wanted.as_str()) {
                Some(material) => Some(material.clone()),
                None => {
                    let known: Vec<&str> = materials.keys().copied().collect();
                    let near =
                        nearest(wanted, &known).map_or(String::new(), |near| format!("; did you mean \"{near}\"?"));
                    return self
                        .fail(place("material"), format!("expected one of the scene, found \"{wanted}\"{near}"));
                }
            },
        };
        let needed = |material: Option<Material>| match material {
            Some(material) => Ok(Surface::from(material)),
            None => self.fail(place("material"), "expected a name, found none: only models bring their own"),
        };
        let far = |found: Vec3| -> Result<(), SceneError> {
            let reason = format!("expected nothing beyond {FARTHEST_M} m along an axis, found a point at {found}");
            self.fail(format!("object \"{name}\""), reason)
        };
        let mut add = |mesh: Mesh, surface: Surface| -> Result<(), SceneError> {
            let mesh = placed(mesh, world_from_object, turn);
            if let Some(found) = mesh.positions.iter().find(|corner| !is_near(**corner)) {
                return far(*found);
            }
            solids.push(Solid::Mesh(Part { name: name.clone(), mesh, surface }));
            Ok(())
        };
        let lengths = |key: &str, lengths: &[f32]| -> Result<(), SceneError> {
            lengths.iter().try_for_each(|length| self.within(place(key), *length, SMALLEST_M, FARTHEST_M).map(drop))
        };
        match (&text.model, &text.sphere, &text.plane, &text.cuboid, &text.lathe) {
            (Some(model), None, None, None, None) => {
                for part in named.model(self.beside(&model.file), self.up(place("model.up"), model)?)? {
                    let surface = material.clone().map_or_else(|| part.surface.clone(), Surface::from);
                    add(part.mesh.clone(), surface)?;
                }
                Ok(())
            }
            (None, Some(sphere), None, None, None) => {
                lengths("sphere.radius_m", &[sphere.radius_m])?;
                let radius = scale * sphere.radius_m;
                self.within(place("sphere.radius_m times scale"), radius, SMALLEST_M, FARTHEST_M)?;
                let corner = translation + radius * translation.signum();
                if !is_near(corner) {
                    return far(corner);
                }
                solids.push(Solid::Ball { centre: translation, radius, surface: needed(material)? });
                Ok(())
            }
            (None, None, Some(plane), None, None) => {
                lengths("plane.size_m", &*plane.size_m)?;
                add(solids::rectangle(Vec2::from_array(*plane.size_m)), needed(material)?)
            }
            (None, None, None, Some(cuboid), None) => {
                lengths("box.size_m", &*cuboid.size_m)?;
                add(solids::cuboid(Vec3::from_array(*cuboid.size_m)), needed(material)?)
            }
            (None, None, None, None, Some(lathe)) => {
                let surface = needed(material)?;
                add(self.lathe(place("lathe"), lathe)?, surface)
            }
            (model, sphere, plane, cuboid, lathe) => {
                let given = [
                    ("model", model.is_some()),
                    ("sphere", sphere.is_some()),
                    ("plane", plane.is_some()),
                    ("box", cuboid.is_some()),
                    ("lathe", lathe.is_some()),
                ];
                self.one_of(format!("object \"{name}\""), &given)
            }
        }
    }

    fn lathe(&self, place: String, text: &LatheText) -> Result<Mesh, SceneError> {
        let points = text.profile_m.len();
        if !(2..=10_000).contains(&points) {
            return self.fail(place, format!("expected 2 to 10000 points of the profile, found {points}"));
        }
        let profile: Vec<[f32; 2]> = text.profile_m.iter().map(|point| **point).collect();
        let unsound = |point: &&[f32; 2]| !(0.0..=FARTHEST_M).contains(&point[0]) || !is_near(Vec3::Z * point[1]);
        if let Some(point) = profile.iter().find(unsound) {
            let reason =
                format!("expected [radius, height], a radius from 0, both at most {FARTHEST_M} m, found {point:?}");
            return self.fail(place, reason);
        }
        if !(3..=4096).contains(&text.segments) {
            return self.fail(place, format!("expected 3 to 4096 segments, found {}", text.segments));
        }
        let mesh = Lathe { profile: &profile, smooth: text.smooth, segments: text.segments }.turn();
        if mesh.triangles.is_empty() {
            return self.fail(place, "expected a profile that turns a surface, found none off the axis");
        }
        Ok(mesh)
    }
}

/// What messages call an object.
fn named_or_numbered(text: &ObjectText, index: usize) -> String {
    match &text.name {
        Some(name) => name.chars().take(NAME_LETTERS).collect(),
        None => index.to_string(),
    }
}

/// The most triangles that a lathe makes.
fn most_triangles(text: &LatheText) -> usize {
    // The steps of a smooth profile between two of its points.
    let steps = if text.smooth { 5 } else { 1 };
    let rings = text.profile_m.len().saturating_sub(1).saturating_mul(steps);
    rings.saturating_mul(text.segments).saturating_mul(2)
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
