//! A small fake rig for the tests: what it photographs is known, and it can be broken in many ways.

#![allow(dead_code)] // each test file takes its part

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use relumine_basis::Position;
use relumine_capture::ShownPattern;
use relumine_radiometry::files::encode_png_counts;
use relumine_radiometry::{Counts, ExposureSettings, Image};
use relumine_rig::{Camera, Drivers, Photograph, Projector, Rig, RigError, Stage};

pub(crate) const WIDTH: usize = 24;
pub(crate) const HEIGHT: usize = 16;
/// M of [`RIG`].
const SQUARES: usize = 4;

/// 2 × 2 positions, 4 × 4 squares, combs 2 apart, two exposures.
pub(crate) const RIG: &str = r#"format = "relumine-rig/1"
title = "fake"

[hemisphere]
radius_m = 2.0
azimuths = 2
tilts = 2

[projector]
squares = 4
half_width = 0.25

[patterns]
scheme = "combs"
spacing = 2

[camera]
width = 24
height = 16
exposures_s = [1.0, 0.25]

[drivers]
stage = "manual"
projector = "manual"
camera = "watched-folder"
"#;

pub(crate) fn rig() -> Rig {
    Rig::parse(Path::new("rig.toml"), RIG).unwrap()
}

/// How a fake rig is broken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Fault {
    None,
    /// Pictures are one pixel too wide.
    Size,
    /// Pictures end too early.
    Torn,
    /// Longer exposures are darker.
    Shutter,
    /// The shutter stays open half as long as it says, from 0.5 s on.
    LongShutter,
    /// Codes follow the square root of the light.
    Response,
    /// Every photograph has another brightness.
    Flicker,
    /// The projector shows white whatever it is told.
    StuckProjector,
    /// Each pattern is half as bright again as the one before.
    WarmingProjector,
    /// Combs of columns are shown as rows that lack a square.
    WrongColumns,
    /// The stage stays where it is.
    StuckStage,
    /// The stage comes back to another place.
    LooseStage,
    /// The stage fails at position 2.
    FailingStage,
}

/// What was done, in order: `m2` moved to 2, `s black` shown, `p 0.25` photographed.
pub(crate) type Log = Rc<RefCell<Vec<String>>>;

struct World {
    fault: Fault,
    position: usize,
    moves: usize,
    shown: Option<ShownPattern>,
    shows: usize,
    photographs: usize,
    log: Log,
}

struct Fake(Rc<RefCell<World>>);

pub(crate) fn fake(fault: Fault) -> (Drivers, Log) {
    let log = Log::default();
    let world = World { fault, position: 0, moves: 0, shown: None, shows: 0, photographs: 0, log: log.clone() };
    let world = Rc::new(RefCell::new(world));
    let drivers = Drivers {
        stage: Box::new(Fake(world.clone())),
        projector: Box::new(Fake(world.clone())),
        camera: Box::new(Fake(world)),
        durable: false,
    };
    (drivers, log)
}

impl Stage for Fake {
    fn move_to(&mut self, index: usize, _: Position) -> Result<(), RigError> {
        let mut world = self.0.borrow_mut();
        world.log.borrow_mut().push(format!("m{index}"));
        if world.fault == Fault::FailingStage && index == 2 {
            return Err(RigError::Device { device: "stage", reason: "end stop reached".into() });
        }
        if world.fault != Fault::StuckStage {
            world.moves += usize::from(world.position != index);
            world.position = index;
        }
        Ok(())
    }
}

impl Projector for Fake {
    fn show(&mut self, pattern: ShownPattern) -> Result<(), RigError> {
        let mut world = self.0.borrow_mut();
        world.log.borrow_mut().push(format!("s {pattern}"));
        world.shows += 1;
        world.shown = Some(pattern);
        Ok(())
    }
}

impl Camera for Fake {
    fn photograph(&mut self, exposure: &ExposureSettings) -> Result<Photograph, RigError> {
        let mut world = self.0.borrow_mut();
        world.log.borrow_mut().push(format!("p {}", exposure.exposure_s));
        world.photographs += 1;
        Ok(Photograph { bytes: world.picture(exposure.exposure_s), extension: "png".into() })
    }
}

impl World {
    fn picture(&self, exposure_s: f64) -> Vec<u8> {
        let time = match self.fault {
            Fault::Shutter => 0.1 / exposure_s,
            Fault::LongShutter if exposure_s > 0.5 => exposure_s / 2.0,
            _ => exposure_s,
        };
        let mut light = time;
        if self.fault == Fault::Flicker && self.photographs % 2 == 1 {
            light *= 2.0;
        }
        if self.fault == Fault::WarmingProjector {
            light *= 1.0 + 0.5 * self.shows as f64;
        }
        let width = WIDTH + usize::from(self.fault == Fault::Size);
        let pixels = (0..width * HEIGHT).map(|pixel| {
            let fraction = (self.radiance(pixel % width, pixel / width) * light).min(1.0);
            let fraction = if self.fault == Fault::Response { fraction.sqrt() } else { fraction };
            [(fraction * 65535.0).round() as u16; 3]
        });
        let mut bytes = encode_png_counts(&Image::<Counts>::from_pixels(width, HEIGHT, pixels.collect()), 16);
        if self.fault == Fault::Torn {
            bytes.truncate(bytes.len() / 2);
        }
        bytes
    }

    /// Below 1 under white; the projector's black shines 1 %.
    fn radiance(&self, x: usize, y: usize) -> f64 {
        let lit = match (self.fault, self.shown) {
            (_, None) => Vec::new(),
            (Fault::StuckProjector, Some(_)) => ShownPattern::White.lit(SQUARES, 2),
            (Fault::WrongColumns, Some(ShownPattern::Column { u, k })) => {
                ShownPattern::Row { v: u, k }.lit(SQUARES, 2).into_iter().skip(1).collect()
            }
            (_, Some(pattern)) => pattern.lit(SQUARES, 2),
        };
        let all = ShownPattern::White.lit(SQUARES, 2);
        let sum = |squares: &[(usize, usize)]| squares.iter().map(|(u, v)| self.transfer(*u, *v, x, y)).sum::<f64>();
        0.01 * sum(&all) + 0.99 * sum(&lit)
    }

    fn transfer(&self, u: usize, v: usize, x: usize, y: usize) -> f64 {
        let (x, y) = (x as f64 / WIDTH as f64 * 4.0, y as f64 / HEIGHT as f64 * 4.0);
        let loose = if self.fault == Fault::LooseStage { 0.2 * self.moves as f64 } else { 0.0 };
        let shift = 0.5 + 0.3 * self.position as f64 + loose;
        let distance = (u as f64 + shift - x).powi(2) + (v as f64 + 0.5 - y).powi(2);
        0.02 + 0.2 * (-distance).exp()
    }
}

/// Every file below a folder with its bytes, but for the lock.
pub(crate) fn tree(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = BTreeMap::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(inner) = folders.pop() {
        for entry in fs::read_dir(&inner).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.file_name().unwrap() != ".lock" {
                files.insert(path.strip_prefix(folder).unwrap().to_path_buf(), fs::read(&path).unwrap());
            }
        }
    }
    files
}
