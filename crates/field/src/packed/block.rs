//! One block of a packed field: the bases of its patches and the atoms of some positions.

use half::f16;

use crate::Extent;
use crate::packed::{Atoms, Groups, Patches};

/// One block of pixels, read.
#[derive(Clone, Debug)]
pub struct PackedBlock {
    /// Its pixels in the picture.
    pub extent: Extent,
    /// The cut of its pixels.
    pub patches: Patches,
    /// Components of the longest basis of its patches.
    pub rank: usize,
    /// The bases, `[component][channel][row][column]` of the block.
    pub basis: Vec<i8>,
    /// What one step of a coefficient is worth, `[component][patch]`.
    pub steps: Vec<f32>,
    /// The atoms by position; `None` if not read.
    pub positions: Vec<Option<Atoms>>,
}

impl PackedBlock {
    /// The atoms of a patch at a position, the whole first; `None` if the position was not read.
    pub fn atoms(&self, position: usize, patch: usize) -> Option<impl Iterator<Item = crate::packed::Atom<'_>>> {
        Some(self.positions.get(position)?.as_ref()?.of(patch))
    }

    /// Adds `weights` (by square, v · M + u) times the transfers of a position to `picture`,
    /// `[channel][row][column]` of the block: the plain version of relighting.
    pub fn add_weighted(&self, position: usize, groups: &Groups, weights: &[[f32; 3]], picture: &mut [f64]) {
        let [height, width] = self.patches.block();
        let sizes = groups.sizes();
        let mut means = vec![[0.0f64; 3]; groups.len()];
        for (square, weight) in weights.iter().enumerate() {
            let group = groups.of(square);
            (0..3).for_each(|c| means[group][c] += f64::from(weight[c]) / sizes[group] as f64);
        }
        let weight_of = |id: usize| match weights.get(id) {
            Some(weight) => weight.map(f64::from),
            None => means[id - weights.len()],
        };
        for patch in 0..self.patches.len() {
            let Some(atoms) = self.atoms(position, patch) else { continue };
            let (rows, columns) = self.patches.pixels(patch);
            let mut main = None;
            for atom in atoms {
                let mut weight = weight_of(usize::from(atom.id));
                match main {
                    None => main = Some(weight),
                    Some(main) => (0..3).for_each(|c| weight[c] -= main[c]),
                }
                for (component, coefficient) in atom.coefficients.iter().enumerate() {
                    let step = f64::from(self.steps[component * self.patches.len() + patch]);
                    let value = f64::from(*coefficient) * step * f64::from(atom.exponent).exp2();
                    for (c, weight) in weight.iter().enumerate() {
                        for y in rows.clone() {
                            let row = ((component * 3 + c) * height + y) * width;
                            for x in columns.clone() {
                                let out = (c * height + y) * width + x;
                                picture[out] += weight * value * f64::from(self.basis[row + x]);
                            }
                        }
                    }
                }
            }
        }
    }

    /// The transfers of all squares of a position over `scale`, `[square][channel][row][column]` of the block, into `values`.
    ///
    /// # Panics
    /// If `values` are not M² · 3 · pixels.
    pub fn decode(&self, position: usize, groups: &Groups, scale: f32, values: &mut [f16]) {
        let [height, width] = self.patches.block();
        let plane = height * width;
        let sizes = groups.sizes();
        let m2 = sizes.iter().sum::<usize>();
        assert_eq!(values.len(), m2 * 3 * plane, "every pixel of every square");
        values.fill(f16::ZERO);
        for patch in 0..self.patches.len() {
            let Some(atoms) = self.atoms(position, patch) else { continue };
            let (rows, columns) = self.patches.pixels(patch);
            let pixels = rows.len() * columns.len();
            let mut main = None;
            let mut shares: Vec<Option<Vec<f32>>> = vec![None; groups.len()];
            let mut squares: Vec<(usize, Vec<f32>)> = Vec::new();
            for atom in atoms {
                let id = usize::from(atom.id);
                let mut vector = self.vector(patch, &atom);
                match (&mut main, id < m2) {
                    (None, _) => main = Some((id, vector)),
                    (Some((_, whole)), true) => {
                        whole.iter_mut().zip(&vector).for_each(|(whole, value)| *whole -= value);
                        squares.push((id, vector));
                    }
                    (Some((_, whole)), false) => {
                        whole.iter_mut().zip(&vector).for_each(|(whole, value)| *whole -= value);
                        vector.iter_mut().for_each(|value| *value /= sizes[id - m2] as f32);
                        shares[id - m2] = Some(vector);
                    }
                }
            }
            let Some((main, whole)) = main else { continue };
            squares.push((main, whole));
            let mut put = |square: usize, vector: &dyn Fn(usize) -> f32| {
                for index in 0..3 * pixels {
                    let (channel, pixel) = (index / pixels, index % pixels);
                    let (y, x) = (rows.start + pixel / columns.len(), columns.start + pixel % columns.len());
                    let value = (vector(index) / scale).clamp(-f16::MAX.to_f32(), f16::MAX.to_f32());
                    values[(square * 3 + channel) * plane + y * width + x] = f16::from_f32(value);
                }
            };
            for square in 0..m2 {
                let own = squares.iter().find(|(own, _)| *own == square).map(|(_, vector)| vector);
                match (own, &shares[groups.of(square)]) {
                    (Some(own), Some(share)) => put(square, &|index| own[index] + share[index]),
                    (Some(own), None) => put(square, &|index| own[index]),
                    (None, Some(share)) => put(square, &|index| share[index]),
                    (None, None) => {}
                }
            }
        }
    }

    /// What an atom says, `[channel][row][column]` of its patch.
    fn vector(&self, patch: usize, atom: &crate::packed::Atom) -> Vec<f32> {
        let [height, width] = self.patches.block();
        let (rows, columns) = self.patches.pixels(patch);
        let mut vector = vec![0.0f32; 3 * rows.len() * columns.len()];
        for (component, coefficient) in atom.coefficients.iter().enumerate() {
            let step = self.steps[component * self.patches.len() + patch];
            let value = f32::from(*coefficient) * step * f32::from(atom.exponent).exp2();
            let lines =
                (0..3).flat_map(|channel| rows.clone().map(move |y| ((component * 3 + channel) * height + y) * width));
            for (line, sums) in lines.zip(vector.chunks_exact_mut(columns.len())) {
                let basis = &self.basis[line..][columns.clone()];
                sums.iter_mut().zip(basis).for_each(|(sum, entry)| *sum += value * f32::from(*entry));
            }
        }
        vector
    }
}
