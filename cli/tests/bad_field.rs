//! Damaged fields and lights, and outputs that cannot be: nothing is shown that was not measured, nothing is overwritten.

#![allow(clippy::unwrap_used)] // in helpers of tests too

mod support;

use std::fs;
use std::path::{Path, PathBuf};

use relumine::{ReflectanceField, Relighting};
use support::studio::{Plan, Studio, exr_bytes, write_exr};
use support::{Numbers, assert_same_tree, flip_bit, leavings, read, relative_l2, relumine, shown, tree};

/// A field, and the shard of one of its positions.
fn field_and_shard() -> (Studio, PathBuf, PathBuf) {
    let studio = Studio::new(&Plan::default());
    let field = studio.field();
    let shard = field.join("transfer/c/1/0/0/0/0/0");
    assert!(shard.exists());
    (studio, field, shard)
}

/// Relights and expects that the damage is found: exit code 3, the words on stderr, no picture.
#[track_caller]
fn relight_finds(studio: &Studio, field: &Path, words: &[&str]) {
    let output = studio.path("damaged.exr");
    relumine!["relight", field, "--light", &studio.sky(), "--samples", "4096", "-o", &output].fails(3, words);
    assert_eq!(leavings(&output), [""; 0]);
}

/// Inspects and expects that the file is listed as damage.
#[track_caller]
fn inspect_lists(field: &Path, file: &str, what: &str) {
    let told = relumine!["inspect", field];
    assert_eq!(told.code, Some(3), "{told:#?}");
    assert!(told.stdout.contains(&format!("damage         {file}: {what}")), "{told:#?}");
    assert!(told.stderr.contains("1 files are damaged"), "{told:#?}");
}

#[test]
fn a_flipped_bit_in_a_block_is_found() {
    let (studio, field, shard) = field_and_shard();
    flip_bit(&shard, 200, 3);
    relight_finds(&studio, &field, &[&shown(&shard), "damaged"]);
    inspect_lists(&field, "transfer/c/1/0/0/0/0/0", "changed");
}

#[test]
fn a_flipped_bit_in_the_index_of_a_shard_is_found() {
    let (studio, field, shard) = field_and_shard();
    flip_bit(&shard, fs::metadata(&shard).unwrap().len() as usize - 40, 0);
    relight_finds(&studio, &field, &[&shown(&shard), "checksum of its index"]);
    inspect_lists(&field, "transfer/c/1/0/0/0/0/0", "changed");
}

#[test]
fn no_flipped_bit_of_a_shard_shows_another_picture() {
    let (studio, field, shard) = field_and_shard();
    let open = ReflectanceField::open(&field).unwrap();
    let mut light = open.cells().dark();
    light.values_mut().fill([1.0, 0.5, 0.25]);
    let lights = [light];
    let relit = || Relighting::new(&open, &lights).and_then(Relighting::run);
    let (whole, bytes) = (relit().unwrap(), fs::read(&shard).unwrap());
    let (mut numbers, mut found) = (Numbers(1), 0);
    for _ in 0..400 {
        let (byte, bit) = (numbers.below(bytes.len()), numbers.below(8) as u8);
        flip_bit(&shard, byte, bit);
        match relit() {
            // zstd has a few bits in its headers that mean nothing.
            Ok(pictures) => assert!(pictures == whole, "bit {bit} of byte {byte} changed the picture"),
            Err(error) => {
                assert!(error.to_string().contains(&shown(&shard)), "{error}");
                found += 1;
            }
        }
        fs::write(&shard, &bytes).unwrap();
    }
    assert!(found > 390, "{found} of 400 flipped bits were found");
    drop(studio);
}

#[test]
fn a_shard_that_was_deleted_is_not_black() {
    let (studio, field, shard) = field_and_shard();
    fs::remove_file(&shard).unwrap();
    relight_finds(&studio, &field, &[&shown(&shard)]);
    inspect_lists(&field, "transfer/c/1/0/0/0/0/0", "missing");
}

#[test]
fn a_truncated_or_grown_shard_is_found() {
    let (studio, field, shard) = field_and_shard();
    let bytes = fs::read(&shard).unwrap();
    let grown = [&bytes[..], &bytes[..]].concat();
    for other in [&bytes[..bytes.len() / 2], &bytes[..20], &[], &grown] {
        fs::write(&shard, other).unwrap();
        if other.len() < bytes.len() {
            relight_finds(&studio, &field, &[&shown(&shard)]);
        }
        inspect_lists(&field, "transfer/c/1/0/0/0/0/0", "changed");
    }
}

#[test]
fn a_flipped_bit_in_the_metadata_is_found() {
    let studio = Studio::new(&Plan::default());
    fs::remove_file(studio.photograph(1, "row-1-0")).unwrap();
    let field = studio.path("lossy.field");
    studio.develop(&field).fails(3, &["row-1-0"]);
    let metadata = field.join("zarr.json");
    let text = fs::read_to_string(&metadata).unwrap();
    let digit_after = |words: &str| {
        let value = text.find(words).unwrap_or_else(|| panic!("no {words:?} in {text}")) + words.len();
        value + text[value..].find(|letter: char| ('2'..='9').contains(&letter)).unwrap()
    };
    // What still reads as metadata is the danger: another scale shines brighter, another radius takes light elsewhere,
    // and a missing cell by another name is a black one.
    let mut believed = Vec::new();
    for place in ["{", "\"scale\":", "\"radius_m\":", "\"half_width\":", "\"missing\": [\n"] {
        let byte = if place == "{" { 0 } else { digit_after(place) };
        flip_bit(&metadata, byte, 0);
        let output = studio.path("damaged.exr");
        let run = relumine!["relight", &field, "--light", &studio.sky(), "--samples", "4096", "-o", &output, "--force"];
        if run.code != Some(3) || !run.stderr.contains(&shown(&metadata)) || output.exists() {
            believed.push((place, run));
        }
        let told = relumine!["inspect", &field];
        assert_eq!(told.code, Some(3), "{told:#?}");
        assert!(format!("{}{}", told.stdout, told.stderr).contains("zarr.json"), "{told:#?}");
        fs::write(&metadata, &text).unwrap();
    }
    assert!(believed.is_empty(), "relit from damaged metadata: {believed:#?}");
}

#[test]
fn a_field_without_one_of_its_files_is_damaged() {
    let (studio, field, _) = field_and_shard();
    for file in ["zarr.json", "transfer/zarr.json"] {
        let bytes = fs::read(field.join(file)).unwrap();
        fs::remove_file(field.join(file)).unwrap();
        relight_finds(&studio, &field, &[&shown(&field.join(file))]);
        assert_eq!(relumine!["inspect", &field].code, Some(3));
        fs::write(field.join(file), bytes).unwrap();
    }
    let list = field.join("checksums.b3");
    let text = fs::read_to_string(&list).unwrap();
    fs::write(&list, &text[..100]).unwrap();
    relumine!["inspect", &field].fails(3, &[&shown(&list)]);
    fs::remove_file(&list).unwrap();
    relumine!["inspect", &field].fails(3, &[&shown(&list)]);
}

#[test]
fn a_file_that_does_not_belong_to_a_field_is_told() {
    let (_studio, field, _) = field_and_shard();
    fs::write(field.join("transfer/c/note.txt"), "mine").unwrap();
    inspect_lists(&field, "transfer/c/note.txt", "not part of the field");
}

#[test]
fn what_is_no_field_is_refused() {
    let (studio, field, _) = field_and_shard();
    let run = relumine!["relight", &studio.capture(), "--light", &studio.sky(), "-o", &studio.path("a.exr")];
    assert!(run.code != Some(0) && run.stderr.contains(&shown(&studio.capture())), "{run:#?}");
    fs::write(field.join("zarr.json"), "{\"zarr_format\": 3, \"node_type\": \"group\", \"attributes\": {}}").unwrap();
    relight_finds(&studio, &field, &[&shown(&field.join("zarr.json")), "not a reflectance field"]);
}

#[test]
fn a_nan_in_a_light_is_refused() {
    let (studio, field, _) = field_and_shard();
    // 8 × 8 is the mosaic of 2 × 2 positions with 4 × 4 squares, 8 × 4 a lat-long map.
    for (name, size) in [("mosaic.exr", (8, 8)), ("map.exr", (8, 4))] {
        let light = studio.path(name);
        fs::write(&light, exr_bytes(size, &|x, y| if (x, y) == (3, 2) { [f32::NAN; 3] } else { [1.0; 3] })).unwrap();
        let inside = match size {
            (8, 8) => studio.light("in.toml", &format!("[mosaic]\nfile = \"{name}\"\n")),
            _ => studio.light("in.toml", &format!("[environment]\nmap = \"{name}\"\n")),
        };
        let output = studio.path("nan.exr");
        for light_given in [&light, &inside] {
            relumine!["relight", &field, "--light", light_given, "-o", &output].fails(3, &[&shown(&light), "(3, 2)"]);
            relumine!["light", light_given, "--for", &field, "-o", &output].fails(3, &[&shown(&light)]);
        }
        assert_eq!(leavings(&output), [""; 0]);
    }
}

#[test]
fn an_unknown_key_of_a_light_is_refused_with_the_nearest_known_one() {
    let (studio, field, _) = field_and_shard();
    let output = studio.path("a.exr");
    for (text, words) in [
        ("[[piont]]\nposition = [0, 0, 1]\nintensity_w_sr = [1, 1, 1]\n", "did you mean `point`"),
        ("[[point]]\nposition = [0, 0, 1]\nintensity_w_s = [1, 1, 1]\n", "did you mean `intensity_w_sr`"),
        ("[environment]\nradiance = [1, 1, 1]\nrotation = 3\n", "did you mean `rotation_deg`"),
        ("[placement]\ntranslate = [1, 1, 1]\n", "did you mean `translate_m`"),
    ] {
        let light = studio.light("typo.toml", text);
        let run = relumine!["relight", &field, "--light", &light, "-o", &output];
        run.fails(3, &[&format!("{}:", shown(&light)), "unknown key", words]);
    }
    let light = studio.light("wrong.toml", "[[sun]]\ndirection = [0, 0, 0]\nirradiance_w_m2 = [1, 1, 1]\n");
    relumine!["relight", &field, "--light", &light, "-o", &output].fails(3, &[&shown(&light), "sun 0: direction"]);
    assert_eq!(leavings(&output), [""; 0]);
}

#[test]
fn a_light_for_other_cells_is_refused() {
    let (studio, field, _) = field_and_shard();
    let (light, output) = (studio.path("other.exr"), studio.path("a.exr"));
    write_exr(&light, (9, 7), |_, _| [1.0; 3]);
    let run = relumine!["relight", &field, "--light", &light, "-o", &output];
    run.fails(1, &[&shown(&light), "9 × 7", "8 × 8"]);
    let run = relumine!["relight", &field, "--light", &light, "--as", "mosaic", "-o", &output];
    run.fails(1, &[&shown(&light), "8 × 8"]);
    assert_eq!(leavings(&output), [""; 0]);
}

#[test]
fn an_output_that_exists_is_refused_and_stays_as_it_was() {
    let (studio, field, _) = field_and_shard();
    let (sky, picture) = (studio.sky(), studio.path("a.exr"));
    fs::write(&picture, "mine").unwrap();
    relumine!["relight", &field, "--light", &sky, "-o", &picture].fails(1, &[&shown(&picture), "--force"]);
    relumine!["light", &sky, "--for", &field, "-o", &picture].fails(1, &[&shown(&picture), "--force"]);
    assert_eq!(fs::read(&picture).unwrap(), b"mine");
    fs::write(studio.path("b.png"), "mine").unwrap();
    let run = relumine!["light", &sky, "--for", &field, "-o", &studio.path("b.exr")];
    run.fails(1, &[&shown(&studio.path("b.png")), "--force"]);
    assert!(!studio.path("b.exr").exists());

    let before = Studio::new(&Plan { noise: 0.001, ..Plan::default() });
    let other = before.field();
    studio.develop(&other).fails(1, &[&shown(&other), "--force"]);
    assert_same_tree(&other, &Studio::new(&Plan { noise: 0.001, ..Plan::default() }).field());
    relumine!["develop", &studio.capture(), "-o", &other, "--force"].succeeds();
    assert_same_tree(&other, &field);
    assert_eq!(leavings(&other), ["whole.field"]);

    relumine!["relight", &field, "--light", &sky, "-o", &picture, "--force"].succeeds();
    assert_eq!(read(&picture).size(), (20, 12));
}

#[test]
fn only_a_field_is_replaced_by_a_field() {
    let studio = Studio::new(&Plan::default());
    let capture = studio.capture();
    let before = tree(&capture);
    // One wrong word must not cost the photographs.
    for output in [&capture, &capture.join("photographs")] {
        let run = relumine!["develop", &capture, "-o", output, "--force"];
        assert!(run.code != Some(0) && run.stderr.contains(&shown(output)), "{run:#?}");
        assert!(tree(&capture) == before, "the capture has changed");
    }
}

#[test]
fn two_lights_in_one_call_are_two_calls() {
    let (studio, field, _) = field_and_shard();
    let spot = "[[spot]]\nposition = [1.0, 0.5, 1.5]\ntarget = [0, 0, 0]\nintensity_w_sr = [9, 8, 7]\n\
                beam_half_angle_deg = 3\ncutoff_half_angle_deg = 5\n";
    let (sky, spot) = (studio.sky(), studio.light("spot.toml", spot));
    let [a, b, c, d] = ["a.exr", "b.exr", "c.exr", "d.exr"].map(|name| studio.path(name));
    let n = "65536";
    let both = relumine!["relight", &field, "--samples", n, "--light", &sky, "--light", &spot, "-o", &a, "-o", &b];
    both.succeeds();
    relumine!["relight", &field, "--samples", n, "--light", &sky, "-o", &c].succeeds();
    relumine!["relight", &field, "--samples", n, "--light", &spot, "-o", &d].succeeds();
    assert!(relative_l2(read(&a).pixels(), read(&c).pixels()) < 1e-6);
    assert!(relative_l2(read(&b).pixels(), read(&d).pixels()) < 1e-6);
    assert!(relative_l2(read(&a).pixels(), read(&b).pixels()) > 0.1);
}

#[test]
fn words_that_contradict_themselves_are_wrong_usage() {
    let (studio, field, _) = field_and_shard();
    let (sky, a, b) = (studio.sky(), studio.path("a.exr"), studio.path("b.exr"));
    let relight = |words: &[&Path]| {
        let mut command = vec!["relight".into(), field.clone().into_os_string()];
        command.extend(words.iter().map(|word| word.as_os_str().to_os_string()));
        support::run(&command)
    };
    let [light, output] = ["--light", "-o"].map(Path::new);
    relight(&[light, &sky, light, &sky, output, &a]).fails(2, &["2 lights, but 1 outputs"]);
    relight(&[light, &sky, light, &sky, output, &a, output, &a]).fails(2, &["given twice"]);
    relight(&[light, &sky, output, &studio.path("a.jpg")]).fails(2, &["a.jpg", ".exr, .hdr, .png or .tif"]);
    relight(&[light, &sky, output, &studio.path("a")]).fails(2, &[".exr, .hdr, .png or .tif"]);
    relight(&[light, &sky, output, &b, Path::new("--samples=0")]).fails(2, &["--samples"]);
    relight(&[light, &sky, output, &b, Path::new("--object-radius=-1")]).fails(2, &["--object-radius"]);
    relumine!["light", &sky, "--for", &field, "-o", &studio.path("a.png")].fails(2, &["a.png", ".exr"]);
    assert_eq!(leavings(&studio.path("a")), [""; 0]);
}

#[test]
fn a_folder_that_is_not_there_is_named() {
    let (studio, field, _) = field_and_shard();
    let (folder, sky) = (studio.path("nowhere"), studio.sky());
    let named = &[&*shown(&folder)];
    relumine!["relight", &field, "--light", &sky, "-o", &folder.join("a.exr")].fails(1, named);
    relumine!["light", &sky, "--for", &field, "-o", &folder.join("a.exr")].fails(1, named);
    studio.develop(&folder.join("a.field")).fails(1, named);
    assert!(!folder.exists());
}
