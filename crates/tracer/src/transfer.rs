//! The whole transfer in one pass: paths are followed from the camera once, and each of their vertices is connected with
//! every projector position; what comes that way is added to the square it comes through. No projector is rasterised:
//! where in the pixel and where in the square light goes is exact.
//!
//! Connections run position by position, so that all shadow rays of a packet share an end, and only one position's squares
//! are in memory at a time.

use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use crate::lantern::Arriving;
use crate::packet::{Packet, RAYS};
use crate::path::{Leg, PathOptions, Random, Vertex, Visitor, walk};
use crate::{Lantern, Scene};

/// The paths of a rectangle of pixels, to be connected with lanterns.
pub struct Paths {
    columns: Range<usize>,
    rows: Range<usize>,
    samples: usize,
    /// The vertices of each row of pixels, and where those of each pixel begin.
    lines: Vec<Line>,
}

#[derive(Default)]
struct Line {
    vertices: Vec<Vertex>,
    starts: Vec<usize>,
}

/// Collects vertices that a lantern can be connected with.
struct Collect<'a> {
    scene: &'a Scene,
    line: Line,
}

impl Visitor for Collect<'_> {
    fn wants_legs(&self) -> bool {
        false
    }

    fn leg(&mut self, _: &Leg) {}

    fn vertex(&mut self, vertex: &Vertex, _: &mut Random) {
        // Smooth glass shows a point-like lantern nowhere.
        if !self.scene.bsdf(vertex.surface).is_specular() {
            self.line.vertices.push(*vertex);
        }
    }
}

/// What a pixel gets through one square.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Share {
    /// The pixel, row-major among those asked for.
    pub pixel: u32,
    /// The square, v · M + u.
    pub square: u32,
    /// Radiance towards the camera, W·m⁻²·sr⁻¹.
    pub radiance: [f32; 3],
}

impl Paths {
    /// Follows the paths of the pixels in `columns` × `rows` of the scene's picture.
    ///
    /// # Panics
    /// If they leave it.
    pub fn trace(scene: &Scene, columns: Range<usize>, rows: Range<usize>, options: &PathOptions) -> Self {
        let (width, height) = scene.picture_size();
        assert!(columns.end <= width && rows.end <= height, "pixels outside the picture");
        let trace = |y: usize| {
            let mut collect = Collect { scene, line: Line::default() };
            for x in columns.clone() {
                collect.line.starts.push(collect.line.vertices.len());
                for sample in 0..options.samples {
                    walk(scene, (x, y), sample, options, &mut collect);
                }
            }
            let Line { mut vertices, mut starts } = collect.line;
            starts.push(vertices.len());
            vertices.shrink_to_fit();
            Line { vertices, starts }
        };
        let lines = rows.clone().into_par_iter().map(trace).collect();
        Self { columns, rows, samples: options.samples.max(1), lines }
    }

    /// The most bytes that the paths of `pixels` pixels take.
    pub fn most_bytes(pixels: usize, options: &PathOptions) -> usize {
        pixels.saturating_mul(options.samples).saturating_mul(options.bounces).saturating_mul(size_of::<Vertex>())
    }

    /// About the bytes that these take.
    pub fn bytes(&self) -> usize {
        self.vertices() * size_of::<Vertex>()
    }

    /// Vertices in all: each costs one connection a lantern.
    pub fn vertices(&self) -> usize {
        self.lines.iter().map(|line| line.vertices.len()).sum()
    }

    /// Radiance towards the camera under each square of `lantern` alone, for the pixels in `columns` × `rows`, which must lie
    /// among the traced ones, of the same `scene`: what is not zero, by pixel and then by square.
    pub fn under(&self, scene: &Scene, lantern: &Lantern, columns: Range<usize>, rows: Range<usize>) -> Vec<Share> {
        let width = columns.len();
        let strips: Vec<Vec<Share>> = (rows.clone().step_by(ROWS).collect::<Vec<_>>())
            .into_par_iter()
            .map(|start| {
                let strip = start..(start + ROWS).min(rows.end);
                let first_pixel = (start - rows.start) * width;
                let connections = self.connections(scene, lantern, columns.clone(), strip, first_pixel);
                self.add_up(lantern, &connections)
            })
            .collect();
        strips.concat()
    }

    /// What each vertex of a strip adds under the lantern if nothing stands between, and whether nothing does.
    fn connections(
        &self,
        scene: &Scene,
        lantern: &Lantern,
        columns: Range<usize>,
        rows: Range<usize>,
        first_pixel: usize,
    ) -> Vec<Connection> {
        let mut connections = Vec::new();
        let pixels = rows.flat_map(|y| columns.clone().map(move |x| (x, y)));
        for (pixel, (x, y)) in (first_pixel as u32..).zip(pixels) {
            let line = &self.lines[y - self.rows.start];
            let column = x - self.columns.start;
            let vertices = &line.vertices[line.starts[column]..line.starts[column + 1]];
            connections.extend(vertices.iter().filter_map(|vertex| Connection::new(scene, vertex, lantern, pixel)));
        }
        match lantern.origin() {
            Some(origin) => shade(scene, origin, &mut connections),
            None => connections.retain(|c| scene.is_free(c.start, c.towards, c.distance)),
        }
        connections
    }

    fn add_up(&self, lantern: &Lantern, connections: &[Connection]) -> Vec<Share> {
        let share = 1.0 / self.samples as f32;
        let mut shares = Vec::new();
        let mut sums = vec![Vec3::ZERO; lantern.squares()];
        let mut touched: Vec<u32> = Vec::new();
        for of_pixel in connections.chunk_by(|a, b| a.pixel == b.pixel) {
            for connection in of_pixel {
                sums[connection.square as usize] += connection.radiance;
                touched.push(connection.square);
            }
            touched.sort_unstable();
            touched.dedup();
            for square in touched.drain(..) {
                let radiance = (std::mem::take(&mut sums[square as usize]) * share).to_array();
                shares.push(Share { pixel: of_pixel[0].pixel, square, radiance });
            }
        }
        shares
    }
}

/// Rows whose connections are made together: enough of them for packets that keep close.
const ROWS: usize = 8;

/// The way from a vertex to a lantern.
#[derive(Clone, Copy, Debug)]
struct Connection {
    pixel: u32,
    square: u32,
    /// What it adds if it is free.
    radiance: Vec3,
    start: Vec3,
    towards: Vec3,
    distance: f32,
}

impl Connection {
    #[inline]
    fn new(scene: &Scene, vertex: &Vertex, lantern: &Lantern, pixel: u32) -> Option<Self> {
        let Arriving { square, towards, distance, irradiance } = lantern.arriving(vertex.position)?;
        let value = vertex.value(scene.bsdf(vertex.surface), towards);
        if value == Vec3::ZERO {
            return None;
        }
        let radiance = vertex.throughput * value * irradiance;
        let start = vertex.start(scene, towards);
        Some(Self { pixel, square: square as u32, radiance, start, towards, distance })
    }
}

/// Keeps the connections with `origin` that nothing stands in the way of. Rays are sorted by direction, so that those of a
/// packet pass the same nodes; the order of what is kept does not change.
fn shade(scene: &Scene, origin: Vec3, connections: &mut Vec<Connection>) {
    let Some(shadows) = scene.shadows() else { return };
    let mut order: Vec<u64> = connections
        .iter()
        .enumerate()
        .map(|(index, connection)| u64::from(place_on_curve(connection.towards)) << 32 | index as u64)
        .collect();
    order.sort_unstable();
    let mut free = vec![false; connections.len()];
    let mut stack = Vec::new();
    for rays in order.chunks(RAYS) {
        let index = |key: u64| (key & 0xffff_ffff) as usize;
        let mut packet = Packet::towards(origin, rays.iter().map(|key| connections[index(*key)].start));
        packet.stop(origin, &shadows, &mut stack);
        for (lane, key) in rays.iter().enumerate() {
            free[index(*key)] = packet.is_free(lane);
        }
    }
    let mut free = free.into_iter();
    connections.retain(|_| free.next() == Some(true));
}

/// Directions that are near on the sphere are near in these numbers: a Z curve over octahedral coordinates.
fn place_on_curve(direction: Vec3) -> u32 {
    let flat = direction / direction.abs().element_sum();
    let (x, y) = if flat.z >= 0.0 {
        (flat.x, flat.y)
    } else {
        ((1.0 - flat.y.abs()).copysign(flat.x), (1.0 - flat.x.abs()).copysign(flat.y))
    };
    let spread = |value: f32| {
        let mut bits = ((value * 0.5 + 0.5) * 65_535.0) as u32;
        bits = (bits | bits << 8) & 0x00ff_00ff;
        bits = (bits | bits << 4) & 0x0f0f_0f0f;
        bits = (bits | bits << 2) & 0x3333_3333;
        (bits | bits << 1) & 0x5555_5555
    };
    spread(x) | spread(y) << 1
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;
    use std::path::Path;

    use relumine_basis::{Pattern, Position};

    use super::*;
    use crate::shape::Shape;

    /// The plain version, in double precision and shape by shape.
    fn is_free(scene: &Scene, from: Vec3, to: Vec3) -> bool {
        let (from, to) = (from.as_dvec3(), to.as_dvec3());
        let way = to - from;
        let stops = |shape: &Shape| match shape {
            Shape::Triangle(corners) => {
                let [a, b, c] = corners.map(|corner| corner.as_dvec3() - from);
                let (u, v, w) = (way.dot(b.cross(c)), way.dot(c.cross(a)), way.dot(a.cross(b)));
                let inside = (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0);
                let normal = (b - a).cross(c - a);
                let t = a.dot(normal) / way.dot(normal);
                inside && t > 0.0 && t < 1.0
            }
            Shape::Ball { centre, radius } => {
                let offset = from - centre.as_dvec3();
                let (a, b) = (way.length_squared(), offset.dot(way));
                let c = offset.length_squared() - f64::from(*radius).powi(2);
                let root = (b * b - a * c).max(0.0).sqrt();
                b * b > a * c && [(-b - root) / a, (-b + root) / a].iter().any(|t| *t > 0.0 && *t < 1.0)
            }
        };
        !scene.shadows().is_some_and(|shadows| shadows.shapes.iter().any(stops))
    }

    #[test]
    fn packets_stop_what_single_rays_and_every_shape_by_itself_stop() {
        let profile = "[[0, 0], [0.2, 0], [0.08, 0.15], [0.05, 0.3], [0.12, 0.35], [0.1, 0.45], [0, 0.5]]";
        let text = format!(
            "format = \"relumine-scene/1\"\n[camera]\nposition = [0, -4, 3]\ntarget = [0, 0, 0.2]\nhorizontal_fov_deg = 18\n\
             width = 30\nheight = 20\n[[material]]\nname = \"m\"\ndiffuse.reflectance = [0.5, 0.5, 0.5]\n\
             [[object]]\nmaterial = \"m\"\nplane.size_m = [1.4, 1.4]\n\
             [[object]]\nmaterial = \"m\"\nlathe.profile_m = {profile}\n\
             [[object]]\nmaterial = \"m\"\nsphere.radius_m = 0.15\ntranslate_m = [0.4, 0.1, 0.15]\n"
        );
        let scene = Scene::parse(Path::new("scene.toml"), &text).unwrap();
        let paths = Paths::trace(&scene, 0..30, 0..20, &PathOptions { samples: 4, bounces: 3, seed: 3 });
        let pattern = Pattern::new(16, 0.3).unwrap();
        let (mut all, mut apart_from_single, mut apart_from_plain) = (0, 0, 0);
        for (azimuth, tilt) in [(20.0, 30.0), (200.0, 75.0), (-80.0, 60.0)] {
            let lantern = Lantern::projector(Position::from_degrees(azimuth, tilt), 4.0, pattern, 1.0, 0.0);
            let origin = lantern.origin().unwrap();
            let vertices = paths.lines.iter().flat_map(|line| &line.vertices);
            let mut connections: Vec<Connection> = (0..)
                .zip(vertices)
                .filter_map(|(index, vertex)| Connection::new(&scene, vertex, &lantern, index))
                .collect();
            let before = connections.clone();
            shade(&scene, origin, &mut connections);
            let kept: HashSet<u32> = connections.iter().map(|connection| connection.pixel).collect();
            all += before.len();
            for connection in before {
                let free = kept.contains(&connection.pixel);
                let single = scene.is_free(connection.start, connection.towards, connection.distance);
                apart_from_single += usize::from(free != single);
                apart_from_plain += usize::from(free != is_free(&scene, origin, connection.start));
            }
        }
        println!(
            "of {all}, {apart_from_single} differ from single rays, {apart_from_plain} from every shape by itself"
        );
        assert!(all > 4000 && 2000 * apart_from_single <= all && 2000 * apart_from_plain <= all);
    }
}
