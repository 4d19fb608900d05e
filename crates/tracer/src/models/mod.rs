//! Model files: glTF 2.0 ([`gltf`]) and Wavefront OBJ ([`obj`]).
//!
//! A file gives triangles in metres, z up, and what they are made of. Triangles without area are dropped; corners that no
//! triangle uses as well; a part without triangles is none. Files that a model names must lie in its folder or below.
//!
//! Files come from anywhere, so nothing in them is trusted: every index and range is held against the bytes that are
//! there before it is used, and nothing is allocated because a file claims it.

mod error;
mod file;
mod gltf;
mod obj;
mod pictures;
mod placement;

#[cfg(test)]
mod tests;

use std::path::Path;

pub use error::ModelError;
use file::{ModelFile, read_regular};
use glam::{DAffine3, DMat3, DVec3};

use crate::Model;

/// The largest model file, buffer or picture file.
const MAX_BYTES: u64 = 1 << 31;

/// The most triangles of a model, counted as often as its nodes repeat them.
const MAX_TRIANGLES: usize = 1 << 26;

/// The most primitives of a glTF scene, counted in the same way.
const MAX_PRIMITIVES: usize = 1 << 20;

/// Which axis of a file points up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Up {
    /// As in glTF: (x, y, z) becomes (x, −z, y).
    Y,
    /// As in this program.
    Z,
}

impl Up {
    fn world_from_file(self) -> DAffine3 {
        match self {
            Self::Y => DAffine3::from_mat3(DMat3::from_cols(DVec3::X, DVec3::Z, -DVec3::Y)),
            Self::Z => DAffine3::IDENTITY,
        }
    }
}

/// Reads a model: `.gltf`, `.glb` or `.obj`. Without `up`, y points up in glTF and z in OBJ, which does not say.
///
/// From glTF come the default scene's triangles (the first scene's, if none is the default) and metallic-roughness
/// materials with their pictures and normal maps, `KHR_texture_transform`, `KHR_materials_transmission` (the mean of its
/// texture), `KHR_materials_ior`, `KHR_mesh_quantization`, and of `KHR_materials_volume` that the body is solid.
/// Not read: animation, skins and morph targets (the rest pose is taken), vertex colours, tangents, emission, attenuation
/// in volumes, points, lines, cameras, lights, compressed meshes. Alpha is opaque in every mode. All pictures of a material
/// share one set of texture coordinates.
///
/// From OBJ come polygons, which are taken as convex, and the materials of its `.mtl` files: glass if `d` is below 1 or
/// `illum` is 4, 6, 7 or 9, and there is `Ni`; plastic if `Ks` is not black and there is `Ns`; diffuse otherwise. A face
/// without material is grey. Not read: smoothing groups (without normals faces are flat), bump maps, options of maps,
/// emission, vertex colours, curves.
///
/// # Errors
/// If a file cannot be read, contradicts itself, uses a part of its format that changes the shape and is not read here,
/// names a file outside its folder, or has no triangles.
pub fn read_model(path: &Path, up: Option<Up>) -> Result<Model, ModelError> {
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
    let read = match extension.as_deref() {
        Some("gltf" | "glb") => gltf::read,
        Some("obj") => obj::read,
        _ => return Err(ModelError::UnknownFormat { path: path.to_path_buf() }),
    };
    let bytes =
        read_regular(path, MAX_BYTES).map_err(|source| ModelError::Read { path: path.to_path_buf(), source })?;
    let file = ModelFile::new(path);
    let model = read(&file, &bytes, up)?;
    if model.parts.is_empty() {
        return Err(file.malformed("the model", "triangles with area were expected, it has none"));
    }
    Ok(model)
}
