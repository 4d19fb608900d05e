//! Textures (§3.8): a picture, how it goes on beyond its borders, and where it lies on the coordinates of a mesh.

use std::borrow::Cow;
use std::path::PathBuf;
use std::sync::Arc;

use glam::{Affine2, Vec2, Vec3};
use gltf::json::extensions::texture::TextureTransform;
use gltf::json::material::NormalTexture;
use gltf::json::texture::{Info, WrappingMode};
use gltf::json::validation::Checked;
use gltf::json::{Image, Index, Texture};
use relumine_radiometry as radiometry;

use super::{Document, ModelError, buffers, uri};
use crate::models::file::read_named;
use crate::models::pictures::Pictures;
use crate::models::placement::LARGEST_UV;
use crate::{TexturePicture, Wrap};

/// How a material refers to a texture.
pub(super) struct Reference {
    texture: Index<Texture>,
    /// Which set of texture coordinates it lies on.
    pub(super) uv_set: u32,
    transform: TextureTransform,
}

impl Reference {
    pub(super) fn new(info: &Info) -> Self {
        let transform = info.extensions.as_ref().and_then(|extensions| extensions.texture_transform.clone());
        Self::with_transform(info.index, info.tex_coord, transform.unwrap_or_default())
    }

    /// The types know `KHR_texture_transform` for other textures only, so that here it is still JSON.
    pub(super) fn of_normals(
        document: &Document<'_>,
        place: &str,
        texture: &NormalTexture,
    ) -> Result<Self, ModelError> {
        let extension = texture.extensions.as_ref().and_then(|known| known.others.get("KHR_texture_transform"));
        let transform = match extension {
            Some(value) => gltf::json::deserialize::from_value(value.clone())
                .map_err(|error| document.file.malformed(place, format!("KHR_texture_transform: {error}")))?,
            None => TextureTransform::default(),
        };
        Ok(Self::with_transform(texture.index, texture.tex_coord, transform))
    }

    fn with_transform(texture: Index<Texture>, set: u32, transform: TextureTransform) -> Self {
        Self { texture, uv_set: transform.tex_coord.unwrap_or(set), transform }
    }

    /// `KHR_texture_transform`: translation · rotation · scale. Its rotation is counter-clockwise as seen, and v points
    /// downward.
    fn picture_from_mesh(&self) -> Affine2 {
        let TextureTransform { offset, rotation, scale, .. } = &self.transform;
        Affine2::from_scale_angle_translation(Vec2::from(scale.0), -rotation.0, Vec2::from(offset.0))
    }
}

/// The texture with its samples multiplied by `factor`, decoded from sRGB if it means colour.
pub(super) fn read(
    document: &Document<'_>,
    pictures: &mut Pictures,
    place: &str,
    reference: &Reference,
    factor: Vec3,
    srgb: bool,
) -> Result<TexturePicture, ModelError> {
    let picture_from_mesh = reference.picture_from_mesh();
    if !picture_from_mesh.to_cols_array().iter().all(|number| number.abs() <= LARGEST_UV) {
        let reason = format!("numbers up to {LARGEST_UV:e} were expected in KHR_texture_transform");
        return Err(document.file.malformed(place, reason));
    }
    let texture = document.get(place, "textures", reference.texture)?;
    let place = format!("textures[{}]", reference.texture.value());
    let wrap = match texture.sampler {
        Some(sampler) => {
            let sampler = document.get(&place, "samplers", sampler)?;
            [wrap(document, &place, sampler.wrap_s)?, wrap(document, &place, sampler.wrap_t)?]
        }
        None => [Wrap::Repeat; 2],
    };
    // This is how the types say that a texture has no source of its own.
    if texture.source.value() == u32::MAX as usize {
        return Err(document.file.unsupported(place, "a texture without a source, whose picture is an extension's"));
    }
    let picture = picture(document, pictures, &place, texture.source, srgb)?;
    Ok(TexturePicture { picture, factor, wrap, picture_from_mesh })
}

fn wrap(document: &Document<'_>, place: &str, mode: Checked<WrappingMode>) -> Result<Wrap, ModelError> {
    match mode {
        Checked::Valid(WrappingMode::Repeat) => Ok(Wrap::Repeat),
        Checked::Valid(WrappingMode::MirroredRepeat) => Ok(Wrap::Mirror),
        Checked::Valid(WrappingMode::ClampToEdge) => Ok(Wrap::Clamp),
        Checked::Invalid => {
            Err(document.file.malformed(place, "a wrapping mode of 10497, 33648 or 33071 was expected in its sampler"))
        }
    }
}

fn picture(
    document: &Document<'_>,
    pictures: &mut Pictures,
    place: &str,
    index: Index<Image>,
    srgb: bool,
) -> Result<Arc<radiometry::Image<radiometry::Linear>>, ModelError> {
    let file = document.file;
    let image = document.get(place, "images", index)?;
    let place = format!("images[{}]", index.value());
    let outside = image.uri.as_ref().filter(|text| !uri::is_data(text));
    let name = match outside {
        Some(text) => {
            let path = uri::path(text).ok_or_else(|| file.malformed(&place, buffers::not_a_path(text)))?;
            file.beside(&place, &path)?
        }
        None => PathBuf::from(&place),
    };
    pictures.get(file, &place, &name, srgb, || {
        let bytes = match (&image.uri, image.buffer_view) {
            (Some(text), _) => Cow::Owned(match uri::data(text) {
                Some(bytes) => bytes.map_err(|reason| file.malformed(&place, reason))?,
                None => read_named(&name)?,
            }),
            (None, Some(view)) => Cow::Borrowed(document.view(&place, view)?.1),
            (None, None) => return Err(file.malformed(&place, "a uri or a bufferView was expected")),
        };
        match is_png_or_jpeg(&bytes) {
            true => Ok(bytes),
            false => Err(file.unsupported(&place, "a picture that is neither PNG nor JPEG")),
        }
    })
}

/// The formats of §3.8.3.
fn is_png_or_jpeg(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x89PNG\r\n\x1a\n") || bytes.starts_with(b"\xff\xd8\xff")
}
