//! Any bytes give a model that holds what meshes promise, or an error that names a file: never a panic.

use std::fs;
use std::path::Path;
use std::sync::LazyLock;

use proptest::prelude::*;

use super::super::read_model;
use super::spoil::{seeded, spoiled, spoiled_text};
use super::{complaint, cube, folder, holds, png};

const MORE: &str = r#"
  "materials": [{ "name": "all", "pbrMetallicRoughness": {
    "baseColorFactor": [0.5, 0.25, 0.125, 1],
    "baseColorTexture": { "index": 0, "extensions": { "KHR_texture_transform": { "offset": [0, 1], "rotation": 1.5 } } },
    "metallicRoughnessTexture": { "index": 1 }, "roughnessFactor": 0.5, "metallicFactor": 0.25 },
    "normalTexture": { "index": 0, "scale": 2, "extensions": { "KHR_texture_transform": { "scale": [2, 2] } } },
    "extensions": { "KHR_materials_transmission": { "transmissionFactor": 0.5, "transmissionTexture": { "index": 0 } },
      "KHR_materials_ior": { "ior": 1.33 }, "KHR_materials_volume": { "thicknessFactor": 0.1 } } }],
  "textures": [{ "source": 0 }, { "source": 0, "sampler": 0 }],
  "samplers": [{ "wrapS": 33071, "wrapT": 33648 }],
  "images": [{ "uri": "picture.png" }],
  "extensionsRequired": ["KHR_texture_transform"],"#;

static GLTF: LazyLock<[&'static str; 2]> = LazyLock::new(|| {
    let node = r#""translation": [1, 2, 3], "rotation": [0, 0, 0.6, 0.8], "scale": [1, -1, 2], "children": [1], "#;
    let all = cube::gltf(node, r#""material": 0, "mode": 4, "#, MORE).replace(
        r#""mesh": 0 }]"#,
        "\"mesh\": 0 },\n {\"mesh\": 0, \"matrix\": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1] }]",
    );
    let sparse = all.replace(
        r#""max": [1, 1, 1]"#,
        r#""sparse": { "count": 2, "indices": { "bufferView": 3, "byteOffset": 2, "componentType": 5123 },
           "values": { "bufferView": 1, "byteOffset": 12 } }"#,
    );
    let sparse = sparse.replace(r#""mode": 4"#, r#""mode": 5"#);
    [all, sparse].map(|text| &*String::leak(text))
});

const OBJ: [&str; 2] = [
    "mtllib m.mtl\nv 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 3\nvn 0 0 1\no one\n\
     usemtl b\nf 1/1/1 2/2/1 3/3/2 4/4/2\ng two\nusemtl a\nf 1 2 3\nf -1//-1 -2//-2 -3//-1\nf 1/1 2/2 3/3\n",
    "# none\nv 0 0 0 1\nv 2 0 0 1\nv 2 2 0 1\nv 0 2 1 1\nf 1 2 3 4\nf 4 3 2 1\ns off\nl 1 2\n",
];

const MTL: [&str; 1] = [
    "newmtl a\nKd 1 0 0\nKs 0.5 0.5 0.5\nNs 100\nillum 2\n\nnewmtl b\nKd 0 0 1\nmap_Kd picture.png\nd 1\nNi 1.5\nTf 1 1 1\nTr 0\n",
];

/// The files that lie beside each other in every case.
fn beside() -> tempfile::TempDir {
    let picture = png(2, 2, &[[255, 0, 0], [0, 255, 0], [0, 0, 255], [128, 128, 128]]);
    folder(&[
        ("cube.bin", &cube::buffer()),
        ("picture.png", &picture),
        ("m.mtl", MTL[0].as_bytes()),
        ("a.obj", OBJ[0].as_bytes()),
    ])
}

/// Puts `bytes` into the file `name` and reads `model`.
fn attempt(folder: &Path, name: &str, bytes: &[u8], model: &str) -> Result<(), String> {
    fs::write(folder.join(name), bytes).unwrap();
    match read_model(&folder.join(model), None) {
        Ok(model) => {
            holds(&model);
            Ok(())
        }
        Err(error) => {
            let error = error.to_string();
            assert!(error.contains(&folder.display().to_string()), "{error}");
            Err(error)
        }
    }
}

#[test]
fn the_valid_texts_are_read() {
    let folder = beside();
    for text in GLTF.iter() {
        attempt(folder.path(), "a.gltf", text.as_bytes(), "a.gltf").unwrap();
        let text = text.replace(r#""uri": "cube.bin", "#, "");
        attempt(folder.path(), "a.glb", &cube::glb(&text, &cube::buffer()), "a.glb").unwrap();
    }
    for text in OBJ {
        attempt(folder.path(), "a.obj", text.as_bytes(), "a.obj").unwrap();
    }
}

/// They begin with a byte that says the format; what follows a line `%` lies beside.
#[test]
fn the_seeds_of_the_fuzz_target_are_read() {
    let seeds = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/seeds/model");
    for seed in fs::read_dir(seeds).unwrap() {
        let bytes = fs::read(seed.unwrap().path()).unwrap();
        let name = match bytes[0] {
            b'g' => "a.gltf",
            b'b' => "a.glb",
            _ => "a.obj",
        };
        let folder = beside();
        let cut = bytes.windows(3).position(|three| three == b"\n%\n").unwrap_or(bytes.len() - 1);
        fs::write(folder.path().join("beside"), bytes.get(cut + 3..).unwrap_or_default()).unwrap();
        attempt(folder.path(), name, &bytes[1..=cut], name).unwrap();
    }
}

proptest! {
    #![proptest_config(seeded(1000))]

    #[test]
    fn a_spoiled_gltf_is_used_or_refused(text in spoiled_text(GLTF.as_slice())) {
        let folder = beside();
        let _ = attempt(folder.path(), "a.gltf", text.as_bytes(), "a.gltf");
    }

    #[test]
    fn a_spoiled_buffer_is_used_or_refused(
        changes in prop::collection::vec((0..840_usize, any::<u8>()), 1..8),
        length in prop_oneof![Just(840), 0..840_usize],
    ) {
        let folder = beside();
        let mut bytes = cube::buffer();
        changes.iter().for_each(|(at, byte)| bytes[*at] = *byte);
        fs::write(folder.path().join("a.gltf"), GLTF[0]).unwrap();
        let _ = attempt(folder.path(), "cube.bin", &bytes[..length], "a.gltf");
    }

    #[test]
    fn a_spoiled_container_is_used_or_refused(
        changes in prop::collection::vec((0..40_usize, any::<u8>()), 1..4),
        cut in any::<prop::sample::Index>(),
        whole in any::<bool>(),
    ) {
        let folder = beside();
        let mut bytes = cube::glb(&GLTF[0].replace(r#""uri": "cube.bin", "#, ""), &cube::buffer());
        changes.iter().for_each(|(at, byte)| bytes[*at] = *byte);
        bytes.truncate(if whole { bytes.len() } else { cut.index(bytes.len()) });
        let _ = attempt(folder.path(), "a.glb", &bytes, "a.glb");
    }

    #[test]
    fn a_spoiled_obj_is_used_or_refused(bytes in spoiled(&OBJ)) {
        let folder = beside();
        let _ = attempt(folder.path(), "a.obj", &bytes, "a.obj");
    }

    #[test]
    fn a_spoiled_library_is_used_or_refused(bytes in spoiled(&MTL)) {
        let folder = beside();
        let _ = attempt(folder.path(), "m.mtl", &bytes, "a.obj");
    }

    #[test]
    fn any_text_is_no_model(text in any::<String>()) {
        let folder = beside();
        prop_assert!(attempt(folder.path(), "a.gltf", text.as_bytes(), "a.gltf").is_err());
        prop_assert!(attempt(folder.path(), "a.obj", text.as_bytes(), "a.obj").is_err());
    }
}

/// What a glTF says after one change.
fn gltf_complaint(from: &str, to: &str) -> String {
    let text = GLTF[1].replacen(from, to, 1);
    assert_ne!(text, GLTF[1], "{from} is not there");
    let picture = png(1, 1, &[[9; 3]]);
    complaint(&[("a.gltf", text.as_bytes()), ("cube.bin", &cube::buffer()), ("picture.png", &picture)])
}

#[test]
fn every_index_that_leads_nowhere_is_named() {
    for (from, to, expected) in [
        (r#""scene": 0"#, r#""scene": 1"#, "scene: there is no scenes[1]"),
        (r#""nodes": [0]"#, r#""nodes": [2]"#, "the scene: there is no nodes[2]"),
        (r#""children": [1]"#, r#""children": [9]"#, "the scene: there is no nodes[9]"),
        (r#""mesh": 0 }"#, r#""mesh": 1 }"#, "nodes: there is no meshes[1]"),
        (r#""POSITION": 0"#, r#""POSITION": 4"#, "meshes[0].primitives[0]: there is no accessors[4]"),
        (r#""NORMAL": 1"#, r#""NORMAL": 4"#, "meshes[0].primitives[0]: there is no accessors[4]"),
        (r#""indices": 3"#, r#""indices": 4"#, "meshes[0].primitives[0]: there is no accessors[4]"),
        (r#""material": 0"#, r#""material": 1"#, "meshes[0].primitives[0]: there is no materials[1]"),
        (r#""bufferView": 0"#, r#""bufferView": 4"#, "accessors[0]: there is no bufferViews[4]"),
        (r#""buffer": 0"#, r#""buffer": 1"#, "bufferViews[0]: there is no buffers[1]"),
        (r#""index": 0"#, r#""index": 2"#, "materials[0]: there is no textures[2]"),
        (r#""source": 0"#, r#""source": 1"#, "textures[0]: there is no images[1]"),
        (r#""sampler": 0"#, r#""sampler": 1"#, "textures[1]: there is no samplers[1]"),
        (
            r#""byteOffset": 2,"#,
            r#""byteOffset": 70,"#,
            "accessors[0].sparse: 2 elements were expected, its views have fewer",
        ),
        (
            r#""bufferView": 3, "byteOffset": 2"#,
            r#""bufferView": 0, "byteOffset": 2"#,
            "accessors[0].sparse: indices below 24 were expected, one is 16256",
        ),
    ] {
        assert_eq!(gltf_complaint(from, to), expected, "{to}");
    }
}

#[test]
fn every_range_is_held_against_the_bytes_that_are_there() {
    for (from, to, expected) in [
        (
            r#""count": 24"#,
            r#""count": 25"#,
            "accessors[0]: 25 elements of 12 bytes were expected, one every 12 from 0 on, in a view of 288 bytes",
        ),
        (
            r#""count": 24"#,
            r#""count": 18446744073709551615"#,
            "accessors[0]: 18446744073709551615 elements of 12 bytes were expected, one every 12 from 0 on, in a view of 288 bytes",
        ),
        (
            r#""byteLength": 288 }"#,
            r#""byteLength": 841 }"#,
            "bufferViews[0]: 841 bytes from 0 on, but buffers[0] has 840",
        ),
        (r#""byteLength": 840"#, r#""byteLength": 841"#, "buffers[0]: it announces 841 bytes, only 840 are there"),
        (r#""byteStride": 8"#, r#""byteStride": 0"#, "accessors[2]: a byteStride of at least 8 was expected, it is 0"),
        (r#""type": "VEC2""#, r#""type": "VEC4""#, "accessors[2]: the type Vec2 was expected, it is Vec4"),
        (
            r#""componentType": 5126"#,
            r#""componentType": 5"#,
            "accessors[0]: a type and a componentType of §3.6.2 were expected",
        ),
        (
            r#""componentType": 5123, "count""#,
            r#""componentType": 5122, "count""#,
            "accessors[3]: indices were expected, as integers without sign",
        ),
        (
            r#""bufferView": 0, "#,
            "",
            "accessors[0]: not supported: an accessor without a bufferView (compressed, or all zeros)",
        ),
        (
            r#""count": 24, "type": "VEC2""#,
            r#""count": 23, "type": "VEC2""#,
            "meshes[0].primitives[0]: POSITION has 24 elements, TEXCOORD 23",
        ),
    ] {
        assert_eq!(gltf_complaint(from, to), expected, "{to}");
    }
}

#[test]
fn what_makes_no_sense_is_refused() {
    for (from, to, expected) in [
        (
            r#""children": [1]"#,
            r#""children": [1, 0]"#,
            "nodes[0]: one parent was expected, but the scene comes here twice",
        ),
        (
            r#""children": [1]"#,
            r#""children": [1, 1]"#,
            "nodes[1]: one parent was expected, but the scene comes here twice",
        ),
        ("0, 0.6, 0.8", "0, 0, 0", "nodes[0]: a rotation as a unit quaternion was expected, it is [0, 0, 0, 0]"),
        ("0, 0, 1] }", "0, 0, 2] }", "nodes[1]: a finite matrix whose last row is 0, 0, 0, 1 was expected"),
        (r#""version": "2.0""#, r#""version": "1.0""#, "asset.version: not supported: 2.0 was expected, it is \"1.0\""),
        (
            r#"["KHR_texture_transform"]"#,
            r#"["KHR_draco_mesh_compression"]"#,
            "extensionsRequired: not supported: the extension \"KHR_draco_mesh_compression\"; known are KHR_materials_ior, \
             KHR_materials_transmission, KHR_materials_volume, KHR_mesh_quantization, KHR_texture_transform",
        ),
        (r#""ior": 1.33"#, r#""ior": 0.5"#, "materials[0]: an ior of at least 1 was expected, it is 0.5"),
        (r#""mode": 5"#, r#""mode": 7"#, "meshes[0].primitives[0]: a mode of 0 … 6 was expected"),
        (
            r#""wrapS": 33071"#,
            r#""wrapS": 1"#,
            "textures[1]: a wrapping mode of 10497, 33648 or 33071 was expected in its sampler",
        ),
        (
            r#""scale": [1, -1, 2]"#,
            r#""scale": [1, -1, 1e20]"#,
            "meshes[0].primitives[0]: corners within 1e9 m of the origin were expected, one is at [0.31999996, 100000000000000000000, 3.24]",
        ),
        ("picture.png", "data:,abc", "images[0]: not supported: a picture that is neither PNG nor JPEG"),
        ("picture.png", "cube.bin", "images[0]: not supported: a picture that is neither PNG nor JPEG"),
        ("cube.bin", "data:;base64,====", "buffers[0]: base64 (RFC 4648, §4) was expected in the data: URI"),
    ] {
        assert_eq!(gltf_complaint(from, to), expected, "{to}");
    }
}

#[test]
fn an_index_beyond_the_corners_is_refused() {
    let text = cube::gltf("", "", "").replace(r#""byteOffset": 768"#, r#""byteOffset": 700"#);
    let error = complaint(&[("a.gltf", text.as_bytes()), ("cube.bin", &cube::buffer())]);
    assert_eq!(error, "meshes[0].primitives[0]: indices below 24 were expected, the one at 1 is 16256");
}

#[test]
fn a_place_that_is_no_number_is_refused() {
    let mut buffer = cube::buffer();
    buffer[4..8].copy_from_slice(&f32::NAN.to_le_bytes());
    let text = cube::gltf("", "", "");
    let error = complaint(&[("a.gltf", text.as_bytes()), ("cube.bin", &buffer)]);
    assert!(error.starts_with("meshes[0].primitives[0]: corners within 1e9 m of the origin were expected"), "{error}");
}

#[test]
fn files_outside_the_folder_are_not_asked_for() {
    for uri in ["../cube.bin", "/etc/hostname", "a/%2E%2E/../b", "%2e%2e/cube.bin", "https://example.org/a.bin", ""] {
        let error = gltf_complaint(r#""uri": "cube.bin""#, &format!(r#""uri": "{uri}""#));
        assert!(error.starts_with("buffers[0]: a file in the model's folder was expected"), "{error}");
    }
    let error = gltf_complaint("picture.png", "../picture.png");
    assert!(error.starts_with("images[0]: a file in the model's folder was expected"), "{error}");
}
