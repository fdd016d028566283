//! Scene files: read, written, refused with file, line and key.

#![allow(clippy::result_large_err, reason = "an error ends the load: its size costs nothing")]

use cloth_sim::scene::{MaterialChoice, Up};
use cloth_sim::{Scene, SceneError};
use proptest::prelude::*;

/// Every table and most keys.
const FULL: &str = r#"name = "table"
up = "z"
gravity = [0, 0, -9.81]
duration = 4.0

[time]
dt = 0.005
integrator = "implicit-newton"

[solver]
method = "faer-llt"
tolerance = 1e-5
max_iterations = 200

[air]
wind = [1.0, 0.0, 0.0]
density = 1.2
drag = 0.5
lift = 0.1
damping = 0.2

[contact]
thickness = 0.003
self = true
friction = 0.4
self_friction = 0.1

[[cloth]]
name = "cloth"
material = { areal_density = 0.2, in_plane = { model = "baraff-witkin", warp = 100, weft = 90.0, shear = 10.0 }, bending = { model = "hinge", rigidity = 1e-5 } }
position = [0, 1, 0]
rotation = { axis = [0, 0, 2], angle = 1.57 }
pins = [
  { vertices = [0, 10] },
  { box = { min = [0, 0, 0], max = [1, 1, 1] }, keyframes = [{ time = 0.0 }, { time = 1.0, position = [0, 0, 1] }] },
  { vertices = [3], collider = "ball" },
]
[cloth.mesh]
generator = "grid"
width = 1.0
height = 1.0
nx = 11
ny = 11

[[cloth]]
name = "shirt"
mesh = { file = "shirt.obj" }
material = { areal_density = 0.1, in_plane = { model = "spring", stiffness = 10.0 } }
rest = "uv"

[[collider]]
name = "ball"
shape = { type = "sphere", radius = 0.5 }
keyframes = [{ time = 0.0 }, { time = 1.0, rotation = { axis = [0, 1, 0], angle = 12.0 } }]
friction = 0.6

[[collider]]
name = "walker"
sequence = { file = "walk.npz", fps = 30 }

[output]
fps = 24
obj = true
"#;

fn parse(text: &str) -> Result<Scene, SceneError> {
    Scene::parse_toml(text, "table.toml")
}

/// The error after replacing `from` by `to` in the full scene.
fn refused(from: &str, to: &str) -> SceneError {
    assert!(FULL.contains(from), "{from} is in the scene");
    let text = FULL.replacen(from, to, 1);
    match parse(&text) {
        Err(error) => {
            assert_eq!(error.file.as_deref(), Some("table.toml"));
            error
        }
        Ok(_) => panic!("accepted {to}"),
    }
}

/// Asserts the error's line (that of `from`), its key, and words of what was expected and got.
fn check(from: &str, to: &str, key: &str, expected: &str, got: &str) -> SceneError {
    check_at(from, from, to, key, expected, got)
}

/// The same with the line on which `place` stands.
fn check_at(place: &str, from: &str, to: &str, key: &str, expected: &str, got: &str) -> SceneError {
    let error = refused(from, to);
    let line = 1 + FULL[..FULL.find(place).expect("a place in the scene")].matches('\n').count();
    assert_eq!((error.line, error.key.as_str()), (Some(line), key), "{error}");
    assert!(error.expected.contains(expected), "{error}");
    assert!(error.got.contains(got), "{error}");
    assert!(error.to_string().starts_with(&format!("table.toml:{line}: {key}: expected ")), "{error}");
    error
}

#[test]
fn a_full_scene_is_read() {
    let scene = parse(FULL).unwrap();
    assert_eq!(scene.up, Up::Z);
    assert_eq!(scene.cloth.len(), 2);
    assert_eq!(scene.cloth[0].pins.len(), 3);
    assert!(matches!(scene.cloth[1].material, MaterialChoice::Given(_)));
    assert!(scene.cloth[1].self_collision && !scene.output.ply && scene.output.npz);
    let files: Vec<_> = scene.files().into_iter().map(|f| (f.path, f.sequence, f.key)).collect();
    assert_eq!(
        files,
        [
            ("shirt.obj".into(), false, "cloth[1].mesh.file".into()),
            ("walk.npz".into(), true, "collider[1].sequence.file".into())
        ]
    );
}

#[test]
fn scenes_survive_toml_and_json() {
    let scene = parse(FULL).unwrap();
    let toml = scene.to_toml().unwrap();
    let again = Scene::parse_toml(&toml, "again.toml").unwrap();
    assert_eq!(scene, again);
    assert_eq!(toml, again.to_toml().unwrap());
    assert_eq!(scene, Scene::from_json(&scene.to_json().unwrap()).unwrap());
    let mut other = again;
    other.cloth[0].position[1] += 1e-12;
    assert_ne!(scene, other);
}

#[test]
fn gravity_follows_up() {
    let scene = parse(&FULL.replace("gravity = [0, 0, -9.81]\n", "")).unwrap();
    assert_eq!(scene.gravity(), [0.0, 0.0, -9.81]);
    let scene = parse(&FULL.replace("gravity = [0, 0, -9.81]\n", "").replace("up = \"z\"\n", "")).unwrap();
    assert_eq!(scene.gravity(), [0.0, -9.81, 0.0]);
}

#[test]
fn unknown_keys_are_refused_with_the_nearest_known() {
    let error = check("friction = 0.4", "frictoin = 0.4", "contact.frictoin", "friction", "frictoin");
    assert_eq!(error.nearest.as_deref(), Some("friction"));
    assert!(error.to_string().ends_with("(did you mean \"friction\"?)"), "{error}");
    let error = check("[contact]", "[contacts]", "contacts", "contact", "contacts");
    assert_eq!(error.nearest.as_deref(), Some("contact"));
    let error = check("rest = \"uv\"", "rst = \"uv\"", "cloth[1].rst", "rest", "rst");
    assert_eq!(error.nearest.as_deref(), Some("rest"));
    let error = check("nx = 11", "nxx = 11", "cloth[0].mesh.nxx", "nx", "nxx");
    assert_eq!(error.nearest.as_deref(), Some("nx"));
    let error = check("fps = 24", "bananas = 24", "output.bananas", "fps", "bananas");
    assert_eq!(error.nearest, None);
    check("time = 1.0, position", "tme = 1.0, position", "cloth[0].pins[1].keyframes[1].tme", "time", "tme");
}

#[test]
fn wrong_types_and_missing_keys_are_refused() {
    check("dt = 0.005", "dt = \"fast\"", "time.dt", "finite number", "\"fast\"");
    check("dt = 0.005", "dt = nan", "time.dt", "finite number", "NaN");
    check("dt = 0.005", "dt = inf", "time.dt", "finite number", "inf");
    check("nx = 11", "nx = 11.5", "cloth[0].mesh.nx", "integer", "11.5");
    check("nx = 11", "nx = -11", "cloth[0].mesh.nx", "integer ≥ 0", "-11");
    check("wind = [1.0, 0.0, 0.0]", "wind = [1.0, 0.0]", "air.wind", "array of 3", "array of 2");
    check("wind = [1.0, 0.0, 0.0]", "wind = [1.0, 0.0, true]", "air.wind[2]", "number", "true");
    check("self = true", "self = 1", "contact.self", "true or false", "1");
    check("radius = 0.5", "radus = 0.5", "collider[0].shape.radus", "radius", "radus");
    check(", radius = 0.5", "", "collider[0].shape.radius", "finite number", "missing");
    check_at("name = \"table\"", "duration = 4.0", "", "duration", "finite number", "missing");
    check_at("[[cloth]]\nname = \"shirt\"", "name = \"shirt\"\n", "", "cloth[1].name", "string", "missing");
    check("duration = 4.0", "duration = 1979-05-27", "duration", "number", "1979");
    check("[air]", "[[air]]", "air", "table", "array");
}

#[test]
fn unknown_choices_are_refused_with_the_known_ones() {
    let error = check("\"implicit-newton\"", "\"implicit-euller\"", "time.integrator", "\"rk4\"", "euller");
    assert_eq!(error.nearest.as_deref(), Some("implicit-euler"));
    check("up = \"z\"", "up = \"x\"", "up", "\"y\", \"z\"", "\"x\"");
    let error =
        check("type = \"sphere\"", "type = \"spehre\"", "collider[0].shape.type", "capsule", "spehre");
    assert_eq!(error.nearest.as_deref(), Some("sphere"));
    check("generator = \"grid\"", "generator = \"gird\"", "cloth[0].mesh.generator", "ribbon", "gird");
    check("type = \"sphere\", ", "", "collider[0].shape.type", "\"sphere\"", "missing");
    check("model = \"hinge\"", "model = \"hing\"", "cloth[0].material.bending.model", "hinge", "hing");
    check("{ file = \"shirt.obj\" }", "{ fle = \"shirt.obj\" }", "cloth[1].mesh", "generator", "table");
}

#[test]
fn values_out_of_range_are_refused_at_their_line() {
    check("dt = 0.005", "dt = 0.0", "time.dt", "> 0 [s]", "0");
    check("tolerance = 1e-5", "tolerance = 1.5", "solver.tolerance", "< 1", "1.5");
    check("dt = 0.005", "dt = -0.005", "time.dt", "> 0 [s]", "-0.005");
    check("duration = 4.0", "duration = -1", "duration", "> 0 [s]", "-1");
    check("thickness = 0.003", "thickness = -0.003", "contact.thickness", "> 0 [m]", "-0.003");
    check("friction = 0.4", "friction = -0.4", "contact.friction", "≥ 0", "-0.4");
    check("areal_density = 0.2", "areal_density = -0.2", "cloth[0].material.areal_density", "kg/m²", "-0.2");
    check("warp = 100", "warp = -100", "cloth[0].material.in_plane.warp", "N/m", "-100");
    check("rigidity = 1e-5", "rigidity = -1.0", "cloth[0].material.bending.rigidity", "N m", "-1");
    check("friction = 0.6", "friction = -0.6", "collider[0].friction", "≥ 0", "-0.6");
    check("axis = [0, 0, 2]", "axis = [0, 0, 0]", "cloth[0].rotation.axis", "axis", "[0, 0, 0]");
    check("fps = 24", "fps = 0", "output.fps", "> 0", "0");
    check("fps = 30", "fps = 0", "collider[1].sequence.fps", "> 0", "0");
    check("max_iterations = 200", "max_iterations = 0", "solver.max_iterations", "≥ 1", "0");
    check(
        "{ time = 0.0 }, { time = 1.0, position",
        "{ time = 2.0 }, { time = 1.0, position",
        "cloth[0].pins[1].keyframes[1].time",
        "later than 2 s",
        "1",
    );
    check("min = [0, 0, 0]", "min = [2, 0, 0]", "cloth[0].pins[1].box", "min ≤ max", "2");
}

#[test]
fn what_does_not_fit_together_is_refused() {
    check_at(
        "name = \"ball\"",
        "name = \"shirt\"",
        "name = \"ball\"",
        "collider[0].name",
        "no other body",
        "cloth[1].name",
    );
    check("collider = \"ball\"", "collider = \"bal\"", "cloth[0].pins[2].collider", "ball", "bal");
    let given = "{ areal_density = 0.1, in_plane = { model = \"spring\", stiffness = 10.0 } }";
    let error = check(given, "\"coton\"", "cloth[1].material", "cotton", "coton");
    assert_eq!(error.nearest.as_deref(), Some("cotton"));
    check("{ vertices = [0, 10] }", "{ }", "cloth[0].pins[0]", "vertices or box", "neither");
    check("{ vertices = [0, 10] }", "{ vertices = [] }", "cloth[0].pins[0].vertices", "at least one", "none");
    check_at(
        "[[collider]]\nname = \"walker\"",
        "sequence = { file = \"walk.npz\", fps = 30 }",
        "",
        "collider[1]",
        "exactly one of",
        "none",
    );
    check("file = \"walk.npz\", fps", "fps", "collider[1].sequence", "exactly one of", "neither");
    check("self = true", "detector = \"bvhh\"", "contact.detector", "bvh", "bvhh");
}

#[test]
fn what_is_no_toml_is_refused_at_its_line() {
    let error = refused("dt = 0.005", "dt = 0.005.1");
    assert_eq!(error.line, Some(7), "{error}");
    assert!(error.expected.contains("TOML"));
    let error = refused("dt = 0.005", "dt = 0.005\ndt = 0.006");
    assert_eq!(error.line, Some(8), "{error}");
    let error = refused("[solver]", "[solver");
    assert_eq!(error.line, Some(10), "{error}");
    assert!(parse("").is_err(), "an empty file has no duration");
}

#[test]
fn json_errors_name_the_key() {
    let mut value: serde_json::Value =
        serde_json::from_str(&parse(FULL).unwrap().to_json().unwrap()).unwrap();
    value["cloth"][0]["mesh"]["nx"] = "many".into();
    let error = Scene::from_json(&value.to_string()).unwrap_err();
    assert_eq!((error.file, error.line, error.key.as_str()), (None, None, "cloth[0].mesh.nx"));
    assert!(Scene::from_json("{").unwrap_err().expected.contains("JSON"));
}

#[test]
fn the_schema_lists_every_key_of_a_scene() {
    let schema = Scene::json_schema();
    for key in [
        "name", "up", "gravity", "duration", "time", "solver", "air", "contact", "cloth", "collider",
        "output",
    ] {
        assert!(schema["properties"].get(key).is_some_and(|s| s.get("description").is_some()), "{key}");
    }
    assert_eq!(schema["additionalProperties"], serde_json::Value::Bool(false));
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// A scene file with a piece cut out, doubled or replaced is read or refused, and refused within its lines.
    #[test]
    fn damaged_files_are_refused_in_place(start in 0..FULL.len(), length in 0usize..40, with in "[a-z0-9=\\[\\]{}\", .\n-]{0,6}") {
        let end = (start + length).min(FULL.len());
        let text = format!("{}{with}{}", &FULL[..start], &FULL[end..]);
        if let Err(error) = parse(&text) {
            let lines = text.lines().count() + 1;
            prop_assert!(error.line.is_some_and(|line| (1..=lines).contains(&line)), "{error}");
            prop_assert!(!error.expected.is_empty() && !error.got.is_empty(), "{error}");
        }
    }
}

#[test]
fn a_fabric_takes_the_law_that_the_scene_asks_for() {
    use cloth_core::{Bending, HingeCoupling};
    let scene = |material: &str| {
        Scene::parse_toml(
            &format!(
                "duration = 1.0\n[[cloth]]\nname = \"c\"\nmesh = {{ generator = \"grid\", width = 1.0, height = 1.0, nx = 3, ny = 3 }}\nmaterial = {material}\n"
            ),
            "test.toml",
        )
    };
    let of = |material: &str| match &scene(material).unwrap().cloth[0].material {
        MaterialChoice::Fabric(choice) => choice.material().unwrap().bending,
        MaterialChoice::Given(material) => material.bending,
        MaterialChoice::Named(name) => panic!("{name}"),
    };
    let Bending::Hysteresis(law) = of("{ fabric = \"cotton\", bending = \"hysteresis\", plasticity = 0.2 }")
    else {
        panic!("hysteresis")
    };
    assert_eq!((law.plasticity, law.fatigue), (0.2, 0.0));
    assert!(law.coercive_couple.is_some_and(|c| c > 0.0));
    assert!(matches!(of("{ fabric = \"cotton\" }"), Bending::Hinge { .. }));
    assert_eq!(
        of("{ fabric = \"cotton\", hinges = \"independent\" }").hinges(),
        Some(HingeCoupling::Independent)
    );
    let own =
        "{ areal_density = 0.2, in_plane = { model = \"spring\", stiffness = 9.0 }, bending = BENDING }";
    let linear = of(&own.replace("BENDING", "{ model = \"linear\", rigidity = 1e-5 }"));
    assert_eq!(linear, Bending::Hinge { rigidity: 1e-5, damping: 0.0, hinges: HingeCoupling::Coupled });
    assert!(matches!(
        of(&own.replace("BENDING", "{ model = \"spring\", stiffness = 1.0 }")),
        Bending::Spring { .. }
    ));

    let fails = |material: &str| scene(material).unwrap_err();
    let error = fails("{ fabric = \"coton\", bending = \"hysteresis\" }");
    assert_eq!((error.key.as_str(), error.nearest.as_deref()), ("cloth[0].material.fabric", Some("cotton")));
    let error = fails("{ fabric = \"cotton\", bending = \"hysterisis\" }");
    assert_eq!(
        (error.key.as_str(), error.nearest.as_deref()),
        ("cloth[0].material.bending", Some("hysteresis"))
    );
    assert_eq!(fails("{ fabric = \"cotton\", plasticity = 0.2 }").key, "cloth[0].material.plasticity");
    let steep = "{ fabric = \"cotton\", bending = \"hysteresis\", fatigue = 1.5 }";
    assert_eq!(fails(steep).key, "cloth[0].material.fatigue");
    let error = fails(&own.replace("BENDING", "{ model = \"hysteresis\", rigidty = 1e-5 }"));
    assert_eq!(
        (error.key.as_str(), error.nearest.as_deref()),
        ("cloth[0].material.bending.rigidty", Some("rigidity"))
    );
    let error = fails(&own.replace("BENDING", "{ model = \"hysteresis\", rigidity = 1e-5 }"));
    assert_eq!(error.key, "cloth[0].material.bending.coercive_couple");
    assert_eq!(
        fails(&own.replace("BENDING", "{ model = \"rubber\" }")).key,
        "cloth[0].material.bending.model"
    );
}
