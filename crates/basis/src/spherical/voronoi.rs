//! Voronoi regions of the upper hemisphere, exact: each region is a few convex polygons of great-circle arcs.

use super::triangle::{sample, solid_angle};
use super::{SphericalError, checked};
use glam::DVec3;

/// How many of the nearest sites cut first, nearest first; after them a region is small and few others reach it.
const NEAREST_FIRST: usize = 24;

/// All directions with z ≥ 0 that are nearer to one site than to any other.
#[derive(Debug, Clone, PartialEq)]
pub struct VoronoiRegion {
    site: DVec3,
    polygons: Vec<Vec<DVec3>>,
    area: f64,
    /// The polygons as triangle fans, each with the area up to and including it \[sr\].
    fan: Vec<([DVec3; 3], f64)>,
}

impl VoronoiRegion {
    fn new(site: DVec3, polygons: Vec<Vec<DVec3>>) -> Self {
        let mut fan = Vec::new();
        let mut area = 0.0;
        for polygon in &polygons {
            for edge in polygon[1..].windows(2) {
                let corners = [polygon[0], edge[0], edge[1]];
                let part = solid_angle(corners[0], corners[1], corners[2]);
                if part > 0.0 {
                    area += part;
                    fan.push((corners, area));
                }
            }
        }
        Self { site, polygons, area, fan }
    }

    /// Convex polygons, counter-clockwise seen from outside, that together are the region: at most one per octant.
    /// None when a site below the horizon owns no direction above it.
    pub fn polygons(&self) -> &[Vec<DVec3>] {
        &self.polygons
    }

    /// Solid angle \[sr\].
    pub fn area(&self) -> f64 {
        self.area
    }

    /// The direction in the region that (u, v) in \[0, 1)² stands for, uniform by solid angle; stratified (u, v) give
    /// stratified directions. An empty region gives its site.
    pub fn sample(&self, u: f64, v: f64) -> DVec3 {
        let target = u * self.area;
        let chosen = self.fan.partition_point(|&(_, up_to)| up_to <= target).min(self.fan.len().saturating_sub(1));
        let Some(&([a, b, c], up_to)) = self.fan.get(chosen) else { return self.site };
        // What is left of u inside the chosen triangle is uniform again.
        let from = if chosen == 0 { 0.0 } else { self.fan[chosen - 1].1 };
        sample(a, b, c, ((target - from) / (up_to - from)).clamp(0.0, 1.0), v.clamp(0.0, 1.0))
    }
}

/// The Voronoi region of each site on the upper hemisphere, in the order of the sites.
///
/// # Errors
/// When the list is empty or a site cannot be used, see [`SphericalError`].
pub fn hemisphere_voronoi(sites: &[DVec3]) -> Result<Vec<VoronoiRegion>, SphericalError> {
    let sites = checked(sites)?;
    Ok((0..sites.len()).map(|index| VoronoiRegion::new(sites[index], region_polygons(&sites, index))).collect())
}

/// Solid angle \[sr\] of the Voronoi region of each site on the upper hemisphere. Together they are 2π.
///
/// # Errors
/// When the list is empty or a site cannot be used, see [`SphericalError`].
pub fn hemisphere_voronoi_areas(sites: &[DVec3]) -> Result<Vec<f64>, SphericalError> {
    Ok(hemisphere_voronoi(sites)?.iter().map(VoronoiRegion::area).collect())
}

/// The four octants of the upper hemisphere, cut by the bisector between the site and every other one.
fn region_polygons(sites: &[DVec3], index: usize) -> Vec<Vec<DVec3>> {
    let site = sites[index];
    let rim = [DVec3::X, DVec3::Y, DVec3::NEG_X, DVec3::NEG_Y];
    let mut polygons: Vec<Vec<DVec3>> = (0..4).map(|k| vec![rim[k], rim[(k + 1) % 4], DVec3::Z]).collect();
    let mut spare = Vec::new();
    let mut reach = Reach::of(site, &polygons);
    for other in nearest_first(sites, index) {
        if polygons.is_empty() {
            break;
        }
        if reach.excludes(site, sites[other]) {
            continue;
        }
        let inward = site - sites[other];
        for polygon in &mut polygons {
            clip(polygon, inward, &mut spare);
        }
        polygons.retain(|polygon| polygon.len() >= 3);
        reach = Reach::of(site, &polygons);
    }
    polygons
}

/// All other sites, those that probably cut the region in front.
fn nearest_first(sites: &[DVec3], index: usize) -> Vec<usize> {
    let mut others: Vec<usize> = (0..sites.len()).filter(|&other| other != index).collect();
    let closeness = |other: &usize| sites[*other].dot(sites[index]);
    let nearer = |a: &usize, b: &usize| closeness(b).total_cmp(&closeness(a)).then(a.cmp(b));
    if others.len() > NEAREST_FIRST {
        others.select_nth_unstable_by(NEAREST_FIRST, nearer);
        others[..NEAREST_FIRST].sort_unstable_by(nearer);
    } else {
        others.sort_unstable_by(nearer);
    }
    others
}

/// How far a region can reach from its site: a bisector cuts only if the other site is nearer than twice that.
struct Reach {
    /// Cosine of twice the angle to the farthest corner; −2 where that angle may not be the farthest point's.
    cos_twice: f64,
}

impl Reach {
    fn of(site: DVec3, polygons: &[Vec<DVec3>]) -> Self {
        let cos = polygons.iter().flatten().map(|corner| corner.dot(site)).fold(1.0, f64::min);
        // Within 90° of the site the farthest point of an arc is one of its ends.
        Self { cos_twice: if cos > 0.0 { 2.0 * cos * cos - 1.0 } else { -2.0 } }
    }

    fn excludes(&self, site: DVec3, other: DVec3) -> bool {
        site.dot(other) < self.cos_twice - 1e-12
    }
}

/// Sutherland–Hodgman on great-circle arcs: keeps the part of the polygon with x·inward ≥ 0.
fn clip(polygon: &mut Vec<DVec3>, inward: DVec3, spare: &mut Vec<DVec3>) {
    if polygon.iter().all(|corner| corner.dot(inward) >= 0.0) {
        return;
    }
    spare.clear();
    let mut from = polygon[polygon.len() - 1];
    let mut from_side = from.dot(inward);
    for &to in polygon.iter() {
        let to_side = to.dot(inward);
        if (from_side >= 0.0) != (to_side >= 0.0) {
            // The great circle through both corners meets the bisector where the chord does.
            let crossing = from + (to - from) * (from_side / (from_side - to_side));
            push_new(spare, crossing.normalize_or(from));
        }
        if to_side >= 0.0 {
            push_new(spare, to);
        }
        (from, from_side) = (to, to_side);
    }
    if spare.len() > 1 && spare[0].distance_squared(spare[spare.len() - 1]) < 1e-30 {
        spare.pop();
    }
    std::mem::swap(polygon, spare);
}

/// Appends a corner unless it is the last one again.
fn push_new(polygon: &mut Vec<DVec3>, corner: DVec3) {
    if polygon.last().is_none_or(|last| last.distance_squared(corner) >= 1e-30) {
        polygon.push(corner);
    }
}
