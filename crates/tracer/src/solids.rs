//! Bodies of our own making: rectangle, box, and what a lathe turns.

use glam::{Vec2, Vec3};

use crate::Mesh;

/// A rectangle in z = 0 round the origin that faces upward; texture coordinates from its corner (−x, +y), v towards −y.
pub(crate) fn rectangle(size: Vec2) -> Mesh {
    let corner = |u: f32, v: f32| Vec3::new((u - 0.5) * size.x, (0.5 - v) * size.y, 0.0);
    let uvs = [(0.0, 1.0), (1.0, 1.0), (1.0, 0.0), (0.0, 0.0)];
    Mesh {
        positions: uvs.map(|(u, v)| corner(u, v)).to_vec(),
        normals: Vec::new(),
        uvs: uvs.map(|(u, v)| Vec2::new(u, v)).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    }
}

/// A box of this size that stands on z = 0, round the z axis.
pub(crate) fn cuboid(size: Vec3) -> Mesh {
    let mut mesh = Mesh::default();
    // Each face: the axis it looks along, and which way.
    for (axis, way) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0), (2, 1.0), (2, -1.0)] {
        let mut normal = Vec3::ZERO;
        normal[axis] = way;
        let mut right = Vec3::ZERO;
        right[(axis + 1) % 3] = way;
        let up = normal.cross(right);
        let start = mesh.positions.len() as u32;
        for (u, v) in [(0.0f32, 1.0f32), (1.0, 1.0), (1.0, 0.0), (0.0, 0.0)] {
            let corner = normal + (2.0 * u - 1.0) * right + (1.0 - 2.0 * v) * up;
            mesh.positions.push(0.5 * size * (corner + Vec3::Z));
            mesh.uvs.push(Vec2::new(u, v));
        }
        mesh.triangles.extend([[start, start + 1, start + 2], [start, start + 2, start + 3]]);
    }
    mesh
}

/// A profile turned about the z axis.
#[derive(Clone, Debug)]
pub(crate) struct Lathe<'a> {
    /// (radius, z), from the foot upward with the body on the side of the axis.
    pub(crate) profile: &'a [[f32; 2]],
    /// Whether the profile is a smooth curve through its points; a point given twice stays an edge.
    pub(crate) smooth: bool,
    /// Steps round the axis.
    pub(crate) segments: usize,
}

/// Steps of a smooth profile between two of its points.
const STEPS: usize = 5;

impl Lathe<'_> {
    pub(crate) fn turn(&self) -> Mesh {
        let curves = if self.smooth { self.curves() } else { self.straight() };
        let length: f32 = curves.iter().flat_map(|curve| curve.windows(2)).map(|w| w[0].0.distance(w[1].0)).sum();
        let mut mesh = Mesh::default();
        let mut walked = 0.0;
        for curve in curves {
            let ring = (self.segments + 1) as u32;
            let first = mesh.positions.len() as u32;
            for (index, (point, normal)) in curve.iter().enumerate() {
                if index > 0 {
                    walked += point.distance(curve[index - 1].0);
                }
                for step in 0..=self.segments {
                    let u = step as f32 / self.segments as f32;
                    let (sine, cosine) =
                        if step == self.segments { (0.0, 1.0) } else { (std::f32::consts::TAU * u).sin_cos() };
                    mesh.positions.push(Vec3::new(point.x * cosine, point.x * sine, point.y));
                    mesh.normals.push(Vec3::new(normal.x * cosine, normal.x * sine, normal.y));
                    mesh.uvs.push(Vec2::new(u, 1.0 - walked / length.max(f32::MIN_POSITIVE)));
                }
            }
            for row in 0..curve.len().saturating_sub(1) as u32 {
                for step in 0..self.segments as u32 {
                    let (a, b) = (first + row * ring + step, first + (row + 1) * ring + step);
                    // On the axis a side has no length.
                    if curve[row as usize].0.x > 0.0 {
                        mesh.triangles.push([a, a + 1, b + 1]);
                    }
                    if curve[row as usize + 1].0.x > 0.0 {
                        mesh.triangles.push([a, b + 1, b]);
                    }
                }
            }
        }
        mesh
    }

    fn points(&self) -> Vec<Vec2> {
        self.profile.iter().map(|[radius, z]| Vec2::new(*radius, *z)).collect()
    }

    /// Each piece with its own normals, so that every point is an edge.
    fn straight(&self) -> Vec<Vec<(Vec2, Vec2)>> {
        let points = self.points();
        let pieces = points.windows(2).filter(|piece| piece[0] != piece[1]);
        pieces.map(|piece| piece.iter().map(|point| (*point, outward(piece[1] - piece[0]))).collect()).collect()
    }

    /// Smooth curves between points given twice.
    fn curves(&self) -> Vec<Vec<(Vec2, Vec2)>> {
        let points = self.points();
        let mut curves = Vec::new();
        let mut run: Vec<Vec2> = Vec::new();
        for (index, point) in points.iter().enumerate() {
            run.push(*point);
            let edge = points.get(index + 1) == Some(point);
            if (edge || index + 1 == points.len()) && run.len() > 1 {
                curves.push(spline(&run));
            }
            if edge {
                run.clear();
            }
        }
        curves
    }
}

/// Outward normal of a profile that goes along `along`, the body to its left.
fn outward(along: Vec2) -> Vec2 {
    Vec2::new(along.y, -along.x).normalize_or(Vec2::X)
}

/// A smooth curve through the points (cubic Hermite pieces), with its normals.
fn spline(points: &[Vec2]) -> Vec<(Vec2, Vec2)> {
    let last = points.len() - 1;
    // The tangent at a point follows its neighbours; no longer than the shorter of the two pieces, or it would overshoot.
    let tangent = |index: usize| {
        // What ends on the axis goes on mirrored beyond it.
        let beyond =
            |neighbour: Vec2| if points[index].x == 0.0 { neighbour * Vec2::new(-1.0, 1.0) } else { points[index] };
        let before = if index > 0 { points[index - 1] } else { beyond(points[1]) };
        let after = if index < last { points[index + 1] } else { beyond(points[last - 1]) };
        let reach = [index.checked_sub(1), (index < last).then_some(index)]
            .into_iter()
            .flatten()
            .map(|piece| points[piece].distance(points[piece + 1]))
            .fold(f32::INFINITY, f32::min);
        (after - before).normalize_or(Vec2::Y) * reach
    };
    let mut curve = Vec::with_capacity(last * STEPS + 1);
    for piece in 0..last {
        let (p, q, m, n) = (points[piece], points[piece + 1], tangent(piece), tangent(piece + 1));
        let end = if piece + 1 == last { STEPS + 1 } else { STEPS };
        for step in 0..end {
            let t = step as f32 / STEPS as f32;
            let (t2, t3) = (t * t, t * t * t);
            let mut point =
                (2.0 * t3 - 3.0 * t2 + 1.0) * p + (t3 - 2.0 * t2 + t) * m + (3.0 * t2 - 2.0 * t3) * q + (t3 - t2) * n;
            let along = (6.0 * t2 - 6.0 * t) * (p - q) + (3.0 * t2 - 4.0 * t + 1.0) * m + (3.0 * t2 - 2.0 * t) * n;
            // The curve may not cross the axis.
            point.x = point.x.max(0.0);
            curve.push((point, outward(along)));
        }
    }
    curve
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Volume by the divergence theorem: positive only if every triangle is wound outward.
    fn volume(mesh: &Mesh) -> f32 {
        let corner = |index: u32| mesh.positions[index as usize];
        mesh.triangles.iter().map(|[a, b, c]| corner(*a).dot(corner(*b).cross(corner(*c))) / 6.0).sum()
    }

    #[test]
    fn a_box_has_its_volume_and_stands_on_the_ground() {
        let mesh = cuboid(Vec3::new(2.0, 3.0, 0.5));
        assert!((volume(&mesh) - 3.0).abs() < 1e-5, "{}", volume(&mesh));
        assert!(mesh.positions.iter().all(|p| p.z >= 0.0 && p.z <= 0.5));
    }

    #[test]
    fn a_turned_rectangle_is_a_cylinder_and_a_turned_arc_a_ball() {
        let segments = 256;
        let cylinder =
            Lathe { profile: &[[0.0, 0.0], [1.0, 0.0], [1.0, 2.0], [0.0, 2.0]], smooth: false, segments }.turn();
        assert!((volume(&cylinder) / std::f32::consts::TAU - 1.0).abs() < 1e-3, "{}", volume(&cylinder));
        let arc: Vec<[f32; 2]> = (0..=24)
            .map(|i| {
                let (sine, cosine) = (std::f32::consts::PI * i as f32 / 24.0).sin_cos();
                [sine.max(0.0), 1.0 - cosine]
            })
            .collect();
        let ball = Lathe { profile: &arc, smooth: true, segments }.turn();
        let expected = 4.0 / 3.0 * std::f32::consts::PI;
        assert!((volume(&ball) / expected - 1.0).abs() < 3e-3, "{}", volume(&ball));
        for (position, normal) in ball.positions.iter().zip(&ball.normals) {
            let radial = *position - Vec3::Z;
            assert!(normal.dot(radial.normalize()) > 0.999, "{normal} at {position}");
        }
    }

    #[test]
    fn a_point_given_twice_is_an_edge() {
        let profile = [[0.5, 0.0], [0.5, 1.0], [0.5, 1.0], [0.0, 1.0]];
        let mesh = Lathe { profile: &profile, smooth: true, segments: 8 }.turn();
        let top: Vec<Vec3> =
            mesh.positions.iter().zip(&mesh.normals).filter(|(p, _)| p.z == 1.0).map(|(_, n)| *n).collect();
        assert!(top.iter().any(|n| n.z > 0.99) && top.iter().any(|n| n.z.abs() < 0.01), "{top:?}");
    }
}
