//! The paper's separation: the minimum of two combs.

use super::Combs;

/// B(u, v) = min(row comb, column comb) per lane, where both were taken; zero elsewhere and never below zero.
///
/// Without noise and with squares that do not reach each other's light it is exact, and never too small; what two lit
/// squares of *both* combs send to a pixel is counted twice (docs/MATH.md).
///
/// # Panics
/// If `squares` does not hold M² · lanes values.
pub fn separate_minimum(combs: &Combs, squares: &mut [f32]) {
    let (m, lanes) = (combs.squares, combs.lanes);
    assert_eq!(squares.len(), m * m * lanes);
    for v in 0..m {
        for u in 0..m {
            let square = &mut squares[(v * m + u) * lanes..][..lanes];
            match (combs.row(u, v), combs.column(u, v)) {
                (Some(row), Some(column)) => {
                    for ((value, row), column) in square.iter_mut().zip(row).zip(column) {
                        *value = row.min(*column).max(0.0);
                    }
                }
                _ => square.fill(0.0),
            }
        }
    }
}
