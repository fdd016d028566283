//! Pushes out of the thickness: they move positions at a rate of their own and leave no velocity, whatever the step.

#![allow(clippy::unwrap_used, reason = "a failure here is a failure of the test")]

mod support;

use cloth_response::collision::mesh::generators::grid;
use cloth_response::{FrictionLaw, FrictionRule, ResponseParams, Vec3};
use support::{World, cloth, collider, placed};

const THICKNESS: f64 = 0.004;
/// Rounding of velocities, from differences of positions of 0.1 m over the smallest step [m/s].
const ROUNDING: f64 = 1e-9;
/// How far the sweeps may be off, per step [m/s].
const TOLERANCE: f64 = 1e-6;

/// A sheet 1 mm above another, turned, and that 1 mm above a collider; nothing moves them.
fn pressed() -> World {
    let sheet = |y: f64, turn: f64| placed(grid(0.1, 0.1, 5, 5).unwrap(), [0.0, turn, 0.0], [0.0, y, 0.0]);
    let friction = FrictionRule::uniform(FrictionLaw::Coulomb { mu_c: 0.5 });
    let mut world = World::new(
        &[cloth(sheet(0.002, 0.3)), cloth(sheet(0.001, 0.0)), collider(grid(0.4, 0.4, 4, 4).unwrap())],
        ResponseParams { thickness: THICKNESS, friction, ..ResponseParams::default() },
    );
    world.gravity = Vec3::zeros();
    world
}

/// Mean gap between the sheets, and to the collider.
fn gaps(world: &World) -> [f64; 2] {
    let height = |b: usize| world.body(b).map(|i| world.x[i].y).sum::<f64>() / world.body(b).len() as f64;
    [height(0) - height(1), height(1) - height(2)]
}

/// What is wrong with a step of [`pressed`] layers from `start`, in which nothing but pushes may act.
///
/// `pushed`: what the response says that they did [kg m].
fn wrong(world: &World, start: &[Vec3], v_t0: &[Vec3], pushed: Vec3) -> Option<&'static str> {
    let change = |i: usize| (world.v[i] - v_t0[i]).norm();
    if world.body(0).chain(world.body(1)).any(|i| change(i) > ROUNDING + TOLERANCE) {
        return Some("a push left velocity");
    }
    let up = |i: usize| (world.x[i].y - start[i].y) / world.inv_mass[i];
    let [upper, lower] = [0, 1].map(|b| world.body(b).map(up).sum::<f64>());
    if !(upper > 0.0 && lower > 0.0 && upper > lower) {
        return Some("a push brought layers nearer");
    }
    ((pushed.y - upper - lower).abs() > 1e-3 * (upper + lower)).then_some("a push was not told")
}

#[test]
fn planted_faults_of_pushes_are_caught() {
    let dt = 2e-3;
    let mut world = pressed();
    let (start, v_t0) = (world.x.clone(), world.v.clone());
    let pushed = world.step(dt).pushed;
    assert_eq!(wrong(&world, &start, &v_t0, pushed), None);
    let (end, v_t1) = (world.x.clone(), world.v.clone());
    for i in 0..end.len() {
        world.v[i] = v_t1[i] + (end[i] - start[i]) / dt;
    }
    assert_eq!(wrong(&world, &start, &v_t0, pushed), Some("a push left velocity"));
    world.v = v_t1;
    for i in 0..end.len() {
        world.x[i] = start[i] * 2.0 - end[i];
    }
    assert_eq!(wrong(&world, &start, &v_t0, pushed), Some("a push brought layers nearer"));
    world.x = end;
    assert_eq!(wrong(&world, &start, &v_t0, pushed * 1.01), Some("a push was not told"));
}

/// Slope of the upper wall of [`jammed`].
const SLOPE: f64 = 0.02;

/// How far a sheet goes sideways in a step of `dt` that has no room: it is a thickness above a floor, and one border touches a
/// wall above that leans by [`SLOPE`], so that what pushes it down pushes it aside too.
fn jammed(friction: f64, dt: f64) -> (f64, World) {
    let friction = FrictionRule::uniform(FrictionLaw::Coulomb { mu_c: friction });
    let wall = placed(
        grid(0.4, 0.4, 4, 4).unwrap(),
        [0.0, 0.0, SLOPE.atan()],
        [0.0, THICKNESS + 2e-6 + 0.05 * SLOPE, 0.0],
    );
    let mut world = World::new(
        &[
            cloth(placed(grid(0.1, 0.1, 3, 3).unwrap(), [0.0; 3], [0.0, THICKNESS, 0.0])),
            collider(grid(0.4, 0.4, 4, 4).unwrap()),
            collider(wall),
        ],
        ResponseParams { thickness: THICKNESS, friction, ..ResponseParams::default() },
    );
    world.gravity = Vec3::zeros();
    let start = world.x.clone();
    world.step(dt);
    let side = |i: usize| (world.x[i].x - start[i].x).abs();
    (world.body(0).map(side).fold(0.0, f64::max), world)
}

/// Pushes that cannot all have their way end at what they are able to, and hold each other by friction: they do not wedge the cloth
/// out, step after step, as far as the sweeps go on.
#[test]
fn pushes_against_each_other_move_nothing_sideways() {
    let dt = 1e-3;
    let (free, world) = jammed(0.0, dt);
    let heaviest = world.body(0).map(|i| world.inv_mass[i]).fold(0.0, f64::max);
    // The spring of a whole overlap, on a corner, by as many pairs as meet there.
    let most = 6.0 * SLOPE * 20.0 * THICKNESS * dt * dt * heaviest;
    assert!(free > 1e-6 && free < most, "{free} of {most}");
    let (held, _) = jammed(0.3, dt);
    assert!(held < 2.0 * TOLERANCE * dt + 1e-12, "{held} where {free} is free");
}

#[test]
fn a_push_leaves_no_velocity_and_takes_its_time() {
    for (dt, steps) in [(1e-4, 400), (1e-3, 40), (5e-3, 8)] {
        let mut world = pressed();
        let mut pushed = 0.0;
        for _ in 0..steps {
            let info = world.step(dt);
            pushed += info.pushed.y;
            let fastest = world.v.iter().map(Vec3::norm).fold(0.0, f64::max);
            assert!(fastest < ROUNDING + TOLERANCE * f64::from(steps), "dt {dt}: {fastest} m/s");
        }
        // 40 ms of 50: 1 − e^−0.8 = 0.55 of the overlap of 3 mm is undone at most, whatever the step; corners beyond the other's
        // border move alone, so that means are less.
        for gap in gaps(&world) {
            assert!((0.0015..0.0029).contains(&gap), "dt {dt}: {gap}");
        }
        let mass = |b: usize| world.body(b).map(|i| 1.0 / world.inv_mass[i]).sum::<f64>();
        let rise = |b: usize, y: f64| {
            world.body(b).map(|i| (world.x[i].y - y) / world.inv_mass[i]).sum::<f64>() / mass(b)
        };
        let way = mass(0) * rise(0, 0.002) + mass(1) * rise(1, 0.001);
        assert!((pushed - way).abs() < 1e-3 * way, "what is said is what was pushed: {pushed} {way}");
    }
}

/// A sheet that slides within the thickness is braked by what presses it, which here is nothing, and not by the push.
#[test]
fn a_push_brakes_nothing() {
    let mut world = pressed();
    for i in world.body(0).chain(world.body(1)) {
        world.v[i] = Vec3::new(0.2, 0.0, 0.1);
    }
    let info = world.step(5e-3);
    assert!(info.pushed.y > 0.0);
    for i in world.body(1) {
        let slip = Vec3::new(world.v[i].x - 0.2, 0.0, world.v[i].z - 0.1);
        assert!(slip.norm() < 10.0 * TOLERANCE, "{slip:?}");
    }
}
