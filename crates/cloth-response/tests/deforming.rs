//! Colliders whose vertices move one by one: no rigid motion to ride on.

#![allow(clippy::unwrap_used, reason = "a failure here is a failure of the test")]

mod support;

use cloth_response::collision::mesh::generators::grid;
use cloth_response::{ResponseError, ResponseParams, Vec3};
use support::{World, cloth, collider, judge, placed};

const DT: f64 = 0.005;

/// Height of the collider's surface over its plane [m]: a bump that grows at 1 to 5 m/s and waves as it does.
fn height(x: &Vec3, time: f64) -> f64 {
    let bump = (-40.0 * (x.x * x.x + x.z * x.z)).exp();
    0.2 * (20.0 * time).sin() * bump * (1.0 + 0.4 * (30.0 * x.x + 60.0 * time).sin())
}

/// Counts over the steps of a run.
#[derive(Debug, Default)]
struct Reached {
    zones: usize,
    held: usize,
    refused: usize,
}

/// Loose cloth on a waving bump for a quarter of a second: no step has a collision. Refused steps are halved.
fn run(params: ResponseParams) -> Reached {
    let surface = placed(grid(0.6, 0.6, 13, 13).unwrap(), [0.0; 3], [0.011, 0.0, 0.013]);
    let plane = surface.vertices.clone();
    let sheet = placed(grid(0.4, 0.4, 10, 10).unwrap(), [0.0, 0.3, 0.0], [0.0, 0.01, 0.0]);
    let mut world = World::new(&[cloth(sheet), collider(surface)], params);
    world.stiffness = 3.0;
    world.damping = 2e-3;
    let first = world.first[1];
    let (mut reached, mut dt) = (Reached::default(), DT);
    let mut highest = 0.0_f64;
    while world.time < 0.25 {
        match world
            .try_step(dt, &|i, _, time| plane[i - first] + Vec3::y() * height(&plane[i - first], time + dt))
        {
            Ok(step) => {
                assert_eq!(judge(&world.mesh, &step.x_t0, &world.x, &world.pool), 0, "at {} s", world.time);
                reached.zones += step.info.zones;
                reached.held += step.info.held_vertices;
                dt = DT;
            }
            Err(ResponseError::Unresolved { .. }) => {
                reached.refused += 1;
                dt *= 0.5;
                assert!(dt > 1e-4 * DT, "stuck at {} s", world.time);
            }
            Err(other) => panic!("{other}"),
        }
        highest = world.body(0).map(|i| world.x[i].y).fold(highest, f64::max);
    }
    assert!(highest > 0.15, "the bump lifts the cloth: {highest} m");
    reached
}

fn params() -> ResponseParams {
    ResponseParams { thickness: 0.004, ..ResponseParams::default() }
}

#[test]
fn impulses_hold_cloth_on_a_deforming_collider() {
    let reached = run(params());
    assert_eq!(reached.refused, 0, "{reached:?}");
}

#[test]
fn zones_ride_on_a_deforming_collider() {
    let reached = run(ResponseParams { max_passes: 1, max_zone_passes: 30, ..params() });
    assert!(reached.zones > 10 && reached.refused <= 2, "{reached:?}");
}

#[test]
fn held_cloth_rides_on_a_deforming_collider() {
    let reached = run(ResponseParams { max_passes: 1, max_zone_passes: 0, ..params() });
    assert!(reached.held > 20 && reached.zones == 0 && reached.refused <= 2, "{reached:?}");
}
