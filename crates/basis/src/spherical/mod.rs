//! Regions and triangles on the hemisphere, for positions that are no regular grid.
//!
//! A regular partition cuts the hemisphere into azimuth × tilt patches. For any other list of positions (the *sites*)
//! a patch is the site's spherical Voronoi region, [`hemisphere_voronoi`], and light between positions is shared
//! among the corners of a spherical Delaunay triangle, [`Triangulation`].
//!
//! All directions are unit vectors with z up; solid angles are in steradians. Everything is deterministic: the same
//! sites in the same order give the same bits.
//!
//! What this module will not do: whole spheres (sites may reach only [`LOWEST_SITE_Z`] below the horizon), two sites
//! at one place, weights of distance or density, gradients, and extrapolation. A direction beyond the outermost sites
//! gets the light of the rim.

mod buckets;
mod chain;
mod delaunay;
mod rim;
mod surface;
mod sweep;
mod triangle;
mod voronoi;

#[cfg(test)]
mod tests;

use glam::DVec3;

pub use delaunay::{Triangulation, Weights};
pub use voronoi::{VoronoiRegion, hemisphere_voronoi, hemisphere_voronoi_areas};

/// Sites must have z above this: a little below the horizon is a mounting tolerance, more is a mistake.
pub const LOWEST_SITE_Z: f64 = -0.2;

/// Two sites nearer to each other than this \[rad\] are one site given twice.
pub const SMALLEST_SEPARATION: f64 = 1e-6;

/// Why a list of sites cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SphericalError {
    /// There is nothing to divide the hemisphere among.
    #[error("no sites: expected at least one direction")]
    NoSites,
    /// The vector has no direction: its length is zero, infinite or not a number.
    #[error("site {index} is no direction: expected a unit vector, got ({}, {}, {})", .site.x, .site.y, .site.z)]
    NoDirection {
        /// Index of the site in the list.
        index: usize,
        /// The vector as given.
        site: DVec3,
    },
    /// The site lies too far below the horizon.
    #[error("site {index} is below the horizon: expected z > {LOWEST_SITE_Z}, got z = {z}")]
    BelowHorizon {
        /// Index of the site in the list.
        index: usize,
        /// Its z after normalisation.
        z: f64,
    },
    /// Two sites are the same place.
    #[error(
        "sites {first} and {second} coincide: expected at least {SMALLEST_SEPARATION} rad between sites, \
         got {separation:e} rad"
    )]
    Coincident {
        /// The lower index.
        first: usize,
        /// The higher index.
        second: usize,
        /// Angle between the two \[rad\].
        separation: f64,
    },
}

/// The sites with length one, or the reason why they cannot be used.
fn checked(sites: &[DVec3]) -> Result<Vec<DVec3>, SphericalError> {
    if sites.is_empty() {
        return Err(SphericalError::NoSites);
    }
    let mut unit: Vec<DVec3> = Vec::with_capacity(sites.len());
    for (index, &site) in sites.iter().enumerate() {
        let direction = site.try_normalize().ok_or(SphericalError::NoDirection { index, site })?;
        if direction.z <= LOWEST_SITE_Z {
            return Err(SphericalError::BelowHorizon { index, z: direction.z });
        }
        let near = |other: &DVec3| other.distance_squared(direction) < SMALLEST_SEPARATION * SMALLEST_SEPARATION;
        if let Some(first) = unit.iter().position(near) {
            let separation = unit[first].distance(direction);
            return Err(SphericalError::Coincident { first, second: index, separation });
        }
        unit.push(direction);
    }
    Ok(unit)
}
