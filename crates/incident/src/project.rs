//! A whole light description projected on the cells.

use glam::DVec3;
use rand::SeedableRng;
use rand_pcg::Pcg64;
use rayon::prelude::*;
use relumine_basis::{Cell, Cells, Coefficients, Entry, Reach};
use relumine_lamp::{Lamp, Light, Mosaic};

use crate::deposit::{Deposit, Tally};
use crate::{IncidentError, Reconstruction, cell_quadrature, source_rays};

/// Independent repetitions: their spread is the error estimate.
const BATCHES: usize = 16;
/// What of an environment is brighter than this many times its mean is drawn from the source: suns and windows are small,
/// and samples of the cells would miss them.
const CEILING: f64 = 2.0;

/// How to project.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// What happens between positions.
    pub between: Reconstruction,
    /// Collapse the light to what arrives at the origin first, the same at every point (figs. 1 and 10, bottom).
    pub light_map: bool,
    /// Rays for each lamp and samples for the environment, in all.
    pub samples: usize,
    /// Leave out light that passes the origin at a greater distance, metres: it lights nothing. `None` fills cells whole,
    /// which makes each coefficient the mean over its cell.
    pub object_radius_m: Option<f64>,
    /// Start of the random numbers.
    pub seed: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            between: Reconstruction::default(),
            light_map: false,
            samples: 1 << 20,
            object_radius_m: None,
            seed: 2003,
        }
    }
}

/// Light on the cells.
#[derive(Clone, Debug)]
pub struct Projected {
    /// lᵢ.
    pub coefficients: Coefficients,
    /// Σ lᵢ |Ωᵢ|, per channel: W for near cells, W·m⁻² for far fields.
    pub flux: [f64; 3],
    /// Standard error of the coefficients, relative L2 weighted with |Ωᵢ|.
    pub relative_error: f64,
    /// What lamps send to the object and no cell can carry.
    pub lost: Lost,
}

/// Shares of the flux that lamps send to the object's ball and that is lost to the relighting.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lost {
    /// From below the horizon.
    pub below_horizon: f64,
    /// From outside the pattern's cone.
    pub outside_pattern: f64,
}

/// Projects `light` on `cells`. The same light, cells and options give the same bits.
///
/// # Errors
/// If the light's mosaic does not have the shape of the cells.
pub fn project(light: &Light, cells: &Cells, options: &Options) -> Result<Projected, IncidentError> {
    let lamps: Vec<Lamp> = light.lamps.iter().map(|lamp| light.placement.object_from_world_lamp(lamp)).collect();
    let environment =
        light.environment.as_ref().map(|environment| environment.clone().turned(-light.placement.rotation, 1.0));
    let mosaic = light.mosaic.as_ref().map(|mosaic| mosaic_coefficients(mosaic, cells)).transpose()?;
    // Distant lamps are a light map already.
    let light_map = options.light_map && cells.reach() != Reach::Far;
    // A mosaic that is neither moved nor collapsed is the coefficients themselves.
    let (exact, moved) = match mosaic {
        Some(mosaic) if light.placement.is_identity() && !light_map => (Some(mosaic), None),
        other => (None, other),
    };
    let environment_parts =
        environment.as_ref().map(|environment| environment.split(CEILING * environment.mean_luminance()));
    let batch = |index: usize| -> (Vec<DVec3>, Tally) {
        let mut deposit = Deposit::new(cells, options.between, options.object_radius_m);
        let samples = options.samples.div_ceil(BATCHES);
        let stream = |source: usize| Pcg64::seed_from_u64(options.seed ^ ((source * BATCHES + index) as u64) << 32);
        for lamp in &lamps {
            // The same random numbers for every lamp: a light that is the sum of two gives the sum of their coefficients.
            let mut stream = stream(3);
            if light_map || cells.reach() == Reach::Far {
                let arrival = |xi: [f64; 2]| lamp.arrival(DVec3::ZERO, xi);
                source_rays::shoot_arriving(&arrival, cells, samples, &mut stream, &mut deposit);
            } else {
                source_rays::shoot(lamp, cells, samples, &mut stream, &mut deposit);
            }
        }
        if let Some((smooth, highlights)) = &environment_parts {
            let radiance = |_: DVec3, direction: DVec3| smooth(-direction);
            cell_quadrature::integrate(&radiance, cells, options.between, samples, &mut stream(0), &mut deposit);
            if let Some(highlights) = highlights {
                let arrival = |xi: [f64; 2]| highlights.arrival(xi);
                source_rays::shoot_arriving(&arrival, cells, samples, &mut stream(2), &mut deposit);
            }
        }
        if let Some(mosaic) = &moved {
            let radiance = |point: DVec3, direction: DVec3| {
                let direction = light.placement.world_from_object_direction(direction);
                if light_map {
                    radiance_at_origin(mosaic, cells, light.placement.translation, direction)
                } else {
                    radiance_of_mosaic(mosaic, cells, light.placement.world_from_object_point(point), direction)
                }
            };
            // A mosaic is constant on its cells: to share its light between positions would blur it twice.
            let between = Reconstruction::Box;
            cell_quadrature::integrate(&radiance, cells, between, samples, &mut stream(1), &mut deposit);
        }
        (deposit.flux, deposit.tally)
    };
    let nothing_to_sample = lamps.is_empty() && light.environment.is_none() && moved.is_none();
    let batches = if nothing_to_sample { 0 } else { BATCHES };
    let mut statistics = Statistics::new(cells);
    let together = rayon::current_num_threads().clamp(1, BATCHES);
    for start in (0..batches).step_by(together) {
        // Folded in the order of the batches, whatever thread was first.
        let done: Vec<_> = (start..batches.min(start + together)).into_par_iter().map(batch).collect();
        done.into_iter().for_each(|(flux, tally)| statistics.add(&flux, tally));
    }
    Ok(statistics.finish(cells, exact))
}

fn mosaic_coefficients(mosaic: &Mosaic, cells: &Cells) -> Result<Coefficients, IncidentError> {
    let mut coefficients = cells.dark();
    let (width, height) = mosaic.pixels.size();
    coefficients
        .set_mosaic(width, height, mosaic.pixels.pixels())
        .map_err(|source| IncidentError::Mosaic { path: mosaic.path.clone(), source })?;
    Ok(coefficients)
}

/// The light field that a mosaic describes: constant on each cell, nothing outside all cells.
fn radiance_of_mosaic(mosaic: &Coefficients, cells: &Cells, point: DVec3, direction: DVec3) -> DVec3 {
    match cells.entry(point, direction) {
        Entry::Square { outward, u, v } => {
            let position = cells.partition().owner(outward);
            DVec3::from_array(mosaic.values()[cells.index(Cell { position, u, v })].map(f64::from))
        }
        _ => DVec3::ZERO,
    }
}

/// What of a mosaic arrives at the point where the object's origin stands, from a direction; on the axis of a pattern four
/// squares meet if M is even, and their mean is taken by looking a little to each side.
fn radiance_at_origin(mosaic: &Coefficients, cells: &Cells, origin: DVec3, direction: DVec3) -> DVec3 {
    let (x, y) = direction.any_orthonormal_pair();
    let aside = 1e-6;
    [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)]
        .map(|(a, b)| radiance_of_mosaic(mosaic, cells, origin, (direction + aside * (a * x + b * y)).normalize()))
        .iter()
        .sum::<DVec3>()
        / 4.0
}

/// Mean and spread of the batches.
struct Statistics {
    sum: Vec<DVec3>,
    squares: Vec<DVec3>,
    batches: f64,
    tally: Tally,
}

impl Statistics {
    fn new(cells: &Cells) -> Self {
        let zeros = vec![DVec3::ZERO; cells.len()];
        Self { sum: zeros.clone(), squares: zeros, batches: 0.0, tally: Tally::default() }
    }

    fn add(&mut self, flux: &[DVec3], tally: Tally) {
        for ((sum, squares), flux) in self.sum.iter_mut().zip(&mut self.squares).zip(flux) {
            *sum += *flux;
            *squares += *flux * *flux;
        }
        self.batches += 1.0;
        self.tally.add(tally);
    }

    fn finish(self, cells: &Cells, exact: Option<Coefficients>) -> Projected {
        let n = f64::max(self.batches, 1.0);
        let mut coefficients = exact.unwrap_or_else(|| cells.dark());
        let (mut flux, mut error, mut energy) = (DVec3::ZERO, 0.0, 0.0);
        for (cell, value) in coefficients.values_mut().iter_mut().enumerate() {
            let measure = cells.measure(cell);
            let mean = self.sum[cell] / n;
            let total = DVec3::from_array(value.map(f64::from)) + mean / measure;
            *value = total.to_array().map(|component| component as f32);
            flux += total * measure;
            // The variance of the mean of n batches, per |Ω|² to be one of lᵢ, times |Ω| as weight.
            let variance = (self.squares[cell] / n - mean * mean).max(DVec3::ZERO) / f64::max(n - 1.0, 1.0);
            error += variance.element_sum() / measure;
            energy += (total * total).element_sum() * measure;
        }
        let share = |lost: f64| if self.tally.aimed > 0.0 { lost / self.tally.aimed } else { 0.0 };
        Projected {
            coefficients,
            flux: flux.to_array(),
            relative_error: if energy > 0.0 { (error / energy).sqrt() } else { 0.0 },
            lost: Lost {
                below_horizon: share(self.tally.below_horizon),
                outside_pattern: share(self.tally.outside_pattern),
            },
        }
    }
}
