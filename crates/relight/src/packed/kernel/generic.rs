//! The loops, over lanes of any width.
#![allow(unsafe_code)]

use super::{Lanes, PIXELS, Row, Segment, Slot};
use crate::packed::block::COMPONENTS;

/// 2^exponent.
static POWERS: [f32; 32] = {
    let mut powers = [1.0; 32];
    let mut exponent = 1;
    while exponent < 32 {
        powers[exponent] = powers[exponent - 1] * 2.0;
        exponent += 1;
    }
    powers
};

/// The `index`-th number of 16 bits.
///
/// # Safety
/// There must be one.
#[inline(always)]
unsafe fn word(bytes: &[u8], index: usize) -> usize {
    debug_assert!(2 * index + 2 <= bytes.len());
    // SAFETY: the caller's.
    u16::from_le(unsafe { bytes.as_ptr().cast::<u16>().add(index).read_unaligned() }).into()
}

/// 2^exponent · (row of the table − `from`).
///
/// # Safety
/// There must be an `index`-th id and exponent, and a row of that id.
#[inline(always)]
unsafe fn weight((ids, exponents): (&[u8], &[u8]), index: usize, table: &[Row], from: [f32; 4]) -> [f32; 4] {
    // SAFETY: the caller's; exponents are below 32.
    let (row, power) = unsafe {
        let id = word(ids, index);
        debug_assert!(id < table.len() && exponents[index] < 32);
        (table.get_unchecked(id).0, *POWERS.get_unchecked(usize::from(*exponents.get_unchecked(index))))
    };
    [0, 1, 2, 3].map(|channel| (row[channel] - from[channel]) * power)
}

/// Eight coefficients of the `index`-th atom or tail.
///
/// # Safety
/// There must be one.
#[inline(always)]
unsafe fn coefficients<L: Lanes>(bytes: &[u8], index: usize) -> L {
    debug_assert!(L::COUNT == COMPONENTS && (index + 1) * COMPONENTS <= bytes.len());
    // SAFETY: the caller's.
    unsafe { L::widen(bytes.as_ptr().cast::<i8>().add(index * COMPONENTS)) }
}

/// weight · coefficients by channel.
#[inline(always)]
unsafe fn times<L: Lanes>(weight: &Row, coefficients: L) -> [L; 3] {
    // SAFETY: the caller's.
    unsafe {
        [
            L::splat(weight.0[0]).mul(coefficients),
            L::splat(weight.0[1]).mul(coefficients),
            L::splat(weight.0[2]).mul(coefficients),
        ]
    }
}

/// weight · coefficients of the `index`-th atom.
///
/// # Safety
/// There must be one.
#[inline(always)]
unsafe fn term<L: Lanes>(weights: &[Row], bytes: &[u8], index: usize) -> [L; 3] {
    // SAFETY: the caller's.
    unsafe { times(weights.get_unchecked(index), coefficients(bytes, index)) }
}

/// a + b by channel.
#[inline(always)]
unsafe fn plus<L: Lanes>(a: [L; 3], b: [L; 3]) -> [L; 3] {
    // SAFETY: the caller's.
    unsafe { [a[0].add(b[0]), a[1].add(b[1]), a[2].add(b[2])] }
}

/// Adds to a slot.
#[inline(always)]
unsafe fn add_to<L: Lanes>(slot: &mut Slot, more: [L; 3]) {
    let [red, green, blue] = &mut slot.0;
    // SAFETY: the caller's; a channel has 8 components.
    unsafe {
        L::load(red.as_ptr()).add(more[0]).store(red.as_mut_ptr());
        L::load(green.as_ptr()).add(more[1]).store(green.as_mut_ptr());
        L::load(blue.as_ptr()).add(more[2]).store(blue.as_mut_ptr());
    }
}

/// Adds all atoms of a position: in each list the whole, 2nd, 4th … other first, beside them the 1st, 3rd …, then both to the slot.
///
/// # Safety
/// Ids must be below the rows of `table`, slots below `slots`, and `weights` as many as atoms. Lanes are eight.
#[inline(always)]
pub(super) unsafe fn add<L: Lanes, const SPARSE: bool>(
    segment: &Segment<'_>,
    table: &[Row],
    weights: &mut [Row],
    slots: &mut [Slot],
) {
    let (of_wholes, of_others) = weights[..segment.atoms()].split_at_mut(segment.lists);
    let (mut whole, mut first) = (0, 0);
    // SAFETY: the runs count the lists and others of the segment; the rest is the caller's.
    unsafe {
        for run in segment.runs.chunks_exact(4) {
            let (lists, others) = (word(run, 0), word(run, 1));
            for _ in 0..lists {
                let radiance = weight((segment.whole_ids, segment.whole_exponents), whole, table, [0.0; 4]);
                let main = table.get_unchecked(word(segment.whole_ids, whole)).0;
                *of_wholes.get_unchecked_mut(whole) = Row(radiance);
                let mut lit = radiance.map(f32::to_bits);
                for other in first..first + others {
                    let difference = weight((segment.ids, segment.exponents), other, table, main);
                    *of_others.get_unchecked_mut(other) = Row(difference);
                    if SPARSE {
                        (0..4).for_each(|channel| lit[channel] |= difference[channel].to_bits());
                    }
                }
                if !SPARSE || (lit[0] | lit[1] | lit[2]) << 1 != 0 {
                    let mut even: [L; 3] = term(of_wholes, segment.whole_coefficients, whole);
                    if others > 0 {
                        let bytes = segment.coefficients;
                        let mut odd = term(of_others, bytes, first);
                        let mut other = first + 1;
                        while other + 1 < first + others {
                            even = plus(even, term(of_others, bytes, other));
                            odd = plus(odd, term(of_others, bytes, other + 1));
                            other += 2;
                        }
                        if other < first + others {
                            even = plus(even, term(of_others, bytes, other));
                        }
                        even = plus(even, odd);
                    }
                    let slot = word(segment.slots, whole);
                    debug_assert!(slot < slots.len());
                    add_to(slots.get_unchecked_mut(slot), even);
                }
                whole += 1;
                first += others;
            }
        }
        for tail in 0..segment.tails {
            let weight = weights.get_unchecked(word(segment.tail_atoms, tail));
            let slot = word(segment.tail_slots, tail);
            debug_assert!(slot < slots.len());
            let more = times(weight, coefficients::<L>(segment.tail_coefficients, tail));
            add_to(slots.get_unchecked_mut(slot), more);
        }
    }
}

/// Adds the first coefficients of the wholes of a position.
///
/// # Safety
/// As [`add`].
#[inline(always)]
pub(super) unsafe fn add_wholes<L: Lanes>(segment: &Segment<'_>, table: &[Row], slots: &mut [Slot]) {
    // SAFETY: there are as many wholes as lists; the rest is the caller's.
    unsafe {
        for whole in 0..segment.lists {
            let radiance = weight((segment.whole_ids, segment.whole_exponents), whole, table, [0.0; 4]);
            let more = times(&Row(radiance), coefficients::<L>(segment.whole_coefficients, whole));
            add_to(slots.get_unchecked_mut(word(segment.slots, whole)), more);
        }
    }
}

/// Σ step · basis · v over the first `components`, in their order, into the pixels of a patch.
///
/// # Safety
/// There must be as many steps, vectors of the basis and sums in `slots`.
#[inline(always)]
pub(super) unsafe fn pixels<L: Lanes>(
    basis: &[i8],
    steps: &[f32],
    slots: &[Slot],
    components: usize,
    out: &mut [[f32; 3]; PIXELS],
) {
    let mut planes = [[0.0f32; PIXELS]; 3];
    for (channel, plane) in planes.iter_mut().enumerate() {
        // SAFETY: each component has PIXELS values a channel; the rest is the caller's.
        unsafe {
            let mut sums = [L::splat(0.0); PIXELS / 8];
            for component in 0..components {
                let slot = slots.get_unchecked(component / COMPONENTS);
                let value = *steps.get_unchecked(component) * slot.0[channel][component % COMPONENTS];
                let value = L::splat(value);
                let from = basis.as_ptr().add((component * 3 + channel) * PIXELS);
                for (index, sum) in sums.iter_mut().enumerate().take(PIXELS / L::COUNT) {
                    *sum = sum.add(value.mul(L::widen(from.add(index * L::COUNT))));
                }
            }
            for (index, sum) in sums.iter().enumerate().take(PIXELS / L::COUNT) {
                sum.store(plane.as_mut_ptr().add(index * L::COUNT));
            }
        }
    }
    for (pixel, out) in out.iter_mut().enumerate() {
        *out = [planes[0][pixel], planes[1][pixel], planes[2][pixel]];
    }
}
