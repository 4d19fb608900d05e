//! What an OBJ file and its libraries mean.

use glam::{Vec2, Vec3};

use super::super::{Up, read_model};
use super::{bounds, complaint, folder, holds, near, only_part, png, read};
use crate::{Material, Texture};

const SQUARE: &str = "v 0 0 0\nv 2 0 0 # here\nv 2 2 0\nv 0 2 0\nvt 0 0\nvt 1 0 0\nvt 1 1\nvt 0 1\nvn 0 0 3\n";

fn material_of(library: &str) -> Material {
    let text = format!("mtllib a b.mtl\n{SQUARE}usemtl some #1\nf 1/1 2/2 3/3 4/4\n");
    let library = format!("# a library\nnewmtl some #1\n{library}\nnewmtl other\nKd 0 0 0\n");
    let picture = png(1, 2, &[[255, 0, 0], [0, 0, 255]]);
    let files = [("a.obj", text.as_bytes()), ("a b.mtl", library.as_bytes()), ("maps/c.png", &picture)];
    only_part(read(&files).unwrap()).surface.material
}

#[test]
fn faces_are_cut_into_triangles_and_v_turned_down() {
    let text = format!("{SQUARE}f 1/1/1 2/2/1 3/3/1 4/4/1\n");
    let part = only_part(read(&[("square.obj", text.as_bytes())]).unwrap());
    assert_eq!(part.name, "square");
    assert_eq!(part.mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(part.mesh.normals, [Vec3::Z; 4]);
    assert_eq!(part.mesh.uvs, [Vec2::Y, Vec2::ONE, Vec2::X, Vec2::ZERO]);
    let Material::Diffuse { reflectance } = part.surface.material else { panic!() };
    assert_eq!(reflectance.at(Vec2::ZERO), Vec3::splat(0.5));
}

#[test]
fn z_points_up_unless_told_otherwise() {
    let text = format!("{SQUARE}f 1 2 3\n");
    let folder = folder(&[("a.obj", text.as_bytes())]);
    let bounds = |up| bounds(&read_model(&folder.path().join("a.obj"), up).unwrap());
    assert_eq!(bounds(None), (Vec3::ZERO, Vec3::new(2.0, 2.0, 0.0)));
    assert_eq!(bounds(Some(Up::Y)), (Vec3::ZERO, Vec3::new(2.0, 0.0, 2.0)));
}

#[test]
fn objects_materials_and_what_is_known_of_corners_part_the_faces() {
    let text = format!(
        "mtllib m.mtl\n{SQUARE}o one\nusemtl red\nf 1 2 3\nusemtl blue\nf 1 2 3\nusemtl red\nf 1 3 4\nf 1//1 3//1 4//1\n\
         g two\nf -4 -3 -2\nl 1 2\ns 1\n"
    );
    let model =
        read(&[("a.obj", text.as_bytes()), ("m.mtl", b"newmtl red\r\nKd 1 0 0\r\nnewmtl blue\r\nKd 0 0 1 # blue\r\n")])
            .unwrap();
    holds(&model);
    let parts: Vec<_> = model
        .parts
        .iter()
        .map(|part| {
            let Material::Diffuse { reflectance: Texture::Constant(colour) } = part.surface.material else { panic!() };
            (part.name.as_str(), colour, part.mesh.triangles.len(), part.mesh.normals.len())
        })
        .collect();
    assert_eq!(parts, [("one", Vec3::X, 2, 0), ("one", Vec3::Z, 1, 0), ("one", Vec3::X, 1, 3), ("two", Vec3::X, 1, 0)]);
}

#[test]
fn libraries_say_what_a_surface_is_made_of() {
    match material_of("Kd 0.1 0.2 2") {
        Material::Diffuse { reflectance } => assert_eq!(reflectance.at(Vec2::ZERO), Vec3::new(0.1, 0.2, 1.0)),
        other => panic!("{other:?}"),
    }
    match material_of("Kd 0.5\nKs 0.1 0.1 0.1\nNs 198\nNi 1.4\nTf 1 1 1\nd 1\nillum 2") {
        Material::Plastic { diffuse, index, alpha } => {
            assert_eq!((diffuse.at(Vec2::ZERO), index), (Vec3::splat(0.5), 1.5));
            assert!((alpha - 0.1).abs() < 1e-6);
        }
        other => panic!("{other:?}"),
    }
    for glass in ["d 0.2\nNi 1.4", "Tr 0.8\nNi 1.4", "illum 7\nNi 1.4", "d -halo 0.5\nNi 1.4\nKs 1 1 1\nNs 9"] {
        match material_of(&format!("{glass}\nTf 1 0.5 1")) {
            Material::Glass { index, alpha, tint } => {
                assert_eq!((index, alpha, tint), (1.4, 0.0, Vec3::new(1.0, 0.5, 1.0)));
            }
            other => panic!("{other:?}"),
        }
    }
    assert!(matches!(material_of("d 0.2"), Material::Diffuse { .. }), "without an index");
}

#[test]
fn a_map_is_decoded_and_stands_on_its_lower_edge() {
    for map in ["map_Kd maps/c.png", "map_Kd maps\\c.png\nKd 0.5 0.5 0.5"] {
        let factor = if map.contains("Kd 0.5") { 0.5 } else { 1.0 };
        let Material::Diffuse { reflectance } = material_of(map) else { panic!() };
        // Our v = 1 is the file's v = 0, below.
        assert!(near(reflectance.at(Vec2::new(0.5, 0.75)), factor * Vec3::Z));
        assert!(near(reflectance.at(Vec2::new(0.5, 0.25)), factor * Vec3::X));
    }
}

#[test]
fn messages_name_the_line() {
    for (text, expected) in [
        ("v 0 0", "line 1: 3 numbers were expected, found 2"),
        ("\nv 0 nan 0", "line 2: a finite number was expected, found \"nan\""),
        ("v 0 0 1e39", "line 1: a finite number was expected, found \"1e39\""),
        ("v 0 0 0\nf 1 1", "line 2: a face of three corners or more was expected, it has 2"),
        ("v 0 0 0\nf 1 1 2", "line 2: an index of v from 1 to 1 or from -1 to -1 was expected, found \"2\""),
        ("v 0 0 0\nf 1 1 1/1/1/1", "line 2: an index of vt from 1 to 0 or from -1 to -0 was expected, found \"1\""),
        ("v 0 0 0", "the model: triangles with area were expected, it has none"),
        ("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3", "the model: triangles with area were expected, it has none"),
        (
            "v 0 0 0\nv 1e10 0 0\nv 2 3 0\nf 1 2 3",
            "the object \"a\": corners within 1e9 m of the origin were expected, one is at [10000000000, 0, 0]",
        ),
        ("mtllib b.mtl", "cannot read FOLDER/b.mtl: No such file or directory (os error 2)"),
    ] {
        assert_eq!(complaint(&[("a.obj", text.as_bytes())]), expected, "{text}");
    }
    let square = format!("mtllib m.mtl\n{SQUARE}usemtl b\nf 1/1 2/2 3/3\n");
    for (library, expected) in [
        ("newmtl a", "line 11: no library defines the material \"b\""),
        ("newmtl b\nKd 1 1", "FOLDER/m.mtl: line 2: 3 numbers were expected, found 2"),
        ("newmtl b\nKd", "FOLDER/m.mtl: line 2: 3 numbers were expected, found 0"),
        ("newmtl b\nillum x", "FOLDER/m.mtl: line 2: a number of 0 … 10 was expected, found \"x\""),
        (
            "newmtl b\nmap_Kd -s 1 1 1 c.png",
            "FOLDER/m.mtl: line 2: not supported: options of a map: \"-s 1 1 1 c.png\"",
        ),
    ] {
        let files = [("a.obj", square.as_bytes()), ("m.mtl", library.as_bytes())];
        assert_eq!(complaint(&files), expected, "{library}");
    }
    let bare = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl b\nf 1 2 3\n";
    let files = [("a.obj", bare.as_bytes()), ("m.mtl", b"newmtl b\nmap_Kd c.png"), ("c.png", &png(1, 1, &[[0; 3]]))];
    assert!(complaint(&files).contains("texture coordinates (f v/vt) were expected"));
}

#[test]
fn files_outside_the_folder_are_not_asked_for() {
    for name in ["../b.mtl", "/etc/passwd", "a/../../b.mtl", "..\\b.mtl", "."] {
        let error = complaint(&[("a.obj", format!("mtllib {name}").as_bytes())]);
        assert!(error.starts_with("line 1: a file in the model's folder was expected"), "{error}");
    }
    let text = format!("mtllib m.mtl\n{SQUARE}usemtl b\nf 1/1 2/2 3/3\n");
    let error = complaint(&[("a.obj", text.as_bytes()), ("m.mtl", b"newmtl b\nmap_Kd ../c.png")]);
    assert!(error.contains("line 2: a file in the model's folder was expected"), "{error}");
}
