//! Lamps and sky as a path meets them: connected to its vertices, or met by chance at the end of a leg, each weighed by how
//! likely the other would have been (multiple importance sampling, Veach & Guibas 1995, balance heuristic).

use glam::{DVec3, Vec3};
use relumine_lamp::{Arrival, Environment, Highlights, Lamp};

use crate::path::{Leg, Random, Vertex, Visitor};
use crate::scene::Scene;

/// What lights a scene.
pub(crate) struct Lighting {
    lamps: Vec<Lamp>,
    sky: Option<Sky>,
    /// Whether the camera sees lamps and sky themselves.
    seen: bool,
}

enum Sky {
    /// A map, whose directions are drawn by brightness.
    Map(Highlights<'static>),
    /// The same from everywhere, drawn evenly.
    Even(Environment),
}

impl Lighting {
    pub(crate) fn new(lamps: Vec<Lamp>, environment: Option<Environment>, seen: bool) -> Self {
        let sky = environment.map(|environment| match environment.into_highlights() {
            Ok(map) => Sky::Map(map),
            Err(even) => Sky::Even(even),
        });
        Self { lamps, sky, seen }
    }
}

impl Sky {
    /// The radiance that comes from the unit vector `towards`.
    fn radiance(&self, towards: DVec3) -> DVec3 {
        match self {
            Self::Map(map) => map.environment().radiance(towards),
            Self::Even(environment) => environment.radiance(towards),
        }
    }

    fn arrival(&self, xi: [f64; 2]) -> Option<Arrival> {
        if let Self::Map(map) = self {
            return map.arrival(xi);
        }
        let (z, radius) = (xi[0], (1.0 - xi[0] * xi[0]).sqrt());
        let (sine, cosine) = (std::f64::consts::TAU * xi[1]).sin_cos();
        let towards = DVec3::new(radius * cosine, radius * sine, z);
        let irradiance = self.radiance(towards) * std::f64::consts::TAU;
        Some(Arrival { direction: -towards, irradiance, distance_m: f64::INFINITY })
    }

    fn density(&self, towards: DVec3) -> f64 {
        match self {
            Self::Map(map) => map.density(towards),
            Self::Even(_) if towards.z >= 0.0 => std::f64::consts::TAU.recip(),
            Self::Even(_) => 0.0,
        }
    }
}

/// Adds up the radiance that one path brings to the camera.
pub(crate) struct Gather<'a> {
    scene: &'a Scene,
    lighting: &'a Lighting,
    pub(crate) radiance: Vec3,
    /// Whether the camera's own ray met something.
    pub(crate) met: bool,
}

impl<'a> Gather<'a> {
    pub(crate) fn new(scene: &'a Scene, lighting: &'a Lighting) -> Self {
        Self { scene, lighting, radiance: Vec3::ZERO, met: false }
    }

    /// What arrives from a lamp or the sky, drawn with `density` (by solid angle; `None` for a delta).
    fn connect(&mut self, vertex: &Vertex, arrival: Arrival, density: Option<f64>) {
        let towards = -arrival.direction.as_vec3();
        let bsdf = self.scene.bsdf(vertex.surface);
        let value = vertex.value(bsdf, towards);
        if value == Vec3::ZERO {
            return;
        }
        let start = vertex.start(self.scene, towards);
        if !self.scene.is_free(start, towards, arrival.distance_m as f32) {
            return;
        }
        let weight = density.map_or(1.0, |density| {
            let by_chance = f64::from(vertex.density(bsdf, towards));
            density / (density + by_chance)
        });
        self.radiance += vertex.throughput * value * (arrival.irradiance * weight).as_vec3();
    }
}

impl Visitor for Gather<'_> {
    fn wants_legs(&self) -> bool {
        // Only what has an extent is met by chance.
        self.lighting.sky.is_some()
            || self
                .lighting
                .lamps
                .iter()
                .any(|lamp| matches!(lamp, Lamp::Sphere(_) | Lamp::Rectangle(_) | Lamp::Disk(_)))
    }

    fn leg(&mut self, leg: &Leg) {
        if leg.from_camera {
            self.met = leg.distance.is_finite();
            if !self.lighting.seen {
                return;
            }
        }
        let chance = |drawn: f64| match leg.density {
            Some(density) => f64::from(density) / (f64::from(density) + drawn),
            None => 1.0,
        };
        let (point, direction) = (leg.start.as_dvec3(), -leg.direction.as_dvec3());
        for lamp in &self.lighting.lamps {
            if let Some(sight) = lamp.sight(point, direction).filter(|sight| sight.distance_m < f64::from(leg.distance))
            {
                self.radiance += leg.throughput * (sight.radiance * chance(sight.density)).as_vec3();
            }
        }
        if let Some(sky) = self.lighting.sky.as_ref().filter(|_| leg.distance.is_infinite()) {
            let radiance = sky.radiance(-direction);
            self.radiance += leg.throughput * (radiance * chance(sky.density(-direction))).as_vec3();
        }
    }

    fn vertex(&mut self, vertex: &Vertex, random: &mut Random) {
        if self.scene.bsdf(vertex.surface).is_specular() {
            return;
        }
        let lighting = self.lighting;
        let point = vertex.position.as_dvec3();
        for lamp in &lighting.lamps {
            let xi = [random.independent(), random.independent()];
            let Some(arrival) = lamp.arrival(point, xi) else { continue };
            // Lamps without extent have none, nor has a direction that rounding has put past a lamp's rim: no leg finds either.
            let density = lamp.sight(point, arrival.direction).map(|sight| sight.density);
            self.connect(vertex, arrival, density);
        }
        if let Some(sky) = &lighting.sky {
            let xi = [random.independent(), random.independent()];
            if let Some(arrival) = sky.arrival(xi) {
                self.connect(vertex, arrival, Some(sky.density(-arrival.direction)));
            }
        }
    }
}
