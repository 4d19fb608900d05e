//! From the coordinates of a file to the world's, and to a mesh that nobody need doubt.

use glam::{DAffine3, DMat3, Vec3};

use crate::Mesh;

/// No corner is farther from the origin, metres: the square of a triangle's area is then still an `f32`.
const FARTHEST_M: f64 = 1e9;

/// Texture coordinates beyond are no place in a picture that single precision could tell from its neighbours.
pub(super) const LARGEST_UV: f32 = 1e6;

/// Places a mesh. Its indices must be within its corners, its normals and coordinates as many as its corners or none.
///
/// What comes back has corners that are finite and used, unit normals, and triangles whose normal can be computed; a
/// transform that mirrors turns them round, so that they stay counter-clockwise seen from outside.
///
/// # Errors
/// If a corner that a triangle uses has no finite place or coordinates, in words.
pub(super) fn placed(mesh: Mesh, world_from_mesh: &DAffine3) -> Result<Mesh, String> {
    let mut mesh = transformed(mesh, world_from_mesh);
    mesh.triangles.retain(|triangle| {
        let square = face_normal(&mesh.positions, *triangle).length_squared();
        // What is not finite stays, to be named.
        square.is_normal() || !square.is_finite()
    });
    let mesh = without_unused_corners(mesh);
    for position in &mesh.positions {
        if !position.is_finite() || f64::from(position.abs().max_element()) > FARTHEST_M {
            return Err(format!("corners within {FARTHEST_M:e} m of the origin were expected, one is at {position}"));
        }
    }
    if let Some(uv) = mesh.uvs.iter().find(|uv| !uv.is_finite() || uv.abs().max_element() > LARGEST_UV) {
        return Err(format!("texture coordinates up to {LARGEST_UV:e} were expected, a corner has {uv}"));
    }
    Ok(with_unit_normals(mesh))
}

fn transformed(mut mesh: Mesh, world_from_mesh: &DAffine3) -> Mesh {
    for position in &mut mesh.positions {
        *position = world_from_mesh.transform_point3(position.as_dvec3()).as_vec3();
    }
    // Normals go by the inverse transpose, which is the cofactors over the determinant. The cofactors exist for flattening
    // transforms too, and of the determinant only the sign matters.
    let DMat3 { x_axis: x, y_axis: y, z_axis: z } = world_from_mesh.matrix3;
    let cofactors = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y));
    let mirrors = x.dot(y.cross(z)) < 0.0;
    for normal in &mut mesh.normals {
        let turned = (cofactors * normal.as_dvec3()).normalize_or_zero().as_vec3();
        *normal = if mirrors { -turned } else { turned };
    }
    if mirrors {
        for triangle in &mut mesh.triangles {
            triangle.swap(1, 2);
        }
    }
    mesh
}

/// Twice the area long.
fn face_normal(positions: &[Vec3], triangle: [u32; 3]) -> Vec3 {
    let [a, b, c] = triangle.map(|corner| positions[corner as usize]);
    (b - a).cross(c - a)
}

fn without_unused_corners(mut mesh: Mesh) -> Mesh {
    let mut used = vec![false; mesh.positions.len()];
    for corner in mesh.triangles.as_flattened() {
        used[*corner as usize] = true;
    }
    let mut next = 0;
    let new_from_old: Vec<u32> = used
        .iter()
        .map(|used| {
            let index = next;
            next += u32::from(*used);
            index
        })
        .collect();
    for corner in mesh.triangles.as_flattened_mut() {
        *corner = new_from_old[*corner as usize];
    }
    keep(&mut mesh.positions, &used);
    keep(&mut mesh.normals, &used);
    keep(&mut mesh.uvs, &used);
    mesh
}

fn keep<T>(values: &mut Vec<T>, used: &[bool]) {
    let mut used = used.iter();
    values.retain(|_| used.next().is_some_and(|used| *used));
}

/// A normal that is none becomes that of the faces round its corner, weighted by area.
fn with_unit_normals(mut mesh: Mesh) -> Mesh {
    if mesh.normals.iter().all(|normal| normal.is_normalized()) {
        return mesh;
    }
    let missing: Vec<bool> = mesh.normals.iter().map(|normal| !normal.is_normalized()).collect();
    let mut sums = vec![Vec3::ZERO; missing.len()];
    let mut last = sums.clone();
    for triangle in &mesh.triangles {
        let normal = face_normal(&mesh.positions, *triangle);
        for corner in triangle.map(|corner| corner as usize) {
            sums[corner] += normal;
            last[corner] = normal.normalize_or(Vec3::Z);
        }
    }
    for (corner, normal) in mesh.normals.iter_mut().enumerate().filter(|(corner, _)| missing[*corner]) {
        let sum = sums[corner].normalize_or(last[corner]);
        // Sums too large for their square are as good as none.
        *normal = if sum.is_normalized() { sum } else { last[corner] };
    }
    mesh
}
