//! How uncertain the lanes of combs are.

use relumine_radiometry::NoiseCurve;

use super::Combs;
use super::lanes::{Lanes, load};

/// The noise of the photographs of which [`Combs`] were made: a frame is (photograph − black) · scale.
#[derive(Clone, Copy)]
pub struct CombNoise<'a> {
    /// Variance of a photograph by its radiance.
    pub curve: &'a NoiseCurve,
    /// The black frame that was subtracted, radiance, as lanes.
    pub black: &'a [f32],
    /// What the black frame is uncertain by, variance, as lanes. All frames share this error.
    pub black_variance: &'a [f32],
    /// 1/(1 − b).
    pub scale: f32,
}

impl CombNoise<'_> {
    /// Variance of a frame's own error in one lane, the black frame's left aside.
    pub(super) fn of(&self, lane: usize, value: f32) -> f32 {
        self.scale * self.scale * self.curve.at(value / self.scale + self.black[lane])
    }

    /// Standard deviation of a frame without light in one lane.
    pub(super) fn dark_deviation(&self) -> f32 {
        self.scale * self.curve.dark().sqrt()
    }
}

impl<'a> Combs<'a> {
    /// The noise, unless there is none at all.
    pub(super) fn noisy(&self) -> Option<&CombNoise<'a>> {
        let has_any = |noise: &&CombNoise| noise.curve.dark() > 0.0 || noise.curve.at(1.0) > 0.0;
        self.noise.as_ref().filter(has_any)
    }
}

/// [`CombNoise`] of W lanes.
pub(super) struct NoiseOfLanes<'a, const W: usize> {
    curve: &'a NoiseCurve,
    black: Lanes<W>,
    scale: f32,
    /// Variance of the error that all frames share.
    pub(super) shared: Lanes<W>,
}

impl<'a, const W: usize> NoiseOfLanes<'a, W> {
    /// Of the lanes from `at` on.
    #[inline(always)]
    pub(super) fn new(noise: &CombNoise<'a>, at: usize) -> Self {
        let variance: Lanes<W> = load(noise.black_variance, at);
        let shared = variance.map(|variance| noise.scale * noise.scale * variance);
        Self { curve: noise.curve, black: load(noise.black, at), scale: noise.scale, shared }
    }

    /// Variance of a frame's own error, the black frame's left aside.
    #[inline(always)]
    pub(super) fn of(&self, values: &Lanes<W>) -> Lanes<W> {
        let per_scale = 1.0 / self.scale;
        std::array::from_fn(|lane| self.scale * self.scale * self.curve.at(values[lane] * per_scale + self.black[lane]))
    }
}
