//! The M × M squares of a pattern on the projector's tangent plane.

use crate::BasisError;

/// M × M squares over |s|, |t| ≤ `half_width`. Square (u, v): u grows to the right, v downward, as the projector sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pattern {
    squares: usize,
    half_width: f64,
}

impl Pattern {
    /// The most squares a side: more than any projector resolves.
    pub const MAX_SQUARES: usize = 1024;

    /// M = `squares` a side over a pattern of `half_width` h, the tangent of half the angle it spans.
    ///
    /// # Errors
    /// If M is not in 1 ..= 1024, or h not in 10⁻⁶ ..= 10.
    pub fn new(squares: usize, half_width: f64) -> Result<Self, BasisError> {
        if !(1..=Self::MAX_SQUARES).contains(&squares) {
            return Err(BasisError::OutOfRange { name: "squares", expected: "1 to 1024", found: squares.to_string() });
        }
        if !(1e-6..=10.0).contains(&half_width) {
            return Err(BasisError::OutOfRange {
                name: "half_width",
                expected: "the tangent of half the pattern's angle, 0.000001 to 10",
                found: half_width.to_string(),
            });
        }
        Ok(Self { squares, half_width })
    }

    /// M, squares a side.
    pub fn squares(&self) -> usize {
        self.squares
    }

    /// h, the tangent of half the angle the pattern spans.
    pub fn half_width(&self) -> f64 {
        self.half_width
    }

    /// The square that (s, t) falls in; `None` outside the pattern.
    pub fn square_at(&self, s: f64, t: f64) -> Option<(usize, usize)> {
        let m = self.squares as f64;
        let u = ((s / self.half_width + 1.0) / 2.0 * m).floor();
        let v = ((1.0 - t / self.half_width) / 2.0 * m).floor();
        (u >= 0.0 && u < m && v >= 0.0 && v < m).then_some((u as usize, v as usize))
    }

    /// The point of square (u, v) at the fractions `a` (rightward) and `b` (downward) of its sides, each in [0, 1).
    pub fn point_in_square(&self, u: usize, v: usize, a: f64, b: f64) -> (f64, f64) {
        let side = 2.0 * self.half_width / self.squares as f64;
        (-self.half_width + (u as f64 + a) * side, self.half_width - (v as f64 + b) * side)
    }

    /// ∫ cosθa dω over square (u, v) = ∫ cos⁴a ds dt, sr: what the square adds to |Ωᵢ| per unit patch area.
    pub fn projected_solid_angle(&self, u: usize, v: usize) -> f64 {
        let (s0, t1) = self.point_in_square(u, v, 0.0, 0.0);
        let (s1, t0) = self.point_in_square(u, v, 1.0, 1.0);
        let corner = projected_solid_angle_to_corner;
        corner(s1, t1) - corner(s0, t1) - corner(s1, t0) + corner(s0, t0)
    }
}

/// ∫₀ˢ∫₀ᵗ (1 + x² + y²)⁻² dy dx: the configuration factor of a rectangle with one corner on the axis, times π.
fn projected_solid_angle_to_corner(s: f64, t: f64) -> f64 {
    let root_s = (1.0 + s * s).sqrt();
    let root_t = (1.0 + t * t).sqrt();
    0.5 * (s / root_s * (t / root_s).atan() + t / root_t * (s / root_t).atan())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_closed_form_agrees_with_a_sum_over_a_fine_grid() {
        let pattern = Pattern::new(5, 0.45).unwrap();
        let side = 2.0 * 0.45 / 5.0;
        for (u, v) in [(0, 0), (2, 2), (4, 1), (3, 4)] {
            let n = 200;
            let mut sum = 0.0;
            for i in 0..n {
                for j in 0..n {
                    let (s, t) =
                        pattern.point_in_square(u, v, (i as f64 + 0.5) / n as f64, (j as f64 + 0.5) / n as f64);
                    sum += (1.0 + s * s + t * t).powi(-2);
                }
            }
            sum *= (side / n as f64).powi(2);
            let closed = pattern.projected_solid_angle(u, v);
            assert!((closed / sum - 1.0).abs() < 1e-6, "square ({u}, {v}): {closed} against {sum}");
        }
    }

    #[test]
    fn a_pattern_that_opens_wide_sees_the_whole_projected_hemisphere() {
        // ∫ cosθ dω over the hemisphere is π; |s|, |t| ≤ 10 leaves out little.
        let whole = Pattern::new(1, 10.0).unwrap().projected_solid_angle(0, 0);
        assert!((whole - std::f64::consts::PI).abs() < 0.04, "{whole}");
    }
}
