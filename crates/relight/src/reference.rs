//! The plain version.

use relumine_basis::Coefficients;
use relumine_field::{FieldError, ReflectanceField};
use relumine_radiometry::{Image, Radiance};

/// Σ lᵢ Rᵢ, cell by cell in double precision.
///
/// # Errors
/// If the field cannot be read.
pub fn relight_reference(field: &ReflectanceField, light: &Coefficients) -> Result<Image<Radiance>, FieldError> {
    let (width, height) = field.picture_size();
    let mut sum = vec![[0.0f64; 3]; width * height];
    for (cell, coefficient) in light.values().iter().enumerate().filter(|(_, l)| **l != [0.0; 3]) {
        for (sum, transfer) in sum.iter_mut().zip(field.transfer(cell)?.pixels()) {
            for channel in 0..3 {
                sum[channel] += f64::from(coefficient[channel]) * f64::from(transfer[channel]);
            }
        }
    }
    Ok(Image::from_pixels(width, height, sum.into_iter().map(|pixel| pixel.map(|sample| sample as f32)).collect()))
}
