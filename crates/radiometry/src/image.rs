//! A picture whose type says what its numbers mean.
//!
//! Counts of a camera, radiance, transfer and display codes are all three numbers a pixel, and mixing them up is the
//! commonest mistake in this field. Here each is a type of its own: adding counts to radiance does not compile.
//!
//! ```compile_fail
//! use relumine_radiometry::{Counts, Image, Radiance};
//! let photograph = Image::<Counts>::black(4, 3);
//! let mut sum = Image::<Radiance>::black(4, 3);
//! sum.add_scaled(&photograph, [1.0; 3]); // counts are not radiance
//! ```

use std::fmt::Debug;
use std::marker::PhantomData;

/// What the samples of an [`Image`] measure.
pub trait Quantity: Send + Sync + 'static {
    /// The type of one sample.
    type Sample: Copy + Default + PartialEq + Debug + Send + Sync;
    /// The name for messages, with the unit.
    const NAME: &'static str;
}

/// Quantities whose samples are linear: they may be scaled and added among themselves.
pub trait Linearity: Quantity<Sample = f32> {}

macro_rules! quantity {
    ($(#[$doc:meta])* $name:ident, $sample:ty, $text:literal) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $name {}
        impl Quantity for $name {
            type Sample = $sample;
            const NAME: &'static str = $text;
        }
    };
}

quantity!(
    /// What an analogue-to-digital converter gave, 0 … 65535, before black level and response.
    Counts, u16, "counts"
);
quantity!(
    /// Linear samples as a float picture file holds them; only its reader knows what they measure
    /// (see [`Image::reinterpret`]).
    Linear, f32, "linear samples"
);
quantity!(
    /// Scene radiance, W·m⁻²·sr⁻¹ (or a constant multiple, where the camera is not calibrated absolutely).
    Radiance, f32, "radiance [W·m⁻²·sr⁻¹]"
);
quantity!(
    /// Radiance towards the camera per unit incident radiance over one cell: Rᵢ of eq. 5, dimensionless.
    Transfer, f32, "transfer [1]"
);
quantity!(
    /// Display codes: sRGB-encoded, 0 … 1. Nothing may be added to these.
    Encoded, f32, "display codes [0…1]"
);

impl Linearity for Linear {}
impl Linearity for Radiance {}
impl Linearity for Transfer {}

/// An RGB picture, row 0 at the top, pixels in row-major order, of one [`Quantity`].
#[derive(Clone, Debug, PartialEq)]
pub struct Image<Q: Quantity> {
    width: usize,
    height: usize,
    pixels: Vec<[Q::Sample; 3]>,
    quantity: PhantomData<Q>,
}

impl<Q: Quantity> Image<Q> {
    /// A picture of `width` × `height` zero pixels.
    pub fn black(width: usize, height: usize) -> Self {
        Self { width, height, pixels: vec![[Q::Sample::default(); 3]; width * height], quantity: PhantomData }
    }

    /// Takes `width` × `height` pixels in row-major order.
    ///
    /// # Panics
    /// If the number of pixels is not `width * height`.
    pub fn from_pixels(width: usize, height: usize, pixels: Vec<[Q::Sample; 3]>) -> Self {
        assert_eq!(pixels.len(), width * height, "an image of {width} × {height} has {} pixels", width * height);
        Self { width, height, pixels, quantity: PhantomData }
    }

    /// Pixels in a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// `(width, height)`.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// All pixels, row-major.
    pub fn pixels(&self) -> &[[Q::Sample; 3]] {
        &self.pixels
    }

    /// All pixels, row-major, to change.
    pub fn pixels_mut(&mut self) -> &mut [[Q::Sample; 3]] {
        &mut self.pixels
    }

    /// The pixels themselves, row-major.
    pub fn into_pixels(self) -> Vec<[Q::Sample; 3]> {
        self.pixels
    }

    /// The pixel at column `x`, row `y`.
    pub fn pixel(&self, x: usize, y: usize) -> [Q::Sample; 3] {
        self.pixels[y * self.width + x]
    }
}

impl<Q: Linearity> Image<Q> {
    /// Adds `weight` times `other`, per channel.
    ///
    /// # Panics
    /// If the sizes differ.
    pub fn add_scaled(&mut self, other: &Self, weight: [f32; 3]) {
        assert_eq!(self.size(), other.size(), "pictures of different size do not add");
        for (sum, term) in self.pixels.iter_mut().zip(&other.pixels) {
            for channel in 0..3 {
                sum[channel] += weight[channel] * term[channel];
            }
        }
    }

    /// The same samples under another linear quantity, for the caller who knows the factor between them is one.
    pub fn reinterpret<P: Linearity>(self) -> Image<P> {
        Image::from_pixels(self.width, self.height, self.pixels)
    }
}
