//! A projector at its place, or a distant lamp: what arrives from it at a point, and through which square.

use glam::{DVec3, Vec3};
use relumine_basis::{Cells, Pattern, Position, Reach};

/// What lights the scene through squares: a projector, or one distant lamp.
#[derive(Clone, Debug)]
pub struct Lantern {
    kind: Kind,
}

#[derive(Clone, Debug)]
enum Kind {
    Projector {
        position: Vec3,
        right: Vec3,
        up: Vec3,
        outward: Vec3,
        pattern: Pattern,
        intensity: f32,
        vignetting: f32,
    },
    Distant {
        towards: Vec3,
    },
}

/// Light that arrives at a point from a lantern.
pub(crate) struct Arriving {
    pub(crate) square: usize,
    pub(crate) towards: Vec3,
    pub(crate) distance: f32,
    pub(crate) irradiance: f32,
}

impl Lantern {
    /// A projector at `radius_m` in the direction of `position`, with `intensity_w_sr` on its axis, that lights a flat screen
    /// evenly but for `vignetting`, the share that is lacking in the pattern's corners (it grows with the square of the
    /// distance from the axis).
    pub fn projector(
        position: Position,
        radius_m: f64,
        pattern: Pattern,
        intensity_w_sr: f64,
        vignetting: f64,
    ) -> Self {
        let frame = position.frame();
        let kind = Kind::Projector {
            position: (radius_m * frame.outward).as_vec3(),
            right: frame.right.as_vec3(),
            up: frame.up.as_vec3(),
            outward: frame.outward.as_vec3(),
            pattern,
            intensity: intensity_w_sr as f32,
            vignetting: vignetting as f32,
        };
        Self { kind }
    }

    /// A lamp at infinity in the unit direction `towards`, of irradiance one: a single square.
    pub fn distant(towards: DVec3) -> Self {
        Self { kind: Kind::Distant { towards: towards.as_vec3() } }
    }

    /// The lantern whose squares are the cells of position `index`: a projector of one watt a steradian, or a distant lamp.
    pub fn of_cells(cells: &Cells, index: usize) -> Self {
        let position = cells.partition().positions()[index];
        match cells.reach() {
            Reach::Near { radius_m, pattern } => Self::projector(position, radius_m, pattern, 1.0, 0.0),
            Reach::Far => Self::distant(position.direction()),
        }
    }

    /// Squares in all.
    pub fn squares(&self) -> usize {
        match &self.kind {
            Kind::Projector { pattern, .. } => pattern.squares() * pattern.squares(),
            Kind::Distant { .. } => 1,
        }
    }

    /// The point that all its light comes from; `None` for a distant lamp.
    pub(crate) fn origin(&self) -> Option<Vec3> {
        match &self.kind {
            Kind::Projector { position, .. } => Some(*position),
            Kind::Distant { .. } => None,
        }
    }

    #[inline]
    pub(crate) fn arriving(&self, point: Vec3) -> Option<Arriving> {
        match &self.kind {
            Kind::Projector { position, right, up, outward, pattern, intensity, vignetting } => {
                let offset = *position - point;
                let squared = offset.length_squared();
                let distance = squared.sqrt();
                let towards = offset / distance;
                // The light travels the other way.
                let forward = towards.dot(*outward);
                if forward <= 1e-6 {
                    return None;
                }
                let (s, t) = (-towards.dot(*right) / forward, -towards.dot(*up) / forward);
                let (u, v) = pattern.square_at(f64::from(s), f64::from(t))?;
                // I(a) = I₀/cos³a lights a screen evenly.
                let half_width = pattern.half_width() as f32;
                let lacking = vignetting * (s * s + t * t) / (2.0 * half_width * half_width);
                let intensity = intensity * (1.0 - lacking) / (forward * forward * forward);
                Some(Arriving { square: v * pattern.squares() + u, towards, distance, irradiance: intensity / squared })
            }
            Kind::Distant { towards } => {
                Some(Arriving { square: 0, towards: *towards, distance: f32::INFINITY, irradiance: 1.0 })
            }
        }
    }
}
