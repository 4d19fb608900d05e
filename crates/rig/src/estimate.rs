//! What a plan costs: hours, bytes on disk, and what may go wrong with it.

use std::fmt;
use std::fs;
use std::path::Path;

use relumine_basis::Reach;

use crate::{Hands, Plan, Rig};

/// What a plan costs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Duration of the capture, hours; `None` on a virtual rig, which takes what its computer takes.
    pub hours: Option<f64>,
    /// Bytes of one photograph.
    pub bytes_per_photograph: u64,
    /// Whether these were reckoned as an uncompressed picture of so many bits, for want of `bytes_per_photograph`.
    pub reckoned_bits: Option<u32>,
    /// Bytes of all photographs.
    pub bytes: u64,
}

impl Estimate {
    /// Reckons it: each position is moved to once, each pattern shown once a position.
    pub fn of(rig: &Rig, plan: &Plan) -> Self {
        let timing = rig.timing();
        let exposures: f64 =
            plan.exposures().iter().map(|exposure| exposure.exposure_s + timing.photograph_s).sum::<f64>();
        let position_s = timing.move_s + plan.patterns().len() as f64 * (timing.show_s + exposures);
        let bits = if rig.setup().levels().1 > 255 { 16 } else { 8 };
        let (width, height) = rig.setup().picture_size();
        let uncompressed = (width * height * 3) as u64 * u64::from(bits / 8);
        let bytes_per_photograph = rig.bytes_per_photograph().unwrap_or(uncompressed);
        Self {
            hours: (rig.hands() == Hands::Manual).then(|| plan.positions() as f64 * position_s / 3600.0),
            bytes_per_photograph,
            reckoned_bits: rig.bytes_per_photograph().is_none().then_some(bits),
            bytes: bytes_per_photograph.saturating_mul(plan.len() as u64),
        }
    }
}

/// Something about a plan that a person should know before the first photograph, and that stops nothing.
#[derive(Clone, Debug, PartialEq)]
pub enum PlanWarning {
    /// The photographs do not fit on the disk.
    Disk {
        /// Bytes of the photographs.
        needed: u64,
        /// Bytes that are free.
        free: u64,
    },
    /// One position does not fit in the memory of this machine when it is developed.
    Memory {
        /// Bytes that one position needs.
        needed: u64,
        /// Bytes that the machine has.
        present: u64,
    },
    /// The object is larger than the ball that every pattern covers.
    Object {
        /// Radius of the object, metres.
        object_radius_m: f64,
        /// Radius of the ball, metres.
        covered_radius_m: f64,
        /// The half width that would cover the object; none if it fills the hemisphere.
        half_width: Option<f64>,
    },
}

impl PlanWarning {
    /// What there is to say about a capture at `directory` (if it is known already) that `relumine develop` needs
    /// `developing_bytes` of memory for, a position.
    pub fn all(rig: &Rig, estimate: &Estimate, directory: Option<&Path>, developing_bytes: u64) -> Vec<Self> {
        let mut warnings = Vec::new();
        if let Some(free) = directory.and_then(free_bytes).filter(|free| *free < estimate.bytes) {
            warnings.push(Self::Disk { needed: estimate.bytes, free });
        }
        if let Some(present) = memory_bytes().filter(|present| *present < developing_bytes) {
            warnings.push(Self::Memory { needed: developing_bytes, present });
        }
        let covered_radius_m = rig.setup().cells().covered_radius_m();
        if let Some(object_radius_m) = rig.object_radius_m().filter(|radius| *radius > covered_radius_m)
            && let Reach::Near { radius_m, .. } = rig.setup().cells().reach()
        {
            let sine = object_radius_m / radius_m;
            let half_width = (sine < 1.0).then(|| sine.asin().tan());
            warnings.push(Self::Object { object_radius_m, covered_radius_m, half_width });
        }
        warnings
    }
}

impl fmt::Display for PlanWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let gib = |bytes: u64| format!("{:.1} GiB", bytes as f64 / (1u64 << 30) as f64);
        match self {
            Self::Disk { needed, free } => write!(
                f,
                "the photographs take about {}, and {} are free on this disk: choose another, or see to it while the \
                 capture goes on (it stops when the disk is full and can be gone on with)",
                gib(*needed),
                gib(*free)
            ),
            Self::Memory { needed, present } => write!(
                f,
                "`relumine develop` will need {} of memory a position, this machine has {}: develop on another, or \
                 photograph smaller pictures",
                gib(*needed),
                gib(*present)
            ),
            Self::Object { object_radius_m, covered_radius_m, half_width } => {
                write!(
                    f,
                    "the pattern covers a ball of {covered_radius_m:.3} m about the origin, the object reaches to \
                     {object_radius_m:.3} m: what stands outside is lit by some positions only; "
                )?;
                match half_width {
                    Some(half_width) => write!(f, "half_width = {half_width:.3} would cover it"),
                    None => write!(f, "the projector stands inside the object's ball: enlarge the hemisphere"),
                }
            }
        }
    }
}

/// Free bytes on the disk that holds `path`, or would hold it.
fn free_bytes(path: &Path) -> Option<u64> {
    let path = std::path::absolute(path).ok()?;
    fs4::available_space(path.ancestors().find(|folder| folder.exists())?).ok()
}

/// Bytes of memory that the machine has, where it says so.
fn memory_bytes() -> Option<u64> {
    let text = fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
    line.split_whitespace().next()?.parse::<u64>().ok()?.checked_mul(1024)
}
