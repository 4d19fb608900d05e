//! Paths from the camera: what they meet, and where they go on.

use glam::Vec3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::bsdf::{Bsdf, Varying};
use crate::scene::{Scene, across};

/// How many paths, and how long.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathOptions {
    /// Paths a pixel.
    pub samples: usize,
    /// Times that light is scattered on its way from lamp to camera, at most; 1 is direct light only.
    pub bounces: usize,
    /// Start of the random numbers. Same scene, options and seed give the same bits, whatever the number of threads.
    pub seed: u64,
}

impl Default for PathOptions {
    fn default() -> Self {
        Self { samples: 64, bounces: 5, seed: 2003 }
    }
}

/// A place where a path is scattered, seen from the side it came from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Vertex {
    pub(crate) position: Vec3,
    /// Geometric normal towards the side of `wo`.
    pub(crate) facing: Vec3,
    /// The frame of shading: two tangents and the normal, towards the side of `wo`.
    pub(crate) frame: [Vec3; 3],
    /// Where the light goes, in that frame.
    pub(crate) wo: Vec3,
    /// What light that goes there is multiplied with on its way to the camera.
    pub(crate) throughput: Vec3,
    pub(crate) surface: u32,
    pub(crate) varying: Varying,
}

impl Vertex {
    /// A world direction in the frame of shading.
    pub(crate) fn local(&self, direction: Vec3) -> Vec3 {
        let [x, y, z] = self.frame;
        Vec3::new(direction.dot(x), direction.dot(y), direction.dot(z))
    }

    fn world(&self, direction: Vec3) -> Vec3 {
        let [x, y, z] = self.frame;
        direction.x * x + direction.y * y + direction.z * z
    }

    /// f·|cosθᵢ| for light that comes from the world direction `towards`; zero where shading and geometry disagree on
    /// whether it comes through.
    #[inline]
    pub(crate) fn value(&self, bsdf: &Bsdf, towards: Vec3) -> Vec3 {
        let wi = self.local(towards);
        let side = towards.dot(self.facing);
        if side * wi.z <= 0.0 || (wi.z < 0.0 && !bsdf.transmits()) {
            return Vec3::ZERO;
        }
        bsdf.value(&self.varying, self.wo, wi)
    }

    /// The density with which the path goes on towards the world direction `towards`.
    pub(crate) fn density(&self, bsdf: &Bsdf, towards: Vec3) -> f32 {
        bsdf.density(&self.varying, self.wo, self.local(towards))
    }

    /// Where a ray that leaves towards `towards` starts.
    pub(crate) fn start(&self, scene: &Scene, towards: Vec3) -> Vec3 {
        let off = scene.off_surface(self.facing);
        if towards.dot(self.facing) >= 0.0 { self.position + off } else { self.position - off }
    }
}

/// The way from one vertex to what comes next.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Leg {
    pub(crate) start: Vec3,
    pub(crate) direction: Vec3,
    /// To the next surface; infinite if there is none.
    pub(crate) distance: f32,
    /// What light that comes along it is multiplied with on its way to the camera.
    pub(crate) throughput: Vec3,
    /// The density of its direction; `None` after smooth glass, and for what the camera sees itself.
    pub(crate) density: Option<f32>,
    /// Whether it starts at the camera.
    pub(crate) from_camera: bool,
}

/// What happens along a path.
pub(crate) trait Visitor {
    /// Whether the leg after the last scattering matters.
    fn wants_legs(&self) -> bool;
    fn leg(&mut self, leg: &Leg);
    fn vertex(&mut self, vertex: &Vertex, random: &mut Random);
}

/// The random numbers of one path: the first few spread evenly over the paths of a pixel, the rest independent.
pub(crate) struct Random {
    generator: Pcg64Mcg,
    even: [f32; EVEN],
    used: usize,
}

/// Numbers a path that are spread evenly: two for the place in the pixel, three for the first scattering.
const EVEN: usize = 5;
const BASES: [u64; EVEN] = [2, 3, 5, 7, 11];

impl Random {
    /// Of path `sample` of the pixel with this index: a Halton sequence, turned by a number of each pixel.
    pub(crate) fn new(seed: u64, pixel: u64, sample: u64) -> Self {
        let mut turns = Pcg64Mcg::seed_from_u64(mixed(seed ^ mixed(pixel)));
        let even = std::array::from_fn(|dimension| {
            let turned: f64 = turns.random::<f64>() + radical_inverse(BASES[dimension], sample);
            (turned.fract() as f32).min(1.0 - f32::EPSILON)
        });
        Self { generator: Pcg64Mcg::seed_from_u64(mixed(seed ^ mixed(pixel ^ mixed(sample + 1)))), even, used: 0 }
    }

    /// The next number, in [0, 1).
    pub(crate) fn next(&mut self) -> f32 {
        self.used += 1;
        match self.even.get(self.used - 1) {
            Some(even) => *even,
            None => self.generator.random(),
        }
    }

    /// A number that is independent of the evenly spread ones and leaves them for the path.
    pub(crate) fn independent(&mut self) -> f64 {
        self.generator.random()
    }
}

/// SplitMix64 (Steele et al. 2014): neighbouring numbers become unrelated ones.
fn mixed(mut x: u64) -> u64 {
    x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

fn radical_inverse(base: u64, mut index: u64) -> f64 {
    let (mut inverse, mut place) = (0.0, 1.0 / base as f64);
    while index > 0 {
        inverse += (index % base) as f64 * place;
        index /= base;
        place /= base as f64;
    }
    inverse
}

/// After this many scatterings, dark paths end by chance (Russian roulette), and those that go on count for them.
const SURE: usize = 3;

/// Follows path `sample` of pixel (x, y).
pub(crate) fn walk(
    scene: &Scene,
    (x, y): (usize, usize),
    sample: usize,
    options: &PathOptions,
    visitor: &mut impl Visitor,
) {
    let (width, height) = scene.picture_size();
    let mut random = Random::new(options.seed, (y * width + x) as u64, sample as u64);
    let (a, b) = (f64::from(random.next()), f64::from(random.next()));
    let towards = scene.camera().towards(x as f64 + a, y as f64 + b, width, height);
    let mut leg = Leg {
        start: scene.camera().position().as_vec3(),
        direction: towards.as_vec3().normalize(),
        distance: f32::INFINITY,
        throughput: Vec3::ONE,
        density: None,
        from_camera: true,
    };
    for depth in 0..=options.bounces {
        // On the last leg nothing is scattered any more; it only asks what shines at its end.
        let last = depth == options.bounces;
        if last && !visitor.wants_legs() {
            return;
        }
        let place = scene.meet(leg.start, leg.direction);
        leg.distance = place.map_or(f32::INFINITY, |place| place.distance);
        visitor.leg(&leg);
        let Some(place) = place.filter(|_| !last) else { return };
        let outside = leg.direction.dot(place.geometric) < 0.0;
        let side = if outside { 1.0 } else { -1.0 };
        let facing = side * place.geometric;
        // A shading normal that looks away from where the path came from cannot be: the surface itself takes its place.
        let mut normal = side * place.shading;
        if normal.dot(-leg.direction) < 1e-3 {
            normal = facing;
        }
        let (tangent, bitangent) = across(normal);
        let mut vertex = Vertex {
            position: place.position,
            facing,
            frame: [tangent, bitangent, normal],
            wo: Vec3::Z,
            throughput: leg.throughput,
            surface: place.surface,
            varying: Bsdf::varying(scene.material(place.surface), place.uv, outside),
        };
        vertex.wo = vertex.local(-leg.direction);
        vertex.wo.z = vertex.wo.z.max(1e-4);
        visitor.vertex(&vertex, &mut random);

        let bsdf = scene.bsdf(place.surface);
        let Some(scattered) = bsdf.sample(&vertex.varying, vertex.wo, [random.next(), random.next(), random.next()])
        else {
            return;
        };
        let direction = vertex.world(scattered.wi).normalize();
        if direction.dot(facing) * scattered.wi.z <= 0.0 {
            return;
        }
        let mut throughput = leg.throughput * scattered.weight;
        if throughput == Vec3::ZERO {
            return;
        }
        if depth + 1 >= SURE {
            let survival = throughput.max_element().min(0.95);
            if survival <= 0.0 || random.next() >= survival {
                return;
            }
            throughput /= survival;
        }
        let start = vertex.start(scene, direction);
        leg = Leg { start, direction, distance: 0.0, throughput, density: scattered.density, from_camera: false };
    }
}
