//! From the sketches of all positions to the basis and the atoms of a patch.

use half::slice::HalfFloatSliceExt;

use crate::packed::basis::{Basis, Enough, dot, norm, sum};
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
    // The wholes of lit positions, then the squares of each.
    let wholes = lit.len();
    let mut rows = lit;
    rows.extend(parts.iter().flat_map(|parts| parts.squares.iter().map(|(_, values)| &values[..])));
    let basis = Basis::of_rows(&rows, &Enough { residual: OF_BASIS * allowed, rank: MOST_RANK });
    let coder = Coder::new(basis, allowed, length);
    let smooth = Smooth::new(&coder, [height, width]);
    let mut along = coder.along(&rows);
    let mut along_squares = along.split_off(wholes).into_iter();
    let mut along_wholes = along.into_iter();
    let mut kept = Kept::default();
    let sizes = groups.sizes();
    let m2 = squares * squares;
    let mut atoms = Vec::with_capacity(positions.len());
    for (sketch, parts) in positions.iter().zip(&parts) {
        let mut of_position = Vec::new();
        if sketch.whole.is_empty() {
            atoms.push(of_position);
            continue;
        }
        let whole = along_wholes.next().expect("one of each lit position");
        of_position.push(coder.code(sketch.main, whole, OF_WHOLE * allowed));
        kept.whole += sum(&sketch.whole);
        kept.power += f64::from(dot(&sketch.whole, &sketch.whole));
        // Groups first: squares are coded as what they show beyond their group's share.
        let mut members = sizes.clone();
        for square in parts.squares.iter().map(|(square, _)| *square).chain([sketch.main]) {
            members[groups.of(usize::from(square))] -= 1;
        }
        let mut of_groups: Vec<Option<OwnedAtom>> = (0..groups.len()).map(|_| None).collect();
        for group in (0..groups.len()).filter(|group| members[*group] > 0) {
            let spread = sizes[group] as f32 / members[group] as f32;
            let rest = &parts.rest[group * 3 * QUARTERS..][..3 * QUARTERS];
            let atom = coder.code_coefficients((m2 + group) as u16, &smooth.fit(rest, spread), OF_GROUP * allowed);
            if !atom.coefficients.is_empty() {
                kept.coarse += coder.sum(&atom, members[group] as f32 / sizes[group] as f32);
                of_groups[group] = Some(atom);
            }
        }
        for ((square, values), mut along) in parts.squares.iter().zip(&mut along_squares) {
            kept.squares += sum(values);
            let group = groups.of(usize::from(*square));
            if let Some(share) = &of_groups[group] {
                coder.take_off(&mut along, share, 1.0 / sizes[group] as f32);
            }
            let atom = coder.code(*square, along, OF_SQUARE * allowed);
            if !atom.coefficients.is_empty() {
                of_position.push(atom);
            }
        }
        of_position.extend(of_groups.into_iter().flatten());
        atoms.push(of_position);
    }
    let said = coder.decode(atoms.iter().filter_map(|of_position| of_position.first()));
    for (whole, said) in rows.iter().zip(&said) {
        kept.residual += whole.iter().zip(said).map(|(whole, said)| f64::from(whole - said).powi(2)).sum::<f64>();
    }
    let Coder { basis, steps, .. } = coder;
    let scale = 0.5f32.powi(EXPONENT);
    PackedPatch {
        steps: steps.iter().zip(&basis.per_unit).map(|(step, per_unit)| step * per_unit * scale).collect(),
        vectors: basis.vectors,
        atoms,
        kept,
    }
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
