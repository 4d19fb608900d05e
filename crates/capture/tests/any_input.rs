//! Any text gives a set-up or table that can be used, or an error that names the file: never a panic.

use std::path::{Component, Path};

use proptest::prelude::*;
use relumine_basis::{Cells, Reach};
use relumine_capture::{CaptureError, Photographs, Setup};

#[path = "../../../fuzz/spoil.rs"]
mod spoil;
use spoil::{seeded, spoiled, spoiled_text};

const SETUPS: [&str; 2] = [
    r#"format = "relumine-capture/1"
title = "Chess pieces"
[hemisphere]
radius_m = 4.0
azimuths = 12
tilts = 4
[projector]
squares = 8
half_width = 0.30
intensity_w_sr = 50.2655
[patterns]
scheme = "combs"
spacing = 3
[camera]
width = 192
height = 128
response = "srgb"
black_level = 12
white_level = 65535
reference_patch = [180, 4, 10, 20]
"#,
    r#"format = "relumine-capture/1"
[hemisphere]
radius_m = 2.5
positions_deg = [[15.0, 11.25], [45.0, 60], [200, 89.5], [310, 0]]
[projector]
squares = 2
half_width = 0.3
square_flux = [[1, 0.9], [0.8, 1.1]]
[patterns]
scheme = "squares"
[camera]
width = 16
height = 8
"#,
];

const TABLES: [&str; 2] = [
    "position,pattern,exposure_s,iso,f_number,file,sha256\n\
     0,black,0.0333,100,8,p/black.png,0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef\n\
     0,row-0-0,0.0333,100,8,p/a.png,\n\
     0,row-0-0,0.5,100,8,p/b.png,\n\
     3,column-2-1,0.0333,200,5.6,\"p/c,d.png\",\n",
    "position,pattern,exposure_s,iso,f_number,file,sha256\r\n\
     0,square-1-2,1,,,a.tif,\r\n0,white,2,,,b.tif,\r\n0,white,2,,,c.tif,\r\n0,black,1,,,d.t",
];

fn holds(setup: &Setup) {
    let cells = setup.cells();
    assert!((1..=Cells::MAX).contains(&cells.len()));
    // Beyond these squares under- or overflow (a_geometry_without_a_measure_is_refused).
    let plausible = matches!(cells.reach(), Reach::Near { radius_m, pattern }
        if (1e-6..1e6).contains(&radius_m) && pattern.half_width() > 1e-6)
        && (1e-9..1e9).contains(&setup.intensity_w_sr());
    for index in [0, cells.len() / 3, cells.len() - 1] {
        let cell = cells.cell(index);
        assert_eq!(cells.index(cell), index);
        if !plausible {
            continue;
        }
        let measure = cells.measure(index);
        assert!(measure > 0.0 && measure.is_finite(), "cell {index} has the measure {measure}");
        if !(1e-30..1e30).contains(&setup.square_flux(cell.u, cell.v)) {
            continue;
        }
        let factor = setup.transfer_per_radiance(cell);
        assert!(factor > 0.0 && factor.is_finite(), "cell {index} has the factor {factor}");
    }
    let (width, height) = setup.picture_size();
    assert!(width > 0 && height > 0 && width * height <= relumine_radiometry::files::MAX_PIXELS);
    let (black, white) = setup.levels();
    assert!(black < white);
}

fn try_setup(text: &str) -> Result<(), String> {
    let path = Path::new("no/such/capture.toml");
    match Setup::parse(path, text) {
        Ok(setup) => {
            holds(&setup);
            Ok(())
        }
        // A response file that is named and not there: the error is about that file.
        Err(CaptureError::Description(error)) if error.to_string().starts_with("cannot read no/such") => Ok(()),
        Err(error) => Err(error.to_string()),
    }
}

fn try_table(text: &[u8]) {
    match Photographs::parse(Path::new("photographs.csv"), text) {
        Ok(photographs) => {
            assert_eq!(photographs.is_empty(), photographs.rows.is_empty());
            for ((_, pattern), rows) in &photographs.rows {
                assert_eq!(pattern.to_string().parse(), Ok(*pattern));
                assert!(!rows.is_empty());
                let exposures: Vec<f64> = rows.iter().map(|row| row.exposure.relative()).collect();
                assert!(exposures.iter().all(|exposure| *exposure > 0.0 && exposure.is_finite()), "{exposures:?}");
                assert!(exposures.is_sorted(), "{exposures:?}");
                for row in rows {
                    assert!(row.file.components().all(|part| matches!(part, Component::Normal(_))), "{:?}", row.file);
                }
            }
        }
        Err(error) => assert!(error.to_string().starts_with("photographs.csv:"), "{error}"),
    }
}

proptest! {
    #![proptest_config(seeded(400))]

    #[test]
    fn a_spoiled_setup_is_used_or_refused(text in spoiled_text(&SETUPS)) {
        if let Err(error) = try_setup(&text) {
            prop_assert!(error.starts_with("no/such/capture.toml"), "{error}");
        }
    }

    #[test]
    fn any_text_is_no_setup(text in any::<String>()) {
        let error = try_setup(&text).expect_err("no set-up has only a few letters");
        prop_assert!(error.starts_with("no/such/capture.toml"), "{error}");
    }

    #[test]
    fn a_spoiled_table_is_used_or_refused(text in spoiled(&TABLES)) {
        try_table(&text);
    }

    #[test]
    fn any_bytes_after_the_header_are_used_or_refused(rows in proptest::collection::vec(any::<u8>(), 0..200)) {
        let header = b"position,pattern,exposure_s,iso,f_number,file,sha256\n";
        try_table(&[&header[..], &rows].concat());
        try_table(&rows);
    }

    #[test]
    fn a_table_cut_anywhere_is_the_rows_before_the_cut(at in any::<proptest::sample::Index>()) {
        let text = TABLES[0].as_bytes();
        let header = text.iter().position(|byte| *byte == b'\n').expect("a header") + 1;
        let cut = header + at.index(text.len() - header);
        let photographs = Photographs::parse(Path::new("p.csv"), &text[..cut]).expect("a torn line is no error");
        let whole = text[header..cut].iter().filter(|byte| **byte == b'\n').count();
        // A last line that lacks only its newline may count.
        prop_assert!((whole..=whole + 1).contains(&photographs.len()));
        prop_assert_eq!(photographs.torn_line.is_some(), cut > header && text[cut - 1] != b'\n' && photographs.len() == whole);
    }
}

#[test]
fn the_valid_texts_are_read() {
    for text in SETUPS {
        try_setup(text).expect("a set-up");
    }
    for text in TABLES {
        assert!(Photographs::parse(Path::new("p.csv"), text.as_bytes()).is_ok_and(|table| table.len() >= 2));
    }
}

#[test]
fn claims_are_refused_before_anything_is_made_of_them() {
    for (from, to) in [
        ("azimuths = 12", "azimuths = 9223372036854775807"),
        ("tilts = 4", "tilts = 4294967296"),
        ("squares = 8", "squares = 9223372036854775807"),
        ("spacing = 3", "spacing = 0"),
        ("width = 192", "width = 9223372036854775807"),
        ("height = 128", "height = 4294967296"),
    ] {
        let text = SETUPS[0].replace(from, to);
        assert_ne!(text, SETUPS[0]);
        let error = try_setup(&text).expect_err(to);
        assert!(error.starts_with("no/such/capture.toml: "), "{error}");
    }
    // The most cells there may be: 64 positions of 1024 × 1024 squares.
    let most = SETUPS[0].replace("azimuths = 12", "azimuths = 16").replace("squares = 8", "squares = 1024");
    try_setup(&most).expect("as many cells as there may be");
    assert!(try_setup(&most.replace("tilts = 4", "tilts = 5")).is_err());
}

#[test]
fn as_many_positions_as_a_list_may_have_are_divided_in_seconds() {
    let list = |count: usize| -> String {
        (0..count).map(|i| format!("[{}, {}], ", (i % 64) as f64 * 1e-3, 45.0 + (i / 64) as f64 * 1e-3)).collect()
    };
    let with = |list: &str| SETUPS[1].replace("[15.0, 11.25], [45.0, 60], [200, 89.5], [310, 0]", list);
    // A tight crowd; 4096 are four times as many and take sixteen times as long.
    try_setup(&with(&list(1024))).expect("a list of 1024");
    assert!(try_setup(&with(&list(4097))).is_err_and(|error| error.contains("4096")));
}

#[test]
fn a_geometry_without_a_measure_is_refused() {
    for (text, from, to) in [
        (SETUPS[0], "radius_m = 4.0", "radius_m = 1e-160"),
        (SETUPS[0], "radius_m = 4.0", "radius_m = 1e200"),
        (SETUPS[0], "half_width = 0.30", "half_width = 1e-200"),
        (SETUPS[0], "intensity_w_sr = 50.2655", "intensity_w_sr = 1e-308"),
        (SETUPS[1], "square_flux = [[1, ", "square_flux = [[1e-308, "),
    ] {
        assert!(text.contains(from));
        let error = try_setup(&text.replace(from, to)).expect_err(to);
        assert!(error.starts_with("no/such/capture.toml"), "{error}");
    }
}

#[test]
fn a_long_table_takes_no_longer_a_row() {
    let rows = |count: usize| -> Vec<u8> {
        let rows: String = (1..=count).map(|i| format!("0,black,{i},,,a.png,\n")).collect();
        format!("position,pattern,exposure_s,iso,f_number,file,sha256\n{rows}").into_bytes()
    };
    // The best of a few: another process may take the core away at any moment.
    let seconds = |text: &[u8]| {
        let goes = (0..7).map(|_| {
            let start = std::time::Instant::now();
            try_table(text);
            start.elapsed().as_secs_f64()
        });
        goes.fold(f64::INFINITY, f64::min)
    };
    let (few, many) = (rows(4_000), rows(32_000));
    let (few, many) = (seconds(&few), seconds(&many));
    assert!(many < 32.0 * few, "{few} s, and {many} s for eight times as many rows");
}
