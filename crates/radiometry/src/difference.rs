//! How far two pictures are apart.

use crate::{Image, Linearity};

/// Error figures of a picture against a reference, over the pixels of a mask and all three channels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// ‖A − B‖ / ‖B‖.
    pub relative_l2: f64,
    /// mean(A) / mean(B).
    pub ratio_of_means: f64,
    /// Root mean square of A − B.
    pub rmse: f64,
    /// Peak signal to noise ratio, dB, the peak being the largest sample of B; infinite for equal pictures.
    pub psnr_db: f64,
    /// The factor A was multiplied with first.
    pub scale: f64,
    /// Pixels compared.
    pub pixels: usize,
}

/// Compares `a` with the reference `b` where `mask` is true (everywhere without one). With `fit_scale`, `a` is first
/// multiplied with the one factor that brings it nearest to `b`. `None` if no pixel is left or the reference is black.
///
/// # Panics
/// If the pictures or the mask differ in size.
pub fn difference<Q: Linearity>(
    a: &Image<Q>,
    b: &Image<Q>,
    mask: Option<&[bool]>,
    fit_scale: bool,
) -> Option<Difference> {
    assert_eq!(a.size(), b.size(), "pictures of different size");
    assert!(mask.is_none_or(|mask| mask.len() == b.pixels().len()), "a mask of another size");
    let compared = |index: usize| mask.is_none_or(|mask| mask[index]);
    let samples = || {
        let pairs = a.pixels().iter().zip(b.pixels()).enumerate().filter(|(index, _)| compared(*index));
        pairs.flat_map(|(_, (a, b))| (0..3).map(|c| (f64::from(a[c]), f64::from(b[c]))))
    };
    let (mut aa, mut ab, mut bb, mut sum_a, mut sum_b, mut peak, mut count) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0f64, 0);
    for (a, b) in samples() {
        aa += a * a;
        ab += a * b;
        bb += b * b;
        sum_a += a;
        sum_b += b;
        peak = peak.max(b);
        count += 1;
    }
    if count == 0 || bb == 0.0 {
        return None;
    }
    let scale = if fit_scale && aa > 0.0 { ab / aa } else { 1.0 };
    let error: f64 = samples().map(|(a, b)| (scale * a - b).powi(2)).sum();
    let rmse = (error / f64::from(count)).sqrt();
    Some(Difference {
        relative_l2: (error / bb).sqrt(),
        ratio_of_means: scale * sum_a / sum_b,
        rmse,
        psnr_db: 20.0 * (peak / rmse).log10(),
        scale,
        pixels: count as usize / 3,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Radiance;

    fn ramp(gain: f32) -> Image<Radiance> {
        Image::from_pixels(10, 1, (0..10).map(|i| [gain * i as f32; 3]).collect())
    }

    #[test]
    fn a_scaled_picture_is_as_far_away_as_its_scale_says() {
        let figures = difference(&ramp(1.1), &ramp(1.0), None, false).unwrap();
        assert!((figures.relative_l2 - 0.1).abs() < 1e-6 && (figures.ratio_of_means - 1.1).abs() < 1e-6);
        let fitted = difference(&ramp(1.1), &ramp(1.0), None, true).unwrap();
        assert!(fitted.relative_l2 < 1e-6 && (fitted.scale - 1.0 / 1.1).abs() < 1e-6);
        assert_eq!(difference(&ramp(1.0), &ramp(1.0), None, false).unwrap().psnr_db, f64::INFINITY);
    }

    #[test]
    fn the_mask_limits_and_nothing_is_no_figure() {
        let mask: Vec<bool> = (0..10).map(|i| i < 3).collect();
        assert_eq!(difference(&ramp(2.0), &ramp(1.0), Some(&mask), false).unwrap().pixels, 3);
        assert_eq!(difference(&ramp(2.0), &ramp(1.0), Some(&[false; 10]), false), None);
        assert_eq!(difference(&ramp(2.0), &ramp(0.0), None, false), None);
    }
}
