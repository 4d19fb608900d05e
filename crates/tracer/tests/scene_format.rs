//! FORMAT.md §6 is what the reader does: its example is read, its defaults are the defaults, and what it does not allow is
//! refused by an error that says where, what was expected and what came.

#![allow(clippy::unwrap_used)] // in helpers of tests too

use std::path::Path;

use relumine_lamp::Light;
use relumine_radiometry::files::{ExrSample, write_exr, write_png8};
use relumine_radiometry::{Image, Radiance};
use relumine_tracer::{PathOptions, Rendered, Rendering, Scene};
use tempfile::TempDir;

const HEAD: &str = r#"format = "relumine-scene/1"
[camera]
position = [0, -4, 3]
target = [0, 0, 0.2]
horizontal_fov_deg = 20
width = 12
height = 8
"#;

const MATTE: &str = "[[material]]\nname = \"matte\"\ndiffuse.reflectance = [0.5, 0.5, 0.5]\n";

/// The text of the example in FORMAT.md.
fn example() -> &'static str {
    let format = include_str!("../../../FORMAT.md");
    let section = &format[format.find("## 6. Scene description").unwrap()..];
    let start = section.find("```toml\n").unwrap() + "```toml\n".len();
    &section[start..start + section[start..].find("```").unwrap()]
}

/// A folder with the files that the example names.
fn folder() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let picture = Image::from_pixels(2, 2, vec![[0.2, 0.4, 0.6]; 4]);
    write_png8(&folder.path().join("cloth.png"), &picture).unwrap();
    std::fs::write(folder.path().join("vase.obj"), "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n").unwrap();
    folder
}

fn parse(text: &str) -> Scene {
    let folder = folder();
    Scene::parse(&folder.path().join("scene.toml"), text).unwrap()
}

fn refused(text: &str) -> String {
    match Scene::parse(Path::new("no/such/scene.toml"), text) {
        Ok(_) => panic!("this was accepted:\n{text}"),
        Err(error) => error.to_string(),
    }
}

fn render(scene: &Scene) -> Rendered {
    let text = "format = \"relumine-light/1\"\n[environment]\nradiance = [1, 1, 1]";
    let light = Light::parse(Path::new("light.toml"), text).unwrap();
    Rendering::new(scene, &light, PathOptions { samples: 8, bounces: 3, seed: 1 }, false).unwrap().run()
}

#[test]
fn the_example_is_read() {
    let scene = parse(example());
    assert_eq!(scene.picture_size(), (240, 160));
    // Plane, box, ball, lathe of five pieces with the one between the point given twice empty, and the model.
    let lathe = 4 * 5 * 96 * 2 - 96 - 96;
    assert_eq!(scene.shapes(), 2 + 12 + 1 + lathe + 1);
    assert!((scene.camera().position().y + 4.3).abs() < 1e-12);
}

#[test]
fn what_is_left_out_has_the_documented_default() {
    let mut said = example().to_owned();
    for (there, default) in [
        ("index = 1.55 ", "index = 1.5 "),
        ("tint = [1.0, 0.8, 0.4]", "tint = [1, 1, 1]"),
        ("fields = [6, 6]", "fields = [8, 8]"),
        ("scale = 0.2 ", "scale = 1 "),
        ("rotate_deg = [0, 0, 30] ", "rotate_deg = [0, 0, 0] "),
        ("translate_m = [-0.3, -0.2, 0]", "translate_m = [0, 0, 0]"),
    ] {
        assert!(said.contains(there), "{there} is not in the example");
        said = said.replace(there, default);
    }
    let mut left_out = said.clone();
    for default in [
        "up = [0, 0, 1] ",
        "index = 1.49 ",
        "index = 1.5 ",
        "alpha = 0.0 ",
        "tint = [1, 1, 1]",
        ", fields = [8, 8]",
        "smooth = true ",
        "segments = 96 ",
        ", up = \"z\"",
        "scale = 1 ",
        "rotate_deg = [0, 0, 0] ",
        "translate_m = [0, 0, 0]",
    ] {
        assert_eq!(left_out.matches(default).count(), 1, "{default}");
        left_out = left_out.replace(default, "");
    }
    let [said, left_out] = [said, left_out].map(|text| render(&parse(&text).with_picture_size(48, 32)));
    assert!(said.picture == left_out.picture && said.coverage == left_out.coverage);
    assert!(said.coverage.iter().any(|share| *share > 0.0));
}

#[test]
fn a_scene_without_objects_is_black() {
    for rest in ["", MATTE] {
        let rendered = render(&parse(&format!("{HEAD}{rest}")));
        assert!(rendered.picture.pixels().iter().all(|pixel| *pixel == [0.0; 3]));
        assert!(rendered.coverage.iter().all(|share| *share == 0.0));
    }
}

/// Whether a rod of length one along z, placed like this, is found at a point: a camera far above looks at it.
fn is_at(placing: &str, [x, y]: [f64; 2]) -> bool {
    let text = format!(
        "format = \"relumine-scene/1\"\n[camera]\nposition = [{x}, {y}, 50]\ntarget = [{x}, {y}, 0]\nup = [0, 1, 0]\n\
         horizontal_fov_deg = 0.01\nwidth = 1\nheight = 1\n{MATTE}[[object]]\nmaterial = \"matte\"\n\
         box.size_m = [0.1, 0.1, 1]\n{placing}\n"
    );
    render(&parse(&text)).coverage[0] == 1.0
}

#[test]
fn objects_are_scaled_then_turned_about_x_then_y_then_z_then_moved() {
    // About x the rod's end goes from +z to −y; about y to +x.
    for (placing, end) in [
        ("rotate_deg = [90, 0, 0]", [0.0, -0.9]),
        ("rotate_deg = [0, 90, 0]", [0.9, 0.0]),
        ("rotate_deg = [90, 0, 90]", [0.9, 0.0]),
        ("rotate_deg = [90, 90, 0]", [0.0, -0.9]),
        ("rotate_deg = [0, 90, 90]", [0.0, 0.9]),
        ("rotate_deg = [0, 90, 0]\nscale = 2\ntranslate_m = [0, 3, 0]", [1.9, 3.0]),
    ] {
        assert!(is_at(placing, end), "{placing}");
        assert!(!is_at(placing, [-end[0], -end[1]]), "{placing}");
    }
}

#[test]
fn pictures_are_decoded_as_their_kind_says_and_never_brighter_than_one() {
    let folder = tempfile::tempdir().unwrap();
    write_exr(
        &folder.path().join("float.exr"),
        &Image::<Radiance>::from_pixels(1, 1, vec![[0.5, 7.0, 0.0]]),
        ExrSample::Float,
        &[],
    )
    .unwrap();
    // 188 of 255 in sRGB is half of the light.
    write_png8(&folder.path().join("integer.png"), &Image::from_pixels(1, 1, vec![[188.0 / 255.0; 3]])).unwrap();
    for (file, expected) in [("float.exr", [0.5, 1.0, 0.0]), ("integer.png", [0.503, 0.503, 0.503])] {
        let text = format!(
            "format = \"relumine-scene/1\"\n[camera]\nposition = [0, 0, 5]\ntarget = [0, 0, 0]\nup = [0, 1, 0]\n\
             horizontal_fov_deg = 5\nwidth = 4\nheight = 4\n[[material]]\nname = \"m\"\n\
             diffuse.reflectance.picture = \"{file}\"\n[[object]]\nmaterial = \"m\"\nplane.size_m = [4, 4]\n"
        );
        let scene = Scene::parse(&folder.path().join("scene.toml"), &text).unwrap();
        let light = "format = \"relumine-light/1\"\n[[sun]]\ndirection = [0, 0, -1]\nirradiance_w_m2 = [1, 1, 1]";
        let light = Light::parse(Path::new("light.toml"), light).unwrap();
        let options = PathOptions { samples: 1, bounces: 1, seed: 1 };
        let rendered = Rendering::new(&scene, &light, options, false).unwrap().run();
        for (came, expected) in rendered.picture.pixel(1, 1).iter().zip(expected) {
            assert!((came * std::f32::consts::PI - expected).abs() < 2e-3, "{file}: {came}");
        }
    }
}

/// What stands in [`VALID`], what stands there instead, and the error after the path of the file; ⏎ is a new line.
const CASES: &str = r#"
relumine-scene/1
relumine-scene/2
format: expected "relumine-scene/1", found "relumine-scene/2"

up = [0, 0, 1]
upp = [0, 0, 1]
:5: unknown key `upp`: did you mean `up`? (known here: position, target, up, horizontal_fov_deg, width, height)

target = [0, 0, 0]
(nothing)
:2: missing field `target`

target = [0, 0, 0]
target = [0, -4, 0]
camera: target: expected apart from the position, found [0.0, -4.0, 0.0]

up = [0, 0, 1]
up = [0, 2, 0]
camera: up: expected not along the view, found [0.0, 2.0, 0.0]

up = [0, 0, 1]
up = [0, 0, nan]
camera: up: expected at most 1000 m from the origin, found [0.0, 0.0, NaN]

position = [0, -4, 0]
position = [0, -1e200, 0]
camera: position: expected at most 1000 m from the origin, found [0.0, -1e200, 0.0]

horizontal_fov_deg = 20
horizontal_fov_deg = 180
camera: horizontal_fov_deg: expected above 0 and below 180, found 180

horizontal_fov_deg = 20
horizontal_fov_deg = nan
camera: horizontal_fov_deg: expected above 0 and below 180, found NaN

width = 4
width = 0
camera: width, height: expected 1 to 268435456 pixels, found 0 × 3

width = 4
width = 9223372036854775807
camera: width, height: expected 1 to 268435456 pixels, found 9223372036854775807 × 3

width = 4
width = -1
:7: invalid value: integer `-1`, expected usize

name = "a"
name = "b"
material "b": the name is given twice

diffuse.reflectance = [1, 1, 1]
(nothing)
material "a": expected one of diffuse, conductor, plastic, glass, found none

diffuse.reflectance = [1, 1, 1]
diffuse.reflectance = [1, 1, 1] ⏎ glass = {}
material "a": expected one of diffuse, conductor, plastic, glass, found diffuse and glass

diffuse.reflectance = [1, 1, 1]
diffuse.reflectance = [1, nan, 1]
material "a": diffuse.reflectance: expected red, green and blue, 0 to 1, found [1.0, NaN, 1.0]

diffuse.reflectance = [1, 1, 1]
diffuse.reflectance = [1, 1]
:11: invalid length 2, expected a list of 3

diffuse.reflectance = [1, 1, 1]
diffuse.reflectance = 1
:11: invalid type: integer `1`, expected a colour [red, green, blue], { checkerboard, fields } or { picture }

diffuse.reflectance = [1, 1, 1]
diffuse.reflectance = { pictur = "a.png" }
:11: unknown key `pictur`: did you mean `picture`? (known here: checkerboard, fields, picture)

diffuse.reflectance = [1, 1, 1]
diffuse.reflectance = { fields = [2, 2] }
material "a": diffuse.reflectance: expected a colour, or { checkerboard } with or without fields, or { picture }

diffuse.reflectance = [1, 1, 1]
diffuse.reflectance = { checkerboard = [[1, 1, 1], [0, 0, 0]], fields = [nan, 2] }
material "a": diffuse.reflectance: expected fields above 0 and at most 10000, found [NaN, 2.0]

metal = "Au"
metal = "Fe"
material "b": conductor: expected a metal of Ag, Al, Au, Cu, found "Fe"

metal = "Au"
metal = "Au", k = [1, 1, 1]
material "b": conductor: expected either metal, or eta and k, found metal and k

metal = "Au"
eta = [1, nan, 1], k = [1, 1, 1]
material "b": conductor: expected eta above 0 and k from 0, both at most 100, found [1.0, NaN, 1.0] and [1.0, 1.0, 1.0]

alpha = 0.25
alpha = 2
material "b": conductor.alpha: expected 0 to 1, found 2

metal = "Au", alpha = 0.25
metal = "Au"
:14: missing field `alpha`

conductor = { metal = "Au", alpha = 0.25 }
glass = { alpha = 0.1, index = 1 }
material "b": glass.index: expected 1.01 to 4, found 1

conductor = { metal = "Au", alpha = 0.25 }
glass = { tint = [1, 1, 2] }
material "b": glass.tint: expected red, green and blue, 0 to 1, found [1.0, 1.0, 2.0]

conductor = { metal = "Au", alpha = 0.25 }
plastic = { diffuse = [0, 0, 0], index = 0.5, alpha = 0 }
material "b": plastic.index: expected 1 to 4, found 0.5

material = "a"
material = "aa"
object "ball": material: expected one of the scene, found "aa"; did you mean "a"?

material = "a"
material = "somewhere"
object "ball": material: expected one of the scene, found "somewhere"

material = "a"
(nothing)
object "ball": material: expected a name, found none: only models bring their own

sphere.radius_m = 0.5
(nothing)
object "ball": expected one of model, sphere, plane, box, lathe, found none

sphere.radius_m = 0.5
sphere.radius_m = 0.5 ⏎ box.size_m = [1, 1, 1]
object "ball": expected one of model, sphere, plane, box, lathe, found sphere and box

sphere.radius_m = 0.5
sphere.radius_m = -0.5
object "ball": sphere.radius_m: expected 0.000001 to 1000, found -0.5

sphere.radius_m = 0.5
sphere.radius_m = nan
object "ball": sphere.radius_m: expected 0.000001 to 1000, found NaN

sphere.radius_m = 0.5
sphere.radius_m = 999.5
object "ball": expected nothing beyond 1000 m along an axis, found a point at [1000.5, 999.5, 999.5]

sphere.radius_m = 0.5
sphere.radius_m = 500 ⏎ scale = 3
object "ball": sphere.radius_m times scale: expected 0.000001 to 1000, found 1500

sphere.radius_m = 0.5
plane.size_m = [1, nan]
object "ball": plane.size_m: expected 0.000001 to 1000, found NaN

sphere.radius_m = 0.5
box.size_m = [1, 1e30, 1]
object "ball": box.size_m: expected 0.000001 to 1000, found 1000000000000000000000000000000

sphere.radius_m = 0.5
box.size_m = [1, 1, 0]
object "ball": box.size_m: expected 0.000001 to 1000, found 0

sphere.radius_m = 0.5
box.size_m = [1, 1, 1] ⏎ scale = 2000
object "ball": expected nothing beyond 1000 m along an axis, found a point at [1001, -1000, 0]

translate_m = [1, 0, 0]
translate_m = [1000.5, 0, 0]
object "ball": translate_m: expected -1000 to 1000, found [1000.5, 0.0, 0.0]

translate_m = [1, 0, 0]
translate_m = [nan, 0, 0]
object "ball": translate_m: expected -1000 to 1000, found [NaN, 0.0, 0.0]

translate_m = [1, 0, 0]
rotate_deg = [0, inf, 0]
object "ball": rotate_deg: expected three angles, found [0.0, inf, 0.0]

translate_m = [1, 0, 0]
scale = 0
object "ball": scale: expected 0.000001 to 1000000, found 0

sphere.radius_m = 0.5
lathe.profile_m = [[1, 0]]
object "ball": lathe: expected 2 to 10000 points of the profile, found 1

sphere.radius_m = 0.5
lathe.profile_m = [[1, 0], [-1, 1]]
object "ball": lathe: expected [radius, height], a radius from 0, both at most 1000 m, found [-1.0, 1.0]

sphere.radius_m = 0.5
lathe.profile_m = [[1, 0], [1, nan]]
object "ball": lathe: expected [radius, height], a radius from 0, both at most 1000 m, found [1.0, NaN]

sphere.radius_m = 0.5
lathe = { profile_m = [[1, 0], [1, 1]], segments = 2 }
object "ball": lathe: expected 3 to 4096 segments, found 2

sphere.radius_m = 0.5
lathe.profile_m = [[0, 0], [0, 1]]
object "ball": lathe: expected a profile that turns a surface, found none off the axis

sphere.radius_m = 0.5
model = { file = "a.obj", up = "x" }
object "ball": model.up: expected "y" or "z", found "x"

sphere.radius_m = 0.5
model.fil = "a.obj"
:18: unknown key `fil`: did you mean `file`? (known here: file, up)
"#;

const VALID: &str = r#"format = "relumine-scene/1"
[camera]
position = [0, -4, 0]
target = [0, 0, 0]
up = [0, 0, 1]
horizontal_fov_deg = 20
width = 4
height = 3
[[material]]
name = "a"
diffuse.reflectance = [1, 1, 1]
[[material]]
name = "b"
conductor = { metal = "Au", alpha = 0.25 }
[[object]]
name = "ball"
material = "a"
sphere.radius_m = 0.5
translate_m = [1, 0, 0]
"#;

#[test]
fn an_error_says_where_what_was_expected_and_what_came() {
    parse(VALID);
    let mut wrong = Vec::new();
    for case in CASES.trim().split("\n\n") {
        let [from, to, expected] = case.lines().collect::<Vec<_>>().try_into().unwrap();
        let to = if to == "(nothing)" { String::new() } else { to.replace(" ⏎ ", "\n") };
        assert_eq!(VALID.matches(from).count(), 1, "{from}");
        let error = refused(&VALID.replace(from, &to));
        // With the line, or with the name of what is wrong.
        let space = if expected.starts_with(':') { "" } else { ": " };
        let expected = format!("no/such/scene.toml{space}{expected}");
        if error != expected {
            wrong.push(format!("{to}\n  expected {expected}\n  came     {error}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_file_that_is_not_there_is_named() {
    for (from, to, file) in [
        ("sphere.radius_m = 0.5", "model.file = \"lost.glb\"", "no/such/lost.glb"),
        ("diffuse.reflectance = [1, 1, 1]", "diffuse.reflectance.picture = \"lost.png\"", "no/such/lost.png"),
    ] {
        let error = refused(&VALID.replace(from, to));
        assert!(error.contains(file) && error.contains("No such file"), "{error}");
    }
    let error = refused(&VALID.replace("sphere.radius_m = 0.5", "model.file = \"a.stl\""));
    assert_eq!(error, "no/such/a.stl: a name that ends in .gltf, .glb or .obj was expected");
    for name in ["lost.toml", "lost.obj", "lost"] {
        let error = Scene::read(&Path::new("no/such").join(name)).err().unwrap().to_string();
        assert!(error.starts_with(&format!("cannot read no/such/{name}: ")), "{error}");
    }
}

#[test]
fn a_list_has_as_many_numbers_as_it_should() {
    for (from, to, line, expected) in [
        ("position = [0, -4, 0]", "position = [0, -4, 0, 1]", 3, 3),
        ("target = [0, 0, 0]", "target = [0, 0]", 4, 3),
        ("diffuse.reflectance = [1, 1, 1]", "diffuse.reflectance = [1, 1, 1, 1]", 11, 3),
        (
            "diffuse.reflectance = [1, 1, 1]",
            "diffuse.reflectance.checkerboard = [[1, 1, 1], [1, 1, 1], [1, 1, 1]]",
            11,
            2,
        ),
        ("sphere.radius_m = 0.5", "lathe.profile_m = [[1, 0], [1, 0, 1]]", 18, 2),
        ("translate_m = [1, 0, 0]", "translate_m = [1, 0, 0, 0]", 19, 3),
    ] {
        let error = refused(&VALID.replace(from, to));
        let found = if to.contains("target") { 2 } else { expected + 1 };
        let wanted = format!("no/such/scene.toml:{line}: invalid length {found}, expected a list of {expected}");
        assert_eq!(error, wanted);
    }
}

#[test]
fn a_few_words_cannot_ask_for_gigabytes() {
    let lathe = |points: usize, segments: usize| {
        let profile: Vec<String> = (0..points).map(|i| format!("[1,{}]", i as f64 / 100.0)).collect();
        format!(
            "[[object]]\nmaterial = \"a\"\n[object.lathe]\nprofile_m = [{}]\nsegments = {segments}\n",
            profile.join(",")
        )
    };
    // One, or many that are harmless alone.
    for (text, triangles) in [
        (lathe(10_000, 4096), 9999 * 5 * 4096 * 2),
        (lathe(101, 1000).repeat(5), 5_000_000),
        (lathe(3, usize::MAX >> 2), usize::MAX),
    ] {
        assert_eq!(
            refused(&format!("{VALID}{text}")),
            format!(
                "no/such/scene.toml: lathe: expected at most 4194304 triangles of all lathes, found {triangles}: fewer \
                 segments or points make fewer"
            )
        );
    }
    let folder = tempfile::tempdir().unwrap();
    let wall = format!("v 0 0 0\nv 1 0 0\nv 0 0 1\n{}", "f 1 2 3\n".repeat(1 << 14));
    std::fs::write(folder.path().join("wall.obj"), wall).unwrap();
    let objects = "[[object]]\nmodel.file = \"wall.obj\"\n".repeat((1 << 12) + 1);
    let error = Scene::parse(&folder.path().join("scene.toml"), &format!("{HEAD}{objects}")).err().unwrap().to_string();
    let expected =
        "object \"4096\": model: expected at most 67108864 triangles of it and the models before, found more";
    assert!(error.ends_with(expected), "{error}");
    let materials: String = (0..4097).map(|i| format!("[[material]]\nname = \"m{i}\"\nglass = {{}}\n")).collect();
    assert_eq!(
        refused(&format!("{HEAD}{materials}")),
        "no/such/scene.toml: material: expected at most 4096, found 4097"
    );
}

#[test]
fn a_model_is_a_scene_by_itself() {
    let folder = folder();
    let scene = Scene::read(&folder.path().join("vase.obj")).unwrap();
    assert_eq!((scene.shapes(), scene.picture_size()), (1, (480, 480)));
    let coverage = render(&scene.with_picture_size(24, 24)).coverage;
    assert!(coverage.contains(&1.0));
    // All of it is seen.
    let border = |i: usize| [i / 24, i % 24].iter().any(|at| [0, 23].contains(at));
    assert!(coverage.iter().enumerate().all(|(i, share)| !border(i) || *share == 0.0));
    std::fs::write(folder.path().join("far.obj"), "v 0 0 0\nv 2000 0 0\nv 0 0 1\nf 1 2 3\n").unwrap();
    let error = Scene::read(&folder.path().join("far.obj")).err().unwrap().to_string();
    assert!(
        error.contains("model: expected triangles within 1000 m of the origin, found one at [2000, 0, 0]"),
        "{error}"
    );
}
