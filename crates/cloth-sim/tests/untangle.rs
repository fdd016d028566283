//! `start = "untangle"`: small penetrations are repaired and listed, others refused with their number.

#![allow(clippy::result_large_err, reason = "an error ends the test: its size costs nothing")]
#![allow(clippy::unwrap_used, reason = "a failure fails the test")]

mod common;

use cloth_sim::core::mesh::Vec3;
use cloth_sim::{Assets, SimError, Simulation, SimulationOptions};
use common::{MATERIAL, advance, bits, build, scene};

/// A sheet flat at y = 0, with whatever else.
fn flat(more: &str) -> String {
    format!(
        r#"
duration = 1.0
start = "untangle"
[contact]
thickness = 0.004
[[cloth]]
name = "flat"
mesh = {{ generator = "grid", width = 0.3, height = 0.3, nx = 13, ny = 13 }}
{MATERIAL}
{more}
"#
    )
}

fn sheet(name: &str, place: &str) -> String {
    format!(
        "[[cloth]]\nname = \"{name}\"\nmesh = {{ generator = \"grid\", width = 0.2, height = 0.2, nx = 9, ny = 9 }}\n{MATERIAL}\n{place}\n"
    )
}

/// The simulation, and where its vertices would be without repair.
fn repaired(text: &str) -> (Simulation, Vec<Vec3>) {
    let given = text.replace("start = \"untangle\"", "");
    let given = given.replace("[contact]", "[contact]\nallow_intersections = true");
    let before = build(&scene(&given), 1);
    assert!(!before.intersections().unwrap().is_empty(), "the scene has something to repair");
    (build(&scene(text), 1), before.all_positions().to_vec())
}

/// Checks a repair: nothing meets, what moved is listed, nothing went farther than `most` [m], and it runs.
fn check(text: &str, most: f64) {
    let (mut sim, before) = repaired(text);
    assert!(sim.intersections().unwrap().is_empty());
    let done = sim.report().untangled.clone().expect("a repair");
    let way: Vec<f64> = sim.all_positions().iter().zip(&before).map(|(a, b)| (a - b).norm()).collect();
    let moved: Vec<(u32, f64)> = (0u32..).zip(way.iter().copied()).filter(|(_, d)| *d > 0.0).collect();
    assert_eq!(done.moved, moved);
    assert!(done.pairs > 0 && done.largest > 0.0 && done.largest < most, "{:e}", done.largest);
    assert_eq!(
        &sim.all_positions()[sim.positions().len()..],
        &before[sim.positions().len()..],
        "colliders stay"
    );
    let effect = sim.plan().effects.iter().find(|e| e.name == "untangled start").unwrap();
    assert!(
        effect.on && effect.elements == moved.len() && effect.why.contains("pairs resolved"),
        "{}",
        effect.why
    );
    assert_eq!(bits(&sim), bits(&build(&scene(text), 2)), "the same on any number of threads");
    advance(&mut sim, 0.05).unwrap();
    assert!(sim.intersections().unwrap().is_empty());
}

#[test]
fn a_border_that_dips_through_a_sheet() {
    // The low border of the small sheet is 10 mm below the other one.
    let tilted =
        sheet("tilted", "position = [0.003, 0.02, 0.002]\nrotation = { axis = [0, 0, 1], angle = 0.3 }");
    check(&flat(&tilted), 0.03);
}

#[test]
fn a_corner_that_dips_through_a_sheet() {
    let corner =
        sheet("corner", "position = [0.003, 0.035, 0.002]\nrotation = { axis = [1, 0, -1], angle = 0.3 }");
    check(&flat(&corner), 0.03);
}

#[test]
fn two_sheets_in_one_plane() {
    check(&flat(&sheet("other", "position = [0.003, 0.0, 0.002]")), 0.01);
}

#[test]
fn a_sheet_that_dips_into_a_sphere() {
    // The cap is 6 mm deep.
    let ball = "[[collider]]\nname = \"ball\"\nshape = { type = \"sphere\", radius = 0.1, tolerance = 1e-3 }\n\
                position = [0.003, -0.094, 0.002]\n";
    check(&flat(ball), 0.03);
}

#[test]
fn a_vertex_through_a_floor() {
    let floor = "[[collider]]\nname = \"floor\"\nshape = { type = \"plane\", half_size = 1.0 }\n\
                 position = [0.0, -0.038, 0.0]\nrotation = { axis = [1, 0, -1], angle = 0.2 }\n";
    check(&flat(floor), 0.03);
}

#[test]
fn borders_that_cross_like_cards() {
    // The sheets stand in each other's borders by 4 mm: neither is cut in two.
    let card =
        sheet("card", "position = [0.246, 0.003, 0.002]\nrotation = { axis = [1, 0, 0], angle = 1.4 }");
    check(&flat(&card), 0.06);
}

#[test]
fn a_hopeless_tangle_is_refused_with_its_count() {
    let through =
        sheet("through", "position = [0.011, 0.007, 0.013]\nrotation = { axis = [1, 0, 0], angle = 1.4 }");
    let text = flat(&through);
    let error = Simulation::new(&scene(&text), Assets::default(), SimulationOptions::default())
        .err()
        .expect("refused");
    let words = error.to_string();
    let SimError::StartIntersections { count, pairs, names, tangled } = error else { panic!("{words}") };
    let before = tangled.expect("untangling was tried");
    assert!(count > 0 && count <= before && !pairs.is_empty() && !names.is_empty());
    assert!(
        words.contains(&format!("leaves these of {before}")) && words.contains("through triangle"),
        "{words}"
    );
    // Where intersections are allowed it runs as given.
    let allowed = text.replace("[contact]", "[contact]\nallow_intersections = true");
    let sim = build(&scene(&allowed), 1);
    let given = build(&scene(&allowed.replace("start = \"untangle\"", "")), 1);
    assert_eq!(bits(&sim), bits(&given), "a repair that fails leaves no trace");
    assert!(sim.report().untangled.is_none());
}

#[test]
fn pinned_vertices_are_not_moved() {
    let ball = "[[collider]]\nname = \"ball\"\nshape = { type = \"sphere\", radius = 0.1, tolerance = 1e-3 }\n\
                position = [0.003, -0.094, 0.002]\n";
    let all = (0..169).map(|i| i.to_string()).collect::<Vec<_>>().join(", ");
    let text = flat(ball).replace(MATERIAL, &format!("{MATERIAL}\npins = [{{ vertices = [{all}] }}]"));
    let error = Simulation::new(&scene(&text), Assets::default(), SimulationOptions::default()).err();
    assert!(matches!(error, Some(SimError::StartIntersections { .. })), "nothing can give way");
}

#[test]
fn a_clean_start_stays_as_it_is() {
    let text = flat(&sheet("above", "position = [0.003, 0.05, 0.002]"));
    let sim = build(&scene(&text), 1);
    let given = build(&scene(&text.replace("start = \"untangle\"", "")), 1);
    assert_eq!(bits(&sim), bits(&given));
    assert!(sim.report().untangled.is_none());
    assert!(given.plan().effects.iter().any(|e| e.name == "untangled start" && !e.on && e.bytes == 0));
}
