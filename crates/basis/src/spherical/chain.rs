//! Sites without a triangle worth the name: one, two, or all on one great circle. Then only the angle along it counts.

use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// On a closed circle: the sine of the height above it from which the lowest-numbered site fades in, so that the light
/// of all sides does not meet at the pole with a jump.
const POLE_FADE: f64 = 0.7;

/// Sites along a great circle.
#[derive(Debug, Clone)]
pub(super) struct Chain {
    /// Direction of angle 0, then of angle 90°, then the pole.
    frame: [DVec3; 3],
    /// Angle \[rad\] and site, ascending in (−π, π]. When the chain is open they lie around 0.
    stops: Vec<(f64, usize)>,
    /// No gap between neighbours is 180° or more.
    closed: bool,
    /// Open chain: the least cosine that counts, so that directions near the pole keep a defined angle.
    least: f64,
}

impl Chain {
    pub(super) fn new(sites: &[DVec3]) -> Self {
        let first = sites[0];
        let lean = |p: &&DVec3| first.cross(**p).length_squared();
        let second = sites.iter().max_by(|a, b| lean(a).total_cmp(&lean(b))).unwrap_or(&first);
        // One site, or two opposite ones: any great circle holds them, take the one that passes nearest to the zenith.
        let upright = first.cross(DVec3::Z).normalize_or(DVec3::X);
        let normal = first.cross(*second);
        let pole = if normal.length() < 1e-9 { upright } else { normal.normalize() };
        let pole = if pole.z < 0.0 { -pole } else { pole };

        let start = if normal.length() < 1e-9 { first.cross(pole).normalize() } else { first };
        let start = if start.z < 0.0 { -start } else { start };
        let mut angles: Vec<f64> = sites.iter().map(|p| angle([start, pole.cross(start), pole], *p)).collect();
        angles.sort_by(f64::total_cmp);
        // The widest gap from one angle to the next around the circle; of equal ones that around ±180°.
        let around = |k: usize| angles[0] + TAU - angles[k];
        let gap_after = |k: usize| if k + 1 < angles.len() { angles[k + 1] - angles[k] } else { around(k) };
        let inner = (0..angles.len() - 1).max_by(|&a, &b| gap_after(a).total_cmp(&gap_after(b)));
        let last = angles.len() - 1;
        let widest = inner.filter(|&k| gap_after(k) > gap_after(last) + 1e-9).unwrap_or(last);
        let closed = gap_after(widest) < PI - 1e-9;
        // Angle 0 is opposite the middle of that gap.
        let middle = angles[widest] + 0.5 * gap_after(widest) - PI;
        let zero = start * middle.cos() + pole.cross(start) * middle.sin();
        let frame = [zero, pole.cross(zero), pole];
        let mut stops: Vec<(f64, usize)> = sites.iter().enumerate().map(|(i, p)| (angle(frame, *p), i)).collect();
        stops.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let widest_cos = stops.iter().map(|stop| stop.0.cos()).fold(1.0, f64::min);
        Self { frame, stops, closed, least: (0.5 * widest_cos).clamp(0.0, 0.05) }
    }

    /// Up to three sites and their weights, not normalised. A site may come twice.
    pub(super) fn weights(&self, direction: DVec3) -> [(usize, f64); 3] {
        let last = self.stops.len() - 1;
        let [across, along] = [self.frame[0], self.frame[1]].map(|axis| direction.dot(axis));
        let angle = if self.closed { along.atan2(across) } else { along.atan2(across.max(self.least)) };
        let after = self.stops.partition_point(|stop| stop.0 <= angle);
        let (from, to) = if self.closed {
            let turn = |(angle, site): (f64, usize), by: f64| (angle + by, site);
            let from = if after == 0 { turn(self.stops[last], -TAU) } else { self.stops[after - 1] };
            (from, if after > last { turn(self.stops[0], TAU) } else { self.stops[after] })
        } else {
            (self.stops[after.saturating_sub(1)], self.stops[after.min(last)])
        };
        let (past, ahead) = ((angle - from.0).max(0.0), (to.0 - angle).max(0.0));
        // The weighted sum of two unit vectors points along the arc by the sines; half a circle has no such sum.
        let share = if past + ahead < 3.0 { (ahead.sin(), past.sin()) } else { (ahead, past) };
        let total = share.0 + share.1;
        let share = if total > 0.0 { (share.0 / total, share.1 / total) } else { (1.0, 0.0) };
        let height = direction.dot(self.frame[2]).abs();
        let fade = if self.closed { ((height - POLE_FADE) / (1.0 - POLE_FADE)).clamp(0.0, 1.0) } else { 0.0 };
        [(from.1, share.0 * (1.0 - fade)), (to.1, share.1 * (1.0 - fade)), (0, fade)]
    }
}

fn angle(frame: [DVec3; 3], direction: DVec3) -> f64 {
    direction.dot(frame[1]).atan2(direction.dot(frame[0]))
}
