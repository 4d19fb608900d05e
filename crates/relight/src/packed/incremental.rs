//! A light that changes at some positions.

use rayon::prelude::*;
use relumine_basis::Coefficients;
use relumine_radiometry::{Image, Radiance};

use crate::packed::block::{COMPONENTS, Slot};
use crate::packed::kernel::Kernel;
use crate::packed::sum::{Summing, clear, write_patches};
use crate::packed::weights::check_cells;
use crate::packed::{LightWeights, PackedError, ResidentBlock, ResidentPacked};

/// All is summed anew when the light has changed by so many times what it is now. Each change is rounded to 2⁻⁵³ of itself, so
/// what is left of changes is some 10⁻¹⁰ of the picture at most.
const DRIFT: f64 = 1e6;

/// The picture of a field under a light that changes at some positions at a time.
///
/// What each position adds to the sums v of a patch is computed in single precision and always to the same bits; the sums of
/// positions are kept in double precision. When a position changes, what it added is taken away and what it adds now is added,
/// so changes leave nothing behind: after any number of them the picture is that of the present light to [`crate::TOLERANCE`].
/// Only patches whose sums have changed are made anew.
pub struct Incremental {
    light: Coefficients,
    picture: Image<Radiance>,
    sums: Vec<Vec<Sums>>,
    /// Σ |change| since all was summed anew.
    changed: f64,
}

/// A slot in double precision.
type Sums = [[f64; COMPONENTS]; 3];
const NOTHING: Sums = [[0.0; COMPONENTS]; 3];

/// What an update has done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Update {
    /// Positions at which the light has changed.
    pub positions: usize,
    /// Patches made anew.
    pub patches: usize,
    /// Whether all lit positions were summed anew.
    pub anew: bool,
}

/// From what the new sums come.
enum Change {
    /// All lit positions.
    Anew(LightWeights),
    /// Some positions, as they were and as they are.
    Differences(LightWeights, LightWeights),
}

impl Incremental {
    /// Relights the field.
    ///
    /// # Errors
    /// If the light is for other cells.
    pub fn new(field: &ResidentPacked, light: &Coefficients) -> Result<Self, PackedError> {
        check_cells(light, field.squares(), field.positions())?;
        let (width, height) = field.picture_size();
        let sums = field.blocks().iter().map(|block| vec![NOTHING; block.number_of_slots()]).collect();
        let mut dark = light.clone();
        dark.values_mut().fill([0.0; 3]);
        let mut incremental = Self { light: dark, picture: Image::black(width, height), sums, changed: 0.0 };
        incremental.update(field, light)?;
        Ok(incremental)
    }

    /// The picture under the light of the last update, radiance [W·m⁻²·sr⁻¹].
    pub fn picture(&self) -> &Image<Radiance> {
        &self.picture
    }

    /// The light of the last update.
    pub fn light(&self) -> &Coefficients {
        &self.light
    }

    /// Goes on to another light.
    ///
    /// # Errors
    /// If the light is for other cells.
    ///
    /// # Panics
    /// If the field is another than that it was made of.
    pub fn update(&mut self, field: &ResidentPacked, light: &Coefficients) -> Result<Update, PackedError> {
        let (squares, positions) = (field.squares(), field.positions());
        check_cells(light, squares, positions)?;
        check_cells(&self.light, squares, positions)?;
        assert!(
            self.sums.len() == field.blocks().len()
                && self.sums.iter().zip(field.blocks()).all(|(sums, block)| sums.len() == block.number_of_slots()),
            "another field"
        );
        let m2 = squares * squares;
        let cells = |position: usize| position * m2..(position + 1) * m2;
        let (old, new) = (self.light.values(), light.values());
        let changed: Vec<usize> =
            (0..positions).filter(|position| old[cells(*position)] != new[cells(*position)]).collect();
        if changed.is_empty() {
            return Ok(Update::default());
        }
        let size = |value: f32| f64::from(value.abs());
        let change = changed.iter().flat_map(|position| old[cells(*position)].iter().zip(&new[cells(*position)]));
        self.changed += change.flat_map(|(old, new)| (0..3).map(|c| size(new[c] - old[c]))).sum::<f64>();
        let present: f64 = new.as_flattened().iter().map(|value| size(*value)).sum();
        let lit = (0..positions).filter(|position| !light.is_position_dark(*position)).count();
        // Differences take every changed position twice. What is not a number must not stay in the sums.
        let anew = lit <= 2 * changed.len() || !(self.changed <= DRIFT * present);
        let change = if anew {
            self.changed = 0.0;
            Change::Anew(LightWeights::new(light, squares, positions)?)
        } else {
            let of = |light: &Coefficients| LightWeights::of_positions(light, squares, positions, &changed);
            Change::Differences(of(&self.light), of(light))
        };
        let patches = self.apply(field, &change);
        self.light.clone_from(light);
        Ok(Update { positions: changed.len(), patches, anew })
    }

    /// Brings sums and picture up to date; the number of patches made anew.
    fn apply(&mut self, field: &ResidentPacked, change: &Change) -> usize {
        let kernel = Kernel::best();
        let mut shares = field.share_out(&mut self.picture);
        let blocks = field.blocks().par_iter().zip(&mut self.sums).zip(&mut shares);
        let update = |work: &mut Work, ((block, sums), rows): ((&ResidentBlock, &mut Vec<Sums>), &mut Vec<_>)| {
            work.update_sums(&kernel, block, change, sums);
            clear(&mut work.single, sums.len());
            work.patches.clear();
            for patch in 0..block.patches.len() {
                let slots = block.slots_of(patch);
                if work.touched[slots.clone()].contains(&true) {
                    work.patches.push(patch);
                    for (single, sums) in work.single[slots.clone()].iter_mut().zip(&sums[slots]) {
                        *single = Slot(sums.map(|channel| channel.map(|sum| sum as f32)));
                    }
                }
            }
            write_patches(&kernel, block, work.patches.iter().copied(), &work.single, rows);
            work.patches.len()
        };
        blocks.map_init(Work::default, update).sum()
    }
}

/// Room for the work on a block.
#[derive(Default)]
struct Work {
    old: Summing,
    new: Summing,
    anew: Vec<Sums>,
    single: Vec<Slot>,
    /// Patches to be made anew.
    patches: Vec<usize>,
    /// Slots that have changed.
    touched: Vec<bool>,
}

impl Work {
    /// Brings the sums of a block up to date, and notes which have changed.
    fn update_sums(&mut self, kernel: &Kernel, block: &ResidentBlock, change: &Change, sums: &mut [Sums]) {
        self.touched.clear();
        self.touched.resize(sums.len(), false);
        match change {
            Change::Anew(light) => {
                self.anew.clear();
                self.anew.resize(sums.len(), NOTHING);
                for (lit, table) in light.tables(0..light.lit().len()) {
                    let adds = self.new.of_position(kernel, block, lit.position, (table, lit.sparse));
                    for (sum, adds) in self.anew.as_flattened_mut().as_flattened_mut().iter_mut().zip(flat(adds)) {
                        *sum += f64::from(*adds);
                    }
                }
                for ((sum, anew), touched) in sums.iter_mut().zip(&self.anew).zip(&mut self.touched) {
                    *touched = sum != anew;
                    *sum = *anew;
                }
            }
            Change::Differences(old, new) => {
                for ((was, old), (is, new)) in old.tables(0..old.lit().len()).zip(new.tables(0..new.lit().len())) {
                    let old = self.old.of_position(kernel, block, was.position, (old, was.sparse));
                    let new = self.new.of_position(kernel, block, is.position, (new, is.sparse));
                    let slots = old.iter().zip(new).zip(sums.iter_mut()).zip(&mut self.touched);
                    for (((old, new), sum), touched) in slots.filter(|(((old, new), _), _)| old != new) {
                        *touched = true;
                        let values = flat(std::slice::from_ref(old)).zip(flat(std::slice::from_ref(new)));
                        for (sum, (old, new)) in sum.as_flattened_mut().iter_mut().zip(values) {
                            *sum += f64::from(*new) - f64::from(*old);
                        }
                    }
                }
            }
        }
    }
}

/// The values of slots.
fn flat(slots: &[Slot]) -> impl Iterator<Item = &f32> {
    slots.iter().flat_map(|slot| slot.0.as_flattened())
}
