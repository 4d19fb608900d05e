//! Captures of a painted plane with shading, interreflection and noise, in folders of their own.

#![allow(dead_code)] // each test file takes its part

use std::fmt::Write;
use std::fs;
use std::path::Path;

use relumine_capture::{Scheme, ShownPattern};
use relumine_radiometry::files::encode_png_counts;
use relumine_radiometry::{Counts, Image};
use sha2::{Digest, Sha256};

pub(crate) const WIDTH: usize = 96;
pub(crate) const HEIGHT: usize = 64;
const POSITIONS: usize = 5;
const SQUARES: usize = 6;
/// Exposures, and electrons at full scale.
const EXPOSURES: [f64; 2] = [1.0, 6.0];
const FULL_WELL: f64 = 40_000.0;
/// b.
pub(crate) const BLACK_LEVEL: f64 = 0.005;

/// What is photographed, and what goes wrong of itself.
pub(crate) struct World {
    /// Of the combs; 0 is single squares.
    pub(crate) spacing: usize,
    /// Position, the beginning of the patterns concerned, and by how many pixels the picture is shifted.
    pub(crate) moved: Option<(usize, &'static str, [f64; 2])>,
    /// Position, and by how much the lamp rises from its first photograph to its last.
    pub(crate) drift: Option<(usize, f64)>,
    /// Columns at the left that no square lights: they see only the projector's black.
    pub(crate) unlit: usize,
    /// More lines of `[camera]`.
    pub(crate) camera: &'static str,
}

impl Default for World {
    fn default() -> Self {
        Self { spacing: 3, moved: None, drift: None, unlit: 0, camera: "" }
    }
}

/// Which photograph is being taken.
#[derive(Clone, Copy)]
pub(crate) struct Place {
    pub(crate) position: usize,
    pub(crate) pattern: ShownPattern,
}

impl Place {
    pub(crate) fn is(self, position: usize, pattern: &str) -> bool {
        self.position == position && self.pattern.to_string() == pattern
    }
}

struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn gauss(&mut self) -> f64 {
        (0..12).map(|_| self.unit()).sum::<f64>() - 6.0
    }
}

/// How much of a square's light falls at the coordinate `at`, in squares: one inside, soft edges.
fn inside(square: usize, at: f64) -> f64 {
    let edge = |distance: f64| (0.5 + distance / 0.25).clamp(0.0, 1.0);
    edge(at - square as f64) * edge(square as f64 + 1.0 - at)
}

impl World {
    pub(crate) fn squares() -> Self {
        Self { spacing: 0, ..Self::default() }
    }

    fn scheme(&self) -> Scheme {
        if self.spacing == 0 { Scheme::Squares } else { Scheme::Combs { spacing: self.spacing } }
    }

    /// Radiance of every pixel under each square (v · M + u) alone at full white.
    fn by_square(&self, position: usize, [dx, dy]: [f64; 2]) -> Vec<Vec<f64>> {
        let angle = position as f64 * 1.1;
        let m = SQUARES as f64;
        let mut squares = vec![vec![0.0; WIDTH * HEIGHT]; SQUARES * SQUARES];
        for pixel in 0..WIDTH * HEIGHT {
            let (x, y) = ((pixel % WIDTH) as f64 - dx, (pixel / WIDTH) as f64 - dy);
            let (s, t) = (x / WIDTH as f64 - 0.5, y / HEIGHT as f64 - 0.5);
            let paint = 0.5 + 0.4 * (6.0 * (0.37 * x).sin() * (0.29 * y + 0.004 * x * x).sin()).tanh();
            let shading = (0.6 + 0.5 * (s * angle.cos() + t * angle.sin())).max(0.05);
            // Turned and stretched, each position in its own way; the outer squares miss the picture in part.
            let (turned, grown) = (0.25 * angle.sin(), 0.95);
            let u = m * (0.5 + grown * (s - turned * t));
            let v = m * (0.5 + grown * (t + turned * s));
            let lit = if pixel % WIDTH < self.unlit { 0.0 } else { 0.9 * shading };
            for (index, square) in squares.iter_mut().enumerate() {
                let (square_u, square_v) = (index % SQUARES, index / SQUARES);
                let direct = inside(square_u, u) * inside(square_v, v);
                let near = ((square_u as f64 + 0.5 - u).powi(2) + (square_v as f64 + 0.5 - v).powi(2)) / 8.0;
                square[pixel] = paint * lit * (direct + 0.01 * (-near).exp());
            }
        }
        squares
    }

    pub(crate) fn photographed(&self) -> Painted {
        self.photographed_with(&|_, radiance| radiance)
    }

    /// Photographs the world; `change` has the last word on the radiance of each photograph.
    pub(crate) fn photographed_with(&self, change: &dyn Fn(Place, [f64; 3]) -> [f64; 3]) -> Painted {
        let painted = Painted { folder: tempfile::tempdir().unwrap() };
        let mut table = "position,pattern,exposure_s,iso,f_number,file,sha256\n".to_string();
        let patterns: Vec<ShownPattern> =
            [ShownPattern::Black, ShownPattern::White].into_iter().chain(self.scheme().lighting(SQUARES)).collect();
        for position in 0..POSITIONS {
            let still = self.by_square(position, [0.0; 2]);
            let moved = self.moved.filter(|moved| moved.0 == position);
            let all = |squares: &[Vec<f64>]| -> Vec<f64> {
                (0..WIDTH * HEIGHT).map(|pixel| squares.iter().map(|square| square[pixel]).sum()).collect()
            };
            let shifted = moved.map(|(_, start, by)| (start, self.by_square(position, by)));
            let all_still = all(&still);
            let all_shifted = shifted.as_ref().map_or(Vec::new(), |(_, squares)| all(squares));
            fs::create_dir_all(painted.path().join(format!("photographs/p{position:03}"))).unwrap();
            for (order, pattern) in patterns.iter().enumerate() {
                let (squares, all) = match &shifted {
                    Some((start, shifted)) if pattern.to_string().starts_with(start) => (shifted, &all_shifted),
                    _ => (&still, &all_still),
                };
                let time = order as f64 / (patterns.len() - 1) as f64;
                let drift = self.drift.filter(|drift| drift.0 == position).map_or(0.0, |drift| drift.1);
                let lamp = 1.0 + drift * (time - 0.5);
                let lit: Vec<usize> =
                    pattern.lit(SQUARES, self.spacing.max(1)).into_iter().map(|(u, v)| v * SQUARES + u).collect();
                let radiance: Vec<[f64; 3]> = (0..WIDTH * HEIGHT)
                    .map(|pixel| {
                        let shown: f64 = lit.iter().map(|index| squares[*index][pixel]).sum();
                        // Where no square shines, the card beside the object still sees the projector's black.
                        let black = if pixel % WIDTH < self.unlit { 0.1 } else { BLACK_LEVEL * all[pixel] };
                        let radiance = lamp * (black + (1.0 - BLACK_LEVEL) * shown);
                        change(Place { position, pattern: *pattern }, [radiance, 0.9 * radiance, 0.8 * radiance])
                    })
                    .collect();
                for (index, exposure) in EXPOSURES.iter().enumerate() {
                    let mut random = Random(((position * 1000 + order) * 10 + index) as u64 ^ 0x9e37_79b9_7f4a_7c15);
                    let count = |value: f64, random: &mut Random| {
                        let x = value * exposure;
                        let noise = random.gauss() * (x / FULL_WELL + (5.0 / FULL_WELL).powi(2)).sqrt();
                        ((x + noise).clamp(0.0, 1.0) * 65035.0 + 500.0).round() as u16
                    };
                    let pixels = radiance.iter().map(|pixel| pixel.map(|value| count(value, &mut random))).collect();
                    let bytes = encode_png_counts(&Image::<Counts>::from_pixels(WIDTH, HEIGHT, pixels), 16);
                    let file = format!("photographs/p{position:03}/{pattern}_e{index}.png");
                    fs::write(painted.path().join(&file), &bytes).unwrap();
                    let sum: String = Sha256::digest(&bytes).iter().map(|byte| format!("{byte:02x}")).collect();
                    writeln!(table, "{position},{pattern},{exposure},,,{file},{sum}").unwrap();
                }
            }
        }
        fs::write(painted.path().join("photographs.csv"), table).unwrap();
        let patterns = match self.scheme() {
            Scheme::Squares => "scheme = \"squares\"".to_string(),
            Scheme::Combs { spacing } => format!("scheme = \"combs\"\nspacing = {spacing}"),
        };
        let setup = format!(
            "format = \"relumine-capture/1\"\n[hemisphere]\nradius_m = 2.0\nazimuths = {POSITIONS}\ntilts = 1\n[projector]\n\
             squares = {SQUARES}\nhalf_width = 0.3\n[patterns]\n{patterns}\n[camera]\nwidth = {WIDTH}\nheight = {HEIGHT}\n\
             black_level = 500\nwhite_level = 65535\n{}\n",
            self.camera
        );
        fs::write(painted.path().join("capture.toml"), setup).unwrap();
        painted
    }
}

/// A capture in a folder of its own.
pub(crate) struct Painted {
    folder: tempfile::TempDir,
}

/// A line of the table without its checksum; the header as it is.
pub(crate) fn without_sum(line: &str) -> String {
    match line.rsplit_once(',') {
        Some((rest, sum)) if sum.len() == 64 => format!("{rest},"),
        _ => line.into(),
    }
}

impl Painted {
    pub(crate) fn path(&self) -> &Path {
        self.folder.path()
    }

    /// A capture with the same photographs and a table of its own.
    pub(crate) fn copy(&self) -> Self {
        let copy = Self { folder: tempfile::tempdir().unwrap() };
        for position in 0..POSITIONS {
            let folder = format!("photographs/p{position:03}");
            fs::create_dir_all(copy.path().join(&folder)).unwrap();
            for entry in fs::read_dir(self.path().join(&folder)).unwrap() {
                let entry = entry.unwrap();
                fs::hard_link(entry.path(), copy.path().join(&folder).join(entry.file_name())).unwrap();
            }
        }
        for name in ["capture.toml", "photographs.csv"] {
            fs::copy(self.path().join(name), copy.path().join(name)).unwrap();
        }
        copy
    }

    pub(crate) fn edit(&self, change: impl FnOnce(String) -> String) {
        let path = self.path().join("photographs.csv");
        let text = fs::read_to_string(&path).unwrap();
        let changed = change(text.clone());
        assert_ne!(changed, text, "the table should have changed");
        fs::write(path, changed).unwrap();
    }

    /// Puts other files into the places of files; checksums are left out.
    fn rename(&self, to: &dyn Fn(&str) -> String) {
        self.edit(|table| {
            let line = |line: &str| {
                let fields: Vec<&str> = line.split(',').collect();
                let renamed = to(fields[5]);
                if renamed == fields[5] {
                    format!("{line}\n")
                } else {
                    format!("{},{renamed},\n", fields[..5].join(","))
                }
            };
            table.lines().map(line).collect()
        });
    }

    pub(crate) fn exchange_files(&self, a: &str, b: &str) {
        self.rename(&|file| {
            let pair = [(a, b), (b, a)].into_iter().find(|(from, _)| file.contains(from));
            pair.map_or(file.into(), |(from, to)| file.replace(from, to))
        });
    }

    /// All exposures of two patterns.
    pub(crate) fn exchange(&self, position: usize, a: &str, b: &str) {
        let name = |pattern: &str| format!("p{position:03}/{pattern}_");
        self.exchange_files(&name(a), &name(b));
    }

    /// One photograph is listed in the place of another.
    pub(crate) fn replace_file(&self, place: &str, by: &str) {
        let from = fs::read(self.path().join(format!("photographs/{by}.png"))).unwrap();
        let path = self.path().join(format!("photographs/{place}.png"));
        fs::remove_file(&path).unwrap();
        fs::write(path, from).unwrap();
        self.edit(|table| table.lines().map(|line| without_sum(line) + "\n").collect());
    }

    pub(crate) fn replace(&self, position: usize, pattern: &str, by: &str) {
        for exposure in 0..EXPOSURES.len() {
            let from = fs::read(self.path().join(format!("photographs/p{position:03}/{by}_e{exposure}.png"))).unwrap();
            let path = self.path().join(format!("photographs/p{position:03}/{pattern}_e{exposure}.png"));
            // It may be linked from another capture.
            fs::remove_file(&path).unwrap();
            fs::write(path, from).unwrap();
        }
        self.edit(|table| table.lines().map(|line| without_sum(line) + "\n").collect());
    }

    /// The same pattern of another position stands in the place.
    pub(crate) fn replace_from(&self, position: usize, pattern: &str, other: usize) {
        for exposure in 0..EXPOSURES.len() {
            let name = |position: usize| format!("photographs/p{position:03}/{pattern}_e{exposure}.png");
            let from = fs::read(self.path().join(name(other))).unwrap();
            fs::write(self.path().join(name(position)), from).unwrap();
        }
        self.edit(|table| table.lines().map(|line| without_sum(line) + "\n").collect());
    }
}
