//! What files of each format mean, on models written here; what bad ones say; and models of others, if they are there.

#![allow(clippy::unwrap_used)] // in helpers of tests too

mod any_input;
mod cube;
mod gltf_materials;
mod gltf_shapes;
mod obj;
mod others;
#[path = "../../../../../fuzz/spoil.rs"]
mod spoil;

use std::fs;
use std::path::Path;

use glam::{DAffine3, Vec2, Vec3};
use proptest::prelude::*;
use relumine_radiometry::Image;
use relumine_radiometry::files::encode_png_counts;
use tempfile::TempDir;

use super::placement::placed;
use super::{ModelError, Up, read_model};
use crate::{Mesh, Model, Part};

/// A folder with these files.
fn folder(files: &[(&str, &[u8])]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }
    folder
}

/// Reads the first of these files, which lie in one folder.
fn read(files: &[(&str, &[u8])]) -> Result<Model, ModelError> {
    let folder = folder(files);
    read_model(&folder.path().join(files[0].0), None)
}

/// What the error says behind the name of the file.
fn complaint(files: &[(&str, &[u8])]) -> String {
    let folder = folder(files);
    let path = folder.path().join(files[0].0);
    let error = read_model(&path, None).expect_err("an error").to_string();
    assert!(error.contains(&folder.path().display().to_string()), "{error}");
    error.replace(&format!("{}: ", path.display()), "").replace(&folder.path().display().to_string(), "FOLDER")
}

fn only_part(model: Model) -> Part {
    assert_eq!(model.parts.len(), 1, "{:?}", model.parts.iter().map(|part| &part.name).collect::<Vec<_>>());
    model.parts.into_iter().next().unwrap()
}

fn png(width: usize, height: usize, pixels: &[[u16; 3]]) -> Vec<u8> {
    encode_png_counts(&Image::from_pixels(width, height, pixels.to_vec()), 8)
}

fn near(a: Vec3, b: Vec3) -> bool {
    a.abs_diff_eq(b, 1e-5)
}

/// The box round all corners.
fn bounds(model: &Model) -> (Vec3, Vec3) {
    let corners = model.parts.iter().flat_map(|part| &part.mesh.positions);
    corners.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), corner| (low.min(*corner), high.max(*corner)))
}

/// What every mesh promises that comes from a file.
fn holds(model: &Model) {
    assert!(!model.parts.is_empty());
    for Part { mesh, name, .. } in &model.parts {
        let count = mesh.positions.len();
        assert!(name.chars().count() <= 80 && !mesh.triangles.is_empty());
        assert!(mesh.positions.iter().all(|position| position.is_finite()));
        assert!(mesh.normals.is_empty() || mesh.normals.len() == count);
        assert!(mesh.normals.iter().all(|normal| normal.is_normalized()), "{:?}", mesh.normals);
        assert!(mesh.uvs.is_empty() || mesh.uvs.len() == count);
        assert!(mesh.uvs.iter().all(|uv| uv.is_finite()));
        let mut used = vec![false; count];
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|corner| mesh.positions[corner as usize]);
            assert!((b - a).cross(c - a).normalize().is_normalized());
            triangle.iter().for_each(|corner| used[*corner as usize] = true);
        }
        assert!(used.iter().all(|used| *used));
    }
}

/// Volume of a closed mesh, positive if its triangles are counter-clockwise seen from outside.
fn volume(mesh: &Mesh) -> f32 {
    let corners = |triangle: &[u32; 3]| triangle.map(|corner| mesh.positions[corner as usize]);
    mesh.triangles.iter().map(corners).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
}

#[test]
fn unusable_normals_become_those_of_the_faces() {
    let mesh = Mesh {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(5.0, 5.0, 5.0)],
        normals: vec![Vec3::ZERO, Vec3::NAN, 3.0 * Vec3::X, Vec3::Z],
        uvs: vec![Vec2::ZERO; 4],
        triangles: vec![[0, 1, 2], [0, 1, 1], [2, 2, 0]],
    };
    let mesh = placed(mesh, &DAffine3::IDENTITY).unwrap();
    assert_eq!(mesh.triangles, [[0, 1, 2]]);
    assert_eq!(mesh.normals, [Vec3::Z, Vec3::Z, Vec3::X]);
    assert_eq!((mesh.positions.len(), mesh.uvs.len()), (3, 3));
}

#[test]
fn a_file_is_told_by_its_ending_and_must_be_one() {
    assert!(complaint(&[("a.stl", b"solid")]).contains("a name that ends in .gltf, .glb or .obj was expected"));
    let error = read_model(Path::new("no/such.obj"), Some(Up::Y)).unwrap_err().to_string();
    assert!(error.starts_with("cannot read no/such.obj: "), "{error}");
    let folder = folder(&[("a.obj/b", b"")]);
    let error = read_model(&folder.path().join("a.obj"), None).unwrap_err().to_string();
    assert!(error.ends_with("not a regular file"), "{error}");
}

proptest! {
    #![proptest_config(spoil::seeded(200))]

    /// Outward stays outward, and a normal stays upright on its face, whatever the transform does.
    #[test]
    fn normals_stay_upright_and_outward(numbers in prop::array::uniform9(-2.0..2.0_f64)) {
        let matrix = glam::DMat3::from_cols_array(&numbers);
        prop_assume!(matrix.determinant().abs() > 1e-2);
        let mesh = placed(cube::mesh(), &DAffine3::from_mat3(matrix)).unwrap();
        prop_assert!((f64::from(volume(&mesh)) - 8.0 * matrix.determinant().abs()).abs() < 1e-3);
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|corner| mesh.positions[corner as usize]);
            let upright = (b - a).cross(c - a).normalize();
            prop_assert!(upright.dot(mesh.normals[triangle[0] as usize]) > 1.0 - 1e-3);
        }
    }
}
