//! `relumine merge` from outside: known radiance comes back, what was not seen is marked, and what is no bracket is refused.

#![allow(clippy::unwrap_used)] // in helpers of tests too

mod support;
#[path = "../../crates/radiometry/src/files/tests/tiff_tags.rs"]
mod tiff_tags;

use std::fs;
use std::path::{Path, PathBuf};

use relumine::radiometry::files::{self, Picture, READS_CAMERA_RAW};
use relumine::radiometry::{Counts, Image};
use support::{leavings, read, relumine, shown};
use tempfile::TempDir;
use tiff_tags::{Value, tiff};

const SIZE: (usize, usize) = (60, 40);
const SECONDS: [f64; 4] = [0.03125, 0.25, 2.0, 16.0];

/// Three decades of radiance, and a lamp that no exposure sees.
fn radiance(x: usize, y: usize) -> [f64; 3] {
    if (x, y) == (50, 30) {
        return [1000.0; 3];
    }
    let grey = 10f64.powf(-2.0 + 3.0 * x as f64 / SIZE.0 as f64) * (1.0 + y as f64 / SIZE.1 as f64);
    [grey, 0.8 * grey, 0.6 * grey]
}

/// What a linear camera of 16 bits without noise counts, black at 1000, clipped at 60,000.
fn counts(seconds: f64) -> Image<Counts> {
    let (width, height) = SIZE;
    let pixel =
        |i: usize| radiance(i % width, i / width).map(|l| (1000.0 + 59_000.0 * l * seconds).min(60_000.0) as u16);
    Image::from_pixels(width, height, (0..width * height).map(pixel).collect())
}

struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(TempDir::new().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn text(&self, name: &str, text: &str) -> PathBuf {
        fs::write(self.path(name), text).unwrap();
        self.path(name)
    }

    fn png(&self, name: &str, image: &Image<Counts>, bits: u8) -> PathBuf {
        files::write_png_counts(&self.path(name), image, bits).unwrap();
        self.path(name)
    }

    /// The bracket as PNG and its list.
    fn bracket(&self) -> PathBuf {
        let mut list = format!("# a bracket\n{}\n", SECONDS.len());
        for (index, seconds) in SECONDS.into_iter().enumerate() {
            self.png(&format!("shot {index}.png"), &counts(seconds), 16);
            list += &format!("\"shot {index}.png\" {seconds} 8 0 0\n");
        }
        self.text("list.txt", &list)
    }
}

const LEVELS: [&str; 6] = ["--response", "linear", "--black-level", "1000", "--white-level", "60000"];

macro_rules! merge {
    ($($word:expr),+ $(,)?) => {
        relumine!["merge", $($word),+, LEVELS[0], LEVELS[1], LEVELS[2], LEVELS[3], LEVELS[4], LEVELS[5]]
    };
}

#[test]
fn a_list_gives_its_radiance_variance_and_mask() {
    let folder = Folder::new();
    let (list, out) = (folder.bracket(), folder.path("out.exr"));
    let (variance, mask) = (folder.path("variance.exr"), folder.path("mask.png"));
    let run = merge!["--list", &list, "-o", &out, "--variance", &variance, "--mask", &mask].succeeds();
    assert!(run.stderr.contains("shot 0.png: exposure 0.031250, ") && run.stderr.contains("% of it used"), "{run:#?}");
    assert!(run.stdout.is_empty());

    let (found, variance) = (read(&out), read(&variance));
    let Picture::Integer { image: mask, .. } = files::read_picture(&mask).unwrap() else { panic!("a float mask") };
    for y in 0..SIZE.1 {
        for x in 0..SIZE.0 {
            if (x, y) == (50, 30) {
                assert_eq!((found.pixel(x, y), mask.pixel(x, y)), ([32.0; 3], [0; 3]), "a lower bound, marked");
                assert_eq!(variance.pixel(x, y), [f32::MAX; 3]);
                continue;
            }
            assert_eq!(mask.pixel(x, y), [255; 3]);
            for (channel, truth) in radiance(x, y).into_iter().enumerate() {
                let (found, variance) =
                    (f64::from(found.pixel(x, y)[channel]), f64::from(variance.pixel(x, y)[channel]));
                // Counts were cut to whole ones, and the photographs have no other noise.
                assert!((found / truth - 1.0).abs() < 2e-3, "({x}, {y}): {found} for {truth}");
                assert!(
                    variance > 0.0 && variance.sqrt() < 0.1 * truth,
                    "({x}, {y}): σ {} of {truth}",
                    variance.sqrt()
                );
            }
        }
    }
}

#[test]
fn the_result_does_not_depend_on_threads_nor_on_the_order() {
    let folder = Folder::new();
    let list = folder.bracket();
    let reversed: Vec<_> = fs::read_to_string(&list).unwrap().lines().skip(2).map(String::from).collect();
    let reversed =
        folder.text("reversed.txt", &reversed.iter().rev().map(|line| format!("{line}\n")).collect::<String>());
    let mut outputs = Vec::new();
    for (name, list, threads) in [("a.exr", &list, "1"), ("b.exr", &list, "5"), ("c.exr", &reversed, "2")] {
        merge!["--list", list, "-o", &folder.path(name), "--threads", threads].succeeds();
        outputs.push(fs::read(folder.path(name)).unwrap());
    }
    assert!(outputs[0] == outputs[1] && outputs[0] == outputs[2]);
}

#[test]
fn reciprocal_lists_and_response_files_say_the_same() {
    let folder = Folder::new();
    let list = folder.bracket();
    let reciprocal: String = (0..SECONDS.len()).map(|i| format!("\"shot {i}.png\" {}\n", 1.0 / SECONDS[i])).collect();
    let reciprocal = folder.text("reciprocal.txt", &reciprocal);
    let response = folder.text("line.csv", "relative_exposure,red,green,blue\n0,0,0,0\n1,1,1,1\n");
    let (a, b) = (folder.path("a.hdr"), folder.path("b.hdr"));
    merge!["--list", &list, "-o", &a].succeeds();
    relumine![
        "merge",
        "--list",
        &reciprocal,
        "--reciprocal",
        "-o",
        &b,
        "--response",
        &response,
        "--black-level",
        "1000",
        "--white-level",
        "60000"
    ]
    .succeeds();
    assert_eq!(fs::read(&a).unwrap(), fs::read(&b).unwrap());
}

#[test]
fn exposures_are_measured_when_asked() {
    let folder = Folder::new();
    // The second was really 0.25 s and is said to be 0.3 s.
    let list = folder.bracket();
    let wrong = fs::read_to_string(&list).unwrap().replace(" 0.25 ", " 0.3 ");
    let wrong = folder.text("wrong.txt", &wrong);
    let (told, measured) = (folder.path("told.exr"), folder.path("measured.exr"));
    merge!["--list", &wrong, "-o", &told].succeeds();
    let run = merge!["--list", &wrong, "-o", &measured, "--refine-exposures"].succeeds();
    assert!(run.stderr.contains("measured"), "{run:#?}");
    let spread = |path: &Path| {
        // All to one scale, which a bracket does not tell.
        let picture = read(path);
        let ratios = (0..50).map(|x| f64::from(picture.pixel(x, 5)[0]) / radiance(x, 5)[0]);
        let (low, high) = ratios.fold((f64::INFINITY, 0.0f64), |(low, high), r| (low.min(r), high.max(r)));
        high / low - 1.0
    };
    assert!(spread(&told) > 0.03 && spread(&measured) < 0.006, "{} and {}", spread(&told), spread(&measured));
}

/// A TIFF of 8 bits with its exposure time in EXIF.
fn tiff_with_exif(grey: u8, time: Option<[u32; 2]>) -> Vec<u8> {
    let exif = time.map(|time| (0x829a, Value::Rationals(vec![time]))).into_iter().collect();
    tiff(&[
        (0x0100, Value::Longs(vec![8])),
        (0x0101, Value::Longs(vec![8])),
        (0x0102, Value::Shorts(vec![8, 8, 8])),
        (0x0103, Value::Shorts(vec![1])),
        (0x0106, Value::Shorts(vec![2])),
        (0x0111, Value::Offset(vec![grey; 192])),
        (0x0115, Value::Shorts(vec![3])),
        (0x0116, Value::Longs(vec![8])),
        (0x0117, Value::Longs(vec![192])),
        (0x8769, Value::Directory(exif)),
    ])
}

#[test]
fn photographs_say_their_exposures_in_exif() {
    let folder = Folder::new();
    let [a, b, c] = ["a.tif", "b.tif", "c.tif"].map(|name| folder.path(name));
    fs::write(&a, tiff_with_exif(51, Some([1, 10]))).unwrap();
    fs::write(&b, tiff_with_exif(102, Some([2, 10]))).unwrap();
    fs::write(&c, tiff_with_exif(102, None)).unwrap();
    let out = folder.path("out.exr");
    relumine!["merge", &a, &b, "-o", &out, "--response", "linear"].succeeds();
    assert!((read(&out).pixel(3, 3)[1] - 2.0).abs() < 1e-5);

    let out = folder.path("none.exr");
    relumine!["merge", &a, &c, "-o", &out].fails(3, &[&shown(&c), "exposure time in EXIF", "--list"]);
    relumine!["merge", &a, &a, "-o", &out].fails(3, &[&shown(&a), "given twice"]);
    relumine!["merge", &a, "-o", &out].fails(3, &["2 to 1024 photographs", "found 1"]);
    fs::write(&b, tiff_with_exif(102, Some([1, 10]))).unwrap();
    relumine!["merge", &a, &b, "-o", &out].fails(3, &["same exposure (0.1)"]);
    assert!(leavings(&out).is_empty());
}

#[test]
fn what_is_no_bracket_is_refused() {
    let folder = Folder::new();
    let (list, out) = (folder.bracket(), folder.path("out.exr"));
    let small = folder.png("small.png", &Image::from_pixels(2, 2, vec![[9; 3]; 4]), 16);
    let bits = folder.png("bits.png", &Image::from_pixels(60, 40, vec![[9; 3]; 2400]), 8);
    let float = folder.path("float.exr");
    merge!["--list", &list, "-o", &float].succeeds();
    for (text, words) in [
        ("\"shot 0.png\" 1\nsmall.png 2\n", vec![shown(&small), "60 × 40 was expected".into(), "2 × 2".into()]),
        ("\"shot 0.png\" 1\nbits.png 2\n", vec![shown(&bits), "16-bit".into(), "8-bit".into()]),
        ("\"shot 0.png\" 1\nfloat.exr 2\n", vec![shown(&float), "counts of 8 or 16 bits".into()]),
        ("\"shot 0.png\" 1\n\"shot 1.png\" 1\n", vec!["same exposure (1)".into()]),
        ("\"shot 0.png\" 1\n", vec!["found 1".into()]),
        ("\"shot 0.png\" 1\n\"shot 1.png\" soon\n", vec!["bad.txt:2: expected an exposure".into()]),
        ("\"shot 0.png\" 1\nmissing.png 2\n", vec!["missing.png: could not be read".into()]),
    ] {
        let bad = folder.text("bad.txt", text);
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        merge!["--list", &bad, "-o", &out].fails(3, &words);
    }
    assert!(leavings(&out).is_empty());
}

#[test]
fn a_stack_that_is_all_black_or_all_white_has_an_honest_mask() {
    let folder = Folder::new();
    for (code, shade) in [(0, 64), (255, 0)] {
        let even = Image::from_pixels(8, 8, vec![[code; 3]; 64]);
        (0..2).for_each(|i| drop(folder.png(&format!("{i}.png"), &even, 8)));
        let list = folder.text("list.txt", "0.png 1\n1.png 4\n");
        let (out, mask) = (folder.path("out.exr"), folder.path("mask.png"));
        relumine!["merge", "--list", &list, "-o", &out, "--mask", &mask, "--response", "srgb", "--force"]
            .fails(3, &["no exposure saw anything"]);
        let Picture::Integer { image, .. } = files::read_picture(&mask).unwrap() else { panic!("a float mask") };
        assert!(image.pixels().iter().all(|pixel| *pixel == [shade; 3]));
        // No response can be recovered from it either, and that is said.
        relumine!["merge", "--list", &list, "-o", &out, "--force"].fails(3, &["pixels are neither black nor clipped"]);
    }
}

#[test]
fn words_that_contradict_each_other_are_wrong_usage() {
    let folder = Folder::new();
    let (list, out) = (folder.bracket(), folder.path("out.exr"));
    merge!["--list", &list, "-o", &folder.path("out.png")].fails(2, &[".exr or .hdr"]);
    merge!["--list", &list, "-o", &out, "--mask", &folder.path("mask.exr")].fails(2, &[".png"]);
    merge!["--list", &list, "-o", &out, "--variance", &out].fails(2, &["written twice"]);
    merge!["--list", &list, "-o", &out, "--full-well", "0"].fails(2, &["--full-well"]);
    merge!["--list", &list, "-o", &out, "--camera-white-balance"].fails(1, &["camera RAW"]);
    relumine!["merge", "-o", &out].fails(2, &["PICTURES"]);
    relumine!["merge", "--list", &list, "-o", &out, "--response", "nothing.csv"].fails(1, &["nothing.csv"]);
    relumine!["merge", "--list", &list, "-o", &out, "--black-level", "9", "--white-level", "9", "--response", "srgb"]
        .fails(3, &["black level (9)"]);
    assert!(leavings(&out).is_empty());
    fs::write(&out, "mine").unwrap();
    merge!["--list", &list, "-o", &out].fails(1, &["exists already", "--force"]);
    assert_eq!(fs::read(&out).unwrap(), b"mine");
}

#[test]
fn camera_raw_without_the_feature_says_how_to_build_it() {
    if READS_CAMERA_RAW {
        println!("skipped: this program reads camera RAW");
        return;
    }
    let folder = Folder::new();
    let exif = vec![(0x829a, Value::Rationals(vec![[1, 10]]))];
    let dng = tiff(&[
        (0x0100, Value::Longs(vec![8])),
        (0x0101, Value::Longs(vec![8])),
        (0x0106, Value::Shorts(vec![32803])),
        (0x010f, Value::Text("Relumine")),
        (0x0111, Value::Offset(vec![1; 128])),
        (0x8769, Value::Directory(exif)),
        (0xc612, Value::Bytes(vec![1, 4, 0, 0])),
    ]);
    let paths = ["a.dng", "b.dng"].map(|name| folder.path(name));
    paths.iter().for_each(|path| fs::write(path, &dng).unwrap());
    let list = folder.text("list.txt", "a.dng 1\nb.dng 2\n");
    relumine!["merge", "--list", &list, "-o", &folder.path("out.exr")].fails(3, &["DNG", "--features raw"]);
}

#[test]
fn a_real_bracket_is_merged_from_its_exif() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/hdr_frobisher");
    if !folder.exists() {
        println!("skipped: {} is not there, so no real bracket was merged", folder.display());
        return;
    }
    let out = Folder::new();
    let shots = ["IMG_2600.jpg", "IMG_2601.jpg", "IMG_2602.jpg"].map(|name| folder.join(name));
    let run = relumine!["merge", &shots[0], &shots[1], &shots[2], "-o", &out.path("out.exr")].succeeds();
    assert!(run.stderr.contains("response recovered"), "{run:#?}");
    let picture = read(&out.path("out.exr"));
    assert_eq!(picture.size(), (640, 426));
    // A night view: more than three decades between the dark and the lamps.
    let mut green: Vec<f32> = picture.pixels().iter().map(|pixel| pixel[1]).filter(|value| *value > 0.0).collect();
    green.sort_by(f32::total_cmp);
    let (dark, bright) = (green[green.len() / 100], green[green.len() * 99 / 100]);
    assert!(bright / dark > 100.0, "from {dark} to {bright}");
}
