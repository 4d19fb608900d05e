//! The files of cameras, renderers and light probes that came with the project, where they are present.

use std::fs;
use std::path::{Path, PathBuf};

use super::super::{Picture, read_picture};

/// `RELUMINE_DATA`, or the shared data beside the repository.
fn data() -> PathBuf {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    std::env::var_os("RELUMINE_DATA").map_or(beside, PathBuf::from)
}

/// All files below `folder` with this extension, in order of name; says so when there are none.
fn files(folder: &str, extension: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![data().join(folder)];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|found| found == extension) {
                found.push(path);
            }
        }
    }
    found.sort();
    if found.is_empty() {
        println!("skipped: no .{extension} files in {}", data().join(folder).display());
    }
    found
}

fn read(path: &Path) -> Picture {
    let picture = read_picture(path).unwrap_or_else(|error| panic!("{error}"));
    let (width, height) = picture.size();
    assert!(width > 1 && height > 1, "{}: {}", path.display(), picture.describe());
    picture
}

#[test]
fn photographs_are_eight_bit() {
    // Of the thousands, every seventh.
    let photographs = files("chess-capture/photographs", "png").into_iter().step_by(7);
    for path in photographs.chain(files("chess-capture/calibration", "png")).chain(files("rti_lion240", "jpg")) {
        let picture = read(&path);
        assert!(matches!(picture, Picture::Integer { bits: 8, .. }), "{}: {}", path.display(), picture.describe());
    }
}

#[test]
fn renderings_and_light_probes_are_floats_with_light_in_them() {
    let renderings = files("chess-capture", "exr");
    let probes =
        ["env_debevec_small", "env_cc0_pmndrs", "hdr_memorial", "fisheye_office"].map(|name| files(name, "hdr"));
    for path in renderings.into_iter().chain(probes.into_iter().flatten()) {
        let Picture::Float(image) = read(&path) else { panic!("{}: not float", path.display()) };
        assert!(image.pixels().as_flattened().iter().any(|sample| *sample > 0.0), "{}: black", path.display());
    }
}

#[test]
fn the_image_crate_reads_the_same_light_probes() {
    for path in files("env_debevec_small", "hdr").into_iter().chain(files("hdr_memorial", "hdr")) {
        let Picture::Float(ours) = read(&path) else { panic!("{}: not float", path.display()) };
        let decoder = image::codecs::hdr::HdrDecoder::new(std::io::BufReader::new(fs::File::open(&path).unwrap()));
        let theirs = image::DynamicImage::from_decoder(decoder.unwrap()).unwrap().into_rgb32f();
        assert!(ours.pixels().as_flattened() == theirs.as_raw(), "{}", path.display());
    }
}
