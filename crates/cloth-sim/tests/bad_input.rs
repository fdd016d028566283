//! What a scene or its assets may get wrong once meshes are known: each error names it, and nothing is built.

mod common;

use cloth_sim::core::mesh::{TriMesh, Vec3, generators};
use cloth_sim::{Assets, Scene, SimError, Simulation, SimulationOptions};
use common::{MATERIAL, hanging, scene};

fn refuse(scene: &Scene, assets: Assets) -> SimError {
    match Simulation::new(scene, assets, SimulationOptions::default()) {
        Err(error) => error,
        Ok(_) => panic!("accepted"),
    }
}

/// The error text of a cloth whose mesh is the asset "sheet".
fn mesh_error(mesh: TriMesh) -> String {
    let text =
        format!("duration = 1.0\n[[cloth]]\nname = \"skirt\"\nmesh = {{ asset = \"sheet\" }}\n{MATERIAL}\n");
    let mut assets = Assets::default();
    assets.meshes.insert("sheet".into(), mesh);
    let text = refuse(&scene(&text), assets).to_string();
    assert!(
        text.starts_with("test.toml:4: cloth[0].mesh: expected ") && text.contains("\"skirt\""),
        "{text}"
    );
    text
}

fn sheet() -> TriMesh {
    generators::grid(1.0, 1.0, 3, 3).expect("a grid")
}

#[test]
fn defects_of_a_mesh_are_named_with_its_cloth() {
    let mut mesh = sheet();
    mesh.vertices[5].x = f64::NAN;
    assert!(mesh_error(mesh).contains("vertex 5"));
    let mut mesh = sheet();
    mesh.triangles[2][1] = 77;
    assert!(mesh_error(mesh).contains("triangle 2 has 77"));
    let mut mesh = sheet();
    mesh.triangles[3][1] = mesh.triangles[3][0];
    assert!(mesh_error(mesh).contains("triangle 3"));
    let mut mesh = sheet();
    mesh.vertices.push(Vec3::zeros());
    assert!(mesh_error(mesh).contains("vertex 9"));
    let mut mesh = sheet();
    mesh.vertices.push(Vec3::new(0.1, 0.5, 0.1));
    let edge = mesh.triangles[0];
    mesh.triangles.push([edge[0], edge[1], 9]);
    mesh.triangles.push([edge[1], edge[0], 9]);
    mesh.uv = None;
    assert!(mesh_error(mesh).contains(&format!("edge ({}, {})", edge[0].min(edge[1]), edge[0].max(edge[1]))));
    assert!(mesh_error(TriMesh::default()).contains("at least one triangle"));
}

#[test]
fn meshes_of_absurd_size_are_refused_before_they_are_made() {
    let text = |count: &str| {
        let mesh = format!(
            "mesh = {{ generator = \"grid\", width = 1.0, height = 1.0, nx = {count}, ny = {count} }}"
        );
        format!("duration = 1.0\n[[cloth]]\nname = \"skirt\"\n{mesh}\n{MATERIAL}\n")
    };
    assert!(Scene::parse_toml(&text("2048"), "a.toml").is_ok());
    for (count, got) in [("2049", "4198401"), ("65535", "4294836225"), ("4294967295", "18446744065119617025")]
    {
        let error = Scene::parse_toml(&text(count), "a.toml").expect_err("too large").to_string();
        assert_eq!(
            error,
            format!(
                "a.toml:4: cloth[0].mesh: expected at most 4194304 vertices in all generated meshes together, got {got}"
            )
        );
    }
}

#[test]
fn messages_quote_no_more_than_one_reads() {
    let long = "x".repeat(100_000);
    for text in [format!("{long} = 1"), format!("up = \"{long}\"")] {
        let error = Scene::parse_toml(&text, "a.toml").expect_err("no scene").to_string();
        assert!(error.len() < 1200 && error.contains("bytes more)"), "{} bytes", error.len());
    }
}

#[test]
fn a_non_manifold_edge_is_allowed_without_bending() {
    let mut mesh = sheet();
    mesh.vertices.push(Vec3::new(0.1, 0.5, 0.1));
    let edge = mesh.triangles[0];
    mesh.triangles.push([edge[0], edge[1], 9]);
    mesh.uv = None;
    let text = "duration = 1.0\n[[cloth]]\nname = \"a\"\nmesh = { asset = \"sheet\" }\n\
        material = { areal_density = 0.1, in_plane = { model = \"spring\", stiffness = 10.0 } }\n";
    let mut assets = Assets::default();
    assets.meshes.insert("sheet".into(), mesh);
    assert!(Simulation::new(&scene(text), assets, SimulationOptions::default()).is_ok());
}

#[test]
fn missing_assets_are_named() {
    let text =
        format!("duration = 1.0\n[[cloth]]\nname = \"a\"\nmesh = {{ file = \"skirt.obj\" }}\n{MATERIAL}\n");
    let error = refuse(&scene(&text), Assets::default()).to_string();
    assert!(error.contains("test.toml:4: cloth[0].mesh.file") && error.contains("\"skirt.obj\""), "{error}");
    let mut assets = Assets::default();
    assets.meshes.insert("skirts.obj".into(), sheet());
    let error = refuse(&scene(&text), assets).to_string();
    assert!(error.contains("did you mean \"skirts.obj\"?"), "{error}");
}

#[test]
fn pins_out_of_range_and_twice_are_named() {
    let text = hanging(5, "rk4", 0.001).replace("vertices = [0, 4]", "vertices = [0, 25]");
    let error = refuse(&scene(&text), Assets::default());
    let SimError::InvalidScene(error) = error else { panic!("{error}") };
    assert_eq!(error.key, "cloth[0].pins[0].vertices[1]");
    assert_eq!(error.got, "25");
    assert!(error.expected.contains("0 to 24"));
    assert!(error.line.is_some());
    let text = hanging(5, "rk4", 0.001).replace("vertices = [0, 4]", "vertices = [4, 4]");
    assert!(refuse(&scene(&text), Assets::default()).to_string().contains("vertex 4 of \"cloth\" again"));
    let text =
        hanging(5, "rk4", 0.001).replace("vertices = [0, 4]", "box = { min = [5, 5, 5], max = [6, 6, 6] }");
    assert!(refuse(&scene(&text), Assets::default()).to_string().contains("pins[0].box"));
}

#[test]
fn sizes_of_generators_and_shapes_are_named_at_their_line() {
    let text = hanging(5, "rk4", 0.001).replace("width = 1.0", "width = -1.0");
    let error = refuse(&scene(&text), Assets::default()).to_string();
    assert!(error.contains("cloth[0].mesh.width: expected") && error.contains("-1"), "{error}");
    let text = hanging(5, "rk4", 0.001)
        + "[[collider]]\nname = \"ball\"\nshape = { type = \"sphere\", radius = 0.0 }\n";
    let error = refuse(&scene(&text), Assets::default()).to_string();
    assert!(error.contains("collider[0].shape.radius: expected"), "{error}");
}

#[test]
fn a_rest_shape_from_uv_needs_uv() {
    let text = "duration = 1.0\n[[cloth]]\nname = \"a\"\nrest = \"uv\"\nmesh = { asset = \"sheet\" }\n"
        .to_owned()
        + MATERIAL;
    let mut mesh = sheet();
    mesh.uv = None;
    let mut assets = Assets::default();
    assets.meshes.insert("sheet".into(), mesh);
    let error = refuse(&scene(&text), assets).to_string();
    assert!(error.contains("test.toml:4: cloth[0].rest"), "{error}");
}

#[test]
fn sequences_are_checked() {
    let text = hanging(5, "rk4", 0.001)
        + "[[collider]]\nname = \"walker\"\nsequence = { asset = \"walk\", fps = 10 }\n";
    let scene = scene(&text);
    let walk = |frames: Vec<Vec<Vec3>>| {
        let mut assets = Assets::default();
        let triangles = vec![[0, 1, 2]];
        assets.sequences.insert("walk".into(), cloth_sim::Sequence { triangles, frames, fps: None });
        assets
    };
    let good = vec![Vec3::zeros(), Vec3::x(), Vec3::y()];
    assert!(refuse(&scene, Assets::default()).to_string().contains("\"walk\""));
    assert!(refuse(&scene, walk(vec![])).to_string().contains("frames"));
    let short = walk(vec![good.clone(), good[..2].to_vec()]);
    assert!(refuse(&scene, short).to_string().contains("2 in frame 1"));
    let mut bad = good.clone();
    bad[1].z = f64::INFINITY;
    assert!(refuse(&scene, walk(vec![good.clone(), bad])).to_string().contains("frame 1, vertex 1"));
    assert!(Simulation::new(&scene, walk(vec![good]), SimulationOptions::default()).is_ok());
}

#[test]
fn arguments_are_checked() {
    let scene = scene(&hanging(5, "rk4", 0.001));
    let none = SimulationOptions { threads: Some(0), ..SimulationOptions::default() };
    let error = Simulation::new(&scene, Assets::default(), none).err().expect("no thread");
    assert!(matches!(error, SimError::InvalidArgument { name: "threads", .. }), "{error}");
    let mut sim = common::build(&scene, 1);
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        let error = common::advance(&mut sim, bad).unwrap_err();
        assert!(matches!(error, SimError::InvalidArgument { name: "seconds", .. }), "{error}");
    }
    common::advance(&mut sim, 0.0).unwrap();
    assert_eq!(sim.step_count(), 0);
}

#[test]
fn what_is_no_checkpoint_is_refused() {
    let sim = common::build(&scene(&hanging(5, "rk4", 0.001)), 1);
    let good = sim.checkpoint();
    assert!(Simulation::resume(&good, None).is_ok());
    let refused = |bytes: &[u8]| match Simulation::resume(bytes, None) {
        Err(SimError::InvalidCheckpoint { expected, got }) => format!("{expected} / {got}"),
        Err(other) => panic!("{other}"),
        Ok(_) => panic!("accepted"),
    };
    assert!(refused(b"").contains("CLOTHSIM"));
    assert!(refused(b"PK\x03\x04 something else altogether").contains("CLOTHSIM"));
    for cut in [10, 30, good.len() / 2, good.len() - 1] {
        refused(&good[..cut]);
    }
    let mut long = good.clone();
    long.push(0);
    assert!(refused(&long).contains("tail"));
    let mut version = good.clone();
    version[8] = 99;
    assert!(refused(&version).contains("version 99"));
    for at in [25, good.len() / 2, good.len() - 20, good.len() - 3] {
        let mut damaged = good.clone();
        damaged[at] ^= 4;
        assert!(refused(&damaged).contains("checksum"), "byte {at}");
    }
}

/// A scene with a value for every kind of bound.
const SIZES: &str = r#"
duration = 1.0
gravity = [0.0, -9.81, 0.0]
[time]
dt = 0.005
[air]
wind = [1.0, 0.0, 0.0]
density = 1.2
drag = 0.1
damping = 0.3
[contact]
thickness = 0.004
friction = 0.3
repulsion_stiffness = 20.0
[[cloth]]
name = "cloth"
mesh = { generator = "grid", width = 1.0, height = 1.0, nx = 5, ny = 5 }
material = { areal_density = 0.2, in_plane = { model = "baraff-witkin", warp = 210.0, weft = 200.0, shear = 30.0, damping = 0.002 }, bending = { model = "hinge", rigidity = 1e-5, damping = 0.003 } }
warp = [1.0, 0.0, 0.0]
position = [0.0, 2.0, 0.0]
velocity = [0.0, 0.0, 0.1]
rotation = { axis = [0.0, 1.0, 0.0], angle = 0.5 }
pins = [{ vertices = [0, 20], keyframes = [{ time = 0.25, position = [0.0, 0.0, 0.0] }] }]
[[collider]]
name = "ball"
shape = { type = "sphere", radius = 0.4, tolerance = 0.01 }
position = [0.0, 0.5, 0.0]
[output]
fps = 60.0
"#;

#[test]
fn absurd_numbers_are_named_with_their_bound() {
    assert!(Simulation::new(&scene(SIZES), Assets::default(), SimulationOptions::default()).is_ok());
    let check = |from: &str, to: &str, key: &str, bound: &str| {
        assert!(SIZES.contains(from), "{from}");
        let error = Scene::parse_toml(&SIZES.replace(from, to), "test.toml").expect_err(to);
        assert_eq!((error.key.as_str(), error.file.as_deref()), (key, Some("test.toml")), "{error}");
        assert!(error.line.is_some() && error.expected.contains(bound), "{error}");
        let value: f64 =
            to.rsplit(['=', '[', ',', ' ']).next().unwrap_or("").trim_end_matches(']').parse().unwrap();
        assert!(error.got.contains(&format!("{value:?}")), "{error}");
    };
    check("width = 1.0", "width = 1e300", "cloth[0].mesh.width", "at most 1e9 m");
    check("height = 1.0", "height = 1e-30", "cloth[0].mesh.height", "at least 1e-7 m");
    check("radius = 0.4", "radius = 1e300", "collider[0].shape.radius", "at most 1e9 m");
    check("tolerance = 0.01", "tolerance = 1e-200", "collider[0].shape.tolerance", "at least 1e-9 m");
    check("thickness = 0.004", "thickness = 1e300", "contact.thickness", "at most 1e6 m");
    check("thickness = 0.004", "thickness = 1e-300", "contact.thickness", "at least 1e-9 m");
    check(
        "repulsion_stiffness = 20.0",
        "repulsion_stiffness = 1e300",
        "contact.repulsion_stiffness",
        "1e12 N/m",
    );
    check("friction = 0.3", "friction = 1e300", "contact.friction", "at most 1e6");
    check("gravity = [0.0, -9.81, 0.0]", "gravity = [0.0, 0.0, 1e300]", "gravity", "at most 1e7 m/s²");
    check("wind = [1.0, 0.0, 0.0]", "wind = [0.0, 0.0, 1e200]", "air.wind", "at most 1e5 m/s");
    check("density = 1.2", "density = 1e300", "air.density", "at most 1e5 kg/m³");
    check("drag = 0.1", "drag = 1e300", "air.drag", "at most 1e6");
    check("damping = 0.3", "damping = 1e300", "air.damping", "at most 1e12");
    check(
        "areal_density = 0.2",
        "areal_density = 1e300",
        "cloth[0].material.areal_density",
        "at most 1e6 kg/m²",
    );
    check("warp = 210.0", "warp = 1e300", "cloth[0].material.in_plane.warp", "at most 1e12 N/m");
    check("shear = 30.0", "shear = 1e300", "cloth[0].material.in_plane.shear", "at most 1e12 N/m");
    check("rigidity = 1e-5", "rigidity = 1e300", "cloth[0].material.bending.rigidity", "at most 1e9 N m");
    check("damping = 0.003", "damping = 1e300", "cloth[0].material.bending.damping", "at most 1e12");
    check("warp = [1.0, 0.0, 0.0]", "warp = [0.0, 0.0, 1e-200]", "cloth[0].warp", "at least 1e-100");
    check("axis = [0.0, 1.0, 0.0]", "axis = [0.0, 0.0, 1e300]", "cloth[0].rotation.axis", "at most 1e100");
    check("angle = 0.5", "angle = 1e300", "cloth[0].rotation.angle", "at most 1e9 rad");
    check("position = [0.0, 2.0, 0.0]", "position = [0.0, 0.0, 1e300]", "cloth[0].position", "at most 1e9 m");
    check(
        "velocity = [0.0, 0.0, 0.1]",
        "velocity = [0.0, 0.0, 1e300]",
        "cloth[0].velocity",
        "at most 1e5 m/s",
    );
    check("time = 0.25", "time = 1e300", "cloth[0].pins[0].keyframes[0].time", "at most 1e9 s");
    check("duration = 1.0", "duration = 1e300", "duration", "at most 1e9 s");
    check("dt = 0.005", "dt = 1e-300", "time.dt", "at least 1e-12 s");
    check("fps = 60.0", "fps = 1e300", "output.fps", "at most 1e12 1/s");
    // A box without end holds all vertices.
    let all = "pins = [{ box = { min = [-1e300, -1e300, -1e300], max = [1e300, 1e300, 1e300] } }]";
    let text =
        SIZES.lines().map(|l| if l.starts_with("pins") { all } else { l }).collect::<Vec<_>>().join("\n");
    assert!(Simulation::new(&scene(&text), Assets::default(), SimulationOptions::default()).is_ok());
}

#[test]
fn absurd_coordinates_of_assets_are_named() {
    let mut mesh = sheet();
    mesh.vertices[5].x = 1e300;
    let text = mesh_error(mesh);
    assert!(
        text.contains("at most 1e9 m in size") && text.contains("1e300") && text.contains("vertex 5"),
        "{text}"
    );
    let text = format!(
        "duration = 1.0\n[[cloth]]\nname = \"a\"\nmesh = {{ asset = \"sheet\" }}\nvelocities = \"v\"\n{MATERIAL}\n"
    );
    let mut assets = Assets::default();
    assets.meshes.insert("sheet".into(), sheet());
    assets.velocities.insert("v".into(), vec![Vec3::new(0.0, -1e100, 0.0); 9]);
    let text = refuse(&scene(&text), assets).to_string();
    assert!(
        text.contains("cloth[0].velocities") && text.contains("1e5 m/s") && text.contains("-1e100"),
        "{text}"
    );
}

#[test]
fn a_thickness_of_the_cloths_size_is_refused_and_one_of_its_edges_warned_of() {
    let error = refuse(&scene(&SIZES.replace("thickness = 0.004", "thickness = 1.5")), Assets::default());
    let text = error.to_string();
    assert!(
        text.contains("contact.thickness: expected less than the size of \"cloth\", 1.414e0 m"),
        "{text}"
    );
    let warnings = |thickness: &str| {
        let text = SIZES.replace("thickness = 0.004", &format!("thickness = {thickness}"));
        common::build(&scene(&text), 1).plan().warnings.clone()
    };
    assert_eq!(warnings("0.2"), [""; 0]);
    let said = warnings("0.3");
    assert!(
        said.len() == 1 && said[0].contains("contact.thickness = 0.3 m is above the edge length"),
        "{said:?}"
    );
}

#[test]
fn a_warp_along_the_normal_is_refused() {
    let bad = SIZES.replace("warp = [1.0, 0.0, 0.0]", "warp = [0.0, -2.0, 0.0]");
    let text = refuse(&scene(&bad), Assets::default()).to_string();
    assert!(
        text.contains("cloth[0].warp: expected a direction that is not along the normal of \"cloth\"")
            && text.contains("[0.0, -2.0, 0.0], along that of 32 of 32 triangles"),
        "{text}"
    );
    // A closed body has some triangles across any axis; springs have no warp.
    let block = "mesh = { generator = \"box\", size = [1.0, 1.0, 1.0], cells = [2, 2, 2] }";
    let text: String =
        SIZES.lines().filter(|l| !l.starts_with("pins")).map(|l| l.to_owned() + "\n").collect();
    let grid = "mesh = { generator = \"grid\", width = 1.0, height = 1.0, nx = 5, ny = 5 }";
    assert!(
        Simulation::new(&scene(&text.replace(grid, block)), Assets::default(), SimulationOptions::default())
            .is_ok()
    );
    let spring = bad.replace(
        "in_plane = { model = \"baraff-witkin\", warp = 210.0, weft = 200.0, shear = 30.0, damping = 0.002 }",
        "in_plane = { model = \"spring\", stiffness = 100.0 }",
    );
    assert!(Simulation::new(&scene(&spring), Assets::default(), SimulationOptions::default()).is_ok());
}
