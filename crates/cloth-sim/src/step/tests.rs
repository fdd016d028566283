//! A step that fails, and what it leaves.

use super::touches;
use crate::auto_step::FIRST;
use crate::ledger::Ledger;
use crate::{Assets, Scene, SimError, Simulation, SimulationOptions, Vec3};
use std::ops::ControlFlow;

const SCENE: &str = r#"
duration = 1.0
[time]
dt = 0.01
max_halvings = 3
[[cloth]]
name = "cloth"
mesh = { generator = "grid", width = 1.0, height = 1.0, nx = 6, ny = 6 }
material = { areal_density = 0.2, in_plane = { model = "spring", stiffness = 50.0 } }
pins = [{ vertices = [0], keyframes = [{ time = 0.0 }, { time = 1.0, position = [0.0, 1.0, 0.0] }] }]
"#;

fn simulation() -> Simulation {
    let scene = Scene::parse_toml(SCENE, "test.toml").unwrap();
    let options = SimulationOptions { threads: Some(1), ..SimulationOptions::default() };
    Simulation::new(&scene, Assets::default(), options).unwrap()
}

#[test]
fn a_retry_leaves_no_trace() {
    let mut retried = simulation();
    retried.fail = |time, dt| time < 0.005 && dt > 0.006;
    retried.step().unwrap();
    assert_eq!((retried.report.steps[0].retries, retried.report.steps[0].substeps), (1, 2));
    let mut straight = simulation();
    straight.step_to(0.005, 0.005).unwrap();
    straight.step_to(0.01, 0.005).unwrap();
    assert_eq!(retried.state.x, straight.state.x);
    assert_eq!(retried.state.v, straight.state.v);
    assert_eq!((retried.state.time, retried.state.step), (0.01, 1));
    let mut whole = simulation();
    whole.step().unwrap();
    assert_ne!(retried.state.x, whole.state.x, "the comparison sees a difference");
}

/// The scene with a law that remembers, folded far enough by its pin for friction to be overcome.
fn remembering() -> Simulation {
    let text = SCENE.replace(
        "in_plane = { model = \"spring\", stiffness = 50.0 } }",
        "in_plane = { model = \"spring\", stiffness = 50.0 }, \
         bending = { model = \"hysteresis\", b1 = 2e-3, b2 = 1e-3, c1 = -5e-3, plasticity = 0.3, fatigue = 0.1 } }",
    );
    let scene = Scene::parse_toml(&text, "test.toml").unwrap();
    let options = SimulationOptions { threads: Some(1), ..SimulationOptions::default() };
    Simulation::new(&scene, Assets::default(), options).unwrap()
}

#[test]
fn history_is_committed_once_per_accepted_step() {
    let mut retried = remembering();
    assert!(retried.integrator.system().remembers());
    // Both halves of the first attempt at full size fail, and so does one at half size.
    retried.fail = |time, dt| (time < 0.005 && dt > 0.006) || (time < 0.03 && time > 0.015 && dt > 0.003);
    for _ in 0..5 {
        retried.step().unwrap();
    }
    let retries: u32 = retried.report.steps.iter().map(|s| s.retries).sum();
    assert!(retries >= 2, "{retries}");
    let mut straight = remembering();
    for &[end, dt] in &retried.accepted {
        straight.step_to(end, dt).unwrap();
    }
    let memory = retried.memory();
    assert_eq!(memory, straight.memory());
    assert_eq!(retried.state.x, straight.state.x);
    let mut whole = remembering();
    for _ in 0..5 {
        whole.step().unwrap();
    }
    assert_ne!(memory, whole.memory(), "the comparison sees a difference");
    assert!(memory.iter().any(|m| *m != 0.0));
}

#[test]
fn history_survives_a_checkpoint_to_the_same_bits() {
    let mut sim = remembering();
    for _ in 0..30 {
        sim.step().unwrap();
    }
    let mut resumed = Simulation::resume(&sim.checkpoint(), Some(2)).unwrap();
    assert_eq!(resumed.hinges(), sim.hinges());
    let mut forgetful = Simulation::resume(&sim.checkpoint(), Some(2)).unwrap();
    let nothing = remembering().memory();
    forgetful.integrator.set_memory(&nothing).unwrap();
    for _ in 0..30 {
        for sim in [&mut sim, &mut resumed, &mut forgetful] {
            sim.step().unwrap();
        }
    }
    assert_eq!(resumed.state, sim.state);
    assert_eq!(resumed.hinges(), sim.hinges());
    assert_ne!(forgetful.state.x, sim.state.x, "memory that is lost is seen");
    assert!(sim.hinges().iter().any(|h| h.place.rest_curvature != 0.0), "some bend has stayed");
}

#[test]
fn a_step_that_fails_at_every_size_keeps_the_last_good_state() {
    let mut sim = simulation();
    sim.step().unwrap();
    let good = sim.state.clone();
    sim.fail = |_, _| true;
    let error = sim.step().unwrap_err();
    assert_eq!(error, SimError::Diverged { time: 0.01, reason: "planted".into(), vertices: vec![0] });
    assert_eq!(sim.state, good);
    assert_eq!(sim.report.steps.len(), 1);
    sim.fail = |_, _| false;
    sim.step().unwrap();
    let mut straight = simulation();
    straight.step().unwrap();
    straight.step().unwrap();
    assert_eq!(sim.state, straight.state);
}

/// A card that slides down a slope, held by contact constraints.
fn sliding() -> Simulation {
    let text = r#"
duration = 1.0
[time]
dt = 0.01
[contact]
method = "constraints"
thickness = 0.01
friction = { law = "coulomb-stiction", mu_c = 0.1, mu_s = 0.2 }
[[cloth]]
name = "card"
mesh = { generator = "grid", width = 1.0, height = 1.0, nx = 6, ny = 6 }
material = { areal_density = 0.2, in_plane = { model = "spring", stiffness = 50.0 } }
position = [-0.003, 0.01, 0.0]
rotation = { axis = [0, 0, 1], angle = 0.3 }
[[collider]]
name = "slope"
shape = { type = "plane", half_size = 3.0 }
rotation = { axis = [0, 0, 1], angle = 0.3 }
"#;
    let scene = Scene::parse_toml(text, "test.toml").unwrap();
    let options = SimulationOptions { threads: Some(1), ..SimulationOptions::default() };
    Simulation::new(&scene, Assets::default(), options).unwrap()
}

#[test]
fn a_retry_leaves_no_trace_in_contact_constraints() {
    let mut retried = sliding();
    retried.step().unwrap();
    // An attempt that the guard gives up, after a search of its own.
    let good = retried.state.clone();
    retried.state.v[7].x = 1e6;
    let before = retried.state.clone();
    assert!(retried.attempt(0.02, 0.01, false, &mut crate::StepReport::default()).is_err());
    assert_eq!(retried.state, before);
    retried.state = good;
    retried.fail = |time, dt| time < 0.015 && dt > 0.006;
    retried.step().unwrap();
    let mut straight = sliding();
    for [end, dt] in [[0.01, 0.01], [0.015, 0.005], [0.02, 0.005]] {
        straight.step_to(end, dt).unwrap();
    }
    let state = |sim: &Simulation| (sim.state.x.clone(), sim.state.v.clone(), sim.state.holds.clone());
    assert!(state(&retried) == state(&straight));
    assert!(retried.state.holds.sliding.iter().any(|s| *s));
    let mut whole = sliding();
    whole.step().unwrap();
    whole.step().unwrap();
    assert!(state(&retried) != state(&whole), "the comparison sees a difference");
    // What is not a number comes out as an alarm that names vertices, and the state stays.
    let good = retried.state.clone();
    retried.fail = |_, _| false;
    retried.state.v[7].x = f64::NAN;
    let SimError::Diverged { vertices, .. } = retried.step().unwrap_err() else { panic!("diverged") };
    assert!(!vertices.is_empty());
    assert_eq!(retried.state.x, good.x);
}

#[test]
fn sub_steps_that_succeed_before_one_that_fails_are_kept() {
    let mut sim = simulation();
    sim.fail = |time, dt| dt > 0.006 || time > 0.004;
    let SimError::Diverged { time, .. } = sim.step().unwrap_err() else { panic!("diverged") };
    assert_eq!(time, 0.005);
    assert_eq!(sim.time(), 0.005);
    // The step is taken up where it stands, and ends where it would have.
    sim.fail = |_, _| false;
    sim.step().unwrap();
    assert_eq!((sim.state.time, sim.state.step), (0.01, 1));
    assert_eq!(sim.accepted, [[0.005, 0.005], [0.01, 0.005]]);
}

/// The scene for two steps that fail above a quarter of the size from 5 ms to 15 ms.
fn reduced(mut sim: Simulation) -> Simulation {
    sim.fail = |time, dt| (0.004..0.015).contains(&time) && dt > 0.003;
    sim
}

#[test]
fn a_size_is_halved_at_once_and_doubled_after_eight_sub_steps() {
    let mut sim = reduced(simulation());
    for _ in 0..10 {
        sim.step().unwrap();
    }
    let sizes: Vec<f64> = sim.accepted.iter().map(|[_, dt]| dt * 400.0).collect();
    let mut expected = vec![4.0];
    expected.extend([1.0; 8]);
    expected.extend([2.0; 8]);
    let full = expected.len();
    expected.resize(sizes.len(), 4.0);
    assert_eq!(sizes, expected, "in quarters of the step");
    assert_eq!((full, sizes.len()), (17, 20));
    let counts = |k: usize| {
        let step = &sim.report.steps[k];
        (step.retries, step.substeps, step.smallest_dt)
    };
    assert_eq!([counts(0), counts(1), counts(2)], [(0, 1, 0.01), (2, 4, 0.0025), (0, 4, 0.0025)]);
    let totals = &sim.report.totals;
    assert_eq!((totals.retries, totals.reduced), (2, 6));
    assert_eq!((totals.smallest_dt, totals.smallest_dt_time), (Some(0.0025), Some(0.02)));
    let refused: Vec<_> =
        sim.report.refused.iter().map(|r| (r.step, r.time, r.dt, r.reason.as_str())).collect();
    assert_eq!(refused, [(2, 0.01, 0.01, "diverged: planted"), (2, 0.01, 0.005, "diverged: planted")]);
    assert_eq!(sim.state.pace, crate::pace::Pace::default(), "back at full size");
}

#[test]
fn no_attempt_is_below_the_floor() {
    let text = SCENE.replace("max_halvings = 3", "max_halvings = 10\ndt_min = 0.002");
    let scene = Scene::parse_toml(&text, "test.toml").unwrap();
    let mut sim = Simulation::new(&scene, Assets::default(), SimulationOptions::default()).unwrap();
    sim.fail = |_, _| true;
    assert!(matches!(sim.step(), Err(SimError::Diverged { .. })));
    let sizes: Vec<f64> = sim.report.refused.iter().map(|r| r.dt).collect();
    assert_eq!(sizes, [0.01, 0.005, 0.0025]);
    assert_eq!(sim.state.pace, crate::pace::Pace::default(), "an error leaves the pace as it was");
}

#[test]
fn a_checkpoint_within_a_reduced_step_goes_on_to_the_same_bits() {
    let fail: fn(f64, f64) -> bool = |time, dt| (0.004..0.015).contains(&time) && dt > 0.003;
    let mut straight = reduced(remembering());
    straight.advance(0.1, &mut || ControlFlow::Continue(())).unwrap();
    // Stopped before each attempt in turn, saved, and resumed on another number of threads.
    let mut stops = 0;
    let mut sim = reduced(remembering());
    let mut done = sim.advance(0.1, &mut || ControlFlow::Break(())).unwrap();
    let mut within = 0;
    while done.interrupted {
        within += usize::from(sim.under_way.is_some());
        sim = Simulation::resume(&sim.checkpoint(), Some(1 + stops % 2)).unwrap();
        sim.fail = fail;
        let mut asked = 0;
        done = sim
            .finish_advance(&mut || {
                asked += 1;
                if asked > 1 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            })
            .unwrap();
        stops += 1;
    }
    assert!(within >= 6, "{within} checkpoints within a step");
    assert_eq!(sim.state, straight.state);
    assert_eq!(sim.memory(), straight.memory());
    let counts = |sim: &Simulation| -> Vec<_> {
        sim.report
            .steps
            .iter()
            .map(|s| (s.step, s.time, s.retries, s.substeps, s.newton_iterations))
            .collect()
    };
    assert_eq!(counts(&sim), counts(&straight));
    // Planted: a checkpoint that forgets the pace tries the whole step again.
    let mut whole = reduced(remembering());
    whole.fail = |_, _| false;
    whole.advance(0.1, &mut || ControlFlow::Continue(())).unwrap();
    assert_ne!(sim.state.x, whole.state.x, "the comparison sees a difference");
}

#[test]
fn an_advance_ends_a_step_that_was_left_in_the_middle() {
    let mut sim = simulation();
    sim.fail = |time, dt| dt > 0.006 || time > 0.004;
    sim.step().unwrap_err();
    sim.fail = |_, _| false;
    sim.advance(0.02, &mut || ControlFlow::Continue(())).unwrap();
    let steps: Vec<_> = sim.report.steps.iter().map(|s| (s.time, s.dt)).collect();
    assert_eq!(steps, [(0.005, 0.005), (0.015, 0.01), (0.025, 0.01)]);
}

#[test]
fn a_scene_without_contact_builds_none() {
    let sim = simulation();
    assert!(sim.contact.is_none());
    assert!(sim.plan.running().all(|name| !name.contains("contact") && name != "friction"));
}

#[test]
fn a_step_under_error_control_that_fails_is_halved_without_a_trace() {
    let text = SCENE.replace("dt = 0.01", "dt = \"auto\"");
    let scene = Scene::parse_toml(&text, "test.toml").unwrap();
    let auto = || Simulation::new(&scene, Assets::default(), SimulationOptions::default()).unwrap();
    let mut sim = auto();
    sim.step().unwrap();
    let good = sim.state.clone();
    let mut fails = auto();
    fails.step().unwrap();
    // The step begins at 1 ms: its second half fails until it is small enough.
    fails.fail = |time, dt| time > 1.0001e-3 && time < 1e-2 && dt > 1e-4;
    fails.step().unwrap();
    let retries = fails.report.steps[1].retries;
    assert!(retries > 0);
    assert_eq!(fails.report.refused.len(), retries as usize);
    let dt = fails.report.steps[1].dt;
    let mut straight = auto();
    straight.step().unwrap();
    assert!(straight.state == good);
    straight.state.pace.control.size = dt;
    straight.step().unwrap();
    assert_eq!(straight.report.steps[1].dt, dt);
    assert_eq!((&straight.state.x, &straight.state.v), (&fails.state.x, &fails.state.v));
    // At the floor it stops, and the state is the last good one.
    sim.fail = |_, _| true;
    assert!(matches!(sim.step(), Err(SimError::Diverged { .. })));
    assert!(sim.state == good);
    assert_eq!(sim.report.steps.len(), 1);
}

/// A stiff card that lands on its corner, in steps far too large for its springs.
fn landing(audited: bool) -> Simulation {
    landing_among("dt = 0.0166", "", "", audited)
}

#[test]
fn energy_that_contact_makes_is_a_failed_step() {
    // Largest rise of the energy above the least one before, relative to what the fall sets free.
    let rise = |sim: &mut Simulation| {
        let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
        let free = 0.2 * 0.01 * 9.81 * 0.1;
        for _ in 0..40 {
            sim.step().unwrap();
            let energy = sim.energy().total();
            least = least.min(energy);
            most = most.max(energy - least);
        }
        most / free
    };
    let mut sim = landing(true);
    let (kept, made) = (rise(&mut sim), rise(&mut landing(false)));
    println!("rise: {kept:.2} audited, {made:.2} not; {:?}", sim.report.totals);
    assert!(sim.report.totals.retries > 0);
    assert!(sim.report.refused.iter().any(|r| r.reason.contains("contact made")), "{:?}", sim.report.refused);
    assert!(made > 5.0, "the scene has something to find: {made}");
    assert!(kept < 0.2 * made, "{kept} of {made}");
}

/// Where contact goes on making more energy than there is, the cloth stops where it is, and the run goes on.
#[test]
fn what_runs_away_stands_still_where_it_was() {
    let mut sim = landing(true);
    while sim.time() < 0.6 {
        sim.step().unwrap();
    }
    assert!(touches(&sim.state) && sim.state.pace.ledger.open, "it lies on the floor");
    let mut free = Simulation::resume(&sim.checkpoint(), Some(1)).unwrap();
    let (x, time) = (sim.state.x.clone(), sim.time());
    sim.state.v[0].y += 1e-2;
    // A joule less than there is: whatever the step, it seems to have made one.
    let ledger = sim.state.pace.ledger;
    sim.state.pace.ledger =
        Ledger { open: true, level: ledger.level - 1.0, base: ledger.base - 1.0, scale: 0.0, ..ledger };
    sim.step().unwrap();
    assert_eq!(sim.state.x, x);
    assert!(sim.state.v.iter().chain(&sim.state.contact_force).all(|v| *v == Vec3::zeros()));
    assert!((sim.time() - time - 0.0166).abs() < 1e-12);
    assert!(sim.report.refused.iter().any(|r| r.time >= time && r.reason.contains("contact made")));
    free.state.v[0].y += 1e-2;
    free.step().unwrap();
    assert_ne!(free.state.x, x, "without the loss it moves");
}

/// The energy of a fall that is lost in the landing is not there to be made again.
#[test]
fn what_was_lost_may_not_be_made_again() {
    let lies = || {
        let mut sim = landing(true);
        while sim.time() < 0.6 {
            sim.step().unwrap();
        }
        assert!(touches(&sim.state) && sim.state.pace.ledger.open, "it lies on the floor");
        sim.state.v[0].y += 1e-4;
        sim
    };
    // Less than there is by a part of the fall's energy: whatever the step, it seems to have made that.
    let refused_after = |lowest: Option<f64>| {
        let mut sim = lies();
        let (ledger, time) = (sim.state.pace.ledger, sim.time());
        assert!(ledger.level - ledger.lowest < 0.1 * ledger.scale, "{ledger:?}");
        let less = 0.4 * ledger.scale;
        sim.state.pace.ledger = Ledger {
            level: ledger.level - less,
            base: ledger.base - less,
            lowest: lowest.unwrap_or(ledger.lowest),
            ..ledger
        };
        sim.step().unwrap();
        sim.report().refused.iter().filter(|r| r.time >= time && r.reason.contains("contact made")).count()
    };
    assert!(refused_after(None) > 0);
    assert_eq!(refused_after(Some(f64::MIN)), 0, "as if all of the fall's energy were still there");
}

/// With steps chosen by their error what stands still does so for as long as a step was tried first: stretches of the size tried
/// last, each half of the one before, would come to no end.
#[test]
fn what_stands_still_does_so_in_steps_that_do_not_shrink() {
    let mut sim = landing_among("dt = \"auto\"\ndt_tolerance = 100.0\ndt_max = 0.0166", "", "", true);
    while sim.time() < 0.6 {
        sim.step().unwrap();
    }
    assert!(touches(&sim.state) && sim.state.pace.ledger.open, "it lies on the floor");
    let (x, time) = (sim.state.x.clone(), sim.time());
    // A joule less than there is: whatever the step, it seems to have made one.
    let ledger = sim.state.pace.ledger;
    sim.state.pace.ledger =
        Ledger { open: true, level: ledger.level - 1.0, base: ledger.base - 1.0, scale: 0.0, ..ledger };
    let steps = 20_u32;
    for _ in 0..steps {
        sim.step().unwrap();
        assert_eq!(sim.state.x, x, "it stands");
    }
    let least = 0.99 * FIRST * f64::from(steps - 1);
    let passed = sim.time() - time;
    assert!(passed > least, "{passed} s in {steps} steps");
    // The sizes tried last, for which it must not stand, are far less.
    let report = sim.report();
    let tried_last = report.steps.iter().rev().take(steps as usize).map(|s| s.smallest_dt).sum::<f64>();
    assert!(tried_last > 0.0 && tried_last < 0.1 * least, "{tried_last} s of {least}");
}

/// A flag held by two corners in wind; they move up, if anything.
fn flag(dt: f64, wind: f64, lift: f64, effects: &str) -> Simulation {
    let text = format!(
        r#"
duration = 2.0
[time]
dt = {dt}
[solver]
tolerance = 1e-10
[air]
wind = [0.0, 0.0, {wind}]
density = 1.2
drag = 1.0
lift = 0.5
damping = 0.5
[effects]
{effects}
[[cloth]]
name = "flag"
mesh = {{ generator = "grid", width = 0.4, height = 0.4, nx = 9, ny = 9 }}
material = {{ areal_density = 0.2, in_plane = {{ model = "spring", stiffness = 100.0, damping = 0.01 }} }}
pins = [{{ vertices = [0, 8], keyframes = [{{ time = 0.0 }}, {{ time = 1.0, position = [0.0, {lift}, 0.0] }}] }}]
"#
    );
    let scene = Scene::parse_toml(&text, "test.toml").unwrap();
    let options = SimulationOptions { threads: Some(1), ..SimulationOptions::default() };
    Simulation::new(&scene, Assets::default(), options).unwrap()
}

/// Energy gained, work of pins, work of air in half a second [J].
fn account(dt: f64, wind: f64, lift: f64) -> [f64; 3] {
    let mut sim = flag(dt, wind, lift, "energy_account = true");
    let start = sim.energy().total();
    let mut work = [0.0; 2];
    while sim.time() < 0.5 - 0.5 * dt {
        sim.step().unwrap();
        let entry = sim.report().steps.last().unwrap().energy.unwrap();
        work[0] += entry.pins;
        work[1] += entry.air;
        assert!((entry.total - sim.energy().total()).abs() < 1e-12);
    }
    [sim.energy().total() - start, work[0], work[1]]
}

#[test]
fn what_pins_and_wind_do_is_what_the_cloth_gains_and_loses() {
    for (wind, lift) in [(0.0, 1.0), (6.0, 0.0), (4.0, -1.0)] {
        // What is missing is lost: in damping, and to backward Euler, whose part falls with the step.
        let [coarse, fine] = [2e-3, 5e-4].map(|dt| {
            let [gained, pins, air] = account(dt, wind, lift);
            if lift > 0.0 {
                assert!(pins > 0.1, "lifting is work: {pins}");
            }
            if wind > 0.0 {
                assert!(air.abs() > 1e-3, "wind works: {air}");
            }
            pins + air - gained
        });
        assert!(fine > 0.0 && coarse > fine, "{wind} {lift}: lost {coarse} {fine}");
    }
    // Slowly lifted, all the work of pins is height: 32 g by 0.1 m.
    let mut sim = flag(2e-3, 0.0, 0.2, "energy_account = true");
    for _ in 0..1000 {
        sim.step().unwrap();
    }
    let (mut pins, mut air) = (0.0, 0.0);
    for step in &sim.report().steps[..500] {
        let entry = step.energy.unwrap();
        (pins, air) = (pins + entry.pins, air + entry.air);
    }
    let _ = air;
    assert!(pins > 0.032 * 9.81 * 0.2 * 0.9, "{pins}");
}

#[test]
fn the_account_changes_no_bit_and_is_kept_only_where_it_is_asked_for() {
    let (mut with, mut without) = (flag(5e-3, 3.0, 1.0, "energy_account = true"), flag(5e-3, 3.0, 1.0, ""));
    for _ in 0..30 {
        with.step().unwrap();
        without.step().unwrap();
    }
    assert_eq!(with.state, without.state);
    assert!(without.report.steps.iter().all(|s| s.energy.is_none()));
    let mut landing = landing(true);
    for _ in 0..20 {
        landing.step().unwrap();
    }
    let kept: Vec<bool> = landing.report.steps.iter().map(|s| s.energy.is_some()).collect();
    assert!(kept.contains(&true) && kept.contains(&false), "{kept:?}");
}

/// The card of [`landing`] with other things going on: keys of `[time]`, tables, and bodies of scene text.
fn landing_among(time: &str, tables: &str, bodies: &str, audited: bool) -> Simulation {
    let text = format!(
        r#"
duration = 1.0
[time]
{time}
[contact]
thickness = 0.004
{tables}
[[cloth]]
name = "card"
mesh = {{ generator = "grid", width = 0.1, height = 0.1, nx = 2, ny = 2 }}
material = {{ areal_density = 0.2, in_plane = {{ model = "spring", stiffness = 1e4 }} }}
position = [0.003, 0.1, 0.002]
rotation = {{ axis = [1, 0, 1], angle = 0.6 }}
{bodies}
[[collider]]
name = "floor"
shape = {{ type = "plane", half_size = 1.0 }}
"#
    );
    let scene = Scene::parse_toml(&text, "test.toml").unwrap();
    let options = SimulationOptions { threads: Some(1), ..SimulationOptions::default() };
    let mut sim = Simulation::new(&scene, Assets::default(), options).unwrap();
    sim.audited &= audited;
    sim
}

#[test]
fn energy_made_is_found_while_pins_move_wind_blows_cloth_sleeps_and_steps_are_chosen() {
    let fixed = "dt = 0.0166";
    let cloth = |name: &str, more: &str| {
        format!(
            "[[cloth]]\nname = \"{name}\"\nmesh = {{ generator = \"grid\", width = 0.1, height = 0.1, nx = 2, ny = 2 }}\n\
             material = {{ areal_density = 0.2, in_plane = {{ model = \"spring\", stiffness = 10.0 }} }}\n{more}\n"
        )
    };
    let moved = cloth(
        "moved",
        "position = [0.5, 1.0, 0.0]\n\
         pins = [{ vertices = [0, 1], keyframes = [{ time = 0.0 }, { time = 1.0, position = [0.0, 0.01, 0.0] }] }]",
    );
    let still = cloth("still", "position = [0.5, 0.0041, 0.0]");
    let sleep = "[effects]\nsleep = { speed = 0.05, time = 0.02 }\n[air]\ndamping = 0.1\n";
    let wind = "[air]\nwind = [0.2, 0.0, 0.0]\ndensity = 1.2\ndrag = 1.0\n";
    let loose = "dt = \"auto\"\ndt_tolerance = 100.0\ndt_max = 0.0166";
    for (what, time, tables, bodies) in [
        ("pins", fixed, "", moved.as_str()),
        ("wind", fixed, wind, ""),
        ("sleep", fixed, sleep, still.as_str()),
        ("auto", loose, "", ""),
    ] {
        let run = |audited: bool| {
            let mut sim = landing_among(time, tables, bodies, audited);
            let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
            while sim.time() < 0.6 {
                sim.step().unwrap();
                let energy = sim.energy().total();
                least = least.min(energy);
                most = most.max(energy - least);
            }
            (most, sim)
        };
        let ((kept, sim), (made, _)) = (run(true), run(false));
        println!("{what}: {kept:.2e} J made with the ledger, {made:.2e} J without");
        let found = sim.report.refused.iter().any(|r| r.reason.contains("contact made"));
        assert!(found, "{what}: {:?}", sim.report.refused);
        assert!(kept < 0.5 * made, "{what}: {kept} of {made}");
        if what == "sleep" {
            assert!(
                sim.report.steps.iter().any(|s| s.asleep > 0 && s.energy.is_some()),
                "some slept meanwhile"
            );
        }
    }
}
