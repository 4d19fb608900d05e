//! Projection from the cell: Φᵢ = ∫ L cosθa dω dA over points of the patch and directions of the square.

use glam::DVec3;
use rand::{Rng, RngExt};
use relumine_basis::{Cells, Pattern, Position, Reach};

use crate::Reconstruction;
use crate::deposit::Deposit;

/// Integrates a light field, given as the radiance of the light that passes `point` in `direction`, with about `samples`
/// samples in all; `between` says who shares what enters between positions. For far fields `point` is the origin.
pub(crate) fn integrate(
    radiance: &dyn Fn(DVec3, DVec3) -> DVec3,
    cells: &Cells,
    between: Reconstruction,
    samples: usize,
    rng: &mut impl Rng,
    deposit: &mut Deposit,
) {
    let side = (samples / cells.len()).isqrt().clamp(1, 1 << 10);
    let share = 1.0 / (side * side) as f64;
    let squares: Vec<f64> = match cells.reach() {
        Reach::Far => Vec::new(),
        Reach::Near { pattern, .. } => {
            let m = pattern.squares();
            (0..m * m).map(|square| pattern.projected_solid_angle(square % m, square / m)).collect()
        }
    };
    for position in 0..cells.positions() {
        let solid_angle = cells.partition().solid_angle(position) * share;
        for stratum in 0..side * side {
            let a = ((stratum % side) as f64 + rng.random::<f64>()) / side as f64;
            let b = ((stratum / side) as f64 + rng.random::<f64>()) / side as f64;
            let outward = cells.partition().sample(position, a, b);
            let shares = between.shares(cells, outward);
            match cells.reach() {
                Reach::Far => deposit.square(&shares, 0, 0, radiance(DVec3::ZERO, -outward) * solid_angle),
                Reach::Near { radius_m, pattern } => {
                    let m = pattern.squares();
                    let frame = Position::from_direction(outward).frame();
                    let area = radius_m * radius_m * solid_angle;
                    for (u, v) in (0..m * m).map(|square| (square % m, square / m)) {
                        let (s, t) = point_by_measure(pattern, u, v, rng);
                        let direction = frame.world_from_projector(s, t);
                        let arriving = radiance(radius_m * outward, direction);
                        if arriving != DVec3::ZERO && deposit.reaches_object(radius_m * outward, direction) {
                            deposit.square(&shares, u, v, arriving * (area * squares[v * m + u]));
                        }
                    }
                }
            }
        }
    }
}

/// A point of square (u, v) with density ∝ cosθa dω = cos⁴a ds dt, by rejection: then every sample of a cell weighs the
/// same, and constant light comes out exactly.
fn point_by_measure(pattern: Pattern, u: usize, v: usize, rng: &mut impl Rng) -> (f64, f64) {
    let cos4 = |s: f64, t: f64| (1.0 + s * s + t * t).powi(-2);
    let (left, top) = pattern.point_in_square(u, v, 0.0, 0.0);
    let (right, bottom) = pattern.point_in_square(u, v, 1.0, 1.0);
    // Greatest where the square is nearest to the axis.
    let greatest = cos4(0f64.clamp(left, right), 0f64.clamp(bottom, top));
    loop {
        let (s, t) = pattern.point_in_square(u, v, rng.random(), rng.random());
        if rng.random::<f64>() * greatest <= cos4(s, t) {
            return (s, t);
        }
    }
}
