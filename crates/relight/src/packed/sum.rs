//! The sum over one block: v of its patches, then their pixels.

use crate::packed::ResidentBlock;
use crate::packed::block::{COMPONENTS, PIXELS, Segment, Slot};
use crate::packed::kernel::{self, Fixed, Kernel};
use crate::packed::weights::{LightWeights, Row};

/// Positions whose sum is taken by itself before it is added to the others, so that rounding does not grow with their number.
const TOGETHER: usize = 32;

/// Room for the sums of some blocks.
#[derive(Default)]
pub(crate) struct Summing {
    /// Of one block after the other.
    sums: Vec<Slot>,
    partial: Vec<Slot>,
    weights: Vec<Row>,
}

impl Summing {
    /// v of all slots of some blocks under a light, one block after the other. Positions that were not read add nothing.
    ///
    /// The blocks take turns after so many positions, whose tables then stay in the cache.
    pub(crate) fn sum(&mut self, kernel: &Kernel, blocks: &[ResidentBlock], light: &LightWeights) -> &[Slot] {
        clear(&mut self.sums, blocks.iter().map(ResidentBlock::number_of_slots).sum());
        let lit = light.lit().len();
        for first in (0..lit).step_by(TOGETHER) {
            let together = first..(first + TOGETHER).min(lit);
            let mut rest = &mut self.sums[..];
            for block in blocks {
                let (sums, after) = rest.split_at_mut(block.number_of_slots());
                rest = after;
                // The first partial sum needs no room of its own.
                let to = if first == 0 {
                    &mut *sums
                } else {
                    clear(&mut self.partial, sums.len());
                    &mut self.partial
                };
                let mut next = light.lit().skip(first + 1).take(TOGETHER - 1);
                for (lit, table) in light.tables(together.clone()) {
                    let ahead = next.next().map_or(&[][..], |position| block.bytes_of(position));
                    if let Some(segment) = block.segment(lit.position) {
                        let segment = Segment { ahead, ..segment };
                        kernel.add((&segment, block.ids()), (table, lit.sparse), &mut self.weights, to);
                    }
                }
                if first > 0 {
                    add_all(sums, &self.partial);
                }
            }
        }
        &self.sums
    }

    /// As [`Summing::sum`], but of the first components of the wholes only.
    pub(crate) fn sum_wholes(&mut self, kernel: &Kernel, blocks: &[ResidentBlock], light: &LightWeights) -> &[Slot] {
        clear(&mut self.sums, blocks.iter().map(ResidentBlock::number_of_slots).sum());
        let mut rest = &mut self.sums[..];
        for block in blocks {
            let (sums, after) = rest.split_at_mut(block.number_of_slots());
            rest = after;
            let mut next = light.lit().skip(1);
            for (lit, table) in light.tables(0..light.lit().len()) {
                let ahead = next.next().map_or(&[][..], |position| block.bytes_of(position));
                if let Some(segment) = block.segment(lit.position) {
                    let segment = Segment { ahead, ..segment };
                    kernel.add_wholes((&segment, block.ids()), table, &mut self.weights, sums);
                }
            }
        }
        &self.sums
    }

    /// What one position adds to a block, by itself.
    pub(crate) fn of_position(
        &mut self,
        kernel: &Kernel,
        block: &ResidentBlock,
        position: usize,
        table: (&[Row], bool),
    ) -> &[Slot] {
        clear(&mut self.sums, block.number_of_slots());
        if let Some(segment) = block.segment(position) {
            kernel.add((&segment, block.ids()), table, &mut self.weights, &mut self.sums);
        }
        &self.sums
    }
}

/// Makes `slots` so many zeros.
pub(crate) fn clear(slots: &mut Vec<Slot>, number: usize) {
    slots.clear();
    slots.resize(number, Slot::ZERO);
}

/// Adds slot by slot.
fn add_all(sums: &mut [Slot], more: &[Slot]) {
    for (sum, more) in sums.iter_mut().zip(more) {
        let (sum, more) = (sum.0.as_flattened_mut(), more.0.as_flattened());
        sum.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
    }
}

/// Whether pixels take the place of what was there or are added to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Write {
    Over,
    Onto,
}

/// The pixels of some patches of a block from the sums of all its slots, into the rows of the block.
pub(crate) fn write_patches(
    kernel: &Kernel,
    block: &ResidentBlock,
    chosen: impl Iterator<Item = (usize, Write)>,
    slots: &[Slot],
    block_rows: &mut [&mut [[f32; 3]]],
) {
    let mut chosen = chosen.peekable();
    let (mut fixed, mut pixels) = (Fixed::default(), [[0.0; 3]; PIXELS]);
    while let Some((patch, write)) = chosen.next() {
        let [rows, columns] = block.pixels_of(patch);
        let (basis, slots) = (block.basis_of(patch), &slots[block.slots_of(patch)]);
        if let Some((next, _)) = chosen.peek() {
            let [rows, columns] = block.pixels_of(*next);
            block_rows[rows].iter().for_each(|row| kernel::ask_for(&row[columns.clone()]));
        }
        let components = components(slots).min(basis.components);
        if components > 0 {
            kernel.pixels(&basis, slots, components, (&mut fixed, &mut pixels));
        } else {
            pixels = [[0.0; 3]; PIXELS];
        }
        for (row, from) in block_rows[rows].iter_mut().zip(pixels.as_chunks::<8>().0) {
            let to = &mut row[columns.clone()];
            match (write, <&mut [_; 8]>::try_from(&mut *to)) {
                (Write::Over, Ok(to)) => *to = *from,
                (Write::Over, Err(_)) => to.copy_from_slice(&from[..to.len()]),
                (Write::Onto, _) => {
                    let (to, from) = (to.as_flattened_mut(), from.as_flattened());
                    to.iter_mut().zip(from).for_each(|(to, from)| *to += from);
                }
            }
        }
    }
}

/// All patches of a block.
pub(crate) fn write_block(kernel: &Kernel, block: &ResidentBlock, slots: &[Slot], block_rows: &mut [&mut [[f32; 3]]]) {
    write_patches(kernel, block, (0..block.patches.len()).map(|patch| (patch, Write::Over)), slots, block_rows);
}

/// The last component that is not 0, counted from 1.
fn components(slots: &[Slot]) -> usize {
    let lit = |slot: &Slot, component: usize| slot.0.iter().any(|channel| channel[component] != 0.0);
    let last = slots.iter().rposition(|slot| slot.0.as_flattened().iter().any(|sum| *sum != 0.0));
    last.map_or(0, |last| {
        let within = (0..COMPONENTS).rev().find(|component| lit(&slots[last], *component)).unwrap_or(0);
        last * COMPONENTS + within + 1
    })
}
