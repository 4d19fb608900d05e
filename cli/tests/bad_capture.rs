//! Damaged, incomplete and contradictory captures: what is lost is missing from the field, never black, and is told.

#![allow(clippy::unwrap_used)] // in helpers of tests too

mod support;

use std::fs;
use std::path::Path;

use relumine::radiometry::files;
use relumine::radiometry::{Counts, Image};
use relumine::{Coefficients, ReflectanceField};
use support::studio::{Camera, Patterns, Plan, Positions, Studio, exr_bytes, truth};
use support::{Run, leavings, missing_squares, relative_l2, relumine, shown};

/// Develops, expecting that something is lost: exit code 3, the words on stderr, and exactly these squares missing, told
/// by `inspect` and by `relight`, and everything else as it is without the loss.
#[track_caller]
fn loses(studio: &Studio, whole: &Path, words: &[&str], missing: &[(usize, usize, usize)]) -> Run {
    let field = studio.path("lossy.field");
    let run = studio.develop(&field).fails(3, words);
    assert!(run.stderr.contains(&format!("{} squares are missing", missing.len())), "{run:#?}");
    assert_eq!(missing_squares(&field), missing);

    let told = relumine!["inspect", &field];
    assert_eq!(told.code, Some(if missing.is_empty() { 0 } else { 3 }), "{told:#?}");
    assert!(told.stdout.contains(&format!("missing        {} of ", missing.len())), "{told:#?}");
    assert!(told.stdout.contains("loss "), "{told:#?}");

    let (lossy, whole) = (ReflectanceField::open(&field).unwrap(), ReflectanceField::open(whole).unwrap());
    let touched: Vec<usize> = missing.iter().map(|(position, ..)| *position).collect();
    for cell in 0..whole.cells().len() {
        if !touched.contains(&whole.cells().cell(cell).position) && !missing.is_empty() {
            assert!(lossy.transfer(cell).unwrap() == whole.transfer(cell).unwrap(), "cell {cell} has changed");
        }
    }
    let relit =
        relumine!["relight", &field, "--light", &studio.sky(), "--samples", "16384", "-o", &studio.path("lossy.exr"),];
    assert_eq!(relit.code, Some(if missing.is_empty() { 0 } else { 3 }), "{relit:#?}");
    assert!(studio.path("lossy.exr").exists(), "what can be shown is shown: {relit:#?}");
    let measure = |cells: &mut dyn Iterator<Item = usize>| cells.map(|cell| whole.cells().measure(cell)).sum::<f64>();
    let share = measure(&mut (0..whole.cells().len()).filter(|cell| lossy.is_missing(*cell)))
        / measure(&mut (0..whole.cells().len()));
    match relit.missing_percent() {
        None => assert_eq!(share, 0.0, "{relit:#?}"),
        // The sky is the same on all cells but for those that reach below the horizon.
        Some(percent) => assert!((percent / 100.0 / share - 1.0).abs() < 0.15, "{percent} % of {share}: {relit:#?}"),
    }
    run
}

/// The squares of a row comb of the default plan.
const ROW_1_0: [(usize, usize); 2] = [(0, 1), (2, 1)];

fn at(position: usize, squares: &[(usize, usize)]) -> Vec<(usize, usize, usize)> {
    squares.iter().map(|(u, v)| (position, *u, *v)).collect()
}

/// Develops, expecting that nothing comes of it: exit code 3, the words on stderr, no field.
#[track_caller]
fn is_refused(studio: &Studio, words: &[&str]) {
    let field = studio.path("refused.field");
    studio.develop(&field).fails(3, words);
    assert!(!field.exists());
}

#[test]
fn a_whole_capture_has_no_loss() {
    let studio = Studio::new(&Plan::default());
    let run = studio.develop(&studio.path("a.field")).succeeds();
    assert!(!run.stderr.contains("could not be used") && run.stdout.is_empty(), "{run:#?}");
    assert!(missing_squares(&studio.path("a.field")).is_empty());
    relumine!["inspect", &studio.path("a.field")].succeeds();
    assert!(relumine!["inspect", &studio.capture()].succeeds().stdout.contains("whole          yes"));
}

#[test]
fn a_photograph_that_is_not_on_disk_makes_its_squares_missing() {
    let studio = Studio::new(&Plan::default());
    let whole = studio.field();
    let photograph = studio.photograph(2, "row-1-0");
    fs::remove_file(&photograph).unwrap();
    loses(&studio, &whole, &[&shown(&photograph), "position 2, row-1-0"], &at(2, &ROW_1_0));
    let told = relumine!["inspect", &studio.capture()].fails(3, &["1 damaged"]);
    assert!(told.stdout.contains(&shown(&photograph)), "{told:#?}");
}

#[test]
fn a_row_that_is_not_in_the_table_makes_its_squares_missing() {
    let studio = Studio::new(&Plan::default());
    let whole = studio.field();
    studio.remove_row(0, "column-3-1");
    loses(&studio, &whole, &["position 0, column-3-1", "photographs.csv"], &at(0, &[(3, 1), (3, 3)]));
    let told = relumine!["inspect", &studio.capture()].fails(3, &["1 photographs are missing"]);
    assert!(told.stdout.contains("position 0, column-3-1"), "{told:#?}");
}

#[test]
fn a_position_without_a_black_frame_is_missing_whole() {
    let studio = Studio::new(&Plan::default());
    let whole = studio.field();
    studio.remove_row(3, "black");
    let all: Vec<_> = (0..4).flat_map(|v| (0..4).map(move |u| (u, v))).collect();
    loses(&studio, &whole, &["position 3, black"], &at(3, &all));
}

#[test]
fn a_truncated_photograph_is_lost() {
    let studio = Studio::new(&Plan::default());
    let whole = studio.field();
    let bytes = fs::read(studio.photograph(1, "row-1-0")).unwrap();
    let photograph = studio.replace_photograph(1, "row-1-0", &bytes[..bytes.len() / 2]);
    loses(&studio, &whole, &[&shown(&photograph), "not a whole PNG"], &at(1, &ROW_1_0));
}

#[test]
fn a_photograph_that_is_not_the_listed_one_is_lost() {
    let studio = Studio::new(&Plan::default());
    let whole = studio.field();
    let (other, photograph) = (studio.photograph(1, "row-3-0"), studio.photograph(1, "row-1-0"));
    fs::copy(other, &photograph).unwrap();
    loses(&studio, &whole, &[&shown(&photograph), "SHA-256"], &at(1, &ROW_1_0));
    let told = relumine!["inspect", &studio.capture()].fails(3, &["1 damaged"]);
    assert!(told.stdout.contains(&shown(&photograph)), "{told:#?}");
}

#[test]
fn a_photograph_of_another_size_is_refused() {
    let studio = Studio::new(&Plan::default());
    let bytes = files::encode_png_counts(&Image::<Counts>::black(12, 20), 16);
    let photograph = studio.replace_photograph(1, "white", &bytes);
    is_refused(&studio, &[&shown(&photograph), "20 × 12", "12 × 20"]);
}

#[test]
fn eight_bits_where_sixteen_are_promised_are_refused() {
    let studio = Studio::new(&Plan::default());
    let bytes = files::encode_png_counts(&Image::<Counts>::black(20, 12), 8);
    let photograph = studio.replace_photograph(0, "row-0-0", &bytes);
    is_refused(&studio, &[&shown(&photograph), "8-bit", "white_level"]);
}

#[test]
fn a_nan_in_a_float_photograph_loses_it() {
    let studio = Studio::new(&Plan { camera: Camera::Exr, ..Plan::default() });
    let whole = studio.field();
    let bytes = exr_bytes((20, 12), &|x, y| if (x, y) == (7, 5) { [0.1, f32::NAN, 0.1] } else { [0.1; 3] });
    let photograph = studio.replace_photograph(1, "row-1-0", &bytes);
    loses(&studio, &whole, &[&shown(&photograph), "pixel (7, 5)"], &at(1, &ROW_1_0));
}

#[test]
fn one_of_two_exposures_costs_no_square() {
    let studio = Studio::new(&Plan { camera: Camera::Srgb8, ..Plan::default() });
    let whole = studio.field();
    let photograph = studio.photograph(1, "row-1-0");
    fs::remove_file(&photograph).unwrap();
    loses(&studio, &whole, &[&shown(&photograph), "its other exposures are used"], &[]);
}

#[test]
fn a_square_of_a_list_of_positions_is_missing_alone() {
    let positions = Positions::List(vec![[0.0, 20.0], [120.0, 45.0], [240.0, 70.0]]);
    let studio = Studio::new(&Plan { positions, patterns: Patterns::Squares, ..Plan::default() });
    let whole = studio.field();
    fs::remove_file(studio.photograph(1, "square-2-3")).unwrap();
    loses(&studio, &whole, &["position 1, square-2-3"], &[(1, 2, 3)]);
    // Squares that stand alone do not suffer from each other: the others are the truth, as they were.
    let (lossy, whole) = (studio.path("lossy.field"), ReflectanceField::open(&whole).unwrap());
    let lossy = ReflectanceField::open(&lossy).unwrap();
    for cell in (0..whole.cells().len()).filter(|cell| !lossy.is_missing(*cell)) {
        let (found, expected) = (lossy.transfer(cell).unwrap(), whole.transfer(cell).unwrap());
        assert!(relative_l2(found.pixels(), expected.pixels()) < 1e-3, "cell {cell}");
    }
}

#[test]
fn a_torn_last_line_is_a_photograph_not_taken_yet() {
    let studio = Studio::new(&Plan::default());
    let whole = studio.field();
    // The last row of the table is column-3-1 of position 3; cut in the middle of its file name.
    studio.edit("photographs.csv", |text| text[..text.rfind("_e0.png").unwrap()].into());
    let lines = fs::read_to_string(studio.table()).unwrap().lines().count();
    let words = [&*format!("line {lines} is torn"), "position 3, column-3-1"];
    loses(&studio, &whole, &words, &at(3, &[(3, 1), (3, 3)]));
}

#[test]
fn a_torn_line_in_the_middle_is_refused_with_its_number() {
    let studio = Studio::new(&Plan::default());
    studio.edit("photographs.csv", |text| text.replacen("0,row-0-0,1,,,photographs", "0,row-0-0,1,,\n", 1));
    let line =
        fs::read_to_string(studio.table()).unwrap().lines().position(|line| line == "0,row-0-0,1,,").unwrap() + 1;
    is_refused(&studio, &[&format!("{}:{line}", shown(&studio.table())), "expected 7 fields"]);
}

#[test]
fn an_unknown_key_is_refused_with_the_nearest_known_one() {
    let studio = Studio::new(&Plan::default());
    studio.edit("capture.toml", |text| text.replace("half_width", "half_widht"));
    is_refused(&studio, &["capture.toml:", "unknown key `half_widht`", "did you mean `half_width`"]);
}

#[test]
fn a_value_that_cannot_be_is_refused() {
    for (from, to, word) in [
        ("squares = 4", "squares = 0", "squares"),
        ("radius_m = 2.0", "radius_m = -2.0", "radius_m"),
        ("width = 20", "width = 0", "picture"),
        ("white_level = 65535", "white_level = 0", "white_level"),
        ("scheme = \"combs\"", "scheme = \"comb\"", "scheme"),
        ("spacing = 2", "spacing = 0", "spacing"),
        ("capture/1", "capture/2", "format"),
    ] {
        let studio = Studio::new(&Plan::default());
        studio.edit("capture.toml", |text| text.replace(from, to));
        is_refused(&studio, &["capture.toml", word]);
    }
}

#[test]
fn a_row_of_a_position_or_pattern_that_is_not_set_up_is_refused_with_its_line() {
    for (row, words) in [
        ("4,black,1,,,photographs/p000/black_e0.png,\n", ["position 4", "0 to 3"]),
        ("0,square-1-1,1,,,photographs/p000/black_e0.png,\n", ["square-1-1", "\"combs\""]),
        ("0,row-4-0,1,,,photographs/p000/black_e0.png,\n", ["row-4-0", "4 × 4"]),
        ("0,row-0-2,1,,,photographs/p000/black_e0.png,\n", ["row-0-2", "4 × 4"]),
        ("0,grey,1,,,photographs/p000/black_e0.png,\n", ["grey", "black, white"]),
    ] {
        let studio = Studio::new(&Plan::default());
        studio.edit("photographs.csv", |text| text + row);
        let lines = fs::read_to_string(studio.table()).unwrap().lines().count();
        is_refused(&studio, &[&format!("{}:{lines}", shown(&studio.table())), words[0], words[1]]);
    }
}

#[test]
fn a_capture_without_table_description_or_photographs_is_refused() {
    let studio = Studio::new(&Plan::default());
    fs::rename(studio.capture().join("photographs"), studio.path("elsewhere")).unwrap();
    is_refused(&studio, &[&shown(&studio.capture()), "nothing in it can be used"]);
    fs::remove_file(studio.table()).unwrap();
    is_refused(&studio, &["photographs.csv"]);
    fs::remove_file(studio.capture().join("capture.toml")).unwrap();
    is_refused(&studio, &["capture.toml"]);
}

#[test]
fn an_impossible_option_is_wrong_usage() {
    let studio = Studio::new(&Plan::default());
    let field = studio.path("a.field");
    for level in ["1.5", "-0.1", "nan"] {
        let option = format!("--black-level={level}");
        relumine!["develop", &studio.capture(), "-o", &field, &option].fails(2, &["black-level"]);
    }
    relumine!["develop", &studio.capture()].fails(2, &["--output"]);
    relumine!["develop", &studio.capture(), "-o", &field, "--separation", "maximum"].fails(2, &["maximum"]);
    assert_eq!(leavings(&field), [""; 0]);
}

#[test]
fn squares_photographed_alone_come_out_as_they_shone() {
    // The control of all tests here: the truth goes in, and the same truth comes out of every camera.
    for (camera, tolerance) in [(Camera::Png16, 1e-3), (Camera::Exr, 1e-3), (Camera::Srgb8, 3e-2)] {
        let studio = Studio::new(&Plan { camera, patterns: Patterns::Squares, ..Plan::default() });
        let field = ReflectanceField::open(&studio.field()).unwrap();
        let square_flux = 12.0 * (2.0f64 * 0.25 / 4.0).powi(2);
        for cell in (0..field.cells().len()).step_by(5) {
            let relumine::Cell { position, u, v } = field.cells().cell(cell);
            let to_radiance = square_flux / field.cells().measure(cell);
            let found: Vec<_> =
                field.transfer(cell).unwrap().pixels().iter().map(|p| p.map(|s| s * to_radiance as f32)).collect();
            let expected: Vec<_> = (0..240).map(|i| truth(position, u, v, i % 20, i / 20).map(|s| s as f32)).collect();
            let error = relative_l2(&found, &expected);
            assert!(error < tolerance, "cell {cell}: {error}");
        }
        let dark: Coefficients = field.cells().dark();
        assert_eq!(relumine::missing_share(&field, &dark), 0.0);
    }
}
