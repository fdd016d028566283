//! `time.dt = "auto"`: the error is what was asked for, whatever the step has to be for that.

#![allow(clippy::result_large_err, reason = "an error ends the test: its size costs nothing")]

mod common;

use cloth_sim::core::mesh::Vec3;
use cloth_sim::{Scene, Simulation};
use common::{advance, bits, build, drape, hanging, scene, simulation};
use std::ops::ControlFlow;

/// A scene under error control.
fn auto(text: &str, tolerance: f64) -> String {
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let at = lines.iter().position(|l| l.starts_with("dt = ")).expect("a step");
    lines[at] = format!("dt = \"auto\"\ndt_tolerance = {tolerance}");
    lines.join("\n")
}

/// Largest distance between the vertices of two states [m].
fn distance(a: &[Vec3], b: &[Vec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
}

/// A cloth that swings down from two corners, after this time, against steps of RK4 far below all others.
const SECONDS: f64 = 0.3;

fn reference() -> Vec<Vec3> {
    let mut sim = simulation(&hanging(6, "rk4", 1e-4));
    advance(&mut sim, SECONDS).unwrap_or_else(|e| panic!("{e}"));
    sim.positions().to_vec()
}

#[test]
fn the_error_of_a_smooth_scene_follows_the_tolerance() {
    let exact = reference();
    for integrator in ["implicit-euler", "implicit-newton", "semi-implicit", "midpoint"] {
        let errors = [4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4].map(|tolerance| {
            let mut sim = simulation(&auto(&hanging(6, integrator, 1e-3), tolerance));
            advance(&mut sim, SECONDS).unwrap();
            let t = &sim.report().totals;
            let error = distance(sim.positions(), &exact);
            println!(
                "{integrator}: tolerance {tolerance:e} m, error {error:.2e} m, {} steps of {:.2e} to {:.2e} s, {} rejected",
                t.steps, t.smallest_dt.unwrap(), t.largest_dt, t.rejected
            );
            // What steps add must not be far from the whole.
            assert!(error < 2.0 * tolerance, "{integrator}: {error:e} m with a tolerance of {tolerance:e} m");
            assert!(t.above_tolerance == 0 && t.rejected <= t.steps);
            error
        });
        assert!(errors[4] < 0.25 * errors[0], "{integrator}: {errors:?}");
        assert!(errors.windows(2).filter(|e| e[1] < e[0]).count() >= 3, "{integrator}: {errors:?}");
    }
}

#[test]
fn the_fixed_step_of_the_same_cost_has_a_larger_error() {
    let exact = reference();
    let mut sim = simulation(&auto(&hanging(6, "implicit-euler", 1e-3), 1e-3));
    advance(&mut sim, SECONDS).unwrap();
    // Three solves a step.
    let solves = 3 * sim.report().totals.steps;
    let mut fixed = simulation(&hanging(6, "implicit-euler", SECONDS / solves as f64));
    advance(&mut fixed, SECONDS).unwrap();
    let errors = [distance(sim.positions(), &exact), distance(fixed.positions(), &exact)];
    println!("errors with {solves} solves: auto, fixed: {errors:?}");
    assert!(errors[0] < 0.5 * errors[1], "{errors:?}");
}

#[test]
fn steps_land_on_frames() {
    let mut sim = simulation(&auto(&hanging(5, "implicit-euler", 1e-3), 1e-3));
    let mut time = 0.0;
    for _ in 0..12 {
        time += 1.0 / 60.0;
        advance(&mut sim, 1.0 / 60.0).unwrap();
        assert_eq!(sim.time(), time);
    }
    let steps = &sim.report().steps;
    assert_eq!(steps.len() as u64, sim.step_count());
    let mut before = 0.0;
    for step in steps {
        // Ends are sums of sizes, but for rounding.
        assert!((step.time - before - step.dt).abs() < 1e-12, "{step:?}");
        assert!(step.substeps == 2 && step.error.is_some_and(|e| e <= 1e-4));
        before = step.time;
    }
    let plan = sim.plan();
    assert!(plan.running().any(|name| name == "error-controlled step"));
    assert_eq!(plan.dt, 0.04);
    let mut one = simulation(&auto(&hanging(5, "implicit-euler", 1e-3), 1e-3));
    one.step().unwrap();
    assert_eq!(one.time(), one.report().steps[0].dt);
}

#[test]
fn contact_ends_without_intersections_and_with_few_refusals() {
    let mut sim = simulation(&auto(&drape(13), 2e-3));
    for _ in 0..20 {
        advance(&mut sim, 0.04).unwrap();
        assert!(sim.intersections().unwrap().is_empty(), "at {} s", sim.time());
    }
    let t = sim.report().totals.clone();
    println!(
        "{} steps of {:?} to {} s, {} rejected, {} above, {} retries",
        t.steps, t.smallest_dt, t.largest_dt, t.rejected, t.above_tolerance, t.retries
    );
    assert!(sim.report().steps.iter().all(|s| s.rejected <= 4));
    assert!(sim.report().steps.iter().any(|s| s.contact.as_ref().is_some_and(|c| c.impulses > 0)));
    assert!(t.rejected < 2 * t.steps, "{} of {}", t.rejected, t.steps);
    assert!(t.smallest_dt.unwrap() > 1e-5);
}

#[test]
fn the_bits_do_not_depend_on_threads_or_interruptions() {
    let text = auto(&drape(9), 2e-3);
    let run = |threads: usize| {
        let mut sim = build(&scene(&text), threads);
        advance(&mut sim, 0.4).unwrap_or_else(|e| panic!("{e}"));
        sim
    };
    let straight = run(1);
    assert_eq!(bits(&straight), bits(&run(2)));
    let mut sim = build(&scene(&text), 1);
    let mut done = sim.advance(0.4, &mut || ControlFlow::Break(())).unwrap();
    let mut stops = 0;
    while done.interrupted {
        stops += 1;
        sim = Simulation::resume(&sim.checkpoint(), None).unwrap();
        let mut asked = 0;
        let mut few = || {
            asked += 1;
            if asked > 5 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        done = sim.finish_advance(&mut few).unwrap();
    }
    assert!(stops > 3, "{stops}");
    assert_eq!(bits(&sim), bits(&straight));
    assert_eq!(sim.report().totals.rejected, straight.report().totals.rejected);
}

#[test]
fn wrong_values_are_named() {
    let text = auto(&hanging(5, "implicit-euler", 1e-3), 1e-3);
    for (from, to, key, expected) in [
        ("dt_tolerance = 0.001", "dt_tolerance = 0.0", "time.dt_tolerance", "> 0 [m]"),
        ("dt_tolerance = 0.001", "dt_tolerance = -1e-3", "time.dt_tolerance", "> 0 [m]"),
        ("dt_tolerance = 0.001", "dt_tolerance = nan", "time.dt_tolerance", "finite number"),
        ("dt_tolerance = 0.001", "dt_tolerance = 1e-300", "time.dt_tolerance", "at least 1e-12 m"),
        ("dt_tolerance = 0.001", "dt_max = 0.0", "time.dt_max", "> 0 [s]"),
        ("dt_tolerance = 0.001", "dt_min = 0.0", "time.dt_min", "> 0 [s]"),
        ("dt_tolerance = 0.001", "dt_min = 0.5", "time.dt_min", "at most time.dt_max = 0.04 s"),
        ("dt = \"auto\"", "dt = \"automatic\"", "time.dt", "\"auto\""),
        ("dt = \"auto\"", "dt = true", "time.dt", "finite number"),
    ] {
        let wrong = text.replace(from, to);
        assert_ne!(wrong, text);
        let error = Scene::parse_toml(&wrong, "test.toml").and_then(|s| s.check()).unwrap_err();
        assert_eq!(error.key, key);
        assert!(error.line.is_some() && error.expected.contains(expected), "{error}");
    }
}
