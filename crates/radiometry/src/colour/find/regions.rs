//! Regions of even colour that may be patches.

use crate::colour::Photograph;

/// The longer side of the picture that is searched, pixels, at most.
const SIDE: usize = 1000;
/// Steepest difference between neighbours inside a region, of the range of cube roots: one after the other, since noise
/// asks for a large one and patches that touch dark surrounds for a small one.
const EVENNESS: [f32; 7] = [0.012, 0.018, 0.027, 0.04, 0.06, 0.09, 0.13];
/// A region has at least so many pixels, and at most this share of the picture.
const FEWEST_PIXELS: usize = 16;
const LARGEST_SHARE: f64 = 0.05;
/// Area over the root of the determinant of the second moments: 12 for any parallelogram, 12.57 for an ellipse, less for what
/// has holes or arms.
const COMPACTNESS: std::ops::Range<f64> = 10.6..12.7;
/// The longest over the shortest axis of the second moments, squared.
const LONGEST: f64 = 5.0;
/// More regions than any chart has patches; the most compact are kept.
const MOST_REGIONS: usize = 4000;

/// A photograph reduced by averaging, as cube roots of its channels over what all but the brightest pixels have.
pub(super) struct Reduced {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) pixels: Vec<[f32; 3]>,
    factor: usize,
}

/// A region of even colour.
#[derive(Clone, Copy, Debug)]
pub(super) struct Region {
    /// Its centre, pixels of the reduced picture.
    pub(super) centre: [f64; 2],
    /// Pixels.
    pub(super) area: f64,
    /// How far its compactness is from a parallelogram's.
    shape: f64,
}

impl Reduced {
    pub(super) fn of(photograph: &Photograph) -> Self {
        let image = photograph.linear();
        let factor = image.width().max(image.height()).div_ceil(SIDE);
        let (width, height) = ((image.width() / factor).max(1), (image.height() / factor).max(1));
        let mut pixels = vec![[0.0f32; 3]; width * height];
        for (index, pixel) in pixels.iter_mut().enumerate() {
            let (left, top) = (index % width * factor, index / width * factor);
            let (right, bottom) = ((left + factor).min(image.width()), (top + factor).min(image.height()));
            let count = ((right - left) * (bottom - top)) as f32;
            for y in top..bottom {
                for x in left..right {
                    let source = image.pixel(x, y);
                    (0..3).for_each(|channel| pixel[channel] += source[channel] / count);
                }
            }
        }
        let mut reduced = Self { width, height, pixels, factor };
        reduced.stretch();
        reduced
    }

    /// Each channel over its 99th percentile, cube root, then a mean over 3 × 3 pixels against noise.
    fn stretch(&mut self) {
        for channel in 0..3 {
            let mut sorted: Vec<f32> = self.pixels.iter().map(|pixel| pixel[channel]).collect();
            sorted.sort_unstable_by(f32::total_cmp);
            let bright = sorted[(sorted.len() - 1) * 99 / 100];
            let scale = if bright > 0.0 { 1.0 / bright } else { 0.0 };
            self.pixels.iter_mut().for_each(|p| p[channel] = (p[channel] * scale).clamp(0.0, 2.0).cbrt());
        }
        let source = self.pixels.clone();
        for (index, pixel) in self.pixels.iter_mut().enumerate() {
            let (x, y) = (index % self.width, index / self.width);
            let (mut sum, mut count) = ([0.0f32; 3], 0.0);
            for row in y.saturating_sub(1)..(y + 2).min(self.height) {
                for neighbour in &source[row * self.width..][x.saturating_sub(1)..(x + 2).min(self.width)] {
                    (0..3).for_each(|channel| sum[channel] += neighbour[channel]);
                    count += 1.0;
                }
            }
            *pixel = sum.map(|sum| sum / count);
        }
    }

    /// A point of the reduced picture in the photograph.
    pub(super) fn to_photograph(&self, point: [f64; 2]) -> [f64; 2] {
        point.map(|value| value * self.factor as f64)
    }

    /// The largest difference in any channel among the 3 × 3 pixels round each one.
    fn steepness(&self) -> Vec<f32> {
        let (width, height) = (self.width, self.height);
        let mut steepness = vec![f32::MAX; width * height];
        for y in 1..height.saturating_sub(1) {
            for x in 1..width.saturating_sub(1) {
                let (mut low, mut high) = ([f32::MAX; 3], [f32::MIN; 3]);
                for row in y - 1..=y + 1 {
                    for pixel in &self.pixels[row * width + x - 1..=row * width + x + 1] {
                        for channel in 0..3 {
                            low[channel] = low[channel].min(pixel[channel]);
                            high[channel] = high[channel].max(pixel[channel]);
                        }
                    }
                }
                steepness[y * width + x] = (0..3).map(|channel| high[channel] - low[channel]).fold(0.0, f32::max);
            }
        }
        steepness
    }
}

/// The regions that may be patches, the largest first; of those round one centre the largest.
pub(super) fn regions(picture: &Reduced) -> Vec<Region> {
    let steepness = picture.steepness();
    let mut found: Vec<Region> =
        EVENNESS.iter().flat_map(|limit| connected(&steepness, picture.width, *limit)).collect();
    found.sort_by(|a, b| a.shape.total_cmp(&b.shape));
    found.truncate(2 * MOST_REGIONS);
    found.sort_by(|a, b| b.area.total_cmp(&a.area));
    let mut kept: Vec<Region> = Vec::new();
    for region in found {
        let doubled = |other: &Region| {
            let distance = (other.centre[0] - region.centre[0]).hypot(other.centre[1] - region.centre[1]);
            distance < 0.4 * region.area.sqrt() && other.area < 4.0 * region.area
        };
        if kept.len() < MOST_REGIONS && !kept.iter().any(doubled) {
            kept.push(region);
        }
    }
    kept
}

/// The connected parts that are less steep than `limit` and compact.
fn connected(steepness: &[f32], width: usize, limit: f32) -> Vec<Region> {
    let mut free: Vec<bool> = steepness.iter().map(|value| *value < limit).collect();
    let largest = (LARGEST_SHARE * steepness.len() as f64) as usize;
    let (mut regions, mut waiting) = (Vec::new(), Vec::new());
    for start in 0..free.len() {
        if !std::mem::take(&mut free[start]) {
            continue;
        }
        waiting.push(start);
        let (mut area, mut sum, mut square) = (0usize, [0.0; 2], [0.0; 3]);
        // Moments about the first pixel, so that large coordinates cost no digits.
        let origin = [(start % width) as f64, (start / width) as f64];
        while let Some(index) = waiting.pop() {
            let (x, y) = ((index % width) as f64 - origin[0], (index / width) as f64 - origin[1]);
            area += 1;
            sum = [sum[0] + x, sum[1] + y];
            square = [square[0] + x * x, square[1] + x * y, square[2] + y * y];
            // Pixels at the border are never even, so that all four neighbours exist.
            for neighbour in [index - 1, index + 1, index - width, index + width] {
                if std::mem::take(&mut free[neighbour]) {
                    waiting.push(neighbour);
                }
            }
        }
        if (FEWEST_PIXELS..=largest).contains(&area) {
            regions.extend(region(area as f64, origin, sum, square));
        }
    }
    regions
}

/// The region of these moments, if it is compact.
fn region(area: f64, origin: [f64; 2], sum: [f64; 2], square: [f64; 3]) -> Option<Region> {
    let mean = sum.map(|sum| sum / area);
    // A pixel is a square itself: 1/12 of second moment in x and y.
    let xx = square[0] / area - mean[0] * mean[0] + 1.0 / 12.0;
    let xy = square[1] / area - mean[0] * mean[1];
    let yy = square[2] / area - mean[1] * mean[1] + 1.0 / 12.0;
    let determinant = xx * yy - xy * xy;
    let spread = (0.25 * (xx - yy).powi(2) + xy * xy).sqrt();
    let (long, short) = (0.5 * (xx + yy) + spread, 0.5 * (xx + yy) - spread);
    let compactness = area / determinant.sqrt();
    let centre = [0, 1].map(|axis| origin[axis] + mean[axis] + 0.5);
    (COMPACTNESS.contains(&compactness) && long < LONGEST * short).then(|| Region {
        centre,
        area,
        shape: (compactness - 12.0).abs(),
    })
}
