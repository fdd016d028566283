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
        assets.sequences.insert("walk".into(), cloth_sim::Sequence { triangles, frames });
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
