//! Flux counted in cells.

use glam::DVec3;
use relumine_basis::{Between, Cell, Cells, Entry};

use crate::Reconstruction;

/// What became of flux that was shot at the object.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Tally {
    /// All of it that meets the object's ball.
    pub(crate) aimed: f64,
    /// Of that, from below the horizon, where no position stands.
    pub(crate) below_horizon: f64,
    /// Of that, outside the pattern's cone.
    pub(crate) outside_pattern: f64,
}

impl Tally {
    pub(crate) fn add(&mut self, other: Self) {
        self.aimed += other.aimed;
        self.below_horizon += other.below_horizon;
        self.outside_pattern += other.outside_pattern;
    }
}

/// Flux by cell index, and how it gets there.
pub(crate) struct Deposit<'a> {
    cells: &'a Cells,
    reconstruction: Reconstruction,
    /// Rays that pass the origin at a greater distance light nothing, metres.
    object_radius_m: f64,
    /// Whether such rays are left out of the cells too.
    cut_at_object: bool,
    pub(crate) flux: Vec<DVec3>,
    pub(crate) tally: Tally,
}

impl<'a> Deposit<'a> {
    pub(crate) fn new(cells: &'a Cells, reconstruction: Reconstruction, object_radius_m: Option<f64>) -> Self {
        Self {
            cells,
            reconstruction,
            object_radius_m: object_radius_m.unwrap_or(cells.covered_radius_m()),
            cut_at_object: object_radius_m.is_some(),
            flux: vec![DVec3::ZERO; cells.len()],
            tally: Tally::default(),
        }
    }

    /// Whether the line through `point` in `direction` counts at all.
    pub(crate) fn reaches_object(&self, point: DVec3, direction: DVec3) -> bool {
        !self.cut_at_object || self.meets_object(point, direction)
    }

    fn meets_object(&self, point: DVec3, direction: DVec3) -> bool {
        point.reject_from_normalized(direction).length() <= self.object_radius_m
    }

    /// Counts a ray that carries `flux` and starts at `point` in `direction`.
    pub(crate) fn ray(&mut self, point: DVec3, direction: DVec3, flux: DVec3) {
        // Light that leaves a lamp outside the object away from it has not come through the object either.
        if point.dot(direction) > 0.0 && point.length() > self.object_radius_m {
            return;
        }
        let meets = self.meets_object(point, direction);
        if !meets && self.cut_at_object {
            return;
        }
        let aimed = if meets { flux.element_sum() } else { 0.0 };
        self.tally.aimed += aimed;
        match self.cells.entry(point, direction) {
            Entry::Square { outward, u, v } => {
                self.square(&self.reconstruction.shares(self.cells, outward), u, v, flux);
            }
            Entry::BelowHorizon => self.tally.below_horizon += aimed,
            Entry::OutsidePattern | Entry::Misses => self.tally.outside_pattern += aimed,
        }
    }

    /// Counts flux that these positions share and that enters through square (u, v).
    pub(crate) fn square(&mut self, shares: &Between, u: usize, v: usize, flux: DVec3) {
        for &(position, share) in shares.shares() {
            self.flux[self.cells.index(Cell { position, u, v })] += flux * share;
        }
    }
}
