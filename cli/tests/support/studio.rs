//! Tiny captures with a known truth, in a folder of their own.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use relumine::radiometry::files::{self, ExrSample};
use relumine::radiometry::{Counts, Image, Linear, srgb_encode};
use sha2::{Digest, Sha256};
use tempfile::TempDir;

use super::{Numbers, Run, read, relumine};

/// b: the share of white that the projector's black still shines.
pub(crate) const BLACK_LEVEL: f64 = 0.01;

pub(crate) enum Positions {
    /// Azimuths × tilts.
    Grid(usize, usize),
    /// `[azimuth, tilt]`, degrees.
    List(Vec<[f64; 2]>),
}

pub(crate) enum Patterns {
    Combs { spacing: usize },
    Squares,
}

pub(crate) enum Camera {
    /// 16-bit linear PNG.
    Png16,
    /// 8-bit sRGB PNG at exposures 1 and 4.
    Srgb8,
    /// Float EXR.
    Exr,
}

/// What is set up.
pub(crate) struct Plan {
    pub(crate) positions: Positions,
    /// M.
    pub(crate) squares: usize,
    pub(crate) patterns: Patterns,
    pub(crate) camera: Camera,
    /// Width and height of the pictures.
    pub(crate) size: (usize, usize),
    pub(crate) radius_m: f64,
    pub(crate) half_width: f64,
    pub(crate) intensity_w_sr: f64,
    /// Standard deviation of a photograph, radiance.
    pub(crate) noise: f64,
}

impl Default for Plan {
    /// 2 × 2 positions, 4 × 4 squares, combs 2 apart.
    fn default() -> Self {
        Self {
            positions: Positions::Grid(2, 2),
            squares: 4,
            patterns: Patterns::Combs { spacing: 2 },
            camera: Camera::Png16,
            size: (20, 12),
            radius_m: 2.0,
            half_width: 0.25,
            intensity_w_sr: 12.0,
            noise: 0.0,
        }
    }
}

impl Plan {
    fn positions(&self) -> usize {
        match &self.positions {
            Positions::Grid(azimuths, tilts) => azimuths * tilts,
            Positions::List(list) => list.len(),
        }
    }

    /// Patterns by the names of FORMAT.md, with the squares (u, v) that they light.
    fn patterns(&self) -> Vec<(String, Vec<(usize, usize)>)> {
        let m = self.squares;
        let all: Vec<_> = (0..m * m).map(|square| (square % m, square / m)).collect();
        let mut patterns = vec![("black".to_string(), vec![]), ("white".to_string(), all.clone())];
        match self.patterns {
            Patterns::Squares => patterns.extend(all.iter().map(|(u, v)| (format!("square-{u}-{v}"), vec![(*u, *v)]))),
            Patterns::Combs { spacing } => {
                for (line, k) in (0..m).flat_map(|line| (0..spacing).map(move |k| (line, k))) {
                    let teeth = || (k..m).step_by(spacing);
                    patterns.push((format!("row-{line}-{k}"), teeth().map(|u| (u, line)).collect()));
                    patterns.push((format!("column-{line}-{k}"), teeth().map(|v| (line, v)).collect()));
                }
            }
        }
        patterns
    }

    fn setup(&self) -> String {
        let positions = match &self.positions {
            Positions::Grid(azimuths, tilts) => format!("azimuths = {azimuths}\ntilts = {tilts}"),
            Positions::List(list) => format!("positions_deg = {list:?}"),
        };
        let patterns = match self.patterns {
            Patterns::Combs { spacing } => format!("scheme = \"combs\"\nspacing = {spacing}"),
            Patterns::Squares => "scheme = \"squares\"".into(),
        };
        let (response, white_level) = match self.camera {
            Camera::Png16 | Camera::Exr => ("linear", 65535),
            Camera::Srgb8 => ("srgb", 255),
        };
        let Self { squares, radius_m, half_width, intensity_w_sr, size: (width, height), .. } = self;
        format!(
            "format = \"relumine-capture/1\"\ntitle = \"test\"\n\n[hemisphere]\nradius_m = {radius_m:?}\n{positions}\n\n\
             [projector]\nsquares = {squares}\nhalf_width = {half_width:?}\nintensity_w_sr = {intensity_w_sr:?}\n\n\
             [patterns]\n{patterns}\n\n[camera]\nwidth = {width}\nheight = {height}\nresponse = \"{response}\"\n\
             white_level = {white_level}\n"
        )
    }
}

/// Radiance of pixel (x, y) under square (u, v) alone: smooth, and every pixel is lit by several squares.
pub(crate) fn truth(position: usize, u: usize, v: usize, x: usize, y: usize) -> [f64; 3] {
    let mut numbers = Numbers(position as u64);
    let mut between = |low: f64, high: f64| low + (high - low) * (numbers.next() >> 11) as f64 / (1u64 << 53) as f64;
    let (x, y) = (x as f64 / 20.0, y as f64 / 12.0);
    let (centre_u, centre_v) = (4.0 * x + between(-0.5, 0.5), 4.0 * y + between(-0.5, 0.5));
    let distance = (u as f64 + 0.5 - centre_u).powi(2) + (v as f64 + 0.5 - centre_v).powi(2);
    let brightness = between(0.08, 0.15);
    let transfer = brightness * (0.02 + (-distance / 1.3).exp());
    [0, 1, 2].map(|channel| transfer * (0.7 + 0.3 * (6.0 * x + 4.0 * y + f64::from(channel) + between(0.0, 6.0)).sin()))
}

/// A folder with a capture in it, and room for fields, lights and pictures.
pub(crate) struct Studio {
    folder: TempDir,
}

impl Studio {
    /// Photographs the [`truth`].
    pub(crate) fn new(plan: &Plan) -> Self {
        Self::photographing(plan, &|position, u, v| {
            let (width, height) = plan.size;
            (0..width * height).map(|pixel| truth(position, u, v, pixel % width, pixel / width)).collect()
        })
    }

    /// Photographs anything, given as the radiance of all pixels under (position, u, v) alone.
    pub(crate) fn photographing(plan: &Plan, lit_by: &dyn Fn(usize, usize, usize) -> Vec<[f64; 3]>) -> Self {
        let studio = Self { folder: tempfile::tempdir().unwrap() };
        let mut table = "position,pattern,exposure_s,iso,f_number,file,sha256\n".to_string();
        let mut numbers = Numbers(2003);
        for position in 0..plan.positions() {
            let m = plan.squares;
            let squares: Vec<_> = (0..m * m).map(|square| lit_by(position, square % m, square / m)).collect();
            let sum = |lit: &[(usize, usize)], pixel: usize, channel: usize| -> f64 {
                lit.iter().map(|(u, v)| squares[v * m + u][pixel][channel]).sum()
            };
            let all: Vec<_> = (0..m * m).map(|square| (square % m, square / m)).collect();
            let folder = format!("photographs/p{position:03}");
            fs::create_dir_all(studio.capture().join(&folder)).unwrap();
            for (pattern, lit) in plan.patterns() {
                let mut radiance = |pixel: usize| {
                    [0, 1, 2].map(|channel| {
                        let shining =
                            BLACK_LEVEL * sum(&all, pixel, channel) + (1.0 - BLACK_LEVEL) * sum(&lit, pixel, channel);
                        shining + plan.noise * numbers.gauss()
                    })
                };
                let radiance: Vec<[f64; 3]> = (0..plan.size.0 * plan.size.1).map(&mut radiance).collect();
                for (index, (exposure, bytes)) in plan.camera.photographs(plan.size, &radiance).into_iter().enumerate()
                {
                    let file = format!("{folder}/{pattern}_e{index}.{}", plan.camera.extension());
                    fs::write(studio.capture().join(&file), &bytes).unwrap();
                    writeln!(table, "{position},{pattern},{exposure},,,{file},{}", sha256(&bytes)).unwrap();
                }
            }
        }
        fs::write(studio.capture().join("capture.toml"), plan.setup()).unwrap();
        fs::write(studio.table(), table).unwrap();
        studio
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn capture(&self) -> PathBuf {
        self.path("capture")
    }

    pub(crate) fn table(&self) -> PathBuf {
        self.capture().join("photographs.csv")
    }

    /// The first exposure of a pattern.
    pub(crate) fn photograph(&self, position: usize, pattern: &str) -> PathBuf {
        let stem = self.capture().join(format!("photographs/p{position:03}/{pattern}_e0"));
        ["png", "exr"].map(|extension| stem.with_extension(extension)).into_iter().find(|path| path.exists()).unwrap()
    }

    /// Puts other bytes in the place of a photograph, with their checksum in the table.
    pub(crate) fn replace_photograph(&self, position: usize, pattern: &str, bytes: &[u8]) -> PathBuf {
        let path = self.photograph(position, pattern);
        let old = sha256(&fs::read(&path).unwrap());
        fs::write(&path, bytes).unwrap();
        self.edit("photographs.csv", |text| text.replace(&old, &sha256(bytes)));
        path
    }

    /// Changes a text file of the capture.
    pub(crate) fn edit(&self, name: &str, change: impl FnOnce(String) -> String) {
        let path = self.capture().join(name);
        let text = fs::read_to_string(&path).unwrap();
        let changed = change(text.clone());
        assert_ne!(changed, text, "{name} should have changed");
        fs::write(path, changed).unwrap();
    }

    /// Removes the rows of a pattern from the table.
    pub(crate) fn remove_row(&self, position: usize, pattern: &str) {
        let start = format!("{position},{pattern},");
        self.edit("photographs.csv", |text| {
            text.lines().filter(|line| !line.starts_with(&start)).fold(String::new(), |table, line| table + line + "\n")
        });
    }

    pub(crate) fn develop(&self, field: &Path) -> Run {
        relumine!["develop", &self.capture(), "-o", field]
    }

    /// The field of a whole capture.
    pub(crate) fn field(&self) -> PathBuf {
        let field = self.path("whole.field");
        if !field.exists() {
            self.develop(&field).succeeds();
        }
        field
    }

    /// Writes a light description; `text` lacks only the format.
    pub(crate) fn light(&self, name: &str, text: &str) -> PathBuf {
        let path = self.path(name);
        fs::write(&path, format!("format = \"relumine-light/1\"\n{text}")).unwrap();
        path
    }

    /// A constant white sky.
    pub(crate) fn sky(&self) -> PathBuf {
        self.light("sky.toml", "[environment]\nradiance = [1, 1, 1]\n")
    }

    /// Relights `field` under a light with more `words`, of a few samples if they do not say how many.
    #[track_caller]
    pub(crate) fn relit(&self, field: &Path, light: &Path, words: &[&str]) -> Image<Linear> {
        let output = self.path("relit.exr");
        let mut command: Vec<_> = ["relight", "--force"].map(Into::into).to_vec();
        command.extend([field.into(), "--light".into(), light.into(), "-o".into(), output.clone().into_os_string()]);
        command.extend(words.iter().map(Into::into));
        if !words.contains(&"--samples") {
            command.extend(["--samples".into(), "16384".into()]);
        }
        super::run(&command).succeeds();
        read(&output)
    }
}

impl Camera {
    fn extension(&self) -> &'static str {
        if matches!(self, Self::Exr) { "exr" } else { "png" }
    }

    /// The exposures of one radiance image, and the bytes of each photograph.
    fn photographs(&self, (width, height): (usize, usize), radiance: &[[f64; 3]]) -> Vec<(f64, Vec<u8>)> {
        let png = |bits: u8, encode: &dyn Fn(f64) -> f64| {
            let white = f64::from((1u32 << bits) - 1);
            let code = |value: f64| (encode(value.clamp(0.0, 1.0)) * white).round() as u16;
            let pixels = radiance.iter().map(|pixel| pixel.map(code)).collect();
            files::encode_png_counts(&Image::<Counts>::from_pixels(width, height, pixels), bits)
        };
        match self {
            Self::Png16 => vec![(1.0, png(16, &|value| value))],
            Self::Srgb8 => [1.0, 4.0].map(|t| (t, png(8, &|value| srgb_encode((t * value).min(1.0))))).to_vec(),
            Self::Exr => {
                vec![(1.0, exr_bytes((width, height), &|x, y| radiance[y * width + x].map(|value| value as f32)))]
            }
        }
    }
}

/// An EXR of any samples, NaN included, which the writers of the program refuse.
pub(crate) fn exr_bytes(size: (usize, usize), pixel: &(dyn Fn(usize, usize) -> [f32; 3] + Sync)) -> Vec<u8> {
    use exr::prelude::{Encoding, SpecificChannels, Vec2, WritableImage};
    let channels = SpecificChannels::rgb(|Vec2(x, y)| <(f32, f32, f32)>::from(pixel(x, y)));
    let mut bytes = std::io::Cursor::new(Vec::new());
    let image = exr::image::Image::from_encoded_channels(size, Encoding::UNCOMPRESSED, channels);
    image.write().non_parallel().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

/// Writes a float picture, one value a pixel.
pub(crate) fn write_exr(path: &Path, size: (usize, usize), pixel: impl Fn(usize, usize) -> [f32; 3]) {
    let pixels = (0..size.0 * size.1).map(|index| pixel(index % size.0, index / size.0)).collect();
    files::write_exr(path, &Image::<Linear>::from_pixels(size.0, size.1, pixels), ExrSample::Float, &[]).unwrap();
}

pub(crate) fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}
