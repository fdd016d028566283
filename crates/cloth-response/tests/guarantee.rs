//! The step contract in hard cases: what is accepted has no collision, by an independent judge.

#![allow(clippy::unwrap_used, reason = "a failure here is a failure of the test")]

mod support;

use cloth_response::collision::mesh::generators::{cuboid, grid, sphere};
use cloth_response::collision::{Contacts, DetectError, Detector, Query};
use cloth_response::{
    FrictionLaw, FrictionRule, ResponseError, ResponseInfo, ResponseParams, Vec3, collision,
};
use nalgebra::Rotation3;
use support::{Part, Random, World, cloth, collider, judge, placed};

fn params() -> ResponseParams {
    ResponseParams { thickness: 0.004, ..ResponseParams::default() }
}

fn sheet(size: f64, n: usize, axis_angle: [f64; 3], shift: [f64; 3]) -> Part {
    cloth(placed(grid(size, size, n, n).unwrap(), axis_angle, shift))
}

/// Sums over steps, to prove that a test reached what it is about.
#[derive(Default)]
struct Reached {
    steps: usize,
    collisions: usize,
    zones: usize,
    held: usize,
    refused: usize,
}

impl Reached {
    fn add(&mut self, info: &ResponseInfo) {
        self.steps += 1;
        self.collisions += info.collisions;
        self.zones += info.zones;
        self.held += info.held_vertices;
        assert_eq!((info.remaining, info.exempt), (0, 0));
    }
}

/// Two sheets at 50 m/s against each other: no collision, no intersection, momentum kept where no vertex was held.
#[test]
fn sheets_at_50_metres_per_second() {
    for tilt in [0.0, 0.3, 1.2] {
        let mut world = World::new(
            &[
                sheet(0.3, 9, [0.1, 0.0, tilt], [0.0, 0.1, 0.0]),
                sheet(0.3, 9, [0.0, 0.5, 0.0], [0.01, -0.1, 0.0]),
            ],
            params(),
        );
        for (body, speed) in [(0, -25.0), (1, 25.0)] {
            for i in world.body(body) {
                world.v[i].y = speed;
            }
        }
        world.gravity = Vec3::zeros();
        let mut reached = Reached::default();
        for _ in 0..10 {
            let before = world.momentum().0;
            let info = world.step(0.005);
            if info.held_vertices == 0 {
                assert!((world.momentum().0 - before).norm() < MOMENTUM_ERROR);
            }
            reached.add(&info);
        }
        assert!(reached.collisions > 100, "the sheets met");
    }
}

/// Rounding of sums over 200 vertices of 1e-4 kg at 25 m/s [N s].
const MOMENTUM_ERROR: f64 = 1e-13;

/// Three sheets of vertices with random velocities and a turning ball that moves into them.
fn tangle(seed: u64, params: ResponseParams) -> (World, f64, Vec3) {
    let mut random = Random(seed);
    let mut world = World::new(
        &[
            sheet(0.2, 6, [0.1, 0.0, 0.1], [0.0, 0.03, 0.0]),
            sheet(0.2, 6, [0.0, 0.4, 0.0], [0.01, 0.0, 0.0]),
            sheet(0.2, 5, [0.1, 0.1, -0.1], [0.0, -0.03, 0.01]),
            collider(placed(sphere(0.05, 1).unwrap(), [0.0; 3], BALL)),
        ],
        params,
    );
    assert_eq!(collision::intersections(&world.mesh, &world.x, &world.pool).unwrap(), [[0u32; 2]; 0]);
    world.stiffness = 2.0;
    world.damping = 1e-3;
    let speed = [1.0, 5.0, 30.0][seed as usize % 3];
    for i in 0..world.first[3] {
        world.v[i] = random.vector() * speed;
    }
    (world, speed, random.vector() * 20.0)
}

/// Start of the ball's centre [m], and its velocity [m/s].
const BALL: [f64; 3] = [0.0, -0.12, 0.0];
const BALL_VELOCITY: [f64; 3] = [0.0, 0.8, 0.1];
const TANGLE_DT: f64 = 0.004;

/// Runs a tangle; a refused step is tried again with halved steps.
fn run_tangle(seed: u64, params: ResponseParams, reached: &mut Reached) {
    let (mut world, _, spin) = tangle(seed, params);
    let end = 12.0 * TANGLE_DT;
    let mut dt = TANGLE_DT;
    while world.time < end - 1e-9 {
        let (way, turn) = (Vec3::from(BALL_VELOCITY), Rotation3::from_scaled_axis(spin * dt));
        let result = world.try_step(dt, &|_, x, time| {
            let centre = Vec3::from(BALL) + way * time;
            centre + way * dt + turn * (x - centre)
        });
        match result {
            Ok(step) => {
                assert_eq!(judge(&world.mesh, &step.x_t0, &world.x, &world.pool), 0, "seed {seed}");
                reached.add(&step.info);
                dt = TANGLE_DT;
            }
            Err(ResponseError::Unresolved { .. }) => {
                reached.refused += 1;
                dt *= 0.5;
                assert!(dt > 1e-4 * TANGLE_DT, "seed {seed}: stuck at {} s", world.time);
            }
            Err(other) => panic!("{other}"),
        }
    }
    assert_eq!(collision::intersections(&world.mesh, &world.x, &world.pool).unwrap(), [[0u32; 2]; 0]);
}

/// Random tangles over many seeds hold the contract, with all stages and with the late stages doing all the work.
#[test]
fn random_tangles() {
    let mut reached = Reached::default();
    for seed in 0..40 {
        run_tangle(seed, params(), &mut reached);
    }
    assert!(reached.collisions > 1000 && reached.refused < reached.steps / 20);

    let mut zones_only = Reached::default();
    for seed in 0..20 {
        run_tangle(seed, ResponseParams { max_passes: 1, ..params() }, &mut zones_only);
    }
    assert!(zones_only.zones > 100);

    let mut hold_only = Reached::default();
    for seed in 0..20 {
        run_tangle(seed, ResponseParams { max_passes: 1, max_zone_passes: 0, ..params() }, &mut hold_only);
    }
    assert!(hold_only.held > 100 && hold_only.zones == 0);
}

/// Sees nothing.
struct Blind;

impl Detector for Blind {
    fn name(&self) -> &'static str {
        "blind"
    }

    fn detect(
        &mut self,
        _: &collision::CollisionMesh,
        _: &Query<'_>,
        _: &rayon::ThreadPool,
    ) -> Result<Contacts, DetectError> {
        Ok(Contacts::default())
    }
}

/// Planted fault: a response that sees no collision leaves some, and the judge of these tests finds them.
#[test]
fn judge_finds_what_a_blind_response_leaves() {
    let mut left = 0;
    for seed in 0..6 {
        let (mut world, _, _) = tangle(seed, params());
        let (mut x_t1, mut v) = world.candidate(TANGLE_DT, &|_, x, _| *x);
        world
            .responder
            .respond_with(
                &world.mesh,
                &mut world.bvh,
                &mut Blind,
                &world.inv_mass,
                &world.x,
                &mut x_t1,
                &mut v,
                TANGLE_DT,
                &world.pool,
            )
            .unwrap();
        left += judge(&world.mesh, &world.x, &x_t1, &world.pool);
    }
    assert!(left > 0);
}

/// Brute force that takes as long for few active vertices as for all.
#[derive(Default)]
struct Whole {
    queries: usize,
}

impl Detector for Whole {
    fn name(&self) -> &'static str {
        "whole"
    }

    fn narrows(&self) -> bool {
        false
    }

    fn detect(
        &mut self,
        mesh: &collision::CollisionMesh,
        query: &Query<'_>,
        pool: &rayon::ThreadPool,
    ) -> Result<Contacts, DetectError> {
        assert!(query.active.is_none(), "few pairs are the hierarchy's");
        self.queries += 1;
        collision::BruteForce.detect(mesh, query, pool)
    }
}

/// A method that does not narrow is asked once per step, for all pairs; the hierarchy does the rest, to the same bits.
#[test]
fn a_method_that_does_not_narrow_is_asked_for_all_pairs_only() {
    let (mut whole, mut passes) = (Whole::default(), 0);
    for seed in 0..6 {
        let (mut world, _, _) = tangle(seed, params());
        let (mut x_t1, mut v) = world.candidate(TANGLE_DT, &|_, x, _| *x);
        let (mut x_expected, mut v_expected) = (x_t1.clone(), v.clone());
        let World { mesh, bvh, responder, inv_mass, x, pool, .. } = &mut world;
        responder.respond(mesh, bvh, inv_mass, x, &mut x_expected, &mut v_expected, TANGLE_DT, pool).unwrap();
        let info = responder
            .respond_with(mesh, bvh, &mut whole, inv_mass, x, &mut x_t1, &mut v, TANGLE_DT, pool)
            .unwrap();
        assert!(x_t1 == x_expected && v == v_expected);
        passes += info.passes;
    }
    assert_eq!(whole.queries, 6);
    assert!(passes > 6, "some step looked again");
}

/// The same bits for one, two and three threads.
#[test]
fn threads_do_not_change_the_answer() {
    let run = |threads: usize| {
        let mut world = World::with_threads(
            &[
                sheet(0.3, 20, [0.1, 0.0, 0.3], [0.0, 0.1, 0.0]),
                sheet(0.3, 20, [0.0, 0.5, 0.0], [0.01, 0.0, 0.0]),
                collider(placed(sphere(0.1, 2).unwrap(), [0.0; 3], [0.0, -0.12, 0.0])),
            ],
            params(),
            threads,
        );
        world.stiffness = 1.0;
        for i in world.body(0) {
            world.v[i].y = -20.0;
        }
        for _ in 0..6 {
            world.try_step(0.005, &|_, x, _| *x).unwrap();
        }
        (world.x, world.v)
    };
    let one = run(1);
    assert!(one == run(2));
    assert!(one == run(3));
}

/// A stack between two planes that close: resolved down to a fraction of its thickness, then refused by naming
/// cloth, never intersecting.
#[test]
fn squeezed_stack_is_refused_at_last() {
    let layers = 6;
    let gap = 0.005;
    let mut parts: Vec<_> = (0..layers)
        .map(|i| sheet(0.1, 4 + i % 2, [0.0, 0.2 * i as f64, 0.0], [0.001 * i as f64, gap * i as f64, 0.0]))
        .collect();
    let half = gap * (layers as f64 + 1.0) / 2.0;
    for side in [-1.0, 1.0] {
        let shift = [0.011, half - gap + side * half, 0.013];
        parts.push(collider(placed(grid(0.3, 0.3, 3, 3).unwrap(), [0.0; 3], shift)));
    }
    let mut world = World::new(&parts, params());
    world.stiffness = 2.0;
    world.damping = 1e-3;
    let (upper, speed, dt) = (world.first[layers + 1], 0.2, 0.005);
    let mut left = 2.0 * half;
    loop {
        let way = Vec3::y() * (speed * dt);
        match world.try_step(dt, &|i, x, _| if i >= upper { x - way } else { x + way }) {
            Ok(done) => assert_eq!(judge(&world.mesh, &done.x_t0, &world.x, &world.pool), 0),
            Err(ResponseError::Unresolved { pairs, vertices }) => {
                assert!(!pairs.is_empty() && (vertices[0] as usize) < world.first[layers]);
                break;
            }
            Err(other) => panic!("{other}"),
        }
        left -= 2.0 * speed * dt;
        assert!(left > 0.0, "planes that pass through each other leave no room");
    }
    assert!(left < 0.5 * gap * (layers as f64 + 1.0), "given up with {left} m left");
}

/// Cloth laid on a box that turns: the box's edges do not cut through.
#[test]
fn turning_box_carries_cloth() {
    let cloth_mesh = placed(grid(0.4, 0.4, 13, 13).unwrap(), [0.0; 3], [0.0, 0.056, 0.0]);
    let block = cuboid([0.2, 0.1, 0.2], [2, 1, 2]).unwrap();
    let mut world = World::new(&[cloth(cloth_mesh), collider(block)], params());
    world.stiffness = 3.0;
    world.damping = 2e-3;
    for step in 0..100 {
        let turn = Rotation3::from_scaled_axis(Vec3::y() * (0.016 * (step as f64 / 50.0).min(1.0)));
        world.step_moving(0.004, &|_, x, _| turn * x);
    }
    let top = world.body(0).map(|i| world.x[i].y).fold(0.0, f64::max);
    assert!((0.053..0.1).contains(&top), "it lies on the box, with folds: {top}");
}

/// A card on a turntable is dragged along by the surface's velocity with friction, and not without.
#[test]
fn turntable_drags_by_friction() {
    let spin = |friction: f64| {
        let friction = FrictionRule::uniform(FrictionLaw::Coulomb { mu_c: friction });
        let card = placed(grid(0.1, 0.1, 5, 5).unwrap(), [0.0; 3], [0.0, 0.004, 0.0]);
        let table = placed(grid(0.3, 0.3, 4, 4).unwrap(), [0.0; 3], [0.011, 0.0, 0.013]);
        let mut world = World::new(&[cloth(card), collider(table)], ResponseParams { friction, ..params() });
        world.stiffness = 2.0;
        world.damping = 1e-3;
        let turn = Rotation3::from_scaled_axis(Vec3::y() * 0.01);
        for _ in 0..60 {
            world.step_moving(0.005, &|_, x, _| turn * x);
        }
        let inertia: f64 =
            world.body(0).map(|i| (world.x[i].x.powi(2) + world.x[i].z.powi(2)) / world.inv_mass[i]).sum();
        world.momentum().1.y / inertia / 2.0
    };
    let (rough, smooth) = (spin(0.8), spin(0.0));
    assert!((rough - 1.0).abs() < 0.01, "{rough}");
    assert!(smooth.abs() < 0.01, "{smooth}");
}

/// A sheet that hangs from pinned vertices is hit by a fast ball; pins stay, nothing passes through.
#[test]
fn pinned_sheet_catches_a_ball() {
    let mut world = World::new(
        &[
            sheet(0.3, 9, [1.57, 0.0, 0.0], [0.0; 3]),
            collider(placed(sphere(0.06, 1).unwrap(), [0.0; 3], [0.0, 0.0, 0.2])),
        ],
        params(),
    );
    world.stiffness = 3.0;
    world.damping = 2e-3;
    for i in world.body(0) {
        if world.x[i].y > 0.149 {
            world.pin(i);
        }
    }
    let ball = world.first[1];
    for _ in 0..40 {
        world.step_moving(0.004, &|i, x, _| if i >= ball { x - Vec3::z() * 0.04 } else { *x });
    }
    // The ball is at z = −1.4 by then; what it touches rides in front of it.
    let front = world.body(0).map(|i| world.x[i].z).fold(0.0, f64::min);
    assert!(front < -1.0, "{front}");
}
