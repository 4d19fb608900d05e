//! Wavefront OBJ: `v`, `vt`, `vn`, `f`, `o`, `g`, `mtllib` and `usemtl`; other lines are passed over.
//!
//! Read here, line by line, because messages shall name the line, faces with and without normals occur in one file, and
//! the libraries tried panic on short lines.

mod corner;
mod library;

use std::collections::HashMap;

use glam::{Vec2, Vec3};

use self::corner::corner;
use self::library::Library;
use super::file::{ModelFile, short};
use super::placement::placed;
use super::{ModelError, Up};
use crate::{Material, Mesh, Model, Part, Surface, Texture};

/// Of faces without a material.
const GREY: Vec3 = Vec3::splat(0.5);

/// Reads a model whose bytes are those of `file`.
pub(super) fn read(file: &ModelFile<'_>, bytes: &[u8], up: Option<Up>) -> Result<Model, ModelError> {
    let mut reader = Reader::new(file);
    for (number, line) in bytes.split(|byte| *byte == b'\n').enumerate() {
        // Names may be in any code page; the rest is ASCII.
        reader.line(number + 1, &String::from_utf8_lossy(line))?;
    }
    reader.finish(up.unwrap_or(Up::Z))
}

/// Faces that become one part: of one object and material, and with the same things known of their corners.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
struct Kind {
    object: usize,
    material: Option<usize>,
    uvs: bool,
    normals: bool,
}

/// A part that is still growing.
struct Draft {
    name: String,
    material: Option<usize>,
    mesh: Mesh,
    /// By the indices of place, texture coordinates and normal.
    corners: HashMap<[usize; 3], u32>,
}

struct Reader<'a> {
    file: &'a ModelFile<'a>,
    positions: Vec<Vec3>,
    uvs: Vec<Vec2>,
    normals: Vec<Vec3>,
    /// The object's number and name.
    object: (usize, String),
    material: Option<usize>,
    /// Names of materials and the line of each that names it first.
    materials: Vec<(String, usize)>,
    material_numbers: HashMap<String, usize>,
    mtl: Library,
    drafts: Vec<Draft>,
    draft_numbers: HashMap<Kind, usize>,
    triangles: usize,
}

impl<'a> Reader<'a> {
    fn new(file: &'a ModelFile<'a>) -> Self {
        let name = file.path().file_stem().map(|name| short(&name.to_string_lossy())).unwrap_or_default();
        Self {
            file,
            positions: Vec::new(),
            uvs: Vec::new(),
            normals: Vec::new(),
            object: (0, name),
            material: None,
            materials: Vec::new(),
            material_numbers: HashMap::new(),
            mtl: Library::default(),
            drafts: Vec::new(),
            draft_numbers: HashMap::new(),
            triangles: 0,
        }
    }

    fn line(&mut self, number: usize, line: &str) -> Result<(), ModelError> {
        let (word, rest) = words(line);
        let place = || format!("line {number}");
        let malformed = |reason: String| self.file.malformed(place(), reason);
        match word {
            // A weight or a colour may follow.
            "v" => self.positions.push(Vec3::from_array(numbers(rest, 3).map_err(malformed)?)),
            // Its v points upward, ours downward. Some give u alone, some a third number.
            "vt" => {
                let [u, v, _] = numbers(rest, 1).map_err(malformed)?;
                self.uvs.push(Vec2::new(u, 1.0 - v));
            }
            "vn" => self.normals.push(Vec3::from_array(numbers(rest, 3).map_err(malformed)?)),
            "f" => self.face(number, before_comment(rest))?,
            "o" | "g" => self.object = (self.object.0 + 1, short(rest)),
            "mtllib" => self.mtl.add(self.file, &place(), rest)?,
            "usemtl" => self.material = Some(self.material(number, rest)),
            _ => {}
        }
        Ok(())
    }

    fn material(&mut self, line: usize, name: &str) -> usize {
        if let Some(known) = self.material_numbers.get(name) {
            return *known;
        }
        self.material_numbers.insert(name.to_owned(), self.materials.len());
        self.materials.push((name.to_owned(), line));
        self.materials.len() - 1
    }

    fn face(&mut self, number: usize, text: &str) -> Result<(), ModelError> {
        let place = || format!("line {number}");
        let counts = [self.positions.len(), self.uvs.len(), self.normals.len()];
        let corners: Result<Vec<_>, _> = text.split_whitespace().map(|text| corner(text, counts)).collect();
        let corners = corners.map_err(|reason| self.file.malformed(place(), reason))?;
        if corners.len() < 3 {
            let reason = format!("a face of three corners or more was expected, it has {}", corners.len());
            return Err(self.file.malformed(place(), reason));
        }
        self.file.count_triangles(place(), &mut self.triangles, corners.len() - 2)?;
        let kind = Kind {
            object: self.object.0,
            material: self.material,
            uvs: corners.iter().all(|corner| corner[1].is_some()),
            normals: corners.iter().all(|corner| corner[2].is_some()),
        };
        let draft = *self.draft_numbers.entry(kind).or_insert_with(|| {
            let mesh = Mesh::default();
            let (name, material) = (self.object.1.clone(), self.material);
            self.drafts.push(Draft { name, material, mesh, corners: HashMap::new() });
            self.drafts.len() - 1
        });
        let draft = &mut self.drafts[draft];
        let mut polygon = Vec::with_capacity(corners.len());
        for [position, uv, normal] in corners {
            let key = [position, uv.filter(|_| kind.uvs), normal.filter(|_| kind.normals)];
            let key = key.map(|index| index.unwrap_or(usize::MAX));
            polygon.push(*draft.corners.entry(key).or_insert_with(|| {
                let mesh = &mut draft.mesh;
                mesh.positions.push(self.positions[key[0]]);
                if kind.uvs {
                    mesh.uvs.push(self.uvs[key[1]]);
                }
                if kind.normals {
                    mesh.normals.push(self.normals[key[2]]);
                }
                // At most three a triangle, and those are counted.
                mesh.positions.len() as u32 - 1
            }));
        }
        draft.mesh.triangles.extend(polygon.windows(2).skip(1).map(|pair| [polygon[0], pair[0], pair[1]]));
        Ok(())
    }

    fn finish(mut self, up: Up) -> Result<Model, ModelError> {
        let world_from_file = up.world_from_file();
        let mut surfaces = HashMap::new();
        let mut model = Model::default();
        for draft in std::mem::take(&mut self.drafts) {
            let mesh = placed(draft.mesh, &world_from_file)
                .map_err(|reason| self.file.malformed(format!("the object {:?}", draft.name), reason))?;
            if mesh.triangles.is_empty() {
                continue;
            }
            let surface = match surfaces.get(&draft.material) {
                Some(surface) => Surface::clone(surface),
                None => {
                    let surface = self.surface(draft.material)?;
                    surfaces.insert(draft.material, surface.clone());
                    surface
                }
            };
            // A picture needs coordinates to lie on.
            let textured = matches!(
                &surface.material,
                Material::Diffuse { reflectance: Texture::Picture(_) }
                    | Material::Plastic { diffuse: Texture::Picture(_), .. }
            );
            if textured && mesh.uvs.is_empty() {
                let reason = "its material has a map, so texture coordinates (f v/vt) were expected";
                return Err(self.file.malformed(format!("the object {:?}", draft.name), reason));
            }
            model.parts.push(Part { name: draft.name, mesh, surface });
        }
        Ok(model)
    }

    fn surface(&mut self, material: Option<usize>) -> Result<Surface, ModelError> {
        let grey = || Material::Diffuse { reflectance: Texture::Constant(GREY) }.into();
        let Some((name, line)) = material.map(|number| &self.materials[number]) else { return Ok(grey()) };
        // Models are passed on without their libraries; a wrong name in one that is there is a mistake.
        if self.mtl.is_empty() {
            return Ok(grey());
        }
        self.mtl.surface(name)?.ok_or_else(|| {
            let reason = format!("no library defines the material {:?}", short(name));
            self.file.malformed(format!("line {line}"), reason)
        })
    }
}

/// The first word of a line, and the rest. A line of comment begins with a word that nobody knows.
fn words(line: &str) -> (&str, &str) {
    let line = line.trim();
    let (word, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
    (word, rest.trim())
}

/// Numbers may be followed by a comment. In a name, `#` is a letter like others: `Material #25`.
fn before_comment(rest: &str) -> &str {
    rest.split('#').next().unwrap_or_default().trim()
}

/// At least `least` of three finite numbers; the others are zero.
fn numbers(text: &str, least: usize) -> Result<[f32; 3], String> {
    let mut numbers = [0.0; 3];
    let mut found = 0;
    for (number, word) in numbers.iter_mut().zip(before_comment(text).split_whitespace()) {
        *number = finite(word)?;
        found += 1;
    }
    match found < least {
        true => Err(format!("{least} numbers were expected, found {found}")),
        false => Ok(numbers),
    }
}

fn finite(word: &str) -> Result<f32, String> {
    let number = before_comment(word).parse::<f32>().ok().filter(|number| number.is_finite());
    number.ok_or_else(|| format!("a finite number was expected, found {:?}", short(word)))
}
