//! Contact that is known by its side: distances of rounding level, starts in touch, pairs that went through.

#![allow(clippy::unwrap_used, reason = "a failure here is a failure of the test")]

mod support;

use cloth_response::collision::mesh::TriMesh;
use cloth_response::collision::mesh::generators::grid;
use cloth_response::{ResponseParams, Side, Sides, Vec3};
use support::{World, cloth, collider, placed};

const DT: f64 = 0.004;

fn params(thickness: f64, allow_initial_contacts: bool) -> ResponseParams {
    ResponseParams { thickness, allow_initial_contacts, ..ResponseParams::default() }
}

/// A level sheet at that height; turned over, its triangles are wound the other way.
fn sheet(size: f64, points: usize, height: f64, turned_over: bool) -> TriMesh {
    let mut mesh = placed(grid(size, size, points, points).unwrap(), [0.0, 0.1, 0.0], [0.007, 0.0, 0.003]);
    mesh.vertices.iter_mut().for_each(|p| p.y = height);
    if turned_over {
        mesh.triangles.iter_mut().for_each(|t| t.swap(0, 1));
    }
    mesh
}

/// Thickness, and with it the distance at which cloth rests, so small that no distance has a direction.
const HAIR: f64 = 1e-13;

/// A card on the ground, a hair above it; both are turned over or not.
fn card(turned_over: [bool; 2]) -> World {
    let parts = [
        cloth(sheet(0.1, 4, HAIR, turned_over[0])),
        collider(placed(sheet(0.3, 5, 0.0, turned_over[1]), [0.0, 0.4, 0.0], [0.0; 3])),
    ];
    let mut world = World::new(&parts, params(HAIR, false));
    world.stiffness = 1.0;
    world
}

fn lowest(world: &World, body: usize) -> f64 {
    world.body(body).map(|i| world.x[i].y).fold(f64::INFINITY, f64::min)
}

const TURNS: [[bool; 2]; 4] = [[false, false], [false, true], [true, false], [true, true]];

/// Pressed on the ground at 1e-13 m for many steps, a card stays above and needs nothing but impulses; lifted, it goes.
#[test]
fn a_card_pressed_at_rounding_distance_stays_on_its_side() {
    for turned_over in TURNS {
        let mut world = card(turned_over);
        let mut decided = 0;
        for k in 0..100 {
            let info = world.step(DT);
            assert_eq!((info.zones, info.held_vertices), (0, 0), "{turned_over:?}, step {k}: {info:?}");
            assert!(lowest(&world, 0) > 0.0 && lowest(&world, 0) < 10.0 * HAIR);
            assert!(info.remembered > 0 && info.remembered <= info.proximities);
            decided += info.by_side;
        }
        assert!(decided > 1000, "{decided}: distances have no direction here");
        world.gravity = Vec3::new(0.0, 1.0, 0.0);
        for _ in 0..5 {
            assert_eq!(world.step(DT).held_vertices, 0);
        }
        let expected = 0.5 * 5.0 * 6.0 * DT * DT;
        assert!((lowest(&world, 0) - expected).abs() < 1e-9, "{}", lowest(&world, 0));
    }
}

/// The same pairs on their other sides, not to be corrected by where they are.
fn flipped(sides: &Sides, world: &World) -> Sides {
    let flip = |s: &Side| Side { positive: !s.positive, certain: false, ..*s };
    Sides::new(sides.pairs().iter().map(flip).collect(), &world.mesh).unwrap()
}

/// Planted: sides that are wrong press the card into the ground, where only the continuous detection stops it.
#[test]
fn a_side_that_is_flipped_is_seen() {
    let mut world = card([false, false]);
    assert_eq!(world.step(DT).collisions, 0);
    let wrong = flipped(world.responder.sides(), &world);
    world.responder.set_sides(wrong);
    assert!(world.step(DT).collisions > 0);
}

/// A card that starts exactly on the ground comes to rest above it, however the triangles are wound.
#[test]
fn a_card_that_starts_in_the_ground_plane_comes_out_above() {
    const THICKNESS: f64 = 0.002;
    for turned_over in TURNS {
        let parts = [
            cloth(sheet(0.1, 4, 0.0, turned_over[0])),
            collider(placed(sheet(0.3, 5, 0.0, turned_over[1]), [0.0, 0.4, 0.0], [0.0; 3])),
        ];
        let mut world = World::new(&parts, params(THICKNESS, true));
        world.stiffness = 1.0;
        world.damping = 1e-3;
        let first = world.try_step(DT, &|_, x, _| *x).unwrap().info;
        assert!(first.exempt > 0 && first.by_side > 0);
        for _ in 0..150 {
            world.try_step(DT, &|_, x, _| *x).unwrap();
            assert!(lowest(&world, 0) >= 0.0, "{turned_over:?}: {}", lowest(&world, 0));
        }
        assert!(lowest(&world, 0) > 0.5 * THICKNESS, "{turned_over:?}: {}", lowest(&world, 0));
        assert!(world.responder.sides().pairs().iter().all(|s| s.certain));
    }
}

/// Planted: with wrong sides such a card is taken through the ground.
#[test]
fn a_start_in_touch_with_flipped_sides_goes_through() {
    let build = || {
        let parts = [cloth(sheet(0.1, 4, 0.0, false)), collider(sheet(0.3, 5, 0.0, false))];
        World::new(&parts, params(0.002, true))
    };
    let mut right = build();
    right.try_step(DT, &|_, x, _| *x).unwrap();
    let mut wrong = build();
    wrong.responder.set_sides(flipped(right.responder.sides(), &wrong));
    for _ in 0..20 {
        right.try_step(DT, &|_, x, _| *x).unwrap();
        wrong.try_step(DT, &|_, x, _| *x).unwrap();
    }
    assert!(
        lowest(&right, 0) > 0.0 && lowest(&wrong, 0) < -1e-3,
        "{} {}",
        lowest(&right, 0),
        lowest(&wrong, 0)
    );
}

/// Two sheets in one plane that nothing tells apart part to two sides, the later one up.
#[test]
fn sheets_in_one_plane_part() {
    for turned_over in TURNS {
        let parts = [
            cloth(sheet(0.1, 4, 0.0, turned_over[0])),
            cloth(placed(sheet(0.1, 5, 0.0, turned_over[1]), [0.0, 0.4, 0.0], [0.0; 3])),
        ];
        let mut world = World::new(&parts, params(0.002, true));
        world.gravity = Vec3::zeros();
        for _ in 0..60 {
            world.try_step(DT, &|_, x, _| *x).unwrap();
        }
        let mean = |b: usize| world.body(b).map(|i| world.x[i].y).sum::<f64>() / world.body(b).len() as f64;
        assert!(mean(1) - mean(0) > 5e-4, "{turned_over:?}: {} over {}", mean(1), mean(0));
    }
}

/// A vertex that went through a sheet where it was exempt is brought back; one that is remembered there stays.
#[test]
fn what_went_through_comes_back() {
    for through in [true, false] {
        let upper = placed(grid(0.1, 0.1, 3, 3).unwrap(), [0.0; 3], [0.017, 0.02, 0.013]);
        let parts = [collider(sheet(0.3, 4, 0.0, false)), cloth(upper)];
        let mut world = World::new(&parts, params(0.004, true));
        world.gravity = Vec3::zeros();
        let vertex = world.first[1] + 4;
        world.x[vertex].y = -1e-4;
        world.try_step(1e-9, &|_, x, _| *x).unwrap();
        let v = vertex as u32;
        let told = |s: &Side| {
            let is_own = s.vertices[0] == v;
            Side { positive: s.positive != is_own, certain: !is_own, ..*s }
        };
        if through {
            let list: Vec<Side> = world.responder.sides().pairs().iter().map(told).collect();
            assert!(list.iter().any(|s| !s.certain));
            world.responder.set_sides(Sides::new(list, &world.mesh).unwrap());
        }
        for _ in 0..100 {
            world.try_step(DT, &|_, x, _| *x).unwrap();
        }
        let height = world.x[vertex].y;
        assert_eq!(height > 1e-4, through, "{height}");
    }
}

/// The sides are the same for any number of threads, and a response that is not accepted leaves none.
#[test]
fn sides_are_kept_by_accepted_steps_alone() {
    let run = |threads: usize, tries: usize| {
        let parts = [
            cloth(sheet(0.1, 9, 0.0031, false)),
            cloth(placed(sheet(0.1, 8, 0.0, true), [0.0, 0.3, 0.0], [0.0; 3])),
            collider(sheet(0.3, 5, -0.003, false)),
        ];
        let mut world = World::with_threads(&parts, params(0.004, false), threads);
        for k in 0..10 {
            for _ in 0..tries {
                // Attempts of other sizes, given up.
                let (mut x, mut v) = world.candidate(0.5 * DT, &|_, x, _| *x);
                let before = world.responder.sides().clone();
                let World { responder, mesh, bvh, inv_mass, x: x_t0, pool, .. } = &mut world;
                responder.respond(mesh, bvh, inv_mass, x_t0, &mut x, &mut v, 0.5 * DT, pool).unwrap();
                assert_eq!(responder.sides(), &before, "step {k}");
            }
            world.step(DT);
        }
        (world.responder.sides().clone(), world.x)
    };
    let (sides, x) = run(1, 0);
    assert!(sides.pairs().len() > 100);
    for (threads, tries) in [(2, 0), (1, 1), (2, 2)] {
        assert!(run(threads, tries) == (sides.clone(), x.clone()), "{threads} threads, {tries} tries");
    }
}
