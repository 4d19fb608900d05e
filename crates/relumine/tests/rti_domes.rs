//! Real photographs in light domes: lamps 4, 12, 20, … are left out and relit from the rest.
//!
//! The photographs lie beside the project, in `../shared/data`; without them these tests say so and pass.

#![allow(clippy::unwrap_used)] // in helpers of tests too

use std::path::Path;

use relumine::radiometry::files::{self, Picture};
use relumine::radiometry::{Image, Radiance, difference};
use relumine::{
    Coefficients, Import, ImportOptions, LampList, Light, ProjectionOptions, Reconstruction, ReflectanceField,
    Relighting, project,
};

/// Mean relative L2 of the left-out photographs, raw values, box and linear; `None` if the set is not there.
fn left_out(set: &str) -> Option<[f64; 2]> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(set).join("dirs.lp");
    if !path.exists() {
        eprintln!("skipped: {} is not there, so no real dome is relit", path.display());
        return None;
    }
    let path = path.canonicalize().unwrap();
    let lamps = LampList::read(&path).unwrap().lamps;
    let (out, kept): (Vec<_>, Vec<_>) = lamps.iter().enumerate().partition(|(index, _)| index % 8 == 4);
    let folder = tempfile::tempdir().unwrap();
    let list = folder.path().join("kept.csv");
    let rows: String = kept
        .iter()
        .map(|(_, lamp)| {
            let direction = lamp.position.direction();
            format!("{},{},{},{}\n", lamp.file.display(), direction.x, direction.y, direction.z)
        })
        .collect();
    std::fs::write(&list, format!("file,x,y,z\n{rows}")).unwrap();
    let field = folder.path().join("dome.field");
    let mut import = Import::start(&list, &field, &ImportOptions::default()).unwrap();
    for outcome in &mut import {
        assert_eq!(outcome.unwrap().missing_squares, 0);
    }
    import.finish().unwrap();
    let field = ReflectanceField::open(&field).unwrap();
    let figures = [Reconstruction::Box, Reconstruction::Linear].map(|between| {
        let lights: Vec<Coefficients> = out
            .iter()
            .map(|(_, lamp)| {
                let way = -lamp.position.direction();
                let sun = format!("direction = [{}, {}, {}]\nirradiance_w_m2 = [1, 1, 1]\n", way.x, way.y, way.z);
                let text = format!("format = \"relumine-light/1\"\n[[sun]]\n{sun}");
                let light = Light::parse(Path::new("sun.toml"), &text).unwrap();
                let options = ProjectionOptions { between, samples: 1024, ..ProjectionOptions::default() };
                project(&light, field.cells(), &options).unwrap().coefficients
            })
            .collect();
        let pictures = Relighting::new(&field, &lights).unwrap().run().unwrap();
        let errors = pictures.iter().zip(&out).map(|(relit, (_, lamp))| {
            let Picture::Integer { image, bits: 8 } = files::read_picture(&lamp.file).unwrap() else {
                panic!("a JPEG")
            };
            let pixels = image.pixels().iter().map(|pixel| pixel.map(|code| f32::from(code) / 255.0)).collect();
            let photograph = Image::<Radiance>::from_pixels(image.width(), image.height(), pixels);
            difference(relit, &photograph, None, false).unwrap().relative_l2
        });
        errors.sum::<f64>() / out.len() as f64
    });
    println!("{set}: box {:.4}, linear {:.4}", figures[0], figures[1]);
    Some(figures)
}

#[test]
fn an_ivory_lion_is_relit_as_well_as_a_plain_interpolation_does() {
    // Nearest lamp .199, barycentric .100.
    let Some([nearest, linear]) = left_out("rti_lion240") else { return };
    assert!(nearest < 0.2 && linear < 0.1, "box {nearest}, linear {linear}");
}

#[test]
fn a_painted_icon_is_relit_as_well_as_a_plain_interpolation_does() {
    // Nearest lamp .126, barycentric .038 where the other lamps surround the one left out; one of nine (.084) is not.
    let Some([nearest, linear]) = left_out("rti_icon72") else { return };
    assert!(nearest < 0.127 && linear < 0.044, "box {nearest}, linear {linear}");
}
