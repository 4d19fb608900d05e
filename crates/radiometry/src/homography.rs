//! A flat thing in a photograph, a chart or a card: a projective map of the plane.

use crate::solve::least_squares;

/// A projective map of the plane, from coordinates of a flat thing to pixels. Pixel (x, y) covers x … x + 1, its centre lies at ½.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Homography([f64; 9]);

impl Homography {
    /// The map that sends each first point nearest to its second, in the algebraic sense, on coordinates moved to their mean
    /// and scaled to their spread (R. Hartley, "In Defense of the Eight-Point Algorithm", 1997). Exact for four pairs. `None` for
    /// fewer than four pairs, or if they leave the map open (three on a line).
    pub fn fit(pairs: &[([f64; 2], [f64; 2])]) -> Option<Self> {
        let (from, to) =
            (Normalisation::of(pairs.iter().map(|pair| pair.0))?, Normalisation::of(pairs.iter().map(|p| p.1))?);
        let mut rows = Vec::with_capacity(2 * pairs.len());
        for (a, b) in pairs {
            let ([x, y], [u, v]) = (from.apply(*a), to.apply(*b));
            rows.push(([x, y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y], u));
            rows.push(([0.0, 0.0, 0.0, x, y, 1.0, -v * x, -v * y], v));
        }
        let [a, b, c, d, e, f, g, h] = least_squares::<8>(&rows)?;
        // Undo both normalisations.
        let m = [a, b, c, d, e, f, g, h, 1.0];
        let (s, [tx, ty]) = (from.scale, from.centre);
        let mut whole = [0.0; 9];
        for row in 0..3 {
            let [p, q, r] = [m[3 * row], m[3 * row + 1], m[3 * row + 2]];
            whole[3 * row..3 * row + 3].copy_from_slice(&[p * s, q * s, r - s * (p * tx + q * ty)]);
        }
        let (s, [tx, ty]) = (to.scale, to.centre);
        for column in 0..3 {
            let last = whole[6 + column];
            whole[column] = whole[column] / s + tx * last;
            whole[3 + column] = whole[3 + column] / s + ty * last;
        }
        let map = Self(whole);
        // Four pairs of which three lie on a line fit, but send something to infinity: all points must be on one side.
        let depths: Vec<f64> = pairs.iter().map(|(a, _)| map.depth(*a)).collect();
        let sided = depths.iter().all(|depth| *depth > 0.0) || depths.iter().all(|depth| *depth < 0.0);
        (sided && map.determinant().abs() > 1e-12 && whole.iter().all(|value| value.is_finite())).then_some(map)
    }

    /// Where a point of the thing lies in the photograph; not finite on the line that goes to infinity.
    pub fn apply(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let m = &self.0;
        let depth = self.depth([x, y]);
        [(m[0] * x + m[1] * y + m[2]) / depth, (m[3] * x + m[4] * y + m[5]) / depth]
    }

    fn depth(&self, [x, y]: [f64; 2]) -> f64 {
        self.0[6] * x + self.0[7] * y + self.0[8]
    }

    /// Of the matrix whose rows have been scaled to length 1.
    fn determinant(&self) -> f64 {
        let m = &self.0;
        let lengths: f64 = m.chunks_exact(3).map(|row| row.iter().map(|v| v * v).sum::<f64>().sqrt()).product();
        (m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) + m[2] * (m[3] * m[7] - m[4] * m[6]))
            / lengths
    }
}

struct Normalisation {
    centre: [f64; 2],
    scale: f64,
}

impl Normalisation {
    fn of(points: impl Iterator<Item = [f64; 2]> + Clone) -> Option<Self> {
        let count = points.clone().count() as f64;
        let sum = points.clone().fold([0.0; 2], |sum, point| [sum[0] + point[0], sum[1] + point[1]]);
        let centre = sum.map(|sum| sum / count);
        let spread = points.map(|[x, y]| (x - centre[0]).hypot(y - centre[1])).sum::<f64>() / count;
        (spread > 0.0 && spread.is_finite()).then(|| Self { centre, scale: 1.0 / spread })
    }

    fn apply(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [(x - self.centre[0]) * self.scale, (y - self.centre[1]) * self.scale]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_corners_go_where_they_are_sent_and_lines_stay_straight() {
        let from = [[0.0, 0.0], [6.0, 0.0], [6.0, 4.0], [0.0, 4.0]];
        let to = [[100.0, 80.0], [700.0, 130.0], [650.0, 520.0], [90.0, 430.0]];
        let pairs: Vec<_> = from.into_iter().zip(to).collect();
        let map = Homography::fit(&pairs).unwrap();
        for (a, b) in &pairs {
            let found = map.apply(*a);
            assert!((found[0] - b[0]).abs() < 1e-9 && (found[1] - b[1]).abs() < 1e-9, "{found:?} {b:?}");
        }
        let [a, b, c] = [[0.0, 2.0], [3.0, 2.0], [6.0, 2.0]].map(|point| map.apply(point));
        let cross = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        assert!(cross.abs() < 1e-6, "three points of a line lie on a line, off by {cross}");
    }

    #[test]
    fn many_pairs_with_errors_come_near_the_true_map() {
        let corners = [[0.0, 0.0], [6.0, 0.0], [6.0, 4.0], [0.0, 4.0]];
        let to = [[100.0, 80.0], [700.0, 130.0], [650.0, 520.0], [90.0, 430.0]];
        let truth = Homography::fit(&corners.into_iter().zip(to).collect::<Vec<_>>()).unwrap();
        let pairs: Vec<_> = (0..24)
            .map(|i| {
                let point = [f64::from(i % 6) + 0.5, f64::from(i / 6) + 0.5];
                let [x, y] = truth.apply(point);
                (point, [x + 0.3 * f64::from(i * 7 % 5 - 2), y + 0.3 * f64::from(i * 11 % 5 - 2)])
            })
            .collect();
        let map = Homography::fit(&pairs).unwrap();
        for point in corners {
            let ([x, y], [u, v]) = (map.apply(point), truth.apply(point));
            assert!((x - u).hypot(y - v) < 1.0, "{point:?} lies {} pixels away", (x - u).hypot(y - v));
        }
    }

    #[test]
    fn corners_on_a_line_or_too_few_give_no_map() {
        let from = [[0.0, 0.0], [6.0, 0.0], [6.0, 4.0], [0.0, 4.0]];
        let line = [[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [3.0, 3.0]];
        let crossed = [[0.0, 0.0], [5.0, 5.0], [5.0, 0.0], [0.0, 5.0]];
        for to in [line, crossed, [[1.0, 1.0]; 4]] {
            assert_eq!(Homography::fit(&from.into_iter().zip(to).collect::<Vec<_>>()), None, "{to:?}");
        }
        assert_eq!(Homography::fit(&[([0.0; 2], [1.0; 2])]), None);
    }
}
