//! Cloth on planes: landing, rest, friction on a slope.

#![allow(clippy::unwrap_used, reason = "a failure here is a failure of the test")]

mod support;

use cloth_response::collision::StencilKind;
use cloth_response::collision::mesh::generators::grid;
use cloth_response::{FrictionLaw, FrictionRule, ResponseParams, Vec3};
use support::{World, cloth, collider, placed};

/// [m]
const THICKNESS: f64 = 0.004;
/// [s]
const DT: f64 = 0.005;
/// Rounding of a fall of g dt = 0.05 m/s per step, taken back by a few dozen impulses [m/s].
const REST_SPEED: f64 = 1e-12;
/// Rounding of sums of 60 masses of 1e-4 kg at 2 m/s [N s].
const MOMENTUM_ERROR: f64 = 1e-15;
/// What the sweeps leave in four layers that fall by 0.05 m/s in each step: some µm per step, to and fro [m/s].
const CREEP: f64 = 3e-3;
/// The sliding speed is that of the closed form while no vertex of the plane passes under the card's border; there the
/// gap is linear to second order only.
const SLIDE_ERROR: f64 = 5e-3;

fn params(friction: f64) -> ResponseParams {
    ResponseParams {
        thickness: THICKNESS,
        friction: FrictionRule::by_kind(
            FrictionLaw::Coulomb { mu_c: 0.2 },
            FrictionLaw::Coulomb { mu_c: friction },
        ),
        ..ResponseParams::default()
    }
}

/// A card of 10 × 10 cm at a height above a plane of 1 m, everything turned by `slope` about z.
fn card_on_plane(height: f64, slope: f64, params: ResponseParams) -> World {
    let turn = [0.0, 0.0, slope];
    let card = placed(grid(0.1, 0.1, 6, 6).unwrap(), [0.0; 3], [0.0, height, 0.0]);
    let plane = placed(grid(1.0, 1.0, 5, 5).unwrap(), [0.0; 3], [0.013, 0.0, 0.017]);
    World::new(&[cloth(placed(card, turn, [0.0; 3])), collider(placed(plane, turn, [0.0; 3]))], params)
}

/// The card laid at its rest gap.
fn card_at_rest(slope: f64, friction: f64) -> World {
    card_on_plane(THICKNESS, slope, params(friction))
}

fn speed(world: &World) -> f64 {
    world.body(0).map(|i| world.v[i].norm()).fold(0.0, f64::max)
}

/// Mean velocity of the card [m/s].
fn mean_velocity(world: &World) -> Vec3 {
    world.momentum().0 / world.body(0).map(|i| 1.0 / world.inv_mass[i]).sum::<f64>()
}

/// A falling card lands at its rest gap and comes to rest without jitter.
#[test]
fn card_comes_to_rest() {
    let mut world = card_on_plane(0.05, 0.0, params(0.3));
    for _ in 0..100 {
        world.step(DT);
    }
    for _ in 0..200 {
        let info = world.step(DT);
        assert!(speed(&world) < REST_SPEED, "{}", speed(&world));
        assert_eq!((info.collisions, info.zones, info.held_vertices), (0, 0, 0));
    }
    let heights = world.body(0).map(|i| world.x[i].y);
    assert!(heights.clone().fold(1.0, f64::min) > 0.95 * THICKNESS);
    assert!(heights.fold(0.0, f64::max) < 1.05 * THICKNESS);
}

/// Below the friction angle the card stays, above it it slides with g (sin θ − μ cos θ) exactly.
#[test]
fn card_on_slope_sticks_or_slides() {
    for (slope, friction) in [(0.2_f64, 0.3_f64), (0.28, 0.3), (0.6, 0.8), (0.4, 0.3), (0.6, 0.1), (0.3, 0.0)]
    {
        let mut world = card_at_rest(slope, friction);
        let start = world.x.clone();
        let steps = 60;
        for _ in 0..steps {
            world.step(DT);
        }
        let expected = 9.81 * (slope.sin() - friction * slope.cos()).max(0.0) * DT * steps as f64;
        let down = Vec3::new(-slope.cos(), -slope.sin(), 0.0);
        let got = mean_velocity(&world).dot(&down);
        if expected == 0.0 {
            let drift = world.body(0).map(|i| (world.x[i] - start[i]).norm()).fold(0.0, f64::max);
            assert!(drift < 1e-9, "slope {slope}, friction {friction}: drift {drift:e} m");
        } else {
            let error = (got - expected).abs() / expected;
            assert!(error < SLIDE_ERROR, "slope {slope}, friction {friction}: {got} against {expected} m/s");
        }
    }
}

/// Cards on top of each other come to rest, the lower one pressed by the others, and keep their gaps for thousands of
/// steps.
#[test]
fn stack_keeps_its_gaps() {
    let layers = 4;
    let mut parts: Vec<_> = (0..layers)
        .map(|i| {
            let turn = [0.0, 0.3 * i as f64, 0.0];
            cloth(placed(grid(0.1, 0.1, 4 + i % 2, 5).unwrap(), turn, [0.0, 0.006 * (i + 1) as f64, 0.0]))
        })
        .collect();
    parts.push(collider(placed(grid(0.5, 0.5, 4, 4).unwrap(), [0.0; 3], [0.013, 0.0, 0.017])));
    let mut world = World::new(&parts, params(0.3));
    // Well below the limit of the explicit springs, m/dt²/8 edges.
    world.stiffness = 0.3;
    world.damping = 1e-3;
    let cards = world.first[layers];
    let fastest = |world: &World| (0..cards).map(|i| world.v[i].norm()).fold(0.0, f64::max);
    // Pushes leave no velocity, so that layers which landed within the thickness of each other part slowly.
    for _ in 0..800 {
        world.try_step(DT, &|_, x, _| *x).unwrap();
    }
    for step in 0..3000 {
        let done = world.try_step(DT, &|_, x, _| *x).unwrap();
        assert_eq!(
            (done.info.collisions, done.info.zones, done.info.held_vertices),
            (0, 0, 0),
            "step {step}"
        );
        if step % 100 == 0 {
            println!("{step} fastest {:.2e} {:?}", fastest(&world), done.info);
        }
        if step % 100 == 0 {
            assert!(fastest(&world) < CREEP, "step {step}: {} m/s", fastest(&world));
            let near =
                world.bvh.proximity(&world.mesh, &world.x, 0.9 * THICKNESS, None, &world.pool).unwrap();
            let least = near
                .iter()
                .filter(|s| s.kind == StencilKind::VertexTriangle)
                .map(|s| s.distance)
                .fold(THICKNESS, f64::min);
            assert!(least > 0.5 * THICKNESS, "step {step}: gap {least} m");
        }
    }
}

/// Two pieces of cloth alone in space exchange momentum and keep its sum, through repulsion, collisions and friction.
#[test]
fn momentum_is_exchanged_not_made() {
    let mut world = World::new(
        &[
            cloth(placed(grid(0.1, 0.1, 5, 5).unwrap(), [0.1, 0.0, 0.05], [0.0, 0.02, 0.0])),
            cloth(placed(grid(0.1, 0.1, 6, 6).unwrap(), [0.0, 0.3, 0.0], [0.01, 0.0, 0.0])),
        ],
        params(0.3),
    );
    world.gravity = Vec3::zeros();
    for i in world.body(0) {
        world.v[i] = Vec3::new(0.5, -2.0, 0.1);
    }
    let start = world.momentum();
    let mut contacts = 0;
    for _ in 0..40 {
        let info = world.step(DT);
        contacts += info.impulses;
        assert_eq!(info.held_vertices, 0);
    }
    let end = world.momentum();
    assert!(contacts > 100);
    assert!((end.0 - start.0).norm() < MOMENTUM_ERROR, "{:?}", end.0 - start.0);
    let lower = world.body(1).map(|i| world.v[i].y / world.inv_mass[i]).sum::<f64>();
    assert!(lower < -0.1 * start.0.norm(), "the lower piece was pushed");
}
