//! The discrete Fourier transform of pictures whose sides are powers of two.

use std::f64::consts::TAU;
use std::ops::{Add, Mul, Sub};

use rayon::prelude::*;

/// A complex number.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Complex {
    pub(super) re: f32,
    pub(super) im: f32,
}

impl Complex {
    pub(super) fn conjugate(self) -> Self {
        Self { re: self.re, im: -self.im }
    }

    pub(super) fn scaled(self, factor: f32) -> Self {
        Self { re: self.re * factor, im: self.im * factor }
    }
}

impl Add for Complex {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { re: self.re + other.re, im: self.im + other.im }
    }
}

impl Sub for Complex {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self { re: self.re - other.re, im: self.im - other.im }
    }
}

impl Mul for Complex {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self { re: self.re * other.re - self.im * other.im, im: self.re * other.im + self.im * other.re }
    }
}

/// Σ f(x, y) exp(−2πi (x·ξ/width + y·η/height)) of a picture in row-major order; comes out transposed, `[ξ][η]`. Given a
/// transposed picture and the sides in that order, it comes back row-major: twice is the picture turned about, times its size.
///
/// # Panics
/// If a side is no power of two or the picture has another size.
pub(super) fn transformed(mut picture: Vec<Complex>, width: usize, height: usize) -> Vec<Complex> {
    assert!(width.is_power_of_two() && height.is_power_of_two() && picture.len() == width * height);
    rows(&mut picture, width);
    let mut columns = vec![Complex::default(); picture.len()];
    columns.par_chunks_exact_mut(height).enumerate().for_each(|(x, column)| {
        column.iter_mut().enumerate().for_each(|(y, value)| *value = picture[y * width + x]);
    });
    rows(&mut columns, height);
    columns
}

/// Each row by itself: Cooley and Tukey's radix 2, decimation in time.
fn rows(picture: &mut [Complex], length: usize) {
    let turns: Vec<Complex> = (0..length / 2)
        .map(|index| {
            let (sin, cos) = (-TAU * index as f64 / length as f64).sin_cos();
            Complex { re: cos as f32, im: sin as f32 }
        })
        .collect();
    let bits = length.trailing_zeros();
    picture.par_chunks_exact_mut(length).for_each(|row| {
        for index in 0..length {
            let other = if bits == 0 { 0 } else { index.reverse_bits() >> (usize::BITS - bits) };
            if index < other {
                row.swap(index, other);
            }
        }
        let mut half = 1;
        while half < length {
            let stride = length / (2 * half);
            for block in row.chunks_exact_mut(2 * half) {
                let (low, high) = block.split_at_mut(half);
                for (index, (low, high)) in low.iter_mut().zip(high).enumerate() {
                    let turned = *high * turns[index * stride];
                    (*low, *high) = (*low + turned, *low - turned);
                }
            }
            half *= 2;
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_transform_is_the_sum_it_says() {
        let (width, height) = (8, 4);
        let picture: Vec<Complex> = (0..32)
            .map(|index| Complex { re: (index * index % 7) as f32 - 3.0, im: (index * 5 % 11) as f32 / 3.0 })
            .collect();
        let found = transformed(picture.clone(), width, height);
        for xi in 0..width {
            for eta in 0..height {
                let mut sum = (0.0, 0.0);
                for (index, value) in picture.iter().enumerate() {
                    let (x, y) = (index % width, index / width);
                    let angle = -TAU * ((x * xi) as f64 / width as f64 + (y * eta) as f64 / height as f64);
                    let (re, im) = (f64::from(value.re), f64::from(value.im));
                    sum.0 += re * angle.cos() - im * angle.sin();
                    sum.1 += re * angle.sin() + im * angle.cos();
                }
                let value = found[xi * height + eta];
                assert!((f64::from(value.re) - sum.0).abs() < 1e-4 && (f64::from(value.im) - sum.1).abs() < 1e-4);
            }
        }
        let back = transformed(found, height, width);
        for (index, value) in picture.iter().enumerate() {
            let (x, y) = (index % width, index / width);
            let turned = back[(height - y) % height * width + (width - x) % width];
            assert!((turned.re / 32.0 - value.re).abs() < 1e-5 && (turned.im / 32.0 - value.im).abs() < 1e-5);
        }
    }
}
