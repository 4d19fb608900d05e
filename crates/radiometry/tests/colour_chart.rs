//! Charts photographed by a virtual camera are found, measured and corrected to what they are; so are two real ones.

#![allow(clippy::unwrap_used)] // in helpers of tests too

use std::path::{Path, PathBuf};

use relumine_radiometry as radiometry;
use relumine_radiometry::Response;
use relumine_radiometry::colour::space::inverse;
use relumine_radiometry::colour::{
    Chart, ColourFit, Correction, Illuminant, Measurement, Model, Photograph, Reference, measure,
};
use relumine_radiometry::files::{Picture, read_picture};

#[path = "support/chart.rs"]
mod virtual_chart;
use virtual_chart::{CORNERS, CROSSTALK, Scene, display_codes};

fn linear(scene: &Scene, chart: &Chart, reference: &Reference) -> Photograph {
    Photograph::new(&Picture::Float(scene.photograph(chart, reference)), &Response::Linear, 0, None).unwrap()
}

fn colorchecker() -> (Chart, Reference) {
    (Chart::colorchecker_24(), Reference::colorchecker_24())
}

fn farthest(a: [[f64; 2]; 4], b: [[f64; 2]; 4]) -> f64 {
    a.iter().zip(&b).map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1])).fold(0.0, f64::max)
}

fn mean(fit: &ColourFit) -> (f64, f64, f64) {
    let of = |error: fn(&radiometry::colour::PatchFit) -> f64| fit.errors(error).mean;
    (of(|patch| patch.error_before), of(|patch| patch.error_after), of(|patch| patch.error_held_out))
}

#[test]
fn a_chart_is_found_however_it_is_turned_through_noise_and_uneven_light() {
    let (chart, reference) = colorchecker();
    for quarters in 0..4 {
        for (fall_off, noise) in [(0.0, 0.0), (0.5, 0.02)] {
            let scene = Scene { fall_off, noise, ..Scene::plain() }.turned(quarters);
            let found = chart.find(&linear(&scene, &chart, &reference), &reference).unwrap();
            let off = farthest(found.corners, scene.corners);
            assert!(off < 1.0, "turned {quarters}, fall-off {fall_off}: corners are off by {off} pixels");
            assert!(found.agreement > 0.88 && found.patches >= 20, "{found:?}");
        }
    }
}

#[test]
fn a_small_chart_in_a_large_photograph_is_found() {
    let (chart, reference) = colorchecker();
    let scene = Scene {
        size: [1500, 1100],
        corners: CORNERS.map(|[x, y]| [x * 0.7 + 600.0, y * 0.7 + 500.0]),
        ..Scene::plain()
    };
    let found = chart.find(&linear(&scene, &chart, &reference), &reference).unwrap();
    assert!(farthest(found.corners, scene.corners) < 2.0, "{found:?}");
}

/// Charts at any angle, near and far, looked at from the side, dim and noisy: what share of them is found.
#[test]
fn of_a_hundred_charts_hardly_one_is_missed_and_none_is_found_where_it_is_not() {
    let (chart, reference) = colorchecker();
    let (mut state, mut found_of, mut worst) = (1u64, 0, 0.0f64);
    let mut draw = |low: f64, high: f64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (state >> 11) as f64 / (1u64 << 53) as f64
    };
    for _ in 0..100 {
        // A chart 6 long and 4 high, turned in its plane, then tilted away by up to 40 degrees, at a distance of 14.
        let (turn, tilt, axis) = (draw(0.0, 360.0), draw(0.0, 40.0), draw(0.0, 360.0));
        let (length, brightness, noise, fall_off) =
            (draw(150.0, 420.0), draw(0.05, 0.8), draw(0.0, 0.03), draw(-0.4, 0.4));
        let corners = [[-3.0, -2.0], [3.0, -2.0], [3.0, 2.0], [-3.0, 2.0]].map(|[x, y]: [f64; 2]| {
            let rotate = |[x, y]: [f64; 2], degrees: f64| {
                let (sine, cosine) = f64::sin_cos(degrees.to_radians());
                [cosine * x - sine * y, sine * x + cosine * y]
            };
            let [x, y] = rotate([x, y], turn - axis);
            let (depth, x) = (14.0 + x * tilt.to_radians().sin(), x * tilt.to_radians().cos());
            let [x, y] = rotate([x, y], axis).map(|value| value * 14.0 / depth * length / 6.0);
            [320.0 + x, 260.0 + y]
        });
        let scene = Scene { size: [640, 520], corners, exposure: brightness, noise, fall_off, ..Scene::plain() };
        if let Ok(found) = chart.find(&linear(&scene, &chart, &reference), &reference) {
            found_of += 1;
            worst = worst.max(farthest(found.corners, corners) / length);
        }
    }
    eprintln!("{found_of} of 100 charts found, corners off by at most {:.1} % of the chart's length", 100.0 * worst);
    assert!(found_of >= 95, "{found_of} of 100");
    assert!(worst < 0.02, "a chart was found where it is not: {worst} of its length off");
}

#[test]
fn what_is_no_chart_is_not_found() {
    let (chart, reference) = colorchecker();
    // The same patches in another order: a lattice stands out, its colours do not agree.
    let shuffled = Chart::parse_cht(Path::new("a.cht"), "BOXES 24\nY 1 6 A D 0.885 0.885 0 0 1 1\n").unwrap();
    let table = (0..24).fold(
        String::from("BEGIN_DATA_FORMAT\nSAMPLE_ID XYZ_X XYZ_Y XYZ_Z\nEND_DATA_FORMAT\nBEGIN_DATA\n"),
        |text, index| {
            let from = &chart.patches()[(index * 7 + 5) % 24].name;
            let [x, y, z] = reference.xyz(from).unwrap().map(|value| 100.0 * value);
            text + &format!("{} {x} {y} {z}\n", chart.patches()[index].name)
        },
    ) + "END_DATA\n";
    let other = Reference::parse(Path::new("other.cie"), &table, Illuminant::D50).unwrap();
    let error = chart.find(&linear(&Scene::plain(), &shuffled, &other), &reference).unwrap_err();
    assert!(error.to_string().contains("their colours explain"), "{error}");

    let beside = Scene { corners: CORNERS.map(|[x, y]| [x + 2000.0, y]), ..Scene::plain() };
    let error = chart.find(&linear(&beside, &chart, &reference), &reference).unwrap_err();
    assert!(error.to_string().contains("was not found in the photograph"), "{error}");

    let black = Picture::Float(radiometry::Image::black(300, 200));
    let black = Photograph::new(&black, &Response::Linear, 0, None).unwrap();
    assert!(chart.find(&black, &reference).is_err());
}

#[test]
fn the_matrix_undoes_the_cameras_crosstalk() {
    let (chart, reference) = colorchecker();
    let scene = Scene::plain();
    let (measured, left_out) = measure(&linear(&scene, &chart, &reference), &chart, scene.corners).unwrap();
    assert!(left_out.is_empty());
    let fit = ColourFit::new(&measured, &reference, Model::Matrix, false).unwrap();
    let expected = inverse(&CROSSTALK).unwrap();
    let found = fit.correction.matrix().unwrap();
    for (row, expected) in found.iter().zip(&expected) {
        assert!(row.iter().zip(expected).all(|(a, b)| (a - b).abs() < 2e-3), "{found:?}\n{expected:?}");
    }
    assert!((fit.exposure * scene.exposure - 1.0).abs() < 2e-3, "{}", fit.exposure);
    let (before, after, held_out) = mean(&fit);
    assert!(before > 4.0 && after < 0.05 && held_out < 0.1, "{before} {after} {held_out}");
}

#[test]
fn stored_for_a_display_noisy_and_unevenly_lit_the_chart_is_still_corrected() {
    let (chart, reference) = colorchecker();
    let scene = Scene { fall_off: 0.2, noise: 0.02, ..Scene::plain() };
    let codes = display_codes(&scene.photograph(&chart, &reference));
    let photograph = Photograph::new(&Picture::Integer { image: codes, bits: 8 }, &Response::Srgb, 0, None).unwrap();
    let found = chart.find(&photograph, &reference).unwrap();
    let (measured, left_out) = measure(&photograph, &chart, found.corners).unwrap();
    assert!(left_out.is_empty(), "{left_out:?}");
    for model in [Model::Matrix, Model::RootPolynomial] {
        let fit = ColourFit::new(&measured, &reference, model, false).unwrap();
        let (before, after, held_out) = mean(&fit);
        eprintln!("uneven light, {}: ΔE₀₀ before {before:.2}, after {after:.2}, held out {held_out:.2}", model.name());
        assert!(before > 4.0 && after < 1.0 && held_out < 1.3, "{}: {before} {after} {held_out}", model.name());
    }
}

/// What a camera with other spectral sensitivities sees is no linear function of what the eye sees.
fn curved(colour: [f64; 3]) -> [f64; 3] {
    let [r, g, b] = [0, 1, 2].map(|k| (0..3).map(|c| CROSSTALK[k][c] * colour[c]).sum::<f64>().max(1e-4));
    [r + 0.25 * (r * g).sqrt(), g + 0.1 * (g * b).sqrt(), b + 0.2 * (r * b).sqrt()]
}

fn measured_as(reference: &Reference, gain: f64, camera: impl Fn([f64; 3]) -> [f64; 3]) -> Vec<Measurement> {
    let measured = |name: &str| {
        let camera = camera(reference.rec709(name).unwrap()).map(|value| gain * value);
        Measurement { name: name.into(), camera, pixels: 100 }
    };
    Chart::colorchecker_24().patches().iter().map(|patch| measured(&patch.name)).collect()
}

#[test]
fn a_root_polynomial_follows_what_a_matrix_cannot_at_any_exposure() {
    let reference = Reference::colorchecker_24();
    let fit = |gain, model| ColourFit::new(&measured_as(&reference, gain, curved), &reference, model, false).unwrap();
    let (matrix, roots) = (mean(&fit(1.0, Model::Matrix)), mean(&fit(1.0, Model::RootPolynomial)));
    assert!(roots.1 < 0.5 * matrix.1 && roots.2 < matrix.2, "matrix {matrix:?}, root polynomial {roots:?}");
    for model in [Model::Matrix, Model::RootPolynomial] {
        let (bright, dark) = (fit(1.0, model), fit(1.0 / 64.0, model));
        assert!((dark.exposure / bright.exposure / 64.0 - 1.0).abs() < 1e-3);
        let pairs = bright.correction.coefficients().into_iter().zip(dark.correction.coefficients());
        let off = pairs.flat_map(|(a, b)| a.iter().zip(b).map(|(a, b)| (a - b).abs())).fold(0.0, f64::max);
        assert!(off < 1e-3, "{}: the same chart six stops darker gives coefficients {off} off", model.name());
    }
}

#[test]
fn white_that_is_kept_is_neutral_to_the_last_digit() {
    let reference = Reference::colorchecker_24();
    let measured = measured_as(&reference, 0.5, |colour| {
        let [r, g, b] = curved(colour);
        [0.6 * r, g, 0.8 * b]
    });
    let neutral: Vec<&Measurement> = measured.iter().filter(|patch| patch.name.starts_with('D')).collect();
    let mean_white = neutral.iter().fold([0.0; 3], |sum: [f64; 3], patch| {
        let y = radiometry::colour::space::luminance(patch.camera);
        [0, 1, 2].map(|channel| sum[channel] + patch.camera[channel] / y / neutral.len() as f64)
    });
    let spread = |correction: &Correction| {
        let [r, g, b] = correction.apply(mean_white);
        (r / g - 1.0).abs().max((b / g - 1.0).abs())
    };
    for model in [Model::Matrix, Model::RootPolynomial] {
        let kept = ColourFit::new(&measured, &reference, model, true).unwrap();
        let free = ColourFit::new(&measured, &reference, model, false).unwrap();
        assert!(spread(&kept.correction) < 1e-12 && spread(&free.correction) > 1e-4, "{}", model.name());
        let square = |fit: &ColourFit| fit.patches.iter().map(|patch| patch.error_after.powi(2)).sum::<f64>();
        // Less freedom cannot fit better.
        assert!(square(&free) <= square(&kept) * (1.0 + 1e-6), "{}", model.name());
    }
}

#[test]
fn what_cannot_be_fitted_says_why() {
    let reference = Reference::colorchecker_24();
    let measured = measured_as(&reference, 1.0, curved);
    let fit =
        |measured: &[Measurement]| ColourFit::new(measured, &reference, Model::Matrix, false).unwrap_err().to_string();
    assert!(fit(&measured[..5]).contains("5 patches are measured and have a value in the reference, 6 are needed"));
    let grey = measured_as(&reference, 1.0, |[_, g, _]| [g, g, g]);
    assert!(fit(&grey).contains("do not tell the camera's three channels apart"), "{}", fit(&grey));
    let mut dark = measured.clone();
    dark[3].camera = [0.0; 3];
    assert!(fit(&dark).contains("patch A4 is black"));
    let error = ColourFit::new(&measured[..18], &reference, Model::Matrix, true).unwrap_err().to_string();
    assert!(error.contains("no patch of the reference is neutral"), "{error}");
}

#[test]
fn measured_beside_reference_is_a_picture_of_the_chart() {
    let (chart, reference) = colorchecker();
    let fit = ColourFit::new(&measured_as(&reference, 1.0, |colour| colour), &reference, Model::Matrix, false).unwrap();
    let picture = fit.side_by_side(&chart);
    assert_eq!(picture.width(), 1200);
    let middle = |column: f64, row: f64, third: f64| {
        let (x, y) = ((column + 0.5 + third * 0.295) / 6.0, (row + 0.5) / 4.0);
        picture.pixel((x * 1200.0) as usize, (y * picture.height() as f64) as usize)
    };
    for index in 0..24 {
        let (column, row) = (f64::from(index % 6), f64::from(index / 6));
        let [before, after, known] = [-1.0, 0.0, 1.0].map(|third| middle(column, row, third));
        let near = |a: [f32; 3], b: [f32; 3]| a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 0.01);
        assert!(near(before, known) && near(after, known), "patch {index}: {before:?} {after:?} {known:?}");
    }
    // Dark skin and black, as they are known in sRGB (115, 82, 69; 50, 50, 50), to a few codes.
    let code = |pixel: [f32; 3]| pixel.map(|value| (value * 255.0).round());
    assert!(code(middle(0.0, 0.0, 1.0)).iter().zip([115.0, 82.0, 69.0]).all(|(a, b)| (a - b).abs() < 4.0));
    assert!(code(middle(5.0, 3.0, 1.0)).iter().all(|a| (a - 50.0).abs() < 4.0));
}

/// Data beside the project; says what is missed without it.
fn shared(path: &str) -> Option<PathBuf> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(path);
    if !file.exists() {
        eprintln!("skipped: {path} is not there, so what holds of it was not tested");
    }
    file.exists().then_some(file)
}

fn decoded(path: &Path) -> Photograph {
    Photograph::new(&read_picture(path).unwrap(), &Response::Srgb, 0, None).unwrap()
}

#[test]
fn the_real_passport_is_found_upside_down_and_corrected() {
    let Some(path) = shared("cc_charts/passport.jpg") else { return };
    let (chart, reference) = colorchecker();
    let photograph = decoded(&path);
    let found = chart.find(&photograph, &reference).unwrap();
    // The outer corners of the four corner patches, read off by eye; A1 (dark skin) is at the bottom right.
    let seen = [[740.0, 338.0], [329.0, 338.0], [329.0, 69.0], [740.0, 69.0]];
    assert!(farthest(found.corners, seen) < 6.0, "{found:?}");
    let (measured, left_out) = measure(&photograph, &chart, found.corners).unwrap();
    let mut clipped: Vec<&str> = left_out.iter().map(|patch| patch.name.as_str()).collect();
    clipped.sort_unstable();
    assert_eq!(clipped, ["B1", "B3", "B6", "C4"]);
    let (before, after, held_out) = mean(&ColourFit::new(&measured, &reference, Model::Matrix, false).unwrap());
    assert!(before > 5.0 && after < 4.0 && held_out < 4.8, "{before} {after} {held_out}");
    let (_, after, _) = mean(&ColourFit::new(&measured, &reference, Model::RootPolynomial, false).unwrap());
    assert!(after < 3.5, "{after}");
}

#[test]
fn the_real_sg_is_found_and_so_are_the_24_patches_inside_it() {
    let Some(path) = shared("cc_charts/dsg.png") else { return };
    let photograph = decoded(&path);
    let (chart, reference) = colorchecker();
    let found = chart.find(&photograph, &reference).unwrap();
    // Columns E to J, rows 2 to 5 of the SG, whose patches are smaller for their distance than those of the 24.
    let seen = [[686.0, 262.0], [1245.0, 260.0], [1246.0, 627.0], [687.0, 629.0]];
    assert!(farthest(found.corners, seen) < 10.0, "{found:?}");

    let Some(table) = shared("cc_reference/ColorCheckerSG.ti2") else { return };
    let chart = Chart::colorchecker_sg();
    let reference = Reference::read(&table, Illuminant::LightestPatch).unwrap();
    let found = chart.find(&photograph, &reference).unwrap();
    let seen = [[303.0, 171.0], [1630.0, 163.0], [1634.0, 1110.0], [306.0, 1112.0]];
    assert!(farthest(found.corners, seen) < 6.0, "{found:?}");
    let (measured, left_out) = measure(&photograph, &chart, found.corners).unwrap();
    assert_eq!((measured.len(), left_out.len()), (135, 5));
    let (before, after, held_out) = mean(&ColourFit::new(&measured, &reference, Model::Matrix, false).unwrap());
    assert!(before > 6.0 && after < 5.0 && held_out < 5.2, "{before} {after} {held_out}");
}

#[test]
fn argyll_s_charts_and_tables_are_read_and_agree() {
    let Some(folder) = shared("cc_reference") else { return };
    let read = |name: &str| Reference::read(&folder.join(name), Illuminant::D50).unwrap();
    let cie = read("ColorChecker.cie");
    for (name, lab) in
        Chart::colorchecker_24().patches().iter().map(|patch| (&patch.name, cie.lab(&patch.name).unwrap()))
    {
        let built_in = Reference::colorchecker_24().lab(name).unwrap();
        assert!(lab.iter().zip(&built_in).all(|(a, b)| (a - b).abs() < 0.011), "{name}: {lab:?} {built_in:?}");
    }
    for (chart, table, built_in) in [
        ("ColorChecker.cht", "ColorChecker.ti2", Chart::colorchecker_24()),
        ("ColorCheckerSG.cht", "ColorCheckerSG.ti2", Chart::colorchecker_sg()),
        ("ColorCheckerDC.cht", "ColorCheckerDC.ti2", Chart::colorchecker_dc()),
    ] {
        let file = Chart::read_cht(&folder.join(chart)).unwrap();
        let (table, expected) = (read(table), Reference::of_chart(&file, Illuminant::D50).unwrap().unwrap());
        assert_eq!((file.patches().len(), file.grid()), (built_in.patches().len(), built_in.grid()), "{chart}");
        // Corner to corner of the patches the built-in layout is the file's, to a tenth of a patch.
        let outer =
            |chart: &Chart| [chart.patches()[0].rectangle, chart.patches()[chart.patches().len() - 1].rectangle];
        let ([a, b], [c, d]) = (outer(&built_in), outer(&file));
        let place = |from: [[f64; 4]; 2], value: f64, axis: usize| {
            (value - from[0][axis]) / (from[1][axis + 2] - from[0][axis])
        };
        for (ours, theirs) in built_in.patches().iter().zip(file.patches()) {
            assert_eq!(ours.name, theirs.name, "{chart}");
            for side in 0..4 {
                let (at, known) =
                    (place([a, b], ours.rectangle[side], side % 2), place([c, d], theirs.rectangle[side], side % 2));
                let patches = built_in.grid().unwrap()[side % 2] as f64;
                assert!((at - known).abs() * patches < 0.1, "{chart}, {}: {at} and {known}", ours.name);
            }
            let (x, y) = (table.lab(&theirs.name).unwrap(), expected.lab(&theirs.name).unwrap());
            assert!(x.iter().zip(&y).all(|(a, b)| (a - b).abs() < 0.4), "{chart}, {}: {x:?} {y:?}", theirs.name);
        }
    }
    assert_eq!(Chart::read_cht(&folder.join("ColorCheckerPassport.cht")).unwrap().patches().len(), 50);
    assert_eq!(read("ColorCheckerPassport.cie").len(), 50);
}
