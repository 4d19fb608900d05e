//! Where the virtual projector stands, what it shows, and what that looks like.

use std::sync::Arc;

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use relumine_basis::{Position, Reach};
use relumine_capture::{Scheme, Setup, ShownPattern};
use relumine_radiometry::{Image, Radiance};
use relumine_tracer::{Lantern, PathOptions, Paths, Scene, Share};

use super::SimulatedText;

/// Paths are kept from position to position up to this many bytes; beyond, they are followed again at each.
const KEPT_BYTES: usize = 1 << 29;

/// Rows of the picture whose paths are in memory together where they are not kept.
const ROWS: usize = 32;

/// The virtual world round the object.
pub(super) struct World {
    scene: Scene,
    setup: Arc<Setup>,
    settings: SimulatedText,
    options: PathOptions,
    /// Whether paths are kept, once that is known, and those that are.
    keeps: Option<bool>,
    kept: Option<Paths>,
    standing: Option<(usize, Position)>,
    shown: Option<ShownPattern>,
    /// What every square alone looks like from here, if that is known yet.
    shares: Option<Vec<Share>>,
}

/// Whether the paths of the whole picture are few enough to be kept, judged by the row across its middle.
fn fit_to_keep(scene: &Scene, options: &PathOptions) -> bool {
    let (width, height) = scene.picture_size();
    if Paths::most_bytes(width * height, options) <= KEPT_BYTES {
        return true;
    }
    let middle = height / 2;
    let row = Paths::trace(scene, 0..width, middle..middle + 1, options);
    row.bytes().saturating_mul(height) <= KEPT_BYTES
}

/// What is photographed: names its noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    pub(super) index: usize,
    pub(super) pattern: ShownPattern,
}

impl World {
    pub(super) fn new(scene: Scene, setup: Arc<Setup>, settings: SimulatedText, options: PathOptions) -> Self {
        Self { scene, setup, settings, options, keeps: None, kept: None, standing: None, shown: None, shares: None }
    }

    pub(super) fn move_to(&mut self, index: usize, position: Position) {
        if self.standing != Some((index, position)) {
            self.standing = Some((index, position));
            self.shares = None;
        }
    }

    pub(super) fn show(&mut self, pattern: ShownPattern) {
        self.shown = Some(pattern);
    }

    /// What the camera sees now; `None` before anything stands and shines.
    pub(super) fn radiance(&mut self) -> Option<(Place, Image<Radiance>)> {
        let ((index, position), pattern) = (self.standing?, self.shown?);
        if self.shares.is_none() {
            self.shares = Some(self.look(index, position));
        }
        let shares = self.shares.as_ref()?;
        let squares = self.setup.cells().squares();
        let spacing = match self.setup.scheme() {
            Scheme::Combs { spacing } => spacing,
            Scheme::Squares => 1,
        };
        // Black shines through everywhere.
        let black = self.settings.projector_black as f32;
        let mut brightness = vec![black; squares * squares];
        for (u, v) in pattern.lit(squares, spacing) {
            brightness[v * squares + u] = 1.0;
        }
        let (width, height) = self.setup.picture_size();
        let mut picture = Image::black(width, height);
        let pixels = picture.pixels_mut();
        for Share { pixel, square, radiance } in shares {
            for (sum, value) in pixels[*pixel as usize].iter_mut().zip(radiance) {
                *sum += value * brightness[*square as usize];
            }
        }
        Some((Place { index, pattern }, picture))
    }

    /// Every square alone from a position, which is not quite where it should be.
    fn look(&mut self, index: usize, position: Position) -> Vec<Share> {
        let Reach::Near { radius_m, pattern } = self.setup.cells().reach() else {
            unreachable!("a capture has a hemisphere of finite radius");
        };
        let intensity = self.setup.intensity_w_sr();
        let vignetting = self.settings.projector_vignetting;
        let lantern = Lantern::projector(self.misplaced(index, position), radius_m, pattern, intensity, vignetting);
        let (width, height) = self.scene.picture_size();
        if *self.keeps.get_or_insert_with(|| fit_to_keep(&self.scene, &self.options)) {
            let (scene, options) = (&self.scene, &self.options);
            let paths = self.kept.get_or_insert_with(|| Paths::trace(scene, 0..width, 0..height, options));
            return paths.under(scene, &lantern, 0..width, 0..height);
        }
        let mut shares = Vec::new();
        for start in (0..height).step_by(ROWS) {
            let rows = start..(start + ROWS).min(height);
            let paths = Paths::trace(&self.scene, 0..width, rows.clone(), &self.options);
            let first = (start * width) as u32;
            let strip = paths.under(&self.scene, &lantern, 0..width, rows);
            shares.extend(strip.into_iter().map(|share| Share { pixel: share.pixel + first, ..share }));
        }
        shares
    }

    fn misplaced(&self, index: usize, position: Position) -> Position {
        let sigma = self.settings.misplaced_deg.to_radians();
        if sigma == 0.0 {
            return position;
        }
        let mut random = Pcg64Mcg::seed_from_u64(self.settings.seed ^ ((index as u64 + 1) << 32));
        let mut aside = || -> f64 { StandardNormal.sample(&mut random) };
        let frame = position.frame();
        let moved = frame.outward + sigma * (aside() * frame.right + aside() * frame.up);
        Position::from_direction(moved.normalize())
    }
}
