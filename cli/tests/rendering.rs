//! Pictures and fields of virtual scenes, and what photographs of them come to.

#![allow(clippy::unwrap_used)]

mod support;

use std::fs;
use std::path::{Path, PathBuf};

use support::{read, relative_l2, relumine};

const SCENE: &str = r#"format = "relumine-scene/1"
[camera]
position = [0, -4, 3]
target = [0, 0, 0.15]
horizontal_fov_deg = 16
width = 24
height = 16
[[material]]
name = "matte"
diffuse.reflectance = { checkerboard = [[0.7, 0.6, 0.5], [0.2, 0.2, 0.3]], fields = [4, 4] }
[[material]]
name = "clay"
plastic = { diffuse = [0.6, 0.3, 0.2], alpha = 0.3 }
[[object]]
material = "matte"
plane.size_m = [1.2, 1.2]
[[object]]
material = "clay"
lathe.profile_m = [[0, 0], [0.25, 0], [0.1, 0.2], [0.15, 0.4], [0, 0.5]]
"#;

/// A virtual rig without noise: 6 positions, 3 × 3 squares, each alone.
const RIG: &str = r#"format = "relumine-rig/1"
[hemisphere]
radius_m = 4.0
azimuths = 3
tilts = 2
[projector]
squares = 3
half_width = 0.25
intensity_w_sr = 50
[patterns]
scheme = "squares"
[camera]
width = 24
height = 16
exposures_s = [0.5]
[drivers]
stage = "simulated"
projector = "simulated"
camera = "simulated"
[simulated]
scene = "scene.toml"
samples = 16
bounces = 3
seed = 5
projector_black = 0.01
[simulated.sensor]
full_well_e = 1e12
read_noise_e = 0
"#;

const LIGHT: &str = "format = \"relumine-light/1\"\n[[sphere]]\ncenter = [1, -1, 2]\nradius_m = 0.3\nradiance = [20, 18, 15]\n\
                     [environment]\nradiance = [0.2, 0.3, 0.4]\n";

fn studio() -> (tempfile::TempDir, impl Fn(&str) -> PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().to_path_buf();
    for (name, text) in [("scene.toml", SCENE), ("rig.toml", RIG), ("light.toml", LIGHT)] {
        fs::write(root.join(name), text).unwrap();
    }
    (folder, move |name: &str| root.join(name))
}

#[test]
fn a_picture_its_error_and_its_mask_are_the_same_on_any_number_of_threads() {
    let (_folder, at) = studio();
    let render = |threads: &str| -> Vec<Vec<u8>> {
        let names = ["picture.exr", "error.exr", "mask.png"].map(|name| at(&format!("{threads}-{name}")));
        let [picture, error, mask] = &names;
        let (scene, light) = (at("scene.toml"), at("light.toml"));
        relumine!(
            "render",
            &scene,
            "--light",
            &light,
            "-o",
            picture,
            "--error",
            error,
            "--mask",
            mask,
            "--samples",
            "32",
            "--threads",
            threads
        )
        .succeeds();
        names.iter().map(|name| fs::read(name).unwrap()).collect()
    };
    assert!(render("1") == render("3"));
    let (picture, error) = (read(&at("1-picture.exr")), read(&at("1-error.exr")));
    assert_eq!(picture.size(), (24, 16));
    let mean = |pixels: &[[f32; 3]]| pixels.as_flattened().iter().map(|x| f64::from(*x)).sum::<f64>();
    let share = mean(error.pixels()) / mean(picture.pixels());
    assert!((0.001..0.3).contains(&share), "standard error of a pixel: {share}");
}

#[test]
fn photographs_without_noise_come_to_the_field_that_is_rendered() {
    let (_folder, at) = studio();
    relumine!(
        "render",
        &at("scene.toml"),
        "--transfer",
        &at("rig.toml"),
        "-o",
        &at("rendered.field"),
        "--samples",
        "16",
        "--bounces",
        "3",
        "--seed",
        "5"
    )
    .succeeds();
    relumine!("plan", &at("rig.toml"), &at("capture")).succeeds();
    relumine!("capture", &at("capture")).succeeds();
    relumine!("develop", &at("capture"), "-o", &at("developed.field")).succeeds();
    let relit = |field: &str| {
        let out = at(&format!("{field}.exr"));
        relumine!("relight", &at(field), "--light", &at("light.toml"), "-o", &out).succeeds();
        read(&out)
    };
    let (rendered, developed) = (relit("rendered.field"), relit("developed.field"));
    let apart = relative_l2(developed.pixels(), rendered.pixels());
    // Sixteen bits a photograph, halves in both fields.
    println!("relative L2 {apart:.2e}");
    assert!(apart < 2e-3, "{apart}");
    // Whatever the number of threads, the field is the same.
    relumine!(
        "render",
        &at("scene.toml"),
        "--transfer",
        &at("capture"),
        "-o",
        &at("again.field"),
        "--samples",
        "16",
        "--bounces",
        "3",
        "--seed",
        "5",
        "--threads",
        "1"
    )
    .succeeds();
    support::assert_same_tree(&at("again.field"), &at("rendered.field"));
    relumine!("inspect", &at("rendered.field")).succeeds();
}

#[test]
fn what_cannot_be_rendered_says_why() {
    let (_folder, at) = studio();
    let render = |scene: &Path, light: &Path, more: &[&str]| {
        let mut words: Vec<std::ffi::OsString> = vec!["render".into(), scene.into(), "--light".into(), light.into()];
        words.extend(["-o".into(), at("out.exr").into()]);
        words.extend(more.iter().map(Into::into));
        support::run(&words)
    };
    let (scene, light) = (at("scene.toml"), at("light.toml"));
    render(&at("nowhere.toml"), &light, &[]).fails(3, &["nowhere.toml", "cannot read"]);
    render(&scene, &at("nowhere.toml"), &[]).fails(3, &["nowhere.toml"]);
    render(&scene, &light, &["--size", "0x7"]).fails(2, &["640x480"]);
    render(&scene, &light, &["--mask", "mask.exr"]).fails(2, &["mask.exr", ".png"]);
    fs::write(at("typo.toml"), SCENE.replace("diffuse.reflectance", "diffuse.reflectence")).unwrap();
    render(&at("typo.toml"), &light, &[]).fails(3, &["did you mean `reflectance`"]);
    // A mosaic is light on cells.
    relumine!("render", &scene, "--transfer", &at("rig.toml"), "-o", &at("a.field"), "--samples", "1").succeeds();
    relumine!("light", &light, "--for", &at("a.field"), "-o", &at("mosaic.exr")).succeeds();
    fs::write(at("mosaic.toml"), "format = \"relumine-light/1\"\n[mosaic]\nfile = \"mosaic.exr\"\n").unwrap();
    render(&scene, &at("mosaic.toml"), &[]).fails(1, &["mosaic", "--transfer"]);
    assert!(!at("out.exr").exists());
    relumine!("render", &scene, "--transfer", &at("rig.toml"), "-o", &at("a.field")).fails(1, &["exists already"]);
}

#[test]
fn inspect_knows_scenes_and_rigs_by_what_they_say_they_are() {
    let (_folder, at) = studio();
    let said = relumine!("inspect", &at("scene.toml")).succeeds().stdout;
    assert!(said.contains("triangles and balls") && said.contains("24 × 16"), "{said}");
    assert!(relumine!("inspect", &at("rig.toml")).succeeds().stdout.contains("66 in all"));
    assert!(relumine!("inspect", &at("light.toml")).succeeds().stdout.contains("1 lamps"));
}
