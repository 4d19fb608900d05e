//! From one colour a site to three a pixel: the linear filters of H. S. Malvar, L.-W. He, R. Cutler, *High-quality linear
//! interpolation for demosaicing of Bayer-patterned color images*, ICASSP 2004.
//!
//! Every missing colour is the mean of its neighbours (bilinear) plus a share of the Laplacian of the colour that is there.
//! Where one of the samples of that Laplacian is clipped, and at the edges, the mean alone is taken; where one of the mean is
//! clipped, so is the result.

use rayon::prelude::*;

/// Samples of a sensor under a Bayer array, black already at 0.
pub(super) struct Mosaic<'a> {
    pub(super) samples: &'a [f32],
    pub(super) width: usize,
    pub(super) height: usize,
    /// The colour (0 red, 1 green, 2 blue) at [row % 2][column % 2].
    pub(super) colours: [[usize; 2]; 2],
    /// Samples from here on are clipped.
    pub(super) white: f32,
}

/// Red, green and blue of every pixel, row-major. At least 2 × 2 sites.
pub(super) fn demosaic(mosaic: &Mosaic<'_>) -> Vec<[f32; 3]> {
    let mut pixels = vec![[0.0; 3]; mosaic.width * mosaic.height];
    pixels.par_chunks_mut(mosaic.width).enumerate().for_each(|(y, row)| {
        row.iter_mut().enumerate().for_each(|(x, pixel)| *pixel = mosaic.pixel(x, y));
    });
    pixels
}

/// Neighbours from which a colour is averaged.
const CROSS: [(isize, isize); 4] = [(-1, 0), (1, 0), (0, -1), (0, 1)];
const CORNERS: [(isize, isize); 4] = [(-1, -1), (1, -1), (-1, 1), (1, 1)];
const ROW: [(isize, isize); 2] = [(-1, 0), (1, 0)];
const COLUMN: [(isize, isize); 2] = [(0, -1), (0, 1)];

impl Mosaic<'_> {
    fn colour(&self, x: usize, y: usize) -> usize {
        self.colours[y % 2][x % 2]
    }

    /// A site that the sensor does not have is mirrored at its edge, which keeps the colour.
    fn sample(&self, x: usize, y: usize, dx: isize, dy: isize) -> f32 {
        let mirrored = |at: usize, by: isize, length: usize| {
            let moved = at as isize + by;
            let last = length as isize - 1;
            let back = if moved < 0 { -moved } else { moved };
            (if back > last { 2 * last - back } else { back }).clamp(0, last) as usize
        };
        self.samples[mirrored(y, dy, self.height) * self.width + mirrored(x, dx, self.width)]
    }

    fn pixel(&self, x: usize, y: usize) -> [f32; 3] {
        let own = self.colour(x, y);
        std::array::from_fn(|colour| {
            if colour == own {
                return self.samples[y * self.width + x];
            }
            if own != 1 {
                return if colour == 1 { self.green(x, y) } else { self.opposite(x, y) };
            }
            let beside = if x + 1 < self.width { self.colour(x + 1, y) } else { self.colour(x - 1, y) };
            self.beside_green(x, y, beside == colour)
        })
    }

    /// Green at red or blue: the cross, and half the Laplacian of the site's own colour.
    fn green(&self, x: usize, y: usize) -> f32 {
        let far = [(-2, 0), (2, 0), (0, -2), (0, 2)];
        self.interpolated(x, y, &CROSS, |at| 0.5 * (at(0, 0) - mean(&far, at)))
    }

    /// Red at blue and blue at red: the corners, and 3/4 of the Laplacian.
    fn opposite(&self, x: usize, y: usize) -> f32 {
        let far = [(-2, 0), (2, 0), (0, -2), (0, 2)];
        self.interpolated(x, y, &CORNERS, |at| 0.75 * (at(0, 0) - mean(&far, at)))
    }

    /// Red or blue at green, from the row or the column that has it: 5/8 of a Laplacian of nine greens.
    fn beside_green(&self, x: usize, y: usize, in_row: bool) -> f32 {
        let along: [(isize, isize); 2] = if in_row { [(-2, 0), (2, 0)] } else { [(0, -2), (0, 2)] };
        let across: [(isize, isize); 2] = if in_row { [(0, -2), (0, 2)] } else { [(-2, 0), (2, 0)] };
        self.interpolated(x, y, if in_row { &ROW } else { &COLUMN }, |at| {
            // 5 × centre − the four corners − the two along + half the two across, all over 8.
            (5.0 * at(0, 0) - 4.0 * mean(&CORNERS, at) - 2.0 * mean(&along, at) + mean(&across, at)) / 8.0
        })
    }

    fn interpolated(
        &self,
        x: usize,
        y: usize,
        neighbours: &[(isize, isize)],
        detail: impl Fn(&dyn Fn(isize, isize) -> f32) -> f32,
    ) -> f32 {
        let at = |dx: isize, dy: isize| self.sample(x, y, dx, dy);
        if neighbours.iter().any(|(dx, dy)| at(*dx, *dy) >= self.white) {
            return self.white;
        }
        let mean = mean(neighbours, &at);
        let inside = x >= 2 && y >= 2 && x + 2 < self.width && y + 2 < self.height;
        let clipped = || (-2..=2).any(|dy| (-2..=2).any(|dx| at(dx, dy) >= self.white));
        if !inside || clipped() { mean } else { (mean + detail(&at)).min(self.white) }
    }
}

fn mean(places: &[(isize, isize)], at: &dyn Fn(isize, isize) -> f32) -> f32 {
    places.iter().map(|(dx, dy)| at(*dx, *dy)).sum::<f32>() / places.len() as f32
}
