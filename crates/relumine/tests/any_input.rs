//! Any text gives a list of lamps that can be used, or an error that names the list: never a panic.

use std::path::Path;

use proptest::prelude::*;
use relumine::basis::{Layout, Partition};
use relumine::{Error, ExposureList, LampList};

#[path = "../../../fuzz/spoil.rs"]
mod spoil;
use spoil::{seeded, spoiled_text};

const LP: [&str; 2] = [
    "3\nphotos/one 1.jpg 0.1 0.2 0.9\nphotos/two.jpg -0.5 0.5 0.5\nphotos/three.jpg 0 -1 -0.01\n",
    "2\r\na.jpg 0 0 1\r\nb.jpg 1e-3 0 2\r\n",
];
const CSV: [&str; 3] = [
    "file,x,y,z\na.jpg,1,0,1\nb.jpg,0,1,-0.02\n",
    "file,x,y,z,irradiance\na.jpg,1,0,1,2\nb.jpg,0,1,0.3,1e-3\n",
    "file,azimuth_deg,tilt_deg,irradiance\na.jpg,0,45,2\nb.jpg,90,45.5,1\nc.jpg,270,90,7\n",
];
/// Directions, names and intensities, with `%` between.
const DILIGENT: [&str; 1] = ["0.1 0.2 0.97\n-0.3 0.4 0.86\n%\n001.png\n002.png\n%\n1.5 1.4 1.3\n1 1 1\n"];

const EXPOSURES: [&str; 2] = [
    "# Number of Images\n2\n# Filename 1/shutter_speed f/stop\na.png 0.03125 8 0 0\nb.png 64    8 0 0\n",
    "\"a b.jpg\" 1.5 # long\r\nc.jpg\t0.004\r\n",
];

/// Lamps stand above the horizon, their light is positive, and the patches round them are the hemisphere.
fn holds(list: &LampList) {
    assert!(!list.lamps.is_empty());
    for lamp in &list.lamps {
        let position = lamp.position;
        assert!(
            position.is_above_horizon() && (0.0..std::f64::consts::TAU).contains(&position.azimuth),
            "{position:?}"
        );
        assert!(lamp.irradiance.iter().all(|value| *value > 0.0 && value.is_finite()), "{:?}", lamp.irradiance);
    }
    let partition = Partition::new(Layout::List(list.lamps.iter().map(|lamp| lamp.position).collect()));
    if let Ok(partition) = partition {
        let whole: f64 = (0..list.lamps.len()).map(|index| partition.solid_angle(index)).sum();
        assert!((whole / std::f64::consts::TAU - 1.0).abs() < 1e-9, "the patches add to {whole} sr");
    }
}

fn try_list(list: Result<LampList, Error>) -> Result<(), String> {
    list.map(|list| holds(&list)).map_err(|error| error.to_string())
}

fn try_lp(text: &str) -> Result<(), String> {
    try_list(LampList::parse_lp(Path::new("dome/dirs.lp"), text))
}

fn try_csv(text: &str) -> Result<(), String> {
    try_list(LampList::parse_csv(Path::new("dome/dirs.csv"), text))
}

fn try_diligent(text: &str) -> Result<(), String> {
    let mut files = text.split("%\n");
    let (directions, names) = (files.next().unwrap_or_default(), files.next().unwrap_or_default());
    try_list(LampList::parse_diligent(Path::new("dome"), directions, names, files.next()))
}

proptest! {
    #![proptest_config(seeded(400))]

    #[test]
    fn a_spoiled_lp_file_is_used_or_refused(text in spoiled_text(&LP)) {
        if let Err(error) = try_lp(&text) {
            prop_assert!(error.starts_with("dome/dirs.lp: "), "{error}");
        }
    }

    #[test]
    fn a_spoiled_csv_file_is_used_or_refused(text in spoiled_text(&CSV)) {
        if let Err(error) = try_csv(&text) {
            prop_assert!(error.starts_with("dome/dirs.csv: "), "{error}");
        }
    }

    #[test]
    fn a_spoiled_diligent_folder_is_used_or_refused(text in spoiled_text(&DILIGENT)) {
        if let Err(error) = try_diligent(&text) {
            prop_assert!(error.starts_with("dome/light_directions.txt: "), "{error}");
        }
    }

    #[test]
    fn a_spoiled_list_of_exposures_is_used_or_refused(text in spoiled_text(&EXPOSURES), reciprocal in any::<bool>()) {
        match ExposureList::parse(Path::new("set/list.txt"), &text, reciprocal) {
            Ok(list) => {
                for (file, exposure) in &list.photographs {
                    prop_assert!(file.starts_with("set") || file.is_absolute(), "{file:?}");
                    prop_assert!(*exposure > 0.0 && exposure.is_finite(), "{exposure}");
                }
            }
            Err(error) => {
                let error = error.to_string();
                prop_assert!(error.starts_with("set/list.txt:"), "{error}");
            }
        }
    }

    #[test]
    fn any_text_is_used_or_refused(text in any::<String>()) {
        for (result, path) in [
            (try_lp(&text), "dome/dirs.lp: "),
            (try_csv(&text), "dome/dirs.csv: "),
            (try_diligent(&text), "dome/light_directions.txt: "),
        ] {
            if let Err(error) = result {
                prop_assert!(error.starts_with(path), "{error}");
            }
        }
    }

    #[test]
    fn directions_of_any_size_are_used_or_refused(
        directions in proptest::collection::vec(proptest::array::uniform3(proptest::num::f64::ANY), 1..20)
    ) {
        let lines: String = directions.iter().map(|[x, y, z]| format!("a {x} {y} {}\n", z.abs())).collect();
        if let Err(error) = try_lp(&format!("{}\n{lines}", directions.len())) {
            prop_assert!(error.starts_with("dome/dirs.lp: "), "{error}");
        }
    }
}

#[test]
fn the_valid_texts_are_read() {
    for text in LP {
        try_lp(text).expect("a list");
    }
    for text in CSV {
        try_csv(text).expect("a table");
    }
    for text in DILIGENT {
        try_diligent(text).expect("a folder");
    }
}

#[test]
fn a_list_announces_as_many_as_it_likes() {
    let error = try_lp("18446744073709551615\na.jpg 0 0 1\n").expect_err("one is not so many");
    assert!(error.contains("are announced, but 1 are listed"), "{error}");
    let many: String = (0..5000).map(|i| format!("a {} 0 1\n", f64::from(i) * 1e-4)).collect();
    assert!(try_lp(&format!("5000\n{many}")).is_err_and(|error| error.contains("more than 4096 lamps")));
}
