//! A cube from −1 to 1 with a normal and texture coordinates on each face, as glTF has it.

use glam::{Vec2, Vec3};

use crate::Mesh;

/// The two vectors along each face; their cross product points outward.
fn faces() -> [[Vec3; 2]; 6] {
    let axes = [Vec3::X, Vec3::Y, Vec3::Z];
    std::array::from_fn(|face| {
        let (u, v) = (axes[(face + 1) % 3], axes[(face + 2) % 3]);
        if face < 3 { [u, v] } else { [v, u] }
    })
}

pub(super) fn mesh() -> Mesh {
    let mut mesh = Mesh::default();
    for [u, v] in faces() {
        let first = mesh.positions.len() as u32;
        let normal = u.cross(v);
        for [x, y] in [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0_f32]] {
            mesh.positions.push(normal + (2.0 * x - 1.0) * u + (2.0 * y - 1.0) * v);
            mesh.normals.push(normal);
            mesh.uvs.push(Vec2::new(x, y));
        }
        mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }
    mesh
}

/// The buffer of the glTF file: places, normals, texture coordinates, indices.
pub(super) fn buffer() -> Vec<u8> {
    let mesh = mesh();
    let floats = mesh.positions.iter().chain(&mesh.normals).flat_map(Vec3::to_array);
    let floats = floats.chain(mesh.uvs.iter().flat_map(Vec2::to_array));
    let mut bytes: Vec<u8> = floats.flat_map(f32::to_le_bytes).collect();
    bytes.extend(mesh.triangles.as_flattened().iter().flat_map(|index| (*index as u16).to_le_bytes()));
    assert_eq!(bytes.len(), 840);
    bytes
}

/// A glTF file of one node; `node` and `primitive` go into their objects, `more` into the outermost.
pub(super) fn gltf(node: &str, primitive: &str, more: &str) -> String {
    with_buffer(r#""uri": "cube.bin", "#, node, primitive, more)
}

/// As [`gltf`], with another `uri` of the buffer.
pub(super) fn with_buffer(uri: &str, node: &str, primitive: &str, more: &str) -> String {
    format!(
        r#"{{
  "asset": {{ "version": "2.0" }},
  "scene": 0,
  "scenes": [{{ "nodes": [0] }}],
  "nodes": [{{ "name": "cube", {node}"mesh": 0 }}],
  "meshes": [{{ "primitives": [{{
    "attributes": {{ "POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2 }}, {primitive}"indices": 3
  }}] }}],
  "accessors": [
    {{ "bufferView": 0, "componentType": 5126, "count": 24, "type": "VEC3", "min": [-1, -1, -1], "max": [1, 1, 1] }},
    {{ "bufferView": 1, "componentType": 5126, "count": 24, "type": "VEC3" }},
    {{ "bufferView": 2, "componentType": 5126, "count": 24, "type": "VEC2" }},
    {{ "bufferView": 3, "componentType": 5123, "count": 36, "type": "SCALAR" }}
  ],
  "bufferViews": [
    {{ "buffer": 0, "byteLength": 288 }},
    {{ "buffer": 0, "byteOffset": 288, "byteLength": 288 }},
    {{ "buffer": 0, "byteOffset": 576, "byteLength": 192, "byteStride": 8 }},
    {{ "buffer": 0, "byteOffset": 768, "byteLength": 72 }}
  ],{more}
  "buffers": [{{ {uri}"byteLength": 840 }}]
}}
"#
    )
}

/// The binary container of a JSON text and the bytes beside it.
pub(super) fn glb(json: &str, binary: &[u8]) -> Vec<u8> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend((28 + json.len() as u32 + binary.len() as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", &json[..]), (b"BIN\0", binary)] {
        bytes.extend((chunk.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(chunk);
    }
    bytes
}

/// Base64 (RFC 4648, §4).
pub(super) fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for three in bytes.chunks(3) {
        let bits = (0..3).fold(0_u32, |bits, at| bits << 8 | u32::from(*three.get(at).unwrap_or(&0)));
        for at in 0..4 {
            let letter = LETTERS[(bits >> (18 - 6 * at)) as usize & 63];
            text.push(if at <= three.len() { char::from(letter) } else { '=' });
        }
    }
    text
}
