//! One block of a packed field: the bases of its patches and the atoms of some positions.

use crate::packed::{Atoms, Groups, POSITIONS_A_CHUNK, Patches};
use crate::Extent;

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
    /// The atoms, by chunk of [`POSITIONS_A_CHUNK`] positions; `None` if not read.
    pub chunks: Vec<Option<Atoms>>,
}

impl PackedBlock {
    /// The atoms of a patch at a position, the whole first; `None` if the position was not read.
    pub fn atoms(&self, position: usize, patch: usize) -> Option<impl Iterator<Item = crate::packed::Atom<'_>>> {
        let chunk = self.chunks.get(position / POSITIONS_A_CHUNK)?.as_ref()?;
        Some(chunk.of(position % POSITIONS_A_CHUNK, patch))
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
}
