//! The tree of nodes (§3.5): which of them the scene shows, and where each stands.

use glam::{DAffine3, DMat4, DQuat, DVec3, Mat4, Vec3};
use gltf::json::scene::Node;

use super::{Document, ModelError};

/// The nodes of the default scene, or the first, each before its children, with its place in the world of the file.
///
/// A node has one parent (§3.5.2). One that is met twice is refused, and so is every cycle.
pub(super) fn of_scene(document: &Document<'_>) -> Result<Vec<(usize, DAffine3)>, ModelError> {
    let root = &document.root;
    let scene = match root.scene {
        Some(scene) => document.get("scene", "scenes", scene)?,
        None => root.scenes.first().ok_or_else(|| document.file.malformed("scenes", "a scene was expected"))?,
    };
    let mut met = vec![false; root.nodes.len()];
    let mut found = Vec::new();
    let mut waiting: Vec<_> = scene.nodes.iter().rev().map(|node| (*node, DAffine3::IDENTITY)).collect();
    while let Some((index, world_from_parent)) = waiting.pop() {
        let node = document.get("the scene", "nodes", index)?;
        let place = format!("nodes[{}]", index.value());
        if std::mem::replace(&mut met[index.value()], true) {
            return Err(document.file.malformed(place, "one parent was expected, but the scene comes here twice"));
        }
        let parent_from_node = transform(node).map_err(|reason| document.file.malformed(&place, reason))?;
        let world_from_node = world_from_parent * parent_from_node;
        found.push((index.value(), world_from_node));
        // On a stack of our own, lest a long chain of nodes ends the program's.
        waiting.extend(node.children.iter().flatten().rev().map(|child| (*child, world_from_node)));
    }
    Ok(found)
}

fn transform(node: &Node) -> Result<DAffine3, String> {
    if let Some(matrix) = &node.matrix {
        let matrix = Mat4::from_cols_array(matrix);
        if !matrix.is_finite() || matrix.row(3).to_array() != [0.0, 0.0, 0.0, 1.0] {
            return Err("a finite matrix whose last row is 0, 0, 0, 1 was expected".to_owned());
        }
        return Ok(DAffine3::from_mat4(DMat4::from_cols_array(&matrix.to_cols_array().map(f64::from))));
    }
    let vector = |value: Option<[f32; 3]>, absent: DVec3| value.map_or(absent, |value| Vec3::from(value).as_dvec3());
    let (scale, translation) = (vector(node.scale, DVec3::ONE), vector(node.translation, DVec3::ZERO));
    let [x, y, z, w] = node.rotation.map_or([0.0, 0.0, 0.0, 1.0], |rotation| rotation.0).map(f64::from);
    let rotation = DQuat::from_xyzw(x, y, z, w);
    let length = rotation.length();
    if !(length.is_finite() && length > 0.0) {
        return Err(format!("a rotation as a unit quaternion was expected, it is [{x}, {y}, {z}, {w}]"));
    }
    Ok(DAffine3::from_scale_rotation_translation(scale, rotation / length, translation))
}
