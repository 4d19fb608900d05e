//! A scene made ready for rays: shapes in a bounding volume hierarchy, materials, and the camera.

use glam::{Vec2, Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh;
use obvhs::ray::{Ray, RayHit};

use crate::bsdf::{Bsdf, Coats};
use crate::packet::Shadows;
use crate::shape::{PreparedRay, Shape, ShapeHit};
use crate::{Camera, Material, Mesh, NormalMap, Part, Surface};

/// A virtual scene. World frame, metres.
pub struct Scene {
    camera: Camera,
    picture: (usize, usize),
    surfaces: Vec<Ready>,
    parts: Vec<Body>,
    bvh: Option<CwBvh>,
    /// In the order of the hierarchy's leaves.
    shapes: Vec<(Shape, Origin)>,
    /// The same shapes again, for rays in packets.
    packets: Option<(Bvh2, Vec<Shape>)>,
    largest: f32,
}

/// What the parts of a scene are.
pub(crate) enum Solid {
    Mesh(Part),
    Ball { centre: Vec3, radius: f32, surface: Surface },
}

/// A material with what does not vary over it computed once.
struct Ready {
    material: Material,
    bsdf: Bsdf,
    normal_map: Option<NormalMap>,
}

/// The shading data of a part: its surface, and its mesh unless it is a ball.
struct Body {
    surface: u32,
    mesh: Option<Mesh>,
}

/// Where a shape comes from.
#[derive(Clone, Copy, Debug)]
struct Origin {
    part: u32,
    triangle: u32,
}

/// A place where a ray meets a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    pub(crate) position: Vec3,
    pub(crate) distance: f32,
    /// Unit normal of the triangle or ball, outward.
    pub(crate) geometric: Vec3,
    /// Unit normal for shading, on the same side.
    pub(crate) shading: Vec3,
    pub(crate) uv: Vec2,
    pub(crate) surface: u32,
}

/// Rays that start on a surface start this far off it, as a share of the largest coordinate of the scene.
const OFF_SURFACE: f32 = 2e-5;

impl Scene {
    /// Makes solids ready to be rendered as `picture` = (width, height) pixels by `camera`.
    pub(crate) fn new(camera: Camera, picture: (usize, usize), solids: Vec<Solid>) -> Self {
        let (mut surfaces, mut parts, mut shapes) = (Vec::new(), Vec::new(), Vec::new());
        let mut coats = Coats::new();
        for solid in solids {
            let part = parts.len() as u32;
            let (surface, mesh) = match solid {
                Solid::Ball { centre, radius, surface } => {
                    shapes.push((Shape::Ball { centre, radius }, Origin { part, triangle: 0 }));
                    (surface, None)
                }
                Solid::Mesh(Part { mesh, surface, .. }) => {
                    for (triangle, corners) in mesh.triangles.iter().enumerate() {
                        let corners = corners.map(|corner| mesh.positions[corner as usize]);
                        shapes.push((Shape::Triangle(corners), Origin { part, triangle: triangle as u32 }));
                    }
                    (surface, Some(mesh))
                }
            };
            parts.push(Body { surface: surfaces.len() as u32, mesh });
            let bsdf = Bsdf::new(&surface.material, &mut coats);
            surfaces.push(Ready { material: surface.material, bsdf, normal_map: surface.normal_map });
        }
        let (mut bvh, mut packets) = (None, None);
        let mut largest = 0.0f32;
        if !shapes.is_empty() {
            let bare: Vec<Shape> = shapes.iter().map(|(shape, _)| *shape).collect();
            // Spatial splits would list a triangle twice, and leaves could not be put in order.
            let parameters = BvhBuildParams { pre_split: false, ..BvhBuildParams::medium_build() };
            let built = build_cwbvh(&bare, parameters, &mut std::time::Duration::default());
            let pairs = build_bvh2(&bare, parameters, &mut std::time::Duration::default());
            let in_order = pairs.primitive_indices.iter().map(|index| bare[*index as usize]).collect();
            packets = Some((pairs, in_order));
            shapes = built.primitive_indices.iter().map(|index| shapes[*index as usize]).collect();
            largest = built.total_aabb.min.abs().max(built.total_aabb.max.abs()).max_element();
            bvh = Some(built);
        }
        Self { camera, picture, surfaces, parts, bvh, shapes, packets, largest }
    }

    /// The camera.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Pixels of its picture, (width, height), unless asked for otherwise.
    pub fn picture_size(&self) -> (usize, usize) {
        self.picture
    }

    /// The same scene in a picture of another size.
    #[must_use]
    pub fn with_picture_size(mut self, width: usize, height: usize) -> Self {
        self.picture = (width, height);
        self
    }

    /// Number of triangles and balls.
    pub fn shapes(&self) -> usize {
        self.shapes.len()
    }

    /// Radius of the smallest ball at the origin that holds the scene's bounding box, metres.
    pub fn radius_m(&self) -> f64 {
        self.bvh.as_ref().map_or(0.0, |bvh| f64::from(bvh.total_aabb.min.abs().max(bvh.total_aabb.max.abs()).length()))
    }

    pub(crate) fn bsdf(&self, surface: u32) -> &Bsdf {
        &self.surfaces[surface as usize].bsdf
    }

    pub(crate) fn material(&self, surface: u32) -> &Material {
        &self.surfaces[surface as usize].material
    }

    /// The way off a surface with this geometric normal to where rays on the normal's side may start.
    pub(crate) fn off_surface(&self, normal: Vec3) -> Vec3 {
        normal * (OFF_SURFACE * self.largest)
    }

    /// What a ray meets first; `direction` has length one.
    pub(crate) fn meet(&self, origin: Vec3, direction: Vec3) -> Option<Place> {
        let bvh = self.bvh.as_ref()?;
        let prepared = PreparedRay::new(origin, direction);
        let mut found = None;
        let mut nearest = RayHit::none();
        let ray = Ray::new_inf(Vec3A::from(origin), Vec3A::from(direction));
        bvh.ray_traverse(ray, &mut nearest, |ray, index| match self.shapes[index].0.meet(&prepared, ray.tmax) {
            Some(hit) => {
                found = Some((index, hit));
                hit.distance
            }
            None => f32::INFINITY,
        });
        let (index, hit) = found?;
        Some(self.place(index, hit, origin, direction))
    }

    /// Whether nothing stands on the way from `origin` along the unit vector `direction` for `distance`.
    #[inline]
    pub(crate) fn is_free(&self, origin: Vec3, direction: Vec3, distance: f32) -> bool {
        let Some(bvh) = &self.bvh else { return true };
        let prepared = PreparedRay::new(origin, direction);
        let ray = Ray::new(Vec3A::from(origin), Vec3A::from(direction), 0.0, distance);
        bvh.ray_traverse_miss(ray, |_, index| {
            self.shapes[index].0.meet(&prepared, distance).map_or(f32::INFINITY, |hit| hit.distance)
        })
    }

    /// What packets of shadow rays ask; `None` in an empty scene.
    pub(crate) fn shadows(&self) -> Option<Shadows<'_>> {
        self.packets.as_ref().map(|(bvh, shapes)| Shadows { bvh, shapes })
    }

    fn place(&self, index: usize, hit: ShapeHit, origin: Vec3, direction: Vec3) -> Place {
        let (shape, Origin { part, triangle }) = self.shapes[index];
        let body = &self.parts[part as usize];
        let at = |position: Vec3, geometric: Vec3, shading: Vec3, uv: Vec2| Place {
            position,
            distance: hit.distance,
            geometric,
            shading,
            uv,
            surface: body.surface,
        };
        match (shape, &body.mesh) {
            (Shape::Ball { centre, radius }, _) => {
                let normal = (origin + hit.distance * direction - centre).normalize_or(-direction);
                // Longitude and latitude, as a globe is printed.
                let u = normal.y.atan2(normal.x) / std::f32::consts::TAU + 0.5;
                let v = normal.z.clamp(-1.0, 1.0).acos() / std::f32::consts::PI;
                at(centre + radius * normal, normal, normal, Vec2::new(u, v))
            }
            (Shape::Triangle(corners), mesh) => {
                let [b, c] = hit.weights;
                let weigh = |values: [Vec3; 3]| (1.0 - b - c) * values[0] + b * values[1] + c * values[2];
                let position = weigh(corners);
                let geometric = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or(Vec3::Z);
                let Some(mesh) = mesh else { return at(position, geometric, geometric, Vec2::ZERO) };
                let indices = mesh.triangles[triangle as usize].map(|corner| corner as usize);
                let mut shading = geometric;
                let mut outward = geometric;
                if !mesh.normals.is_empty() {
                    shading = weigh(indices.map(|corner| mesh.normals[corner])).normalize_or(geometric);
                    // The corners' normals say which side is outside, whatever the winding.
                    outward = if shading.dot(geometric) < 0.0 { -geometric } else { geometric };
                }
                let mut uv = Vec2::new(b, c);
                if !mesh.uvs.is_empty() {
                    let uvs = indices.map(|corner| mesh.uvs[corner]);
                    uv = (1.0 - b - c) * uvs[0] + b * uvs[1] + c * uvs[2];
                    if let Some(map) = &self.surfaces[body.surface as usize].normal_map {
                        shading = bumped(map, uv, corners, uvs, shading);
                    }
                }
                at(position, outward, shading, uv)
            }
        }
    }
}

/// The normal that a map gives in place of `normal`: its x follows u over the surface, its y goes against v, as in glTF, where
/// v points downward in the picture.
fn bumped(map: &NormalMap, uv: Vec2, corners: [Vec3; 3], uvs: [Vec2; 3], normal: Vec3) -> Vec3 {
    let (e1, e2) = (corners[1] - corners[0], corners[2] - corners[0]);
    let (d1, d2) = (uvs[1] - uvs[0], uvs[2] - uvs[0]);
    let turning = d1.perp_dot(d2);
    // Where u and v grow on the surface: their own derivatives, so that neither winding nor mirroring matters.
    let along_u = (e1 * d2.y - e2 * d1.y) * turning.signum();
    let along_v = (e2 * d1.x - e1 * d2.x) * turning.signum();
    let Some(tangent) = along_u.reject_from_normalized(normal).try_normalize() else { return normal };
    let across = normal.cross(tangent);
    let bitangent = if along_v.dot(across) > 0.0 { -across } else { across };
    let stored = map.texture.at(uv) * 2.0 - 1.0;
    let local = Vec3::new(stored.x * map.scale, stored.y * map.scale, stored.z.max(1e-3));
    (local.x * tangent + local.y * bitangent + local.z * normal).normalize_or(normal)
}

/// Two unit vectors that make a right-handed frame with the unit vector `z` (Duff et al. 2017).
pub(crate) fn across(z: Vec3) -> (Vec3, Vec3) {
    let sign = 1.0f32.copysign(z.z);
    let a = -1.0 / (sign + z.z);
    let b = z.x * z.y * a;
    (Vec3::new(1.0 + sign * z.x * z.x * a, sign * b, -sign * z.x), Vec3::new(b, sign + z.y * z.y * a, -z.y))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Texture;

    #[test]
    fn a_relief_leans_along_u_and_against_v_whatever_the_winding_and_mirroring() {
        let square = [Vec3::ZERO, Vec3::X, Vec3::new(0.0, 1.0, 0.0)];
        // v points downward: u grows along x, v against y. The second is mirrored in u.
        for (uvs, along_u) in [
            ([Vec2::new(0.0, 1.0), Vec2::new(1.0, 1.0), Vec2::new(0.0, 0.0)], Vec3::X),
            ([Vec2::new(1.0, 1.0), Vec2::new(0.0, 1.0), Vec2::new(1.0, 0.0)], -Vec3::X),
        ] {
            for turned in [false, true] {
                let order = |three: [usize; 3]| if turned { [three[0], three[2], three[1]] } else { three };
                let (corners, uvs) = (order([0, 1, 2]).map(|i| square[i]), order([0, 1, 2]).map(|i| uvs[i]));
                let lean = |x: f32, y: f32| {
                    let stored = 0.5 * Vec3::new(x, y, 0.8) + 0.5;
                    let map = NormalMap { texture: Texture::Constant(stored), scale: 1.0 };
                    bumped(&map, Vec2::ZERO, corners, uvs, Vec3::Z)
                };
                assert!((lean(0.6, 0.0) - (0.6 * along_u + 0.8 * Vec3::Z)).length() < 1e-5, "{}", lean(0.6, 0.0));
                assert!((lean(0.0, 0.6) - Vec3::new(0.0, 0.6, 0.8)).length() < 1e-5, "{}", lean(0.0, 0.6));
            }
        }
    }
}
