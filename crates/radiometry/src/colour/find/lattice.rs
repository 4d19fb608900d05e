//! Lattices that regions stand on: from two neighbours of a region, step by step, then as one projective map.

use std::collections::{BTreeMap, VecDeque};

use super::regions::{Reduced, Region};
use crate::colour::Homography;

/// From a node to the next a region may be off by this share of the step while a lattice grows.
const STEP_TOLERANCE: f64 = 0.22;
/// In the end, off by this share of the distance of nodes.
const TOLERANCE: f64 = 0.12;
/// A lattice has at least so many nodes.
const FEWEST_NODES: usize = 8;
/// Neighbours of a region that are tried as the next in its row or column.
const NEIGHBOURS: usize = 8;

/// Regions on a lattice of columns and rows, columns to the right of rows as the picture shows it (not mirrored).
pub(super) struct Lattice {
    /// Column and row → centre of the region, pixels of the reduced picture.
    pub(super) nodes: BTreeMap<[i32; 2], [f64; 2]>,
    map: Homography,
}

/// A node while a lattice grows: its region and the steps to its right and lower neighbours.
#[derive(Clone, Copy)]
struct Node {
    region: usize,
    steps: [[f64; 2]; 2],
}

/// The lattices with at least a third of `patches` nodes, the largest first.
pub(super) fn lattices(regions: &[Region], patches: usize) -> Vec<Lattice> {
    let fewest = FEWEST_NODES.max(patches / 3);
    let mut lattices: Vec<Lattice> = Vec::new();
    let mut covered = vec![false; regions.len()];
    for seed in 0..regions.len() {
        if covered[seed] {
            continue;
        }
        let best = steps(regions, seed)
            .into_iter()
            .map(|steps| grow(regions, seed, steps))
            .max_by_key(BTreeMap::len)
            .filter(|nodes| nodes.len() >= FEWEST_NODES);
        let Some((lattice, used)) = best.and_then(|nodes| straighten(regions, &nodes)) else { continue };
        used.iter().for_each(|region| covered[*region] = true);
        if lattice.nodes.len() >= fewest {
            lattices.push(lattice);
        }
    }
    lattices.sort_by_key(|lattice| std::cmp::Reverse(lattice.nodes.len()));
    lattices
}

/// Pairs of steps from a region to near ones of about its size that may be the next in its row and in its column.
fn steps(regions: &[Region], seed: usize) -> Vec<[[f64; 2]; 2]> {
    let of = &regions[seed];
    let side = of.area.sqrt();
    let mut near: Vec<(f64, [f64; 2])> = regions
        .iter()
        .filter(|other| (0.45..2.2).contains(&(other.area / of.area)))
        .map(|other| [other.centre[0] - of.centre[0], other.centre[1] - of.centre[1]])
        .map(|step| (step[0].hypot(step[1]), step))
        .filter(|(length, _)| (0.9 * side..2.6 * side).contains(length))
        .collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    near.truncate(NEIGHBOURS);
    let mut pairs = Vec::new();
    for (a_length, a) in &near {
        for (b_length, b) in &near {
            let (cross, dot) = (a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1]);
            let upright = a_length * b_length;
            // Rows run more to the right than down: each lattice once, the other turns are tried with the colours.
            if cross > 0.75 * upright
                && dot.abs() < 0.65 * upright
                && a[0] >= a[1].abs()
                && *a_length < 1.8 * b_length
                && *b_length < 1.8 * a_length
            {
                pairs.push([*a, *b]);
            }
        }
    }
    pairs
}

/// Follows the steps from region to region as far as they lead.
fn grow(regions: &[Region], seed: usize, steps: [[f64; 2]; 2]) -> BTreeMap<[i32; 2], usize> {
    let mut nodes = BTreeMap::from([([0, 0], Node { region: seed, steps })]);
    let mut used = vec![false; regions.len()];
    used[seed] = true;
    let mut waiting = VecDeque::from([[0, 0]]);
    while let Some(place) = waiting.pop_front() {
        let Node { region, steps } = nodes[&place];
        for (axis, sign) in [(0, 1), (1, 1), (0, -1), (1, -1)] {
            let mut next = place;
            next[axis] += sign;
            if nodes.contains_key(&next) {
                continue;
            }
            let step = steps[axis].map(|value| value * f64::from(sign));
            let centre = regions[region].centre;
            let target = [centre[0] + step[0], centre[1] + step[1]];
            let reach = STEP_TOLERANCE * step[0].hypot(step[1]);
            let areas = 0.4 * regions[region].area..2.5 * regions[region].area;
            let Some(found) =
                nearest(regions, target, reach, |index| !used[index] && areas.contains(&regions[index].area))
            else {
                continue;
            };
            let made = regions[found].centre;
            let mut steps = steps;
            steps[axis] = [0, 1].map(|k| f64::from(sign) * (made[k] - centre[k]));
            used[found] = true;
            nodes.insert(next, Node { region: found, steps });
            waiting.push_back(next);
        }
    }
    nodes.into_iter().map(|(place, node)| (place, node.region)).collect()
}

/// Fits a projective map, drops what does not stand on it and takes in what does; with the regions used.
fn straighten(regions: &[Region], grown: &BTreeMap<[i32; 2], usize>) -> Option<(Lattice, Vec<usize>)> {
    let mut nodes = grown.clone();
    let mut map = fit(regions, &nodes)?;
    for _ in 0..4 {
        let (low, high) = bounds(nodes.keys())?;
        let mut next = BTreeMap::new();
        let mut used = vec![false; regions.len()];
        for row in low[1] - 3..=high[1] + 3 {
            for column in low[0] - 3..=high[0] + 3 {
                let here = map.apply([f64::from(column), f64::from(row)]);
                let beside = map.apply([f64::from(column + 1), f64::from(row)]);
                let below = map.apply([f64::from(column), f64::from(row + 1)]);
                let step = |to: [f64; 2]| (to[0] - here[0]).hypot(to[1] - here[1]);
                let (reach, cell) = (TOLERANCE * step(beside).min(step(below)), step(beside) * step(below));
                // A patch fills a good part of its cell.
                let fits = |index: usize| !used[index] && (0.15 * cell..1.1 * cell).contains(&regions[index].area);
                if let Some(found) = nearest(regions, here, reach, fits) {
                    used[found] = true;
                    next.insert([column, row], found);
                }
            }
        }
        let settled = next == nodes;
        nodes = next;
        map = fit(regions, &nodes)?;
        if settled {
            break;
        }
    }
    let used = nodes.values().copied().collect();
    let nodes = nodes.into_iter().map(|(place, region)| (place, regions[region].centre)).collect();
    Some((Lattice { nodes, map }, used))
}

fn fit(regions: &[Region], nodes: &BTreeMap<[i32; 2], usize>) -> Option<Homography> {
    if nodes.len() < FEWEST_NODES {
        return None;
    }
    let pairs: Vec<_> = nodes.iter().map(|(place, region)| (place.map(f64::from), regions[*region].centre)).collect();
    Homography::fit(&pairs)
}

fn nearest(regions: &[Region], [x, y]: [f64; 2], reach: f64, allowed: impl Fn(usize) -> bool) -> Option<usize> {
    let distance = |region: &Region| (region.centre[0] - x).hypot(region.centre[1] - y);
    let near = regions.iter().enumerate().map(|(index, region)| (index, distance(region)));
    let near = near.filter(|(index, distance)| *distance < reach && allowed(*index));
    near.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(index, _)| index)
}

fn bounds<'a>(places: impl Iterator<Item = &'a [i32; 2]>) -> Option<([i32; 2], [i32; 2])> {
    places.fold(None, |bounds, [x, y]| match bounds {
        None => Some(([*x, *y], [*x, *y])),
        Some(([a, b], [c, d])) => Some(([a.min(*x), b.min(*y)], [c.max(*x), d.max(*y)])),
    })
}

impl Lattice {
    /// The first and the last column and row with a node.
    pub(super) fn bounds(&self) -> ([i32; 2], [i32; 2]) {
        bounds(self.nodes.keys()).unwrap_or_default()
    }

    /// What the picture shows round the nodes from `low` to `high`, also where nothing stands out: the median of 7 × 7 points in
    /// the middle of the cell, if these lie in the picture.
    pub(super) fn colours(&self, picture: &Reduced, low: [i32; 2], high: [i32; 2]) -> BTreeMap<[i32; 2], [f64; 3]> {
        let mut colours = BTreeMap::new();
        for row in low[1]..=high[1] {
            for column in low[0]..=high[0] {
                let mut samples: [Vec<f32>; 3] = Default::default();
                for point in 0..49 {
                    let (dx, dy) = (f64::from(point % 7 - 3) / 12.0, f64::from(point / 7 - 3) / 12.0);
                    let [x, y] = self.map.apply([f64::from(column) + dx, f64::from(row) + dy]);
                    if (0.0..picture.width as f64).contains(&x) && (0.0..picture.height as f64).contains(&y) {
                        let pixel = picture.pixels[y as usize * picture.width + x as usize];
                        (0..3).for_each(|channel| samples[channel].push(pixel[channel]));
                    }
                }
                if samples[0].len() == 49 {
                    colours.insert(
                        [column, row],
                        samples.map(|mut values| {
                            values.sort_unstable_by(f32::total_cmp);
                            f64::from(values[24])
                        }),
                    );
                }
            }
        }
        colours
    }
}
