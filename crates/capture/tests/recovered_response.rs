//! The response of the chess capture, recovered from its own two exposures, against the true one.
//!
//! The capture lies beside the project, in `../shared/data`; without it this test says so and passes.

use std::fs;
use std::path::Path;

use relumine_capture::{Capture, recover_response};
use relumine_radiometry::{Response, ResponseCurve};

#[test]
fn the_chess_capture_tells_its_response() {
    let chess = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/chess-capture");
    if !chess.join("capture.toml").is_file() {
        println!("skipped: {} is not there, so no response is recovered from a whole capture", chess.display());
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let text = fs::read_to_string(chess.join("capture.toml")).unwrap();
    fs::write(folder.path().join("capture.toml"), text.replace("\"response.csv\"", "\"recover\"")).unwrap();
    let table = fs::read_to_string(chess.join("photographs.csv")).unwrap();
    fs::write(folder.path().join("photographs.csv"), table).unwrap();
    let copy = |name: &str| {
        fs::create_dir_all(folder.path().join(name).parent().unwrap()).unwrap();
        fs::copy(chess.join(name), folder.path().join(name)).unwrap();
    };
    let capture = Capture::open(folder.path()).unwrap();
    capture.photographs().rows.values().flatten().for_each(|row| copy(row.file.to_str().unwrap()));
    let recovered = recover_response(&capture).unwrap();
    let Response::Curve(curve) = &recovered.response else { panic!("a curve") };
    let path = chess.join("response.csv");
    let truth = ResponseCurve::parse(&path, &fs::read_to_string(&path).unwrap()).unwrap();
    let mut largest = 0.0f64;
    for channel in 0..3 {
        for step in 0..=4000 {
            let x = (f64::from(step) / 4000.0).powi(2);
            let expected = truth.fraction(channel, x);
            if (0.05..=0.95).contains(&expected) {
                largest = largest.max((curve.fraction(channel, x) - expected).abs());
            }
        }
    }
    println!("two exposures a factor 16 apart: largest difference of f {largest:.4}, {:?}", recovered.report[1]);
    // A factor 16 leaves much to the prior: this says that it is no worse than it was.
    assert!(largest < 0.04, "{largest}");
}
