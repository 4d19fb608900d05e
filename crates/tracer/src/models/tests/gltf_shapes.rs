//! Where the triangles of a glTF file land.

use glam::{Mat4, Quat, Vec3};

use super::super::{Up, read_model};
use super::{complaint, cube, folder, holds, near, only_part, read, volume};
use crate::Model;

fn read_cube(node: &str, primitive: &str, more: &str) -> Model {
    let model =
        read(&[("a.gltf", cube::gltf(node, primitive, more).as_bytes()), ("cube.bin", &cube::buffer())]).unwrap();
    holds(&model);
    model
}

/// (x, y, z) of the file is (x, −z, y) here.
fn up(vector: Vec3) -> Vec3 {
    Vec3::new(vector.x, -vector.z, vector.y)
}

#[test]
fn a_turned_and_scaled_node_puts_corners_and_normals_where_it_says() {
    // 90° about y: x goes to −z and z to x.
    let node = r#""rotation": [0, 0.70710678, 0, 0.70710678], "scale": [1, 2, 3], "translation": [10, 20, 30], "#;
    let mesh = only_part(read_cube(node, "", "")).mesh;
    let original = cube::mesh();
    assert_eq!(mesh.triangles, original.triangles);
    assert_eq!(mesh.uvs, original.uvs);
    for (corner, old) in original.positions.iter().enumerate() {
        let Vec3 { x, y, z } = *old * Vec3::new(1.0, 2.0, 3.0);
        assert!(near(mesh.positions[corner], up(Vec3::new(z + 10.0, y + 20.0, 30.0 - x))), "corner {corner}");
        let Vec3 { x, y, z } = original.normals[corner];
        assert!(near(mesh.normals[corner], up(Vec3::new(z, y, -x))), "normal {corner}");
    }
}

#[test]
fn normals_go_by_the_inverse_transpose() {
    // x += y: the face at y = 1 stays level, the one at x = 1 leans.
    let node = r#""matrix": [1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1], "#;
    let mesh = only_part(read_cube(node, "", "")).mesh;
    for (normal, old) in mesh.normals.iter().zip(cube::mesh().normals) {
        let expected = if old.x == 0.0 { old } else { old.x * Vec3::new(1.0, -1.0, 0.0).normalize() };
        assert!(near(*normal, up(expected)), "{old} became {normal}");
    }
}

#[test]
fn a_mirrored_node_stays_outside_out() {
    assert!((volume(&only_part(read_cube("", "", "")).mesh) - 8.0).abs() < 1e-4);
    let mesh = only_part(read_cube(r#""scale": [-1, 2, 1], "#, "", "")).mesh;
    assert!((volume(&mesh) - 16.0).abs() < 1e-4);
    for (position, normal) in mesh.positions.iter().zip(&mesh.normals) {
        assert!(position.dot(*normal) > 0.9, "the normal at {position} points to {normal}");
    }
}

#[test]
fn nodes_stand_in_their_parents() {
    let matrix = Mat4::from_scale_rotation_translation(Vec3::splat(2.0), Quat::from_rotation_x(0.4), Vec3::X);
    let numbers = matrix.to_cols_array().map(|number| number.to_string()).join(", ");
    let text = cube::gltf(&format!(r#""children": [1], "matrix": [{numbers}], "#), "", "");
    // The mesh is the grandchild's.
    let text = text.replace(
        r#""mesh": 0 }]"#,
        r#""camera": 0 }, { "children": [2], "translation": [0, 3, 0] }, { "mesh": 0, "scale": [1, 1, 0.5] }]"#,
    );
    let mesh = only_part(read(&[("a.gltf", text.as_bytes()), ("cube.bin", &cube::buffer())]).unwrap()).mesh;
    for (position, old) in mesh.positions.iter().zip(cube::mesh().positions) {
        let inner = old * Vec3::new(1.0, 1.0, 0.5) + Vec3::new(0.0, 3.0, 0.0);
        assert!(near(*position, up(matrix.transform_point3(inner))));
    }
}

#[test]
fn up_is_as_the_caller_says() {
    let text = cube::gltf(r#""translation": [1, 2, 3], "#, "", "");
    let folder = folder(&[("a.gltf", text.as_bytes()), ("cube.bin", &cube::buffer())]);
    let center = |up| {
        let mesh = only_part(read_model(&folder.path().join("a.gltf"), up).unwrap()).mesh;
        mesh.positions.iter().sum::<Vec3>() / 24.0
    };
    assert!(near(center(None), Vec3::new(1.0, -3.0, 2.0)));
    assert!(near(center(Some(Up::Y)), Vec3::new(1.0, -3.0, 2.0)));
    assert!(near(center(Some(Up::Z)), Vec3::new(1.0, 2.0, 3.0)));
}

#[test]
fn text_data_and_binary_are_the_same_cube() {
    let plain = only_part(read_cube("", "", "")).mesh;
    let data = format!(r#""uri": "data:application/octet-stream;base64,{}", "#, cube::base64(&cube::buffer()));
    let data = cube::with_buffer(&data, "", "", "");
    let binary = cube::glb(&cube::with_buffer("", "", "", ""), &cube::buffer());
    for (name, bytes) in [("a.gltf", data.as_bytes()), ("a.glb", &binary)] {
        let mesh = only_part(read(&[(name, bytes)]).unwrap()).mesh;
        assert_eq!(
            (mesh.positions, mesh.normals, mesh.uvs, mesh.triangles),
            (plain.positions.clone(), plain.normals.clone(), plain.uvs.clone(), plain.triangles.clone()),
            "{name}"
        );
    }
    let text = cube::gltf("", "", "").replace("cube.bin", "in%20here/./c%C3%BCbe.bin");
    read(&[("a.gltf", text.as_bytes()), ("in here/cübe.bin", &cube::buffer())]).unwrap();
}

#[test]
fn strips_and_fans_keep_their_side() {
    // A square seen from above, as a strip and as a fan.
    for (mode, corners) in [(5, [[0, 0], [1, 0], [0, 1], [1, 1]]), (6, [[0, 0], [1, 0], [1, 1], [0, 1]])] {
        let floats = corners.iter().flat_map(|[x, y]| [*x as f32, *y as f32, 0.0]);
        let bytes: Vec<u8> = floats.flat_map(f32::to_le_bytes).collect();
        let text = format!(
            r#"{{ "asset": {{ "version": "2.0" }}, "scenes": [{{ "nodes": [0] }}], "nodes": [{{ "mesh": 0 }}],
            "meshes": [{{ "primitives": [{{ "attributes": {{ "POSITION": 0 }}, "mode": {mode} }}] }}],
            "accessors": [{{ "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3" }}],
            "bufferViews": [{{ "buffer": 0, "byteLength": 48 }}],
            "buffers": [{{ "uri": "data:;base64,{}", "byteLength": 48 }}] }}"#,
            cube::base64(&bytes)
        );
        let folder = folder(&[("a.gltf", text.as_bytes())]);
        let mesh = only_part(read_model(&folder.path().join("a.gltf"), Some(Up::Z)).unwrap()).mesh;
        assert!(mesh.normals.is_empty() && mesh.uvs.is_empty());
        assert_eq!(mesh.triangles.len(), 2);
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|corner| mesh.positions[corner as usize]);
            assert_eq!((b - a).cross(c - a), Vec3::Z, "mode {mode}");
        }
    }
}

#[test]
fn integers_and_sparse_values_are_decoded() {
    // Places as normalised bytes, four bytes apart; one is replaced by (1, 0, 1) and lies elsewhere.
    let places: Vec<u8> =
        [[0, 0, 0], [127, 0, 0], [0, 127, 0], [129, 0, 0_u8]].iter().flat_map(|p| [p[0], p[1], p[2], 9]).collect();
    let bytes = [&places[..], &[0, 1, 2, 0, 2, 3], &[2], &[127, 0, 127]].concat();
    let text = r#"{ "asset": { "version": "2.0" }, "extensionsRequired": ["KHR_mesh_quantization"],
        "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
        "accessors": [
          { "bufferView": 0, "componentType": 5120, "normalized": true, "count": 4, "type": "VEC3", "sparse": { "count": 1,
             "indices": { "bufferView": 2, "componentType": 5121 }, "values": { "bufferView": 3 } } },
          { "bufferView": 1, "componentType": 5121, "count": 6, "type": "SCALAR" }
        ],
        "bufferViews": [
          { "buffer": 0, "byteLength": 16, "byteStride": 4 }, { "buffer": 0, "byteOffset": 16, "byteLength": 6 },
          { "buffer": 0, "byteOffset": 22, "byteLength": 1 }, { "buffer": 0, "byteOffset": 23, "byteLength": 3 }
        ],
        "buffers": [{ "uri": "a.bin", "byteLength": 26 }] }"#;
    let folder = folder(&[("a.gltf", text.as_bytes()), ("a.bin", &bytes)]);
    let mesh = only_part(read_model(&folder.path().join("a.gltf"), Some(Up::Z)).unwrap()).mesh;
    assert_eq!(mesh.positions, [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 0.0, 1.0), -Vec3::X]);
}

#[test]
fn lines_and_points_are_passed_over() {
    let text = cube::gltf("", r#""mode": 1, "#, "");
    let error = complaint(&[("a.gltf", text.as_bytes()), ("cube.bin", &cube::buffer())]);
    assert_eq!(error, "the model: triangles with area were expected, it has none");
}
