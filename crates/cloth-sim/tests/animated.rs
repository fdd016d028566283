//! Cloth on colliders that move: vertex by vertex, and with cloth pinned to them.

mod common;

use cloth_sim::core::mesh::{Vec3, generators};
use cloth_sim::{Assets, Sequence, Simulation, SimulationOptions};
use common::{MATERIAL, advance, scene, simulation};

/// Frames per second of the animated mesh.
const FPS: f64 = 20.0;

/// An animated sheet of 13 × 13 vertices: a bump grows out of the plane and wanders.
fn walker() -> Sequence {
    let sheet = generators::grid(0.8, 0.8, 13, 13).expect("a grid");
    let frame = |k: usize| -> Vec<Vec3> {
        let t = k as f64 / FPS;
        let height = |p: &Vec3| {
            let bump = (-30.0 * ((p.x - 0.3 * t).powi(2) + p.z * p.z)).exp();
            0.3 * (10.0 * t).sin() * bump * (1.0 + 0.3 * (25.0 * p.z + 20.0 * t).sin())
        };
        sheet.vertices.iter().map(|p| p + Vec3::y() * height(p)).collect()
    };
    Sequence { triangles: sheet.triangles.clone(), frames: (0..=6).map(frame).collect(), fps: None }
}

/// Cloth on the animated sheet.
fn on_walker(contact: &str, pins: &str) -> Simulation {
    let text = format!(
        r#"
duration = 0.3
[time]
dt = 0.005
[contact]
thickness = 0.004
{contact}
[[cloth]]
name = "cloth"
mesh = {{ generator = "grid", width = 0.4, height = 0.4, nx = 11, ny = 11 }}
{MATERIAL}
position = [0.013, 0.006, 0.007]
rotation = {{ axis = [0, 1, 0], angle = 0.3 }}
{pins}
[[collider]]
name = "walker"
sequence = {{ asset = "walk", fps = {FPS} }}
"#
    );
    let mut assets = Assets::default();
    assets.sequences.insert("walk".into(), walker());
    Simulation::new(&scene(&text), assets, SimulationOptions::default()).unwrap_or_else(|e| panic!("{e}"))
}

/// Height over the animated sheet of a point above it [m], by the triangle of the sheet's grid that it is over.
fn height_over(sheet: &[Vec3], triangles: &[[u32; 3]], p: &Vec3) -> f64 {
    let area = |a: &Vec3, b: &Vec3, c: &Vec3| (b.x - a.x) * (c.z - a.z) - (b.z - a.z) * (c.x - a.x);
    for t in triangles {
        let [a, b, c] = t.map(|v| sheet[v as usize]);
        let whole = area(&a, &b, &c);
        let w = [area(p, &b, &c) / whole, area(&a, p, &c) / whole, area(&a, &b, p) / whole];
        if w.iter().all(|w| *w >= -1e-12) {
            return p.y - (a.y * w[0] + b.y * w[1] + c.y * w[2]);
        }
    }
    f64::INFINITY
}

/// Runs to the end; no step ends with an intersection, and no vertex but `pinned` under the sheet. Sums of zones and
/// held vertices.
fn run(mut sim: Simulation, pinned: &[usize]) -> (usize, usize, Simulation) {
    let triangles = walker().triangles;
    while sim.time() < 0.2999 {
        sim.step().unwrap_or_else(|e| panic!("{e}"));
        assert!(sim.intersections().expect("detection").is_empty(), "at {} s", sim.time());
        for (i, p) in sim.positions().iter().enumerate().filter(|(i, _)| !pinned.contains(i)) {
            let height = height_over(sim.collider_positions(), &triangles, p);
            assert!(height > 0.0, "vertex {i} at {height} m, {} s", sim.time());
        }
    }
    let highest = sim.positions().iter().map(|p| p.y).fold(0.0, f64::max);
    assert!(highest > 0.1, "the bump lifts the cloth: {highest} m");
    let steps = sim.report().steps.iter().filter_map(|s| s.contact.as_ref());
    let sums = steps.fold((0, 0), |(z, h), c| (z + c.zones, h + c.held_vertices));
    (sums.0, sums.1, sim)
}

#[test]
fn an_animated_mesh_lifts_cloth() {
    run(on_walker("", ""), &[]);
}

#[test]
fn impact_zones_ride_on_an_animated_mesh() {
    let (zones, ..) = run(on_walker("max_passes = 1", ""), &[]);
    assert!(zones > 0, "{zones} zones");
}

#[test]
fn held_cloth_rides_on_an_animated_mesh() {
    let (zones, held, _) = run(on_walker("max_passes = 1\nmax_zone_passes = 0", ""), &[]);
    assert!(zones == 0 && held > 5, "{held} vertices held");
}

#[test]
fn cloth_pinned_to_an_animated_mesh_rests_on_it_too() {
    let pinned = [60, 61, 71];
    let sim = on_walker("", "pins = [{ vertices = [60, 61, 71], collider = \"walker\" }]");
    let triangles = walker().triangles;
    let over =
        |sim: &Simulation, v: usize| height_over(sim.collider_positions(), &triangles, &sim.positions()[v]);
    let start = pinned.map(|v| over(&sim, v));
    let (_, _, sim) = run(sim, &pinned);
    for (v, start) in pinned.into_iter().zip(start) {
        // The offset turns with its triangle: at a slope the height over it is the offset over the slope's cosine.
        let end = over(&sim, v);
        assert!(end >= start * 0.999 && end < 2.0 * start, "pin {v}: {start} then {end}");
    }
    let impulses = sim.report().steps.iter().filter_map(|s| s.contact.as_ref()).map(|c| c.impulses);
    let most = impulses.max().expect("contact");
    assert!(most > 20, "the free part lies on it: {most} impulses");
}

#[test]
fn cloth_clamped_to_a_block_rests_on_it_too() {
    let text = format!(
        r#"
duration = 1.0
[time]
dt = 0.005
[contact]
thickness = 0.004
[[cloth]]
name = "cloth"
mesh = {{ generator = "grid", width = 0.5, height = 0.5, nx = 21, ny = 21 }}
{MATERIAL}
position = [0.0, 0.1055, 0.0]
pins = [{{ box = {{ min = [-0.03, 0, -0.03], max = [0.03, 1, 0.03] }}, collider = "block" }}]
[[collider]]
name = "block"
shape = {{ type = "box", half_extents = [0.15, 0.1, 0.15] }}
keyframes = [{{ time = 0.0 }}, {{ time = 0.4, position = [0.0, 0.2, 0.1], rotation = {{ axis = [0, 1, 0], angle = 0.8 }} }}]
"#
    );
    let mut sim = simulation(&text);
    let start = sim.positions().to_vec();
    advance(&mut sim, 0.4).unwrap_or_else(|e| panic!("{e}"));
    assert!(sim.intersections().unwrap().is_empty());
    let turn = nalgebra::Rotation3::from_scaled_axis(Vec3::y() * -0.8);
    let (mut carried, mut resting) = (0, 0);
    for (p, start) in sim.positions().iter().zip(&start) {
        let p = turn * (p - Vec3::new(0.0, 0.2, 0.1));
        if start.x.abs() < 0.03 && start.z.abs() < 0.03 {
            carried += 1;
            assert!((p - start).norm() < 1e-12, "a pin is carried: {p} from {start}");
        } else {
            let inside = p.x.abs() < 0.15 && p.y.abs() < 0.1 && p.z.abs() < 0.15;
            assert!(!inside, "{p} is in the block");
            resting += usize::from(p.x.abs() < 0.15 && p.z.abs() < 0.15 && p.y < 0.1 + 0.006);
        }
    }
    assert!(carried == 9 && resting > 50, "{carried} pinned, {resting} free vertices lie on the block");
    let contact = sim.report().steps.last().and_then(|s| s.contact.clone()).expect("contact");
    assert!(contact.impulses > 50, "{contact:?}");
}
