//! Every kernel that runs here against the plain one.

use crate::packed::ResidentBlock;
use crate::packed::block::{COMPONENTS, PAIR, PIXELS, Slot};
use crate::packed::kernel::{Fixed, Kernel};
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
    let (mut pixels, mut fixed) = (Vec::new(), Fixed::default());
    for patch in 0..block.patches.len() {
        let basis = block.basis_of(patch);
        let mut out = [[0.0; 3]; PIXELS];
        kernel.pixels(&basis, &slots[block.slots_of(patch)], basis.components, (&mut fixed, &mut out));
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

/// Pixels in double precision, and the largest that a component shows.
fn exactly(block: &ResidentBlock, patch: usize, slots: &[Slot]) -> (Vec<f64>, f64) {
    let basis = block.basis_of(patch);
    let (mut pixels, mut largest) = (vec![0.0; 3 * PIXELS], 0.0f64);
    for component in 0..basis.components {
        let (slot, lane) = (component / COMPONENTS, component % COMPONENTS);
        for (index, pixel) in pixels.iter_mut().enumerate() {
            let (at, channel) = (index / 3, index % 3);
            let shown = f64::from(basis.steps[slot][lane] * slots[slot].0[channel][lane]);
            let values = &basis.values[component / 2 * PAIR..];
            *pixel += shown * f64::from(values[2 * (channel * PIXELS + at) + component % 2]);
            largest = largest.max(shown.abs());
        }
    }
    (pixels, largest * 128.0)
}

#[test]
fn pixels_are_those_of_a_sum_in_double_precision_at_any_brightness() {
    let noisy = Noisy { picture: [63, 59], positions: 1, squares: 4, rank: [1, 80], kind: Kind::Wild };
    let blocks: Vec<_> = noisy.blocks(7).iter().map(|block| ResidentBlock::new(block, 4).unwrap()).collect();
    let (mut noise, mut fixed) = (Noise(9), Fixed::default());
    let mut seen = 0;
    for (block, brightness) in
        blocks.iter().flat_map(|block| [1e-44, 1e-36, 1e-20, 1.0, 1e20, 1e30].map(|b| (block, b)))
    {
        for patch in (0..block.patches.len()).filter(|patch| block.basis_of(*patch).components > 0) {
            let mut slots = vec![Slot::ZERO; block.slots_of(patch).len()];
            // Strong and weak beside each other, as sums are.
            let mut value = || (noise.unit() - 0.5) * brightness * 10f32.powi(-(noise.within(0, 5) as i32));
            slots.iter_mut().flat_map(|slot| slot.0.as_flattened_mut()).for_each(|sum| *sum = value());
            let basis = block.basis_of(patch);
            let (exact, largest) = exactly(block, patch, &slots);
            for kernel in Kernel::available() {
                let mut out = [[f32::NAN; 3]; PIXELS];
                kernel.pixels(&basis, &slots, basis.components, (&mut fixed, &mut out));
                for (found, exact) in out.as_flattened().iter().zip(&exact) {
                    let off = (f64::from(*found) - exact).abs();
                    // Below the smallest normal numbers single precision has fewer digits.
                    assert!(off <= 1e-6 * largest + 1e-37, "{}, {brightness}: {found} for {exact}", kernel.name);
                }
                seen += 1;
            }
        }
    }
    assert!(seen > 100, "{seen} patches");
}

#[test]
fn light_that_is_no_finite_number_shows_no_number() {
    let noisy = Noisy { picture: [16, 16], positions: 1, squares: 4, rank: [9, 20], kind: Kind::Scene };
    let block = ResidentBlock::new(&noisy.blocks(1)[0], 4).unwrap();
    for (kernel, wrong) in Kernel::available().iter().flat_map(|kernel| [f32::NAN, f32::INFINITY].map(|w| (kernel, w)))
    {
        let mut slots = vec![Slot([[1.0; COMPONENTS]; 3]); block.slots_of(0).len()];
        slots[0].0[1][3] = wrong;
        let (basis, mut out) = (block.basis_of(0), [[0.0; 3]; PIXELS]);
        kernel.pixels(&basis, &slots, basis.components, (&mut Fixed::default(), &mut out));
        assert!(out.as_flattened().iter().all(|value| value.is_nan()), "{}", kernel.name);
    }
}
