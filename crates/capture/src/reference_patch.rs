//! The reference patch: an area of the picture by which the lamp's drift within a position is taken out.
//!
//! As long as the projector stands still, what lies in the patch gets the same light in every photograph: it lies outside all squares
//! of the pattern and sees only the projector's black, or a border that the projector always shows. Then its radiance under pattern
//! j, Pⱼ, changes with nothing but the lamp, and a photograph divided by Pⱼ/P_black is what the lamp would have shown when it
//! shone as it did for the black frame. Between positions the light comes from elsewhere, so that the patch says nothing of the
//! lamp there: drift from position to position stays.

use std::ops::RangeInclusive;

use relumine_radiometry::{Image, Linearity, Merged, Visibility};

use crate::{CaptureError, Developer, ShownPattern};

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

    /// Sums of the channels over the patch, of a picture in rows of `width`.
    fn sums<'a>(&self, pixels: &'a [[f32; 3]], width: usize) -> impl Iterator<Item = f64> + 'a {
        self.pixels(width).map(move |pixel| pixels[pixel].iter().map(|value| f64::from(*value)).sum::<f64>())
    }

    /// Its pixels, counted row by row of a picture in rows of `width`.
    pub(crate) fn pixels(&self, width: usize) -> impl Iterator<Item = usize> + use<> {
        let patch = *self;
        (patch.y..patch.y + patch.height)
            .flat_map(move |row| (patch.x..patch.x + patch.width).map(move |x| row * width + x))
    }

    /// The mean of all channels over the patch.
    pub(crate) fn mean<Q: Linearity>(&self, picture: &Image<Q>) -> f64 {
        self.sums(picture.pixels(), picture.width()).sum::<f64>() / (3 * self.width * self.height) as f64
    }

    /// P/P_black, what the lamp shone relative to when it was photographed with `black`; NaN pixels of `shown` are left out.
    ///
    /// # Errors
    /// In words, if the patch is too dark or too noisy to tell, or gets light from the pattern.
    pub(crate) fn lamp<Q: Linearity>(&self, shown: &[[f32; 3]], black: &Image<Q>) -> Result<f64, String> {
        let width = black.width();
        let pairs: Vec<(f64, f64)> = self
            .sums(shown, width)
            .zip(self.sums(black.pixels(), width))
            .filter(|(here, _)| here.is_finite())
            .collect();
        let (here, there) = pairs.iter().fold((0.0, 0.0), |(here, there), pair| (here + pair.0, there + pair.1));
        if 2 * pairs.len() < self.width * self.height || here <= 0.0 || there <= 0.0 {
            return Err(
                "the reference patch is as dark as no light, or clipped, under this pattern or under black: take \
                        other exposures or another patch"
                    .into(),
            );
        }
        let lamp = here / there;
        if !Self::PLAUSIBLE.contains(&lamp) {
            return Err(format!(
                "the reference patch is {lamp:.2} times as bright as under black: it must lie where no square of the pattern \
                 lights it"
            ));
        }
        // What is left between the two once they are scaled to each other is noise of both.
        let difference: f64 = pairs.iter().map(|(here, there)| (here / lamp - there).powi(2)).sum();
        let noise = difference.sqrt() / there;
        if noise > Self::NOISIEST {
            return Err(format!(
                "the reference patch is too noisy: its mean is known to {:.1} % only, and {:.1} % are needed: take a larger \
                 patch or longer exposures",
                100.0 * noise,
                100.0 * Self::NOISIEST
            ));
        }
        Ok(lamp)
    }
}

impl Developer {
    /// Divides the frames of a position by what the lamp shone over what it shone for the black frame, as the reference patch says;
    /// comes back with the least and the most of that.
    pub(crate) fn take_drift_out(
        &self,
        position: usize,
        patch: ReferencePatch,
        black: &Merged,
        frames: &mut [Option<Vec<f32>>],
        white: Option<&mut Vec<f32>>,
    ) -> Result<(f64, f64), CaptureError> {
        let setup = self.capture().setup();
        let patterns = setup.scheme().lighting(setup.cells().squares());
        let named =
            patterns.into_iter().zip(frames.iter_mut()).filter_map(|(pattern, frame)| Some((pattern, frame.as_mut()?)));
        let named = named.chain(white.map(|white| (ShownPattern::White, white)));
        let (mut least, mut most) = (1.0f64, 1.0f64);
        for (pattern, frame) in named {
            let lamp = self.lamp(position, pattern, patch, frame, black)?;
            (least, most) = (least.min(lamp), most.max(lamp));
            frame.iter_mut().for_each(|value| *value /= lamp as f32);
        }
        Ok((least, most))
    }

    /// What the lamp shone under a pattern over what it shone under black.
    pub(crate) fn lamp(
        &self,
        position: usize,
        pattern: ShownPattern,
        patch: ReferencePatch,
        shown: &[f32],
        black: &Merged,
    ) -> Result<f64, CaptureError> {
        let width = black.radiance.width();
        let lamp = if patch.pixels(width).any(|pixel| black.visibility[pixel] == Visibility::Clipped) {
            Err("the reference patch is clipped in every exposure of black: take a shorter one, or another patch"
                .into())
        } else {
            patch.lamp(shown.as_chunks().0, &black.radiance)
        };
        lamp.map_err(|reason| {
            let file =
                self.capture().exposures(position, pattern).first().map(|row| row.file.clone()).unwrap_or_default();
            CaptureError::Photograph {
                path: self.capture().directory().join(file),
                reason: format!("{pattern}: {reason}"),
            }
        })
    }
}
