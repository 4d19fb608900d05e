//! Where a chart lies in a photograph, without being told: patches of even colour, the lattice they stand on, and the place on
//! it where the colours agree with the reference.
//!
//! No step knows the camera's colours: the last one asks how much of the reference's colours (cube roots of linear Rec. 709) an
//! affine map of the camera's explains, and takes the place and the orientation that explain most.

mod lattice;
mod regions;

use super::ColourError;
use super::chart::Chart;
use super::measure::Photograph;
use super::reference::Reference;
use lattice::{Lattice, lattices};
use regions::{Reduced, regions};

use crate::Homography;
use crate::solve::least_squares;

/// Colours that are explained to less than this share (R²) are not the chart's.
const LEAST_AGREEMENT: f64 = 0.8;

/// A chart that was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// Where [`Chart::corners`] lie, pixels, (0, 0) at the outer corner of the first pixel.
    pub corners: [[f64; 2]; 4],
    /// How much of the reference's colours the photograph's explain, R², 0 … 1.
    pub agreement: f64,
    /// How many patches stand out by themselves; the others follow from the lattice.
    pub patches: usize,
}

/// A place of the chart on a lattice.
struct Place<'a> {
    lattice: &'a Lattice,
    /// The chart's column and row → the lattice's.
    turn: [[i32; 2]; 2],
    origin: [i32; 2],
    agreement: f64,
}

impl Chart {
    /// Finds the chart in a photograph, whichever way it is turned. It must be one regular grid ([`Chart::grid`]), at least some 12
    /// pixels a patch when the photograph is reduced to 1000 pixels a side, and not mirrored.
    ///
    /// # Errors
    /// If the chart is no grid, the reference lacks a patch, or it is not found: then what came nearest is said.
    pub fn find(&self, photograph: &Photograph, reference: &Reference) -> Result<Found, ColourError> {
        let Some([columns, rows]) = self.grid() else {
            let reason =
                format!("{} is not one regular grid of patches, so it cannot be found: give its corners", self.name());
            return Err(ColourError::Patches(reason));
        };
        let colours: Vec<[f64; 3]> = self
            .patches()
            .iter()
            .map(|patch| reference.rec709(&patch.name).map(|rgb| rgb.map(f64::cbrt)))
            .collect::<Option<_>>()
            .ok_or_else(|| {
                ColourError::Patches(format!(
                    "{} cannot be found: {} lacks some of its patches",
                    self.name(),
                    reference.name()
                ))
            })?;
        let reduced = Reduced::of(photograph);
        let regions = regions(&reduced);
        let lattices = lattices(&regions, self.patches().len());
        let mut best: Option<Place> = None;
        for lattice in &lattices {
            for place in places(lattice, &reduced, [columns, rows], &colours) {
                if best.as_ref().is_none_or(|best| best.agreement < place.agreement) {
                    best = Some(place);
                }
            }
        }
        let not_found = |nearest: String| {
            ColourError::NotFound(format!("{} was not found in the photograph ({nearest})", self.name()))
        };
        let Some(best) = best else {
            let largest = lattices.iter().map(|lattice| lattice.nodes.len()).max().unwrap_or(0);
            return Err(not_found(format!(
                "{} even patches, of which at most {largest} stand on a lattice",
                regions.len()
            )));
        };
        if best.agreement < LEAST_AGREEMENT {
            return Err(not_found(format!(
                "where {columns} × {rows} patches may be, their colours explain {:.0} % of the reference's",
                100.0 * best.agreement
            )));
        }
        let mut pairs = Vec::new();
        for (index, patch) in self.patches().iter().enumerate() {
            let [left, top, right, bottom] = patch.rectangle;
            if let Some([x, y]) = best.lattice.nodes.get(&best.node(index % columns, index / columns)) {
                pairs.push(([0.5 * (left + right), 0.5 * (top + bottom)], reduced.to_photograph([*x, *y])));
            }
        }
        let map = Homography::fit(&pairs)
            .ok_or_else(|| not_found(format!("only {} of its patches stand out", pairs.len())))?;
        Ok(Found {
            corners: self.corners().map(|corner| map.apply(corner)),
            agreement: best.agreement,
            patches: pairs.len(),
        })
    }
}

impl Place<'_> {
    fn node(&self, column: usize, row: usize) -> [i32; 2] {
        let (c, r) = (column as i32, row as i32);
        [0, 1].map(|axis| self.origin[axis] + self.turn[axis][0] * c + self.turn[axis][1] * r)
    }
}

/// Every place and orientation of the chart that has at least a third of its patches standing out.
fn places<'a>(
    lattice: &'a Lattice,
    reduced: &Reduced,
    [columns, rows]: [usize; 2],
    colours: &[[f64; 3]],
) -> Vec<Place<'a>> {
    let (low, high) = lattice.bounds();
    let (width, height) = (columns as i32, rows as i32);
    // Colours of the lattice as far as a chart can stretch beyond what stands out.
    let reach = width.max(height);
    let sampled = lattice.colours(reduced, [low[0] - reach, low[1] - reach], [high[0] + reach, high[1] + reach]);
    let mut places = Vec::new();
    for turn in [[[1, 0], [0, 1]], [[0, -1], [1, 0]], [[-1, 0], [0, -1]], [[0, 1], [-1, 0]]] {
        // Where the chart's last column and row come to lie, seen from its first.
        let span = [0, 1].map(|axis: usize| turn[axis][0] * (width - 1) + turn[axis][1] * (height - 1));
        let range = |axis: usize| {
            let (before, after) = (span[axis].max(0), span[axis].min(0));
            (low[axis] - before)..=(high[axis] - after)
        };
        for y in range(1) {
            for x in range(0) {
                let mut place = Place { lattice, turn, origin: [x, y], agreement: 0.0 };
                let nodes: Vec<[i32; 2]> =
                    (0..columns * rows).map(|index| place.node(index % columns, index / columns)).collect();
                let standing_out = nodes.iter().filter(|node| lattice.nodes.contains_key(*node)).count();
                if 3 * standing_out < nodes.len() {
                    continue;
                }
                let shown: Option<Vec<[f64; 3]>> = nodes.iter().map(|node| sampled.get(node).copied()).collect();
                if let Some(agreement) = shown.and_then(|shown| agreement(&shown, colours)) {
                    place.agreement = agreement;
                    places.push(place);
                }
            }
        }
    }
    places
}

/// R² of the reference's colours on an affine map of the shown ones; `None` if these are all on a plane.
fn agreement(shown: &[[f64; 3]], reference: &[[f64; 3]]) -> Option<f64> {
    let (mut left, mut whole) = (0.0, 0.0);
    for channel in 0..3 {
        let mean = reference.iter().map(|colour| colour[channel]).sum::<f64>() / reference.len() as f64;
        let rows: Vec<([f64; 4], f64)> =
            shown.iter().zip(reference).map(|([r, g, b], colour)| ([*r, *g, *b, 1.0], colour[channel])).collect();
        let map = least_squares(&rows)?;
        for (row, value) in &rows {
            let explained: f64 = row.iter().zip(&map).map(|(a, b)| a * b).sum();
            left += (value - explained).powi(2);
            whole += (value - mean).powi(2);
        }
    }
    Some(1.0 - left / whole)
}
