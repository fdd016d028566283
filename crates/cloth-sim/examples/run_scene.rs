//! Runs a scene file that needs no assets and prints one line per tenth of a simulated second.
//!
//! `cargo run --release -p cloth-sim --example run_scene -- examples/drape.toml [seconds] [threads]`
#![allow(clippy::print_stdout, reason = "a command line example")]

use cloth_sim::core::mesh::Vec3;
use cloth_sim::{Assets, Scene, Simulation, SimulationOptions};
use std::ops::ControlFlow;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut args = std::env::args().skip(1);
    let path = args.next().ok_or("expected the path of a scene file")?;
    let scene = Scene::parse_toml(&std::fs::read_to_string(&path)?, &path)?;
    let seconds = args.next().map_or(Ok(scene.duration), |s| s.parse())?;
    let threads = args.next().map(|s| s.parse()).transpose()?;
    let options = SimulationOptions { threads, ..SimulationOptions::default() };
    let mut sim = Simulation::new(&scene, Assets::default(), options)?;
    println!("{}", sim.plan());

    let frames = (seconds * scene.output.fps).round() as usize;
    let (started, cpu) = (Instant::now(), cpu_seconds());
    let (mut worst, mut iterations) = (0, 0);
    for frame in 1..=frames {
        sim.advance(1.0 / scene.output.fps, &mut || ControlFlow::Continue(()))?;
        let pairs = sim.intersections()?.len();
        worst = worst.max(pairs);
        if frame % (scene.output.fps / 10.0).max(1.0) as usize == 0 {
            let totals = &sim.report().totals;
            let contact = sim.report().steps.last().and_then(|s| s.contact.clone()).unwrap_or_default();
            let fastest = sim.velocities().iter().map(Vec3::norm).fold(0.0, f64::max);
            println!(
                "t {:.2} s  energy {:9.4} J ({}) fastest {fastest:6.3} m/s  pcg {:5}  near {:6}  passes {}  impulses {:5}  \
                 zones {:3}  held {:4}  retries {}  intersections {pairs}  wall {:.1} s",
                sim.time(),
                sim.energy().total(),
                parts(&sim),
                totals.linear_iterations - iterations,
                contact.proximities,
                contact.passes,
                contact.impulses,
                contact.zones,
                contact.held_vertices,
                totals.retries,
                started.elapsed().as_secs_f64(),
            );
            iterations = totals.linear_iterations;
        }
    }
    let totals = &sim.report().totals;
    println!(
        "{} steps, wall {:.2} s in steps, CPU {:.2} s in all, intersections at most {worst}",
        totals.steps,
        totals.wall_seconds,
        cpu_seconds() - cpu
    );
    for (stage, seconds) in &totals.seconds {
        println!("  {seconds:8.3} s  {stage}");
    }
    if let Some(path) = args.next() {
        let bytes: Vec<u8> =
            sim.all_positions().iter().flat_map(|p| [p.x, p.y, p.z]).flat_map(f64::to_le_bytes).collect();
        std::fs::write(path, bytes)?;
    }
    Ok(())
}

fn parts(sim: &Simulation) -> String {
    let e = sim.energy();
    format!(
        "kin {:.3} str {:.3} shr {:.3} bend {:.4} grav {:.3}",
        e.kinetic, e.stretch, e.shear, e.bending, e.gravity
    )
}

/// User and system time of this process [s]; 0 where the system does not tell.
fn cpu_seconds() -> f64 {
    /// Clock ticks per second of /proc on Linux.
    const TICKS: f64 = 100.0;
    let Ok(text) = std::fs::read_to_string("/proc/self/stat") else { return 0.0 };
    let fields: Vec<&str> = text.rsplit(')').next().unwrap_or("").split_whitespace().collect();
    let ticks = |i: usize| fields.get(i).and_then(|f| f.parse::<f64>().ok()).unwrap_or(0.0);
    (ticks(11) + ticks(12)) / TICKS
}
