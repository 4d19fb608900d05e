//! Models that others made. They lie beside the project, in `../shared/data`; without them this test says so and passes.

use std::path::{Path, PathBuf};

use glam::{Vec2, Vec3};

use super::super::{Up, read_model};
use super::{bounds, holds};
use crate::{Material, Texture};

fn data() -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    if path.join("models_gltf").exists() && path.join("models_common").exists() {
        return Some(path);
    }
    eprintln!("skipped: {} is not there, so models of others are not read", path.display());
    None
}

/// Triangles with area, and the box round their corners, z up; computed from the same files with NumPy.
const MODELS: [(&str, usize, [f32; 3], [f32; 3]); 23] = [
    ("models_chess_castle/black_bishop.gltf", 11206, [-0.78896, -0.78777, 0.00033], [0.78657, 0.78777, 3.59988]),
    ("models_chess_castle/black_king.gltf", 4527, [-0.73906, -0.73906, 0.00085], [0.73906, 0.73906, 4.37464]),
    ("models_chess_castle/black_knight.gltf", 14480, [-0.74011, -0.8865, -0.0021], [0.74011, 0.87158, 3.24836]),
    ("models_chess_castle/black_pawn.gltf", 3324, [-0.69011, -0.69011, -0.00116], [0.69011, 0.69011, 2.64463]),
    ("models_chess_castle/black_queen.gltf", 5436, [-0.78288, -0.77693, 5e-05], [0.78288, 0.77242, 3.99185]),
    ("models_chess_castle/black_rook.gltf", 6732, [-0.75162, -0.75162, -0.00155], [0.75162, 0.75162, 2.65748]),
    ("models_chess_castle/chess_board.gltf", 386, [-11.00932, -10.83858, 0.03774], [10.89069, 11.06142, 1.2]),
    ("models_chess_castle/white_bishop.gltf", 10950, [-0.78896, -0.78777, -0.0019], [0.78657, 0.78777, 3.59765]),
    ("models_chess_castle/white_king.gltf", 5934, [-0.74602, -0.73906, -0.00249], [0.73209, 0.73906, 4.37129]),
    ("models_chess_castle/white_knight.gltf", 14480, [-0.73994, -0.87137, 0.00269], [0.73994, 0.88682, 3.25315]),
    ("models_chess_castle/white_pawn.gltf", 2876, [-0.68488, -0.69013, 0.00101], [0.69538, 0.69013, 2.6468]),
    ("models_chess_castle/white_queen.gltf", 5436, [-0.78288, -0.77693, 5e-05], [0.78288, 0.77242, 3.99185]),
    ("models_chess_castle/white_rook.gltf", 6732, [-0.75162, -0.75162, -0.00394], [0.75162, 0.75162, 2.65509]),
    ("models_gltf/Avocado/Avocado.gltf", 682, [-0.02128, -0.01381, -5e-05], [0.02128, 0.01381, 0.06285]),
    ("models_gltf/Suzanne/Suzanne.gltf", 3936, [-1.33691, -0.82568, -0.97461], [1.33691, 0.80078, 0.9502]),
    ("chess-capture/scene/bishop.obj", 7104, [-0.13532, -0.13532, 0.0], [0.13532, 0.13532, 0.599]),
    ("chess-capture/scene/pawn.obj", 5376, [-0.13532, -0.13532, 0.0], [0.13532, 0.13532, 0.385]),
    ("chess-capture/scene/queen.obj", 6720, [-0.13532, -0.13532, 0.0], [0.13532, 0.13532, 0.705]),
    ("chess-capture/scene/rook.obj", 7488, [-0.13532, -0.13532, 0.0], [0.13532, 0.13532, 0.43094]),
    ("models_common/spot.obj", 5856, [-0.47155, -0.73678, -0.66891], [0.47155, 0.95365, 1.049]),
    ("models_common/stanford-bunny.obj", 69451, [-0.09469, 0.03299, -0.06187], [0.06101, 0.18732, 0.0588]),
    ("models_cornell/cornell_box.obj", 36, [0.0, 0.0, 0.0], [556.0, 548.8, 559.2]),
    ("models_cornell/cornell_box_multimaterial.obj", 36, [0.0, 0.0, 0.0], [556.0, 548.8, 559.2]),
];

#[test]
fn models_of_others_have_their_triangles_and_size() {
    let Some(data) = data() else { return };
    for (name, triangles, low, high) in MODELS {
        let model = read_model(&data.join(name), None).unwrap();
        holds(&model);
        assert_eq!(model.parts.iter().map(|part| part.mesh.triangles.len()).sum::<usize>(), triangles, "{name}");
        let found = bounds(&model);
        let tolerance = 1e-5 * found.1.abs().max_element().max(1.0);
        assert!(found.0.abs_diff_eq(low.into(), tolerance), "{name} begins at {}", found.0);
        assert!(found.1.abs_diff_eq(high.into(), tolerance), "{name} ends at {}", found.1);
    }
}

#[test]
fn an_avocado_is_green_in_its_flesh_and_no_metal() {
    let Some(data) = data() else { return };
    let model = read_model(&data.join("models_gltf/Avocado/Avocado.gltf"), Some(Up::Y)).unwrap();
    let surface = &model.parts[0].surface;
    assert!(surface.normal_map.is_some());
    let Material::MetallicRoughness { base_colour, roughness_metallic, .. } = &surface.material else { panic!() };
    assert!(matches!(base_colour, Texture::Picture(picture) if picture.picture.size() == (2048, 2048)));
    let mean = |texture: &Texture| {
        let uvs = &model.parts[0].mesh.uvs;
        uvs.iter().map(|uv| texture.at(*uv)).sum::<Vec3>() / uvs.len() as f32
    };
    let (colour, packed) = (mean(base_colour), mean(roughness_metallic));
    assert!(colour.y > colour.x && colour.x > colour.z, "{colour}");
    assert!(packed.z < 0.05 && packed.y > 0.2, "{packed}");
}

#[test]
fn the_walls_of_the_cornell_box_have_their_colours() {
    let Some(data) = data() else { return };
    let model = read_model(&data.join("models_cornell/cornell_box.obj"), Some(Up::Y)).unwrap();
    assert_eq!(model.parts.len(), 8, "the front wall has no faces");
    let colour = |name: &str| {
        let part = model.parts.iter().find(|part| part.name == name).unwrap();
        let Material::Diffuse { reflectance } = &part.surface.material else { panic!() };
        reflectance.at(Vec2::ZERO)
    };
    assert_eq!((colour("red_wall"), colour("green_wall"), colour("floor")), (Vec3::X, Vec3::Y, Vec3::ONE));
}
