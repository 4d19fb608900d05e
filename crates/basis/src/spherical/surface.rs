//! The spherical triangles between sites, and the way from any direction to one of them or to their rim.

use super::buckets::{Buckets, Cap};
use super::rim::{Cone, Rim};
use super::sweep::{Mesh, NONE, delaunay, next};
use glam::DVec3;

/// A triangle whose plane passes nearer to the origin than this, sin 5°, has a cap of more than 85° radius: it spans
/// the open side of the sites, or a sliver of their rim, and its corners are no neighbours of what lies inside it.
const LEAST_OFFSET: f64 = 0.087_155_742_747_658_17;

/// Share of a triangle by which rounding may put a direction outside all triangles.
const CRACK: f64 = 1e-10;

/// Triangles, their border, and the convex cone of all sites.
#[derive(Debug, Clone)]
pub(super) struct Surface {
    pub(super) triangles: Vec<[usize; 3]>,
    lookup: Buckets,
    rim: Rim,
    /// None when the sites surround the origin.
    cone: Option<Cone>,
}

impl Surface {
    /// Triangulates around `centre`, which must be a positive combination of the sites: then no triangle has the origin
    /// on its outer side, and the border is seen whole from the centre. None when all sites are on one great circle,
    /// or so nearly that every triangle is too flat.
    pub(super) fn new(sites: &[DVec3], centre: DVec3) -> Option<Self> {
        let mesh = delaunay(sites, centre);
        let offsets: Vec<f64> = mesh.corners.chunks(3).map(|t| plane(t, sites).1).collect();
        if offsets.iter().all(|&offset| offset <= LEAST_OFFSET) {
            return None;
        }
        let kept = peel(&mesh, &offsets, sites, centre);
        let on_border = |&e: &usize| kept[e / 3] && (mesh.twins[e] == NONE || !kept[mesh.twins[e] / 3]);
        let rim = Rim::new(centre, sites, (0..mesh.corners.len()).filter(on_border).map(|e| mesh.corners[e]));
        let cone = Cone::around(&rim, sites);
        let kept_corners = mesh.corners.chunks(3).zip(&kept).filter(|&(_, &kept)| kept);
        let triangles: Vec<[usize; 3]> = kept_corners.map(|(t, _)| [t[0], t[1], t[2]]).collect();
        let facets: Vec<Facet> = triangles.iter().map(|t| Facet::new(t, sites)).collect();
        let lookup = Buckets::build(triangles.len(), |cap, candidates| {
            candidates.iter().copied().filter(|&t| facets[t as usize].may_meet(cap)).collect()
        });
        Some(Self { triangles, lookup, rim, cone })
    }

    /// Up to three sites and their weights, not normalised.
    pub(super) fn weights(&self, direction: DVec3, sites: &[DVec3]) -> [(usize, f64); 3] {
        // First to the convex cone around the sites by the shortest way, then, through a dent of the rim, on towards
        // the centre. Both maps are continuous and leave alone what is inside.
        let direction = self.cone.as_ref().map_or(direction, |cone| cone.nearest(direction));
        self.inside(direction, sites).unwrap_or_else(|| {
            let [a, b] = self.rim.crossing(direction);
            [a, b, (a.0, 0.0)]
        })
    }

    /// The weights when some triangle holds the direction.
    pub(super) fn inside(&self, direction: DVec3, sites: &[DVec3]) -> Option<[(usize, f64); 3]> {
        let mut best = None;
        let mut least_outside = -CRACK;
        for &t in self.lookup.at(direction) {
            let triangle = self.triangles[t as usize];
            let [a, b, c] = triangle.map(|i| sites[i] - direction);
            // direction ∝ wa·a + wb·b + wc·c, by Cramer's rule; the differences keep the digits of tiny triangles.
            let weights = [(b, c), (c, a), (a, b)].map(|(from, to)| direction.dot(from.cross(to)));
            let sum: f64 = weights.iter().sum();
            if sum <= 0.0 {
                continue;
            }
            let least = weights.iter().fold(f64::INFINITY, |m, w| m.min(w / sum));
            if least >= least_outside {
                let [wa, wb, wc] = weights.map(|w| w.max(0.0));
                best = Some([(triangle[0], wa), (triangle[1], wb), (triangle[2], wc)]);
                least_outside = least;
                if least >= 0.0 {
                    break;
                }
            }
        }
        best
    }
}

/// Outward unit normal of a triangle's plane, and its distance from the origin.
fn plane(corners: &[usize], sites: &[DVec3]) -> (DVec3, f64) {
    let [a, b, c] = [sites[corners[0]], sites[corners[1]], sites[corners[2]]];
    let normal = (b - a).cross(c - a).normalize_or_zero();
    (normal, normal.dot(a))
}

/// Which triangles to keep. Takes away flat ones from the border inwards, as long as the border stays visible from the
/// centre and every site stays on a triangle.
fn peel(mesh: &Mesh, offsets: &[f64], sites: &[DVec3], centre: DVec3) -> Vec<bool> {
    let mut kept = vec![true; offsets.len()];
    let mut pending: Vec<usize> = (0..offsets.len()).rev().filter(|&t| offsets[t] <= LEAST_OFFSET).collect();
    while let Some(t) = pending.pop() {
        let open = |&e: &usize| mesh.twins[e] == NONE || !kept[mesh.twins[e] / 3];
        let border: Vec<usize> = (3 * t..3 * t + 3).filter(open).collect();
        let &[outer] = border.as_slice() else { continue };
        let inner = [next(outer), next(next(outer))];
        // Seen from across, the two edges that would become the border run the other way.
        let faces_centre = |e: &usize| {
            let (from, to) = (sites[mesh.corners[next(*e)]], sites[mesh.corners[*e]]);
            centre.dot(from.cross(to)) > 1e-6 * to.distance(from)
        };
        if kept[t] && inner.iter().all(faces_centre) {
            kept[t] = false;
            pending.extend(inner.map(|e| mesh.twins[e] / 3).into_iter().filter(|&t| offsets[t] <= LEAST_OFFSET));
        }
    }
    kept
}

/// What tells quickly that a triangle is away from a cap.
struct Facet {
    /// Unit normals of the edges, inward.
    inward: [DVec3; 3],
    /// The circle through the corners.
    circle: Cap,
}

impl Facet {
    fn new(corners: &[usize; 3], sites: &[DVec3]) -> Self {
        let [a, b, c] = corners.map(|i| sites[i]);
        let (centre, offset) = plane(corners, sites);
        let inward = [(a, b), (b, c), (c, a)].map(|(from, to)| from.cross(to).normalize_or_zero());
        Self { inward, circle: Cap { centre, radius: offset.clamp(-1.0, 1.0).acos() + 1e-9 } }
    }

    fn may_meet(&self, cap: Cap) -> bool {
        let slack = cap.radius.min(std::f64::consts::FRAC_PI_2).sin() + 1e-9;
        self.circle.centre.angle_between(cap.centre) <= self.circle.radius + cap.radius
            && self.inward.iter().all(|normal| normal.dot(cap.centre) >= -slack)
    }
}
