//! What glTF says that surfaces are made of.

use glam::{Vec2, Vec3};
use relumine_radiometry::srgb_decode;

use super::{complaint, cube, near, only_part, png, read};
use crate::{Material, Surface, Texture, Wrap};

/// Two by two: red, green above blue, white.
fn picture() -> Vec<u8> {
    png(2, 2, &[[255, 0, 0], [0, 255, 0], [0, 0, 255], [128, 128, 128]])
}

const TEXTURES: &str = r#"
  "textures": [{ "source": 0 }, { "source": 0, "sampler": 0 }],
  "samplers": [{ "wrapS": 33071, "wrapT": 33648 }],
  "images": [{ "uri": "picture.png" }],"#;

fn surface(material: &str) -> Surface {
    let more = format!("\n  \"materials\": [{{ {material} }}],{TEXTURES}");
    let text = cube::gltf("", r#""material": 0, "#, &more);
    let files = [("a.gltf", text.as_bytes()), ("cube.bin", &cube::buffer()), ("picture.png", &picture())];
    only_part(read(&files).unwrap()).surface
}

/// Base colour and roughness-metallic.
fn textures(surface: &Surface) -> (&Texture, &Texture) {
    match &surface.material {
        Material::MetallicRoughness { base_colour, roughness_metallic, .. } => (base_colour, roughness_metallic),
        other => panic!("{other:?}"),
    }
}

#[test]
fn without_a_material_all_values_are_the_formats_defaults() {
    let text = cube::gltf("", "", "");
    let surface = only_part(read(&[("a.gltf", text.as_bytes()), ("cube.bin", &cube::buffer())]).unwrap()).surface;
    let (colour, packed) = textures(&surface);
    assert_eq!((colour.at(Vec2::ZERO), packed.at(Vec2::ZERO)), (Vec3::ONE, Vec3::ONE));
    let Material::MetallicRoughness { index, transmission, solid, .. } = surface.material else { unreachable!() };
    assert_eq!((index, transmission, solid, surface.normal_map.is_none()), (1.5, 0.0, false, true));
}

#[test]
fn colour_is_decoded_and_roughness_is_not() {
    let surface = surface(
        r#""pbrMetallicRoughness": { "baseColorFactor": [0.5, 1, 1, 0.1], "baseColorTexture": { "index": 0 },
        "metallicRoughnessTexture": { "index": 0 }, "roughnessFactor": 0.5, "metallicFactor": 0.25 },
        "normalTexture": { "index": 0, "scale": 2 }"#,
    );
    let (colour, packed) = textures(&surface);
    let grey = Vec2::splat(0.75);
    let linear = srgb_decode(128.0 / 255.0) as f32;
    assert!(near(colour.at(grey), linear * Vec3::new(0.5, 1.0, 1.0)));
    assert!(near(packed.at(grey), 128.0 / 255.0 * Vec3::new(1.0, 0.5, 0.25)));
    let map = surface.normal_map.as_ref().unwrap();
    assert!(near(map.texture.at(grey), Vec3::splat(128.0 / 255.0)));
    assert_eq!(map.scale, 2.0);
    // (0, 0) is the upper left.
    assert!(near(colour.at(Vec2::splat(0.25)), Vec3::new(0.5, 0.0, 0.0)));
    assert!(near(colour.at(Vec2::new(0.25, 0.75)), Vec3::Z));
}

#[test]
fn samplers_say_how_a_picture_goes_on() {
    let surface = surface(
        r#""pbrMetallicRoughness": { "baseColorTexture": { "index": 1 }, "metallicRoughnessTexture": { "index": 0 } }"#,
    );
    let wrap = |texture: &Texture| match texture {
        Texture::Picture(picture) => picture.wrap,
        other => panic!("{other:?}"),
    };
    let (colour, packed) = textures(&surface);
    assert_eq!((wrap(colour), wrap(packed)), ([Wrap::Clamp, Wrap::Mirror], [Wrap::Repeat; 2]));
}

#[test]
fn a_texture_transform_moves_turns_and_scales() {
    // The example of KHR_texture_transform: the lower left quadrant, turned by 90°, is all that the mesh shows.
    let transform = r#""extensions": { "KHR_texture_transform": { "offset": [0, 1], "rotation": 1.57079632679, "scale": [0.5, 0.5] } }"#;
    let surface = surface(&format!(
        r#""pbrMetallicRoughness": {{ "baseColorTexture": {{ "index": 0, {transform} }} }},
        "normalTexture": {{ "index": 0, {transform} }}"#
    ));
    let map = surface.normal_map.as_ref().unwrap();
    for texture in [textures(&surface).0, &map.texture] {
        let Texture::Picture(picture) = texture else { panic!("{texture:?}") };
        let at = |u, v| picture.picture_from_mesh.transform_point2(Vec2::new(u, v));
        assert!(at(0.0, 0.0).abs_diff_eq(Vec2::new(0.0, 1.0), 1e-6));
        assert!(at(1.0, 0.0).abs_diff_eq(Vec2::new(0.0, 0.5), 1e-6));
        assert!(at(0.0, 1.0).abs_diff_eq(Vec2::new(0.5, 1.0), 1e-6));
        assert!(near(texture.at(Vec2::splat(0.5)), Vec3::Z));
    }
}

#[test]
fn light_passes_as_the_extensions_say() {
    let surface = surface(
        r#""extensions": { "KHR_materials_transmission": { "transmissionFactor": 0.5, "transmissionTexture": { "index": 0 } },
        "KHR_materials_ior": { "ior": 1.33 }, "KHR_materials_volume": { "thicknessFactor": 0.1 } }"#,
    );
    let Material::MetallicRoughness { index, transmission, solid, .. } = surface.material else { unreachable!() };
    assert_eq!((index, solid), (1.33, true));
    // Red of the four pixels: 255, 0, 0, 128.
    assert!((transmission - 0.5 * 383.0 / 4.0 / 255.0).abs() < 1e-6);
}

#[test]
fn pictures_lie_in_views_and_data_as_well() {
    let material = "\n  \"materials\": [{ \"pbrMetallicRoughness\": { \"baseColorTexture\": { \"index\": 0 } } }],";
    let data = format!(r#""uri": "data:image/png;base64,{}""#, cube::base64(&picture()));
    let view = r#""bufferView": 4, "mimeType": "image/png""#;
    let binary = [cube::buffer(), picture()].concat();
    for image in [&data, view] {
        let more = format!("{material}{}", TEXTURES.replace(r#""uri": "picture.png""#, image));
        let text = cube::with_buffer("", "", r#""material": 0, "#, &more);
        let text = text.replace("\"byteLength\": 840", &format!("\"byteLength\": {}", binary.len())).replace(
            r#""byteOffset": 768, "byteLength": 72 }"#,
            &format!(
                r#""byteOffset": 768, "byteLength": 72 }}, {{ "buffer": 0, "byteOffset": 840, "byteLength": {} }}"#,
                picture().len()
            ),
        );
        let surface = only_part(read(&[("a.glb", &cube::glb(&text, &binary))]).unwrap()).surface;
        assert!(near(textures(&surface).0.at(Vec2::splat(0.25)), Vec3::X));
    }
}

#[test]
fn pictures_of_one_material_share_their_coordinates() {
    let complain = |material: &str| {
        let more = format!("\n  \"materials\": [{{ {material} }}],{TEXTURES}");
        let text = cube::gltf("", r#""material": 0, "#, &more);
        complaint(&[("a.gltf", text.as_bytes()), ("cube.bin", &cube::buffer()), ("picture.png", &picture())])
    };
    let set = r#""pbrMetallicRoughness": { "baseColorTexture": { "index": 0, "texCoord": 1 } }"#;
    assert_eq!(
        complain(&format!(r#"{set}, "normalTexture": {{ "index": 0 }}"#)),
        "materials[0]: not supported: pictures on TEXCOORD_1 and on TEXCOORD_0 in one material"
    );
    let expected = "meshes[0].primitives[0]: its material has a texture, so TEXCOORD_1 was expected";
    assert_eq!(complain(set), expected);
}
