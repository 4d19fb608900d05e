//! The sum over one block: v of its patches, then their pixels.

use crate::packed::ResidentBlock;
use crate::packed::block::{COMPONENTS, PIXELS, Segment, Slot};
use crate::packed::kernel::Kernel;
use crate::packed::weights::{LightWeights, Row};

/// Positions whose sum is taken by itself before it is added to the others, so that rounding does not grow with their number.
const TOGETHER: usize = 32;

/// What is done for one block after the other: room for its sums.
#[derive(Default)]
pub(crate) struct Summing {
    sums: Vec<Slot>,
    partial: Vec<Slot>,
    weights: Vec<Row>,
}

impl Summing {
    /// v of all slots of a block under a light. Positions that were not read add nothing.
    pub(crate) fn sum(&mut self, kernel: &Kernel, block: &ResidentBlock, light: &LightWeights) -> &[Slot] {
        let ids = block.ids();
        clear(&mut self.sums, block.number_of_slots());
        let mut next = light.lit().skip(1);
        let together = if light.lit().len() <= TOGETHER { None } else { Some(TOGETHER) };
        for (index, (lit, table)) in light.tables().enumerate() {
            let to = match together {
                None => &mut self.sums,
                Some(together) => {
                    if index % together == 0 {
                        add_all(&mut self.sums, &self.partial);
                        clear(&mut self.partial, block.number_of_slots());
                    }
                    &mut self.partial
                }
            };
            let ahead = next.next().map_or(&[][..], |position| block.bytes_of(position));
            if let Some(segment) = block.segment(lit.position) {
                let segment = Segment { ahead, ..segment };
                kernel.add((&segment, ids), (table, lit.sparse), &mut self.weights, to);
            }
        }
        if together.is_some() {
            add_all(&mut self.sums, &self.partial);
            self.partial.clear();
        }
        &self.sums
    }

    /// As [`Summing::sum`], but of the first components of the wholes only.
    pub(crate) fn sum_wholes(&mut self, kernel: &Kernel, block: &ResidentBlock, light: &LightWeights) -> &[Slot] {
        let ids = block.ids();
        clear(&mut self.sums, block.number_of_slots());
        for (lit, table) in light.tables() {
            if let Some(segment) = block.segment(lit.position) {
                kernel.add_wholes((&segment, ids), table, &mut self.weights, &mut self.sums);
            }
        }
        &self.sums
    }

    /// What one position adds, by itself.
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

/// Adds slot by slot; `more` may be empty.
fn add_all(sums: &mut [Slot], more: &[Slot]) {
    for (sum, more) in sums.iter_mut().zip(more) {
        let (sum, more) = (sum.0.as_flattened_mut(), more.0.as_flattened());
        sum.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
    }
}

/// The pixels of one patch from its sums, into the rows of its block.
pub(crate) fn write_patch(
    kernel: &Kernel,
    block: &ResidentBlock,
    patch: usize,
    slots: &[Slot],
    block_rows: &mut [&mut [[f32; 3]]],
) {
    let (rows, columns) = block.patches.pixels(patch);
    let basis = block.basis_of(patch);
    let components = components(slots).min(basis.1.len());
    let mut pixels = [[0.0; 3]; PIXELS];
    if components > 0 {
        let ahead = if patch + 1 < block.patches.len() { block.basis_of(patch + 1).0 } else { &[] };
        kernel.pixels(basis, ahead, slots, components, &mut pixels);
    }
    for (row, from) in block_rows[rows].iter_mut().zip(pixels.as_chunks::<8>().0) {
        let to = &mut row[columns.clone()];
        match <&mut [_; 8]>::try_from(&mut *to) {
            Ok(to) => *to = *from,
            Err(_) => to.copy_from_slice(&from[..to.len()]),
        }
    }
}

/// The pixels of all patches of a block from its sums, into its rows.
pub(crate) fn write_block(kernel: &Kernel, block: &ResidentBlock, slots: &[Slot], block_rows: &mut [&mut [[f32; 3]]]) {
    for patch in 0..block.patches.len() {
        write_patch(kernel, block, patch, &slots[block.slots_of(patch)], block_rows);
    }
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
