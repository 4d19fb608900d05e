//! Where the pattern lies in a photograph of a flat card: the homography from its four corners.

use super::ProjectorError;
use crate::Homography;

/// A map from the pattern, 0 … 1 to the right and 0 … 1 downward, to pixels of a photograph.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PatternView(Homography);

impl PatternView {
    /// From the places of the upper left, upper right, lower right and lower left corner **as the projector sees the card**, pixels from
    /// the photograph's upper left corner (the middle of the first pixel is at 0.5, 0.5).
    ///
    /// # Errors
    /// If they are not the corners, in order, of a convex quadrilateral of at least a pixel.
    pub fn from_corners(corners: [[f64; 2]; 4]) -> Result<Self, ProjectorError> {
        let fail = |reason: &str| Err(ProjectorError::Corners(format!("{reason}, found {corners:?}")));
        if corners.iter().flatten().any(|value| value.is_nan() || value.abs() > 1e6) {
            return fail("expected pixels");
        }
        let turn = |index: usize| {
            let [a, b, c] = [0, 1, 2].map(|step| corners[(index + step) % 4]);
            (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])
        };
        let turns = [turn(0), turn(1), turn(2), turn(3)];
        if !(turns.iter().all(|turn| *turn > 1.0) || turns.iter().all(|turn| *turn < -1.0)) {
            return fail("expected four corners of a convex area, one after the other around it");
        }
        let pattern = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let pairs: Vec<_> = pattern.into_iter().zip(corners).collect();
        Homography::fit(&pairs).map(Self).map_or_else(|| fail("expected corners of an area"), Ok)
    }

    /// The pixel where the point (x, y) of the pattern is seen.
    pub fn pixel(&self, x: f64, y: f64) -> [f64; 2] {
        self.0.apply([x, y])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_go_to_corners_and_lines_stay_lines() {
        let corners = [[10.0, 12.0], [90.0, 5.0], [80.0, 70.0], [20.0, 60.0]];
        let view = PatternView::from_corners(corners).unwrap();
        for (corner, (x, y)) in corners.iter().zip([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]) {
            let [found_x, found_y] = view.pixel(x, y);
            assert!((found_x - corner[0]).abs() < 1e-9 && (found_y - corner[1]).abs() < 1e-9);
        }
        // The diagonals meet in the pattern's middle.
        let [x, y] = view.pixel(0.5, 0.5);
        for [from, to] in [[corners[0], corners[2]], [corners[1], corners[3]]] {
            let cross = (to[0] - from[0]) * (y - from[1]) - (to[1] - from[1]) * (x - from[0]);
            assert!(cross.abs() < 1e-9);
        }
        // A mirrored view is one too.
        assert!(PatternView::from_corners([corners[1], corners[0], corners[3], corners[2]]).is_ok());
    }

    #[test]
    fn corners_that_span_nothing_are_refused() {
        for corners in [
            [[0.0, 0.0], [10.0, 10.0], [10.0, 0.0], [0.0, 10.0]],
            [[0.0, 0.0], [5.0, 0.0], [10.0, 0.0], [0.0, 10.0]],
            [[0.0, 0.0]; 4],
            [[0.0, 0.0], [10.0, 0.0], [f64::NAN, 10.0], [0.0, 10.0]],
        ] {
            assert!(matches!(PatternView::from_corners(corners), Err(ProjectorError::Corners(_))), "{corners:?}");
        }
    }
}
