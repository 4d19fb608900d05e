//! From the camera's channels to linear Rec. 709: a matrix, or a root polynomial.

use rayon::prelude::*;

use super::space::{Matrix3, inverse, transform};
use crate::{Image, Linearity};

/// How a colour correction is computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Model {
    /// A 3 × 3 matrix: linear in light, so that it may be applied to a field.
    #[default]
    Matrix,
    /// A 3 × 6 matrix on R, G, B, √(RG), √(GB), √(RB): the root polynomial of degree 2 of G. Finlayson, M. Mackiewicz and A.
    /// Hurlbert, "Color Correction Using Root-Polynomial Regression" (2015). Twice as bright stays twice as bright, but the
    /// sum of two lights is not the sum of their pictures: for pictures, not for fields.
    RootPolynomial,
}

impl Model {
    /// The name on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Matrix => "matrix",
            Self::RootPolynomial => "root-polynomial",
        }
    }

    /// How many terms a channel is the sum of.
    pub fn terms(self) -> usize {
        match self {
            Self::Matrix => 3,
            Self::RootPolynomial => 6,
        }
    }

    /// The terms of camera RGB; roots of negative products are 0.
    pub(super) fn features(self, [r, g, b]: [f64; 3]) -> [f64; 6] {
        let root = |a: f64, b: f64| (a.max(0.0) * b.max(0.0)).sqrt();
        match self {
            Self::Matrix => [r, g, b, 0.0, 0.0, 0.0],
            Self::RootPolynomial => [r, g, b, root(r, g), root(g, b), root(r, b)],
        }
    }
}

/// A colour correction: camera RGB → linear Rec. 709 (D65).
///
/// Its scale is such that neutral colours keep their luminance: radiance stays in the unit it was in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correction {
    model: Model,
    /// Rows red, green, blue; the last three columns are 0 for a matrix.
    coefficients: [[f64; 6]; 3],
}

impl Correction {
    /// The correction by a matrix; rows red, green, blue.
    pub fn from_matrix(matrix: Matrix3) -> Self {
        let coefficients = matrix.map(|[r, g, b]| [r, g, b, 0.0, 0.0, 0.0]);
        Self { model: Model::Matrix, coefficients }
    }

    /// The correction by a root polynomial; rows red, green, blue on R, G, B, √(RG), √(GB), √(RB).
    pub fn from_root_polynomial(coefficients: [[f64; 6]; 3]) -> Self {
        Self { model: Model::RootPolynomial, coefficients }
    }

    /// How it is computed.
    pub fn model(&self) -> Model {
        self.model
    }

    /// The coefficients, rows red, green, blue, as many columns as the model has terms.
    pub fn coefficients(&self) -> [&[f64]; 3] {
        let terms = self.model.terms();
        [&self.coefficients[0][..terms], &self.coefficients[1][..terms], &self.coefficients[2][..terms]]
    }

    /// The matrix; `None` for what is not linear in light.
    pub fn matrix(&self) -> Option<Matrix3> {
        (self.model == Model::Matrix).then(|| self.coefficients.map(|[r, g, b, ..]| [r, g, b]))
    }

    /// What the camera would have shown; `None` for what is not linear in light, or a matrix without an inverse.
    pub fn inverse(&self) -> Option<Matrix3> {
        self.matrix().and_then(|matrix| inverse(&matrix))
    }

    /// Linear Rec. 709 of camera RGB. Colours outside of the gamut have negative channels; they are kept.
    pub fn apply(&self, camera: [f64; 3]) -> [f64; 3] {
        match self.matrix() {
            Some(matrix) => transform(&matrix, camera),
            None => {
                let features = self.model.features(camera);
                self.coefficients.map(|row| row.iter().zip(&features).map(|(a, b)| a * b).sum())
            }
        }
    }

    /// Corrects a picture; negative channels are kept.
    pub fn apply_to<Q: Linearity>(&self, picture: &mut Image<Q>) {
        picture.pixels_mut().par_iter_mut().with_min_len(1 << 12).for_each(|pixel| {
            *pixel = self.apply(pixel.map(f64::from)).map(|value| value as f32);
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Radiance;

    const ROOTS: [[f64; 6]; 3] =
        [[1.5, -0.2, 0.1, -0.3, 0.02, -0.1], [-0.1, 1.2, 0.05, 0.1, -0.2, 0.03], [0.02, -0.3, 1.4, 0.01, -0.1, -0.05]];

    #[test]
    fn a_matrix_is_linear_in_light_and_a_root_polynomial_in_exposure_only() {
        let (a, b) = ([0.3, 0.1, 0.02], [0.05, 0.2, 0.6]);
        let sum = [0, 1, 2].map(|channel| a[channel] + b[channel]);
        let matrix = Correction::from_matrix([[1.5, -0.4, -0.1], [-0.2, 1.3, -0.1], [0.1, -0.5, 1.4]]);
        let roots = Correction::from_root_polynomial(ROOTS);
        let off = |correction: Correction| {
            let ([p, q], s) = ([correction.apply(a), correction.apply(b)], correction.apply(sum));
            (0..3).map(|channel| (p[channel] + q[channel] - s[channel]).abs()).fold(0.0, f64::max)
        };
        assert!(off(matrix) < 1e-15 && off(roots) > 1e-3);
        for correction in [matrix, roots] {
            let (once, brighter) = (correction.apply(a), correction.apply(a.map(|value| 16.0 * value)));
            assert!((0..3).all(|channel| (brighter[channel] / once[channel] - 16.0).abs() < 1e-12));
        }
    }

    #[test]
    fn a_picture_keeps_its_negative_channels_and_goes_back() {
        let correction = Correction::from_matrix([[1.5, -0.4, -0.1], [-0.2, 1.3, -0.1], [0.1, -0.5, 1.4]]);
        let camera = [0.01f32, 0.9, 0.1];
        let mut picture = Image::<Radiance>::from_pixels(1, 1, vec![camera]);
        correction.apply_to(&mut picture);
        let corrected = picture.pixel(0, 0);
        assert!(corrected[0] < -0.3 && corrected[2] < 0.0);
        let back = transform(&correction.inverse().unwrap(), corrected.map(f64::from));
        assert!((0..3).all(|channel| (back[channel] - f64::from(camera[channel])).abs() < 1e-6));
        assert_eq!(Correction::from_root_polynomial(ROOTS).inverse(), None);
    }
}
