//! The atoms of one position in one block, as bytes and read back.
//!
//! ```text
//! u32        number n of atoms
//! u16 × …    atoms of each patch
//! u8 × n     low bytes of the atoms' ids, in the same order
//! u8 × n     high bytes
//! u8 × n     exponents
//! u8 × n     numbers of coefficients
//! i8 × …     the coefficients of each atom
//! ```
//! Numbers are little-endian. Like stands beside like, so that zstd finds it.

use crate::packed::Groups;

/// One vector in the basis of a patch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Atom<'a> {
    /// The first atom of a patch is the whole and has the number of the main square. Of the others, below M² it is a square,
    /// v · M + u, from there on the group less M².
    pub id: u16,
    /// Coefficients count 2^exponent steps.
    pub exponent: u8,
    /// Of the first components of the basis; those that follow are 0.
    pub coefficients: &'a [i8],
}

/// What ids there may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ids {
    /// M², squares of a position: ids below are squares.
    pub squares: usize,
    /// Squares and groups.
    pub all: usize,
}

impl Ids {
    /// The ids of M × M squares and their groups.
    pub fn new(squares: usize) -> Self {
        let m2 = squares * squares;
        Self { squares: m2, all: m2 + Groups::new(squares).len() }
    }
}

/// The atoms of one position.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Atoms {
    bytes: Vec<u8>,
    patches: usize,
    /// Where in the list the atoms of each patch begin, and where the last ends.
    starts: Vec<u32>,
    /// Where the coefficients of the first atom of each patch begin, in bytes from the first coefficient.
    coefficients: Vec<u32>,
}

impl Atoms {
    /// The most coefficients of an atom: a whole basis of 8 × 8 pixels in three channels, some of it in two digits.
    pub const MOST_COEFFICIENTS: usize = 255;
    /// Exponents are below this.
    pub const EXPONENTS: u8 = 32;

    /// Reads the bytes of a position as FORMAT.md describes them; what follows them is padding. Below `squares`, ids are squares,
    /// from there below `ids` groups.
    ///
    /// # Errors
    /// What is wrong, if it cannot be atoms of so many patches in a basis of `rank`.
    pub fn parse(bytes: &[u8], patches: usize, rank: usize, Ids { squares, all: ids }: Ids) -> Result<Self, String> {
        let short = || format!("{} bytes are too few", bytes.len());
        let number = bytes.first_chunk::<4>().map(|number| u32::from_le_bytes(*number) as usize).ok_or_else(short)?;
        let counts = bytes.get(4..4 + 2 * patches).ok_or_else(short)?;
        let mut starts = Vec::with_capacity(patches + 1);
        let mut all = 0u32;
        for count in counts.chunks_exact(2) {
            starts.push(all);
            all += u32::from(u16::from_le_bytes([count[0], count[1]]));
        }
        starts.push(all);
        if all as usize != number {
            return Err(format!("{all} atoms are listed, but {number} announced"));
        }
        let planes = bytes.get(4 + 2 * patches..4 + 2 * patches + 4 * number).ok_or_else(short)?;
        let body = 4 + 2 * patches + 4 * number;
        let (low, rest) = planes.split_at(number);
        let (high, rest) = rest.split_at(number);
        let (exponents, lengths) = rest.split_at(number);
        let mut coefficients = Vec::with_capacity(patches);
        let mut end = 0usize;
        // By id the last list that had it.
        let mut seen = vec![0; ids];
        for (list, atoms) in starts.windows(2).enumerate() {
            coefficients.push(end as u32);
            for atom in atoms[0] as usize..atoms[1] as usize {
                let id = usize::from(u16::from_le_bytes([low[atom], high[atom]]));
                let length = usize::from(lengths[atom]);
                if id >= ids || length > rank || exponents[atom] >= Self::EXPONENTS {
                    let exponent = exponents[atom];
                    return Err(format!("an atom of square {id}, {length} coefficients and exponent {exponent}"));
                }
                if atom == atoms[0] as usize && id >= squares {
                    return Err(format!("group {} as the main square of a patch", id - squares));
                }
                if std::mem::replace(&mut seen[id], list + 1) == list + 1 {
                    return Err(format!("square {id} twice in one patch"));
                }
                end += length;
            }
        }
        let bytes = bytes.get(..body + end).ok_or_else(short)?.to_vec();
        Ok(Self { bytes, patches, starts, coefficients })
    }

    /// Atoms in all.
    pub fn len(&self) -> usize {
        self.starts.last().map_or(0, |all| *all as usize)
    }

    /// Whether there are none: this position shows nothing here.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The atoms of a patch: the whole first; none if nothing is seen there.
    ///
    /// # Panics
    /// If there is no such patch.
    pub fn of(&self, patch: usize) -> impl Iterator<Item = Atom<'_>> {
        assert!(patch < self.patches, "no such patch");
        let number = self.len();
        let ids = 4 + 2 * self.patches;
        let body = ids + 4 * number;
        let mut at = body + self.coefficients[patch] as usize;
        (self.starts[patch] as usize..self.starts[patch + 1] as usize).map(move |atom| {
            let byte = |plane: usize| self.bytes[ids + plane * number + atom];
            let coefficients = &self.bytes[at..at + usize::from(byte(3))];
            at += coefficients.len();
            Atom { id: u16::from_le_bytes([byte(0), byte(1)]), exponent: byte(2), coefficients: signed(coefficients) }
        })
    }
}

/// Bytes as signed numbers.
#[allow(unsafe_code)]
fn signed(bytes: &[u8]) -> &[i8] {
    // SAFETY: u8 and i8 have the same size and alignment, and every pattern is a value of both.
    unsafe { std::slice::from_raw_parts(bytes.as_ptr().cast(), bytes.len()) }
}

/// Atoms being written, patch by patch.
#[derive(Default)]
pub(crate) struct Writing {
    counts: Vec<u16>,
    ids: Vec<u16>,
    exponents: Vec<u8>,
    lengths: Vec<u8>,
    coefficients: Vec<i8>,
}

impl Writing {
    /// Goes on to the next patch.
    pub(crate) fn begin_patch(&mut self) {
        self.counts.push(0);
    }

    /// Adds an atom to the patch last begun.
    pub(crate) fn push(&mut self, atom: Atom) {
        *self.counts.last_mut().expect("a patch was begun") += 1;
        self.ids.push(atom.id);
        self.exponents.push(atom.exponent);
        self.lengths.push(atom.coefficients.len() as u8);
        self.coefficients.extend_from_slice(atom.coefficients);
    }

    /// The bytes.
    pub(crate) fn finish(&self) -> Vec<u8> {
        let mut bytes = (self.ids.len() as u32).to_le_bytes().to_vec();
        bytes.extend(self.counts.iter().flat_map(|count| count.to_le_bytes()));
        bytes.extend(self.ids.iter().map(|id| id.to_le_bytes()[0]));
        bytes.extend(self.ids.iter().map(|id| id.to_le_bytes()[1]));
        bytes.extend_from_slice(&self.exponents);
        bytes.extend_from_slice(&self.lengths);
        bytes.extend(self.coefficients.iter().map(|value| value.to_le_bytes()[0]));
        bytes
    }
}
