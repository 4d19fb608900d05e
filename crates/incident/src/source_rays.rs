//! Projection from the source: rays that carry a lamp's flux.

use glam::DVec3;
use rand::{Rng, RngExt, seq::SliceRandom};
use relumine_basis::Cells;
use relumine_lamp::{Arrival, Lamp, Ray};

use crate::deposit::Deposit;

/// Shoots about `rays` stratified rays of `lamp` into `deposit`.
pub(crate) fn shoot(lamp: &Lamp, cells: &Cells, rays: usize, rng: &mut impl Rng, deposit: &mut Deposit) {
    let strata = Strata::new(rays, rng);
    let share = 1.0 / strata.len() as f64;
    let radius = cells.reached_radius_m();
    for xi in strata.draw(rng) {
        if let Some(Ray { origin, direction, flux }) = lamp.shoot(radius, xi) {
            deposit.ray(origin, direction, flux * share);
        }
    }
}

/// Spreads light that arrives at the origin over the whole scene: about `rays` rays of the suns that would look the same
/// from there. `arrival` gives a direction and its irradiance for two uniform numbers.
pub(crate) fn shoot_arriving(
    arrival: &dyn Fn([f64; 2]) -> Option<Arrival>,
    cells: &Cells,
    rays: usize,
    rng: &mut impl Rng,
    deposit: &mut Deposit,
) {
    let strata = Strata::new(rays, rng);
    let share = 1.0 / strata.len() as f64;
    let radius = cells.reached_radius_m();
    for xi in strata.draw(rng) {
        let Some(Arrival { direction, irradiance, .. }) = arrival([xi[2], xi[3]]) else { continue };
        if radius.is_infinite() {
            // A far field has no places, only directions.
            deposit.ray(DVec3::ZERO, direction, irradiance * share);
        } else if let Some(ray) = (Lamp::Sun { direction, irradiance }).shoot(radius, xi) {
            deposit.ray(ray.origin, ray.direction, ray.flux * share);
        }
    }
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
