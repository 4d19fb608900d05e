//! Whole numbers side by side, each of which takes the products of two components at a time.
#![allow(unsafe_code)]

/// Sums of whole numbers in 32 bits, one a pixel.
pub(super) trait Pairs: Copy {
    /// Pixels.
    const COUNT: usize;
    /// Two numbers of 16 bits a pixel.
    type Words: Copy;

    /// Nothing summed yet.
    ///
    /// # Safety
    /// Here and below: the machine has the features of these lanes, and pointers lead to as many values as are read or written;
    /// they need no alignment.
    unsafe fn zero() -> Self;
    /// Two numbers of 8 bits a pixel.
    unsafe fn widen(from: *const i8) -> Self::Words;
    /// The same two numbers for every pixel.
    unsafe fn splat(from: *const i16) -> Self::Words;
    /// Adds to each pixel the products of its two numbers with two others. Sums must stay within 32 bits.
    unsafe fn add_products(self, values: Self::Words, weights: Self::Words) -> Self;
    /// (high · `base` + low) · `scale`, each rounded to single precision in this order.
    unsafe fn join(high: Self, low: Self, base: f32, scale: f32, to: *mut f32);
}

/// Eight pixels in plain Rust.
#[derive(Clone, Copy)]
pub(super) struct Plain([i32; 8]);

impl Pairs for Plain {
    const COUNT: usize = 8;
    type Words = [i16; 16];

    #[inline(always)]
    unsafe fn zero() -> Self {
        Self([0; 8])
    }

    #[inline(always)]
    unsafe fn widen(from: *const i8) -> [i16; 16] {
        // SAFETY: the caller's.
        unsafe { from.cast::<[i8; 16]>().read_unaligned() }.map(i16::from)
    }

    #[inline(always)]
    unsafe fn splat(from: *const i16) -> [i16; 16] {
        // SAFETY: the caller's.
        let two = unsafe { from.cast::<[i16; 2]>().read_unaligned() };
        std::array::from_fn(|lane| two[lane % 2])
    }

    #[inline(always)]
    unsafe fn add_products(self, values: [i16; 16], weights: [i16; 16]) -> Self {
        let product = |lane: usize| i32::from(values[lane]) * i32::from(weights[lane]);
        Self(std::array::from_fn(|pixel| self.0[pixel] + product(2 * pixel) + product(2 * pixel + 1)))
    }

    #[inline(always)]
    unsafe fn join(high: Self, low: Self, base: f32, scale: f32, to: *mut f32) {
        let joined: [f32; 8] = std::array::from_fn(|pixel| (high.0[pixel] as f32 * base + low.0[pixel] as f32) * scale);
        // SAFETY: the caller's.
        unsafe { to.cast::<[f32; 8]>().write_unaligned(joined) }
    }
}

#[cfg(target_arch = "x86_64")]
pub(super) use x86::{Eight, Sixteen};

#[cfg(target_arch = "x86_64")]
mod x86 {
    use std::arch::x86_64::{
        __m256i, __m512i, _mm_loadu_si128, _mm256_add_epi32, _mm256_add_ps, _mm256_cvtepi8_epi16, _mm256_cvtepi32_ps,
        _mm256_loadu_si256, _mm256_madd_epi16, _mm256_mul_ps, _mm256_set1_epi32, _mm256_set1_ps, _mm256_setzero_si256,
        _mm256_storeu_ps, _mm512_add_epi32, _mm512_add_ps, _mm512_cvtepi8_epi16, _mm512_cvtepi32_ps,
        _mm512_dpwssd_epi32, _mm512_madd_epi16, _mm512_mul_ps, _mm512_set1_epi32, _mm512_set1_ps, _mm512_setzero_si512,
        _mm512_storeu_ps,
    };

    use super::Pairs;

    /// Eight pixels of AVX2.
    #[derive(Clone, Copy)]
    pub(in super::super) struct Eight(__m256i);

    // SAFETY of every block below: the caller's.
    impl Pairs for Eight {
        const COUNT: usize = 8;
        type Words = __m256i;

        #[inline(always)]
        unsafe fn zero() -> Self {
            Self(unsafe { _mm256_setzero_si256() })
        }

        #[inline(always)]
        unsafe fn widen(from: *const i8) -> __m256i {
            unsafe { _mm256_cvtepi8_epi16(_mm_loadu_si128(from.cast())) }
        }

        #[inline(always)]
        unsafe fn splat(from: *const i16) -> __m256i {
            unsafe { _mm256_set1_epi32(from.cast::<i32>().read_unaligned()) }
        }

        #[inline(always)]
        unsafe fn add_products(self, values: __m256i, weights: __m256i) -> Self {
            Self(unsafe { _mm256_add_epi32(self.0, _mm256_madd_epi16(values, weights)) })
        }

        #[inline(always)]
        unsafe fn join(high: Self, low: Self, base: f32, scale: f32, to: *mut f32) {
            unsafe {
                let high = _mm256_mul_ps(_mm256_cvtepi32_ps(high.0), _mm256_set1_ps(base));
                let joined = _mm256_add_ps(high, _mm256_cvtepi32_ps(low.0));
                _mm256_storeu_ps(to, _mm256_mul_ps(joined, _mm256_set1_ps(scale)));
            }
        }
    }

    /// Sixteen pixels of AVX-512; `VNNI`: of machines that multiply and add whole numbers at once.
    #[derive(Clone, Copy)]
    pub(in super::super) struct Sixteen<const VNNI: bool>(__m512i);

    impl<const VNNI: bool> Pairs for Sixteen<VNNI> {
        const COUNT: usize = 16;
        type Words = __m512i;

        #[inline(always)]
        unsafe fn zero() -> Self {
            Self(unsafe { _mm512_setzero_si512() })
        }

        #[inline(always)]
        unsafe fn widen(from: *const i8) -> __m512i {
            unsafe { _mm512_cvtepi8_epi16(_mm256_loadu_si256(from.cast())) }
        }

        #[inline(always)]
        unsafe fn splat(from: *const i16) -> __m512i {
            unsafe { _mm512_set1_epi32(from.cast::<i32>().read_unaligned()) }
        }

        #[inline(always)]
        unsafe fn add_products(self, values: __m512i, weights: __m512i) -> Self {
            Self(unsafe {
                if VNNI {
                    _mm512_dpwssd_epi32(self.0, values, weights)
                } else {
                    _mm512_add_epi32(self.0, _mm512_madd_epi16(values, weights))
                }
            })
        }

        #[inline(always)]
        unsafe fn join(high: Self, low: Self, base: f32, scale: f32, to: *mut f32) {
            unsafe {
                let high = _mm512_mul_ps(_mm512_cvtepi32_ps(high.0), _mm512_set1_ps(base));
                let joined = _mm512_add_ps(high, _mm512_cvtepi32_ps(low.0));
                _mm512_storeu_ps(to, _mm512_mul_ps(joined, _mm512_set1_ps(scale)));
            }
        }
    }
}

#[cfg(target_arch = "aarch64")]
pub(super) use arm::Neon;

#[cfg(target_arch = "aarch64")]
mod arm {
    use std::arch::aarch64::{
        int16x8_t, int32x4_t, vaddq_f32, vaddq_s32, vcvtq_f32_s32, vdupq_n_s32, vget_low_s16, vld1_s8, vmovl_s8,
        vmull_high_s16, vmull_s16, vmulq_n_f32, vpaddq_s32, vreinterpretq_s16_s32, vst1q_f32,
    };

    use super::Pairs;

    /// Four pixels of NEON.
    #[derive(Clone, Copy)]
    pub(in super::super) struct Neon(int32x4_t);

    // SAFETY of every block below: the caller's.
    impl Pairs for Neon {
        const COUNT: usize = 4;
        type Words = int16x8_t;

        #[inline(always)]
        unsafe fn zero() -> Self {
            Self(unsafe { vdupq_n_s32(0) })
        }

        #[inline(always)]
        unsafe fn widen(from: *const i8) -> int16x8_t {
            unsafe { vmovl_s8(vld1_s8(from)) }
        }

        #[inline(always)]
        unsafe fn splat(from: *const i16) -> int16x8_t {
            unsafe { vreinterpretq_s16_s32(vdupq_n_s32(from.cast::<i32>().read_unaligned())) }
        }

        #[inline(always)]
        unsafe fn add_products(self, values: int16x8_t, weights: int16x8_t) -> Self {
            unsafe {
                let low = vmull_s16(vget_low_s16(values), vget_low_s16(weights));
                Self(vaddq_s32(self.0, vpaddq_s32(low, vmull_high_s16(values, weights))))
            }
        }

        #[inline(always)]
        unsafe fn join(high: Self, low: Self, base: f32, scale: f32, to: *mut f32) {
            unsafe {
                let joined = vaddq_f32(vmulq_n_f32(vcvtq_f32_s32(high.0), base), vcvtq_f32_s32(low.0));
                vst1q_f32(to, vmulq_n_f32(joined, scale));
            }
        }
    }
}
