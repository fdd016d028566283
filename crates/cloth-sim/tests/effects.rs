//! Effects that are left out where they are proved not to matter, and cloth that sleeps.
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

mod common;

use cloth_sim::{Simulation, SimulationOptions};
use common::{MATERIAL, bits, build, drape, scene, simulation};

/// Everything the engine may decide by itself that does not change results.
const AUTO: &str = "\n[effects]\nself_collision = \"auto\"\nccd = \"auto\"\n";

/// A standing sheet that is thrown on a floor and crumples.
fn crumple(n: usize) -> String {
    format!(
        r#"
duration = 1.0
[time]
dt = 0.01
[contact]
thickness = 0.006
friction = 0.4
[[cloth]]
name = "cloth"
mesh = {{ generator = "grid", width = 0.3, height = 0.5, nx = {n}, ny = {n} }}
{MATERIAL}
rotation = {{ axis = [1.0, 0.1, 0.05], angle = 1.5 }}
position = [0.0, 0.27, 0.0]
velocity = [0.0, -4.0, 0.0]
[[collider]]
name = "floor"
shape = {{ type = "plane", half_size = 1.0 }}
"#
    )
}

/// Steps both and compares the bits after each; looks left out, triangles proved flat, and contacts found.
fn compare(text: &str, steps: usize) -> [usize; 3] {
    let (mut whole, mut auto) = (simulation(text), build(&scene(&format!("{text}{AUTO}")), 2));
    let mut seen = [0; 3];
    for step in 0..steps {
        whole.step().unwrap();
        auto.step().unwrap();
        assert_eq!(bits(&whole), bits(&auto), "step {step}");
        let [all, some] = [&whole, &auto].map(|sim| sim.report().steps[step].contact.clone().unwrap());
        assert_eq!(all.flat_triangles, 0);
        assert_eq!(
            (all.proximities, all.collisions, all.impulses),
            (some.proximities, some.collisions, some.impulses)
        );
        seen[0] += usize::from(some.looked_at == 0);
        seen[1] += some.flat_triangles as usize;
        seen[2] += all.collisions;
    }
    seen
}

#[test]
fn a_drape_is_the_same_bits_with_auto() {
    let [left_out, flat, collisions] = compare(&drape(21), 130);
    assert!(left_out > 5 && flat > 800 && collisions > 20, "{left_out} {flat} {collisions}");
}

#[test]
fn a_crumpling_sheet_is_the_same_bits_with_auto() {
    let [_, flat, collisions] = compare(&crumple(19), 130);
    assert!(flat > 0 && collisions > 20, "{flat} {collisions}");
}

/// A card on a slope of `angle` [rad], heavily damped, with a law of friction.
fn slope(angle: f64, law: &str, extra: &str) -> Simulation {
    let (sin, cos) = angle.sin_cos();
    let text = format!(
        r#"
duration = 1.0
[time]
dt = 0.005
[air]
damping = 60.0
[contact]
thickness = 0.006
friction = {{ {law} }}
[[cloth]]
name = "card"
mesh = {{ generator = "grid", width = 0.3, height = 0.3, nx = 7, ny = 7 }}
{MATERIAL}
position = [{}, {}, 0.0]
rotation = {{ axis = [0, 0, 1], angle = {angle} }}
[[collider]]
name = "slope"
shape = {{ type = "plane", half_size = 2.0 }}
rotation = {{ axis = [0, 0, 1], angle = {angle} }}
{extra}
"#,
        -0.0061 * sin,
        0.0061 * cos,
    );
    simulation(&text)
}

const STRIBECK: &str = "law = \"stribeck\", mu_c = 0.1, mu_s = 0.3, v_s = 0.5, delta_s = 1.0";

fn slow_friction(tolerance: f64) -> String {
    format!("[effects]\nfriction = \"auto\"\nfriction_tolerance = {tolerance}")
}

/// Steps both; the steps in which the second had slow friction, and how far apart they are in the end [m].
fn apart(on: &mut Simulation, auto: &mut Simulation, steps: usize) -> (usize, f64) {
    let mut slow = 0;
    for step in 0..steps {
        on.step().unwrap();
        auto.step().unwrap();
        let [none, some] =
            [&*on, &*auto].map(|sim| sim.report().steps[step].contact.as_ref().unwrap().slow_friction);
        assert_eq!(none, 0);
        slow += some;
    }
    let far = on.positions().iter().zip(auto.positions()).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    (slow, far)
}

/// All laws agree while everything sticks: what is left is that the sweeps settle velocities to 1e-6 m/s.
#[test]
fn what_sticks_has_slow_friction() {
    let viscous =
        "law = \"viscous\", mu_c = 0.1, mu_s = 0.3, v_s = 0.4, delta_s = 0.2, f_v = 5.0, delta_v = 1.0";
    for law in [STRIBECK, viscous, "law = \"coulomb-stiction\", mu_c = 0.1, mu_s = 0.3"] {
        let (mut on, mut auto) = (slope(0.2, law, ""), slope(0.2, law, &slow_friction(0.01)));
        let (slow, far) = apart(&mut on, &mut auto, 100);
        assert!(slow > 50, "{law}: {slow}");
        assert!(far <= 2.0 * 1e-6 * 0.5, "{law}: {far}");
    }
}

#[test]
fn creep_stays_within_the_tolerance_of_slow_friction() {
    // Friction per mass is wrong by at most ε μ_s g cos α, over the whole time against the drag of 60/s.
    let bound = |tolerance: f64, angle: f64| tolerance * 0.3 * 9.81 * angle.cos() * 0.5 / 60.0;
    let (mut on, mut auto) = (slope(0.302, STRIBECK, ""), slope(0.302, STRIBECK, &slow_friction(0.02)));
    let start = on.positions()[0];
    let (slow, far) = apart(&mut on, &mut auto, 100);
    assert!((on.positions()[0] - start).norm() > 5e-4, "it creeps");
    assert!(slow > 50 && far <= bound(0.02, 0.302), "{slow} {far}");
    // Too fast for that: the whole law, and no trace of the try.
    let (mut on, mut auto) = (slope(0.5, STRIBECK, ""), slope(0.5, STRIBECK, &slow_friction(0.02)));
    let (slow, _) = apart(&mut on, &mut auto, 100);
    assert_eq!((slow, bits(&on)), (0, bits(&auto)));
    // Planted: a kernel that takes this for slow is seen.
    let (mut on, mut auto) = (slope(0.5, STRIBECK, ""), slope(0.5, STRIBECK, &slow_friction(0.6)));
    let (slow, far) = apart(&mut on, &mut auto, 100);
    assert!(slow > 50 && far > bound(0.02, 0.5), "{slow} {far}");
}

/// Two napkins on a floor, a metre apart; a ball comes down on the first one after a second.
const NAPKINS: &str = r#"
duration = 2.0
[time]
dt = 0.005
[contact]
thickness = 0.006
friction = 0.4
[air]
damping = 3.0
[[cloth]]
name = "left"
mesh = { generator = "grid", width = 0.3, height = 0.3, nx = 9, ny = 9 }
material = { areal_density = 0.2, in_plane = { model = "spring", stiffness = 50.0 }, bending = { model = "hysteresis", b1 = 2e-3, b2 = 1e-3, c1 = -5e-3, plasticity = 0.3, fatigue = 0.1 } }
position = [-0.5, 0.01, 0.0]
[[cloth]]
name = "right"
mesh = { generator = "grid", width = 0.3, height = 0.3, nx = 9, ny = 9 }
material = { areal_density = 0.2, in_plane = { model = "spring", stiffness = 50.0 }, bending = { model = "hysteresis", b1 = 2e-3, b2 = 1e-3, c1 = -5e-3, plasticity = 0.3, fatigue = 0.1 } }
position = [0.5, 0.01, 0.0]
rotation = { axis = [0, 0, 1], angle = 0.02 }
[[collider]]
name = "floor"
shape = { type = "plane", half_size = 2.0 }
[[collider]]
name = "ball"
shape = { type = "sphere", radius = 0.1, tolerance = 4e-3 }
position = [-0.5, 0.5, 0.0]
keyframes = [{ time = 1.0 }, { time = 1.4, position = [-0.5, 0.107, 0.0] }, { time = 2.5, position = [-0.2, 0.107, 0.0] }]
"#;
/// Threshold of sleep [m/s] and [s].
const SPEED: f64 = 5e-3;
const SLEEP: &str = "\n[effects]\nsleep = { speed = 5e-3, time = 0.1 }\n";

fn sleeping() -> Simulation {
    build(&scene(&format!("{NAPKINS}{SLEEP}")), 1)
}

#[test]
fn napkins_sleep_until_they_are_touched() {
    let (mut sim, mut awake) = (sleeping(), simulation(NAPKINS));
    let mut first_sleep = None;
    for step in 1..=400 {
        sim.step().unwrap();
        awake.step().unwrap();
        if first_sleep.is_none() {
            let same = bits(&sim) == bits(&awake);
            assert!(same || !sim.asleep().is_empty(), "while nothing sleeps nothing is different: {step}");
        }
        if first_sleep.is_none() && sim.asleep().len() == 2 {
            first_sleep = Some((step, sim.positions().to_vec(), sim.report().totals.linear_iterations));
        }
        if step == 200 {
            let (_, x, iterations) = first_sleep.clone().unwrap();
            assert_eq!(sim.positions(), &x[..], "what sleeps stays");
            assert_eq!(sim.report().totals.linear_iterations, iterations, "and is not solved for");
            // Its energy is that of the awake cloth but for what that has crept.
            let [own, other] = [&sim, &awake].map(|sim| sim.energy().total());
            assert!((own - other).abs() < 0.05 * other.abs(), "{own} {other}");
        }
    }
    let (step, x, _) = first_sleep.unwrap();
    assert!(step < 150, "{step}");
    assert_eq!(sim.asleep(), ["right"], "the ball has woken the left one, and pushes it still");
    let half = x.len() / 2;
    assert_eq!(sim.positions()[half..], x[half..]);
    let moved = (0..half).map(|i| (sim.positions()[i] - x[i]).norm()).fold(0.0, f64::max);
    assert!(moved > 1e-3, "{moved}");
    // What the other would have crept is at most the threshold times the time asleep.
    let asleep = 0.005 * (400 - step) as f64;
    let crept = (half..x.len()).map(|i| (awake.positions()[i] - x[i]).norm()).fold(0.0, f64::max);
    assert!(crept <= SPEED * asleep, "{crept}");
}

#[test]
fn sleep_is_in_checkpoints_with_all_that_is_remembered() {
    let mut sim = sleeping();
    // Past the first sleep; then through the touch of the ball, from a checkpoint with one awake.
    for steps in [205, 60] {
        for _ in 0..steps {
            sim.step().unwrap();
        }
        let mut resumed = Simulation::resume(&sim.checkpoint(), Some(2)).unwrap();
        assert_eq!(resumed.asleep(), sim.asleep());
        assert_eq!(resumed.hinges(), sim.hinges());
        let (energy, same) = (sim.energy().total(), resumed.energy().total());
        assert!((energy - same).abs() < 1e-9 * energy.abs(), "{energy} {same}");
        for _ in 0..60 {
            sim.step().unwrap();
            resumed.step().unwrap();
        }
        assert_eq!(bits(&sim), bits(&resumed));
        assert_eq!(resumed.hinges(), sim.hinges());
    }
    assert_eq!(sim.asleep(), ["right"]);
}

/// A stack falls asleep together, and what lands on it wakes all of it.
#[test]
fn a_stack_sleeps_and_wakes_as_one() {
    let sheet = |name: &str, size: f64, y: f64| {
        format!(
            "[[cloth]]\nname = \"{name}\"\nmesh = {{ generator = \"grid\", width = {size}, height = {size}, nx = 7, ny = 7 }}\n{MATERIAL}\nposition = [0.0, {y}, 0.0]\n"
        )
    };
    let text = format!(
        "duration = 3.0\n[time]\ndt = 0.005\n[air]\ndamping = 5.0\n[contact]\nthickness = 0.006\nfriction = 0.4\n{}{}{}[[collider]]\nname = \"floor\"\nshape = {{ type = \"plane\", half_size = 1.0 }}\n{SLEEP}",
        sheet("lower", 0.3, 0.007),
        sheet("upper", 0.26, 0.0145),
        sheet("late", 0.2, 2.0),
    );
    let mut sim = simulation(&text);
    let (mut slept, mut woke) = (false, false);
    for _ in 0..600 {
        sim.step().unwrap();
        let asleep = sim.asleep();
        let stack = ["lower", "upper"].map(|name| asleep.contains(&name));
        assert_eq!(stack[0], stack[1], "at {} s", sim.time());
        slept |= stack[0];
        woke |= slept && !stack[0];
    }
    assert!(slept && woke, "{slept} {woke}");
    assert_eq!(sim.asleep().len(), 3, "all have come to rest");
    assert!(sim.intersections().unwrap().is_empty());
}

#[test]
fn what_is_not_asked_for_is_off_and_takes_nothing() {
    let sim = simulation(&drape(9));
    for name in ["flatness proofs", "gap proofs", "slow friction", "sleep"] {
        let effect = sim.plan().effects.iter().find(|e| e.name == name).unwrap();
        assert!(!effect.on && effect.bytes == 0 && !effect.why.is_empty() && effect.milliseconds.is_none());
    }
    let auto = simulation(&format!("{}{AUTO}sleep = {{}}\n", drape(9)));
    for name in ["flatness proofs", "gap proofs", "sleep"] {
        assert!(auto.plan().running().any(|n| n == name), "{name}");
    }
    let plan =
        |sim: &Simulation| sim.plan().effects.iter().find(|e| e.name == "slow friction").unwrap().clone();
    let why = plan(&slope(0.2, STRIBECK, &slow_friction(0.02)));
    assert!(why.on && why.why.contains("m/s") && why.why.contains("0.02"), "{why:?}");
    let why = plan(&simulation(&format!("{}{}", drape(9), slow_friction(0.02))));
    assert!(!why.on && why.why.contains("Coulomb"), "{why:?}");
    assert!(auto.plan().effects.iter().any(|e| e.on && e.milliseconds.is_some_and(|ms| ms > 0.0)));
}

#[test]
fn mistakes_are_named() {
    let error = |extra: &str| {
        let text = format!("{}\n{extra}\n", drape(9));
        let parsed = cloth_sim::Scene::parse_toml(&text, "test.toml").map_err(|e| e.to_string());
        let options = SimulationOptions { threads: Some(1), ..SimulationOptions::default() };
        match parsed {
            Err(error) => error,
            Ok(scene) => match Simulation::new(&scene, cloth_sim::Assets::default(), options) {
                Err(error) => error.to_string(),
                Ok(_) => panic!("{extra} is accepted"),
            },
        }
    };
    let text = error("[effects]\nccd = \"maybe\"");
    assert!(text.contains("effects.ccd") && text.contains("\"on\"") && text.contains("maybe"), "{text}");
    let text = error("[effects]\ncdd = \"auto\"");
    assert!(text.contains("did you mean \"ccd\""), "{text}");
    let text = error("[effects]\nsleep = { speed = 0.0 }");
    assert!(text.contains("effects.sleep.speed") && text.contains("> 0"), "{text}");
    let text = error("[effects]\nfriction = \"auto\"\nfriction_tolerance = 1.0");
    assert!(text.contains("effects.friction_tolerance") && text.contains("< 1"), "{text}");
    let text = error("[effects]\nsleep = { time = -1.0 }");
    assert!(text.contains("effects.sleep.time"), "{text}");
    let mut given = scene(&format!("{}{SLEEP}", drape(9)));
    given.contact.as_mut().unwrap().method = cloth_sim::scene::ContactMethod::Constraints;
    assert!(given.check().unwrap_err().to_string().contains("effects.sleep"));
}
