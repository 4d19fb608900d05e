//! The outermost sites, and how a direction beyond them finds its way back.

use glam::DVec3;

/// Where a direction nearly 90° or more from all sites starts to slide back to the centre: cosine of the angle to the
/// nearest point. There the nearest point is undecided, and without the slide it would jump.
const FAR: f64 = 0.2;

/// A closed ring of sites around a centre, in order of azimuth about it; the ring is seen whole from the centre.
#[derive(Debug, Clone)]
pub(super) struct Rim {
    centre: DVec3,
    /// With `centre` a right-handed frame; azimuth is measured from the first.
    across: (DVec3, DVec3),
    members: Vec<Member>,
}

#[derive(Debug, Clone, Copy)]
struct Member {
    azimuth: f64,
    site: usize,
    direction: DVec3,
}

impl Rim {
    /// Sorts the sites into a ring.
    pub(super) fn new(centre: DVec3, sites: &[DVec3], ring: impl IntoIterator<Item = usize>) -> Self {
        let mut rim = Self { centre, across: centre.any_orthonormal_pair(), members: Vec::new() };
        let member = |site: usize| Member { azimuth: rim.azimuth(sites[site]), site, direction: sites[site] };
        let mut members: Vec<Member> = ring.into_iter().map(member).collect();
        members.sort_by(|a, b| a.azimuth.total_cmp(&b.azimuth).then(a.site.cmp(&b.site)));
        rim.members = members;
        rim
    }

    fn azimuth(&self, direction: DVec3) -> f64 {
        direction.dot(self.across.1).atan2(direction.dot(self.across.0))
    }

    fn following(&self, k: usize) -> usize {
        if k + 1 == self.members.len() { 0 } else { k + 1 }
    }

    fn preceding(&self, k: usize) -> usize {
        if k == 0 { self.members.len() - 1 } else { k - 1 }
    }

    /// The edge that the arc from the centre through the direction crosses: k for the edge from member k to the next.
    fn edge_towards(&self, direction: DVec3) -> usize {
        let azimuth = self.azimuth(direction);
        self.preceding(self.members.partition_point(|member| member.azimuth <= azimuth))
    }

    /// The two ends of the edge between the centre and the direction, and weights, not normalised: their weighted sum
    /// points to where the arc from the centre through the direction crosses the edge.
    pub(super) fn crossing(&self, direction: DVec3) -> [(usize, f64); 2] {
        let k = self.edge_towards(direction);
        let (a, b) = (self.members[k], self.members[self.following(k)]);
        // w·a + (1 − w)·b is to lie in the plane of centre and direction.
        let plane = self.centre.cross(direction);
        let weights = [plane.dot(b.direction).max(0.0), (-plane.dot(a.direction)).max(0.0)];
        if weights[0] + weights[1] > 0.0 {
            [(a.site, weights[0]), (b.site, weights[1])]
        } else {
            [(a.site, 1.0), (b.site, 0.0)]
        }
    }
}

/// The convex cone that all sites span, when that is not the whole space.
#[derive(Debug, Clone)]
pub(super) struct Cone {
    rim: Rim,
    /// Edge k runs from the rim's member k to the next.
    edges: Vec<Edge>,
}

#[derive(Debug, Clone, Copy)]
struct Edge {
    /// Unit normal of the edge's plane, towards the other sites.
    inward: DVec3,
    /// Unit tangents of the edge at its two ends, both in its sense.
    leaving: DVec3,
    arriving: DVec3,
}

impl Cone {
    /// Drops from the rim what is not convex; none when the sites surround the origin.
    pub(super) fn around(rim: &Rim, sites: &[DVec3]) -> Option<Self> {
        let mut members = rim.members.clone();
        let (mut k, mut kept_in_a_row) = (0, 0);
        while members.len() > 3 && kept_in_a_row < members.len() {
            let n = members.len();
            k %= n;
            let [before, here, after] = [(k + n - 1) % n, k, (k + 1) % n].map(|k| members[k].direction);
            let normal = before.cross(after);
            // Inside or on the arc between its neighbours, and that arc passes on the right side of the centre.
            if normal.dot(rim.centre) > 0.0 && normal.dot(here) >= -1e-15 {
                members.remove(k);
                (k, kept_in_a_row) = (k + members.len() - 1, 0);
            } else {
                (k, kept_in_a_row) = (k + 1, kept_in_a_row + 1);
            }
        }
        let rim = Rim { centre: rim.centre, across: rim.across, members };
        let edge = |k: usize| {
            let (a, b) = (rim.members[k].direction, rim.members[rim.following(k)].direction);
            let inward = a.cross(b).try_normalize()?;
            let encloses = rim.centre.dot(inward) > 0.0 && sites.iter().all(|p| p.dot(inward) >= -1e-12);
            encloses.then(|| Edge { inward, leaving: inward.cross(a), arriving: inward.cross(b) })
        };
        let edges = (0..rim.members.len()).map(edge).collect::<Option<Vec<Edge>>>()?;
        Some(Self { rim, edges })
    }

    /// The direction itself inside the cone, else the nearest one in it. Continuous on the whole sphere: far from the
    /// cone, where two sides may be equally near, the direction slides along the cone's surface to its centre.
    pub(super) fn nearest(&self, direction: DVec3) -> DVec3 {
        let k = self.rim.edge_towards(direction);
        if direction.dot(self.edges[k].inward) >= 0.0 {
            return direction;
        }
        // A foot is the nearest point of the cone in space, its length the cosine of the angle to the direction.
        let foot = self.foot_near(direction, k).unwrap_or_else(|| self.foot_of_all(direction));
        (foot + self.rim.centre * (FAR - foot.length()).max(0.0)).normalize_or(self.rim.centre)
    }

    /// Walks along the rim from an edge that faces the direction until the foot no longer moves on. What it finds is
    /// the nearest of all, for what remains then points away from the whole cone; in wide cones it may find none.
    fn foot_near(&self, direction: DVec3, facing: usize) -> Option<DVec3> {
        let mut k = facing;
        for _ in 0..self.edges.len() {
            let edge = self.edges[k];
            let (neighbour, corner, corner_is_nearest) = if direction.dot(edge.leaving) < 0.0 {
                let neighbour = self.rim.preceding(k);
                (neighbour, k, direction.dot(self.edges[neighbour].arriving) >= 0.0)
            } else if direction.dot(edge.arriving) > 0.0 {
                let neighbour = self.rim.following(k);
                (neighbour, neighbour, direction.dot(self.edges[neighbour].leaving) <= 0.0)
            } else {
                let depth = direction.dot(edge.inward);
                return (depth <= 0.0).then(|| direction - edge.inward * depth);
            };
            if corner_is_nearest {
                return Some(self.foot_at_corner(direction, corner)).filter(|&foot| foot != DVec3::ZERO);
            }
            k = neighbour;
        }
        None
    }

    fn foot_at_corner(&self, direction: DVec3, k: usize) -> DVec3 {
        let corner = self.rim.members[k].direction;
        corner * corner.dot(direction).max(0.0)
    }

    /// The same by asking every edge and corner: of all feet on the rim the nearest is the longest.
    fn foot_of_all(&self, direction: DVec3) -> DVec3 {
        let feet = self.edges.iter().enumerate().map(|(k, edge)| {
            if direction.dot(edge.leaving) > 0.0 && direction.dot(edge.arriving) < 0.0 {
                direction - edge.inward * direction.dot(edge.inward)
            } else {
                self.foot_at_corner(direction, k)
            }
        });
        feet.fold(DVec3::ZERO, |best, foot| if foot.length_squared() > best.length_squared() { foot } else { best })
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{ring, spiral};
    use super::{Cone, Rim};
    use glam::DVec3;
    use proptest::prelude::*;

    fn cone(sites: &[DVec3]) -> Option<Cone> {
        let centre = sites.iter().sum::<DVec3>().normalize();
        Cone::around(&Rim::new(centre, sites, 0..sites.len()), sites)
    }

    #[test]
    fn a_horizon_ring_is_drawn_to_along_the_edge() {
        let sites = ring(12, 0.3);
        let cone = cone(&sites).unwrap();
        assert_eq!(cone.edges.len(), 12);
        // Below the middle of an edge the nearest point is that middle; below a site it is the site.
        let middle = (sites[0] + sites[1]).normalize();
        let below = DVec3::new(middle.x, middle.y, 0.0).normalize();
        assert!(cone.nearest(below).distance(middle) < 1e-15);
        assert!(cone.nearest(DVec3::new(sites[3].x, sites[3].y, 0.1)).distance(sites[3]) < 1e-15);
    }

    #[test]
    fn dents_are_left_out_and_surrounding_sites_have_no_cone() {
        let mut sites = ring(6, 0.3);
        sites.extend(ring(6, 0.8).iter().map(|p| DVec3::from_array([p.y, p.x, p.z])));
        assert_eq!(cone(&sites).unwrap().edges.len(), 6);
        let mut surrounding = ring(5, -0.15);
        surrounding.push(DVec3::Z);
        assert!(Cone::around(&Rim::new(DVec3::Z, &surrounding, 0..5), &surrounding).is_none());
    }

    proptest! {
        #![proptest_config(super::super::tests::seeded(100))]

        #[test]
        fn the_walk_finds_the_nearest_of_all(sites in super::super::tests::sites(5..40), shift in 0.2_f64..3.0) {
            // Pushed to one side, so that there is much outside.
            let sites: Vec<DVec3> = sites.iter().map(|&p| (p + DVec3::new(shift, 0.0, 0.3)).normalize()).collect();
            let Some(cone) = cone(&sites) else { return Ok(()) };
            for direction in spiral(500, -0.2) {
                let k = cone.rim.edge_towards(direction);
                if direction.dot(cone.edges[k].inward) >= 0.0 {
                    continue;
                }
                let (walk, all) = (cone.foot_near(direction, k), cone.foot_of_all(direction));
                prop_assert!(walk.is_none_or(|walk| walk.distance(all) < 1e-9), "{walk:?} {all}");
                // The reason why it is nearest: the rest points away from every site.
                prop_assert!(sites.iter().all(|p| p.dot(direction - all) < 1e-9));
            }
        }
    }
}
