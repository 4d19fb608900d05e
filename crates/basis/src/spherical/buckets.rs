//! A square grid over the whole sphere that lists, for each cell, the few things which can matter to a direction in it.

use glam::DVec3;

/// How often one candidate may be listed, on average, before the cells are made no smaller.
const MOST_PER_CANDIDATE: usize = 256;

/// Cells of an octahedral map, each with a list of candidates in ascending order.
#[derive(Debug, Clone)]
pub(super) struct Buckets {
    /// Cells along one edge of the map, a power of two.
    side: usize,
    /// Where each cell's list starts in `items`, and one more for the end of the last.
    start: Vec<u32>,
    items: Vec<u32>,
}

/// A cap that holds one cell.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cap {
    pub(super) centre: DVec3,
    /// Angle \[rad\].
    pub(super) radius: f64,
}

impl Buckets {
    /// Sorts the candidates 0..count into cells. `keep` selects those of a list that can matter inside a cap; it is
    /// asked coarse cells first, and finer cells see only what their parent kept.
    pub(super) fn build(count: usize, keep: impl Fn(Cap, &[u32]) -> Vec<u32>) -> Self {
        let all: Vec<u32> = (0..count as u32).collect();
        let mut side = 4;
        let mut lists: Vec<Vec<u32>> = (0..side * side).map(|cell| keep(cap(cell, side), &all)).collect();
        // About sixteen cells per candidate in the half of the sphere where the candidates are; fewer when the lists
        // do not become shorter, as with a tight crowd of sites.
        let total = |lists: &[Vec<u32>]| lists.iter().map(Vec::len).sum::<usize>();
        while side * side < 32 * count && side < 512 && total(&lists) < MOST_PER_CANDIDATE * count {
            let finer = 2 * side;
            let parent = |cell: usize| (cell / finer / 2) * side + (cell % finer) / 2;
            lists = (0..finer * finer).map(|cell| keep(cap(cell, finer), &lists[parent(cell)])).collect();
            side = finer;
        }
        let mut start = vec![0];
        let mut items = Vec::new();
        for list in lists {
            items.extend(list);
            start.push(items.len() as u32);
        }
        Self { side, start, items }
    }

    /// The candidates for a unit direction.
    pub(super) fn at(&self, direction: DVec3) -> &[u32] {
        let (u, v) = square_from_direction(direction);
        let along = |t: f64| (((t + 1.0) * 0.5 * self.side as f64) as usize).min(self.side - 1);
        let cell = along(v) * self.side + along(u);
        &self.items[self.start[cell] as usize..self.start[cell + 1] as usize]
    }
}

/// The cap around a cell. A cell is one spherical quad or two spherical triangles with corners among the cell's own,
/// so the corner farthest from the middle bounds it.
fn cap(cell: usize, side: usize) -> Cap {
    let at = |i: f64, j: f64| direction_from_square(i * 2.0 / side as f64 - 1.0, j * 2.0 / side as f64 - 1.0);
    let (i, j) = ((cell % side) as f64, (cell / side) as f64);
    let centre = at(i + 0.5, j + 0.5);
    let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)];
    let radius = corners.map(|(di, dj)| centre.angle_between(at(i + di, j + dj))).into_iter().fold(0.0, f64::max);
    // A direction on the border of two cells may be rounded into either.
    Cap { centre, radius: radius + 1e-9 }
}

/// The octahedral map: the sphere pushed onto |x| + |y| + |z| = 1, its lower half folded out to the square's corners.
fn square_from_direction(direction: DVec3) -> (f64, f64) {
    let p = direction / (direction.x.abs() + direction.y.abs() + direction.z.abs());
    if p.z >= 0.0 { (p.x, p.y) } else { fold(p.x, p.y) }
}

fn direction_from_square(u: f64, v: f64) -> DVec3 {
    let z = 1.0 - u.abs() - v.abs();
    let (x, y) = if z >= 0.0 { (u, v) } else { fold(u, v) };
    DVec3::new(x, y, z).normalize()
}

fn fold(u: f64, v: f64) -> (f64, f64) {
    ((1.0 - v.abs()).copysign(u), (1.0 - u.abs()).copysign(v))
}

#[cfg(test)]
mod tests {
    use super::super::tests::spiral;
    use super::{Buckets, cap, direction_from_square, square_from_direction};
    use glam::DVec3;

    #[test]
    fn the_map_comes_home() {
        for direction in spiral(1000, -1.0) {
            let (u, v) = square_from_direction(direction);
            assert!(direction_from_square(u, v).distance(direction) < 1e-15);
        }
        for direction in [DVec3::NEG_Z, DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z] {
            let (u, v) = square_from_direction(direction);
            assert!(direction_from_square(u, v).distance(direction) < 1e-15);
        }
    }

    #[test]
    fn every_direction_lies_in_the_cap_of_its_cell() {
        // Each cell's only candidate is its own number, so a query returns the cell.
        let cells = Buckets::build(4096, |_, _| Vec::new()).side;
        let numbered = Buckets {
            side: cells,
            start: (0..=(cells * cells) as u32).collect(),
            items: (0..(cells * cells) as u32).collect(),
        };
        for direction in spiral(20_000, -1.0) {
            let cell = numbered.at(direction)[0] as usize;
            let cap = cap(cell, cells);
            assert!(direction.angle_between(cap.centre) <= cap.radius);
        }
    }
}
