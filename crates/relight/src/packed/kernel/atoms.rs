//! From the atoms of a position to the sums v, over eight numbers side by side.
#![allow(unsafe_code)]

use super::lanes::{WithRows, prefetch};
use super::{Lanes, Row, Segment, Slot};
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

/// The row of the table that an id and an exponent ask for, and 2^exponent.
///
/// # Safety
/// There must be such, and the pointers lead to them.
#[inline(always)]
unsafe fn row<L: WithRows>(id: *const u8, exponent: *const u8, table: *const Row) -> (L::Four, f32) {
    // SAFETY: the caller's; exponents are below 32, and half rows have 8 bytes.
    unsafe {
        let half_rows = usize::from(u16::from_le(id.cast::<u16>().read_unaligned()));
        let row = table.cast::<[f32; 2]>().add(half_rows).cast::<Row>();
        (L::load_four(&*row), *POWERS.get_unchecked(usize::from(*exponent)))
    }
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
unsafe fn product<L: Lanes>(bytes: &[u8], (weight, index): (&Row, usize)) -> [L; 3] {
    // SAFETY: the caller's.
    unsafe { times(weight, coefficients(bytes, index)) }
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
pub(super) unsafe fn add<L: WithRows, const SPARSE: bool>(
    segment: &Segment<'_>,
    table: &[Row],
    weights: &mut [Row],
    slots: &mut [Slot],
) {
    let (mut whole, mut other) = (0, 0);
    let ahead = segment.ahead.len().div_ceil(segment.lists.max(1));
    // SAFETY: the runs count the lists and others of the segment; the rest is the caller's.
    unsafe {
        for run in segment.runs.chunks_exact(4) {
            let run = Run { lists: word(run, 0), others: word(run, 1), whole, other, ahead };
            // Loops of known length for the lengths that lists mostly have.
            match run.others {
                0 => add_run::<L, SPARSE, 0>(segment, &run, table, weights, slots),
                1 => add_run::<L, SPARSE, 1>(segment, &run, table, weights, slots),
                2 => add_run::<L, SPARSE, 2>(segment, &run, table, weights, slots),
                3 => add_run::<L, SPARSE, 3>(segment, &run, table, weights, slots),
                4 => add_run::<L, SPARSE, 4>(segment, &run, table, weights, slots),
                5 => add_run::<L, SPARSE, 5>(segment, &run, table, weights, slots),
                6 => add_run::<L, SPARSE, 6>(segment, &run, table, weights, slots),
                7 => add_run::<L, SPARSE, 7>(segment, &run, table, weights, slots),
                8 => add_run::<L, SPARSE, 8>(segment, &run, table, weights, slots),
                _ => add_run::<L, SPARSE, ANY>(segment, &run, table, weights, slots),
            }
            whole += run.lists;
            other += run.lists * run.others;
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

/// Lists of one length.
struct Run {
    lists: usize,
    /// Atoms of each list besides the whole.
    others: usize,
    /// The first whole and the first other atom.
    whole: usize,
    other: usize,
    /// Bytes to ask for in advance by each list.
    ahead: usize,
}

/// Stands for any number of others.
const ANY: usize = usize::MAX;

/// Adds the first coefficients of the atoms of a run whose lists have `OTHERS` others, and sets their weights.
///
/// # Safety
/// As [`add`], and the segment must have the run.
#[inline(always)]
unsafe fn add_run<L: WithRows, const SPARSE: bool, const OTHERS: usize>(
    segment: &Segment<'_>,
    run: &Run,
    table: &[Row],
    weights: &mut [Row],
    slots: &mut [Slot],
) {
    let others = if OTHERS == ANY { run.others } else { OTHERS };
    // SAFETY: the caller's; wholes come before the others.
    unsafe {
        let of_wholes = weights.as_mut_ptr();
        let of_others = of_wholes.add(segment.lists);
        // All weights first: what follows then reads each of them into all lanes at once.
        let table = table.as_ptr();
        let (whole_ids, whole_exponents) = (segment.whole_ids.as_ptr(), segment.whole_exponents.as_ptr());
        let mut ids = segment.ids.as_ptr().add(2 * run.other);
        let mut exponents = segment.exponents.as_ptr().add(run.other);
        let mut to = of_others.add(run.other);
        for whole in run.whole..run.whole + run.lists {
            prefetch(segment.ahead.as_ptr().wrapping_add(whole * run.ahead));
            let (main, power) = row::<L>(whole_ids.add(2 * whole), whole_exponents.add(whole), table);
            let weight = L::scale_four(main, power);
            let mut lit = weight;
            for other in 0..others {
                let (radiance, power) = row::<L>(ids.add(2 * other), exponents.add(other), table);
                let weight = L::scale_four(L::less_four(radiance, main), power);
                L::store_four(weight, &mut *to.add(other));
                if SPARSE {
                    lit = L::or_four(lit, weight);
                }
            }
            ids = ids.add(2 * others);
            exponents = exponents.add(others);
            to = to.add(others);
            L::store_four(weight, &mut *of_wholes.add(whole));
            if SPARSE {
                // The lane that is no channel says whether anything in the list is lit.
                (*of_wholes.add(whole)).0[3] = if L::is_zero_four(lit) { 0.0 } else { 1.0 };
            }
        }
        let mut first = run.other;
        for whole in run.whole..run.whole + run.lists {
            prefetch(segment.ahead.as_ptr().wrapping_add(whole * run.ahead + run.ahead / 2));
            let weight = &*of_wholes.add(whole);
            if !SPARSE || weight.0[3] != 0.0 {
                let mut even: [L; 3] = times(weight, coefficients(segment.whole_coefficients, whole));
                if others > 0 {
                    let mut odd = product(segment.coefficients, (&*of_others.add(first), first));
                    for index in 1..others {
                        let other = first + index;
                        let more = product(segment.coefficients, (&*of_others.add(other), other));
                        if index % 2 == 0 {
                            odd = plus(odd, more);
                        } else {
                            even = plus(even, more);
                        }
                    }
                    even = plus(even, odd);
                }
                let slot = word(segment.slots, whole);
                debug_assert!(slot < slots.len());
                add_to(slots.get_unchecked_mut(slot), even);
            }
            first += others;
        }
    }
}

/// Adds the first coefficients of the wholes of a position.
///
/// # Safety
/// As [`add`].
#[inline(always)]
pub(super) unsafe fn add_wholes<L: WithRows>(segment: &Segment<'_>, table: &[Row], slots: &mut [Slot]) {
    // SAFETY: there are as many wholes as lists; the rest is the caller's.
    unsafe {
        for whole in 0..segment.lists {
            if whole % 4 == 0 {
                // What wholes have there lies at its beginning, 13 bytes each.
                prefetch(segment.ahead.as_ptr().wrapping_add(16 * whole));
            }
            let (id, exponent) =
                (segment.whole_ids.as_ptr().add(2 * whole), segment.whole_exponents.as_ptr().add(whole));
            let (main, power) = row::<L>(id, exponent, table.as_ptr());
            let mut weight = Row::default();
            L::store_four(L::scale_four(main, power), &mut weight);
            let more = times(&weight, coefficients::<L>(segment.whole_coefficients, whole));
            add_to(slots.get_unchecked_mut(word(segment.slots, whole)), more);
        }
    }
}
