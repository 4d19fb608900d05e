//! The loops that all the time goes into.
//!
//! Each loop is written once (`atoms.rs`, `pixels.rs`), over numbers side by side, and compiled for each kind of machine. Sums in
//! single precision are taken in the order that the loop says and nothing in them is fused, others are of whole numbers, so every
//! version gives the same bits.

mod atoms;
mod lanes;
mod pairs;
mod pixels;
#[cfg(test)]
mod tests;

use crate::packed::block::{Basis, COMPONENTS, PAIR, PIXELS, Segment, Slot};
use crate::packed::weights::Row;
use lanes::Lanes;
pub(crate) use pixels::Fixed;
use pixels::MOST_COMPONENTS;

/// Adds the atoms of a position: all of them, or the first coefficients of the wholes.
type Add = unsafe fn(&Segment<'_>, &[Row], &mut [Row], &mut [Slot]);
/// Σ step · basis · v of a patch.
type Pixels = unsafe fn(&Basis<'_>, &[Slot], usize, (&mut Fixed, &mut [[f32; 3]; PIXELS]));

/// Asks for memory that will be needed soon.
pub(super) fn ask_for<T: ?Sized>(value: &T) {
    const LINE: usize = 64;
    let first = std::ptr::from_ref(value).cast::<u8>();
    let last = first.wrapping_add(size_of_val(value).saturating_sub(1));
    (0..size_of_val(value)).step_by(LINE).for_each(|offset| lanes::prefetch(first.wrapping_add(offset)));
    lanes::prefetch(last);
}

/// The loops for one kind of machine.
#[derive(Clone, Copy)]
pub(crate) struct Kernel {
    #[cfg_attr(not(test), expect(dead_code, reason = "tests say which kernel differs"))]
    pub(crate) name: &'static str,
    add: Add,
    add_sparse: Add,
    add_wholes: Add,
    pixels: Pixels,
}

impl Kernel {
    /// The fastest that runs here.
    pub(crate) fn best() -> Self {
        *Self::available().last().expect("the plain one is always there")
    }

    /// All that run here, the plain one first.
    pub(crate) fn available() -> Vec<Self> {
        #[allow(unused_mut)]
        let mut kernels = vec![plain::KERNEL];
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx2") {
                kernels.push(avx2::KERNEL);
            }
            let wide = is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512bw");
            if wide && is_x86_feature_detected!("avx512vl") && is_x86_feature_detected!("avx512dq") {
                kernels.push(avx512::KERNEL);
                if is_x86_feature_detected!("avx512vnni") {
                    kernels.push(avx512_vnni::KERNEL);
                }
            }
        }
        #[cfg(target_arch = "aarch64")]
        if std::arch::is_aarch64_feature_detected!("neon") {
            kernels.push(neon::KERNEL);
        }
        kernels
    }

    /// Adds the atoms of a position to the slots of its block. `sparse` says that whole lists may be dark: these are skipped,
    /// which changes nothing. `weights` is room for a weight each atom.
    ///
    /// The table must have a row for each id, and `slots` be as many as those of the block the segment is of.
    pub(super) fn add(
        &self,
        (segment, ids): (&Segment<'_>, usize),
        (table, sparse): (&[Row], bool),
        weights: &mut Vec<Row>,
        slots: &mut [Slot],
    ) {
        self.run(if sparse { self.add_sparse } else { self.add }, segment, (table, ids), weights, slots);
    }

    /// Adds the first coefficients of the wholes of a position, each under the light of its main square.
    pub(super) fn add_wholes(
        &self,
        (segment, ids): (&Segment<'_>, usize),
        table: &[Row],
        weights: &mut Vec<Row>,
        slots: &mut [Slot],
    ) {
        self.run(self.add_wholes, segment, (table, ids), weights, slots);
    }

    fn run(
        &self,
        add: Add,
        segment: &Segment<'_>,
        (table, ids): (&[Row], usize),
        weights: &mut Vec<Row>,
        slots: &mut [Slot],
    ) {
        assert_eq!(table.len(), ids, "a row for each square and group");
        if weights.len() < segment.atoms() {
            weights.resize(segment.atoms(), Row::default());
        }
        // SAFETY: kernels are only made for machines that have their features. Ids are below the rows of the table, and slots
        // below those of the block: it was laid out so. There is a weight for each atom.
        #[allow(unsafe_code)]
        unsafe {
            add(segment, table, weights, slots);
        }
    }

    /// Σ step · basis · v over the first `components` of a patch: its 8 × 8 pixels, row-major, and room for what lies
    /// between.
    pub(super) fn pixels(
        &self,
        basis: &Basis<'_>,
        slots: &[Slot],
        components: usize,
        out: (&mut Fixed, &mut [[f32; 3]; PIXELS]),
    ) {
        let groups = components.div_ceil(COMPONENTS);
        assert!(components <= MOST_COMPONENTS, "more components than a basis has");
        assert!(groups <= slots.len() && groups <= basis.steps.len(), "components that the patch has not");
        assert!(components.div_ceil(2) * PAIR <= basis.values.len(), "components that the basis has not");
        // SAFETY: kernels are only made for machines that have their features, and all parts are long enough.
        #[allow(unsafe_code)]
        unsafe {
            (self.pixels)(basis, slots, components, out);
        }
    }
}

/// The loops, compiled with the given features.
macro_rules! kernel {
    ($module:ident, $name:literal, $eight:ty, $pairs:ty, $(#[$features:meta])*) => {
        #[allow(unsafe_code)]
        mod $module {
            use super::{Basis, Fixed, Kernel, PIXELS, Row, Segment, Slot, atoms, lanes, pairs};

            pub(super) const KERNEL: Kernel =
                Kernel { name: $name, add: add::<false>, add_sparse: add::<true>, add_wholes, pixels };

            /// # Safety
            /// As the generic version, and the machine has the features.
            $(#[$features])*
            unsafe fn add<const SPARSE: bool>(
                segment: &Segment<'_>,
                table: &[Row],
                weights: &mut [Row],
                slots: &mut [Slot],
            ) {
                // SAFETY: the caller's.
                unsafe { atoms::add::<$eight, SPARSE>(segment, table, weights, slots) }
            }

            /// # Safety
            /// As the generic version, and the machine has the features.
            $(#[$features])*
            unsafe fn add_wholes(segment: &Segment<'_>, table: &[Row], _: &mut [Row], slots: &mut [Slot]) {
                // SAFETY: the caller's.
                unsafe { atoms::add_wholes::<$eight>(segment, table, slots) }
            }

            /// # Safety
            /// As the generic version, and the machine has the features.
            $(#[$features])*
            unsafe fn pixels(
                basis: &Basis<'_>,
                slots: &[Slot],
                components: usize,
                out: (&mut Fixed, &mut [[f32; 3]; PIXELS]),
            ) {
                // SAFETY: the caller's.
                unsafe { super::pixels::pixels::<$eight, $pairs>(basis, slots, components, out) }
            }
        }
    };
}

kernel!(plain, "plain", lanes::Plain, pairs::Plain,);
#[cfg(target_arch = "x86_64")]
kernel!(avx2, "AVX2", lanes::Eight, pairs::Eight, #[target_feature(enable = "avx2")]);
#[cfg(target_arch = "x86_64")]
kernel!(
    avx512,
    "AVX-512",
    lanes::Eight,
    pairs::Sixteen<false>,
    #[target_feature(enable = "avx2,avx512f,avx512bw,avx512vl,avx512dq")]
);
#[cfg(target_arch = "x86_64")]
kernel!(
    avx512_vnni,
    "AVX-512 with VNNI",
    lanes::Eight,
    pairs::Sixteen<true>,
    #[target_feature(enable = "avx2,avx512f,avx512bw,avx512vl,avx512dq,avx512vnni")]
);
#[cfg(target_arch = "aarch64")]
kernel!(neon, "NEON", lanes::Neon, pairs::Neon, #[target_feature(enable = "neon")]);
