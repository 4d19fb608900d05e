//! Response files of others, of ours, and damaged ones.

use std::path::{Path, PathBuf};

use proptest::prelude::*;
use relumine_radiometry::{Linearization, Response, ResponseCurve, response_plot, srgb_encode};

#[path = "../../../fuzz/spoil.rs"]
mod spoil;
use spoil::{seeded, spoiled_text};

fn parse(text: &str) -> Result<ResponseCurve, String> {
    ResponseCurve::parse(Path::new("r.csv"), text).map_err(|error| error.to_string())
}

/// Exposures X = zᵞ of 256 codes, γ per channel.
const GAMMAS: [f64; 3] = [2.2, 2.0, 1.0];

fn exposure(channel: usize, code: usize) -> f64 {
    (code as f64 / 255.0).powf(GAMMAS[channel])
}

/// N × 3 or 3 × N numbers.
fn array(value: impl Fn(usize, usize) -> f64, tall: bool, separator: &str) -> String {
    let line = |numbers: Vec<f64>| numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(separator);
    let lines: Vec<String> = if tall {
        (0..256).map(|code| line((0..3).map(|channel| value(channel, code)).collect())).collect()
    } else {
        (0..3).map(|channel| line((0..256).map(|code| value(channel, code)).collect())).collect()
    };
    lines.join("\n") + "\n"
}

/// The curve gives every code back at its exposure.
fn is_power_laws(curve: &ResponseCurve) {
    for channel in 0..3 {
        for code in 0..256 {
            let fraction = curve.fraction(channel, exposure(channel, code));
            assert!((fraction - code as f64 / 255.0).abs() < 1e-4, "channel {channel}, code {code}: {fraction}");
        }
    }
}

#[test]
fn arrays_of_exposures_are_read_in_every_form() {
    for (tall, separator) in [(true, ","), (true, " "), (false, ", "), (false, "\t")] {
        is_power_laws(&parse(&array(exposure, tall, separator)).unwrap());
        // OpenCV and colour-hdri scale so that the middle or the end is one.
        is_power_laws(&parse(&array(|channel, code| 7.0 * exposure(channel, code), tall, separator)).unwrap());
        let log = |channel, code: usize| exposure(channel, code.max(1)).ln() + if code == 0 { -4.0 } else { 0.0 } + 1.3;
        is_power_laws(&parse(&array(log, tall, separator)).unwrap());
    }
    is_power_laws(&parse(&format!("# an array\n\n{}", array(exposure, true, ","))).unwrap());
}

#[test]
fn an_rsp_polynomial_is_read_highest_power_first() {
    // X = 0.7 z³ + 0.2 z² + 0.1 z, and with another scale; X = z.
    let curve = parse("3 0.7 0.2 0.1 0\n3 1.4 0.4 0.2 0\n1 1 0\n").unwrap();
    for i in 0..=20 {
        let z = f64::from(i) / 20.0;
        let x = 0.7 * z.powi(3) + 0.2 * z.powi(2) + 0.1 * z;
        for (channel, x) in [(0, x), (1, x), (2, z)] {
            assert!((curve.fraction(channel, x) - z).abs() < 1e-4, "channel {channel}: f({x}) for {z}");
        }
    }
}

#[test]
fn small_falls_are_levelled_and_large_ones_refused() {
    let ripple = |by: f64| array(move |c, code| exposure(c, code) + if code % 2 == 0 { by } else { 0.0 }, true, ",");
    let curve = parse(&ripple(0.01)).unwrap();
    for channel in 0..3 {
        // Lower down the ripple is larger than the exposures themselves.
        for code in (0..256).filter(|code| exposure(channel, *code) > 0.1) {
            let fraction = curve.fraction(channel, exposure(channel, code));
            assert!((fraction - code as f64 / 255.0).abs() < 0.03, "channel {channel}, code {code}: {fraction}");
        }
    }
    let error = parse(&ripple(0.2)).unwrap_err();
    assert!(error.contains("must rise from code to code"), "{error}");
    let error = parse(&array(|c, code| exposure(c, 255 - code), false, ",")).unwrap_err();
    assert!(error.contains("r.csv:1: the exposure of the highest code must be above 0"), "{error}");
}

#[test]
fn what_is_none_of_these_says_what_was_expected() {
    for (text, expected) in [
        ("", "r.csv:1: expected the header"),
        ("a,b\n1,2\n", "r.csv:1: expected the header"),
        ("1 2 3\n", "found 1 rows of 3"),
        ("2 1 0\n2 1 0\n2 1 0\n", "found 3 rows of 3"),
        ("1 1 0\n1 1 0\n1 -1 0\n", "r.csv:3: the exposure of the highest code"),
        ("1,2,3\n4,5\n", "r.csv:2: expected 3 numbers as in the first row, found 2"),
        ("1,2,3\n4,nan,6\n", "r.csv:2: expected numbers, found \"4,nan,6\""),
        ("0 1 0\n0 1 0\n0 1 0\n", "found 3 rows of 3"),
    ] {
        let error = parse(text).unwrap_err();
        assert!(error.contains(expected), "{text:?}: {error}");
    }
}

#[test]
fn a_written_curve_is_read_to_the_bit() {
    let curve = parse(&array(exposure, true, ",")).unwrap();
    assert_eq!(parse(&curve.to_csv()).unwrap(), curve);
    assert_eq!(ResponseCurve::from_rows(&curve.rows()).unwrap(), curve);
}

#[test]
fn a_plot_shows_three_lines_at_the_right_places() {
    let text: String =
        (0..=200).map(|row| f64::from(row) / 200.0).map(|x| format!("{x},{0},{0},{0}\n", srgb_encode(x))).collect();
    let curve = parse(&format!("{}\n{text}", ResponseCurve::HEADER)).unwrap();
    let plot = response_plot(&curve, Some([(0.1, 0.9); 3]), Some(("true & old", &curve)), "a <title>");
    assert!(plot.starts_with("<svg ") && plot.ends_with("</svg>\n"));
    assert!(plot.contains("a &lt;title&gt;") && plot.contains("true &amp; old"), "{plot}");
    // Three grey ones, three measured, six extrapolated ends, and five in the legend.
    assert_eq!(plot.matches("<polyline").count(), 3 + 3 + 6 + 5);
    assert!(!plot.contains("NaN") && !plot.contains("inf"), "{plot}");
    // The first red line begins at 10 % of the codes, x = 78 + 0.1 · 622.
    let red = plot.find("stroke=\"#c8372d\"").unwrap();
    let points = plot[..red].rsplit("points=\"").next().unwrap();
    assert!(points.starts_with("140.2,"), "{points}");
}

#[test]
fn the_response_of_the_chess_capture_is_read() {
    let data: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let path = data.join("chess-capture/response.csv");
    if !path.is_file() {
        println!("skipped: {} is not there", path.display());
        return;
    }
    let curve = ResponseCurve::parse(&path, &std::fs::read_to_string(&path).unwrap()).unwrap();
    assert_eq!((curve.fraction(0, 0.0), curve.fraction(2, 1.0)), (0.0, 1.0));
}

/// The curve rises, and f⁻¹ with it.
fn holds(text: &str) -> Result<(), TestCaseError> {
    match parse(text) {
        Ok(curve) => {
            for channel in 0..3 {
                let fractions: Vec<f64> = (0..=50).map(|i| curve.fraction(channel, f64::from(i) / 50.0)).collect();
                prop_assert!(fractions.is_sorted() && fractions.iter().all(|f| f.is_finite()), "{fractions:?}");
            }
            prop_assert!(parse(&curve.to_csv()).as_ref() == Ok(&curve));
            prop_assert!(!response_plot(&curve, None, None, "").contains("NaN"));
            let table = Linearization::new(&Response::Curve(curve), 0, 255);
            prop_assert!((1..=255).all(|code| table.exposure(1, code) >= table.exposure(1, code - 1)));
        }
        Err(error) => prop_assert!(error.starts_with("r.csv:"), "{error}"),
    }
    Ok(())
}

const FILES: [&str; 4] = [
    include_str!("../../../fuzz/seeds/response/rows.csv"),
    include_str!("../../../fuzz/seeds/response/hdrgen.rsp"),
    include_str!("../../../fuzz/seeds/response/exposures.csv"),
    include_str!("../../../fuzz/seeds/response/logs.txt"),
];

#[test]
fn the_seeds_are_what_they_say() {
    for file in FILES {
        parse(file).unwrap();
    }
}

proptest! {
    #![proptest_config(seeded(600))]

    #[test]
    fn a_spoiled_response_file_is_used_or_refused(text in spoiled_text(&FILES)) {
        holds(&text)?;
    }

    #[test]
    fn any_text_is_used_or_refused(text in any::<String>()) {
        holds(&text)?;
    }
}
