//! Shadow rays in packets: many that start at one point and end where they are asked.
//!
//! A common origin makes the work of a node or triangle common too: the edges' planes through the origin are computed once a
//! packet, and each ray costs a few dot products, side by side in vector lanes. Two triangles that share an edge share its
//! plane to the bit, so no ray passes between them. [`Scene::is_free`](crate::Scene) is the plain version.

use glam::Vec3;
use obvhs::bvh2::Bvh2;

use crate::shape::{PreparedRay, Shape};

/// Rays in a packet.
pub(crate) const RAYS: usize = 16;

/// One number a ray.
type Lanes = [f32; RAYS];

/// Rays from one origin; each reaches from there to origin + direction, which is its whole length.
#[derive(Clone, Debug)]
pub(crate) struct Packet {
    direction: [Lanes; 3],
    inverse: [Lanes; 3],
    /// 1 for a ray that nothing has stopped yet, −1 for others.
    reach: Lanes,
    open: usize,
}

/// The parts of a scene that packets ask.
pub(crate) struct Shadows<'a> {
    pub(crate) bvh: &'a Bvh2,
    /// In the order of the hierarchy's leaves.
    pub(crate) shapes: &'a [Shape],
}

impl Packet {
    /// Rays from `origin` to the given points, at most [`RAYS`].
    pub(crate) fn towards(origin: Vec3, ends: impl Iterator<Item = Vec3>) -> Self {
        let mut packet = Self { direction: [[0.0; RAYS]; 3], inverse: [[0.0; RAYS]; 3], reach: [-1.0; RAYS], open: 0 };
        for (lane, end) in ends.take(RAYS).enumerate() {
            for (axis, component) in (end - origin).to_array().into_iter().enumerate() {
                packet.direction[axis][lane] = component;
                // Never infinite: 0 · ∞ would be no number.
                packet.inverse[axis][lane] =
                    if component.abs() < 1e-20 { 1e20f32.copysign(component) } else { 1.0 / component };
            }
            packet.reach[lane] = 1.0;
            packet.open += 1;
        }
        packet
    }

    /// Whether nothing stopped ray `lane`.
    pub(crate) fn is_free(&self, lane: usize) -> bool {
        self.reach[lane] > 0.0
    }

    /// Stops every ray that meets a shape before its end. `stack` is room to work in.
    pub(crate) fn stop(&mut self, origin: Vec3, shadows: &Shadows, stack: &mut Vec<u32>) {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the feature was found. The function computes the same bits as the plain one.
            #[allow(unsafe_code)]
            unsafe {
                stop_avx2(self, origin, shadows, stack);
            }
            return;
        }
        self.stop_plain(origin, shadows, stack);
    }

    #[inline(always)]
    fn stop_plain(&mut self, origin: Vec3, shadows: &Shadows, stack: &mut Vec<u32>) {
        stack.clear();
        // The root stands alone, all others in pairs; bit 31 tells it.
        const ROOT: u32 = 1 << 31;
        stack.push(ROOT);
        while let Some(entry) = stack.pop() {
            let (first, count) = if entry == ROOT { (0, 1) } else { (entry as usize, 2) };
            for node in &shadows.bvh.nodes[first..first + count] {
                let low = Vec3::from(node.aabb().min) - origin;
                let high = Vec3::from(node.aabb().max) - origin;
                if !self.enters(low, high) {
                    continue;
                }
                if !node.is_leaf() {
                    stack.push(node.first_index);
                    continue;
                }
                let leaf = node.first_index as usize..(node.first_index + node.prim_count) as usize;
                for shape in &shadows.shapes[leaf] {
                    match shape {
                        Shape::Triangle(corners) => self.stop_at_triangle(corners.map(|corner| corner - origin)),
                        ball @ Shape::Ball { .. } => self.stop_at_ball(ball, origin),
                    }
                }
                if self.open == 0 {
                    return;
                }
            }
        }
    }

    /// Whether an open ray enters the box from `low` to `high`, both seen from the origin.
    #[inline(always)]
    fn enters(&self, low: Vec3, high: Vec3) -> bool {
        let mut entering = [0.0f32; RAYS];
        let mut leaving = self.reach;
        for axis in 0..3 {
            let (low, high) = (low[axis], high[axis]);
            for lane in 0..RAYS {
                let (a, b) = (low * self.inverse[axis][lane], high * self.inverse[axis][lane]);
                let (near, far) = if a < b { (a, b) } else { (b, a) };
                entering[lane] = if near > entering[lane] { near } else { entering[lane] };
                leaving[lane] = if far < leaving[lane] { far } else { leaving[lane] };
            }
        }
        let mut any = 0u32;
        for lane in 0..RAYS {
            any |= u32::from(entering[lane] <= leaving[lane]);
        }
        any != 0
    }

    /// The corners are seen from the origin.
    #[inline(always)]
    fn stop_at_triangle(&mut self, [a, b, c]: [Vec3; 3]) {
        // Twice the normal of the plane through the origin and an edge. Corners lie close together and far away, so p × q would
        // lose its digits; this form keeps them, and changes only its sign when the edge is walked the other way.
        let plane = |p: Vec3, q: Vec3| (p + q).cross(q - p);
        let (ab, bc, ca) = (plane(a, b), plane(b, c), plane(c, a));
        let normal = (b - a).cross(c - a);
        let offset = a.dot(normal);
        let [dx, dy, dz] = &self.direction;
        let mut open = 0;
        for lane in 0..RAYS {
            let along = |v: Vec3| dx[lane] * v.x + dy[lane] * v.y + dz[lane] * v.z;
            let (u, v, w) = (along(bc), along(ca), along(ab));
            // Inside if the three have one sign; met at offset/speed of the way.
            let low = if u < v { u } else { v };
            let low = if w < low { w } else { low };
            let high = if u > v { u } else { v };
            let high = if w > high { w } else { high };
            let speed = along(normal);
            let inside = (low >= 0.0) | (high <= 0.0);
            let before_end = (offset * speed > 0.0) & (offset.abs() < speed.abs());
            let reach = if inside & before_end { -1.0 } else { self.reach[lane] };
            self.reach[lane] = reach;
            open += usize::from(reach > 0.0);
        }
        self.open = open;
    }

    fn stop_at_ball(&mut self, ball: &Shape, origin: Vec3) {
        for lane in 0..RAYS {
            if self.reach[lane] > 0.0 {
                let way = Vec3::from_array([0, 1, 2].map(|axis| self.direction[axis][lane]));
                let length = way.length();
                let ray = PreparedRay::new(origin, way / length);
                if ball.meet(&ray, length).is_some() {
                    self.reach[lane] = -1.0;
                    self.open -= 1;
                }
            }
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn stop_avx2(packet: &mut Packet, origin: Vec3, shadows: &Shadows, stack: &mut Vec<u32>) {
    packet.stop_plain(origin, shadows, stack);
}
