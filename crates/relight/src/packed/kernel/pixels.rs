//! From the sums v of a patch to its pixels, in whole numbers.
//!
//! The bases are 8 bits a value, so step · v is brought to whole numbers too: 30 bits, of which the largest of the patch takes
//! all, in two halves of 16. Their products with the bases are then exact and their sums stay within 32 bits, so that their
//! order is free; two components are multiplied at once. What is lost, less than 2⁻²⁹ of the largest value, is below what
//! single precision would lose.
#![allow(unsafe_code)]

use std::array::from_fn;

use super::lanes::Lanes;
use super::pairs::Pairs;
use super::{Basis, PIXELS, Slot};
use crate::packed::block::{COMPONENTS, PAIR};

/// As many as a file can name.
pub(super) const MOST_COMPONENTS: usize = u8::MAX as usize;
const MOST_SLOTS: usize = MOST_COMPONENTS.div_ceil(COMPONENTS);
/// Below 2 to this are the whole numbers.
const BITS: i32 = 29;
/// The lower half lies between −2¹⁴ and 2¹⁴; |upper| ≤ 2¹⁴. Of 255 components with bases of 8 bits, sums are below 2³⁰.
const LOW_BITS: i32 = 15;
/// Exponents below this are taken for it, so that the scale is a number.
const LEAST_EXPONENT: i32 = -97;

/// step · v of a patch, `[slot][channel][component]`, and in two halves of whole numbers. Room for it, filled anew for each patch.
#[derive(Clone)]
pub(crate) struct Fixed {
    values: [[[f32; COMPONENTS]; 3]; MOST_SLOTS],
    high: [[[i16; COMPONENTS]; 3]; MOST_SLOTS],
    low: [[[i16; COMPONENTS]; 3]; MOST_SLOTS],
    /// What 1 is worth.
    scale: f32,
}

impl Default for Fixed {
    fn default() -> Self {
        let halves = [[[0; COMPONENTS]; 3]; MOST_SLOTS];
        Self { values: [[[0.0; COMPONENTS]; 3]; MOST_SLOTS], high: halves, low: halves, scale: 0.0 }
    }
}

/// 2^exponent, of a normal number.
#[inline(always)]
fn power(exponent: i32) -> f32 {
    f32::from_bits(((exponent + 127) as u32) << 23)
}

impl Fixed {
    /// Takes the sums of some slots; `false` if something is no finite number.
    ///
    /// # Safety
    /// There must be as many steps, for slots of at most [`MOST_COMPONENTS`].
    #[inline(always)]
    unsafe fn fill<E: Lanes>(&mut self, steps: &[[f32; COMPONENTS]], slots: &[Slot]) -> bool {
        debug_assert!(E::COUNT == COMPONENTS && slots.len() <= MOST_SLOTS && slots.len() <= steps.len());
        let mut largest = [0.0f32; COMPONENTS];
        // SAFETY: the caller's.
        unsafe {
            let mut most = E::splat(0.0);
            for (values, (slot, steps)) in self.values.iter_mut().zip(slots.iter().zip(steps)) {
                let steps = E::load(steps.as_ptr());
                for (values, sums) in values.iter_mut().zip(&slot.0) {
                    let scaled = E::load(sums.as_ptr()).mul(steps);
                    most = most.max_magnitude(scaled);
                    scaled.store(values.as_mut_ptr());
                }
            }
            most.store(largest.as_mut_ptr());
        }
        let largest = largest.into_iter().map(f32::to_bits).fold(0, u32::max);
        if largest >= f32::INFINITY.to_bits() {
            return false;
        }
        // The largest is below 2^exponent.
        let exponent = ((largest >> 23) as i32 - 126).max(LEAST_EXPONENT);
        let ones = power(BITS - exponent);
        self.scale = power(exponent - BITS);
        for (values, (high, low)) in self.values.iter().zip(self.high.iter_mut().zip(&mut self.low)).take(slots.len()) {
            for (values, (high, low)) in values.iter().zip(high.iter_mut().zip(low)) {
                // SAFETY: finite and below 2²⁹.
                let whole: [i32; COMPONENTS] = from_fn(|i| unsafe { (values[i] * ones).to_int_unchecked() });
                let upper: [i32; COMPONENTS] = from_fn(|i| (whole[i] + (1 << (LOW_BITS - 1))) >> LOW_BITS);
                *high = upper.map(|upper| upper as i16);
                *low = from_fn(|i| (whole[i] - (upper[i] << LOW_BITS)) as i16);
            }
        }
        true
    }
}

/// Σ step · basis · v over the first `components` into the pixels of a patch.
///
/// # Safety
/// There must be as many steps, components of the basis and sums in `slots`, at most 255.
#[inline(always)]
pub(super) unsafe fn pixels<E: Lanes, L: Pairs>(
    basis: &Basis<'_>,
    slots: &[Slot],
    components: usize,
    (fixed, out): (&mut Fixed, &mut [[f32; 3]; PIXELS]),
) {
    let slots = &slots[..components.div_ceil(COMPONENTS)];
    // SAFETY: the caller's.
    if !unsafe { fixed.fill::<E>(basis.steps, slots) } {
        *out = [[f32::NAN; 3]; PIXELS];
        return;
    }
    let fixed = &*fixed;
    let mut planes = [[0.0f32; PIXELS]; 3];
    // SAFETY: the caller's.
    unsafe {
        // As many sums at once as there are registers for.
        match L::COUNT {
            16 => planes_of::<L, 3, 4>(basis, (slots, fixed), components, [0, 0], &mut planes),
            8 => {
                for channel in 0..3 {
                    for first in [0, 32] {
                        planes_of::<L, 1, 4>(basis, (slots, fixed), components, [channel, first], &mut planes);
                    }
                }
            }
            _ => {
                for channel in 0..3 {
                    for first in [0, 32] {
                        planes_of::<L, 1, 8>(basis, (slots, fixed), components, [channel, first], &mut planes);
                    }
                }
            }
        }
    }
    for (pixel, out) in out.iter_mut().enumerate() {
        *out = [planes[0][pixel], planes[1][pixel], planes[2][pixel]];
    }
}

/// `CHANNELS` channels from a first one on, `VECTORS` · `L::COUNT` pixels from a first one on.
///
/// # Safety
/// As [`pixels`].
#[inline(always)]
unsafe fn planes_of<L: Pairs, const CHANNELS: usize, const VECTORS: usize>(
    basis: &Basis<'_>,
    (slots, fixed): (&[Slot], &Fixed),
    components: usize,
    [first_channel, first_pixel]: [usize; 2],
    planes: &mut [[f32; PIXELS]; 3],
) {
    // SAFETY: there are PAIR values of two components; the rest is the caller's.
    unsafe {
        let mut sums = [[[L::zero(); 2]; VECTORS]; CHANNELS];
        for (group, _) in slots.iter().enumerate().filter(|(_, slot)| !slot.is_zero()) {
            let start = group * COMPONENTS / 2;
            let (high, low) = (fixed.high.get_unchecked(group), fixed.low.get_unchecked(group));
            for pair in 0..COMPONENTS.min(components - group * COMPONENTS).div_ceil(2) {
                let from = basis.values.as_ptr().add((start + pair) * PAIR);
                for (index, sums) in sums.iter_mut().enumerate() {
                    let channel = first_channel + index;
                    let high = L::splat(high.get_unchecked(channel).as_ptr().add(2 * pair));
                    let low = L::splat(low.get_unchecked(channel).as_ptr().add(2 * pair));
                    for (index, [sum_high, sum_low]) in sums.iter_mut().enumerate() {
                        let offset = 2 * (channel * PIXELS + first_pixel + index * L::COUNT);
                        let values = L::widen(from.add(offset));
                        *sum_high = sum_high.add_products(values, high);
                        *sum_low = sum_low.add_products(values, low);
                    }
                }
            }
        }
        for (index, sums) in sums.iter().enumerate() {
            let plane = planes.get_unchecked_mut(first_channel + index);
            for (index, [high, low]) in sums.iter().enumerate() {
                let to = plane.as_mut_ptr().add(first_pixel + index * L::COUNT);
                L::join(*high, *low, power(LOW_BITS), fixed.scale, to);
            }
        }
    }
}
