//! Sharing light between positions: spherical Delaunay triangles and the weights of their corners.

use super::buckets::{Buckets, Cap};
use super::chain::Chain;
use super::surface::Surface;
use super::{SphericalError, checked, hemisphere_voronoi_areas};
use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, TAU};

/// A share smaller than this is rounding and counts as nothing, so that a site has weight 1 at itself.
const NOTHING: f64 = 1e-12;

/// Up to three sites and their shares, each > 0, together 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weights {
    entries: [(usize, f64); 3],
    len: usize,
}

impl Weights {
    /// Adds up what belongs to one site, drops what is nothing and normalises.
    fn new(raw: [(usize, f64); 3]) -> Self {
        let total: f64 = raw.iter().map(|entry| entry.1).sum();
        let mut weights = Self { entries: [(raw[0].0, 0.0); 3], len: 0 };
        for (site, weight) in raw.into_iter().filter(|entry| entry.1 > NOTHING * total) {
            let known = weights.entries[..weights.len].iter().position(|entry| entry.0 == site);
            let slot = known.unwrap_or(weights.len);
            weights.entries[slot] = (site, if known.is_some() { weights.entries[slot].1 + weight } else { weight });
            weights.len = weights.len.max(slot + 1);
        }
        let sum: f64 = weights.as_slice().iter().map(|entry| entry.1).sum();
        for entry in &mut weights.entries[..weights.len] {
            entry.1 /= sum;
        }
        weights
    }

    /// The pairs of site index and weight.
    pub fn as_slice(&self) -> &[(usize, f64)] {
        &self.entries[..self.len]
    }
}

impl<'a> IntoIterator for &'a Weights {
    type Item = (usize, f64);
    type IntoIter = std::iter::Copied<std::slice::Iter<'a, (usize, f64)>>;

    fn into_iter(self) -> Self::IntoIter {
        self.as_slice().iter().copied()
    }
}

/// The spherical Delaunay triangles of sites on the hemisphere, ready for millions of queries.
///
/// They are those faces of the sites' convex hull whose empty cap does not hold the point opposite the middle of the
/// sites, less flat ones at the border (caps of more than 85° radius). When every face is flat (one or two sites,
/// sites on one great circle) there are no triangles, and weights depend on the angle along that circle alone.
#[derive(Debug, Clone)]
pub struct Triangulation {
    sites: Vec<DVec3>,
    shape: Shape,
    near: Buckets,
}

#[derive(Debug, Clone)]
enum Shape {
    Surface(Surface),
    Chain(Chain),
}

impl Triangulation {
    /// Triangulates the sites.
    ///
    /// # Errors
    /// When the list is empty or a site cannot be used, see [`SphericalError`].
    pub fn new(sites: &[DVec3]) -> Result<Self, SphericalError> {
        let sites = checked(sites)?;
        let areas = hemisphere_voronoi_areas(&sites)?;
        // Weighed by area the middle of a full dome is near the zenith, however the sites crowd. Each site counts a
        // little in any case, so that the middle is inside the sites and not on their border.
        let least = 0.01 * TAU / sites.len() as f64;
        let middle: DVec3 = sites.iter().zip(&areas).map(|(&site, area)| site * (area + least)).sum();
        let centre = if middle.length() > 1e-6 { middle.normalize() } else { DVec3::Z };
        let shape = match Surface::new(&sites, centre) {
            Some(surface) => Shape::Surface(surface),
            None => Shape::Chain(Chain::new(&sites)),
        };
        let near = Buckets::build(sites.len(), |cap, candidates| owners(cap, candidates, &sites));
        Ok(Self { sites, shape, near })
    }

    /// The sites, with length one, in the order given.
    pub fn sites(&self) -> &[DVec3] {
        &self.sites
    }

    /// Site indices of the triangles, counter-clockwise seen from outside.
    pub fn triangles(&self) -> &[[usize; 3]] {
        match &self.shape {
            Shape::Surface(surface) => &surface.triangles,
            Shape::Chain(_) => &[],
        }
    }

    /// Whether a triangle holds the direction; then its weighted sites sum to a vector along the direction.
    pub fn covers(&self, direction: DVec3) -> bool {
        match &self.shape {
            Shape::Surface(surface) => surface.inside(direction.normalize_or(DVec3::Z), &self.sites).is_some(),
            Shape::Chain(_) => false,
        }
    }

    /// How to share light from a direction among the sites: continuous in the direction and 1 at each site.
    ///
    /// In a triangle these are the planar barycentric coordinates of where the ray meets the triangle's plane. Beyond
    /// the triangles they are those of the nearest point of the convex outline of the sites; where the border is dented
    /// they are those of the point below, towards the middle of the sites. Directions farther than about 78° from the
    /// outline slide along it to the middle, for there the nearest point would jump. A vector without direction counts
    /// as the zenith.
    pub fn weights(&self, direction: DVec3) -> Weights {
        let direction = direction.normalize_or(DVec3::Z);
        Weights::new(match &self.shape {
            Shape::Surface(surface) => surface.weights(direction, &self.sites),
            Shape::Chain(chain) => chain.weights(direction),
        })
    }

    /// The site nearest to a direction, the owner of its Voronoi region; of equally near ones the lowest index.
    pub fn nearest(&self, direction: DVec3) -> usize {
        let direction = direction.normalize_or(DVec3::Z);
        let (mut best, mut to_beat) = (0, f64::INFINITY);
        for &site in self.near.at(direction) {
            // Squared chords keep their digits for near sites; equal up to rounding is equal.
            let distance = self.sites[site as usize].distance_squared(direction);
            if distance < to_beat {
                (best, to_beat) = (site as usize, distance - 1e-15 * distance.sqrt());
            }
        }
        best
    }
}

/// The sites that own a direction in the cap: all but those whose bisector with the site nearest to the middle leaves
/// the whole cap to that one.
fn owners(cap: Cap, candidates: &[u32], sites: &[DVec3]) -> Vec<u32> {
    let distance = |site: &u32| sites[*site as usize].distance_squared(cap.centre);
    let Some(&middle) = candidates.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))) else {
        return Vec::new();
    };
    let slack = cap.radius.min(FRAC_PI_2).sin() + 1e-9;
    let reaches = |site: &u32| {
        let apart = sites[middle as usize] - sites[*site as usize];
        apart.dot(cap.centre) <= slack * apart.length()
    };
    candidates.iter().copied().filter(reaches).collect()
}
