//! Strain limits as an effect of their own: with and without contact, and not at all where no cloth asks.

use cloth_sim::{Assets, Scene, Simulation, SimulationOptions};

/// A strip of weak springs that hangs from one end.
const HANGING: &str = r#"
duration = 1.0
[time]
dt = 0.005
[[cloth]]
name = "strip"
mesh = { generator = "grid", width = 0.4, height = 0.1, nx = 9, ny = 3 }
material = { areal_density = 0.2, in_plane = { model = "spring", stiffness = 3.0, damping = 0.02 } }
pins = [{ vertices = [0, 9, 18] }]
LIMIT
"#;

/// Rounding of lengths of a metre and less, relative; what the limiter allows itself.
const TOLERANCE: f64 = 1e-6;

fn simulation(text: &str) -> Simulation {
    let scene = Scene::parse_toml(text, "test.toml").expect("a scene");
    let options = SimulationOptions { threads: Some(2), ..SimulationOptions::default() };
    Simulation::new(&scene, Assets::default(), options).expect("a simulation")
}

/// Largest stretch of the strip's edges along x, of which the mesh has one every 0.05 m, over a run of 0.5 s.
fn largest_stretch(sim: &mut Simulation) -> f64 {
    let mut largest = f64::NEG_INFINITY;
    for _ in 0..100 {
        sim.step().expect("a step");
        let x = sim.positions();
        for row in x.chunks(9) {
            for pair in row.windows(2) {
                largest = largest.max((pair[1] - pair[0]).norm() / 0.05 - 1.0);
            }
        }
    }
    largest
}

#[test]
fn no_edge_is_longer_than_its_limit() {
    let free = largest_stretch(&mut simulation(&HANGING.replace("LIMIT", "")));
    assert!(free > 0.2, "without a limit the strip is stretched by {free}");
    for contact in ["", "\n[contact]\nthickness = 0.002\n"] {
        let text = HANGING.replace("LIMIT", "strain_limit = 0.1") + contact;
        let mut sim = simulation(&text);
        let held = largest_stretch(&mut sim);
        assert!(held <= 0.1 + TOLERANCE, "{held}");
        assert!(held > 0.05, "the limit is reached: {held}");
        let report = sim.report();
        let last = report.steps.last().and_then(|s| s.contact.as_ref()).expect("counters");
        assert!(last.largest_stretch <= 0.1 + TOLERANCE && last.limited_edges > 0, "{last:?}");
        let staged: f64 = report.totals.seconds.iter().map(|(_, s)| s).sum();
        let timed: f64 = report.effects.iter().filter_map(|e| e.milliseconds).sum();
        assert!((timed - 1e3 * staged).abs() < 1e-6, "every stage is counted under an effect: {report:?}");
        if contact.is_empty() {
            let own = report.effects.iter().find(|e| e.name == "strain limit").and_then(|e| e.milliseconds);
            assert!(own > Some(0.0), "response is all for the limit");
        }
    }
}

#[test]
fn what_no_cloth_asks_for_is_not_built() {
    let sim = simulation(&HANGING.replace("LIMIT", ""));
    assert!(!sim.plan().running().any(|name| name == "strain limit" || name == "contact"));
    let sim = simulation(&HANGING.replace("LIMIT", "strain_limit = 0.1"));
    let effect = sim.plan().effects.iter().find(|e| e.name == "strain limit").expect("listed");
    // 3·8 along, 2·9 across, 2·8 diagonals, without the two between the pins.
    assert_eq!((effect.on, effect.elements), (true, 56));
    assert!(effect.bytes > 0 && !sim.plan().running().any(|name| name == "contact"));
}

/// Cloth that passes through cloth and colliders in a scene without contact still does with a strain limit.
#[test]
fn a_limit_alone_makes_no_contact() {
    let text = HANGING.replace("LIMIT", "strain_limit = 0.1")
        + "[[collider]]\nname = \"ball\"\nshape = { type = \"sphere\", radius = 0.1, tolerance = 0.01 }\nposition = [0.0, -0.1, 0.0]\n";
    let mut sim = simulation(&text);
    let middle = cloth_sim::core::mesh::Vec3::new(0.0, -0.1, 0.0);
    let mut inside = 0;
    for _ in 0..60 {
        sim.step().expect("a step");
        inside += sim.positions().iter().filter(|p| (*p - middle).norm() < 0.09).count();
    }
    assert!(inside > 0, "the strip swings through the ball");
    let counters = |step: &cloth_sim::StepReport| step.contact.clone().expect("counters");
    let met = sim.report().steps.iter().map(counters).any(|c| c.proximities > 0 || c.collisions > 0);
    assert!(!met, "nothing meets anything");
}
