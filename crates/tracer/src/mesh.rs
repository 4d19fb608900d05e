//! Triangles, and the models they make up.

use glam::{Vec2, Vec3};

use crate::Surface;

/// Triangles with shared corners. Metres, right-handed, z up.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// The corners.
    pub positions: Vec<Vec3>,
    /// Unit shading normals, one a corner; empty for flat faces.
    pub normals: Vec<Vec3>,
    /// Texture coordinates, one a corner, v downward as in glTF; empty if there are none.
    pub uvs: Vec<Vec2>,
    /// Indices of three corners each, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

/// A mesh and what it is made of.
#[derive(Clone, Debug)]
pub struct Part {
    /// The name that the file gives it, for messages.
    pub name: String,
    /// The triangles.
    pub mesh: Mesh,
    /// What they are made of.
    pub surface: Surface,
}

/// What a model file holds.
#[derive(Clone, Debug, Default)]
pub struct Model {
    /// Its parts, in the order of the file.
    pub parts: Vec<Part>,
}
