//! Every kernel that runs here against the plain one.

use crate::packed::ResidentBlock;
use crate::packed::block::{PIXELS, Slot};
use crate::packed::kernel::Kernel;
use crate::packed::synthetic::{Kind, Noise, Noisy};
use crate::packed::weights::Row;

/// Bits of sums and pixels of a block under noise.
fn bits(kernel: &Kernel, block: &ResidentBlock, sparse: bool, every: usize) -> [Vec<u32>; 3] {
    let mut noise = Noise(5);
    let mut slots = vec![Slot::ZERO; block.number_of_slots()];
    let mut wholes = slots.clone();
    let mut weights = Vec::new();
    for position in 0..block.positions() {
        let row = |id: usize| {
            if id.is_multiple_of(every) { [noise.unit(), noise.unit() * 1e3, -noise.unit(), 0.0] } else { [0.0; 4] }
        };
        let table: Vec<Row> = (0..block.ids()).map(row).map(Row).collect();
        let segment = block.segment(position).unwrap();
        kernel.add((&segment, block.ids()), (&table, sparse), &mut weights, &mut slots);
        kernel.add_wholes((&segment, block.ids()), &table, &mut weights, &mut wholes);
    }
    let mut pixels = Vec::new();
    for patch in 0..block.patches.len() {
        let basis = block.basis_of(patch);
        let mut out = [[0.0; 3]; PIXELS];
        kernel.pixels(&basis, &[], &slots[block.slots_of(patch)], basis.components, &mut out);
        pixels.extend(out.as_flattened().iter().map(|value| value.to_bits()));
    }
    let of = |slots: &[Slot]| slots.iter().flat_map(|slot| slot.0.as_flattened()).map(|sum| sum.to_bits()).collect();
    [of(&slots), of(&wholes), pixels]
}

#[test]
fn every_kernel_gives_the_bits_of_the_plain_one() {
    for (squares, rank, kind) in [(4, [1, 30], Kind::Wild), (1, [0, 9], Kind::Wild), (16, [20, 30], Kind::Scene)] {
        let noisy = Noisy { picture: [63, 59], positions: 19, squares, rank, kind };
        for block in noisy.blocks(3) {
            let block = ResidentBlock::new(&block, squares).unwrap();
            for every in [1, 3, 1000] {
                let plain = bits(&Kernel::available()[0], &block, false, every);
                for kernel in Kernel::available() {
                    for sparse in [false, true] {
                        let what = format!("{}, {squares} squares, sparse {sparse}, every {every}", kernel.name);
                        assert!(bits(&kernel, &block, sparse, every) == plain, "{what}");
                    }
                }
            }
        }
    }
}
