//! Merging from tables, in bands of rows and blocks of samples that stay in the cache.
//!
//! A sample that enters no sum has an infinite variance, so the loops have no branches; only beside clipped pixels a sample is
//! asked whether it is too bright. Where no exposure is safe, the plain version is asked, sample by sample.

use rayon::prelude::*;

use super::plain::BLOOMING_SIGMAS;
use super::{Disagreement, Merged, Stack, Visibility};
use crate::Image;

/// Pixels that one task merges, about: whole rows.
const BAND: usize = 1 << 16;
/// Samples of all exposures that are worked on at a time.
const BLOCK: usize = 1 << 10;

/// Per code: relative exposure, and variance without light (read noise and rounding). Both are 0 and ∞ where the code is not
/// safe.
type Table = Vec<[f32; 2]>;

/// Per code: the variance that photographs were found to differ by, as a share of the exposure's square.
type Shares = Vec<f32>;

pub(super) fn merge(stack: &Stack<'_>) -> Merged {
    let (width, height) = (stack.width, stack.height);
    let (tables, shares) = (tables(stack), shares(stack));
    let mut radiance = vec![[0.0; 3]; width * height];
    let mut variance = vec![[0.0; 3]; width * height];
    let mut visibility = vec![Visibility::Seen; width * height];
    let rows = (BAND / width.max(1)).max(1);
    let band = (rows * width).max(1);
    let bands = radiance.par_chunks_mut(band).zip(variance.par_chunks_mut(band)).zip(visibility.par_chunks_mut(band));
    let used = bands
        .enumerate()
        .map(|(index, ((radiance, variance), visibility))| {
            merge_band(stack, (&tables, shares.as_ref()), index * band, radiance, variance, visibility)
        })
        .reduce(|| vec![0; stack.exposures.len()], |a, b| a.iter().zip(b).map(|(a, b)| a + b).collect());
    Merged { radiance: Image::from_pixels(width, height, radiance), variance, visibility, used: stack.shares(&used) }
}

fn tables(stack: &Stack<'_>) -> [Table; 3] {
    let read = stack.noise.read() as f32;
    std::array::from_fn(|channel| {
        let entry = |code: u16| {
            let step = stack.camera.step(channel, code);
            let entry = [stack.camera.exposure(channel, code), read + step * step / 12.0];
            if stack.is_safe(code) { entry } else { [0.0, f32::INFINITY] }
        };
        (0..=stack.camera.white_level()).map(entry).collect()
    })
}

fn shares(stack: &Stack<'_>) -> Option<[Shares; 3]> {
    let codes = || 0..=stack.camera.white_level();
    let of = |disagreement: &Disagreement, channel| codes().map(|code| disagreement.share(channel, code)).collect();
    stack.disagreement.map(|disagreement| std::array::from_fn(|channel| of(disagreement, channel)))
}

/// Merges the pixels from `start` on; gives how many samples of each exposure entered.
fn merge_band(
    stack: &Stack<'_>,
    (tables, shares): (&[Table; 3], Option<&[Shares; 3]>),
    start: usize,
    radiance: &mut [[f32; 3]],
    variance: &mut [[f32; 3]],
    visibility: &mut [Visibility],
) -> Vec<u64> {
    let mut used = vec![0; stack.exposures.len()];
    let beside_clipped = beside_clipped(stack, start, visibility.len());
    let length = visibility.len();
    let size = (BLOCK / (3 * stack.exposures.len())).max(16);
    let mut block = Block::new(stack, size);
    let outputs = radiance.chunks_mut(size).zip(variance.chunks_mut(size)).zip(visibility.chunks_mut(size));
    for (index, ((radiance, variance), visibility)) in outputs.enumerate() {
        let offset = index * size;
        let beside = |exposure: usize| {
            beside_clipped[exposure].get(offset..(offset + size).min(length)).filter(|flags| flags.contains(&ANY))
        };
        block.merge(
            stack,
            (tables, shares),
            start + offset,
            beside,
            radiance.as_flattened_mut(),
            variance.as_flattened_mut(),
        );
        for (pixel, seen) in visibility.iter_mut().enumerate() {
            let of_pixel = 3 * pixel..3 * pixel + 3;
            let (nothing, black) = (&block.nothing[of_pixel.clone()], &block.black[of_pixel]);
            if nothing != [0; 3] {
                let mut of_channels = [0, 1, 2].map(|channel| seen_or_black(black[channel]));
                for channel in (0..3).filter(|channel| nothing[*channel] != 0) {
                    // It entered no sum of the block, so it is counted there only.
                    let sample = stack.unsafe_sample(start + offset + pixel, channel, &mut used);
                    radiance[pixel][channel] = sample.radiance as f32;
                    variance[pixel][channel] = sample.variance as f32;
                    of_channels[channel] = sample.visibility;
                }
                *seen = super::of_pixel(of_channels);
            } else if black != [0; 3] {
                *seen = Visibility::Black;
            }
        }
        block.count(3 * visibility.len(), &mut used);
    }
    used
}

fn seen_or_black(is_black: u8) -> Visibility {
    if is_black == 0 { Visibility::Seen } else { Visibility::Black }
}

/// Working memory for a block of samples.
struct Block {
    /// Relative exposure and variance without light of every sample of every exposure, exposure by exposure.
    exposure: Vec<f32>,
    dark_variance: Vec<f32>,
    /// Sums over exposures: light, time, variance without light.
    light: Vec<f32>,
    time: Vec<f32>,
    dark: Vec<f32>,
    /// Whether no exposure is safe, and whether none of the safe ones is above black.
    nothing: Vec<u8>,
    black: Vec<u8>,
    /// Of one exposure: what it was found to differ by.
    share: Vec<f32>,
    samples: usize,
    /// Exposures as fractions of the longest, so that single precision holds their squares.
    t: Vec<f32>,
    per_longest: f32,
}

impl Block {
    fn new(stack: &Stack<'_>, pixels: usize) -> Self {
        let samples = 3 * pixels;
        let all = vec![0.0; samples * stack.exposures.len()];
        let longest = stack.exposures[stack.exposures.len() - 1].t;
        Self {
            dark_variance: all.clone(),
            exposure: all,
            light: vec![0.0; samples],
            time: vec![0.0; samples],
            dark: vec![0.0; samples],
            nothing: vec![0; samples],
            black: vec![0; samples],
            share: Vec::new(),
            samples,
            t: stack.exposures.iter().map(|exposed| (exposed.t / longest) as f32).collect(),
            per_longest: (1.0 / longest) as f32,
        }
    }

    fn merge<'b>(
        &mut self,
        stack: &Stack<'_>,
        (tables, shares): (&[Table; 3], Option<&[Shares; 3]>),
        start: usize,
        beside_clipped: impl Fn(usize) -> Option<&'b [u8]>,
        radiance: &mut [f32],
        variance: &mut [f32],
    ) {
        let n = radiance.len();
        let shot = stack.noise.shot() as f32;
        self.light[..n].fill(0.0);
        self.time[..n].fill(0.0);
        self.dark[..n].fill(0.0);
        self.black[..n].fill(1);
        for (i, exposed) in stack.exposures.iter().enumerate() {
            let counts = &exposed.counts[start..start + n / 3];
            let samples = i * self.samples..i * self.samples + n;
            look_up(tables, counts, &mut self.exposure[samples.clone()], &mut self.dark_variance[samples]);
            if let Some(flags) = beside_clipped(i) {
                self.leave_out_blooming(i, flags, shot);
            }
            self.add(i, counts.as_flattened(), stack.camera.black_level());
        }
        if stack.exposures.len() == 1 && shares.is_none() {
            self.only(shot, radiance, variance);
            return;
        }
        // First estimate: all electrons over all time, as photon noise per exposure.
        let (light, time) = (&mut self.light[..n], &self.time[..n]);
        for s in 0..n {
            self.nothing[s] = u8::from(time[s] == 0.0);
            light[s] = (light[s] / time[s]).max(0.0) * shot;
        }
        match shares {
            None => self.weigh(radiance, variance),
            Some(shares) => self.weigh_disagreeing(stack, shares, start, radiance, variance),
        }
    }

    /// What the only exposure says: no weight makes a difference.
    fn only(&mut self, shot: f32, radiance: &mut [f32], variance: &mut [f32]) {
        let n = radiance.len();
        let (exposure, dark, nothing) = (&self.exposure[..n], &self.dark_variance[..n], &mut self.nothing[..n]);
        for s in 0..n {
            let photons = if exposure[s] > 0.0 { exposure[s] * shot } else { 0.0 };
            radiance[s] = exposure[s] * self.per_longest;
            variance[s] = (photons + dark[s]) * (self.per_longest * self.per_longest);
            nothing[s] = u8::from(dark[s] == f32::INFINITY);
        }
    }

    /// The weighted mean of all exposures, and its variance.
    fn weigh(&self, sum: &mut [f32], weights: &mut [f32]) {
        let n = sum.len();
        let light = &self.light[..n];
        sum.fill(0.0);
        weights.fill(0.0);
        for (i, t) in self.t.iter().enumerate() {
            let exposure = &self.exposure[i * self.samples..][..n];
            let dark = &self.dark_variance[i * self.samples..][..n];
            for s in 0..n {
                let weight = t / (light[s] * t + dark[s]);
                sum[s] += weight * exposure[s];
                weights[s] += weight * t;
            }
        }
        for s in 0..n {
            let inverse = self.per_longest / weights[s];
            sum[s] *= inverse;
            weights[s] = inverse * self.per_longest;
        }
    }

    /// As [`Block::weigh`], with what the photographs were found to differ by.
    fn weigh_disagreeing(
        &mut self,
        stack: &Stack<'_>,
        shares: &[Shares; 3],
        start: usize,
        sum: &mut [f32],
        variance: &mut [f32],
    ) {
        let n = sum.len();
        let electrons = stack.noise.full_well_electrons as f32;
        let (light, weights) = (&self.light[..n], &mut self.time[..n]);
        self.share.resize(n, 0.0);
        sum.fill(0.0);
        variance.fill(0.0);
        weights.fill(0.0);
        for (i, (t, exposed)) in self.t.iter().zip(&stack.exposures).enumerate() {
            let exposure = &self.exposure[i * self.samples..][..n];
            let dark = &self.dark_variance[i * self.samples..][..n];
            look_up_shares(shares, &exposed.counts[start..start + n / 3], &mut self.share);
            let share = &self.share[..n];
            for s in 0..n {
                let photons = light[s] * t;
                let expected = photons * electrons;
                let (foreseen, found) = (photons + dark[s], share[s] * expected * expected);
                let weight = t / (foreseen + found);
                sum[s] += weight * exposure[s];
                weights[s] += weight * t;
                // What does not enter has the weight 0.
                variance[s] += weight * weight * foreseen.max(found).min(f32::MAX);
            }
        }
        for s in 0..n {
            let inverse = self.per_longest / weights[s];
            sum[s] *= inverse;
            variance[s] *= inverse * inverse;
        }
    }

    /// Adds one exposure to the sums.
    fn add(&mut self, i: usize, counts: &[u16], black_level: u16) {
        let (n, t) = (counts.len(), self.t[i]);
        let exposure = &self.exposure[i * self.samples..][..n];
        let dark = &self.dark_variance[i * self.samples..][..n];
        let (light, time, darks, black) =
            (&mut self.light[..n], &mut self.time[..n], &mut self.dark[..n], &mut self.black[..n]);
        for s in 0..n {
            let safe = dark[s] < f32::INFINITY;
            light[s] += exposure[s];
            time[s] += if safe { t } else { 0.0 };
            darks[s] += if safe { dark[s] } else { 0.0 };
            black[s] &= u8::from(!(safe & (counts[s] > black_level)));
        }
    }

    /// Takes back the samples of an exposure that are too bright beside a clipped pixel, by what is summed of shorter ones.
    fn leave_out_blooming(&mut self, i: usize, flags: &[u8], shot: f32) {
        let t = self.t[i];
        for pixel in flags.iter().enumerate().filter(|(_, flag)| **flag != 0).map(|(pixel, _)| pixel) {
            for s in 3 * pixel..3 * pixel + 3 {
                let own = i * self.samples + s;
                let (time, dark) = (self.time[s], self.dark_variance[own]);
                if time == 0.0 || dark == f32::INFINITY {
                    continue;
                }
                let shorter = (self.light[s] / time).max(0.0);
                let of_shorter = (shorter * shot * time + self.dark[s]) / (time * time);
                let variance = shorter * shot * t + dark + of_shorter * t * t;
                let excess = self.exposure[own] - shorter * t;
                if excess > BLOOMING_SIGMAS as f32 * variance.sqrt() {
                    self.exposure[own] = 0.0;
                    self.dark_variance[own] = f32::INFINITY;
                }
            }
        }
    }

    /// Adds how many of the first `n` samples of each exposure entered.
    fn count(&self, n: usize, used: &mut [u64]) {
        for (used, dark) in used.iter_mut().zip(self.dark_variance.chunks_exact(self.samples)) {
            *used += u64::from(dark[..n].iter().map(|dark| u32::from(*dark < f32::INFINITY)).sum::<u32>());
        }
    }
}

fn look_up(tables: &[Table; 3], counts: &[[u16; 3]], exposure: &mut [f32], dark: &mut [f32]) {
    let [red, green, blue] = tables.each_ref().map(Vec::as_slice);
    let last = red.len() - 1;
    let (green, blue) = (&green[..=last], &blue[..=last]);
    for ((counts, exposure), dark) in
        counts.iter().zip(exposure.as_chunks_mut::<3>().0).zip(dark.as_chunks_mut::<3>().0)
    {
        let [r, g, b] = counts.map(|code| usize::from(code).min(last));
        let (r, g, b) = (red[r], green[g], blue[b]);
        *exposure = [r[0], g[0], b[0]];
        *dark = [r[1], g[1], b[1]];
    }
}

fn look_up_shares(shares: &[Shares; 3], counts: &[[u16; 3]], share: &mut [f32]) {
    for (counts, share) in counts.iter().zip(share.as_chunks_mut::<3>().0) {
        for channel in 0..3 {
            let of_channel = &shares[channel];
            share[channel] = of_channel[usize::from(counts[channel]).min(of_channel.len() - 1)];
        }
    }
}

/// Which channels of a pixel are clipped: bits.
const ANY: u8 = 1;
const ALL: u8 = 2;

/// For every exposure and `length` pixels from `start` (whole rows): [`ANY`] if a channel of a pixel is not clipped where the
/// pixel or one around it is clipped in any; nothing for an exposure in which there is none. The shortest is not asked.
fn beside_clipped(stack: &Stack<'_>, start: usize, length: usize) -> Vec<Vec<u8>> {
    let width = stack.width;
    let mut all = vec![Vec::new()];
    let first_row = start / width;
    let rows = first_row..first_row + length / width;
    let halo = rows.start.saturating_sub(1)..(rows.end + 1).min(stack.height);
    let white = stack.camera.white_level();
    let mut clipped = vec![0u8; halo.len() * width];
    let mut wide = vec![0u8; width];
    for exposed in &stack.exposures[1..] {
        let counts = &exposed.counts[halo.start * width..halo.end * width];
        let mut any = false;
        for (counts, clipped) in counts.chunks_exact(width).zip(clipped.chunks_exact_mut(width)) {
            let brightest = counts.as_flattened().iter().fold(0, |brightest, code| *code.max(&brightest));
            if brightest < white {
                clipped.fill(0);
                continue;
            }
            any = true;
            for ([r, g, b], clipped) in counts.iter().zip(clipped) {
                let (any, all) = (*r.max(g).max(b), *r.min(g).min(b));
                *clipped = u8::from(any >= white) * ANY + u8::from(all >= white) * ALL;
            }
        }
        let mut beside = vec![0; if any { length } else { 0 }];
        for (row, beside) in rows.clone().zip(beside.chunks_exact_mut(width)) {
            let around = row.saturating_sub(1).max(halo.start)..(row + 2).min(halo.end);
            wide.fill(0);
            for row in around {
                let clipped = &clipped[(row - halo.start) * width..][..width];
                wide.iter_mut().zip(clipped).for_each(|(wide, clipped)| *wide |= clipped);
                wide[1..].iter_mut().zip(clipped).for_each(|(wide, left)| *wide |= left);
                wide.iter_mut().zip(&clipped[1..]).for_each(|(wide, right)| *wide |= right);
            }
            let own = &clipped[(row - halo.start) * width..][..width];
            for ((beside, wide), own) in beside.iter_mut().zip(&wide).zip(own) {
                *beside = wide & !(own / ALL) & ANY;
            }
        }
        all.push(beside);
    }
    all
}
