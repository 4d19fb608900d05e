//! The whole transfer in one pass: paths are followed from the camera once, and each of their vertices is connected with
//! every projector position; what comes that way is added to the square it comes through. No projector is rasterised:
//! where in the pixel and where in the square light goes is exact.
//!
//! Connections run position by position, so that all shadow rays of a packet share an end, and only one position's squares
//! are in memory at a time.

use std::ops::Range;

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use relumine_basis::{Cells, Pattern, Position, Reach};

use crate::Scene;
use crate::path::{Leg, PathOptions, Random, Vertex, Visitor, walk};

/// What lights the scene through squares: a projector, or one distant lamp.
#[derive(Clone, Debug)]
pub struct Lantern {
    kind: Kind,
}

#[derive(Clone, Debug)]
enum Kind {
    Projector {
        position: Vec3,
        right: Vec3,
        up: Vec3,
        outward: Vec3,
        pattern: Pattern,
        intensity: f32,
        vignetting: f32,
    },
    Distant {
        towards: Vec3,
    },
}

/// Light that arrives at a point from a lantern.
struct Arriving {
    square: usize,
    towards: Vec3,
    distance: f32,
    irradiance: f32,
}

impl Lantern {
    /// A projector at `radius_m` in the direction of `position`, with `intensity_w_sr` on its axis, that lights a flat screen
    /// evenly but for `vignetting`, the share that is lacking in the pattern's corners (it grows with the square of the
    /// distance from the axis).
    pub fn projector(
        position: Position,
        radius_m: f64,
        pattern: Pattern,
        intensity_w_sr: f64,
        vignetting: f64,
    ) -> Self {
        let frame = position.frame();
        let kind = Kind::Projector {
            position: (radius_m * frame.outward).as_vec3(),
            right: frame.right.as_vec3(),
            up: frame.up.as_vec3(),
            outward: frame.outward.as_vec3(),
            pattern,
            intensity: intensity_w_sr as f32,
            vignetting: vignetting as f32,
        };
        Self { kind }
    }

    /// A lamp at infinity in the unit direction `towards`, of irradiance one: a single square.
    pub fn distant(towards: DVec3) -> Self {
        Self { kind: Kind::Distant { towards: towards.as_vec3() } }
    }

    /// The lantern whose squares are the cells of position `index`: a projector of one watt a steradian, or a distant lamp.
    pub fn of_cells(cells: &Cells, index: usize) -> Self {
        let position = cells.partition().positions()[index];
        match cells.reach() {
            Reach::Near { radius_m, pattern } => Self::projector(position, radius_m, pattern, 1.0, 0.0),
            Reach::Far => Self::distant(position.direction()),
        }
    }

    /// Squares in all.
    pub fn squares(&self) -> usize {
        match &self.kind {
            Kind::Projector { pattern, .. } => pattern.squares() * pattern.squares(),
            Kind::Distant { .. } => 1,
        }
    }

    #[inline]
    fn arriving(&self, point: Vec3) -> Option<Arriving> {
        match &self.kind {
            Kind::Projector { position, right, up, outward, pattern, intensity, vignetting } => {
                let offset = *position - point;
                let squared = offset.length_squared();
                let distance = squared.sqrt();
                let towards = offset / distance;
                // The light travels the other way.
                let forward = towards.dot(*outward);
                if forward <= 1e-6 {
                    return None;
                }
                let (s, t) = (-towards.dot(*right) / forward, -towards.dot(*up) / forward);
                let (u, v) = pattern.square_at(f64::from(s), f64::from(t))?;
                // I(a) = I₀/cos³a lights a screen evenly.
                let half_width = pattern.half_width() as f32;
                let lacking = vignetting * (s * s + t * t) / (2.0 * half_width * half_width);
                let intensity = intensity * (1.0 - lacking) / (forward * forward * forward);
                Some(Arriving { square: v * pattern.squares() + u, towards, distance, irradiance: intensity / squared })
            }
            Kind::Distant { towards } => {
                Some(Arriving { square: 0, towards: *towards, distance: f32::INFINITY, irradiance: 1.0 })
            }
        }
    }
}

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
        // Mirrors and smooth glass show a point-like lantern nowhere.
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
        pixels * options.samples * options.bounces * size_of::<Vertex>()
    }

    /// Vertices in all: each costs one connection a lantern.
    pub fn vertices(&self) -> usize {
        self.lines.iter().map(|line| line.vertices.len()).sum()
    }

    /// Radiance towards the camera under each square of `lantern` alone, for the pixels in `columns` × `rows`, which must lie
    /// among the traced ones, of the same `scene`: what is not zero, by pixel and then by square.
    pub fn under(&self, scene: &Scene, lantern: &Lantern, columns: Range<usize>, rows: Range<usize>) -> Vec<Share> {
        let width = columns.len();
        let lines: Vec<Vec<Share>> = rows
            .clone()
            .into_par_iter()
            .map(|y| {
                let first_pixel = (y - rows.start) * width;
                self.line_under(scene, lantern, columns.clone(), &self.lines[y - self.rows.start], first_pixel)
            })
            .collect();
        lines.concat()
    }

    fn line_under(
        &self,
        scene: &Scene,
        lantern: &Lantern,
        columns: Range<usize>,
        line: &Line,
        first_pixel: usize,
    ) -> Vec<Share> {
        let share = 1.0 / self.samples as f32;
        let mut shares = Vec::new();
        let mut sums = vec![Vec3::ZERO; lantern.squares()];
        let mut touched: Vec<usize> = Vec::new();
        for (pixel, x) in (first_pixel..).zip(columns) {
            let column = x - self.columns.start;
            for vertex in &line.vertices[line.starts[column]..line.starts[column + 1]] {
                if let Some((square, radiance)) = connect(scene, vertex, lantern) {
                    if sums[square] == Vec3::ZERO {
                        touched.push(square);
                    }
                    sums[square] += radiance;
                }
            }
            touched.sort_unstable();
            touched.dedup();
            for square in touched.drain(..) {
                let radiance = (std::mem::take(&mut sums[square]) * share).to_array();
                shares.push(Share { pixel: pixel as u32, square: square as u32, radiance });
            }
        }
        shares
    }
}

/// What one vertex adds to the picture under a lantern, and through which square.
#[inline]
fn connect(scene: &Scene, vertex: &Vertex, lantern: &Lantern) -> Option<(usize, Vec3)> {
    let Arriving { square, towards, distance, irradiance } = lantern.arriving(vertex.position)?;
    let value = vertex.value(scene.bsdf(vertex.surface), towards);
    if value == Vec3::ZERO {
        return None;
    }
    let start = vertex.start(scene, towards);
    scene.is_free(start, towards, distance).then(|| (square, vertex.throughput * value * irradiance))
}
