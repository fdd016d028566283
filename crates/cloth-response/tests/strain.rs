//! Strain limits: kept in every step, without momentum or intersections of their own, together with contact.

#![allow(clippy::unwrap_used, reason = "a failure here is a failure of the test")]

mod support;

use cloth_response::collision::mesh::generators::{grid, sphere};
use cloth_response::{LimitedEdge, ResponseError, ResponseParams, StrainLimit, Vec3};
use support::{Part, Random, World, cloth, collider, placed};

const DT: f64 = 0.005;
/// Rounding of a length, relative.
const ROUNDING: f64 = 1e-9;
/// Momenta relative to their size.
const MOMENTUM_ERROR: f64 = 1e-10;

const LIMIT: StrainLimit = StrainLimit { stretch: 0.1, compression: Some(0.1) };

fn params() -> ResponseParams {
    ResponseParams { thickness: 0.004, ..ResponseParams::default() }
}

/// The edges of the bodies that are cloth, at their length now.
fn edges(world: &World, limit: StrainLimit) -> Vec<LimitedEdge> {
    let mesh = &world.mesh;
    let dynamic = |e: &&[u32; 2]| mesh.bodies[mesh.vertex_body[e[0] as usize] as usize].dynamic;
    let length = |e: &[u32; 2]| (world.x[e[0] as usize] - world.x[e[1] as usize]).norm();
    let edge = |e: &[u32; 2]| LimitedEdge { vertices: *e, rest_length: length(e), limit };
    mesh.edges.iter().filter(dynamic).map(edge).collect()
}

fn limited(parts: &[Part], limit: StrainLimit) -> (World, Vec<LimitedEdge>) {
    let mut world = World::new(parts, params());
    let list = edges(&world, limit);
    world.responder.set_strain_limits(&world.mesh, list.clone()).unwrap();
    (world, list)
}

/// Least and largest strain of the edges.
fn strains(world: &World, list: &[LimitedEdge]) -> (f64, f64) {
    let strain = |e: &LimitedEdge| {
        let [a, b] = e.vertices.map(|v| world.x[v as usize]);
        (a - b).norm() / e.rest_length - 1.0
    };
    list.iter().map(strain).fold((0.0, 0.0), |(low, high), s| (low.min(s), high.max(s)))
}

/// Cloth without any stiffness, hung by two corners: limited it is a net of 110 % at most in every step, else it falls apart.
#[test]
fn a_hanging_net_keeps_its_limit() {
    let sheet = || [cloth(grid(0.2, 0.2, 9, 9).unwrap())];
    let (mut world, list) = limited(&sheet(), StrainLimit { compression: None, ..LIMIT });
    let mut free = World::new(&sheet(), params());
    for w in [&mut world, &mut free] {
        w.pin(0);
        w.pin(8);
    }
    let (mut largest, mut pulled) = (0.0_f64, 0);
    for _ in 0..200 {
        let info = world.step(DT);
        let (_, stretch) = strains(&world, &list);
        assert!(stretch <= LIMIT.stretch * (1.0 + ROUNDING), "{stretch}");
        assert!((info.largest_stretch - stretch).abs() < ROUNDING);
        largest = largest.max(stretch);
        pulled += info.limited_edges;
        free.try_step(DT, &|_, x, _| *x).unwrap();
    }
    assert!(largest > 0.99 * LIMIT.stretch && pulled > 1000, "the limit acts: {largest}, {pulled}");
    assert!(strains(&free, &list).1 > 1.0, "without it nothing holds");
}

/// Both bounds hold in a piece of cloth whose vertices fly about, and it keeps momentum and angular momentum.
#[test]
fn limits_keep_both_momenta() {
    let (mut world, list) = limited(&[cloth(grid(0.1, 0.1, 6, 6).unwrap())], LIMIT);
    world.gravity = Vec3::zeros();
    let mut random = Random(7);
    for i in world.body(0) {
        let p = random.vector();
        world.v[i] = Vec3::new(p.x, 0.3 * p.y, p.z);
    }
    let start = world.momentum();
    let size: f64 = world.body(0).map(|i| world.v[i].norm() / world.inv_mass[i]).sum();
    let (mut low, mut high) = (0.0_f64, 0.0_f64);
    for _ in 0..40 {
        let mut unlimited = World::new(&[cloth(grid(0.1, 0.1, 6, 6).unwrap())], params());
        unlimited.gravity = Vec3::zeros();
        unlimited.x.clone_from(&world.x);
        unlimited.v.clone_from(&world.v);
        unlimited.try_step(0.002, &|_, x, _| *x).unwrap();
        let without = strains(&unlimited, &list);
        (low, high) = (low.min(without.0), high.max(without.1));
        let info = world.try_step(0.002, &|_, x, _| *x).unwrap().info;
        let (compressed, stretched) = strains(&world, &list);
        assert!(stretched <= 0.1 * (1.0 + ROUNDING) && compressed >= -0.1 * (1.0 + ROUNDING));
        assert!(
            info.largest_stretch <= 0.1 * (1.0 + ROUNDING)
                && info.largest_compression <= 0.1 * (1.0 + ROUNDING)
        );
        let now = world.momentum();
        assert!((now.0 - start.0).norm() < MOMENTUM_ERROR * size, "{:?}", now.0 - start.0);
        assert!(
            (now.1 - start.1).norm() < MOMENTUM_ERROR * 0.1 * size,
            "{:?} of {:?}",
            now.1 - start.1,
            start.1
        );
    }
    assert!(high > 0.101 && low < -0.101, "both limits had work: {low} {high}");
}

/// Loose cloth that drapes over a ball stays a net of bounded edges, and no step has a collision or an intersection:
/// `World::step` judges each by brute force.
#[test]
fn limits_and_contact_hold_together() {
    let sheet = placed(grid(0.4, 0.4, 13, 13).unwrap(), [0.0; 3], [0.0, 0.156, 0.0]);
    let ball = placed(sphere(0.15, 2).unwrap(), [0.0; 3], [0.003, 0.0, 0.005]);
    let (mut world, list) =
        limited(&[cloth(sheet), collider(ball)], StrainLimit { stretch: 0.05, compression: None });
    let (mut both, mut top) = (0, f64::NEG_INFINITY);
    for _ in 0..120 {
        let info = world.step(DT);
        let (_, stretch) = strains(&world, &list);
        assert!(stretch <= 0.05 * (1.0 + ROUNDING), "{stretch}");
        both += usize::from(info.limited_edges > 0 && info.impulses > info.limited_edges);
        top = world.body(0).map(|i| world.x[i].y).fold(f64::NEG_INFINITY, f64::max);
    }
    assert!(both > 50, "contact and limits act together in {both} steps");
    assert!(top > 0.14, "the net hangs on the ball: {top}");
}

/// A limit that nothing reaches changes no bit.
#[test]
fn a_limit_out_of_reach_changes_nothing() {
    let parts = || {
        [
            cloth(placed(grid(0.1, 0.1, 6, 6).unwrap(), [0.1, 0.0, 0.05], [0.0, 0.02, 0.0])),
            collider(grid(1.0, 1.0, 4, 4).unwrap()),
        ]
    };
    let (mut world, _) = limited(&parts(), StrainLimit { stretch: 50.0, compression: None });
    let mut free = World::new(&parts(), params());
    for w in [&mut world, &mut free] {
        (w.stiffness, w.damping) = (5.0, 1e-3);
        for _ in 0..50 {
            w.step(DT);
        }
    }
    assert!(world.x == free.x && world.v == free.v);
}

/// Edges between pins that go apart cannot be kept: an error that names them, and arrays as they were (`try_step`).
#[test]
fn what_cannot_be_kept_is_an_error() {
    let (mut world, _) = limited(&[cloth(grid(0.1, 0.1, 3, 3).unwrap())], LIMIT);
    for v in [0, 3, 6, 2, 5, 8] {
        world.pin(v);
    }
    let pull = |i: usize, x: &Vec3, _: f64| if i.is_multiple_of(3) { x - Vec3::x() * 0.02 } else { *x };
    match world.try_step(DT, &pull) {
        Err(ResponseError::Strained { edges, excess }) => {
            assert!(edges.iter().any(|e| e.contains(&4)) && excess > 0.01, "{edges:?} {excess}");
        }
        other => panic!("{:?}", other.map(|s| s.info)),
    }
    let small = |i: usize, x: &Vec3, _: f64| if i.is_multiple_of(3) { x - Vec3::x() * 0.0002 } else { *x };
    assert!(world.try_step(DT, &small).is_ok(), "a smaller step can be kept");
}

/// Cloth that starts beyond its limit is drawn back bit by bit, and does not burst.
#[test]
fn a_start_beyond_the_limit_is_drawn_back() {
    let mut world = World::new(&[cloth(grid(0.1, 0.1, 4, 4).unwrap())], params());
    let mut list = edges(&world, LIMIT);
    for e in &mut list {
        e.rest_length *= 0.8;
    }
    world.responder.set_strain_limits(&world.mesh, list.clone()).unwrap();
    world.gravity = Vec3::zeros();
    let mut last = strains(&world, &list).1;
    assert!(last > 0.2);
    for _ in 0..50 {
        world.try_step(DT, &|_, x, _| *x).unwrap();
        let now = strains(&world, &list).1;
        assert!(now <= LIMIT.stretch.max(0.1 + 0.9 * (last - 0.1)) + 1e-9, "{now} after {last}");
        last = now;
    }
    assert!(last <= LIMIT.stretch * 1.001, "{last}");
}
