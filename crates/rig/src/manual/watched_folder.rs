//! A camera whose own program (tethering, a card reader, a network share) puts its pictures in a folder.
//!
//! The folder is looked at again and again: that works on every file system. A picture is new if it was not there, or not
//! so, when it was asked for. It counts when it has not changed for a while and is what the capture promises; the file in the
//! folder is only read.

use std::cmp::Reverse;
use std::collections::HashMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant, SystemTime};

use relumine_capture::Setup;
use relumine_radiometry::ExposureSettings;

use super::Operator;
use crate::RigError;
use crate::description::Manual;
use crate::devices::{Camera, Photograph};
use crate::run::check;

/// Time between two looks.
const LOOK_EVERY: Duration = Duration::from_millis(200);
/// Larger files are no photographs.
const MAX_BYTES: u64 = 2 << 30;
const PICTURES: [&str; 6] = ["png", "tif", "tiff", "jpg", "jpeg", "exr"];
const RAW: [&str; 10] = ["cr2", "cr3", "nef", "arw", "dng", "raf", "orf", "rw2", "pef", "iiq"];

/// The camera behind a watched folder.
pub struct WatchedFolder {
    operator: Rc<Operator>,
    setup: Arc<Setup>,
    folder: PathBuf,
    settle: Duration,
    raw_was_told: bool,
}

/// What tells whether a file is still the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct State {
    bytes: u64,
    modified: Option<SystemTime>,
}

impl WatchedFolder {
    /// Watches the folder that `manual` names, for the capture at `directory`; a folder inside the capture is made.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn open(
        operator: Rc<Operator>,
        setup: Arc<Setup>,
        directory: &Path,
        manual: &Manual,
    ) -> Result<Self, RigError> {
        let folder = directory.join(&manual.folder);
        if manual.folder.is_relative() {
            fs::create_dir_all(&folder).map_err(|source| RigError::Write { path: folder.clone(), source })?;
        }
        let settle = Duration::from_secs_f64(manual.settle_s);
        let camera = Self { operator, setup, folder, settle, raw_was_told: false };
        camera.look()?;
        Ok(camera)
    }

    /// The visible files of the folder.
    fn look(&self) -> Result<HashMap<PathBuf, State>, RigError> {
        let fail = |source| RigError::Read { path: self.folder.clone(), source };
        let mut files = HashMap::new();
        for entry in fs::read_dir(&self.folder).map_err(fail)? {
            let entry = entry.map_err(fail)?;
            // Hidden names are those of files on their way. A file that has gone meanwhile was one too.
            if entry.file_name().to_string_lossy().starts_with('.') {
                continue;
            }
            let Ok(metadata) = fs::metadata(entry.path()) else { continue };
            if metadata.is_file() {
                files.insert(entry.path(), State { bytes: metadata.len(), modified: metadata.modified().ok() });
            }
        }
        Ok(files)
    }

    /// Reads a picture; `Err` with why it is not the one that is waited for.
    fn read(&self, path: &Path, state: State) -> Result<Photograph, String> {
        if state.bytes > MAX_BYTES {
            return Err(format!("a file of {} bytes is no photograph", state.bytes));
        }
        let photograph = Photograph {
            bytes: fs::read(path).map_err(|error: io::Error| error.to_string())?,
            extension: extension(path),
        };
        check(&self.setup, &photograph).map(|()| photograph)
    }

    fn tell_of_raw(&mut self, path: &Path) -> Result<(), RigError> {
        if self.raw_was_told {
            return Ok(());
        }
        self.raw_was_told = true;
        self.operator.say(&format!(
            "{}: camera RAW is not read; let the camera or its program write {} files",
            path.display(),
            PICTURES.join(", ")
        ))
    }
}

impl Camera for WatchedFolder {
    fn photograph(&mut self, exposure: &ExposureSettings) -> Result<Photograph, RigError> {
        let mut known = self.look()?;
        let gain = exposure.gain.map_or_else(String::new, |gain| format!(", ISO {}, f/{}", gain.iso, gain.f_number));
        self.operator.say(&format!(
            "photograph with {} s{gain}: waiting for a new picture in {}",
            exposure.exposure_s,
            self.folder.display()
        ))?;
        let mut changing: HashMap<PathBuf, (State, Instant)> = HashMap::new();
        loop {
            if self.operator.wants_to_stop() {
                return Err(RigError::Stopped);
            }
            let mut settled = Vec::new();
            for (path, state) in self.look()? {
                if known.get(&path) == Some(&state) {
                    continue;
                }
                let extension = extension(&path);
                if RAW.contains(&extension.as_str()) {
                    self.tell_of_raw(&path)?;
                }
                if !PICTURES.contains(&extension.as_str()) {
                    continue;
                }
                let (seen, since) = changing.entry(path.clone()).or_insert((state, Instant::now()));
                if *seen != state {
                    (*seen, *since) = (state, Instant::now());
                }
                if state.bytes > 0 && since.elapsed() >= self.settle {
                    settled.push((state, path));
                }
            }
            // The first one taken comes last, and is popped first.
            settled
                .sort_by(|(a, a_path), (b, b_path)| (Reverse(a.modified), b_path).cmp(&(Reverse(b.modified), a_path)));
            while let Some((state, path)) = settled.pop() {
                let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
                match self.read(&path, state) {
                    Ok(photograph) => {
                        self.operator.say(&format!("took {name}"))?;
                        if !settled.is_empty() {
                            self.operator.say(&format!("{} more new pictures are left alone", settled.len()))?;
                        }
                        return Ok(photograph);
                    }
                    Err(reason) => {
                        self.operator.say(&format!("{name} cannot be used: {reason}; waiting for another"))?;
                        known.insert(path, state);
                    }
                }
            }
            thread::sleep(LOOK_EVERY);
        }
    }
}

fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_lowercase()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::manual::operator::tests::{Said, scripted};
    use crate::manual::{Operator, TypedEarly};
    use relumine_radiometry::files::encode_png_counts;
    use relumine_radiometry::{Counts, Image};

    const SETUP: &str = "format = \"relumine-capture/1\"\n[hemisphere]\nradius_m = 1\nazimuths = 1\ntilts = 1\n\
        [projector]\nsquares = 1\nhalf_width = 0.1\n[patterns]\nscheme = \"squares\"\n[camera]\nwidth = 6\nheight = 4\n";
    const EXPOSURE: ExposureSettings = ExposureSettings { exposure_s: 0.5, gain: None };

    /// A camera over `incoming` in a folder of its own, and somebody who never types but has not gone either.
    fn watched() -> (tempfile::TempDir, WatchedFolder, Said, io::PipeWriter) {
        let folder = tempfile::tempdir().unwrap();
        let (reader, writer) = io::pipe().unwrap();
        let said = Said::default();
        let operator = Operator::new(io::BufReader::new(reader), said.clone(), TypedEarly::Forget).unwrap();
        let camera = open(folder.path(), operator);
        (folder, camera, said, writer)
    }

    fn open(directory: &Path, operator: Operator) -> WatchedFolder {
        let setup = Arc::new(Setup::parse(Path::new("capture.toml"), SETUP).unwrap());
        let manual = Manual { settle_s: 0.05, ..Manual::default() };
        WatchedFolder::open(Rc::new(operator), setup, directory, &manual).unwrap()
    }

    fn png(width: usize, count: u16) -> Vec<u8> {
        encode_png_counts(&Image::<Counts>::from_pixels(width, 4, vec![[count; 3]; 4 * width]), 16)
    }

    /// Does the steps one after the other, some looks apart.
    fn meanwhile(steps: Vec<Box<dyn FnOnce() + Send>>) -> thread::JoinHandle<()> {
        thread::spawn(move || {
            for step in steps {
                thread::sleep(3 * LOOK_EVERY);
                step();
            }
        })
    }

    #[test]
    fn only_a_new_and_whole_picture_of_the_right_size_counts() {
        let (folder, mut camera, said, _keyboard) = watched();
        let incoming = folder.path().join("incoming");
        fs::write(incoming.join("old.png"), png(6, 1)).unwrap();
        let write = |name: &str, bytes: Vec<u8>| -> Box<dyn FnOnce() + Send> {
            let path = incoming.join(name);
            Box::new(move || fs::write(path, bytes).unwrap())
        };
        let half = png(6, 2)[..40].to_vec();
        let steps = meanwhile(vec![
            write(".on-its-way.png", png(6, 3)),
            write("notes.txt", b"f/8".to_vec()),
            write("IMG_1.CR2", b"raw".to_vec()),
            write("small.png", png(5, 4)),
            write("IMG_1.PNG", half),
            write("IMG_1.PNG", png(6, 2)),
        ]);
        let photograph = camera.photograph(&EXPOSURE).unwrap();
        steps.join().unwrap();
        assert_eq!(photograph, Photograph { bytes: png(6, 2), extension: "png".into() });
        let text = said.text();
        for line in [
            "photograph with 0.5 s: waiting for a new picture in",
            "IMG_1.CR2: camera RAW is not read",
            "small.png cannot be used: capture.toml promises pictures of 6 × 4, this one has 5 × 4; waiting for another",
            "IMG_1.PNG cannot be used: photograph.png: not a whole PNG",
            "took IMG_1.PNG",
        ] {
            assert!(text.contains(line), "{line}: {text}");
        }
        assert!(!text.contains("old.png") && !text.contains("notes.txt") && !text.contains("on-its-way"), "{text}");
        assert_eq!(fs::read(incoming.join("IMG_1.PNG")).unwrap(), png(6, 2), "the original stays");
    }

    #[test]
    fn a_picture_written_over_the_last_one_is_new() {
        let (folder, mut camera, _said, _keyboard) = watched();
        let path = folder.path().join("incoming/capture.png");
        for count in [1000, 2] {
            let (path, bytes) = (path.clone(), png(6, count));
            let steps = meanwhile(vec![Box::new(move || fs::write(path, bytes).unwrap())]);
            assert_eq!(camera.photograph(&EXPOSURE).unwrap().bytes, png(6, count));
            steps.join().unwrap();
        }
    }

    #[test]
    fn waiting_for_a_picture_can_be_stopped() {
        let folder = tempfile::tempdir().unwrap();
        for answers in ["q\n", ""] {
            let mut camera = open(folder.path(), scripted(answers).0);
            assert!(matches!(camera.photograph(&EXPOSURE), Err(RigError::Stopped)));
        }
    }
}
