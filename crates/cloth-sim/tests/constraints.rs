//! Contact as constraints of the implicit solve.

mod common;

use cloth_sim::Simulation;
use cloth_sim::core::mesh::Vec3;
use common::{advance, simulation};

/// A card on a slope of angle `alpha` [rad], `gap` above its surface.
fn card(alpha: f64, friction: &str, dt: f64, rest: &str) -> String {
    let (h, size) = (0.002, 0.1);
    let (s, c) = alpha.sin_cos();
    format!(
        r#"
duration = 2.0
[time]
dt = {dt}
[contact]
method = "constraints"
thickness = {h}
friction = {friction}
{rest}
[[cloth]]
name = "card"
mesh = {{ generator = "grid", width = {size}, height = {size}, nx = 9, ny = 9 }}
material = {{ areal_density = 0.3, in_plane = {{ model = "baraff-witkin", warp = 2000.0, weft = 2000.0, shear = 1000.0, damping = 0.001 }}, bending = {{ model = "hinge", rigidity = 1e-3, damping = 0.001 }} }}
position = [{}, {}, 0.0]
rotation = {{ axis = [0, 0, 1], angle = {alpha} }}
[[collider]]
name = "plane"
shape = {{ type = "plane", half_size = 20.0 }}
rotation = {{ axis = [0, 0, 1], angle = {alpha} }}
"#,
        -s * h,
        c * h
    )
}

fn mean(sim: &Simulation) -> Vec3 {
    sim.positions().iter().sum::<Vec3>() / sim.positions().len() as f64
}

#[test]
fn a_card_below_the_angle_of_friction_stays() {
    for alpha in [0.0, 0.2, 0.28] {
        let mut sim = simulation(&card(alpha, "0.3", 0.004, ""));
        let start = sim.positions().to_vec();
        advance(&mut sim, 1.0).unwrap();
        let moved = sim.positions().iter().zip(&start).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
        let force: Vec3 = sim.contact_forces().iter().sum();
        let weight = sim.masses().iter().sum::<f64>() * 9.81;
        println!("{alpha}: moved {moved:e} force {force:?} weight {weight}");
    }
    for (name, law) in [
        ("C", "0.1"),
        ("CS", "{ law = \"coulomb-stiction\", mu_c = 0.1, mu_s = 0.2 }"),
        ("CSS", "{ law = \"stribeck\", mu_c = 0.1, mu_s = 0.2, v_s = 0.4, delta_s = 0.2 }"),
        (
            "CSSV",
            "{ law = \"viscous\", mu_c = 0.1, mu_s = 0.2, v_s = 0.4, delta_s = 0.2, f_v = 0.18, delta_v = 1 }",
        ),
    ] {
        for dt in [0.001, 0.004] {
            let alpha = 0.3f64.atan();
            let mut sim = simulation(&card(alpha, law, dt, ""));
            let start = mean(&sim);
            advance(&mut sim, 2.0).unwrap();
            let way = (mean(&sim) - start).norm();
            let t = &sim.report().totals;
            println!("{name} {dt}: {way} lin {} wall {}", t.linear_iterations, t.wall_seconds);
        }
    }
}
