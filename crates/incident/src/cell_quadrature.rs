//! Projection from the cell: Φᵢ = ∫ L cosθa dω dA over points of the patch and directions of the square.

use glam::DVec3;
use rand::{Rng, RngExt};
use relumine_basis::{Cells, Reach};

use crate::deposit::Deposit;

/// Integrates a light field, given as the radiance of the light that passes `point` in `direction`, with about `samples`
/// samples in all. For far fields `point` is the origin.
pub(crate) fn integrate(
    radiance: &dyn Fn(DVec3, DVec3) -> DVec3,
    cells: &Cells,
    samples: usize,
    rng: &mut impl Rng,
    deposit: &mut Deposit,
) {
    let side = (samples / cells.len()).isqrt().clamp(1, 1 << 10);
    let share = 1.0 / (side * side) as f64;
    for position in 0..cells.positions() {
        let solid_angle = cells.partition().solid_angle(position) * share;
        for stratum in 0..side * side {
            let a = ((stratum % side) as f64 + rng.random::<f64>()) / side as f64;
            let b = ((stratum / side) as f64 + rng.random::<f64>()) / side as f64;
            let outward = cells.partition().sample(position, a, b);
            match cells.reach() {
                Reach::Far => deposit.square(outward, 0, 0, radiance(DVec3::ZERO, -outward) * solid_angle),
                Reach::Near { radius_m, pattern } => {
                    let m = pattern.squares();
                    let square_side = 2.0 * pattern.half_width() / m as f64;
                    let frame = relumine_basis::Position::from_direction(outward).frame();
                    let area = radius_m * radius_m * solid_angle * square_side * square_side;
                    for (u, v) in (0..m * m).map(|square| (square % m, square / m)) {
                        let (s, t) = pattern.point_in_square(u, v, rng.random(), rng.random());
                        let direction = frame.world_from_projector(s, t);
                        // dμ = cosθa dω dA = cos⁴a ds dt dA.
                        let cos4 = (1.0 + s * s + t * t).powi(-2);
                        let arriving = radiance(radius_m * outward, direction);
                        if arriving != DVec3::ZERO && deposit.reaches_object(radius_m * outward, direction) {
                            deposit.square(outward, u, v, arriving * (cos4 * area));
                        }
                    }
                }
            }
        }
    }
}
