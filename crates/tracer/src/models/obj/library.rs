//! Material libraries, `.mtl`: `newmtl`, `Kd`, `map_Kd`, `Ks`, `Ns`, `d`, `Tr`, `Tf`, `Ni` and `illum`.

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use glam::{Affine2, Vec3};

use super::{ModelFile, before_comment, finite, numbers, words};
use crate::models::ModelError;
use crate::models::file::{read_named, short};
use crate::models::pictures::Pictures;
use crate::{Material, Surface, Texture, TexturePicture, Wrap};

/// Of the clear coat of everything that has highlights.
const COAT_INDEX: f32 = 1.5;

/// The materials of all libraries that a model names.
#[derive(Default)]
pub(super) struct Library {
    read: HashSet<PathBuf>,
    materials: HashMap<String, Description>,
    pictures: Pictures,
}

/// What a library says of a material.
#[derive(Default)]
struct Description {
    named_in: PathBuf,
    diffuse: Option<Vec3>,
    /// The name of the picture, and the line that names it.
    diffuse_map: Option<(String, usize)>,
    specular: Option<Vec3>,
    exponent: Option<f32>,
    opacity: Option<f32>,
    filter: Option<Vec3>,
    index: Option<f32>,
    model: Option<u32>,
}

impl Library {
    /// Reads the library `name` beside `file`, unless it was read before; `place` names the line that names it.
    pub(super) fn add(&mut self, file: &ModelFile<'_>, place: &str, name: &str) -> Result<(), ModelError> {
        let path = file.beside(place, &slashed(name))?;
        if self.read.insert(path.clone()) {
            self.parse(&path, &read_named(&path)?)?;
        }
        Ok(())
    }

    /// Whether no library was read.
    pub(super) fn is_empty(&self) -> bool {
        self.read.is_empty()
    }

    fn parse(&mut self, path: &Path, bytes: &[u8]) -> Result<(), ModelError> {
        let file = ModelFile::new(path);
        let mut current: Option<(String, Description)> = None;
        for (number, line) in bytes.split(|byte| *byte == b'\n').enumerate() {
            let line = String::from_utf8_lossy(line);
            let (word, rest) = words(&line);
            if word == "newmtl" {
                let description = Description { named_in: path.to_path_buf(), ..Description::default() };
                let next = Some((rest.to_owned(), description));
                self.materials.extend(std::mem::replace(&mut current, next));
            } else if let Some((_, description)) = &mut current {
                let place = format!("line {}", number + 1);
                let set = description.set(word, rest, number + 1);
                set.map_err(|reason| file.malformed(place, reason))?;
            }
        }
        self.materials.extend(current);
        Ok(())
    }

    /// The surface that the material `name` means, if there is one.
    pub(super) fn surface(&mut self, name: &str) -> Result<Option<Surface>, ModelError> {
        let Some(description) = self.materials.get(name) else { return Ok(None) };
        description.material(&mut self.pictures).map(|material| Some(material.into()))
    }
}

/// Files written under Windows part folders with `\`.
fn slashed(name: &str) -> String {
    name.replace('\\', "/")
}

impl Description {
    fn set(&mut self, word: &str, rest: &str, line: usize) -> Result<(), String> {
        match word {
            "Kd" => self.diffuse = Some(colour(rest)?),
            "Ks" => self.specular = Some(colour(rest)?),
            "Tf" => self.filter = Some(colour(rest)?),
            "Ns" => self.exponent = Some(finite(rest)?),
            "Ni" => self.index = Some(finite(rest)?),
            "d" => self.opacity = Some(finite(rest.strip_prefix("-halo").unwrap_or(rest).trim())?),
            "Tr" => self.opacity = Some(1.0 - finite(rest)?),
            "illum" => {
                let model = before_comment(rest).parse();
                self.model =
                    Some(model.map_err(|_| format!("a number of 0 … 10 was expected, found {:?}", short(rest)))?);
            }
            "map_Kd" => self.diffuse_map = Some((rest.to_owned(), line)),
            _ => {}
        }
        Ok(())
    }

    /// Whether light passes: exporters write `Tf 1 1 1` and `Ni 1.5` for wood, so these do not tell.
    fn is_glass(&self) -> bool {
        let refracts = matches!(self.model, Some(4 | 6 | 7 | 9));
        refracts || self.opacity.is_some_and(|opacity| opacity < 1.0)
    }

    fn material(&self, pictures: &mut Pictures) -> Result<Material, ModelError> {
        // Some write 0 for what they do not know.
        if let Some(index) = self.index.filter(|index| *index >= 1.0 && self.is_glass()) {
            return Ok(Material::Glass { index, alpha: 0.0, tint: self.filter.unwrap_or(Vec3::ONE) });
        }
        let diffuse = self.diffuse_texture(pictures)?;
        let shiny = self.specular.is_some_and(|specular| specular.max_element() > 0.0);
        Ok(match self.exponent.filter(|_| shiny) {
            // The GGX width of a Blinn-Phong lobe: Walter et al., Microfacet Models for Refraction (2007), §5.2.
            Some(exponent) => {
                let alpha = (2.0 / (exponent.max(0.0) + 2.0)).sqrt();
                Material::Plastic { diffuse, index: COAT_INDEX, alpha }
            }
            None => Material::Diffuse { reflectance: diffuse },
        })
    }

    /// The picture times `Kd`, or `Kd` alone.
    fn diffuse_texture(&self, pictures: &mut Pictures) -> Result<Texture, ModelError> {
        let Some((name, line)) = &self.diffuse_map else {
            return Ok(Texture::Constant(self.diffuse.unwrap_or(super::GREY)));
        };
        let file = ModelFile::new(&self.named_in);
        let place = format!("line {line}");
        if name.starts_with('-') {
            return Err(file.unsupported(place, format!("options of a map: {:?}", short(name))));
        }
        let path = file.beside(&place, &slashed(name))?;
        let bytes = || read_named(&path).map(Cow::Owned);
        Ok(Texture::Picture(TexturePicture {
            picture: pictures.get(&file, &place, &path, true, bytes)?,
            factor: self.diffuse.unwrap_or(Vec3::ONE),
            wrap: [Wrap::Repeat; 2],
            picture_from_mesh: Affine2::IDENTITY,
        }))
    }
}

/// Of one number or three, brought into 0 … 1.
fn colour(text: &str) -> Result<Vec3, String> {
    let grey = before_comment(text).split_whitespace().count() == 1;
    let [red, green, blue] = numbers(text, if grey { 1 } else { 3 })?;
    let colour = if grey { Vec3::splat(red) } else { Vec3::new(red, green, blue) };
    Ok(colour.clamp(Vec3::ZERO, Vec3::ONE))
}
