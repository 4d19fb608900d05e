//! Projection from the source: rays that carry a lamp's flux.

use glam::DVec3;
use rand::{Rng, RngExt, seq::SliceRandom};
use relumine_basis::Cells;
use relumine_lamp::{Lamp, Ray};

use crate::deposit::Deposit;

/// Shoots about `rays` stratified rays of `lamp` into `deposit`.
pub(crate) fn shoot(lamp: &Lamp, cells: &Cells, light_map: bool, rays: usize, rng: &mut impl Rng, deposit: &mut Deposit) {
    let far = cells.reached_radius_m().is_infinite();
    let strata = Strata::new(rays, rng);
    let share = 1.0 / strata.len() as f64;
    for xi in strata.draw(rng) {
        if far {
            // A far field sees every light as it arrives at the origin.
            if let Some(arrival) = lamp.arrival(DVec3::ZERO, [xi[0], xi[1]]) {
                deposit.ray(DVec3::ZERO, arrival.direction, arrival.irradiance * share);
            }
            continue;
        }
        let radius = cells.reached_radius_m();
        let ray = if light_map { sun_at_origin(lamp, radius, xi) } else { lamp.shoot(radius, xi) };
        if let Some(ray) = ray {
            deposit.ray(ray.origin, ray.direction, ray.flux * share);
        }
    }
}

/// The lamp's light at the origin spread over the whole scene: one ray of the sun that would look the same from there.
fn sun_at_origin(lamp: &Lamp, radius: f64, xi: [f64; 4]) -> Option<Ray> {
    let arrival = lamp.arrival(DVec3::ZERO, [xi[2], xi[3]])?;
    Lamp::Sun { direction: arrival.direction, irradiance: arrival.irradiance }.shoot(radius, xi)
}

/// n × n strata for the first two numbers of a ray, and n × n others, in another order, for the last two.
struct Strata {
    side: usize,
    pairing: Vec<u32>,
}

impl Strata {
    fn new(rays: usize, rng: &mut impl Rng) -> Self {
        let side = rays.isqrt().clamp(1, 1 << 12);
        let mut pairing: Vec<u32> = (0..(side * side) as u32).collect();
        pairing.shuffle(rng);
        Self { side, pairing }
    }

    fn len(&self) -> usize {
        self.side * self.side
    }

    fn draw(&self, rng: &mut impl Rng) -> impl Iterator<Item = [f64; 4]> {
        let n = self.side;
        let place = move |stratum: usize, rng: &mut dyn FnMut() -> f64| {
            [((stratum % n) as f64 + rng()) / n as f64, ((stratum / n) as f64 + rng()) / n as f64]
        };
        self.pairing.iter().enumerate().map(move |(first, second)| {
            let mut uniform = || rng.random::<f64>();
            let [a, b] = place(first, &mut uniform);
            let [c, d] = place(*second as usize, &mut uniform);
            [a, b, c, d]
        })
    }
}
