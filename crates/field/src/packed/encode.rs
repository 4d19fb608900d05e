//! From the sketches of all positions to the basis and the atoms of a patch.

use half::slice::HalfFloatSliceExt;

use crate::packed::basis::{Basis, Enough, dot, norm};
use crate::packed::coder::{Coder, EXPONENT, OwnedAtom};
use crate::packed::sketch::{PatchSketch, QUARTERS, quarter, quarter_sizes};
use crate::packed::smooth::Smooth;
use crate::packed::{Groups, Kept};

/// The errors of a square's parts add up, and the picture of one square is dimmer than that of all: what is allowed for is
/// this share of the error asked for.
const ALLOWED: f64 = 0.75;

/// A square is kept by itself if it shows more than this share of the error, as norms over a patch.
pub(crate) const SQUARE_SHARE: f64 = 0.6;

/// Errors of the whole, of squares and of groups, over what is allowed.
const OF_WHOLE: f64 = 0.6;
const OF_SQUARE: f64 = 0.6;
const OF_GROUP: f64 = 0.2;

/// The basis may leave this share of what is allowed.
const OF_BASIS: f64 = 0.65;

/// The most vectors of a basis.
const MOST_RANK: usize = 192;

/// A patch, packed.
#[derive(Debug, Default)]
pub(crate) struct PackedPatch {
    /// `[component][channel · row · column]`.
    pub(crate) vectors: Vec<Vec<i8>>,
    /// By component: what a coefficient of exponent 0 is worth.
    pub(crate) steps: Vec<f32>,
    /// By position: the atoms, the whole first.
    pub(crate) atoms: Vec<Vec<OwnedAtom>>,
    /// Where the light went.
    pub(crate) kept: Kept,
}

/// Packs a patch of `height` × `width` pixels, seen from all positions, for M = `squares`, so that no square of any position
/// is off by much more than `error` times what all squares of one position show, root mean square over positions.
pub(crate) fn pack_patch(
    [height, width]: [usize; 2],
    squares: usize,
    positions: &[&PatchSketch],
    error: f64,
) -> PackedPatch {
    let length = 3 * height * width;
    let lit: Vec<&[f32]> = positions.iter().map(|sketch| &sketch.whole[..]).filter(|whole| !whole.is_empty()).collect();
    let power = lit.iter().map(|whole| f64::from(dot(whole, whole))).sum::<f64>() / positions.len() as f64;
    if power <= 0.0 {
        return PackedPatch { atoms: positions.iter().map(|_| Vec::new()).collect(), ..PackedPatch::default() };
    }
    let allowed = ALLOWED * error * power.sqrt();
    let groups = Groups::new(squares);
    let least = SQUARE_SHARE * error * power.sqrt();
    let parts: Vec<Parts> = positions.iter().map(|sketch| Parts::of(sketch, &groups, [height, width], least)).collect();
    let mut rows: Vec<Vec<f32>> = lit.iter().map(|whole| whole.to_vec()).collect();
    rows.extend(parts.iter().flat_map(|parts| parts.squares.iter().map(|(_, values)| values.clone())));
    let basis = Basis::of_rows(&rows, &Enough { residual: OF_BASIS * allowed, rank: MOST_RANK });
    let coder = Coder::new(basis, allowed, length);
    let smooth = Smooth::new(&coder, [height, width]);
    let mut kept = Kept::default();
    let sizes = groups.sizes();
    let m2 = squares * squares;
    let atoms = positions
        .iter()
        .zip(parts)
        .map(|(sketch, parts)| {
            let mut atoms = Vec::new();
            if sketch.whole.is_empty() {
                return atoms;
            }
            let mut left = sketch.whole.clone();
            atoms.push(coder.code(sketch.main, &mut left, OF_WHOLE * allowed));
            kept.whole += sum(&sketch.whole);
            kept.power += f64::from(dot(&sketch.whole, &sketch.whole));
            kept.residual += f64::from(dot(&left, &left));
            // Groups first: squares are coded as what they show beyond their group's share.
            let mut members = sizes.clone();
            for square in parts.squares.iter().map(|(square, _)| *square).chain([sketch.main]) {
                members[groups.of(usize::from(square))] -= 1;
            }
            let mut shares: Vec<Option<Vec<f32>>> = vec![None; groups.len()];
            let mut of_groups = Vec::new();
            for group in (0..groups.len()).filter(|group| members[*group] > 0) {
                let spread = sizes[group] as f32 / members[group] as f32;
                let rest = &parts.rest[group * 3 * QUARTERS..][..3 * QUARTERS];
                let atom = coder.code_coefficients((m2 + group) as u16, &smooth.fit(rest, spread), OF_GROUP * allowed);
                if !atom.coefficients.is_empty() {
                    let share = coder.decode(&atom, 1.0 / sizes[group] as f32);
                    kept.coarse += sum(&share) * members[group] as f64;
                    shares[group] = Some(share);
                    of_groups.push(atom);
                }
            }
            for (square, mut values) in parts.squares {
                kept.squares += sum(&values);
                if let Some(share) = &shares[groups.of(usize::from(square))] {
                    values.iter_mut().zip(share).for_each(|(value, share)| *value -= share);
                }
                let atom = coder.code(square, &mut values, OF_SQUARE * allowed);
                if !atom.coefficients.is_empty() {
                    atoms.push(atom);
                }
            }
            atoms.extend(of_groups);
            atoms
        })
        .collect();
    let Coder { basis, steps, .. } = coder;
    let scale = 0.5f32.powi(EXPONENT);
    PackedPatch {
        steps: steps.iter().zip(&basis.per_unit).map(|(step, per_unit)| step * per_unit * scale).collect(),
        vectors: basis.vectors,
        atoms,
        kept,
    }
}

fn sum(values: &[f32]) -> f64 {
    values.iter().map(|value| f64::from(*value)).sum()
}

/// A sketch cut at the error: squares that show less have gone to the rest of their group.
struct Parts {
    squares: Vec<(u16, Vec<f32>)>,
    rest: Vec<f32>,
}

impl Parts {
    fn of(sketch: &PatchSketch, groups: &Groups, [height, width]: [usize; 2], least: f64) -> Self {
        let mut squares = Vec::new();
        let mut rest = sketch.rest.clone();
        let sizes = quarter_sizes(height, width);
        for (square, halves) in &sketch.squares {
            let mut values = vec![0.0; halves.len()];
            halves.convert_to_f32_slice(&mut values);
            values.iter_mut().for_each(|value| *value *= sketch.scale);
            if f64::from(norm(&values)) > least {
                squares.push((*square, values));
                continue;
            }
            let rest = &mut rest[groups.of(usize::from(*square)) * 3 * QUARTERS..][..3 * QUARTERS];
            for (index, value) in values.iter().enumerate() {
                let (channel, pixel) = (index / (height * width), index % (height * width));
                let quarter = quarter(pixel / width, height, pixel % width, width);
                rest[channel * QUARTERS + quarter] += value / sizes[quarter] as f32;
            }
        }
        Self { squares, rest }
    }
}
