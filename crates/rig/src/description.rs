//! `rig.toml`: what a user writes of a rig (FORMAT.md §5).

mod text;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use relumine_capture::Setup;
use relumine_radiometry::{ExposureSettings, Gain, parse_toml, read_text};
use serde::Deserialize;

use crate::RigError;
use crate::simulated::SimulatedText;

use text::{CameraDriverText, HandText, Text};
pub use text::{Manual, Timing};

/// Who moves, shows and photographs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hands {
    /// A person moves and shows; the camera's pictures are found in a folder.
    Manual,
    /// Nobody: the virtual rig.
    Simulated,
}

/// A rig as its description says it.
pub struct Rig {
    path: PathBuf,
    text: String,
    setup: Arc<Setup>,
    capture_toml: String,
    named_files: Vec<PathBuf>,
    white: bool,
    exposures: Vec<ExposureSettings>,
    object_radius_m: Option<f64>,
    bytes_per_photograph: Option<u64>,
    hands: Hands,
    manual: Manual,
    timing: Timing,
    simulated: Option<SimulatedText>,
}

impl Rig {
    /// The `format` line of this version.
    pub const FORMAT: &'static str = "relumine-rig/1";
    /// The most exposures of one pattern.
    pub const MAX_EXPOSURES: usize = 64;
    /// The longest time that a description may give, seconds: a day.
    pub const LONGEST_S: f64 = 86_400.0;

    /// Reads a description and, if it names one, the response file beside it.
    ///
    /// # Errors
    /// If it cannot be read, has unknown keys or impossible values.
    pub fn read(path: &Path) -> Result<Self, RigError> {
        Self::parse(path, &read_text(path)?)
    }

    /// Reads the text of a description; what it names is looked for beside `path`.
    ///
    /// # Errors
    /// As [`Rig::read`].
    pub fn parse(path: &Path, text: &str) -> Result<Self, RigError> {
        let mut read: Text = parse_toml(path, text)?;
        let fail = |reason: String| RigError::Rig { path: path.to_path_buf(), reason };
        if read.format != Self::FORMAT {
            return Err(fail(format!("format: expected \"{}\", found \"{}\"", Self::FORMAT, read.format)));
        }
        let capture_toml = read.capture_toml().map_err(|error| fail(error.to_string()))?;
        let setup = Setup::parse(path, &capture_toml)?;
        let hands = hands(&read).map_err(fail)?;
        let response = read.camera.response.filter(|name| !["linear", "srgb", "recover"].contains(&name.as_str()));
        let exposures = exposures(read.camera.exposures_s, read.camera.iso, read.camera.f_number).map_err(fail)?;
        if let Some(radius) = read.hemisphere.object_radius_m.filter(|radius| !(*radius > 0.0 && radius.is_finite())) {
            return Err(fail(format!("hemisphere: object_radius_m must be a number above 0, but is {radius}")));
        }
        let Timing { move_s, show_s, photograph_s } = read.timing;
        for (name, value) in [
            ("timing: move_s", move_s),
            ("timing: show_s", show_s),
            ("timing: photograph_s", photograph_s),
            ("manual: settle_s", read.manual.settle_s),
        ] {
            if !(0.0..=Self::LONGEST_S).contains(&value) {
                return Err(fail(format!("{name} must be 0 to {} seconds, but is {value}", Self::LONGEST_S)));
            }
        }
        if read.manual.folder.as_os_str().is_empty() {
            return Err(fail("manual: folder must be the name of a folder, but is empty".into()));
        }
        let simulated = read.simulated.map(|mut simulated| {
            simulated.scene = beside(path, &simulated.scene);
            simulated
        });
        if hands == Hands::Simulated && simulated.is_none() {
            return Err(fail("simulated drivers need the section [simulated], which is missing".into()));
        }
        Ok(Self {
            path: path.to_path_buf(),
            text: text.into(),
            capture_toml,
            named_files: response.into_iter().chain(read.camera.colour).map(PathBuf::from).collect(),
            white: read.patterns.white,
            exposures,
            object_radius_m: read.hemisphere.object_radius_m,
            bytes_per_photograph: read.camera.bytes_per_photograph,
            hands,
            manual: read.manual,
            timing: read.timing,
            simulated,
            setup: Arc::new(setup),
        })
    }

    /// Where the description lies.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What it shares with the capture it fills: geometry, patterns, camera.
    pub fn setup(&self) -> &Setup {
        &self.setup
    }

    /// The same, for who must keep it.
    pub fn shared_setup(&self) -> Arc<Setup> {
        self.setup.clone()
    }

    /// The text of the `capture.toml` that belongs to it.
    pub fn capture_toml(&self) -> &str {
        &self.capture_toml
    }

    /// The response file and the colour correction, as far as they are named, relative to the description and to the capture.
    pub fn named_files(&self) -> &[PathBuf] {
        &self.named_files
    }

    /// The description's text for another directory: the scene's path is made absolute.
    ///
    /// # Errors
    /// If the scene is not there.
    pub fn text_for_elsewhere(&self) -> Result<String, RigError> {
        let Some(simulated) = &self.simulated else { return Ok(self.text.clone()) };
        let scene = &simulated.scene;
        let absolute = scene.canonicalize().map_err(|source| RigError::Read { path: scene.clone(), source })?;
        let Scene { simulated: Some(SceneOf { scene }) } = parse_toml(&self.path, &self.text)? else {
            return Ok(self.text.clone());
        };
        let mut text = self.text.clone();
        let quoted = toml::Value::String(absolute.to_string_lossy().into_owned()).to_string();
        text.replace_range(scene.span(), &quoted);
        Ok(text)
    }

    /// Whether the white frame is photographed too.
    pub fn white(&self) -> bool {
        self.white
    }

    /// The exposures of each pattern, shortest first; at least one.
    pub fn exposures(&self) -> &[ExposureSettings] {
        &self.exposures
    }

    /// Radius of the ball at the origin that holds the object, metres, if given.
    pub fn object_radius_m(&self) -> Option<f64> {
        self.object_radius_m
    }

    /// Bytes of one photograph, if given.
    pub fn bytes_per_photograph(&self) -> Option<u64> {
        self.bytes_per_photograph
    }

    /// Who moves, shows and photographs.
    pub fn hands(&self) -> Hands {
        self.hands
    }

    /// Settings of the manual drivers.
    pub fn manual(&self) -> &Manual {
        &self.manual
    }

    /// What its steps take.
    pub fn timing(&self) -> Timing {
        self.timing
    }

    /// Settings of the virtual rig, if there are any; the scene's path is relative to the process, not to the description.
    pub fn simulated(&self) -> Option<&SimulatedText> {
        self.simulated.as_ref()
    }
}

/// Where in the text the scene is named.
#[derive(Deserialize)]
struct Scene {
    simulated: Option<SceneOf>,
}

#[derive(Deserialize)]
struct SceneOf {
    scene: toml::Spanned<String>,
}

fn beside(description: &Path, name: &Path) -> PathBuf {
    description.parent().unwrap_or(Path::new("")).join(name)
}

fn hands(text: &Text) -> Result<Hands, String> {
    let drivers = &text.drivers;
    match (drivers.stage, drivers.projector, drivers.camera) {
        (HandText::Manual, HandText::Manual, CameraDriverText::WatchedFolder) => Ok(Hands::Manual),
        (HandText::Simulated, HandText::Simulated, CameraDriverText::Simulated) => Ok(Hands::Simulated),
        _ => Err("drivers: stage, projector and camera must all be \"simulated\" or none of them: a real camera does not see \
                  a virtual projector"
            .into()),
    }
}

/// Sorted, and each once.
fn exposures(mut times: Vec<f64>, iso: Option<f64>, f_number: Option<f64>) -> Result<Vec<ExposureSettings>, String> {
    let gain = match (iso, f_number) {
        (None, None) => None,
        (Some(iso), Some(f_number)) => Some(Gain { iso, f_number }),
        _ => return Err("camera: iso and f_number must both be given or both be left out".into()),
    };
    for (name, value) in [("iso", iso), ("f_number", f_number)] {
        if let Some(value) = value.filter(|value| !(1e-3..=1e9).contains(value)) {
            return Err(format!("camera: {name} must be 0.001 to 1000000000, but is {value}"));
        }
    }
    if !(1..=Rig::MAX_EXPOSURES).contains(&times.len()) {
        return Err(format!("camera: exposures_s must have 1 to {} times, found {}", Rig::MAX_EXPOSURES, times.len()));
    }
    if let Some(wrong) = times.iter().find(|time| !(1e-9..=Rig::LONGEST_S).contains(*time)) {
        return Err(format!("camera: exposures_s must be 0.000000001 to {} seconds, found {wrong}", Rig::LONGEST_S));
    }
    times.sort_by(f64::total_cmp);
    if let Some(pair) = times.windows(2).find(|pair| pair[0] == pair[1]) {
        return Err(format!("camera: exposures_s must name each time once, found {} twice", pair[0]));
    }
    Ok(times.into_iter().map(|exposure_s| ExposureSettings { exposure_s, gain }).collect())
}
