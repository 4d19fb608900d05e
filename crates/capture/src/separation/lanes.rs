//! Lanes that are worked on together.

/// So many that compilers make loops of them, and few enough that a table of squares stays in the first two caches.
pub(super) const TOGETHER: usize = 64;

/// Values of lanes side by side.
pub(super) type Lanes<const W: usize> = [f32; W];

/// The lanes of a frame from `at` on; zero beyond its end.
#[inline(always)]
pub(super) fn load<const W: usize>(frame: &[f32], at: usize) -> Lanes<W> {
    match frame[at..].first_chunk() {
        Some(lanes) => *lanes,
        None => std::array::from_fn(|lane| frame.get(at + lane).copied().unwrap_or(0.0)),
    }
}

/// Puts lanes back to where they were loaded from.
#[inline(always)]
pub(super) fn store<const W: usize>(frame: &mut [f32], at: usize, lanes: &Lanes<W>) {
    match frame[at..].first_chunk_mut() {
        Some(place) => *place = *lanes,
        None => frame[at..].iter_mut().zip(lanes).for_each(|(place, value)| *place = *value),
    }
}

// Each of these is a function of its own so that the compiler knows that its arguments lie apart, and takes lanes together.

/// sum += values.
#[inline(always)]
pub(super) fn add<const W: usize>(sum: &mut Lanes<W>, values: &Lanes<W>) {
    (0..W).for_each(|lane| sum[lane] += values[lane]);
}

/// values += factor · step, and sum += values.
#[inline(always)]
pub(super) fn follow<const W: usize>(values: &mut Lanes<W>, factor: &Lanes<W>, step: &Lanes<W>, sum: &mut Lanes<W>) {
    (0..W).for_each(|lane| values[lane] += factor[lane] * step[lane]);
    (0..W).for_each(|lane| sum[lane] += values[lane]);
}

/// values *= factor, and sum += values.
#[inline(always)]
pub(super) fn scale<const W: usize>(values: &mut Lanes<W>, factor: &Lanes<W>, sum: &mut Lanes<W>) {
    (0..W).for_each(|lane| values[lane] *= factor[lane]);
    (0..W).for_each(|lane| sum[lane] += values[lane]);
}
