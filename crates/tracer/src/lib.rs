//! A virtual world: scenes, meshes, materials, and a path tracer.
//!
//! It renders a picture of a scene under any lamps, which is the truth that relit pictures are held against
//! ([`Rendering`]), or in one pass the whole transfer of every cell (eq. 5), which is what a virtual projector on a virtual
//! gantry would photograph ([`Paths`]).
//!
//! Surfaces are two-sided; lamps neither hide nor reflect anything and are no part of the scene. Light is RGB, without
//! polarisation, volumes or subsurface scattering. Smooth glass cannot be connected to a point: what a lamp without extent
//! throws through it (its caustic) is missing, and its shadow is black; rough glass is right.

mod bsdf;
mod camera;
mod description;
mod lantern;
mod lighting;
mod material;
mod mesh;
mod models;
mod packet;
mod path;
mod render;
mod scene;
mod shape;
mod solids;
mod texture;
mod transfer;

pub use camera::Camera;
pub use description::SceneError;
pub use lantern::Lantern;
pub use material::{Material, NormalMap, Surface};
pub use mesh::{Mesh, Model, Part};
pub use models::{ModelError, Up, read_model};
pub use path::PathOptions;
pub use render::{RenderError, Rendered, Rendering};
pub use scene::Scene;
pub use texture::{Texture, TexturePicture, Wrap};
pub use transfer::{Paths, Share};
