//! The fit: Gauss–Newton for the logarithms of the slopes of g, the radiance of every pixel eliminated, weights renewed.
//!
//! For each pixel the best ln E is the weighted mean of g(Zⱼ) − ln tⱼ, so what is minimised is a quadratic form of g alone.
//! Weights are 1/variance of ln X: photon noise, read noise, rounding, and what the residuals show beyond these (film grain,
//! JPEG, shutters, lamps). They are taken at what the pixel's other exposures predict: weights by the noisy count itself would
//! prefer those that came out dark, and leaving out by count those that came out bright.

use super::curve::Knots;
use crate::NoiseModel;

/// The least standard deviation of ln X beside the sensor's noise: no shutter is better.
const LEAST_SHARE: f64 = 0.003;
/// Observations that noise is judged by, about.
const TOLD: usize = 4096;
/// Rounds with weights by count, which need no curve yet.
const FIRST_ROUNDS: usize = 8;
/// Rounds until observations far from the others are left out rather than weighed less.
const CONVEX_ROUNDS: usize = 20;
/// Rounds at most.
const ROUNDS: usize = 40;
/// The outermost part of the code range, where weights fade.
const MARGIN: f64 = 0.04;
/// Counts above black over which weights grow, whatever the range.
const LOW_COUNTS: (f64, f64) = (1.0, 10.0);
/// The noise of photographs is not believed to be less than this share of what the model says.
const LEAST_SCALE: f64 = 0.2;
/// Tukey's biweight ends here, in standard deviations.
const FAR: f64 = 4.685;
/// Prior standard deviation of the change of ln slope's gradient over one unit of the opened coordinate, where neighbouring
/// exposures are at most a factor 2 apart. Ripples that wider steps leave open are longer, and bend less as their length squared.
/// This decides what ripple is believed where exposures in one ratio leave it open; it was chosen on simulated cameras,
/// S-shaped, sRGB, linear, film-like, with steps of 2 to 4 between exposures.
const BEND: f64 = 0.08;
/// Prior standard deviation of the change of ln slope over one unit of the opened coordinate.
const DRIFT: f64 = 3.0;

/// The curve of one channel.
pub(super) struct Fit {
    /// g at the knots.
    pub(super) log_exposures: Vec<f64>,
    pub(super) pixels: usize,
    pub(super) observations: usize,
    pub(super) outliers: usize,
    pub(super) rms: f64,
    pub(super) seen: (f64, f64),
}

/// One pixel in one photograph, with its weight.
struct Observation {
    interval: usize,
    share: f64,
    fraction: f64,
    log_time: f64,
    weight: f64,
    far: bool,
    residual: f64,
    deviation: f64,
    /// Variance of ln X by the sensor's noise and rounding.
    model: f64,
    /// Change of ln X over one count.
    one_count: f64,
}

impl Observation {
    fn g(&self, g: &[f64]) -> f64 {
        g[self.interval] + self.share * (g[self.interval + 1] - g[self.interval])
    }
}

/// Fits g to pixels (fractions of the code range, NaN where not seen) at exposures of these logarithms.
pub(super) fn fit(knots: &Knots, pixels: &[Vec<f64>], log_times: &[f64]) -> Fit {
    let mut stacks: Vec<Vec<Observation>> = pixels
        .iter()
        .map(|fractions| {
            let seen = fractions.iter().zip(log_times).filter(|(fraction, _)| fraction.is_finite());
            seen.map(|(fraction, log_time)| {
                let (interval, share) = knots.place(*fraction);
                let weight = 1e3 * fraction.min(1.0 - fraction);
                Observation {
                    interval,
                    share,
                    fraction: *fraction,
                    log_time: *log_time,
                    weight,
                    far: false,
                    residual: 0.0,
                    deviation: 1.0,
                    model: 1.0,
                    one_count: 0.0,
                }
            })
            .collect()
        })
        .collect();
    let gap = log_times.windows(2).map(|pair| pair[1] - pair[0]).fold(std::f64::consts::LN_2, f64::max);
    let prior = Prior::new(&knots.middles(), BEND * (std::f64::consts::LN_2 / gap).powi(2));
    let mut theta = vec![0.5; knots.len() - 1];
    let mut g = knots.log_exposures(&theta);
    for round in 0..ROUNDS {
        if round >= FIRST_ROUNDS {
            reweigh(knots, &g, &mut stacks, round >= CONVEX_ROUNDS);
        }
        let step = step(knots, &theta, &g, &stacks, &prior);
        let mut change = 0.0f64;
        for (value, step) in theta.iter_mut().zip(&step) {
            *value = (*value + step.clamp(-0.7, 0.7)).clamp(-8.0, 8.0);
        }
        let next = knots.log_exposures(&theta);
        for (old, new) in g.iter().zip(&next) {
            change = change.max((old - new).abs().min(1.0) * new.exp().sqrt());
        }
        g = next;
        if round > CONVEX_ROUNDS + 4 && change < 1e-6 {
            break;
        }
    }
    reweigh(knots, &g, &mut stacks, true);
    summary(&stacks, g)
}

/// New weights from the noise at the predicted exposure, and from how far an observation lies from the prediction.
fn reweigh(knots: &Knots, g: &[f64], stacks: &mut [Vec<Observation>], robust: bool) {
    let noise = NoiseModel::default();
    let shot = 1.0 / noise.full_well_electrons;
    let read = (noise.read_noise_electrons / noise.full_well_electrons).powi(2);
    for stack in stacks.iter_mut() {
        if log_radiance(stack, g).is_none() {
            // Where all but one were far, another curve may bring them back.
            stack.iter_mut().for_each(|observation| observation.weight = taper(observation.fraction, knots.one_count));
        }
        let Some(log_radiance) = log_radiance(stack, g) else { continue };
        for observation in stack.iter_mut() {
            observation.residual = observation.g(g) - log_radiance - observation.log_time;
            let predicted = (log_radiance + observation.log_time).min(0.0);
            let exposure = predicted.exp();
            let (_, slope) = knots.inverse(g, predicted);
            let rounding = (knots.one_count * slope).powi(2) / 12.0;
            let sensor = shot / exposure + read / (exposure * exposure);
            observation.model = sensor + rounding;
            observation.one_count = knots.one_count * slope;
        }
    }
    let unexplained = Unexplained::of(stacks, knots.one_count);
    let mut ratios = Vec::new();
    for stack in stacks.iter_mut() {
        for observation in stack.iter_mut() {
            let counts = unexplained.counts * observation.one_count;
            let variance = observation.model + counts * counts + unexplained.share.powi(2);
            observation.weight = taper(observation.fraction, knots.one_count) / variance;
            observation.deviation = variance.sqrt();
        }
        // An observation pulls the mean towards itself; of two, both residuals then say the same.
        let weights: f64 = stack.iter().map(|observation| observation.weight).sum();
        for observation in stack.iter_mut().filter(|observation| observation.weight > 0.0) {
            observation.deviation *= (1.0 - observation.weight / weights).max(1e-3).sqrt();
            ratios.push((observation.residual / observation.deviation).abs());
        }
    }
    if ratios.is_empty() {
        return;
    }
    // The model's noise times this is the noise of these photographs: the median of |normal| is 0.6745.
    let middle = ratios.len() / 2;
    let scale = (*ratios.select_nth_unstable_by(middle, f64::total_cmp).1 / 0.6745).max(LEAST_SCALE);
    for observation in stacks.iter_mut().flatten().filter(|observation| observation.weight > 0.0) {
        let ratio = observation.residual / (FAR * scale * observation.deviation);
        observation.far = ratio.abs() >= 1.0;
        let near = if robust { (1.0 - ratio * ratio).max(0.0).powi(2) } else { (0.3 / ratio.abs()).min(1.0) };
        observation.weight *= near / (scale * scale);
    }
}

/// What noise these photographs have beside the sensor's.
#[derive(Clone, Copy)]
struct Unexplained {
    /// Standard deviation in counts: scanning, JPEG, a black that is none.
    counts: f64,
    /// Standard deviation of ln X: film grain, flicker, a camera that moved.
    share: f64,
}

impl Unexplained {
    /// The likeliest of a table, residuals being distributed as Student's t with four degrees of freedom: outliers weigh little.
    fn of(stacks: &[Vec<Observation>], one_count: f64) -> Self {
        let mut told: Vec<(f64, f64, f64)> = Vec::new();
        for stack in stacks {
            let weights: f64 = stack.iter().map(|observation| observation.weight).sum();
            for observation in stack.iter().filter(|observation| taper(observation.fraction, one_count) > 0.5) {
                // Of n observations n − 1 are free.
                let free = (1.0 - observation.weight / weights).clamp(0.1, 1.0);
                told.push((observation.residual.powi(2) / free, observation.model, observation.one_count.powi(2)));
            }
        }
        let every = told.len().div_ceil(TOLD);
        let cost = |noise: Self| {
            let (counts, share) = (noise.counts.powi(2), noise.share.powi(2));
            let cost = |(square, model, one_count): &(f64, f64, f64)| {
                let variance = model + counts * one_count + share;
                0.5 * variance.ln() + 2.5 * (square / (4.0 * variance)).ln_1p()
            };
            told.iter().step_by(every.max(1)).map(cost).sum::<f64>()
        };
        let mut best = (f64::INFINITY, Self { counts: 0.0, share: LEAST_SHARE });
        for counts in [0.0, 0.5, 1.0, 2.0, 4.0, 8.0].map(|counts| counts * (one_count.recip() / 255.0).max(1.0)) {
            for step in 0..14 {
                let noise = Self { counts, share: LEAST_SHARE * 1.5f64.powi(step) };
                let cost = cost(noise);
                if cost < best.0 {
                    best = (cost, noise);
                }
            }
        }
        best.1
    }
}

/// Rises from 0 to 1 over the outermost parts of the range, so that noise takes hardly any observation in or out. The lowest
/// counts fade as well: that a count is read, so many pixels being darker, says that its light is less than the middle of
/// its step.
fn taper(fraction: f64, one_count: f64) -> f64 {
    let smooth = |inward: f64| inward * inward * (3.0 - 2.0 * inward);
    let (low, high) = LOW_COUNTS;
    let above = smooth(((fraction / one_count - low) / (high - low)).clamp(0.0, 1.0));
    above * smooth((fraction.min(1.0 - fraction) / MARGIN).min(1.0))
}

/// The weighted mean of g(Z) − ln t, if at least two observations count.
fn log_radiance(stack: &[Observation], g: &[f64]) -> Option<f64> {
    let (mut sum, mut weights, mut count) = (0.0, 0.0, 0);
    for observation in stack.iter().filter(|observation| observation.weight > 0.0) {
        sum += observation.weight * (observation.g(g) - observation.log_time);
        weights += observation.weight;
        count += 1;
    }
    (count >= 2).then(|| sum / weights)
}

/// One Gauss–Newton step for θ.
fn step(knots: &Knots, theta: &[f64], g: &[f64], stacks: &[Vec<Observation>], prior: &Prior) -> Vec<f64> {
    let n = theta.len();
    let size = n + 1;
    // Normal matrix and gradient of half the weighted squares with respect to g at the knots.
    let mut matrix = vec![0.0; size * size];
    let mut gradient = vec![0.0; size];
    let mut touched: Vec<(usize, f64)> = Vec::new();
    for stack in stacks {
        let Some(log_radiance) = log_radiance(stack, g) else { continue };
        touched.clear();
        let mut weights = 0.0;
        for observation in stack.iter().filter(|observation| observation.weight > 0.0) {
            let Observation { interval, share, weight, .. } = *observation;
            let residual = observation.g(g) - log_radiance - observation.log_time;
            let ends = [(interval, 1.0 - share), (interval + 1, share)];
            for (a, at_a) in ends {
                gradient[a] += weight * at_a * residual;
                touched.push((a, weight * at_a));
                for (b, at_b) in ends {
                    matrix[a * size + b] += weight * at_a * at_b;
                }
            }
            weights += weight;
        }
        for (a, at_a) in &touched {
            for (b, at_b) in &touched {
                matrix[a * size + b] -= at_a * at_b / weights;
            }
        }
    }
    // g at a knot falls by the rise of every interval above it, so ∂g_k/∂θ_m = −rise_m for m ≥ k, and sums run over k ≤ m.
    for row in 0..size {
        for column in 1..size {
            matrix[row * size + column] += matrix[row * size + column - 1];
        }
    }
    for row in 1..size {
        for column in 0..size {
            matrix[row * size + column] += matrix[(row - 1) * size + column];
        }
        gradient[row] += gradient[row - 1];
    }
    let rises: Vec<f64> = (0..n).map(|interval| knots.rise(theta, interval)).collect();
    let mut normal = vec![0.0; n * n];
    let mut right: Vec<f64> = (0..n).map(|m| gradient[m] * rises[m]).collect();
    for row in 0..n {
        for column in 0..n {
            normal[row * n + column] = matrix[row * size + column] * rises[row] * rises[column];
        }
    }
    prior.add_to(theta, &mut normal, &mut right);
    solve(&mut normal, &mut right, n);
    right
}

/// What is believed of θ before photographs are seen: it bends and drifts little. As rows of a least squares problem.
struct Prior {
    rows: Vec<Vec<(usize, f64)>>,
}

impl Prior {
    fn new(at: &[f64], bend: f64) -> Self {
        let mut rows = Vec::new();
        for i in 1..at.len() {
            let scale = 1.0 / (DRIFT * (at[i] - at[i - 1]).sqrt());
            rows.push(vec![(i - 1, -scale), (i, scale)]);
        }
        for i in 1..at.len().saturating_sub(1) {
            let (before, after) = (at[i] - at[i - 1], at[i + 1] - at[i]);
            let scale = 1.0 / (bend * (0.5 * (before + after)).sqrt());
            let (a, c) = (scale / before, scale / after);
            rows.push(vec![(i - 1, a), (i, -a - c), (i + 1, c)]);
        }
        // Without any photograph the response is somewhere near a power law of exponent 1/e to e.
        rows.extend((0..at.len()).map(|i| vec![(i, 1e-3)]));
        Self { rows }
    }

    fn add_to(&self, theta: &[f64], normal: &mut [f64], right: &mut [f64]) {
        let n = theta.len();
        for row in &self.rows {
            let value: f64 = row.iter().map(|(i, factor)| theta[*i] * factor).sum();
            for (i, factor) in row {
                right[*i] -= value * factor;
                for (j, other) in row {
                    normal[i * n + j] += factor * other;
                }
            }
        }
    }
}

/// Solves a symmetric positive definite system in place, after Cholesky: `right` becomes the solution.
fn solve(matrix: &mut [f64], right: &mut [f64], n: usize) {
    for row in 0..n {
        for column in 0..=row {
            let (head, tail) = matrix.split_at_mut(row * n);
            let (above, current) =
                if column < row { (&head[column * n..column * n + column], &*tail) } else { (&tail[..column], &*tail) };
            let dot: f64 = above.iter().zip(&current[..column]).map(|(a, b)| a * b).sum();
            let value = matrix[row * n + column] - dot;
            matrix[row * n + column] = if column < row {
                value / matrix[column * n + column]
            } else {
                // Rounding may spend what little a direction has; such a direction then stays where it is.
                if value > 0.0 { value.sqrt() } else { 1e150 }
            };
        }
    }
    for row in 0..n {
        let dot: f64 = matrix[row * n..row * n + row].iter().zip(&*right).map(|(a, b)| a * b).sum();
        right[row] = (right[row] - dot) / matrix[row * n + row];
    }
    for row in (0..n).rev() {
        right[row] /= matrix[row * n + row];
        let value = right[row];
        for (column, entry) in matrix[row * n..row * n + row].iter().enumerate() {
            right[column] -= entry * value;
        }
    }
}

fn summary(stacks: &[Vec<Observation>], g: Vec<f64>) -> Fit {
    let mut fit = Fit { log_exposures: g, pixels: 0, observations: 0, outliers: 0, rms: 0.0, seen: (1.0, 0.0) };
    let (mut squares, mut weights) = (0.0, 0.0);
    for stack in stacks {
        fit.outliers += stack.iter().filter(|observation| observation.far).count();
        let used = || stack.iter().filter(|observation| observation.weight > 0.0);
        if used().count() < 2 {
            continue;
        }
        fit.pixels += 1;
        for observation in used() {
            fit.observations += 1;
            squares += observation.weight * observation.residual * observation.residual;
            weights += observation.weight;
            fit.seen = (fit.seen.0.min(observation.fraction), fit.seen.1.max(observation.fraction));
        }
    }
    fit.rms = if weights > 0.0 { (squares / weights).sqrt() } else { 0.0 };
    fit
}

impl Fit {
    /// The smallest and the largest d ln f / d ln X within the seen range.
    pub(super) fn gammas(&self, knots: &Knots) -> (f64, f64) {
        let mut gammas = (f64::INFINITY, 0.0f64);
        for (i, pair) in self.log_exposures.windows(2).enumerate() {
            if knots.fractions[i] >= self.seen.0 && knots.fractions[i + 1] <= self.seen.1 {
                let gamma = (knots.logs[i + 1] - knots.logs[i]) / (pair[1] - pair[0]);
                gammas = (gammas.0.min(gamma), gammas.1.max(gamma));
            }
        }
        gammas
    }
}
