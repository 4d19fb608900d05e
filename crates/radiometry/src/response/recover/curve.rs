//! The unknown curve g = ln f⁻¹ at knots of the code range, rising by construction.
//!
//! Between the knots z₁ < … < z_K = 1 (fractions of the code range) g is linear in ln z, with the slope e^θ: θ = 0
//! everywhere is the linear response, a constant θ a power law. g(1) = 0: relative exposure 1 is where the camera clips.

/// Counts of range up to which every count is a knot.
const COUNTS_AS_KNOTS: f64 = 256.0;
/// Knots of a wider range.
const KNOTS: usize = 384;
/// What a coordinate that opens up both ends of the range adds to both distances, so that it stays finite.
const END: f64 = 1.0 / 512.0;

/// Where the knots stand.
pub(super) struct Knots {
    /// Fractions of the code range, rising; the last is 1.
    pub(super) fractions: Vec<f64>,
    /// ln of the fractions.
    pub(super) logs: Vec<f64>,
    /// One count, as a fraction of the range.
    pub(super) one_count: f64,
}

impl Knots {
    /// Knots for a range of this many counts.
    pub(super) fn new(range: f64) -> Self {
        let fractions: Vec<f64> = if range <= COUNTS_AS_KNOTS {
            let steps = range.round() as usize;
            (1..=steps).map(|step| step as f64 / steps as f64).collect()
        } else {
            let (first, last) = (opened(1.0 / range), opened(1.0));
            let step = (last - first) / (KNOTS - 1) as f64;
            let mut inner: Vec<f64> = (0..KNOTS).map(|knot| closed(first + step * knot as f64)).collect();
            inner[KNOTS - 1] = 1.0;
            inner
        };
        let logs = fractions.iter().map(|fraction| fraction.ln()).collect();
        Self { fractions, logs, one_count: 1.0 / range }
    }

    pub(super) fn len(&self) -> usize {
        self.fractions.len()
    }

    /// 0, then the knots.
    pub(super) fn fractions_with_zero(&self) -> Vec<f64> {
        std::iter::once(0.0).chain(self.fractions.iter().copied()).collect()
    }

    /// The middle of each interval between knots, in the coordinate that opens up both ends of the range.
    pub(super) fn middles(&self) -> Vec<f64> {
        self.fractions.windows(2).map(|pair| 0.5 * (opened(pair[0]) + opened(pair[1]))).collect()
    }

    /// The interval in which a fraction lies and how far in it, by ln z. Below the first knot the first interval goes on.
    pub(super) fn place(&self, fraction: f64) -> (usize, f64) {
        let log = fraction.ln();
        let right = self.logs.partition_point(|knot| *knot <= log).clamp(1, self.len() - 1);
        (right - 1, (log - self.logs[right - 1]) / (self.logs[right] - self.logs[right - 1]))
    }

    /// g at the knots for the logarithms of the slopes.
    pub(super) fn log_exposures(&self, log_slopes: &[f64]) -> Vec<f64> {
        let mut g = vec![0.0; self.len()];
        for interval in (0..log_slopes.len()).rev() {
            g[interval] = g[interval + 1] - self.rise(log_slopes, interval);
        }
        g
    }

    /// By how much g rises over an interval.
    pub(super) fn rise(&self, log_slopes: &[f64], interval: usize) -> f64 {
        log_slopes[interval].exp() * (self.logs[interval + 1] - self.logs[interval])
    }

    /// The fraction at a log exposure (at most 0) and d ln X / d z there.
    pub(super) fn inverse(&self, g: &[f64], log_exposure: f64) -> (f64, f64) {
        let right = g.partition_point(|knot| *knot <= log_exposure).clamp(1, self.len() - 1);
        let slope = (g[right] - g[right - 1]) / (self.logs[right] - self.logs[right - 1]);
        let log = self.logs[right - 1] + (log_exposure - g[right - 1]) / slope;
        let fraction = log.exp();
        (fraction, slope / fraction)
    }
}

/// A coordinate in which both ends of 0 … 1 are opened up: a logit that stays finite.
fn opened(fraction: f64) -> f64 {
    ((fraction + END) / (1.0 - fraction + END)).ln()
}

fn closed(opened: f64) -> f64 {
    let ratio = opened.exp();
    (ratio * (1.0 + END) - END) / (1.0 + ratio)
}

/// Relative exposures at 0 and at the knots.
pub(super) fn exposures(log_exposures: &[f64]) -> Vec<f64> {
    std::iter::once(0.0).chain(log_exposures.iter().map(|g| g.exp())).collect()
}
