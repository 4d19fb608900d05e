//! glTF 2.0, text and binary (Khronos, *The glTF 2.0 Specification*; sections are quoted from it).
//!
//! The crate `gltf` gives the types of the JSON text. Its validation and its accessors are not used, because they panic on
//! indices that lead nowhere: here every index is looked up with [`Document::get`].

mod accessor;
mod buffers;
mod container;
mod material;
mod nodes;
mod primitive;
mod texture;
mod uri;

use gltf::json::root::Get;
use gltf::json::{Index, Root};

use self::buffers::Buffers;
use self::material::Materials;
use super::file::{ModelFile, short};
use super::{MAX_PRIMITIVES, ModelError, Up};
use crate::{Model, Part};

/// The longest JSON text; much of a long one is buffers in `data:` URIs.
const MAX_JSON_BYTES: usize = 1 << 28;

/// What a file may require and still be shown as it is meant.
const EXTENSIONS: [&str; 5] = [
    "KHR_materials_ior",
    "KHR_materials_transmission",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];

/// The text, and the bytes that it speaks of.
struct Document<'a> {
    file: &'a ModelFile<'a>,
    root: Root,
    buffers: Buffers<'a>,
}

impl Document<'_> {
    /// What `index` means, which `place` names; `list` is the list's name.
    fn get<T>(&self, place: &str, list: &str, index: Index<T>) -> Result<&T, ModelError>
    where
        Root: Get<T>,
    {
        self.root.get(index).ok_or_else(|| self.file.malformed(place, format!("there is no {list}[{}]", index.value())))
    }
}

/// Reads a model whose bytes are those of `file`.
pub(super) fn read(file: &ModelFile<'_>, bytes: &[u8], up: Option<Up>) -> Result<Model, ModelError> {
    let document = open(file, bytes)?;
    let up = up.unwrap_or(Up::Y).world_from_file();
    let mut materials = Materials::default();
    let mut model = Model::default();
    let (mut triangles, mut primitives) = (0, 0);
    for (node, world_from_node) in nodes::of_scene(&document)? {
        let node = &document.root.nodes[node];
        let Some(mesh) = node.mesh else { continue };
        let list = document.get("nodes", "meshes", mesh)?;
        let name = node.name.as_ref().or(list.name.as_ref());
        let name = name.map_or_else(|| format!("meshes[{}]", mesh.value()), |name| short(name));
        for (number, primitive) in list.primitives.iter().enumerate() {
            let place = format!("meshes[{}].primitives[{number}]", mesh.value());
            primitives += 1;
            if primitives > MAX_PRIMITIVES {
                let reason = format!("at most {MAX_PRIMITIVES} primitives were expected, the scene has more");
                return Err(file.malformed(place, reason));
            }
            let material = materials.get(&document, &place, primitive.material)?;
            let Some(raw) = primitive::read(&document, &place, primitive, material.uv_set, &mut triangles)? else {
                continue;
            };
            let placed = super::placement::placed(raw, &(up * world_from_node));
            let mesh = placed.map_err(|reason| file.malformed(&place, reason))?;
            if !mesh.triangles.is_empty() {
                model.parts.push(Part { name: name.clone(), mesh, surface: material.surface.clone() });
            }
        }
    }
    Ok(model)
}

fn open<'a>(file: &'a ModelFile<'a>, bytes: &'a [u8]) -> Result<Document<'a>, ModelError> {
    let (json, binary) = container::split(file, bytes)?;
    if json.len() > MAX_JSON_BYTES {
        let reason = format!("at most {MAX_JSON_BYTES} bytes of JSON were expected, here are {}", json.len());
        return Err(file.malformed("the file", reason));
    }
    let root = Root::from_slice(json).map_err(|error| file.malformed("JSON", error))?;
    let version = &root.asset.version;
    if version.split('.').next() != Some("2") {
        return Err(file.unsupported("asset.version", format!("2.0 was expected, it is {:?}", short(version))));
    }
    for name in &root.extensions_required {
        if !EXTENSIONS.contains(&name.as_str()) {
            let what = format!("the extension {:?}; known are {}", short(name), EXTENSIONS.join(", "));
            return Err(file.unsupported("extensionsRequired", what));
        }
    }
    let buffers = Buffers::load(file, &root, binary)?;
    Ok(Document { file, root, buffers })
}
