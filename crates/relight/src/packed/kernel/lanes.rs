//! Numbers side by side, each of which is computed as if it were alone.
#![allow(unsafe_code)]

use crate::packed::weights::Row;

/// Numbers side by side. Every operation is that of single precision on each of them, rounded once.
pub(super) trait Lanes: Copy {
    /// How many.
    const COUNT: usize;

    /// All the same.
    ///
    /// # Safety
    /// Here and below: the machine has the features of these lanes, and pointers lead to [`Lanes::COUNT`] values; they need
    /// no alignment.
    unsafe fn splat(value: f32) -> Self;
    unsafe fn load(from: *const f32) -> Self;
    unsafe fn store(self, to: *mut f32);
    /// Of 8 bits.
    unsafe fn widen(from: *const i8) -> Self;
    unsafe fn add(self, other: Self) -> Self;
    unsafe fn mul(self, other: Self) -> Self;
    /// The larger of both, as bits without their sign: for numbers the larger magnitude, and more than all if one is none.
    unsafe fn max_magnitude(self, other: Self) -> Self;
}

/// Eight numbers, and four: a row of weights.
pub(super) trait WithRows: Lanes {
    /// A row of weights.
    type Four: Copy;

    /// # Safety
    /// Here and below: the machine has the features of these lanes.
    unsafe fn load_four(row: &Row) -> Self::Four;
    unsafe fn store_four(four: Self::Four, row: &mut Row);
    unsafe fn less_four(four: Self::Four, less: Self::Four) -> Self::Four;
    unsafe fn scale_four(four: Self::Four, power: f32) -> Self::Four;
    /// All bits of both.
    unsafe fn or_four(a: Self::Four, b: Self::Four) -> Self::Four;
    /// Whether no bits but signs are set.
    unsafe fn is_zero_four(four: Self::Four) -> bool;
}

/// Asks for memory that will be read soon.
#[inline(always)]
pub(super) fn prefetch(from: *const u8) {
    #[cfg(target_arch = "x86_64")]
    // SAFETY: asking for memory is allowed wherever it is, and every x86-64 can.
    unsafe {
        std::arch::x86_64::_mm_prefetch::<{ std::arch::x86_64::_MM_HINT_T1 }>(from.cast());
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = from;
}

/// Eight numbers in plain Rust.
#[derive(Clone, Copy)]
pub(super) struct Plain([f32; 8]);

impl Lanes for Plain {
    const COUNT: usize = 8;

    #[inline(always)]
    unsafe fn splat(value: f32) -> Self {
        Self([value; 8])
    }

    #[inline(always)]
    unsafe fn load(from: *const f32) -> Self {
        // SAFETY: the caller's.
        Self(unsafe { from.cast::<[f32; 8]>().read_unaligned() })
    }

    #[inline(always)]
    unsafe fn store(self, to: *mut f32) {
        // SAFETY: the caller's.
        unsafe { to.cast::<[f32; 8]>().write_unaligned(self.0) }
    }

    #[inline(always)]
    unsafe fn widen(from: *const i8) -> Self {
        // SAFETY: the caller's.
        Self(unsafe { from.cast::<[i8; 8]>().read_unaligned() }.map(f32::from))
    }

    #[inline(always)]
    unsafe fn add(self, other: Self) -> Self {
        Self(std::array::from_fn(|lane| self.0[lane] + other.0[lane]))
    }

    #[inline(always)]
    unsafe fn mul(self, other: Self) -> Self {
        Self(std::array::from_fn(|lane| self.0[lane] * other.0[lane]))
    }

    #[inline(always)]
    unsafe fn max_magnitude(self, other: Self) -> Self {
        let bits = |value: f32| value.to_bits() & 0x7fff_ffff;
        Self(std::array::from_fn(|lane| f32::from_bits(bits(self.0[lane]).max(bits(other.0[lane])))))
    }
}

impl WithRows for Plain {
    type Four = [f32; 4];

    #[inline(always)]
    unsafe fn load_four(row: &Row) -> [f32; 4] {
        row.0
    }

    #[inline(always)]
    unsafe fn store_four(four: [f32; 4], row: &mut Row) {
        row.0 = four;
    }

    #[inline(always)]
    unsafe fn less_four(four: [f32; 4], less: [f32; 4]) -> [f32; 4] {
        std::array::from_fn(|channel| four[channel] - less[channel])
    }

    #[inline(always)]
    unsafe fn scale_four(four: [f32; 4], power: f32) -> [f32; 4] {
        four.map(|value| value * power)
    }

    #[inline(always)]
    unsafe fn or_four(a: [f32; 4], b: [f32; 4]) -> [f32; 4] {
        std::array::from_fn(|channel| f32::from_bits(a[channel].to_bits() | b[channel].to_bits()))
    }

    #[inline(always)]
    unsafe fn is_zero_four(four: [f32; 4]) -> bool {
        four == [0.0; 4]
    }
}

#[cfg(target_arch = "x86_64")]
pub(super) use x86::Eight;

#[cfg(target_arch = "x86_64")]
mod x86 {
    use std::arch::x86_64::{
        __m128, __m256, _mm_cmpneq_ps, _mm_load_ps, _mm_loadl_epi64, _mm_movemask_ps, _mm_mul_ps, _mm_or_ps,
        _mm_set1_ps, _mm_setzero_ps, _mm_store_ps, _mm_sub_ps, _mm256_add_ps, _mm256_and_si256, _mm256_castps_si256,
        _mm256_castsi256_ps, _mm256_cvtepi8_epi32, _mm256_cvtepi32_ps, _mm256_loadu_ps, _mm256_max_epu32,
        _mm256_mul_ps, _mm256_set1_epi32, _mm256_set1_ps, _mm256_storeu_ps,
    };

    use super::{Lanes, WithRows};
    use crate::packed::weights::Row;

    /// Eight numbers of AVX2.
    #[derive(Clone, Copy)]
    pub(in super::super) struct Eight(__m256);

    // SAFETY of every block below: the caller's.
    impl Lanes for Eight {
        const COUNT: usize = 8;

        #[inline(always)]
        unsafe fn splat(value: f32) -> Self {
            Self(unsafe { _mm256_set1_ps(value) })
        }

        #[inline(always)]
        unsafe fn load(from: *const f32) -> Self {
            Self(unsafe { _mm256_loadu_ps(from) })
        }

        #[inline(always)]
        unsafe fn store(self, to: *mut f32) {
            unsafe { _mm256_storeu_ps(to, self.0) }
        }

        #[inline(always)]
        unsafe fn widen(from: *const i8) -> Self {
            Self(unsafe { _mm256_cvtepi32_ps(_mm256_cvtepi8_epi32(_mm_loadl_epi64(from.cast()))) })
        }

        #[inline(always)]
        unsafe fn add(self, other: Self) -> Self {
            Self(unsafe { _mm256_add_ps(self.0, other.0) })
        }

        #[inline(always)]
        unsafe fn mul(self, other: Self) -> Self {
            Self(unsafe { _mm256_mul_ps(self.0, other.0) })
        }

        #[inline(always)]
        unsafe fn max_magnitude(self, other: Self) -> Self {
            unsafe {
                let bits = |value| _mm256_and_si256(_mm256_castps_si256(value), _mm256_set1_epi32(i32::MAX));
                Self(_mm256_castsi256_ps(_mm256_max_epu32(bits(self.0), bits(other.0))))
            }
        }
    }

    impl WithRows for Eight {
        type Four = __m128;

        #[inline(always)]
        unsafe fn load_four(row: &Row) -> __m128 {
            unsafe { _mm_load_ps(row.0.as_ptr()) }
        }

        #[inline(always)]
        unsafe fn store_four(four: __m128, row: &mut Row) {
            unsafe { _mm_store_ps(row.0.as_mut_ptr(), four) }
        }

        #[inline(always)]
        unsafe fn less_four(four: __m128, less: __m128) -> __m128 {
            unsafe { _mm_sub_ps(four, less) }
        }

        #[inline(always)]
        unsafe fn scale_four(four: __m128, power: f32) -> __m128 {
            unsafe { _mm_mul_ps(four, _mm_set1_ps(power)) }
        }

        #[inline(always)]
        unsafe fn or_four(a: __m128, b: __m128) -> __m128 {
            unsafe { _mm_or_ps(a, b) }
        }

        #[inline(always)]
        unsafe fn is_zero_four(four: __m128) -> bool {
            unsafe { _mm_movemask_ps(_mm_cmpneq_ps(four, _mm_setzero_ps())) == 0 }
        }
    }
}

#[cfg(target_arch = "aarch64")]
pub(super) use arm::Neon;

#[cfg(target_arch = "aarch64")]
mod arm {
    use std::arch::aarch64::{
        float32x4_t, vabsq_f32, vaddq_f32, vcvtq_f32_s32, vdupq_n_f32, vget_high_s16, vget_low_s16, vld1_s8, vld1q_f32,
        vmaxq_u32, vmaxvq_u32, vmovl_s8, vmovl_s16, vmulq_f32, vorrq_u32, vreinterpretq_f32_u32, vreinterpretq_u32_f32,
        vshlq_n_u32, vst1q_f32, vsubq_f32,
    };

    use super::{Lanes, WithRows};
    use crate::packed::weights::Row;

    /// Eight numbers of NEON.
    #[derive(Clone, Copy)]
    pub(in super::super) struct Neon(float32x4_t, float32x4_t);

    // SAFETY of every block below: the caller's.
    impl Lanes for Neon {
        const COUNT: usize = 8;

        #[inline(always)]
        unsafe fn splat(value: f32) -> Self {
            unsafe { Self(vdupq_n_f32(value), vdupq_n_f32(value)) }
        }

        #[inline(always)]
        unsafe fn load(from: *const f32) -> Self {
            unsafe { Self(vld1q_f32(from), vld1q_f32(from.add(4))) }
        }

        #[inline(always)]
        unsafe fn store(self, to: *mut f32) {
            unsafe {
                vst1q_f32(to, self.0);
                vst1q_f32(to.add(4), self.1);
            }
        }

        #[inline(always)]
        unsafe fn widen(from: *const i8) -> Self {
            unsafe {
                let words = vmovl_s8(vld1_s8(from));
                let (low, high) = (vmovl_s16(vget_low_s16(words)), vmovl_s16(vget_high_s16(words)));
                Self(vcvtq_f32_s32(low), vcvtq_f32_s32(high))
            }
        }

        #[inline(always)]
        unsafe fn add(self, other: Self) -> Self {
            unsafe { Self(vaddq_f32(self.0, other.0), vaddq_f32(self.1, other.1)) }
        }

        #[inline(always)]
        unsafe fn mul(self, other: Self) -> Self {
            unsafe { Self(vmulq_f32(self.0, other.0), vmulq_f32(self.1, other.1)) }
        }

        #[inline(always)]
        unsafe fn max_magnitude(self, other: Self) -> Self {
            unsafe {
                let bits = |value| vreinterpretq_u32_f32(vabsq_f32(value));
                let larger = |a, b| vreinterpretq_f32_u32(vmaxq_u32(bits(a), bits(b)));
                Self(larger(self.0, other.0), larger(self.1, other.1))
            }
        }
    }

    impl WithRows for Neon {
        type Four = float32x4_t;

        #[inline(always)]
        unsafe fn load_four(row: &Row) -> float32x4_t {
            unsafe { vld1q_f32(row.0.as_ptr()) }
        }

        #[inline(always)]
        unsafe fn store_four(four: float32x4_t, row: &mut Row) {
            unsafe { vst1q_f32(row.0.as_mut_ptr(), four) }
        }

        #[inline(always)]
        unsafe fn less_four(four: float32x4_t, less: float32x4_t) -> float32x4_t {
            unsafe { vsubq_f32(four, less) }
        }

        #[inline(always)]
        unsafe fn scale_four(four: float32x4_t, power: f32) -> float32x4_t {
            unsafe { vmulq_f32(four, vdupq_n_f32(power)) }
        }

        #[inline(always)]
        unsafe fn or_four(a: float32x4_t, b: float32x4_t) -> float32x4_t {
            unsafe { vreinterpretq_f32_u32(vorrq_u32(vreinterpretq_u32_f32(a), vreinterpretq_u32_f32(b))) }
        }

        #[inline(always)]
        unsafe fn is_zero_four(four: float32x4_t) -> bool {
            unsafe { vmaxvq_u32(vshlq_n_u32::<1>(vreinterpretq_u32_f32(four))) == 0 }
        }
    }
}
