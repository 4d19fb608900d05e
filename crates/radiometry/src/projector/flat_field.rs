//! The flat field: the relative flux of each square, from a photograph of a white card.

use super::{PatternView, ProjectorError};
use crate::colour::white_balance;
use crate::{Image, Radiance};

/// A white card photographed while the projector shows white, and black.
#[derive(Clone, Copy)]
pub struct Card<'a> {
    /// The card under full white.
    pub white: &'a Image<Radiance>,
    /// The card under black, if it was photographed.
    pub black: Option<&'a Image<Radiance>>,
    /// Where a photograph can be believed (not clipped), row-major.
    pub trusted: &'a [bool],
    /// Where the pattern lies in it.
    pub view: PatternView,
}

/// What a card says of the projector.
#[derive(Clone, Debug, PartialEq)]
pub struct FlatField {
    /// Relative flux of square (u, v), `[v][u]`, as `square_flux` of capture.toml: 1 on the axis.
    pub square_flux: Vec<Vec<f64>>,
    /// Gains of red, green and blue that make the projector's white grey and keep its luminance ([`white_balance`]).
    pub white_balance: [f64; 3],
    /// b, the share of white that shines through black, mean over the pattern; `None` without a black frame.
    pub black_level: Option<f64>,
    /// By how much a channel's flux differs from the mean of all in a square, relative, at most: the projector's colour is not the same
    /// everywhere.
    pub colour_spread: f64,
}

/// Samples a side of a square.
const SAMPLES: usize = 24;
/// What is left out at each side of a square: edges of the pattern are soft.
const MARGIN: f64 = 0.1;

impl Card<'_> {
    /// Measures the flux of M × M squares.
    ///
    /// # Errors
    /// If the pattern does not lie inside the photograph, is clipped or as dark as black somewhere, or the pictures differ in size.
    pub fn flat_field(&self, squares: usize) -> Result<FlatField, ProjectorError> {
        let fail = |reason: String| Err(ProjectorError::Photograph(reason));
        if squares == 0 || squares > 4096 {
            return fail(format!("expected 1 to 4096 squares, found {squares}"));
        }
        if self.black.is_some_and(|black| black.size() != self.white.size())
            || self.trusted.len() != self.white.pixels().len()
        {
            return fail("the photographs of white and black differ in size".into());
        }
        let mut flux = Vec::with_capacity(squares * squares);
        let mut black = [0.0; 3];
        for (u, v) in (0..squares * squares).map(|square| (square % squares, square / squares)) {
            let [white, dark] = self.means(u, v, squares)?;
            let lit = [0, 1, 2].map(|channel| white[channel] - dark[channel]);
            if lit.iter().any(|value| *value <= 0.0) {
                return fail(format!(
                    "square ({u}, {v}) shows no more under white than under black: is the card there lit?"
                ));
            }
            (0..3).for_each(|channel| black[channel] += dark[channel]);
            flux.push((lit, white));
        }
        let by_channel = [0, 1, 2].map(|channel| flux.iter().map(|(lit, _)| lit[channel]).sum::<f64>());
        let Some(white_balance) = white_balance(by_channel) else {
            return fail(format!("the card shows {by_channel:?} under white: no light that could be balanced"));
        };
        // Each channel over its own mean, so that the projector's colour does not weigh.
        let relative: Vec<[f64; 3]> = flux
            .iter()
            .map(|(lit, _)| [0, 1, 2].map(|channel| lit[channel] * flux.len() as f64 / by_channel[channel]))
            .collect();
        let mean = |square: &[f64; 3]| square.iter().sum::<f64>() / 3.0;
        let spread =
            |square: &[f64; 3]| square.iter().map(|value| (value / mean(square) - 1.0).abs()).fold(0.0, f64::max);
        // The squares around the axis: one or four.
        let middle = [(squares - 1) / 2, squares / 2];
        let axis = middle.iter().flat_map(|v| middle.map(|u| mean(&relative[v * squares + u]))).sum::<f64>() / 4.0;
        let white: f64 = flux.iter().map(|(_, white)| white.iter().sum::<f64>()).sum();
        Ok(FlatField {
            square_flux: relative
                .chunks(squares)
                .map(|row| row.iter().map(|square| mean(square) / axis).collect())
                .collect(),
            white_balance,
            black_level: self.black.map(|_| black.iter().sum::<f64>() / white),
            colour_spread: relative.iter().map(spread).fold(0.0, f64::max),
        })
    }

    /// Mean radiance of the middle ninth of the pattern under white, per channel.
    ///
    /// # Errors
    /// If it does not lie inside the photograph, or is clipped.
    pub fn middle(&self) -> Result<[f64; 3], ProjectorError> {
        Ok(self.means(1, 1, 3)?[0])
    }

    /// Mean radiance of a square under white and under black (0 without a black frame), over its area on the card.
    fn means(&self, u: usize, v: usize, squares: usize) -> Result<[[f64; 3]; 2], ProjectorError> {
        let mut sums = [[0.0; 3]; 2];
        let step = |square: usize, index: usize| {
            let inside = MARGIN + (1.0 - 2.0 * MARGIN) * (index as f64 + 0.5) / SAMPLES as f64;
            (square as f64 + inside) / squares as f64
        };
        for (i, j) in (0..SAMPLES * SAMPLES).map(|index| (index % SAMPLES, index / SAMPLES)) {
            let pixel = self.view.pixel(step(u, i), step(v, j));
            let white = self.sample(self.white, pixel)?;
            let black = self.black.map_or(Ok([0.0; 3]), |black| self.sample(black, pixel))?;
            for channel in 0..3 {
                sums[0][channel] += white[channel];
                sums[1][channel] += black[channel];
            }
        }
        Ok(sums.map(|sum| sum.map(|value| value / (SAMPLES * SAMPLES) as f64)))
    }

    /// Bilinear between pixels.
    fn sample(&self, picture: &Image<Radiance>, [x, y]: [f64; 2]) -> Result<[f64; 3], ProjectorError> {
        let (width, height) = picture.size();
        if !(0.0..=width as f64).contains(&x) || !(0.0..=height as f64).contains(&y) {
            return Err(ProjectorError::Photograph(format!(
                "the pattern reaches to pixel ({x:.0}, {y:.0}), outside the photograph of {width} × {height}"
            )));
        }
        let place = |at: f64, side: usize| {
            let at = (at - 0.5).clamp(0.0, (side - 1) as f64);
            (at as usize, (at as usize + 1).min(side - 1), at.fract())
        };
        let ((left, right, fx), (top, bottom, fy)) = (place(x, width), place(y, height));
        let mut sum = [0.0; 3];
        for (px, py, weight) in [
            (left, top, (1.0 - fx) * (1.0 - fy)),
            (right, top, fx * (1.0 - fy)),
            (left, bottom, (1.0 - fx) * fy),
            (right, bottom, fx * fy),
        ] {
            if !self.trusted[py * width + px] {
                return Err(ProjectorError::Photograph(format!(
                    "pixel ({px}, {py}) of the card is clipped: expose less, so that the brightest square stays below white"
                )));
            }
            (0..3).for_each(|channel| sum[channel] += weight * f64::from(picture.pixel(px, py)[channel]));
        }
        Ok(sum)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [[f64; 2]; 4] = [[31.0, 20.0], [250.0, 34.0], [268.0, 190.0], [22.0, 170.0]];

    /// A card seen at an angle, lit by a projector whose flux falls off from (0.4, 0.5), with a colour and a black level of 1 %.
    fn card(size: (usize, usize)) -> (Image<Radiance>, Image<Radiance>) {
        let view = PatternView::from_corners(CORNERS).unwrap();
        // The way back by Newton, which needs no second homography.
        let pattern_of = |x: f64, y: f64| {
            let mut at = [0.5, 0.5];
            for _ in 0..30 {
                let [px, py] = view.pixel(at[0], at[1]);
                let d = 1e-6;
                let (right, down) = (view.pixel(at[0] + d, at[1]), view.pixel(at[0], at[1] + d));
                let (a, b, c, e) = ((right[0] - px) / d, (down[0] - px) / d, (right[1] - py) / d, (down[1] - py) / d);
                let determinant = a * e - b * c;
                at[0] += ((x - px) * e - b * (y - py)) / determinant;
                at[1] += (a * (y - py) - (x - px) * c) / determinant;
            }
            at
        };
        let shown = |level: f64| {
            let pixels = (0..size.0 * size.1).map(|index| {
                let [s, t] = pattern_of((index % size.0) as f64 + 0.5, (index / size.0) as f64 + 0.5);
                [0.8, 1.0, 0.6].map(|colour| (level * colour * falloff(s, t)) as f32)
            });
            Image::from_pixels(size.0, size.1, pixels.collect())
        };
        (shown(0.5), shown(0.005))
    }

    fn falloff(s: f64, t: f64) -> f64 {
        1.0 - 0.5 * ((s - 0.4).powi(2) + (t - 0.5).powi(2))
    }

    #[test]
    fn the_flux_of_squares_is_what_the_projector_shone() {
        let (white, black) = card((300, 210));
        let trusted = vec![true; 300 * 210];
        let view = PatternView::from_corners(CORNERS).unwrap();
        let found = Card { white: &white, black: Some(&black), trusted: &trusted, view }.flat_field(6).unwrap();
        let truth = |u: usize, v: usize| {
            let mean: f64 = (0..400)
                .map(|index| {
                    let inside = |at: usize, step: usize| (at as f64 + 0.1 + 0.8 * (step as f64 + 0.5) / 20.0) / 6.0;
                    falloff(inside(u, index % 20), inside(v, index / 20))
                })
                .sum();
            mean / 400.0
        };
        let axis = [(2, 2), (3, 2), (2, 3), (3, 3)].map(|(u, v)| truth(u, v)).iter().sum::<f64>() / 4.0;
        for (u, v) in (0..36).map(|square| (square % 6, square / 6)) {
            let (found, expected) = (found.square_flux[v][u], truth(u, v) / axis);
            assert!((found / expected - 1.0).abs() < 0.002, "({u}, {v}): {found}, not {expected}");
        }
        assert!((found.black_level.unwrap() - 0.01).abs() < 1e-6, "{found:?}");
        // The projector's white is (0.8, 1, 0.6): balanced, all channels have its luminance.
        let luminance = 0.2126 * 0.8 + 0.7152 + 0.0722 * 0.6;
        for (found, channel) in found.white_balance.iter().zip([0.8, 1.0, 0.6]) {
            assert!((found * channel / luminance - 1.0).abs() < 1e-4, "{found} times {channel} is not {luminance}");
        }
        assert!(found.colour_spread < 1e-5);
    }

    #[test]
    fn what_measures_nothing_is_refused_in_words() {
        let (white, black) = card((300, 210));
        let view = PatternView::from_corners(CORNERS).unwrap();
        let mut trusted = vec![true; 300 * 210];
        let told = |card: Card| card.flat_field(4).unwrap_err().to_string();
        // A highlight of a few pixels; single ones may fall between samples.
        for y in 95..105 {
            trusted[y * 300 + 145..y * 300 + 155].fill(false);
        }
        assert!(told(Card { white: &white, black: None, trusted: &trusted, view }).contains("of the card is clipped"));
        let all = vec![true; 300 * 210];
        assert!(told(Card { white: &black, black: Some(&white), trusted: &all, view }).contains("no more under white"));
        let beyond = PatternView::from_corners(CORNERS.map(|[x, y]| [x + 60.0, y])).unwrap();
        assert!(
            told(Card { white: &white, black: None, trusted: &all, view: beyond }).contains("outside the photograph")
        );
    }
}
