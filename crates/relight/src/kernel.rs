//! The loop that all the time goes into: sum += Σ weight · halves.
//!
//! The plain version says what is computed; the vector version computes the same, lane by lane in the same order and without
//! fused multiply-add, so both give the same bits and any machine may use either.

use half::f16;

/// sum[k] += Σⱼ weightⱼ · termⱼ[k], the terms in their order.
///
/// # Panics
/// If a term has another length than the sum.
pub(crate) fn add_weighted(sum: &mut [f32], terms: &[(f32, &[f16])]) {
    assert!(terms.iter().all(|(_, term)| term.len() == sum.len()), "terms and sum differ in length");
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("f16c") {
        // SAFETY: the features were found, and all slices have the same length.
        #[allow(unsafe_code)]
        unsafe {
            vector::add_weighted(sum, terms);
        }
        return;
    }
    add_weighted_plain(sum, terms, 0);
}

/// The plain version, from index `from` on.
fn add_weighted_plain(sum: &mut [f32], terms: &[(f32, &[f16])], from: usize) {
    for (k, sum) in sum.iter_mut().enumerate().skip(from) {
        for (weight, term) in terms {
            *sum += weight * term[k].to_f32();
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)]
mod vector {
    use std::arch::x86_64::{
        _mm_loadu_si128, _mm256_add_ps, _mm256_cvtph_ps, _mm256_loadu_ps, _mm256_mul_ps, _mm256_set1_ps,
        _mm256_storeu_ps,
    };

    use half::f16;

    const LANES: usize = 8;

    /// # Safety
    /// The machine has AVX2 and F16C, and every term is as long as `sum`.
    #[target_feature(enable = "avx2,f16c")]
    pub(super) unsafe fn add_weighted(sum: &mut [f32], terms: &[(f32, &[f16])]) {
        let whole = sum.len() / LANES * LANES;
        for k in (0..whole).step_by(LANES) {
            // SAFETY: k + 8 ≤ whole ≤ the length of the sum and of every term; loads and stores need no alignment.
            unsafe {
                let place = sum.as_mut_ptr().add(k);
                let mut lanes = _mm256_loadu_ps(place);
                for (weight, term) in terms {
                    let halves = _mm_loadu_si128(term.as_ptr().add(k).cast());
                    lanes = _mm256_add_ps(lanes, _mm256_mul_ps(_mm256_set1_ps(*weight), _mm256_cvtph_ps(halves)));
                }
                _mm256_storeu_ps(place, lanes);
            }
        }
        super::add_weighted_plain(sum, terms, whole);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_vector_version_gives_the_bits_of_the_plain_one() {
        let half =
            |i: usize| f16::from_f32(((i * 7919) % 1013) as f32 * 0.37 + if i.is_multiple_of(11) { 1e-7 } else { 0.0 });
        for length in [0, 1, 7, 8, 9, 64, 1003] {
            let terms: Vec<Vec<f16>> = (0..5).map(|t| (0..length).map(|i| half(i + t * 31)).collect()).collect();
            let weighted: Vec<(f32, &[f16])> =
                terms.iter().enumerate().map(|(t, term)| (0.1 + t as f32 * 1.7, term.as_slice())).collect();
            let start: Vec<f32> = (0..length).map(|i| i as f32 / 3.0).collect();
            let (mut fast, mut plain) = (start.clone(), start);
            add_weighted(&mut fast, &weighted);
            add_weighted_plain(&mut plain, &weighted, 0);
            assert!(fast.iter().zip(&plain).all(|(a, b)| a.to_bits() == b.to_bits()), "length {length}");
        }
    }
}
