//! A light that changes at some positions.

use rayon::prelude::*;
use relumine_basis::Coefficients;
use relumine_radiometry::{Image, Radiance};

use crate::packed::block::{COMPONENTS, Slot};
use crate::packed::kernel::{self, Kernel};
use crate::packed::sum::{Summing, Write, clear, write_patches};
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
/// Only patches whose sums have changed are touched. Mostly few components have, and what they show is added to the pixels; when
/// the rounding of such additions might be seen, the patch is made anew from its sums.
pub struct Incremental {
    light: Coefficients,
    picture: Image<Radiance>,
    blocks: Vec<BlockState>,
    /// Whether `blocks` are of this light: where all is as well relit anew, their sums are not needed and left behind.
    summed: bool,
    /// Σ |change| since all was summed anew.
    changed: f64,
}

/// A patch is made anew when the squares of all that its pixels were and of what was added to them, since it last was, exceed so
/// many times the square of what it shows: a few times 10⁻⁷ of it then is rounding.
const ADDED: f64 = 64.0;
/// What is added is rounded more often than what it is added to.
const ROUNDED_MORE: f64 = 8.0;

/// What is kept of a block.
struct BlockState {
    /// v of all positions.
    sums: Vec<Sums>,
    patches: Vec<PatchState>,
}

/// Squares of what a patch shows, in its basis.
#[derive(Clone, Copy, Default)]
struct PatchState {
    /// Now.
    shown: f64,
    /// Of all it has shown and all that was added to it since it was made anew.
    added: f64,
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
    /// Patches that show it.
    pub patches: usize,
    /// Those of them that were made anew from their sums.
    pub patches_anew: usize,
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
        let state = |block: &ResidentBlock| BlockState {
            sums: vec![NOTHING; block.number_of_slots()],
            patches: vec![PatchState::default(); block.patches.len()],
        };
        let blocks = field.blocks().iter().map(state).collect();
        let mut dark = light.clone();
        dark.values_mut().fill([0.0; 3]);
        let picture = Image::black(width, height);
        let mut incremental = Self { light: dark, picture, blocks, summed: false, changed: 0.0 };
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
            self.blocks.len() == field.blocks().len()
                && self.blocks.iter().zip(field.blocks()).all(|(state, block)| {
                    state.sums.len() == block.number_of_slots() && state.patches.len() == block.patches.len()
                }),
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
        let lit = (0..positions).filter(|position| !light.is_position_dark(*position)).count();
        // Differences take every changed position twice.
        let anew = lit <= 2 * changed.len() || self.has_drifted(light, &changed);
        if anew {
            field.relight_into(light, &mut self.picture)?;
            self.summed = false;
            self.light.clone_from(light);
            let patches = field.blocks().iter().map(|block| block.patches.len()).sum();
            return Ok(Update { positions: changed.len(), patches, patches_anew: patches, anew });
        }
        let change = if self.summed {
            let of = |light: &Coefficients| LightWeights::of_positions(light, squares, positions, &changed);
            Change::Differences(of(&self.light), of(light))
        } else {
            self.changed = 0.0;
            Change::Anew(LightWeights::new(light, squares, positions)?)
        };
        let anew = !self.summed;
        self.summed = true;
        let [patches, patches_anew] = self.apply(field, &change);
        self.light.clone_from(light);
        Ok(Update { positions: changed.len(), patches, patches_anew, anew })
    }

    /// Whether so much has changed at some positions, now and before, that the sums might show it. What is not a number must not
    /// stay in them either.
    fn has_drifted(&mut self, light: &Coefficients, changed: &[usize]) -> bool {
        let m2 = light.squares() * light.squares();
        let (old, new) = (self.light.values(), light.values());
        let size = |value: f32| f64::from(value.abs());
        let cells = changed.iter().flat_map(|position| position * m2..(position + 1) * m2);
        self.changed += cells.flat_map(|cell| (0..3).map(move |c| size(new[cell][c] - old[cell][c]))).sum::<f64>();
        let present: f64 = new.as_flattened().iter().map(|value| size(*value)).sum();
        self.changed > DRIFT * present || !self.changed.is_finite()
    }

    /// Brings sums and picture up to date; the number of patches touched and of those made anew.
    fn apply(&mut self, field: &ResidentPacked, change: &Change) -> [usize; 2] {
        let kernel = Kernel::best();
        let mut shares = field.share_out(&mut self.picture);
        let blocks = field.blocks().par_iter().zip(&mut self.blocks).zip(&mut shares);
        let update = |work: &mut Work, ((block, state), rows): ((&ResidentBlock, &mut BlockState), &mut Vec<_>)| {
            work.update_sums(&kernel, block, change, &mut state.sums);
            work.choose(block, state);
            write_patches(&kernel, block, work.patches.iter().copied(), &work.difference, rows);
            let anew = work.patches.iter().filter(|(_, write)| *write == Write::Over).count();
            [work.patches.len(), anew]
        };
        blocks.map_init(Work::default, update).reduce(|| [0; 2], |a, b| [a[0] + b[0], a[1] + b[1]])
    }
}

/// Room for the work on a block.
#[derive(Default)]
struct Work {
    old: Summing,
    new: Summing,
    /// What the sums have changed by; all there is for patches to be made anew.
    difference: Vec<Slot>,
    /// Slots that have changed.
    touched: Vec<bool>,
    /// Patches that have changed.
    patches: Vec<(usize, Write)>,
}

impl Work {
    /// Brings the sums of a block up to date, and notes by what they have changed.
    fn update_sums(&mut self, kernel: &Kernel, block: &ResidentBlock, change: &Change, sums: &mut [Sums]) {
        self.touched.clear();
        self.touched.resize(sums.len(), false);
        clear(&mut self.difference, sums.len());
        // The first components of a patch change more often than others.
        (0..block.patches.len()).filter_map(|patch| sums.get(block.slots_of(patch).start)).for_each(kernel::ask_for);
        match change {
            Change::Anew(light) => {
                // The picture is not that of the sums there were: every patch is made anew.
                sums.fill(NOTHING);
                for (lit, table) in light.tables(0..light.lit().len()) {
                    let adds = self.new.of_position(kernel, block, lit.position, (table, lit.sparse));
                    sums.iter_mut().zip(adds).for_each(|(sum, adds)| {
                        each(sum, |channel, component| f64::from(adds.0[channel][component]));
                    });
                }
                self.touched.fill(true);
            }
            Change::Differences(old, new) => {
                for ((was, old), (is, new)) in old.tables(0..old.lit().len()).zip(new.tables(0..new.lit().len())) {
                    let old = self.old.of_position(kernel, block, was.position, (old, was.sparse));
                    let new = self.new.of_position(kernel, block, is.position, (new, is.sparse));
                    let slots = sums.iter_mut().zip(&mut self.difference).zip(&mut self.touched).zip(old).zip(new);
                    for ((((sum, difference), touched), old), new) in slots.filter(|((_, old), new)| !same(old, new)) {
                        *touched = true;
                        each(sum, |channel, component| {
                            let by = f64::from(new.0[channel][component]) - f64::from(old.0[channel][component]);
                            difference.0[channel][component] += by as f32;
                            by
                        });
                    }
                }
            }
        }
    }

    /// Chooses the patches that have changed, and those of them that are made anew.
    fn choose(&mut self, block: &ResidentBlock, state: &mut BlockState) {
        self.patches.clear();
        for (patch, squares) in state.patches.iter_mut().enumerate() {
            let slots = block.slots_of(patch);
            let touched = &self.touched[slots.clone()];
            let Some(last) = touched.iter().rposition(|touched| *touched) else { continue };
            let steps = block.basis_of(patch).steps;
            let sums = &state.sums[slots.clone()];
            let difference = &mut self.difference[slots];
            let (mut more, mut by) = ([0.0; COMPONENTS], [0.0; COMPONENTS]);
            for slot in (0..=last).filter(|slot| touched[*slot]) {
                add_squares(&mut by, &steps[slot], &difference[slot].0);
                for (sums, difference) in sums[slot].iter().zip(&difference[slot].0) {
                    for (component, sum) in sums.iter().enumerate() {
                        // a² − (a − b)² = b (2 a − b)
                        let (step, difference) = (f64::from(steps[slot][component]), f64::from(difference[component]));
                        more[component] += step * step * difference * (2.0 * sum - difference);
                    }
                }
            }
            squares.shown += more.iter().sum::<f64>();
            squares.added += squares.shown + ROUNDED_MORE * by.iter().sum::<f64>();
            if squares.added < ADDED * squares.shown && last + 1 < sums.len() {
                self.patches.push((patch, Write::Onto));
            } else {
                let mut shown = [0.0; COMPONENTS];
                for ((slot, sums), steps) in difference.iter_mut().zip(sums).zip(steps) {
                    *slot = Slot(sums.map(|channel| channel.map(|sum| sum as f32)));
                    add_squares(&mut shown, steps, &slot.0);
                }
                *squares = PatchState { shown: shown.iter().sum(), added: 0.0 };
                self.patches.push((patch, Write::Over));
            }
        }
    }
}

/// Adds to each sum of a slot.
#[inline(always)]
fn each(sums: &mut Sums, mut more: impl FnMut(usize, usize) -> f64) {
    for (channel, sums) in sums.iter_mut().enumerate() {
        for (component, sum) in sums.iter_mut().enumerate() {
            *sum += more(channel, component);
        }
    }
}

/// Adds the squares of what a slot shows, by component.
fn add_squares(squares: &mut [f64; COMPONENTS], steps: &[f32; COMPONENTS], slot: &[[f32; COMPONENTS]; 3]) {
    for channel in slot {
        for ((square, step), sum) in squares.iter_mut().zip(steps).zip(channel) {
            let shown = f64::from(*step) * f64::from(*sum);
            *square += shown * shown;
        }
    }
}

/// Whether two slots have the same bits.
fn same(a: &Slot, b: &Slot) -> bool {
    let values = a.0.as_flattened().iter().zip(b.0.as_flattened());
    values.fold(0, |differing, (a, b)| differing | (a.to_bits() ^ b.to_bits())) == 0
}
