//! Lanes that are worked on together, and the loops over them compiled for what the machine has.

/// As many lanes as two registers of AVX2 hold: a table of squares of so many stays in the first cache.
pub(crate) const TOGETHER: usize = 64;

/// Values of lanes side by side.
pub(crate) type Lanes<const W: usize> = [f32; W];

/// The lanes of a frame from `at` on; zero beyond its end.
#[inline(always)]
pub(crate) fn load<const W: usize>(frame: &[f32], at: usize) -> Lanes<W> {
    match frame[at..].first_chunk() {
        Some(lanes) => *lanes,
        None => std::array::from_fn(|lane| frame.get(at + lane).copied().unwrap_or(0.0)),
    }
}

/// Puts lanes back to where they were loaded from.
#[inline(always)]
pub(crate) fn store<const W: usize>(frame: &mut [f32], at: usize, lanes: &Lanes<W>) {
    match frame[at..].first_chunk_mut() {
        Some(place) => *place = *lanes,
        None => frame[at..].iter_mut().zip(lanes).for_each(|(place, value)| *place = *value),
    }
}

// Each of these is a function of its own so that the compiler knows that its arguments lie apart, and takes lanes together.

/// sum += values.
#[inline(always)]
pub(crate) fn add<const W: usize>(sum: &mut Lanes<W>, values: &Lanes<W>) {
    (0..W).for_each(|lane| sum[lane] += values[lane]);
}

/// values += factor · step, and sum += values.
#[inline(always)]
pub(crate) fn follow<const W: usize>(
    values: &mut Lanes<W>,
    factor: &Lanes<W>,
    step: &Lanes<W>,
    sum: &mut Lanes<W>,
) {
    (0..W).for_each(|lane| values[lane] += factor[lane] * step[lane]);
    (0..W).for_each(|lane| sum[lane] += values[lane]);
}

/// values *= factor, and sum += values.
#[inline(always)]
pub(crate) fn scale<const W: usize>(values: &mut Lanes<W>, factor: &Lanes<W>, sum: &mut Lanes<W>) {
    (0..W).for_each(|lane| values[lane] *= factor[lane]);
    (0..W).for_each(|lane| sum[lane] += values[lane]);
}

/// Defines a function that calls `plain`, compiled for AVX2 where the machine has it. Both give the same bits: what is
/// compiled for AVX2 does the same to every lane, and nothing is fused.
macro_rules! for_this_machine {
    ($(#[$about:meta])* fn $name:ident($($argument:ident: $kind:ty),* $(,)?) -> $result:ty = $plain:expr) => {
        $(#[$about])*
        fn $name($($argument: $kind),*) -> $result {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn with_avx2($($argument: $kind),*) -> $result {
                    $plain($($argument),*)
                }
                if is_x86_feature_detected!("avx2") {
                    // SAFETY: the feature was found.
                    #[allow(unsafe_code)]
                    return unsafe { with_avx2($($argument),*) };
                }
            }
            $plain($($argument),*)
        }
    };
}
pub(crate) use for_this_machine;
