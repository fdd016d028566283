//! What the response costs on a tablecloth that drapes over a turning sphere.
//!
//! `cargo run --release -p cloth-response --example drape_cost -- [vertices per side] [seconds] [dt] [threads]`
//!
//! 101 × 101 vertices on 2 m, a sphere of radius 0.5 m with 5120 triangles, thickness 4 mm, friction; the cloth's own mechanics
//! are crude (distance constraints), the contact is the real one. Prints one line per 0.1 s.

#![allow(clippy::print_stdout, reason = "the output of an example")]

use cloth_response::collision::mesh::generators::{grid, sphere};
use cloth_response::collision::{Body, Bvh, CollisionMesh, intersections};
use cloth_response::{Responder, ResponseParams, Vec3};
use std::time::Instant;

const CONSTRAINT_SWEEPS: usize = 15;
/// Share of the deviation that a bending constraint takes back in one sweep.
const BENDING: f64 = 0.02;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let argument = |i: usize, default: f64| -> f64 {
        std::env::args().nth(i).and_then(|a| a.parse().ok()).unwrap_or(default)
    };
    let (n, seconds, dt, threads) =
        (argument(1, 101.0) as usize, argument(2, 2.0), argument(3, 0.005), argument(4, 1.0) as usize);
    let check = argument(5, 0.0) != 0.0;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build()?;
    let mut cloth = grid(2.0, 2.0, n, n)?;
    cloth.translate(Vec3::new(0.0, 0.55, 0.0));
    let ball = sphere(0.5, 4)?;
    let dynamic = Body { dynamic: true, self_collision: true };
    let fixed = Body { dynamic: false, self_collision: false };
    let mesh = CollisionMesh::new(&[
        (dynamic, cloth.vertices.len(), &cloth.triangles[..]),
        (fixed, ball.vertices.len(), &ball.triangles[..]),
    ])?;
    println!(
        "cloth {} triangles, ball {}, dt {dt}, {threads} threads",
        cloth.triangles.len(),
        ball.triangles.len()
    );

    let free = cloth.vertices.len();
    let mut x: Vec<Vec3> = cloth.vertices.iter().chain(&ball.vertices).copied().collect();
    let mass = 0.2 * 4.0 / free as f64;
    let inv_mass: Vec<f64> = (0..x.len()).map(|i| if i < free { 1.0 / mass } else { 0.0 }).collect();
    let mut v = vec![Vec3::zeros(); x.len()];
    let rest: Vec<f64> = mesh.edges.iter().map(|e| (x[e[0] as usize] - x[e[1] as usize]).norm()).collect();
    let mut bvh = Bvh::new(&mesh, &x)?;
    let params = ResponseParams::default();
    let mut responder = Responder::new(&mesh, params)?;
    responder.set_rest(&mesh, &x)?;

    let steps = (seconds / dt).round() as usize;
    let print_every = ((0.1 / dt).round() as usize).max(1);
    let (mut cpu, mut total, mut worst) = (0.0, 0.0, 0.0_f64);
    let mut sums: Vec<(&str, f64)> = Vec::new();
    let mut counts = [0usize; 6];
    for step in 0..steps {
        let mut x_t1 = x.clone();
        for i in 0..x.len() {
            if i < free {
                v[i] += Vec3::new(0.0, -9.81, 0.0) * dt;
                x_t1[i] += v[i] * dt;
            } else {
                let spin = if step as f64 * dt > 1.0 { 2.0 } else { 0.0 };
                x_t1[i] = nalgebra::Rotation3::from_scaled_axis(Vec3::y() * (spin * dt)) * x[i];
            }
        }
        for _ in 0..CONSTRAINT_SWEEPS {
            // Bending: every other vertex of a row or column, softly.
            for i in 0..free {
                for (step, room) in [(1, i % n + 2 < n), (n, i / n + 2 < n)] {
                    if room {
                        let j = i + 2 * step;
                        let d = x_t1[j] - x_t1[i];
                        let move_by = d * (BENDING * (1.0 - 4.0 / (n - 1) as f64 / d.norm()));
                        x_t1[i] += move_by;
                        x_t1[j] -= move_by;
                    }
                }
            }
            for (e, edge) in mesh.edges.iter().enumerate() {
                let [a, b] = edge.map(|v| v as usize);
                if a < free {
                    let d = x_t1[b] - x_t1[a];
                    let move_by = d * (0.5 * (1.0 - rest[e] / d.norm()));
                    x_t1[a] += move_by;
                    x_t1[b] -= move_by;
                }
            }
        }
        for i in 0..x.len() {
            v[i] = (x_t1[i] - x[i]) / dt;
        }
        let start = Instant::now();
        let info = responder.respond(&mesh, &mut bvh, &inv_mass, &x, &mut x_t1, &mut v, dt, &pool)?;
        responder.accept();
        let spent = start.elapsed().as_secs_f64();
        x = x_t1;
        cpu += spent;
        total += spent;
        worst = worst.max(spent);
        for &(name, s) in &info.seconds {
            match sums.iter_mut().find(|(n, _)| *n == name) {
                Some(sum) => sum.1 += s,
                None => sums.push((name, s)),
            }
        }
        for (k, c) in
            [info.passes, info.collisions, info.zones, info.zone_vertices, info.held_vertices, info.sweeps]
                .into_iter()
                .enumerate()
        {
            counts[k] += c;
        }
        if (step + 1) % print_every == 0 {
            let per = 1e3 / print_every as f64;
            let stages: Vec<String> = sums.iter().map(|(n, s)| format!("{n} {:.1}", s * per)).collect();
            let intersecting = if check { intersections(&mesh, &x, &pool)?.len() } else { 0 };
            println!(
                "{:.2} s: {:.1} ms/step ({}), near {}, loaded {}, mean passes {:.1}, collisions {:.0}, sweeps {:.0}, residual {:.1e}, zones {} ({}), held {}, intersecting {}",
                (step + 1) as f64 * dt,
                cpu * per,
                stages.join(", "),
                info.proximities,
                info.impulses,
                counts[0] as f64 / print_every as f64,
                counts[1] as f64 / print_every as f64,
                counts[5] as f64 / print_every as f64,
                info.residual,
                counts[2],
                counts[3],
                counts[4],
                intersecting,
            );
            (cpu, counts) = (0.0, [0; 6]);
            sums.clear();
        }
    }
    println!("mean {:.1} ms/step, worst {:.1} ms", 1e3 * total / steps as f64, 1e3 * worst);
    Ok(())
}
