//! Models: any bytes give one that holds what meshes promise, or an error that names a file. The first byte chooses the
//! format: `g` text of glTF, `b` its binary container, any other OBJ. What follows a line `%` is the file `beside`: a buffer
//! or a library of materials. `picture.png` lies there too.
#![no_main]

use std::fs;
use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use relumine_tracer::{Model, read_model};

struct Folder {
    _folder: tempfile::TempDir,
    path: PathBuf,
}

static FOLDER: LazyLock<Folder> = LazyLock::new(|| {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().to_path_buf();
    let picture = concat!(env!("CARGO_MANIFEST_DIR"), "/beside/picture.png");
    fs::copy(picture, path.join("picture.png")).expect("a picture");
    Folder { _folder: folder, path }
});

fuzz_target!(|bytes: &[u8]| {
    let Some((kind, bytes)) = bytes.split_first() else { return };
    let cut = b"\n%\n";
    // The container has no lines.
    let middle = bytes.windows(cut.len()).position(|three| three == cut).filter(|_| *kind != b'b');
    let (text, beside) = match middle {
        Some(middle) => (&bytes[..middle + 1], &bytes[middle + cut.len()..]),
        None => (bytes, &b""[..]),
    };
    let name = match kind {
        b'g' => "a.gltf",
        b'b' => "a.glb",
        _ => "a.obj",
    };
    let path = FOLDER.path.join(name);
    fs::write(&path, text).expect("a model");
    fs::write(FOLDER.path.join("beside"), beside).expect("a file beside it");
    match read_model(&path, None) {
        Ok(model) => holds(&model),
        Err(error) => {
            let folder = FOLDER.path.display().to_string();
            assert!(error.to_string().contains(&folder), "{error}");
        }
    }
});

fn holds(model: &Model) {
    assert!(!model.parts.is_empty());
    for part in &model.parts {
        let mesh = &part.mesh;
        let count = mesh.positions.len();
        assert!(mesh.positions.iter().all(|position| position.is_finite()));
        assert!(mesh.normals.is_empty() || mesh.normals.len() == count);
        assert!(mesh.normals.iter().all(|normal| normal.is_normalized()));
        assert!(mesh.uvs.is_empty() || mesh.uvs.len() == count);
        assert!(mesh.uvs.iter().all(|uv| uv.is_finite()));
        assert!(!mesh.triangles.is_empty());
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|corner| mesh.positions[corner as usize]);
            assert!((b - a).cross(c - a).normalize().is_normalized());
        }
    }
}
