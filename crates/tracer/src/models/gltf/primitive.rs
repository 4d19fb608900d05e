//! Primitives (§3.7.2.1): which corners make triangles, and what is known of them.

use std::collections::HashMap;

use glam::{Vec2, Vec3};
use gltf::json::accessor::Type;
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;

use super::accessor::Elements;
use super::{Document, ModelError};
use crate::Mesh;

/// The triangles of a primitive in the coordinates of its node; none if it is points or lines.
///
/// `uv_set` is the set of texture coordinates that its material needs; without, the first is taken if there is one.
pub(super) fn read(
    document: &Document<'_>,
    place: &str,
    primitive: &Primitive,
    uv_set: Option<u32>,
    triangles: &mut usize,
) -> Result<Option<Mesh>, ModelError> {
    let file = document.file;
    let Checked::Valid(mode) = primitive.mode else {
        return Err(file.malformed(place, "a mode of 0 … 6 was expected"));
    };
    if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
        return Ok(None);
    }
    let vectors = |semantic: Semantic, shape: Type| {
        let index = primitive.attributes.get(&Checked::Valid(semantic));
        index.map(|index| document.vectors(place, *index, shape)).transpose()
    };
    let Some(positions) = vectors(Semantic::Positions, Type::Vec3)? else {
        return Err(file.malformed(place, "the attribute POSITION was expected"));
    };
    let normals = vectors(Semantic::Normals, Type::Vec3)?;
    let uvs = vectors(Semantic::TexCoords(uv_set.unwrap_or(0)), Type::Vec2)?;
    if let (Some(set), None) = (uv_set, &uvs) {
        return Err(file.malformed(place, format!("its material has a texture, so TEXCOORD_{set} was expected")));
    }
    for (name, other) in [("NORMAL", &normals), ("TEXCOORD", &uvs)] {
        if let Some(count) = other.as_ref().map(Elements::len).filter(|count| *count != positions.len()) {
            let reason = format!("POSITION has {} elements, {name} {count}", positions.len());
            return Err(file.malformed(place, reason));
        }
    }
    let indices = primitive.indices.map(|index| document.indices(place, index)).transpose()?;
    let count = indices.as_ref().map_or(positions.len(), Elements::len);
    let whole = if mode == Mode::Triangles { count / 3 } else { count.saturating_sub(2) };
    if mode == Mode::Triangles && !count.is_multiple_of(3) {
        return Err(file.malformed(place, format!("three corners a triangle were expected, it has {count}")));
    }
    let sparse: usize = [Some(&positions), normals.as_ref(), uvs.as_ref(), indices.as_ref()]
        .into_iter()
        .flatten()
        .map(Elements::cost)
        .sum();
    file.count_triangles(place, triangles, whole + sparse)?;

    let mut corners = Corners { positions, normals, uvs, new_from_old: HashMap::new(), mesh: Mesh::default() };
    for number in 0..whole {
        let mut triangle = [0; 3];
        for (corner, at) in triangle.iter_mut().zip(corners_of(mode, number)) {
            let old = match &indices {
                Some(indices) => indices.index(at),
                None => Some(at as u32),
            };
            let new = old.and_then(|old| corners.add(old));
            *corner = new.ok_or_else(|| {
                let (old, count) = (old.unwrap_or_default(), corners.positions.len());
                file.malformed(place, format!("indices below {count} were expected, the one at {at} is {old}"))
            })?;
        }
        corners.mesh.triangles.push(triangle);
    }
    Ok(Some(corners.mesh))
}

/// Which corners make the triangle `number` (§3.7.2.1).
fn corners_of(mode: Mode, number: usize) -> [usize; 3] {
    match mode {
        Mode::TriangleStrip => [number, number + 1 + number % 2, number + 2 - number % 2],
        Mode::TriangleFan => [number + 1, number + 2, 0],
        _ => [3 * number, 3 * number + 1, 3 * number + 2],
    }
}

/// Corners taken over as triangles use them: many primitives may share one long accessor.
struct Corners<'a> {
    positions: Elements<'a>,
    normals: Option<Elements<'a>>,
    uvs: Option<Elements<'a>>,
    new_from_old: HashMap<u32, u32>,
    mesh: Mesh,
}

impl Corners<'_> {
    fn add(&mut self, old: u32) -> Option<u32> {
        if let Some(new) = self.new_from_old.get(&old) {
            return Some(*new);
        }
        let new = u32::try_from(self.mesh.positions.len()).ok()?;
        let at = old as usize;
        self.mesh.positions.push(Vec3::from_array(self.positions.numbers(at)?));
        if let Some(normals) = &self.normals {
            self.mesh.normals.push(Vec3::from_array(normals.numbers(at)?));
        }
        if let Some(uvs) = &self.uvs {
            self.mesh.uvs.push(Vec2::from_array(uvs.numbers(at)?));
        }
        self.new_from_old.insert(old, new);
        Some(new)
    }
}
