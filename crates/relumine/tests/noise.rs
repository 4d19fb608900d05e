//! Noise from photograph to relit picture, on the virtual rig: measured, kept out of sums, and told.

#![allow(clippy::unwrap_used)] // in helpers of tests too

use std::fs;
use std::path::{Path, PathBuf};

use relumine::radiometry::{Image, Radiance};
use relumine::rig::drivers;
use relumine::{
    Coefficients, DevelopOptions, DevelopedReport, Development, Encoding, Light, ProjectionOptions, ReflectanceField,
    Relighting, Rig, Run, Separation, StandardErrors, field_noise, lay_out, project,
};

/// Electrons of the full well and of reading, and the exposure: those of issue 5.
const SENSOR: (f64, f64, f64) = (20_000.0, 6.0, 0.5);

fn examples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples")
}

/// The chess board, photographed with or without noise.
fn photographed(folder: &Path, scheme: &str, is_noisy: bool) -> PathBuf {
    let (full_well, read, exposure) = SENSOR;
    let (full_well, read) = if is_noisy { (full_well, read) } else { (1e10, 0.0) };
    let scene = examples().join("chess/scene.toml").canonicalize().unwrap();
    let text = format!(
        r#"format = "relumine-rig/1"
hemisphere = {{ radius_m = 4.0, azimuths = 5, tilts = 2 }}
projector = {{ squares = 7, half_width = 0.23, intensity_w_sr = 50 }}
patterns = {{ scheme = "{scheme}" }}
drivers = {{ stage = "simulated", projector = "simulated", camera = "simulated" }}

[camera]
width = 48
height = 32
response = "linear"
black_level = 1024
white_level = 65535
exposures_s = [{exposure}]

[simulated]
scene = "{}"
samples = 32
bounces = 4
projector_black = 0.002
sensor = {{ full_well_e = {full_well:e}, read_noise_e = {read} }}
"#,
        scene.display()
    );
    let name = format!("{scheme}-{is_noisy}");
    let (description, capture) = (folder.join(format!("{name}.toml")), folder.join(name));
    fs::write(&description, text).unwrap();
    lay_out(&Rig::read(&description).unwrap(), &capture, false).unwrap();
    let rig = Rig::read(&capture.join("rig.toml")).unwrap();
    Run::open(&capture, drivers::open(&rig, &capture).unwrap()).unwrap().for_each(|taken| drop(taken.unwrap()));
    capture
}

fn developed(capture: &Path, separation: Separation, encoding: Encoding) -> (ReflectanceField, Vec<DevelopedReport>) {
    let path = capture.with_extension(format!("{}.{encoding:?}.field", separation.name()));
    let options = DevelopOptions { separation, encoding, ..DevelopOptions::default() };
    let mut development = Development::start(capture, &path, &options).unwrap();
    let mut outcomes: Vec<_> = (&mut development).map(Result::unwrap).collect();
    development.finish().unwrap();
    outcomes.sort_by_key(|outcome| outcome.position);
    (ReflectanceField::open(&path).unwrap(), outcomes.into_iter().map(|outcome| outcome.report).collect())
}

const UNIFORM: &str = "format = \"relumine-light/1\"\n[environment]\nradiance = [1, 1, 1]\n";

fn lights(field: &ReflectanceField) -> Vec<Coefficients> {
    let spots = fs::read_to_string(examples().join("chess/spots.toml")).unwrap();
    let shafts = fs::read_to_string(examples().join("chess/shafts.toml")).unwrap();
    let of = |text: &str| {
        let light = Light::parse(Path::new("light.toml"), text).unwrap();
        project(&light, field.cells(), &ProjectionOptions { samples: 100_000, ..Default::default() })
            .unwrap()
            .coefficients
    };
    [UNIFORM, &spots, &shafts].into_iter().map(of).collect()
}

fn relit(field: &ReflectanceField, lights: &[Coefficients]) -> Vec<Image<Radiance>> {
    Relighting::new(field, lights).unwrap().run().unwrap()
}

/// Of noisy, true and (where given) standard error: relative L2, ratio of means, share of samples within two standard errors.
fn compared(noisy: &Image<Radiance>, still: &Image<Radiance>, error: Option<&Image<Radiance>>) -> (f64, f64, f64) {
    let (mut square, mut energy, mut sum, mut true_sum, mut within, mut seen) = (0.0, 0.0, 0.0, 0.0, 0, 0);
    for (pixel, (noisy, still)) in noisy.pixels().iter().zip(still.pixels()).enumerate() {
        if still.iter().all(|sample| *sample < 1e-5) {
            continue;
        }
        for channel in 0..3 {
            let (found, truth) = (f64::from(noisy[channel]), f64::from(still[channel]));
            square += (found - truth).powi(2);
            energy += truth * truth;
            sum += found;
            true_sum += truth;
            if let Some(error) = error {
                within += usize::from((found - truth).abs() < 2.0 * f64::from(error.pixels()[pixel][channel]));
            }
            seen += 1;
        }
    }
    assert!(seen > 1000, "the object covers {seen} samples only");
    ((square / energy).sqrt(), sum / true_sum, f64::from(within as u32) / f64::from(seen as u32))
}

#[test]
fn the_noise_of_an_unknown_camera_is_measured_on_its_photographs() {
    let folder = tempfile::tempdir().unwrap();
    let (full_well, read, exposure) = SENSOR;
    let (dark, slope) = ((read / full_well / exposure).powi(2), 1.0 / full_well / exposure);
    for scheme in ["combs", "squares"] {
        let capture = photographed(folder.path(), scheme, true);
        let (_, reports) = developed(&capture, Separation::Fitted, Encoding::Lossless);
        let (mut of_dark, mut of_light) = (0.0, 0.0);
        for report in &reports {
            let noise = report.photograph_noise.as_ref().unwrap();
            assert!(noise.is_measured && noise.has_white);
            of_dark += f64::from(noise.curve.dark()) / dark / reports.len() as f64;
            of_light += f64::from(noise.curve.at(0.5)) / (dark + 0.5 * slope) / reports.len() as f64;
            assert!(noise.black_from_white > 0.8, "the black frame is b times white here: {}", noise.black_from_white);
            // Nothing is wrong with these photographs.
            assert_eq!(report.disagreement, Some(0.0), "{scheme}");
        }
        // A common camera would have a quarter of the variance without light, half of what light adds.
        assert!((of_dark - 1.0).abs() < 0.2, "{scheme}: {of_dark} of the variance without light");
        assert!((of_light - 1.0).abs() < 0.2, "{scheme}: {of_light} of the variance at 0.5");
    }
}

#[test]
fn relit_pictures_are_right_in_sum_and_their_standard_error_covers_what_they_are_off_by() {
    let folder = tempfile::tempdir().unwrap();
    for scheme in ["combs", "squares"] {
        let [noisy, still] = [true, false].map(|is_noisy| {
            developed(&photographed(folder.path(), scheme, is_noisy), Separation::Fitted, Encoding::Lossless).0
        });
        let lights = lights(&noisy);
        let noise = field_noise(&noisy).unwrap();
        let errors = StandardErrors::new(&noisy, &noise, &lights).unwrap().run().unwrap();
        assert_eq!(errors, StandardErrors::new(&noisy, &noise, &lights).unwrap().run().unwrap());
        let pictures = relit(&noisy, &lights).into_iter().zip(relit(&still, &lights)).zip(&errors);
        for (light, ((noisy, still), error)) in ["uniform", "spots", "shafts"].into_iter().zip(pictures) {
            let (l2, ratio, within) = compared(&noisy, &still, Some(error));
            assert!((ratio - 1.0).abs() < 0.01, "{scheme}, {light}: ratio of means {ratio}");
            assert!(l2 < 0.05, "{scheme}, {light}: relative L2 {l2}");
            assert!((0.90..=0.99).contains(&within), "{scheme}, {light}: {within} within two standard errors");
        }
    }
}

#[test]
fn the_fit_is_the_best_of_the_separations_of_combs_under_every_light() {
    let folder = tempfile::tempdir().unwrap();
    let captures = [true, false].map(|is_noisy| photographed(folder.path(), "combs", is_noisy));
    let methods = [Separation::Minimum, Separation::Thresholded, Separation::Unbiased, Separation::Fitted];
    let of = methods.map(|method| {
        let [(noisy, reports), (still, _)] = [0, 1].map(|i| developed(&captures[i], method, Encoding::Lossless));
        let lights = lights(&noisy);
        let pairs = relit(&noisy, &lights).into_iter().zip(relit(&still, &lights));
        let figures: Vec<_> = pairs.map(|(noisy, still)| compared(&noisy, &still, None)).collect();
        (figures, reports)
    });
    for light in 0..3 {
        let best = of[3].0[light].0;
        for (method, (figures, _)) in methods.iter().zip(&of).take(3) {
            assert!(best < figures[light].0, "light {light}: fitted {best}, {method:?} {}", figures[light].0);
        }
    }
    // The reports say what was removed, and the plain minimum is as dark as it must be.
    assert!(of[0].0[0].1 < 0.97, "the plain minimum: {}", of[0].0[0].1);
    assert!(of[1].1.iter().all(|report| report.cut.is_some_and(|cut| cut.abs() < 1.0 && cut != 0.0)));
    assert!(of[2].1.iter().all(|report| report.bias_subtracted.is_some_and(|bias| bias > 0.0)));
    assert!(of[3].1.iter().all(|report| report.spread.is_some_and(|spread| spread.abs() < 0.1)));
    for (_, reports) in &of {
        assert!(reports.iter().all(|report| report.disagreement == Some(0.0)), "noise alone contradicts nothing");
    }
}

#[test]
fn a_field_that_does_not_carry_its_noise_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let capture = photographed(folder.path(), "combs", true);
    for (separation, encoding, reason) in [
        (Separation::Minimum, Encoding::Lossless, "\"minimum\""),
        (Separation::Fitted, Encoding::Packed(0.05), "packing"),
    ] {
        let (field, _) = developed(&capture, separation, encoding);
        let error = field_noise(&field).unwrap_err().to_string();
        assert!(error.contains(reason) && error.contains("uncertain"), "{error}");
    }
}

#[test]
fn a_photograph_of_another_exposure_than_listed_still_contradicts() {
    let folder = tempfile::tempdir().unwrap();
    let capture = photographed(folder.path(), "combs", true);
    let table = capture.join("photographs.csv");
    let text = fs::read_to_string(&table).unwrap();
    // The white frame of position 3 is said to have been exposed half as long as it was.
    let changed: String = text
        .lines()
        .map(|line| if line.starts_with("3,white,0.5,") { line.replacen("0.5", "0.25", 1) } else { line.into() } + "\n")
        .collect();
    assert_ne!(text, changed);
    fs::write(&table, changed).unwrap();
    let (_, reports) = developed(&capture, Separation::Fitted, Encoding::Lossless);
    for (position, report) in reports.iter().enumerate() {
        let disagreement = report.disagreement.unwrap();
        assert_eq!(disagreement > 0.2, position == 3, "position {position}: {disagreement}");
    }
}
