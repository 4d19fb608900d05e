//! One block in memory, laid out for the sum.
//!
//! The sums v of a patch lie in **slots** of 8 components × 3 channels; a patch has as many as its longest atom needs. The atoms
//! of a position lie together, so that light from few positions reads little. In a position the lists are sorted by their length
//! into **runs**, so that the loops over them are foreseeable. Of every atom the first 8 coefficients lie beside those of its list;
//! what is beyond is cut into **tails** of 8, each of which names its weight and its slot. Coefficients stay 8 bits.
//!
//! ```text
//! u16 lists, u16 others      of each run: lists, and atoms of each besides the whole
//! u16 × lists                slots of the lists
//! u16 × lists                ids of the wholes, twofold: as many times 8 bytes is where the row of a table begins
//! u8 × lists                 exponents of the wholes
//! i8 × 8 × lists             first coefficients of the wholes
//! u16 × others               ids of the other atoms, twofold, list by list
//! u8 × others                their exponents
//! i8 × 8 × others            their first coefficients
//! u16 × tails                number of the atom: wholes first, then the others
//! u16 × tails                slots
//! i8 × 8 × tails             coefficients
//! ```

use std::ops::Range;

use relumine_field::Extent;
use relumine_field::packed::Patches;

/// Components of a slot, and coefficients that lie together.
pub(crate) const COMPONENTS: usize = 8;
/// Pixels of a patch, 8 × 8; those that a smaller patch lacks are 0.
pub(crate) const PIXELS: usize = Patches::SIDE * Patches::SIDE;
/// Values of two components of a basis, which lie together: `[channel][pixel][component]`.
pub(crate) const PAIR: usize = 2 * 3 * PIXELS;

/// Sums of 8 components, `[channel][component]`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(32))]
pub(crate) struct Slot(pub(crate) [[f32; COMPONENTS]; 3]);

impl Slot {
    /// Nothing summed yet.
    pub(crate) const ZERO: Self = Self([[0.0; COMPONENTS]; 3]);

    /// Whether it adds nothing.
    #[inline(always)]
    pub(crate) fn is_zero(&self) -> bool {
        // Without the sign, so that −0 is 0.
        self.0.as_flattened().iter().fold(0, |bits, sum| bits | sum.to_bits() << 1) == 0
    }
}

/// One block of a packed field in memory, laid out for the sum: 8 bits a coefficient and a value of the bases.
#[derive(Clone, Debug)]
pub struct ResidentBlock {
    pub(super) extent: Extent,
    pub(super) patches: Patches,
    pub(super) squares: usize,
    /// Where the slots of each patch begin, and where the last end.
    pub(super) slots: Vec<u32>,
    /// Components of the basis of each patch.
    pub(super) components: Vec<u8>,
    /// Where the basis of each patch begins, in pairs of components.
    pub(super) starts: Vec<u32>,
    /// What one step is worth, by slot.
    pub(super) steps: Vec<[f32; COMPONENTS]>,
    /// The bases of the patches, one after the other, two components together, `[pair][channel][pixel of 8 × 8][component of 2]`;
    /// where their number is odd, the last are 0.
    pub(super) basis: Vec<i8>,
    /// Rows and columns of each patch.
    pub(super) pixels: Vec<[Range<u32>; 2]>,
    /// By position; `None` was not read.
    pub(super) places: Vec<Option<Place>>,
    pub(super) bytes: Vec<u8>,
}

/// Where the atoms of a position lie.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Place {
    pub(super) start: u32,
    pub(super) runs: u16,
    pub(super) lists: u16,
    pub(super) others: u16,
    pub(super) tails: u16,
}

impl Place {
    /// Lengths of the parts in bytes, in their order.
    fn lengths(&self) -> [usize; 11] {
        let [runs, lists, others, tails] = [self.runs, self.lists, self.others, self.tails].map(usize::from);
        let (whole, other, tail) =
            ([2 * lists, 2 * lists, lists, 8 * lists], [2 * others, others, 8 * others], 8 * tails);
        let [slots, ids, exponents, coefficients] = whole;
        [4 * runs, slots, ids, exponents, coefficients, other[0], other[1], other[2], 2 * tails, 2 * tails, tail]
    }

    /// Bytes of all parts.
    pub(super) fn length(&self) -> usize {
        self.lengths().iter().sum()
    }
}

/// The atoms of one position. Slots and ids in it are below those of the block, and the numbers of lists, others and tails are
/// those that the parts hold.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Segment<'a> {
    pub(crate) lists: usize,
    pub(crate) tails: usize,
    pub(crate) runs: &'a [u8],
    pub(crate) slots: &'a [u8],
    pub(crate) whole_ids: &'a [u8],
    pub(crate) whole_exponents: &'a [u8],
    pub(crate) whole_coefficients: &'a [u8],
    pub(crate) ids: &'a [u8],
    pub(crate) exponents: &'a [u8],
    pub(crate) coefficients: &'a [u8],
    pub(crate) tail_atoms: &'a [u8],
    pub(crate) tail_slots: &'a [u8],
    pub(crate) tail_coefficients: &'a [u8],
    /// What will be read next.
    pub(crate) ahead: &'a [u8],
}

/// The basis of a patch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Basis<'a> {
    pub(crate) components: usize,
    pub(crate) steps: &'a [[f32; COMPONENTS]],
    pub(crate) values: &'a [i8],
}

impl Segment<'_> {
    /// Atoms in it.
    pub(crate) fn atoms(&self) -> usize {
        self.lists + self.exponents.len()
    }
}

impl ResidentBlock {
    /// Its pixels in the picture.
    pub fn extent(&self) -> &Extent {
        &self.extent
    }

    /// Positions, read or not.
    pub fn positions(&self) -> usize {
        self.places.len()
    }

    /// Bytes in memory.
    pub fn bytes(&self) -> usize {
        self.bytes.len()
            + self.basis.len()
            + size_of_val(self.steps.as_slice())
            + size_of_val(self.pixels.as_slice())
            + size_of_val(self.places.as_slice())
            + 4 * (self.slots.len() + self.starts.len())
            + self.components.len()
    }

    /// Squares and groups that its atoms may name.
    pub(crate) fn ids(&self) -> usize {
        self.squares * self.squares + relumine_field::packed::Groups::new(self.squares).len()
    }

    /// Slots of all patches.
    pub(crate) fn number_of_slots(&self) -> usize {
        self.slots.last().map_or(0, |all| *all as usize)
    }

    /// Slots of a patch.
    pub(crate) fn slots_of(&self, patch: usize) -> Range<usize> {
        self.slots[patch] as usize..self.slots[patch + 1] as usize
    }

    /// The basis of a patch.
    pub(crate) fn basis_of(&self, patch: usize) -> Basis<'_> {
        let (slots, components) = (self.slots_of(patch), self.components[patch].into());
        Basis {
            components,
            steps: &self.steps[slots],
            values: &self.basis[self.starts[patch] as usize * PAIR..][..usize::div_ceil(components, 2) * PAIR],
        }
    }

    /// Rows and columns of a patch in the block.
    pub(crate) fn pixels_of(&self, patch: usize) -> [Range<usize>; 2] {
        self.pixels[patch].clone().map(|range| range.start as usize..range.end as usize)
    }

    /// The bytes of the atoms of a position; none if they were not read.
    pub(crate) fn bytes_of(&self, position: usize) -> &[u8] {
        let place = self.places.get(position).copied().flatten().unwrap_or_default();
        &self.bytes[place.start as usize..][..place.length()]
    }

    /// The atoms of a position; `None` if they were not read.
    pub(crate) fn segment(&self, position: usize) -> Option<Segment<'_>> {
        let place = self.places.get(position)?.as_ref()?;
        let mut rest = &self.bytes[place.start as usize..];
        let mut lengths = place.lengths().into_iter();
        // In the order of the parts, which is that of the fields below.
        let mut part = || {
            let (part, after) = rest.split_at(lengths.next().unwrap_or(0));
            rest = after;
            part
        };
        Some(Segment {
            lists: place.lists.into(),
            tails: place.tails.into(),
            runs: part(),
            slots: part(),
            whole_ids: part(),
            whole_exponents: part(),
            whole_coefficients: part(),
            ids: part(),
            exponents: part(),
            coefficients: part(),
            tail_atoms: part(),
            tail_slots: part(),
            tail_coefficients: part(),
            ahead: &[],
        })
    }
}
