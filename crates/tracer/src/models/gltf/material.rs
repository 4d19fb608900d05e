//! Materials (§3.9): metallic-roughness, and what extensions say of light that passes.

use std::collections::HashMap;

use glam::Vec3;
use gltf::json::extensions::material as extensions;
use gltf::json::material::Material as Description;
use gltf::json::{Index, Material as MaterialIndex};

use super::texture::{self, Reference};
use super::{Document, ModelError};
use crate::models::pictures::Pictures;
use crate::{Material, NormalMap, Surface, Texture};

/// A surface, and the set of texture coordinates that its pictures lie on.
pub(super) struct Described {
    pub(super) surface: Surface,
    pub(super) uv_set: Option<u32>,
}

/// The materials read so far; none twice.
#[derive(Default)]
pub(super) struct Materials {
    read: HashMap<Option<usize>, Described>,
    pictures: Pictures,
}

impl Materials {
    /// The material of a primitive; without one, that of §3.7.2.1: all default values.
    pub(super) fn get(
        &mut self,
        document: &Document<'_>,
        place: &str,
        index: Option<Index<MaterialIndex>>,
    ) -> Result<&Described, ModelError> {
        let number = index.map(|index| index.value());
        if !self.read.contains_key(&number) {
            let absent = Description::default();
            let (place, description) = match index {
                Some(index) => (format!("materials[{}]", index.value()), document.get(place, "materials", index)?),
                None => ("the default material".to_owned(), &absent),
            };
            let reader = Reader { document, place: &place, pictures: &mut self.pictures, uv_set: None };
            self.read.insert(number, reader.read(description)?);
        }
        Ok(&self.read[&number])
    }
}

struct Reader<'a> {
    document: &'a Document<'a>,
    place: &'a str,
    pictures: &'a mut Pictures,
    uv_set: Option<u32>,
}

impl Reader<'_> {
    fn read(mut self, description: &Description) -> Result<Described, ModelError> {
        let absent = extensions::Material::default();
        let extensions = description.extensions.as_ref().unwrap_or(&absent);
        let body = &description.pbr_metallic_roughness;
        let [red, green, blue, _alpha] = body.base_color_factor.0;
        let colour = Vec3::new(
            self.share("baseColorFactor", red)?,
            self.share("baseColorFactor", green)?,
            self.share("baseColorFactor", blue)?,
        );
        let base_colour = self.texture(body.base_color_texture.as_ref().map(Reference::new), colour, true)?;
        // Green is roughness, blue is metallic; red means nothing here.
        let factor = Vec3::new(
            1.0,
            self.share("roughnessFactor", body.roughness_factor.0)?,
            self.share("metallicFactor", body.metallic_factor.0)?,
        );
        let packed = body.metallic_roughness_texture.as_ref().map(Reference::new);
        let roughness_metallic = self.texture(packed, factor, false)?;
        let normal_map = self.normal_map(description)?;

        let material = Material::MetallicRoughness {
            base_colour,
            roughness_metallic,
            index: self.index_of_refraction(extensions)?,
            transmission: self.transmission(extensions)?,
            solid: extensions.volume.as_ref().is_some_and(|volume| volume.thickness_factor.0 > 0.0),
        };
        Ok(Described { surface: Surface { material, normal_map }, uv_set: self.uv_set })
    }

    fn normal_map(&mut self, description: &Description) -> Result<Option<NormalMap>, ModelError> {
        let Some(normals) = &description.normal_texture else { return Ok(None) };
        if !normals.scale.is_finite() {
            return Err(self.malformed("a finite normalTexture.scale was expected"));
        }
        let reference = Reference::of_normals(self.document, self.place, normals)?;
        let texture = self.texture(Some(reference), Vec3::ONE, false)?;
        Ok(Some(NormalMap { texture, scale: normals.scale }))
    }

    fn index_of_refraction(&self, extensions: &extensions::Material) -> Result<f32, ModelError> {
        let index = extensions.ior.as_ref().map_or(1.5, |ior| ior.ior.0);
        if !(index.is_finite() && index >= 1.0) {
            return Err(self.malformed(format!("an ior of at least 1 was expected, it is {index}")));
        }
        Ok(index)
    }

    /// The factor times the mean of the texture's red, which §`KHR_materials_transmission` multiplies point by point.
    fn transmission(&mut self, extensions: &extensions::Material) -> Result<f32, ModelError> {
        let Some(transmission) = &extensions.transmission else { return Ok(0.0) };
        let factor = self.share("transmissionFactor", transmission.transmission_factor.0)?;
        let Some(info) = &transmission.transmission_texture else { return Ok(factor) };
        let reference = Reference::new(info);
        let texture = texture::read(self.document, self.pictures, self.place, &reference, Vec3::ONE, false)?;
        Ok(factor * self.pictures.mean_red(&texture.picture))
    }

    /// The picture times `factor`, or `factor` alone.
    fn texture(&mut self, reference: Option<Reference>, factor: Vec3, srgb: bool) -> Result<Texture, ModelError> {
        let Some(reference) = reference else { return Ok(Texture::Constant(factor)) };
        let set = *self.uv_set.get_or_insert(reference.uv_set);
        if set != reference.uv_set {
            let what = format!("pictures on TEXCOORD_{set} and on TEXCOORD_{} in one material", reference.uv_set);
            return Err(self.document.file.unsupported(self.place, what));
        }
        texture::read(self.document, self.pictures, self.place, &reference, factor, srgb).map(Texture::Picture)
    }

    /// 0 … 1; a little beyond is an exporter's rounding, and much is no better than all.
    fn share(&self, name: &str, value: f32) -> Result<f32, ModelError> {
        if !value.is_finite() {
            return Err(self.malformed(format!("numbers of 0 … 1 were expected in {name}, one is {value}")));
        }
        Ok(value.clamp(0.0, 1.0))
    }

    fn malformed(&self, reason: impl std::fmt::Display) -> ModelError {
        self.document.file.malformed(self.place, reason)
    }
}
