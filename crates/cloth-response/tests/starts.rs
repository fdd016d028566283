//! Starts that are not clean, and input that is refused.

#![allow(clippy::unwrap_used, reason = "a failure here is a failure of the test")]

mod support;

use cloth_response::collision::intersections;
use cloth_response::collision::mesh::generators::grid;
use cloth_response::{Responder, ResponseError, ResponseParams, Vec3};
use support::{World, cloth, placed};

fn params(allow_initial_contacts: bool) -> ResponseParams {
    ResponseParams { thickness: 0.004, allow_initial_contacts, ..ResponseParams::default() }
}

/// Two sheets that pass through each other stay as they are: the crossings neither grow nor vanish.
#[test]
fn known_intersections_get_no_worse() {
    let mut world = World::new(
        &[
            cloth(placed(grid(0.2, 0.2, 8, 8).unwrap(), [0.0; 3], [0.0; 3])),
            cloth(placed(grid(0.2, 0.2, 7, 7).unwrap(), [1.3, 0.2, 0.1], [0.003, 0.011, 0.002])),
        ],
        params(true),
    );
    world.stiffness = 2.0;
    world.damping = 1e-3;
    for i in world.body(1) {
        world.v[i] = Vec3::new(0.5, -1.0, 0.3);
    }
    let before = intersections(&world.mesh, &world.x, &world.pool).unwrap();
    assert!(before.len() > 5);
    for _ in 0..40 {
        world.try_step(0.004, &|_, x, _| *x).unwrap();
        assert_eq!(intersections(&world.mesh, &world.x, &world.pool).unwrap(), before);
    }
}

/// A vertex that lies in a triangle of other cloth at the start.
fn touching(allow: bool) -> World {
    let mut world = World::new(
        &[
            cloth(placed(grid(0.1, 0.1, 3, 3).unwrap(), [0.0; 3], [0.0; 3])),
            cloth(placed(grid(0.1, 0.1, 3, 3).unwrap(), [0.0; 3], [0.017, 0.02, 0.013])),
        ],
        params(allow),
    );
    let vertex = world.first[1] + 4;
    world.x[vertex].y = 0.0;
    world
}

/// A touching pair is exempt and counted where that is allowed, else the step is refused and names it.
#[test]
fn touching_pairs_are_exempt_or_refused() {
    let mut world = touching(true);
    let vertex = (world.first[1] + 4) as u32;
    let step = world.try_step(0.004, &|_, x, _| *x).unwrap();
    assert!(step.info.exempt > 0);

    match touching(false).try_step(0.004, &|_, x, _| *x) {
        Err(ResponseError::Unresolved { vertices, .. }) => assert!(vertices.contains(&vertex)),
        other => panic!("expected a refusal, got {:?}", other.map(|s| s.info)),
    }
}

/// The arguments of a call.
struct Input {
    inv_mass: Vec<f64>,
    x_t0: Vec<Vec3>,
    x_t1: Vec<Vec3>,
    v: Vec<Vec3>,
    dt: f64,
}

/// Wrong lengths, numbers and steps are refused by name.
#[test]
fn bad_input_is_refused() {
    let mut world = touching(true);
    let (x_t1, v) = world.candidate(0.004, &|_, x, _| *x);
    let mut ask = |change: fn(&mut Input)| {
        let mut input = Input {
            inv_mass: world.inv_mass.clone(),
            x_t0: world.x.clone(),
            x_t1: x_t1.clone(),
            v: v.clone(),
            dt: 0.004,
        };
        change(&mut input);
        let Input { inv_mass, x_t0, x_t1, v, dt } = &mut input;
        let World { responder, mesh, bvh, pool, .. } = &mut world;
        responder.respond(mesh, bvh, inv_mass, x_t0, x_t1, v, *dt, pool).map(|_| ())
    };
    assert_eq!(ask(|_| ()), Ok(()));
    for dt in [|i: &mut Input| i.dt = 0.0, |i: &mut Input| i.dt = f64::NAN] {
        assert!(matches!(ask(dt), Err(ResponseError::Parameter { name: "dt", .. })));
    }
    assert!(matches!(ask(|i| i.inv_mass[3] = -1.0), Err(ResponseError::Parameter { name: "inv_mass", .. })));
    assert!(matches!(
        ask(|i| i.inv_mass.truncate(2)),
        Err(ResponseError::Length { name: "inv_mass", got: 2, .. })
    ));
    assert!(matches!(
        ask(|i| i.x_t0[2].y = f64::NAN),
        Err(ResponseError::NotFinite { name: "x_t0", vertex: 2 })
    ));
    assert!(matches!(
        ask(|i| i.x_t1[5].z = f64::INFINITY),
        Err(ResponseError::NotFinite { name: "x_t1", vertex: 5 })
    ));
    assert!(matches!(ask(|i| i.v.push(Vec3::zeros())), Err(ResponseError::Length { name: "v", .. })));
}

/// A mesh finer than the thickness is not blown up by its own neighbours once its rest shape is known.
#[test]
fn fine_meshes_keep_their_shape() {
    let build = || {
        let mut world = World::new(&[cloth(grid(0.02, 0.02, 11, 11).unwrap())], params(false));
        world.gravity = Vec3::zeros();
        world
    };
    let mut world = build();
    let start = world.x.clone();
    for _ in 0..3 {
        assert_eq!(world.step(0.004).impulses, 0);
    }
    assert!(world.x == start);

    let mut ignorant = build();
    ignorant.responder = Responder::new(&ignorant.mesh, params(false)).unwrap();
    assert!(ignorant.step(0.004).impulses > 0, "without the rest shape it pushes");
}
