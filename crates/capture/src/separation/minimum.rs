//! The paper's separation, the minimum of two combs, and two ways to deal with its noise.

use super::{Combs, Removed};

/// B(u, v) = min(row comb, column comb) per lane, where both were taken; zero elsewhere. What noise makes negative stays.
///
/// Without noise and with squares that do not reach each other's light it is exact, and never too small; what two lit
/// squares of *both* combs send to a pixel is counted twice (docs/MATH.md). With noise it is biased: where both combs see
/// the same, by −σ/√π, and hundreds of squares add up ([`separate_unbiased`]).
///
/// # Panics
/// If `squares` does not hold M² · lanes values.
pub fn separate_minimum(combs: &Combs, squares: &mut [f32]) {
    minimum_by(combs, squares, |_, row, column| row.min(column));
}

/// The paper's noise filter: the minimum, black where it is below `sigmas` standard deviations of a photograph without
/// light, one threshold for all lanes; below zero if the noise is not known. Says what was cut.
///
/// # Panics
/// If `squares` does not hold M² · lanes values.
pub fn separate_thresholded(combs: &Combs, sigmas: f32, squares: &mut [f32]) -> Removed {
    let threshold = combs.noise.as_ref().map_or(0.0, |noise| sigmas * noise.dark_deviation());
    let mut removed = Removed::default();
    minimum_by(combs, squares, |_, row, column| {
        let value = row.min(column);
        if value < threshold {
            removed.cut += f64::from(value);
            return 0.0;
        }
        removed.light += f64::from(value);
        value
    });
    removed
}

/// The minimum with its bias subtracted. Of X, Y with means μx, μy, θ² = σx² + σy² and δ = (μx − μy)/θ,
/// E[min(X, Y)] = min(μx, μy) − θ (φ(δ) − |δ| Φ(−|δ|)) (C. E. Clark, *The greatest of a finite set of random variables*,
/// 1961). δ is known with an error of 1 only, so that no correction is right for every δ. This one is right in the mean
/// where both combs see the same (almost all squares: both are dark), up to 0.15 θ too much where they differ by about θ, up
/// to 0.06 θ too little at 3 θ, and fades beyond. Says how much was subtracted;
/// nothing is if the noise is not known.
///
/// # Panics
/// If `squares` does not hold M² · lanes values.
pub fn separate_unbiased(combs: &Combs, squares: &mut [f32]) -> Removed {
    let mut removed = Removed::default();
    minimum_by(combs, squares, |lane, row, column| {
        let value = row.min(column);
        // Where the bias matters both see the same: the variance of the smaller follows noise least.
        let theta = combs.noise.as_ref().map_or(0.0, |noise| (2.0 * noise.of(lane, value)).sqrt());
        let bias = if theta > 0.0 { theta * bias_of_minimum((row - column) / theta) } else { 0.0 };
        removed.light += f64::from(value + bias);
        removed.bias += f64::from(bias);
        value + bias
    });
    removed
}

/// What the minimum of two noisy values is too small by, in units of θ, estimated from their measured difference d over θ:
/// g(d) = √2 (φ(0) + c − 2c d²) exp(−d²/2). With d normal about δ, E[g] = exp(−δ²/4) (φ(0) − c δ²/2): φ(0), the bias, at
/// δ = 0, and next to nothing at δ = 2, as the bias is.
fn bias_of_minimum(difference: f32) -> f32 {
    const PHI_0: f32 = 0.398_942_3;
    const C: f32 = 0.2;
    let square = difference * difference;
    std::f32::consts::SQRT_2 * (PHI_0 + C - 2.0 * C * square) * (-0.5 * square).exp()
}

fn minimum_by(combs: &Combs, squares: &mut [f32], mut of: impl FnMut(usize, f32, f32) -> f32) {
    let (m, lanes) = (combs.squares, combs.lanes);
    assert_eq!(squares.len(), m * m * lanes);
    for v in 0..m {
        for u in 0..m {
            let square = &mut squares[(v * m + u) * lanes..][..lanes];
            match (combs.row(u, v), combs.column(u, v)) {
                (Some(row), Some(column)) => {
                    for (lane, ((value, row), column)) in square.iter_mut().zip(row).zip(column).enumerate() {
                        *value = of(lane, *row, *column);
                    }
                }
                _ => square.fill(0.0),
            }
        }
    }
}
