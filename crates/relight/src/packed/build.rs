//! From a block as it was read to a block laid out for the sum.

use std::ops::Range;

use relumine_field::packed::{Atom, Atoms, PackedBlock, Patches};

use crate::packed::block::{COMPONENTS, PAIR, PIXELS, Place};
use crate::packed::{PackedError, ResidentBlock};

/// Ids are kept twofold.
const MOST_IDS: usize = MOST / 2;
/// Numbers of lists, atoms, tails and slots are kept in 16 bits.
const MOST: usize = u16::MAX as usize;
/// Exponents are below this; [`Atoms::parse`] sees to it.
const EXPONENTS: u8 = Atoms::EXPONENTS;

impl ResidentBlock {
    /// Lays out a block of a field of `squares` × `squares` squares.
    ///
    /// # Errors
    /// If its parts do not fit each other, or are more than 16 bits can count: 65,535 atoms or tails at one position, or as many
    /// slots of 8 components.
    pub fn new(block: &PackedBlock, squares: usize) -> Result<Self, PackedError> {
        Self::of_positions(block, squares, |_| true)
    }

    /// As [`ResidentBlock::new`], but of the positions that are wanted only: the others count as not read.
    pub(crate) fn of_positions(
        block: &PackedBlock,
        squares: usize,
        wanted: impl Fn(usize) -> bool,
    ) -> Result<Self, PackedError> {
        let patches = block.patches;
        let pixels = patches.block()[0] * patches.block()[1];
        let fits = block.basis.len() == block.rank * 3 * pixels && block.steps.len() == block.rank * patches.len();
        let extent = &block.extent;
        if !fits || [extent.rows.len(), extent.columns.len()] != patches.block() {
            let (basis, steps) = (block.basis.len(), block.steps.len());
            return Err(PackedError::Shape { patches: patches.len(), rank: block.rank, basis, steps });
        }
        let positions = block.positions.len();
        let read = |position: usize| wanted(position) && block.positions[position].is_some();
        let mut resident = Self {
            extent: extent.clone(),
            patches,
            squares,
            slots: Vec::with_capacity(patches.len() + 1),
            components: Vec::with_capacity(patches.len()),
            starts: Vec::new(),
            steps: Vec::new(),
            basis: Vec::new(),
            pixels: (0..patches.len()).map(|patch| small_ranges(patches.pixels(patch))).collect(),
            places: Vec::with_capacity(positions),
            bytes: Vec::new(),
        };
        if resident.ids() > MOST_IDS {
            return Err(PackedError::TooMany { what: "squares and groups", found: resident.ids(), most: MOST_IDS });
        }
        let mut longest = vec![0; patches.len()];
        for position in (0..positions).filter(|position| read(*position)) {
            for (patch, longest) in longest.iter_mut().enumerate() {
                for atom in block.atoms(position, patch).into_iter().flatten() {
                    *longest = significant(&atom).len().max(*longest);
                }
            }
        }
        resident.lay_out_bases(block, &longest)?;
        let mut lists = Lists::default();
        for position in 0..positions {
            let mut place = None;
            if read(position) {
                lists.collect(block, position, resident.ids())?;
                place = Some(lists.write(&resident.slots, &mut resident.bytes)?);
            }
            resident.places.push(place);
        }
        resident.bytes.shrink_to_fit();
        Ok(resident)
    }

    /// The bases, as many components of each as its longest atom has.
    fn lay_out_bases(&mut self, block: &PackedBlock, longest: &[usize]) -> Result<(), PackedError> {
        let [height, width] = self.patches.block();
        self.slots.push(0);
        let mut slots = 0;
        for longest in longest {
            if *longest > block.rank {
                let (basis, steps) = (block.basis.len(), block.steps.len());
                return Err(PackedError::Shape { patches: self.patches.len(), rank: block.rank, basis, steps });
            }
            slots += longest.div_ceil(COMPONENTS);
            self.slots.push(slots as u32);
            self.components.push(*longest as u8);
        }
        if slots > MOST {
            return Err(PackedError::TooMany { what: "slots of 8 components", found: slots, most: MOST });
        }
        self.steps = vec![[0.0; COMPONENTS]; slots];
        let mut pairs = 0;
        for (patch, longest) in longest.iter().enumerate() {
            self.starts.push(pairs as u32);
            pairs += longest.div_ceil(2);
            let steps = &mut self.steps[self.slots[patch] as usize..self.slots[patch + 1] as usize];
            for (component, step) in steps.as_flattened_mut()[..*longest].iter_mut().enumerate() {
                *step = block.steps[component * self.patches.len() + patch];
            }
        }
        self.basis = vec![0; pairs * PAIR];
        // Components on the outside: those of a pair stay in the cache while all patches take theirs.
        let plane = |index: usize| &block.basis[index * height * width..][..height * width];
        for first in (0..block.rank).step_by(2) {
            for patch in (0..longest.len()).filter(|patch| longest[*patch] > first) {
                let pixels = self.pixels_of(patch);
                let to = &mut self.basis[(self.starts[patch] as usize + first / 2) * PAIR..][..PAIR];
                for (channel, to) in to.as_chunks_mut().0.iter_mut().enumerate() {
                    let second = (first + 1 < longest[patch]).then(|| plane((first + 1) * 3 + channel));
                    interleave(plane(first * 3 + channel), second, width, &pixels, to);
                }
            }
        }
        Ok(())
    }
}

/// The pixels of a patch in two planes, one beside the other; those that it lacks, and a plane that is not there, are 0.
#[inline]
fn interleave(
    first: &[i8],
    second: Option<&[i8]>,
    width: usize,
    [rows, columns]: &[Range<usize>; 2],
    to: &mut [i8; 2 * PIXELS],
) {
    for (to, y) in to.as_chunks_mut::<{ 2 * Patches::SIDE }>().0.iter_mut().zip(rows.clone()) {
        let row = |plane: &[i8]| {
            let from = &plane[y * width..][columns.clone()];
            // Almost all patches are whole: one load instead of a call.
            <[i8; Patches::SIDE]>::try_from(from).unwrap_or_else(|_| {
                let mut part = [0; Patches::SIDE];
                part[..from.len()].copy_from_slice(from);
                part
            })
        };
        let (first, second) = (row(first), second.map_or([0; Patches::SIDE], row));
        *to = std::array::from_fn(|index| if index % 2 == 0 { first[index / 2] } else { second[index / 2] });
    }
}

/// Rows and columns in 32 bits.
fn small_ranges((rows, columns): (Range<usize>, Range<usize>)) -> [Range<u32>; 2] {
    [rows, columns].map(|range| range.start as u32..range.end as u32)
}

/// The coefficients of an atom without zeros at the end.
fn significant<'a>(atom: &Atom<'a>) -> &'a [i8] {
    let length = atom.coefficients.iter().rposition(|value| *value != 0).map_or(0, |last| last + 1);
    &atom.coefficients[..length]
}

/// The atoms of one position, to be written.
#[derive(Default)]
struct Lists<'a> {
    /// Patch, and which atoms are its: the whole first.
    lists: Vec<(usize, Range<usize>)>,
    /// Id, exponent, coefficients.
    atoms: Vec<(u16, u8, &'a [i8])>,
}

impl<'a> Lists<'a> {
    /// Reads the lists of a position, shortest first.
    fn collect(&mut self, block: &'a PackedBlock, position: usize, ids: usize) -> Result<(), PackedError> {
        self.lists.clear();
        self.atoms.clear();
        for patch in 0..block.patches.len() {
            let start = self.atoms.len();
            for atom in block.atoms(position, patch).into_iter().flatten() {
                let coefficients = significant(&atom);
                if usize::from(atom.id) >= ids {
                    return Err(PackedError::NoSuchSquare { id: atom.id.into(), ids });
                }
                assert!(atom.exponent < EXPONENTS, "atoms were parsed");
                // The whole is kept in any case: others count from its square.
                if !coefficients.is_empty() || self.atoms.len() == start {
                    self.atoms.push((atom.id, atom.exponent, coefficients));
                }
            }
            if self.atoms[start..].iter().any(|(_, _, coefficients)| !coefficients.is_empty()) {
                self.lists.push((patch, start..self.atoms.len()));
            } else {
                self.atoms.truncate(start);
            }
        }
        self.lists.sort_by_key(|(_, atoms)| atoms.len());
        Ok(())
    }

    /// Writes them behind `bytes`; `slots` says where those of each patch begin.
    fn write(&self, slots: &[u32], bytes: &mut Vec<u8>) -> Result<Place, PackedError> {
        let runs: Vec<&[_]> = self.lists.chunk_by(|(_, a), (_, b)| a.len() == b.len()).collect();
        let tails: usize =
            self.atoms.iter().map(|(_, _, values)| values.len().div_ceil(COMPONENTS).saturating_sub(1)).sum();
        let small = |what, found| match u16::try_from(found) {
            Ok(number) => Ok(number),
            Err(_) => Err(PackedError::TooMany { what, found, most: MOST }),
        };
        small("atoms at one position", self.atoms.len())?;
        let place = Place {
            start: u32::try_from(bytes.len()).map_err(|_| PackedError::TooMany {
                what: "bytes",
                found: bytes.len(),
                most: u32::MAX as usize,
            })?,
            runs: small("lengths of lists", runs.len())?,
            lists: small("lists at one position", self.lists.len())?,
            others: small("atoms at one position", self.atoms.len() - self.lists.len())?,
            tails: small("tails at one position", tails)?,
        };
        bytes.reserve(place.length());
        for run in &runs {
            bytes.extend((run.len() as u16).to_le_bytes());
            bytes.extend((run[0].1.len() as u16 - 1).to_le_bytes());
        }
        let slot = |patch: usize, group: usize| (slots[patch] as usize + group) as u16;
        bytes.extend(self.lists.iter().flat_map(|(patch, _)| slot(*patch, 0).to_le_bytes()));
        let wholes = || self.lists.iter().map(|(_, atoms)| &self.atoms[atoms.start]);
        let others = || self.lists.iter().flat_map(|(_, atoms)| &self.atoms[atoms.start + 1..atoms.end]);
        write_atoms(wholes, bytes);
        write_atoms(others, bytes);
        let mut other = self.lists.len();
        let mut tails = Vec::with_capacity(tails);
        for (whole, (patch, atoms)) in self.lists.iter().enumerate() {
            for (index, (_, _, coefficients)) in self.atoms[atoms.clone()].iter().enumerate() {
                let number = if index == 0 { whole } else { other + index - 1 };
                for (group, tail) in coefficients.chunks(COMPONENTS).enumerate().skip(1) {
                    tails.push((number as u16, slot(*patch, group), tail));
                }
            }
            other += atoms.len() - 1;
        }
        bytes.extend(tails.iter().flat_map(|(number, _, _)| number.to_le_bytes()));
        bytes.extend(tails.iter().flat_map(|(_, slot, _)| slot.to_le_bytes()));
        tails.iter().for_each(|(_, _, tail)| write_coefficients(tail, bytes));
        Ok(place)
    }
}

/// Ids, exponents and first coefficients.
fn write_atoms<'b, I: Iterator<Item = &'b (u16, u8, &'b [i8])>>(atoms: impl Fn() -> I, bytes: &mut Vec<u8>) {
    bytes.extend(atoms().flat_map(|(id, _, _)| (2 * id).to_le_bytes()));
    bytes.extend(atoms().map(|(_, exponent, _)| exponent));
    atoms().for_each(|(_, _, coefficients)| write_coefficients(coefficients, bytes));
}

/// The first 8 coefficients, with zeros behind them.
fn write_coefficients(coefficients: &[i8], bytes: &mut Vec<u8>) {
    let eight = match coefficients.first_chunk::<COMPONENTS>() {
        Some(eight) => *eight,
        None => std::array::from_fn(|index| coefficients.get(index).copied().unwrap_or(0)),
    };
    bytes.extend_from_slice(&eight.map(|value| value.to_le_bytes()[0]));
}
