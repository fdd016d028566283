//! Contact as constraints of the implicit solve: rest, sliding, release, energy, and what any method must keep.

mod common;

use cloth_sim::core::mesh::Vec3;
use cloth_sim::{Assets, Scene, Simulation, SimulationOptions};
use common::{MATERIAL, advance, bits, build, drape, scene, simulation};

const G: f64 = 9.81;
const THICKNESS: f64 = 0.002;
const DENSITY: f64 = 0.3;
/// tan α of the slope on which cards slide.
const SLOPE: f64 = 0.3;

/// A card on a slope of angle `alpha` [rad] at the thickness; `frames`: keyframes of the slope.
fn card(alpha: f64, friction: &str, dt: f64, frames: &str) -> String {
    let (s, c) = alpha.sin_cos();
    format!(
        r#"
duration = 2.0
[time]
dt = {dt}
[contact]
method = "constraints"
thickness = {THICKNESS}
friction = {friction}
[[cloth]]
name = "card"
mesh = {{ generator = "grid", width = 0.1, height = 0.1, nx = 7, ny = 7 }}
material = {{ areal_density = {DENSITY}, in_plane = {{ model = "baraff-witkin", warp = 2000.0, weft = 2000.0, shear = 1000.0, damping = 0.001 }}, bending = {{ model = "hinge", rigidity = 1e-3, damping = 0.001 }} }}
position = [{}, {}, 0.0]
rotation = {{ axis = [0, 0, 1], angle = {alpha} }}
[[collider]]
name = "plane"
shape = {{ type = "plane", half_size = 20.0 }}
rotation = {{ axis = [0, 0, 1], angle = {alpha} }}
{frames}
"#,
        -s * THICKNESS,
        c * THICKNESS
    )
}

fn mean(sim: &Simulation) -> Vec3 {
    sim.positions().iter().sum::<Vec3>() / sim.positions().len() as f64
}

fn farthest(sim: &Simulation, from: &[Vec3]) -> f64 {
    sim.positions().iter().zip(from).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
}

fn weight(sim: &Simulation) -> f64 {
    sim.masses().iter().sum::<f64>() * G
}

#[test]
fn a_card_below_the_angle_of_friction_stays_and_is_carried() {
    /// What contacts keep above the thickness, 1e-9 of it [m], and rounding of a sum over the weight.
    const ROUNDING: f64 = 1e-11;
    for alpha in [0.0, 0.2, 0.28] {
        let mut sim = simulation(&card(alpha, "0.3", 0.004, ""));
        let start = sim.positions().to_vec();
        advance(&mut sim, 1.0).unwrap();
        assert!(farthest(&sim, &start) < ROUNDING, "{alpha}: {:e}", farthest(&sim, &start));
        let force: Vec3 = sim.contact_forces().iter().sum();
        let error = (force - Vec3::y() * weight(&sim)).norm();
        assert!(error < ROUNDING * weight(&sim), "{alpha}: {error:e}");
        let contact = sim.report().steps.last().unwrap().contact.clone().unwrap();
        assert_eq!((contact.constrained_sticking, contact.constrained_sliding), (49, 0));
        assert_eq!((contact.impulses, contact.constraint_solves), (0, 1), "the filter has nothing to do");
    }
    // Planted: friction that is too little is seen.
    let mut sim = simulation(&card(0.28, "0.25", 0.004, ""));
    let start = sim.positions().to_vec();
    advance(&mut sim, 0.1).unwrap();
    assert!(farthest(&sim, &start) > 1e-3);
}

#[test]
fn sliding_starts_at_the_angle_of_static_friction() {
    /// Half a degree [rad].
    const HALF: f64 = 0.5 * std::f64::consts::PI / 180.0;
    for (law, mu) in [("0.3", 0.3f64), ("{ law = \"coulomb-stiction\", mu_c = 0.1, mu_s = 0.2 }", 0.2)] {
        for (alpha, slides) in [(mu.atan() - HALF, false), (mu.atan() + HALF, true)] {
            let mut sim = simulation(&card(alpha, law, 0.004, ""));
            let start = mean(&sim);
            advance(&mut sim, 0.5).unwrap();
            let way = (mean(&sim) - start).norm();
            assert_eq!(way > 1e-4, slides, "{law} at {alpha}: {way:e}");
        }
    }
}

/// Way of a card that slides down the slope from rest for 2 s under a law F_k(v)/m: the equation of motion by midpoint steps
/// of 10 µs.
fn way(deceleration: impl Fn(f64) -> f64) -> f64 {
    let (steps, alpha) = (200_000, SLOPE.atan());
    let dt = 2.0 / f64::from(steps);
    let rate = |v: f64| G * alpha.sin() - deceleration(v);
    let (mut x, mut v) = (0.0, 0.0);
    for _ in 0..steps {
        let middle: f64 = v + 0.5 * dt * rate(v);
        x += dt * middle;
        v += dt * rate(middle);
    }
    x
}

#[test]
fn cards_slide_as_their_equation_of_motion_says() {
    /// Of the way over 2 s.
    const AGREEMENT: f64 = 0.01;
    const F_V: f64 = 0.18;
    let normal = G * SLOPE.atan().cos();
    let stribeck = |v: f64| 0.1 + 0.1 * (-(v / 0.4).powf(0.2)).exp();
    let css = "mu_c = 0.1, mu_s = 0.2, v_s = 0.4, delta_s = 0.2";
    let coulomb = way(|_| 0.1 * normal);
    let laws = [
        ("0.1".to_string(), coulomb),
        ("{ law = \"coulomb-stiction\", mu_c = 0.1, mu_s = 0.2 }".to_string(), coulomb),
        (format!("{{ law = \"stribeck\", {css} }}"), way(|v| stribeck(v) * normal)),
        (
            format!("{{ law = \"viscous\", {css}, f_v = {F_V}, delta_v = 1.0 }}"),
            way(|v| stribeck(v) * normal + F_V / DENSITY * v),
        ),
    ];
    for (law, expected) in &laws {
        for dt in [0.001, 0.004] {
            let mut sim = simulation(&card(SLOPE.atan(), law, dt, ""));
            let start = mean(&sim);
            advance(&mut sim, 2.0).unwrap();
            let got = (mean(&sim) - start).norm();
            let error = got / expected - 1.0;
            println!("{law} dt {dt}: {got:.5} m of {expected:.5} m, {error:.2e}");
            assert!(error.abs() < AGREEMENT, "{law} dt {dt}: {error:e}");
        }
    }
    // Planted: the laws differ by more than the tolerance.
    assert!((laws[0].1 / laws[2].1 - 1.0).abs() > 10.0 * AGREEMENT);
    assert!((laws[2].1 / laws[3].1 - 1.0).abs() > 10.0 * AGREEMENT);
}

#[test]
fn the_force_on_a_sliding_card_is_the_kinetic_one() {
    /// Of the force: one step's search ends within that.
    const AGREEMENT: f64 = 2e-3;
    let alpha = SLOPE.atan();
    let mut sim = simulation(&card(alpha, "0.1", 0.004, ""));
    advance(&mut sim, 0.5).unwrap();
    let force: Vec3 = sim.contact_forces().iter().sum();
    let (along, across) =
        (Vec3::new(alpha.cos(), alpha.sin(), 0.0), Vec3::new(-alpha.sin(), alpha.cos(), 0.0));
    let normal = weight(&sim) * alpha.cos();
    assert!((across.dot(&force) / normal - 1.0).abs() < AGREEMENT, "{force}");
    assert!((along.dot(&force) / (0.1 * normal) - 1.0).abs() < AGREEMENT, "{force}");
    let contact = sim.report().steps.last().unwrap().contact.clone().unwrap();
    assert_eq!((contact.constrained_sliding, contact.impulses), (49, 0));
}

/// Keyframes of a motion that gets faster step by step, each by less than friction can pull along: 20 pieces of 50 ms.
fn faster(of_piece: impl Fn(f64) -> String) -> String {
    let frames: Vec<String> = (0..=20)
        .map(|k| format!("{{ time = {}, {} }}", 0.05 * f64::from(k), of_piece(f64::from(k * k) * 0.05)))
        .collect();
    format!("keyframes = [{}]", frames.join(", "))
}

#[test]
fn sticking_cloth_goes_with_what_moves_and_turns() {
    /// Rounding over 250 steps [m].
    const ROUNDING: f64 = 1e-11;
    // Over k pieces the way is k² · 0.05 units: at the end 20 units.
    let belt = faster(|s| format!("position = [{}, {}, 0.0]", 0.005 * s, 0.002 * s));
    // Slow enough: the linearised step sees a turn as a stretch of half its square.
    let table = faster(|s| format!("rotation = {{ axis = [0, 1, 0], angle = {} }}", 0.008 * s));
    let tilt = faster(|s| format!("rotation = {{ axis = [0, 0, 1], angle = {} }}", 0.004 * s));
    let turn = |axis: nalgebra::Unit<Vec3>, angle| nalgebra::Isometry3::rotation(axis.into_inner() * angle);
    let ways = [
        (&belt, nalgebra::Isometry3::translation(0.1, 0.04, 0.0)),
        (&table, turn(Vec3::y_axis(), 0.16)),
        (&tilt, turn(Vec3::z_axis(), 0.08)),
    ];
    for (frames, place) in ways {
        let mut sim = simulation(&card(0.0, "0.6", 0.004, frames));
        let expected: Vec<Vec3> =
            sim.positions().iter().map(|p| place.transform_point(&(*p).into()).coords).collect();
        let start = farthest(&sim, &expected);
        advance(&mut sim, 1.0).unwrap();
        assert!(farthest(&sim, &expected) < ROUNDING, "{:e} of {start}", farthest(&sim, &expected));
        assert!(start > 2e-3 && sim.intersections().unwrap().is_empty());
    }
    // Too fast to follow: the card is left behind.
    let sudden = "keyframes = [{ time = 0.0 }, { time = 1.0, position = [5.0, 0.0, 0.0] }]";
    let mut sim = simulation(&card(0.0, "0.1", 0.004, sudden));
    advance(&mut sim, 1.0).unwrap();
    assert!(mean(&sim).x > 0.3 && mean(&sim).x < 1.0, "pulled by μ g t²/2 = 0.49 m: {}", mean(&sim).x);
}

#[test]
fn a_collider_that_leaves_lets_go() {
    /// The linear solver's tolerance.
    const SOLVED: f64 = 1e-4;
    let frames = "keyframes = [{ time = 0.0 }, { time = 0.2 }, { time = 0.4, position = [0.0, -3.0, 0.0] }]";
    let mut sim = simulation(&card(0.0, "0.5", 0.004, frames));
    advance(&mut sim, 0.2).unwrap();
    let before = sim.positions().to_vec();
    advance(&mut sim, 0.1).unwrap();
    // 25 steps of free fall: Σ k g dt².
    let fall = 325.0 * G * 0.004 * 0.004;
    for (a, b) in sim.positions().iter().zip(&before) {
        assert!((a - b + Vec3::y() * fall).norm() < SOLVED * fall, "{a} {b}");
    }
    assert_eq!(sim.contact_forces().iter().map(Vec3::norm).sum::<f64>(), 0.0);
}

#[test]
fn cloth_that_is_lifted_comes_off_and_is_never_pulled() {
    let lift = "pins = [{ vertices = [0, 1, 2, 3, 4, 5, 6], keyframes = [{ time = 0.0 }, { time = 0.8, position = [0.0, 0.12, 0.0] }] }]";
    let text = card(0.0, "0.5", 0.004, "").replace("[[collider]]", &format!("{lift}\n[[collider]]"));
    let mut sim = simulation(&text.replace("[contact]", "[contact]\nself = false"));
    let mut partly = false;
    for _ in 0..250 {
        sim.step().unwrap();
        let forces = sim.contact_forces();
        let pull = forces.iter().map(|f| f.y).fold(f64::INFINITY, f64::min);
        assert!(pull > -2e-3 * weight(&sim) / 49.0, "t = {}: {pull:e} N", sim.time());
        let held = forces.iter().filter(|f| f.y > 0.0).count();
        partly |= held > 0 && held < 30;
        assert!(sim.intersections().unwrap().is_empty());
    }
    assert!(partly, "it comes off line by line");
    assert!(sim.contact_forces().iter().all(|f| *f == Vec3::zeros()), "it hangs free at the end");
}

/// The largest rise of the mechanical energy above what it had fallen to, and what it has fallen to in the end [J].
fn rise(text: &str, steps: usize) -> (f64, f64) {
    let mut sim = simulation(text);
    let start = sim.energy().total();
    let (mut least, mut highest, mut last) = (0.0f64, 0.0f64, 0.0);
    for _ in 0..steps {
        sim.step().unwrap_or_else(|e| panic!("{e}"));
        last = sim.energy().total() - start;
        least = least.min(last);
        highest = highest.max(last - least);
        assert_eq!(sim.intersections().map(|pairs| pairs.len()), Ok(0));
    }
    (highest, last)
}

/// A drape on a ball that stands still, by constraints, cloth not meeting itself; and the same by the velocity filter.
fn drapes(material: &str) -> [String; 2] {
    let text = drape(25).replace("[contact]", "[contact]\nself = false").replace(MATERIAL, material);
    assert!(text.contains(material));
    [text.replace("[contact]", "[contact]\nmethod = \"constraints\""), text]
}

#[test]
fn draping_gives_no_energy() {
    /// Of what is lost: the search for what slides and sticks ends within a part in a thousand.
    const GIVEN_BACK: f64 = 0.02;
    let stiff = "material = { areal_density = 0.2, in_plane = { model = \"baraff-witkin\", warp = 3e4, weft = 3e4, shear = 3e3 }, bending = { model = \"hinge\", rigidity = 1e-5 } }";
    let plate = "material = { areal_density = 0.2, in_plane = { model = \"baraff-witkin\", warp = 2e3, weft = 2e3, shear = 2e2 }, bending = { model = \"hinge\", rigidity = 1.0 } }";
    for (name, material) in [("soft", MATERIAL), ("stiff in plane", stiff), ("stiff in bending", plate)] {
        let [constraints, filter] = drapes(material);
        let (given, end) = rise(&constraints, 100);
        let (by_filter, _) = rise(&filter, 100);
        println!("{name}: {given:.2e} J of {end:.2e} J by constraints, {by_filter:.2e} J by the filter");
        assert!(given < -GIVEN_BACK * end, "{name}: {given:e} J of {end:e} J");
        assert!(by_filter > 10.0 * given, "{name}: {by_filter:e} J by the filter");
    }
}

#[test]
fn a_squeezed_ball_does_not_hop_higher_than_it_fell() {
    let text = |method: &str| {
        format!(
            r#"
duration = 1.0
[time]
dt = 0.005
[contact]
method = "{method}"
self = false
thickness = 0.004
[[cloth]]
name = "ball"
mesh = {{ generator = "sphere", radius = 0.1, subdivisions = 3 }}
material = {{ areal_density = 0.1, in_plane = {{ model = "baraff-witkin", warp = 3e3, weft = 3e3, shear = 3e3 }}, bending = {{ model = "hinge", rigidity = 0.01 }} }}
position = [0.0, 0.2, 0.0]
[[collider]]
name = "floor"
shape = {{ type = "plane", half_size = 1.0 }}
"#
        )
    };
    let (given, end) = rise(&text("constraints"), 200);
    let (by_filter, _) = rise(&text("velocity-filter"), 200);
    println!("{given:.2e} J of {end:.2e} J by constraints, {by_filter:.2e} J by the filter");
    assert!(given < 1e-3 * -end && by_filter >= given, "{given:e} {end:e} {by_filter:e}");
}

/// The drape with friction that sticks and slips, and cloth that meets itself.
fn constrained_drape(n: usize) -> String {
    drape(n).replace(
        "friction = 0.5",
        "method = \"constraints\"\nfriction = { law = \"stribeck\", mu_c = 0.3, mu_s = 0.6, v_s = 0.1, delta_s = 1.0 }",
    )
}

#[test]
fn a_constrained_drape_has_no_intersection_and_goes_with_the_ball() {
    let mut sim = simulation(&constrained_drape(21));
    let mut held = [0, 0];
    for _ in 0..200 {
        sim.step().unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(sim.intersections().unwrap(), [] as [[u32; 2]; 0], "t = {}", sim.time());
        let contact = sim.report().steps.last().unwrap().contact.clone().unwrap();
        held[0] += contact.constrained_sticking;
        held[1] += contact.constrained_sliding;
    }
    assert!(held[0] > 1000 && held[1] > 1000, "both happen: {held:?}");
    let turned = sim.velocities().iter().zip(sim.positions()).filter(|(_, p)| p.y > 0.2);
    let (mut rate, mut count) = (0.0, 0);
    for (v, p) in turned {
        rate += p.cross(v).y / (p.x * p.x + p.z * p.z).max(1e-4);
        count += 1;
    }
    assert!(
        rate / f64::from(count) > 1.0,
        "the ball turns by 2 rad/s, the top of the cloth by {rate} / {count}"
    );
}

#[test]
fn threads_checkpoints_and_retries_leave_no_trace() {
    let scene = common::scene(&constrained_drape(15));
    let mut straight = build(&scene, 1);
    let mut two = build(&scene, 2);
    for sim in [&mut straight, &mut two] {
        advance(sim, 0.4).unwrap();
    }
    assert_eq!(bits(&straight), bits(&two));
    let saved = two.checkpoint();
    advance(&mut straight, 0.2).unwrap();
    let mut resumed = Simulation::resume(&saved, Some(1)).unwrap();
    assert_eq!(resumed.contact_forces(), two.contact_forces());
    advance(&mut resumed, 0.2).unwrap();
    assert_eq!(bits(&straight), bits(&resumed));
    assert_eq!(straight.contact_forces(), resumed.contact_forces());
    let filter = drape(15);
    let mut other = build(&common::scene(&filter), 1);
    advance(&mut other, 0.6).unwrap();
    assert_ne!(bits(&straight), bits(&other), "the comparison sees a difference");
}

#[test]
fn every_implicit_scheme_and_solver_holds_a_card() {
    let text = card(SLOPE.atan(), "0.1", 0.004, "");
    let expected = 0.5 * G * SLOPE.atan().cos() * 0.2 * 0.2 * 0.2;
    for scheme in ["implicit-euler", "implicit-newton", "semi-implicit"] {
        for solver in ["pcg", "pcg-jacobi", "faer-cg", "faer-llt"] {
            let text = text.replace(
                "[contact]",
                &format!("integrator = \"{scheme}\"\n[solver]\nmethod = \"{solver}\"\n[contact]"),
            );
            // The first limit of stability of bending is far above.
            let mut sim = simulation(&text.replace("rigidity = 1e-3", "rigidity = 1e-6"));
            let start = mean(&sim);
            advance(&mut sim, 0.2).unwrap();
            let got = (mean(&sim) - start).norm();
            // Backward Euler from rest: dt/t more.
            assert!((got / expected - 1.02).abs() < 2e-3, "{scheme} {solver}: {got} of {expected}");
        }
    }
    for scheme in ["explicit-euler", "midpoint", "rk4"] {
        let text = text.replace("[contact]", &format!("integrator = \"{scheme}\"\n[contact]"));
        let scene = Scene::parse_toml(&text, "test.toml");
        let error = match scene {
            Ok(scene) => scene.check().unwrap_err().to_string(),
            Err(error) => error.to_string(),
        };
        assert!(error.contains("contact.method") && error.contains("implicit-newton"), "{error}");
        assert!(error.contains(scheme), "{error}");
    }
}

#[test]
fn a_scene_without_the_method_pays_nothing() {
    let filter = simulation(&drape(9));
    let constrained = simulation(&constrained_drape(9));
    let bytes = |sim: &Simulation| {
        let plan = sim.plan();
        plan.effects.iter().filter(|e| e.on && e.name.contains("contact")).map(|e| e.bytes).sum::<usize>()
    };
    assert!(bytes(&constrained) > bytes(&filter));
    let off = filter.plan().effects.iter().find(|e| e.name == "contact constraints").expect("listed");
    assert!(!off.on && off.bytes == 0);
    let mut filter = filter;
    advance(&mut filter, 0.3).unwrap();
    assert!(
        filter.report().steps.iter().all(|s| s.seconds.iter().all(|(name, _)| name != "contact constraints"))
    );
    let options = SimulationOptions { threads: Some(1), ..SimulationOptions::default() };
    let mut constrained = Simulation::new(&scene(&constrained_drape(9)), Assets::default(), options).unwrap();
    advance(&mut constrained, 0.3).unwrap();
    let cost =
        constrained.report().effects.iter().find(|e| e.name == "contact constraints").expect("an effect");
    assert!(cost.milliseconds > Some(0.0));
}
