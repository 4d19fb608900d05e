//! Relighting a block as it was read, and keeping nothing.

use rayon::prelude::*;
use relumine_field::packed::PackedBlock;
use relumine_radiometry::{Image, Radiance};

use crate::packed::kernel::Kernel;
use crate::packed::sum::{Summing, write_block};
use crate::packed::{LightWeights, PackedError, ResidentBlock};

/// The pixels of one block under each light, radiance [W·m⁻²·sr⁻¹], to the bits of
/// [`ResidentPacked::relight`](crate::ResidentPacked::relight). Only the positions that some light comes from need have been read.
///
/// # Errors
/// If the lights are for other cells than the block, it was not read at a lit position, or it cannot be laid out.
pub fn relight_block(block: &PackedBlock, lights: &[LightWeights]) -> Result<Vec<Image<Radiance>>, PackedError> {
    let Some(first) = lights.first() else { return Ok(Vec::new()) };
    let positions = first.positions();
    let mut lit = vec![false; positions];
    for light in lights {
        if light.positions() != positions || light.squares() != first.squares() {
            let cells = |light: &LightWeights| light.positions() * light.squares() * light.squares();
            return Err(PackedError::OtherCells { expected: cells(first), found: cells(light) });
        }
        light.lit().for_each(|position| lit[position] = true);
    }
    let found = block.positions.len();
    if found != positions {
        return Err(PackedError::Positions { expected: positions, found });
    }
    let resident = ResidentBlock::of_positions(block, first.squares(), |position| lit.get(position) == Some(&true))?;
    if let Some(position) = (0..positions).find(|position| lit[*position] && resident.segment(*position).is_none()) {
        return Err(PackedError::Unread { position });
    }
    let kernel = Kernel::best();
    let [height, width] = block.patches.block();
    let relight = |summing: &mut Summing, light: &LightWeights| {
        let mut picture = Image::black(width, height);
        let mut rows: Vec<&mut [[f32; 3]]> = picture.pixels_mut().chunks_exact_mut(width.max(1)).collect();
        let slots = summing.sum(&kernel, std::slice::from_ref(&resident), light);
        write_block(&kernel, &resident, slots, &mut rows);
        picture
    };
    Ok(lights.par_iter().map_init(Summing::default, relight).collect())
}
