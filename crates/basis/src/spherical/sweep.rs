//! Delaunay triangles of points in the plane: a left-to-right sweep with exact orientation, then edge flips.
//!
//! The plane is the stereographic view of the sites from the point opposite `centre`. That view turns circles into
//! circles, so the planar Delaunay triangulation is the part of the spherical one (the convex hull of the sites) whose
//! empty caps do not hold that point.
//!
//! Degenerate sets need no perturbation. The plane coordinates are rounded to integers and orientation is computed
//! exactly, so the triangles never overlap, whatever lies on one line. An edge is flipped only when its quad is convex
//! and the flip lets the hull gain volume beyond rounding error: the volume grows with each flip, so flipping ends, and
//! of four sites on one circle the diagonal that is there stays.

use glam::DVec3;

/// The twin of an edge at the border.
pub(super) const NONE: usize = usize::MAX;

/// Counter-clockwise triangles. Edge e runs from corner e to corner `next(e)` of triangle e / 3.
#[derive(Debug, Clone)]
pub(super) struct Mesh {
    /// The site at each corner, three corners per triangle.
    pub(super) corners: Vec<usize>,
    /// The same edge in the triangle across it, or [`NONE`].
    pub(super) twins: Vec<usize>,
}

/// The edge after e in its triangle.
pub(super) fn next(e: usize) -> usize {
    if e % 3 == 2 { e - 2 } else { e + 1 }
}

/// Triangulates unit vectors as seen from the point opposite `centre`; no triangles when they lie on one line there.
pub(super) fn delaunay(sites: &[DVec3], centre: DVec3) -> Mesh {
    let points = plane_points(sites, centre);
    let corners = sweep(&points);
    let twins = twins(&corners);
    let mut mesh = Mesh { corners, twins };
    mesh.flip_all(sites, &points);
    mesh
}

type Point = [i64; 2];

/// Stereographic coordinates in units of 2⁻⁵⁰ of the farthest one.
fn plane_points(sites: &[DVec3], centre: DVec3) -> Vec<Point> {
    let (x, y) = centre.any_orthonormal_pair();
    let flat: Vec<[f64; 2]> = sites
        .iter()
        // Sites hardly ever come near the point of view, where they would leave no digits to the others.
        .map(|p| (p, (1.0 + p.dot(centre)).max(1e-3)))
        .map(|(p, depth)| [p.dot(x) / depth, p.dot(y) / depth])
        .collect();
    let largest = flat.iter().flatten().fold(f64::MIN_POSITIVE, |m, t| m.max(t.abs()));
    let scale = (1_u64 << 50) as f64 / largest;
    flat.iter().map(|p| p.map(|t| (t * scale).round() as i64)).collect()
}

/// Twice the area of a, b, c, positive when counter-clockwise. Exact: 2 · (2⁵¹)² fits.
fn orientation(a: Point, b: Point, c: Point) -> i128 {
    let along = |from: Point, to: Point, axis: usize| i128::from(to[axis] - from[axis]);
    along(a, b, 0) * along(a, c, 1) - along(a, b, 1) * along(a, c, 0)
}

/// Adds the points from left to right, each joined to the edges of the hull that it sees.
fn sweep(points: &[Point]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by_key(|&i| (points[i], i));
    let turn = |a: usize, b: usize, c: usize| orientation(points[a], points[b], points[c]);

    // The first points may lie on one line; the first that does not spans a fan with them.
    let Some(apex_at) = (2..order.len()).find(|&k| turn(order[0], order[1], order[k]) != 0) else {
        return Vec::new();
    };
    let apex = order[apex_at];
    let mut line = order[..apex_at].to_vec();
    if turn(order[0], order[1], apex) < 0 {
        line.reverse();
    }
    let mut corners: Vec<usize> = line.windows(2).flat_map(|edge| [edge[0], edge[1], apex]).collect();

    // The hull, counter-clockwise, as a ring of links.
    let (mut after, mut before) = (vec![NONE; points.len()], vec![NONE; points.len()]);
    line.push(apex);
    for (k, &site) in line.iter().enumerate() {
        let follower = line[(k + 1) % line.len()];
        (after[site], before[follower]) = (follower, site);
    }

    let mut latest = apex;
    for &new in &order[apex_at + 1..] {
        // The latest point is the rightmost so far, so the edges which the new one sees lie around it.
        let mut upper = latest;
        while turn(upper, after[upper], new) < 0 {
            corners.extend([after[upper], upper, new]);
            upper = after[upper];
        }
        let mut lower = latest;
        while turn(before[lower], lower, new) < 0 {
            corners.extend([lower, before[lower], new]);
            lower = before[lower];
        }
        if lower == upper {
            // Sees nothing: the plane's rounding put it onto the latest point.
            continue;
        }
        (after[lower], before[new], after[new], before[upper]) = (new, lower, upper, new);
        latest = new;
    }
    corners
}

/// Finds each edge's twin by sorting the edges by their two sites.
fn twins(corners: &[usize]) -> Vec<usize> {
    let key = |e: usize| {
        let (a, b) = (corners[e], corners[next(e)]);
        (a.min(b), a.max(b))
    };
    let mut edges: Vec<usize> = (0..corners.len()).collect();
    edges.sort_by_key(|&e| (key(e), e));
    let mut twins = vec![NONE; corners.len()];
    for pair in edges.windows(2).filter(|pair| key(pair[0]) == key(pair[1])) {
        (twins[pair[0]], twins[pair[1]]) = (pair[1], pair[0]);
    }
    twins
}

impl Mesh {
    /// Flips edges until every cap is empty (Lawson 1977).
    fn flip_all(&mut self, sites: &[DVec3], points: &[Point]) {
        let mut pending: Vec<usize> = (0..self.corners.len()).rev().collect();
        while let Some(e) = pending.pop() {
            let twin = self.twins[e];
            if twin != NONE && self.should_flip(e, twin, sites, points) {
                self.flip(e, twin);
                pending.extend([e, next(e), twin, next(twin)]);
            }
        }
    }

    /// Whether the corner across the edge pokes into this triangle's cap and the other diagonal lies inside the quad.
    fn should_flip(&self, e: usize, twin: usize, sites: &[DVec3], points: &[Point]) -> bool {
        let [a, b, c] = [e, next(e), next(next(e))].map(|e| self.corners[e]);
        let d = self.corners[next(next(twin))];
        let [ab, ac, ad] = [b, c, d].map(|i| sites[i] - sites[a]);
        // Six times the volume that the flip gains, and a bound of what rounding can pretend.
        let gain = ab.cross(ac).dot(ad);
        let noise = 1e-14 * ab.length() * ac.length() * ad.length();
        let turn = |a: usize, b: usize, c: usize| orientation(points[a], points[b], points[c]);
        gain > noise && turn(a, d, c) > 0 && turn(d, b, c) > 0
    }

    /// Replaces the diagonal. Afterwards `e`, `next(e)`, `twin` and `next(twin)` are the quad's outer edges.
    fn flip(&mut self, e: usize, twin: usize) {
        // Before: e = a→b with c across, twin = b→a with d across. After: d→b, b→c, c→d and c→a, a→d, d→c.
        let (ca, db) = (next(next(e)), next(next(twin)));
        let (c, d) = (self.corners[ca], self.corners[db]);
        self.corners[e] = d;
        self.corners[twin] = c;
        let (beyond_db, beyond_ca) = (self.twins[db], self.twins[ca]);
        self.link(e, beyond_db);
        self.link(twin, beyond_ca);
        self.link(ca, db);
    }

    fn link(&mut self, e: usize, twin: usize) {
        self.twins[e] = twin;
        if twin != NONE {
            self.twins[twin] = e;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{ring, spiral};
    use super::{Mesh, NONE, delaunay, next, plane_points, sweep};
    use glam::DVec3;
    use proptest::prelude::*;

    /// Every edge's twin runs the other way, and Euler's count holds: 2n − 2 − (border edges) triangles.
    fn check(mesh: &Mesh, sites: usize) {
        for (e, &twin) in mesh.twins.iter().enumerate().filter(|&(_, &twin)| twin != NONE) {
            assert_eq!(mesh.twins[twin], e);
            assert_eq!((mesh.corners[e], mesh.corners[next(e)]), (mesh.corners[next(twin)], mesh.corners[twin]));
        }
        let border = mesh.twins.iter().filter(|&&twin| twin == NONE).count();
        assert_eq!(mesh.corners.len() / 3, 2 * sites - 2 - border);
    }

    /// No site lies above the plane of any triangle by more than `slack`.
    fn check_empty_caps(mesh: &Mesh, sites: &[DVec3], slack: f64) {
        for corners in mesh.corners.chunks(3) {
            let [a, b, c] = [corners[0], corners[1], corners[2]].map(|i| sites[i]);
            let normal = (b - a).cross(c - a).normalize();
            for &p in sites {
                assert!((p - a).dot(normal) <= slack, "{}", (p - a).dot(normal));
            }
        }
    }

    #[test]
    fn rings_of_cocircular_sites_are_triangulated() {
        let mut sites = vec![DVec3::Z];
        for elevation in [0.0_f64, 0.4, 0.8, 1.2] {
            sites.extend(ring(24, elevation));
        }
        let mesh = delaunay(&sites, DVec3::Z);
        check(&mesh, sites.len());
        check_empty_caps(&mesh, &sites, 1e-12);
    }

    #[test]
    fn a_spiral_of_two_thousand_is_triangulated() {
        let sites = spiral(2000, 0.0);
        let mesh = delaunay(&sites, DVec3::Z);
        check(&mesh, sites.len());
        check_empty_caps(&mesh, &sites, 1e-12);
    }

    #[test]
    fn a_line_has_no_triangles() {
        let sites: Vec<DVec3> = (-3..4).map(|k| DVec3::new(f64::from(k) * 0.3, 0.0, 1.0).normalize()).collect();
        assert!(sweep(&plane_points(&sites, DVec3::Z)).is_empty());
        assert!(delaunay(&sites[..2], DVec3::Z).corners.is_empty());
    }

    proptest! {
        #![proptest_config(super::super::tests::seeded(100))]

        #[test]
        fn random_sites_get_empty_caps(sites in super::super::tests::sites(3..60)) {
            let mesh = delaunay(&sites, DVec3::Z);
            check(&mesh, sites.len());
            check_empty_caps(&mesh, &sites, 1e-9);
        }

        #[test]
        fn sites_on_a_coarse_lattice_get_empty_caps(
            cells in proptest::collection::btree_set((-4_i8..=4, -4_i8..=4), 3..50)
        ) {
            let sites: Vec<DVec3> =
                cells.iter().map(|&(x, y)| DVec3::new(f64::from(x), f64::from(y), 4.0).normalize()).collect();
            let mesh = delaunay(&sites, DVec3::Z);
            if !mesh.corners.is_empty() {
                check(&mesh, sites.len());
                check_empty_caps(&mesh, &sites, 1e-12);
            }
        }
    }
}
