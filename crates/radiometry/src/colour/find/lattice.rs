//! Lattices that regions stand on: from two neighbours of a region, step by step to those beside it, then ring by ring as one
//! projective map.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use super::regions::{Reduced, Region};
use crate::Homography;

/// From a node to the next a region may be off by this share of the step while a lattice grows.
const STEP_TOLERANCE: f64 = 0.22;
/// In the end, off by this share of the distance of nodes.
const TOLERANCE: f64 = 0.12;
/// A lattice has at least so many nodes.
const FEWEST_NODES: usize = 8;
/// Nodes this far from the first, in rows and columns, are found step by step; those farther out by the map.
const NEAR: i32 = 2;
/// No chart has more rows or columns.
const MOST_RINGS: usize = 40;
/// Side of a bucket, pixels.
const BUCKET: f64 = 16.0;
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
    let index = Index::new(regions);
    let mut lattices: Vec<Lattice> = Vec::new();
    let mut covered = vec![false; regions.len()];
    for seed in 0..regions.len() {
        if covered[seed] {
            continue;
        }
        let mut best = BTreeMap::new();
        for steps in steps(&index, seed) {
            let grown = grow(&index, seed, steps);
            if grown.len() > best.len() {
                best = grown;
            }
        }
        let Some((lattice, used)) = straighten(&index, &best) else { continue };
        if lattice.nodes.len() >= fewest {
            used.iter().for_each(|region| covered[*region] = true);
            lattices.push(lattice);
        }
    }
    lattices.sort_by_key(|lattice| std::cmp::Reverse(lattice.nodes.len()));
    lattices
}

/// Pairs of steps from a region to near ones of about its size that may be the next in its row and in its column.
fn steps(index: &Index, seed: usize) -> Vec<[[f64; 2]; 2]> {
    let of = &index.regions[seed];
    let side = of.area.sqrt();
    let mut near: Vec<(f64, [f64; 2])> = index
        .within(of.centre, 2.6 * side)
        .map(|other| &index.regions[other])
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
                && a[0] > 0.5 * a_length
                && *a_length < 1.8 * b_length
                && *b_length < 1.8 * a_length
            {
                pairs.push([*a, *b]);
            }
        }
    }
    pairs
}

/// Follows the steps from region to region, at most [`NEAR`] nodes away from the first.
fn grow(index: &Index, seed: usize, steps: [[f64; 2]; 2]) -> BTreeMap<[i32; 2], usize> {
    let regions = index.regions;
    let mut nodes = BTreeMap::from([([0, 0], Node { region: seed, steps })]);
    let mut waiting = VecDeque::from([[0, 0]]);
    while let Some(place) = waiting.pop_front() {
        let Node { region, steps } = nodes[&place];
        for (axis, sign) in [(0, 1), (1, 1), (0, -1), (1, -1)] {
            let mut next: [i32; 2] = place;
            next[axis] += sign;
            if next[axis].abs() > NEAR || nodes.contains_key(&next) {
                continue;
            }
            let step = steps[axis].map(|value| value * f64::from(sign));
            let centre = regions[region].centre;
            let target = [centre[0] + step[0], centre[1] + step[1]];
            let reach = STEP_TOLERANCE * step[0].hypot(step[1]);
            let areas = 0.4 * regions[region].area..2.5 * regions[region].area;
            let fits =
                |found: usize| areas.contains(&regions[found].area) && nodes.values().all(|node| node.region != found);
            let Some(found) = index.nearest(target, reach, fits) else { continue };
            let made = regions[found].centre;
            let mut steps = steps;
            steps[axis] = [0, 1].map(|k| f64::from(sign) * (made[k] - centre[k]));
            nodes.insert(next, Node { region: found, steps });
            waiting.push_back(next);
        }
    }
    nodes.into_iter().map(|(place, node)| (place, node.region)).collect()
}

/// Fits a projective map to the nodes that have been found, and takes in those of the next ring that stand on it, until no more
/// do; with the regions used. What does not stand on it is dropped on the way.
fn straighten(index: &Index, grown: &BTreeMap<[i32; 2], usize>) -> Option<(Lattice, Vec<usize>)> {
    let mut nodes = grown.clone();
    let mut map = fit(index.regions, &nodes)?;
    for _ in 0..MOST_RINGS {
        let (low, high) = bounds(nodes.keys())?;
        let mut next = BTreeMap::new();
        let mut used = BTreeSet::new();
        for row in low[1] - 1..=high[1] + 1 {
            for column in low[0] - 1..=high[0] + 1 {
                let here = map.apply([f64::from(column), f64::from(row)]);
                let beside = map.apply([f64::from(column + 1), f64::from(row)]);
                let below = map.apply([f64::from(column), f64::from(row + 1)]);
                let step = |to: [f64; 2]| (to[0] - here[0]).hypot(to[1] - here[1]);
                let (reach, cell) = (TOLERANCE * step(beside).min(step(below)), step(beside) * step(below));
                // A patch fills a good part of its cell.
                let fits = |found: usize| {
                    !used.contains(&found) && (0.15 * cell..1.1 * cell).contains(&index.regions[found].area)
                };
                if let Some(found) = index.nearest(here, reach, fits) {
                    used.insert(found);
                    next.insert([column, row], found);
                }
            }
        }
        let settled = next == nodes;
        nodes = next;
        map = fit(index.regions, &nodes)?;
        if settled {
            break;
        }
    }
    let used = nodes.values().copied().collect();
    let nodes = nodes.into_iter().map(|(place, region)| (place, index.regions[region].centre)).collect();
    Some((Lattice { nodes, map }, used))
}

fn fit(regions: &[Region], nodes: &BTreeMap<[i32; 2], usize>) -> Option<Homography> {
    if nodes.len() < FEWEST_NODES {
        return None;
    }
    let pairs: Vec<_> = nodes.iter().map(|(place, region)| (place.map(f64::from), regions[*region].centre)).collect();
    Homography::fit(&pairs)
}

/// Regions by where they are, in buckets of [`BUCKET`] pixels.
struct Index<'a> {
    regions: &'a [Region],
    buckets: BTreeMap<[i32; 2], Vec<usize>>,
}

impl<'a> Index<'a> {
    fn new(regions: &'a [Region]) -> Self {
        let mut buckets: BTreeMap<[i32; 2], Vec<usize>> = BTreeMap::new();
        for (index, region) in regions.iter().enumerate() {
            buckets.entry(region.centre.map(bucket)).or_default().push(index);
        }
        Self { regions, buckets }
    }

    /// The regions whose centres are near a point: all within `reach`, and some beyond.
    fn within(&self, [x, y]: [f64; 2], reach: f64) -> impl Iterator<Item = usize> {
        let columns = bucket(x - reach)..=bucket(x + reach);
        let (top, bottom) = (bucket(y - reach), bucket(y + reach));
        let places = columns.flat_map(move |column| (top..=bottom).map(move |row| [column, row]));
        places.filter_map(|place| self.buckets.get(&place)).flatten().copied()
    }

    fn nearest(&self, [x, y]: [f64; 2], reach: f64, allowed: impl Fn(usize) -> bool) -> Option<usize> {
        // Far outside of any picture there is nothing.
        if !(x.abs() < 1e6 && y.abs() < 1e6 && reach < 1e4) {
            return None;
        }
        let distance = |index: usize| (self.regions[index].centre[0] - x).hypot(self.regions[index].centre[1] - y);
        let near = self.within([x, y], reach).map(|index| (distance(index), index));
        let near = near.filter(|(distance, index)| *distance < reach && allowed(*index));
        near.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))).map(|(_, index)| index)
    }
}

fn bucket(value: f64) -> i32 {
    (value / BUCKET).floor() as i32
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
