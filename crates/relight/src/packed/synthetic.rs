//! Packed blocks of noise, for tests.

use relumine_field::Extent;
use relumine_field::packed::{Atoms, Groups, Ids, PackedBlock, Patches};

/// Random numbers of one seed.
pub(crate) struct Noise(pub(crate) u64);

impl Noise {
    /// 64 random bits.
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number from `from` to `to`, both possible.
    pub(crate) fn within(&mut self, from: usize, to: usize) -> usize {
        from + (self.bits() >> 33) as usize % (to - from + 1)
    }

    /// From 0 to 1.
    pub(crate) fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1u64 << 24) as f32
    }
}

/// What atoms a field of noise has.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Kind {
    /// As in a field of a scene: a patch is lit through a square that follows from where it lies and from those beside it.
    Scene,
    /// Any atoms of any lengths, and lists without any.
    Wild,
}

/// A packed field of noise.
#[derive(Clone, Copy)]
pub(crate) struct Noisy {
    pub(crate) picture: [usize; 2],
    pub(crate) positions: usize,
    pub(crate) squares: usize,
    /// Components of the bases, shortest and longest.
    pub(crate) rank: [usize; 2],
    pub(crate) kind: Kind,
}

impl Noisy {
    /// The blocks of at most 64 × 60 pixels, row-major.
    pub(crate) fn extents(&self) -> Vec<Extent> {
        let [width, height] = self.picture;
        let cut = |length: usize, part: usize| {
            (0..length.div_ceil(part)).map(move |i| i * part..(i * part + part).min(length))
        };
        cut(height, 60)
            .flat_map(|rows| cut(width, 64).map(move |columns| Extent { columns, rows: rows.clone() }))
            .collect()
    }

    /// All blocks.
    pub(crate) fn blocks(&self, seed: u64) -> Vec<PackedBlock> {
        self.extents().into_iter().map(|extent| self.block(extent, seed)).collect()
    }

    /// One block.
    pub(crate) fn block(&self, extent: Extent, seed: u64) -> PackedBlock {
        let start = (extent.rows.start * self.picture[0] + extent.columns.start) as u64;
        let mut noise = Noise(seed.wrapping_mul(0x1234_5678_9abc_def1).wrapping_add(start << 20));
        let patches = Patches::new(extent.rows.len(), extent.columns.len());
        let ranks: Vec<usize> = (0..patches.len()).map(|_| noise.within(self.rank[0], self.rank[1])).collect();
        let rank = ranks.iter().copied().max().unwrap_or(0);
        let pixels = extent.pixels();
        let basis = (0..rank * 3 * pixels).map(|_| (noise.bits() >> 56) as u8 as i8).collect();
        let step = |noise: &mut Noise, component: usize| (0.5 + noise.unit()) * 1e-3 / (1 + component) as f32;
        let steps = (0..rank * patches.len()).map(|index| step(&mut noise, index / patches.len())).collect();
        let position = |position: usize| {
            let list = |(patch, rank): (usize, &usize)| {
                let (rows, columns) = patches.pixels(patch);
                let at = [extent.columns.start + columns.start, extent.rows.start + rows.start];
                self.list(&mut noise, position, at, *rank)
            };
            let lists: Vec<_> = ranks.iter().enumerate().map(list).collect();
            let atoms = Atoms::parse(&to_bytes(&lists), patches.len(), rank, Ids::new(self.squares));
            Some(atoms.expect("well written"))
        };
        let positions = (0..self.positions).map(position).collect();
        PackedBlock { extent, patches, rank, basis, steps, positions }
    }

    /// The atoms of the patch whose first pixel is `[x, y]` at a position.
    fn list(&self, noise: &mut Noise, position: usize, [x, y]: [usize; 2], rank: usize) -> Vec<OwnedAtom> {
        let m = self.squares;
        let groups = Groups::new(m).len();
        match self.kind {
            Kind::Wild if noise.within(0, 7) == 0 => Vec::new(),
            Kind::Wild => {
                let atom = |noise: &mut Noise| {
                    let (id, length) = (noise.within(0, m * m + groups - 1), noise.within(0, rank));
                    OwnedAtom::new(noise, id, 3, length)
                };
                let main = noise.within(0, m * m - 1);
                let length = noise.within(0, rank);
                let mut atoms = vec![OwnedAtom::new(noise, main, 3, length)];
                atoms.extend((0..noise.within(0, 6)).map(|_| atom(noise)));
                once_each(atoms)
            }
            Kind::Scene => {
                let [width, height] = self.picture;
                let (u, v) = ((x * m / width + position) % m, (y * m / height + position / 7) % m);
                let beside = |noise: &mut Noise| {
                    let near = |noise: &mut Noise, at: usize| (at + noise.within(0, 2) + m - 1) % m;
                    near(noise, v) * m + near(noise, u)
                };
                let length = noise.within(10, 16).min(rank);
                let mut atoms = vec![OwnedAtom::new(noise, v * m + u, 4, length)];
                for _ in 0..noise.within(3, 4) {
                    let (id, length) = (beside(noise), noise.within(4, 8).min(rank));
                    atoms.push(OwnedAtom::new(noise, id, 3, length));
                }
                for _ in 0..noise.within(1, 2) {
                    let (id, length) = (m * m + noise.within(0, groups - 1), noise.within(1, 4).min(rank));
                    atoms.push(OwnedAtom::new(noise, id, 2, length));
                }
                once_each(atoms)
            }
        }
    }
}

/// Without those whose id an earlier one has.
fn once_each(mut atoms: Vec<OwnedAtom>) -> Vec<OwnedAtom> {
    let ids: Vec<u16> = atoms.iter().map(|atom| atom.id).collect();
    let mut index = 0..;
    atoms.retain(|atom| index.next().is_some_and(|index| !ids[..index].contains(&atom.id)));
    atoms
}

struct OwnedAtom {
    id: u16,
    exponent: u8,
    coefficients: Vec<i8>,
}

impl OwnedAtom {
    fn new(noise: &mut Noise, id: usize, exponents: usize, length: usize) -> Self {
        let exponent = noise.within(0, exponents) as u8;
        let mut bits = 0;
        let coefficients = (0..length)
            .map(|index| {
                bits = if index % 8 == 0 { noise.bits() } else { bits >> 8 };
                bits as u8 as i8
            })
            .collect();
        Self { id: id as u16, exponent, coefficients }
    }
}

/// The bytes that [`Atoms::parse`] reads.
fn to_bytes(lists: &[Vec<OwnedAtom>]) -> Vec<u8> {
    let atoms = || lists.iter().flatten();
    let mut bytes = (atoms().count() as u32).to_le_bytes().to_vec();
    bytes.extend(lists.iter().flat_map(|list| (list.len() as u16).to_le_bytes()));
    bytes.extend(atoms().map(|atom| atom.id.to_le_bytes()[0]));
    bytes.extend(atoms().map(|atom| atom.id.to_le_bytes()[1]));
    bytes.extend(atoms().map(|atom| atom.exponent));
    bytes.extend(atoms().map(|atom| atom.coefficients.len() as u8));
    bytes.extend(atoms().flat_map(|atom| atom.coefficients.iter().map(|value| value.to_le_bytes()[0])));
    bytes
}
