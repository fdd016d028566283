//! Scenes without contact against closed forms and against themselves.

mod common;

use cloth_sim::core::mesh::Vec3;
use cloth_sim::{Assets, Scene, Simulation, SimulationOptions};
use common::{MATERIAL, advance, bits, build, hanging, scene, simulation};
use std::ops::ControlFlow;

const G: f64 = 9.81;

fn free_fall(integrator: &str, dt: f64) -> String {
    format!(
        r#"
duration = 1.0
[time]
dt = {dt}
integrator = "{integrator}"
[solver]
tolerance = 1e-13
[[cloth]]
name = "cloth"
mesh = {{ generator = "disc", radius = 0.3, rings = 4 }}
{MATERIAL}
position = [0, 2, 0]
velocity = [1, 0, 0]
"#
    )
}

/// Rounding and the solver's residual over a hundred steps.
const FALL_TOLERANCE: f64 = 1e-9;

#[test]
fn free_fall_is_the_schemes_closed_form() {
    let (n, dt) = (100.0, 1e-3);
    // y after n steps, less the start: sums of the schemes' own recursions.
    let backward = -G * dt * dt * n * (n + 1.0) / 2.0;
    let forward = -G * dt * dt * n * (n - 1.0) / 2.0;
    let exact = -G * dt * dt * n * n / 2.0;
    for (integrator, expected) in [
        ("implicit-euler", backward),
        ("implicit-newton", backward),
        ("explicit-euler", forward),
        ("midpoint", exact),
        ("rk4", exact),
    ] {
        let mut sim = simulation(&free_fall(integrator, dt));
        let start = sim.positions().to_vec();
        advance(&mut sim, n * dt).unwrap();
        assert_eq!(sim.step_count(), n as u64);
        for (p, q) in sim.positions().iter().zip(&start) {
            let error = (p - q - Vec3::new(n * dt, expected, 0.0)).norm();
            assert!(error < FALL_TOLERANCE, "{integrator}: {error:e}");
        }
        // The check can tell the schemes apart.
        assert!(
            (backward - exact).abs() > 1e3 * FALL_TOLERANCE && (forward - exact).abs() > 1e3 * FALL_TOLERANCE
        );
    }
}

#[test]
fn a_hanging_cloth_loses_energy_and_comes_to_rest() {
    let text = hanging(13, "implicit-euler", 0.01).replace("[solver]", "[air]\ndamping = 2.0\n[solver]");
    let mut sim = simulation(&text);
    let mut last = sim.energy().total();
    let scale = (sim.energy().gravity - 0.2 * G).abs().max(0.2 * G);
    for _ in 0..400 {
        sim.step().unwrap();
        let now = sim.energy().total();
        // Backward Euler dissipates, the linearisation may give back a little of it.
        assert!(now <= last + 1e-3 * scale, "energy grew from {last} to {now} at {}", sim.time());
        last = now;
    }
    let energy = sim.energy();
    assert!(energy.kinetic < 1e-3 * scale, "{energy:?}");
    assert!(energy.gravity < -0.3 * scale, "the cloth hangs: {energy:?}");
    for corner in [0, 12] {
        let start = Vec3::new(if corner == 0 { -0.5 } else { 0.5 }, 0.0, -0.5);
        assert_eq!(sim.positions()[corner], start, "pinned corners stay");
    }
}

#[test]
fn explicit_and_implicit_schemes_agree_for_small_steps() {
    let run = |integrator: &str, dt: f64| {
        let mut sim = simulation(&hanging(7, integrator, dt));
        advance(&mut sim, 0.1).unwrap();
        sim.positions().to_vec()
    };
    let reference = run("rk4", 2.5e-4);
    let distance =
        |other: &[Vec3]| reference.iter().zip(other).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    // First order: an error of about half the fall's acceleration times t times dt.
    let coarse = distance(&run("implicit-newton", 2e-3));
    let fine = distance(&run("implicit-newton", 1e-3));
    assert!(coarse < 5e-3 && fine < 0.65 * coarse, "{coarse:e} {fine:e}");
    assert!(distance(&run("midpoint", 5e-4)) < 1e-4);
}

#[test]
fn threads_do_not_change_bits() {
    let scene = scene(&hanging(21, "implicit-euler", 0.01));
    let run = |threads| {
        let mut sim = build(&scene, threads);
        advance(&mut sim, 0.2).unwrap();
        bits(&sim)
    };
    let one = run(1);
    assert_eq!(one, run(2));
    assert_eq!(one, run(3));
    let mut other = build(&scene, 1);
    advance(&mut other, 0.19).unwrap();
    assert_ne!(one, bits(&other), "the comparison sees a difference");
}

#[test]
fn a_checkpoint_goes_on_to_the_same_bits() {
    let scene = scene(&hanging(11, "implicit-euler", 0.01));
    let mut straight = build(&scene, 1);
    advance(&mut straight, 0.1).unwrap();
    let saved = straight.checkpoint();
    advance(&mut straight, 0.1).unwrap();
    let mut resumed = Simulation::resume(&saved, Some(2)).unwrap();
    assert_eq!((resumed.step_count(), resumed.time()), (10, 0.1));
    assert_eq!(resumed.report().steps.len(), 10);
    advance(&mut resumed, 0.1).unwrap();
    assert_eq!(bits(&straight), bits(&resumed));
    assert_eq!(straight.time().to_bits(), resumed.time().to_bits());
}

#[test]
fn an_interrupted_advance_is_finished_with_the_same_steps() {
    let scene = scene(&hanging(7, "implicit-euler", 0.01));
    let mut straight = build(&scene, 1);
    advance(&mut straight, 0.055).unwrap();
    assert_eq!(straight.step_count(), 6);

    let mut stopped = build(&scene, 1);
    let mut asked = 0;
    let mut check = || {
        asked += 1;
        if asked > 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let advance = stopped.advance(0.055, &mut check).unwrap();
    assert!(advance.interrupted && advance.steps == 3 && stopped.is_interrupted());
    let mut resumed = Simulation::resume(&stopped.checkpoint(), None).unwrap();
    assert!(resumed.is_interrupted());
    let rest = resumed.finish_advance(&mut || ControlFlow::Continue(())).unwrap();
    assert!(!rest.interrupted && rest.steps == 3 && !resumed.is_interrupted());
    assert_eq!(bits(&straight), bits(&resumed));
}

#[test]
fn pins_follow_keyframes_and_colliders() {
    let text = format!(
        r#"
duration = 1.0
[time]
dt = 0.01
[[cloth]]
name = "cloth"
mesh = {{ generator = "grid", width = 1.0, height = 1.0, nx = 5, ny = 5 }}
{MATERIAL}
pins = [
  {{ vertices = [0], keyframes = [{{ time = 0.0 }}, {{ time = 0.2, position = [0.0, 0.1, 0.0] }}] }},
  {{ box = {{ min = [-0.6, -0.1, 0.4], max = [-0.2, 0.1, 0.6] }}, collider = "block" }},
  {{ vertices = [4], collider = "walker" }},
]
[[collider]]
name = "block"
shape = {{ type = "box", half_extents = [0.1, 0.1, 0.1] }}
position = [-0.5, 0.0, 0.5]
keyframes = [{{ time = 0.0 }}, {{ time = 0.2, rotation = {{ axis = [0, 0, 1], angle = 0.3 }} }}]
[[collider]]
name = "walker"
sequence = {{ asset = "walk", fps = 10.0 }}
"#
    );
    let scene = scene(&text);
    let mut assets = Assets::default();
    let corner = Vec3::new(0.5, 0.0, -0.5);
    let frame = |shift: f64| {
        [Vec3::zeros(), Vec3::x(), Vec3::z()].map(|p| p + corner + Vec3::new(shift, -0.05, 0.0)).to_vec()
    };
    assets.sequences.insert(
        "walk".into(),
        cloth_sim::Sequence {
            triangles: vec![[0, 2, 1]],
            frames: vec![frame(0.0), frame(0.01), frame(0.03)],
            fps: None,
        },
    );
    let mut sim = Simulation::new(&scene, assets, SimulationOptions::default()).unwrap();
    let start = sim.positions().to_vec();
    advance(&mut sim, 0.1).unwrap();
    let moved = |v: usize| sim.positions()[v] - start[v];
    // Rounding of the poses.
    let close = |a: Vec3, b: Vec3| assert!((a - b).norm() < 1e-14, "{a} {b}");
    close(moved(0), Vec3::new(0.0, 0.05, 0.0));
    close(moved(4), Vec3::new(0.01, 0.0, 0.0));
    let center = Vec3::new(-0.5, 0.0, 0.5);
    let turn = nalgebra::Rotation3::from_axis_angle(&Vec3::z_axis(), 0.15);
    for v in [20, 21] {
        close(sim.positions()[v], center + turn * (start[v] - center));
    }
    assert!(moved(12).norm() > 0.01, "what is not pinned falls");
    advance(&mut sim, 0.1).unwrap();
    close(sim.positions()[4] - start[4], Vec3::new(0.03, 0.0, 0.0));
}

#[test]
fn energy_and_masses_are_the_cloths() {
    let sim = simulation(&free_fall("implicit-euler", 0.01));
    let mass: f64 = sim.masses().iter().sum();
    let area: f64 = 0.5 * 24.0 * 0.09 * (std::f64::consts::TAU / 24.0).sin();
    assert!((mass - 0.2 * area).abs() < 1e-12);
    let energy = sim.energy();
    assert!((energy.kinetic - 0.5 * mass).abs() < 1e-12);
    assert!((energy.gravity - mass * G * 2.0).abs() < 1e-12);
    assert!(energy.elastic().abs() < 1e-20);
}

#[test]
fn start_velocities_are_added() {
    let text = free_fall("implicit-euler", 0.01).replace("velocity =", "velocities = \"swing\"\nvelocity =");
    let mut assets = Assets::default();
    let list: Vec<Vec3> = (0..61).map(|i| Vec3::new(0.0, f64::from(i), 0.0)).collect();
    assets.velocities.insert("swing".into(), list);
    let sim = Simulation::new(&scene(&text), assets, SimulationOptions::default()).unwrap();
    assert_eq!(sim.velocities()[7], Vec3::new(1.0, 7.0, 0.0));
    let error =
        Simulation::new(&scene(&text), Assets::default(), SimulationOptions::default()).err().unwrap();
    assert!(error.to_string().contains("cloth[0].velocities"), "{error}");
}

#[test]
fn explicit_steps_beyond_stability_are_foretold() {
    let wild = simulation(&hanging(11, "explicit-euler", 0.02));
    let stable = wild.plan().stable_dt.expect("an estimate for an explicit scheme");
    assert!(stable > 0.0 && stable < 0.02);
    assert!(wild.plan().warnings.iter().any(|w| w.contains("explicit-euler") && w.contains("0.02 s")));
    let tame = simulation(&hanging(11, "explicit-euler", 0.25 * stable));
    assert!(tame.plan().warnings.is_empty(), "{:?}", tame.plan().warnings);
    assert!(simulation(&hanging(11, "implicit-euler", 0.02)).plan().stable_dt.is_none());
}

#[test]
fn a_diverging_run_stops_with_time_and_vertices() {
    let mut sim = simulation(&hanging(11, "explicit-euler", 0.02));
    let error = advance(&mut sim, 10.0).unwrap_err();
    let cloth_sim::SimError::Diverged { time, vertices, .. } = error else { panic!("{error}") };
    assert_eq!(time, sim.time());
    assert!(!vertices.is_empty() && vertices.iter().all(|&v| v < 121));
    assert!(sim.positions().iter().all(|p| p.iter().all(|c| c.is_finite())), "the last good state is kept");
}

#[test]
fn scenes_of_the_examples_folder_are_read() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples");
    let mut count = 0;
    for entry in std::fs::read_dir(&folder).unwrap() {
        let path = entry.unwrap().path();
        // A sweep is many scenes: its own tests read it.
        if path.extension().is_some_and(|e| e == "toml") && !path.ends_with("sweep.toml") {
            let text = std::fs::read_to_string(&path).unwrap();
            let scene =
                Scene::parse_toml(&text, &path.display().to_string()).unwrap_or_else(|e| panic!("{e}"));
            for file in scene.files() {
                assert!(folder.join(&file.path).is_file(), "{}: {} is missing", path.display(), file.path);
            }
            count += 1;
        }
    }
    assert!(count >= 4, "examples: {count}");
}

#[test]
fn a_checkpoint_may_leave_out_the_steps_that_are_kept_elsewhere() {
    let scene = scene(&hanging(5, "implicit-euler", 0.01));
    let mut sim = build(&scene, 1);
    advance(&mut sim, 0.2).unwrap();
    let short = sim.checkpoint_from(15);
    assert!(short.len() + 10 * 200 < sim.checkpoint().len(), "each step takes room");
    let mut resumed = Simulation::resume(&short, None).unwrap();
    assert_eq!(resumed.report().left_out, 15);
    assert_eq!(resumed.report().steps, sim.report().steps[15..]);
    assert_eq!(resumed.report().totals, sim.report().totals);
    advance(&mut sim, 0.1).unwrap();
    advance(&mut resumed, 0.1).unwrap();
    assert_eq!(bits(&sim), bits(&resumed));
    let numbers = |list: &[cloth_sim::StepReport]| list.iter().map(|s| s.step).collect::<Vec<_>>();
    assert_eq!(numbers(resumed.report().steps_from(18)), (19..=30).collect::<Vec<_>>());
    assert_eq!(resumed.report().steps_from(0).len(), 15, "what there is");
    assert_eq!(resumed.report().steps_from(99), []);
    let again = Simulation::resume(&resumed.checkpoint(), None).unwrap();
    assert_eq!(again.report(), resumed.report());
}

#[test]
fn every_stage_of_every_integrator_is_an_effects_cost() {
    for integrator in
        ["explicit-euler", "midpoint", "rk4", "implicit-euler", "implicit-newton", "semi-implicit"]
    {
        let mut sim = build(&scene(&hanging(9, integrator, 1e-4)), 1);
        advance(&mut sim, 2e-3).unwrap();
        let report = sim.report();
        let staged: f64 = report.totals.seconds.iter().map(|(_, s)| s).sum();
        let timed: f64 = report.effects.iter().filter_map(|e| e.milliseconds).sum();
        assert!((timed - 1e3 * staged).abs() < 1e-6, "{integrator}: {timed} of {staged}: {report:?}");
        let least = report.effects.iter().filter_map(|e| e.milliseconds).fold(f64::INFINITY, f64::min);
        assert!(least > 0.0, "{integrator}: {:?}", report.effects);
    }
}
