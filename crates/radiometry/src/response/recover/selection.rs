//! Which pixels a response is recovered from: spread over brightness and over the picture, flat neighbourhoods first.

use crate::{Counts, Image};

/// Fewer pixels than this determine no curve.
pub(super) const NEEDED: usize = 50;
/// Classes of brightness.
const CLASSES: usize = 64;
/// Pixels that a class gives at most: rare brightnesses are not drowned, and common ones still tell most, since a curve has to
/// suit the pixels that there are.
const MOST_OF_A_CLASS: usize = 1024;
/// The picture is divided in this many parts each way; of a class every part gives one pixel before one gives two.
const PARTS: usize = 16;
/// Pixels looked at in a picture of any size, about.
const LOOKED_AT: usize = 1 << 20;

/// The pixels of one channel.
pub(super) struct Chosen {
    /// For each pixel the fractions of the code range, shortest exposure first; NaN where it is black or clipped.
    pub(super) pixels: Vec<Vec<f64>>,
    /// Pixels refused because they became darker with longer exposure.
    pub(super) contradicting: usize,
}

struct Candidate {
    class: usize,
    part: usize,
    unevenness: u64,
    index: usize,
    /// Among those of the same class and part, flattest first.
    rank: usize,
}

/// Chooses pixels of `channel` from a stack that is sorted by exposure.
pub(super) fn choose(stack: &[(&Image<Counts>, f64)], channel: usize, black: f64, white: f64) -> Chosen {
    let (width, height) = stack[0].0.size();
    let fraction = |count: u16| (f64::from(count) - black) / (white - black);
    let one_count = 1.0 / (white - black);
    let seen = |count: u16| {
        let fraction = fraction(count);
        (fraction >= 0.75 * one_count && fraction <= 1.0 - 0.75 * one_count).then_some(fraction)
    };
    // The sum of counts over all exposures rises with radiance whatever the response is, in about even steps of code.
    let ceiling = white as u16;
    let sum = |index: usize| -> u64 {
        stack.iter().map(|(image, _)| u64::from(image.pixels()[index][channel].min(ceiling))).sum()
    };
    let stride = ((width * height) as f64 / LOOKED_AT as f64).sqrt().ceil().max(1.0) as usize;
    let mut contradicting = 0;
    let mut candidates = Vec::new();
    let mut range = (u64::MAX, 0);
    for y in (stride / 2..height).step_by(stride) {
        for x in (stride / 2..width).step_by(stride) {
            let index = y * width + x;
            let counts = || stack.iter().map(|(image, _)| image.pixels()[index][channel]);
            if counts().filter(|count| seen(*count).is_some()).count() < 2 {
                continue;
            }
            if darkens(counts().map(&fraction), one_count) {
                contradicting += 1;
                continue;
            }
            let here = sum(index);
            let unevenness = neighbours(x, y, width, height).map(|n| sum(n).abs_diff(here)).max().unwrap_or(0);
            range = (range.0.min(here), range.1.max(here));
            let part = (y * PARTS / height) * PARTS + x * PARTS / width;
            candidates.push(Candidate { class: 0, part, unevenness, index, rank: 0 });
        }
    }
    let span = (range.1.saturating_sub(range.0) + 1).max(1);
    for candidate in &mut candidates {
        candidate.class = ((sum(candidate.index) - range.0) * CLASSES as u64 / span) as usize;
    }
    candidates.sort_by_key(|c| (c.class, c.part, c.unevenness, c.index));
    for i in 1..candidates.len() {
        if (candidates[i].class, candidates[i].part) == (candidates[i - 1].class, candidates[i - 1].part) {
            candidates[i].rank = candidates[i - 1].rank + 1;
        }
    }
    candidates.sort_by_key(|c| (c.class, c.rank, c.unevenness, c.index));
    let mut taken = [0; CLASSES];
    candidates.retain(|c| {
        taken[c.class] += 1;
        taken[c.class] <= MOST_OF_A_CLASS
    });
    let pixels = candidates
        .iter()
        .map(|c| stack.iter().map(|(image, _)| seen(image.pixels()[c.index][channel]).unwrap_or(f64::NAN)).collect())
        .collect();
    Chosen { pixels, contradicting }
}

/// Whether a pixel falls, as the exposure grows, by more than noise and JPEG explain: 4 % of the range and three counts.
fn darkens(fractions: impl Iterator<Item = f64>, one_count: f64) -> bool {
    let mut brightest = f64::NEG_INFINITY;
    for fraction in fractions {
        if fraction < brightest - 0.04 - 3.0 * one_count {
            return true;
        }
        brightest = brightest.max(fraction);
    }
    false
}

fn neighbours(x: usize, y: usize, width: usize, height: usize) -> impl Iterator<Item = usize> {
    let rows = y.saturating_sub(1)..(y + 2).min(height);
    rows.flat_map(move |row| (x.saturating_sub(1)..(x + 2).min(width)).map(move |column| row * width + column))
}
