//! The reference patch: an area of the picture by which the lamp's drift within a position is taken out.
//!
//! As long as the projector stands still, what lies in the patch gets the same light in every photograph: it lies outside all squares
//! of the pattern and sees only the projector's black, or a border that the projector always shows. Then its radiance under pattern
//! j, Pⱼ, changes with nothing but the lamp, and a photograph divided by Pⱼ/P_black is what the lamp would have shown when it
//! shone as it did for the black frame. Between positions the light comes from elsewhere, so that the patch says nothing of the
//! lamp there: drift from position to position stays.

use std::ops::RangeInclusive;

use relumine_radiometry::{Image, Linearity};

use crate::ShownPattern;

/// An area of the picture, pixels; inside it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReferencePatch {
    x: usize,
    y: usize,
    width: usize,
    height: usize,
}

impl ReferencePatch {
    /// What the patch may show over what it shows under black: no lamp drifts farther while the projector stands still.
    pub(crate) const PLAUSIBLE: RangeInclusive<f64> = 0.67..=1.5;
    /// Noise of the patch's mean above which it is no measure, relative.
    const NOISIEST: f64 = 0.01;

    /// `[x, y, width, height]` in a picture of `size`.
    ///
    /// # Errors
    /// If it is empty or not inside the picture.
    pub(crate) fn new([x, y, width, height]: [usize; 4], size: (usize, usize)) -> Result<Self, String> {
        let inside = |start: usize, length: usize, side: usize| {
            length > 0 && start.checked_add(length).is_some_and(|end| end <= side)
        };
        if !inside(x, width, size.0) || !inside(y, height, size.1) {
            return Err(format!(
                "camera: reference_patch must be [x, y, width, height] of an area inside the picture of {} × {}, found \
                 [{x}, {y}, {width}, {height}]",
                size.0, size.1
            ));
        }
        Ok(Self { x, y, width, height })
    }

    fn pixels<'a, Q: Linearity>(&self, picture: &'a Image<Q>) -> impl Iterator<Item = f64> + 'a {
        let Self { x, y, width, height } = *self;
        (y..y + height).flat_map(move |row| {
            let start = row * picture.width() + x;
            picture.pixels()[start..start + width]
                .iter()
                .map(|pixel| pixel.iter().map(|value| f64::from(*value)).sum::<f64>())
        })
    }

    /// The mean of all channels over the patch.
    pub(crate) fn mean<Q: Linearity>(&self, picture: &Image<Q>) -> f64 {
        self.pixels(picture).sum::<f64>() / (3 * self.width * self.height) as f64
    }

    /// P/P_black, what the lamp shone relative to when it was photographed with `black`.
    ///
    /// # Errors
    /// In words, if the patch is too dark or too noisy to tell, or gets light from the pattern.
    pub(crate) fn lamp<Q: Linearity>(
        &self,
        pattern: ShownPattern,
        shown: &Image<Q>,
        black: &Image<Q>,
    ) -> Result<f64, String> {
        let (here, there) = (self.mean(shown), self.mean(black));
        if !(there > 0.0 && here > 0.0) {
            return Err(
                "the reference patch is as dark as no light under the black frame or this pattern: longer exposures \
                        or a brighter patch are needed"
                    .into(),
            );
        }
        let lamp = here / there;
        if !Self::PLAUSIBLE.contains(&lamp) {
            return Err(format!(
                "under {pattern} the reference patch is {lamp:.2} times as bright as under black: it must lie where no square \
                 of the pattern lights it"
            ));
        }
        // What is left between the two once they are scaled to each other is noise of both.
        let count = (self.width * self.height) as f64;
        let difference: f64 =
            self.pixels(shown).zip(self.pixels(black)).map(|(here, there)| (here / lamp - there).powi(2)).sum();
        let noise = (difference / count).sqrt() / count.sqrt() / (3.0 * there);
        if noise > Self::NOISIEST {
            return Err(format!(
                "the reference patch is too noisy: its mean is known to {:.1} % only, and {:.1} % are needed: a larger patch or \
                 longer exposures",
                100.0 * noise,
                100.0 * Self::NOISIEST
            ));
        }
        Ok(lamp)
    }
}
