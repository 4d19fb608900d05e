//! Loops that the compiler makes wide, compiled for what the machine has.

/// Defines a function that calls `plain`, compiled for AVX2 where the machine has it. Both give the same bits: what is
/// compiled for AVX2 does the same to every number, and nothing is fused. What `plain` calls must be `#[inline(always)]`, or it
/// stays as it is.
#[macro_export]
macro_rules! for_this_machine {
    ($(#[$about:meta])* $seen:vis fn $name:ident($($argument:ident: $kind:ty),* $(,)?) -> $result:ty = $plain:expr) => {
        $(#[$about])*
        $seen fn $name($($argument: $kind),*) -> $result {
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
