//! Pictures made small: means over blocks of pixels.

/// How a picture is reduced to one of at most so many pixels a side.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reduction {
    /// Pixels a side of a block.
    pub(super) block: usize,
    /// Pixels of the picture.
    pub(super) from: (usize, usize),
    /// Pixels of the small one.
    pub(super) size: (usize, usize),
}

impl Reduction {
    pub(super) fn new(from: (usize, usize), longest: usize) -> Self {
        let block = from.0.max(from.1).div_ceil(longest).max(1);
        Self { block, from, size: (from.0.div_ceil(block), from.1.div_ceil(block)) }
    }

    /// Number of small pixels.
    pub(super) fn len(&self) -> usize {
        self.size.0 * self.size.1
    }

    /// The small pixel that a pixel, counted row by row, belongs to.
    pub(super) fn index(&self, pixel: usize) -> usize {
        pixel / self.from.0 / self.block * self.size.0 + pixel % self.from.0 / self.block
    }

    /// The mean of all channels over each block; NaN where `trusted` is false of any of its pixels.
    pub(super) fn mean(&self, pixels: &[[f32; 3]], trusted: impl Fn(usize) -> bool) -> Vec<f32> {
        let mut sums = vec![(0.0f64, 0u32); self.len()];
        for (pixel, value) in pixels.iter().enumerate() {
            let (sum, count) = &mut sums[self.index(pixel)];
            *sum += if trusted(pixel) { f64::from(value[0] + value[1] + value[2]) } else { f64::NAN };
            *count += 3;
        }
        sums.into_iter().map(|(sum, count)| (sum / f64::from(count)) as f32).collect()
    }
}
