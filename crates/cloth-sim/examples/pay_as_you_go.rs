//! Steps a hanging sheet and prints the bytes in use, for `benches/pay_as_you_go.py`, which counts the instructions.
//!
//! `pay_as_you_go minimal STEPS N` steps the integrator of `cloth-core` alone, by hand: springs, gravity, two held corners, and nothing
//! that knows of any effect; `linear` does so without the integrator's test for turns. `pay_as_you_go SCENE.toml STEPS` steps the
//! whole engine. All print the bytes that live after the build and after the steps, and the height of the lowest vertex.
//! `pay_as_you_go plan SCENE.toml` prints the effects that are off, and refuses one of them with elements or bytes.
#![allow(clippy::print_stdout, reason = "a command line example")]

use cloth_sim::core::mesh::{RestShape, Topology, Vec3, generators};
use cloth_sim::core::{
    Bending, ClothPart, ClothSystem, Environment, InPlane, Integrator, IntegratorParams, Material, Pins,
};
use cloth_sim::{Assets, Scene, Simulation, SimulationOptions};
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The system's allocator with a count of the bytes in use.
struct Counting;

static IN_USE: AtomicUsize = AtomicUsize::new(0);

// SAFETY: the system's allocator does the work; the count changes no pointer and no layout.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        IN_USE.fetch_add(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller's promise about `layout` is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        IN_USE.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller's promise about `pointer` and `layout` is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Step of the scene [s].
const DT: f64 = 0.005;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [what, steps, rest @ ..] = &args[..] else {
        return Err("expected: minimal STEPS N, SCENE.toml STEPS, or plan SCENE.toml".into());
    };
    if what == "plan" {
        return plan(steps);
    }
    let steps: usize = steps.parse()?;
    if what == "minimal" || what == "linear" {
        return minimal(
            what == "minimal",
            steps,
            rest.first().ok_or("expected the vertices of a side")?.parse()?,
        );
    }
    let scene = Scene::parse_toml(&std::fs::read_to_string(what)?, what)?;
    let options = SimulationOptions { threads: Some(1), ..SimulationOptions::default() };
    let mut sim = Simulation::new(&scene, Assets::default(), options)?;
    let built = IN_USE.load(Ordering::Relaxed);
    for _ in 0..steps {
        sim.step()?;
    }
    report(built, sim.positions());
    Ok(())
}

fn plan(path: &str) -> Result<(), Box<dyn std::error::Error>> {
    let scene = Scene::parse_toml(&std::fs::read_to_string(path)?, path)?;
    let options = SimulationOptions { threads: Some(1), ..SimulationOptions::default() };
    let sim = Simulation::new(&scene, Assets::default(), options)?;
    for effect in sim.plan().effects.iter().filter(|e| !e.on) {
        if effect.elements + effect.bytes > 0 {
            return Err(format!("{} is off and holds {} bytes", effect.name, effect.bytes).into());
        }
        println!("{}", effect.name);
    }
    Ok(())
}

fn minimal(mends: bool, steps: usize, n: usize) -> Result<(), Box<dyn std::error::Error>> {
    let mesh = generators::grid(1.0, 1.0, n, n)?;
    let topology = Topology::new(mesh.vertices.len(), &mesh.triangles);
    let rest = RestShape::from_positions(&mesh, Vec3::x())?;
    let material = Material {
        areal_density: 0.2,
        in_plane: InPlane::Spring { stiffness: 50.0, damping: 0.0 },
        bending: Bending::None,
    };
    let part = ClothPart {
        mesh: &mesh,
        topology: &topology,
        rest: &rest,
        material: &material,
        triangles: None,
        first_vertex: 0,
    };
    let environment = Environment { gravity: Vec3::new(0.0, -9.81, 0.0), ..Environment::default() };
    let system = ClothSystem::new(&[part], &environment, mesh.vertices.len())?;
    let pool = Arc::new(rayon::ThreadPoolBuilder::new().num_threads(1).build()?);
    let mut integrator = Integrator::new(system, IntegratorParams::default(), pool)?;
    integrator.mend_overshoots(mends);
    let (mut x, mut v) = (mesh.vertices.clone(), vec![Vec3::zeros(); mesh.vertices.len()]);
    let held = [0, n as u32 - 1];
    let targets = held.map(|i| x[i as usize]);
    let built = IN_USE.load(Ordering::Relaxed);
    for step in 0..steps {
        let pins = Pins { vertices: &held, x_t1: &targets, v_t1: &[Vec3::zeros(); 2] };
        integrator.step(&mut x, &mut v, DT * step as f64, DT, &pins)?;
        integrator.accept();
    }
    report(built, &x);
    Ok(())
}

fn report(built: usize, x: &[Vec3]) {
    let lowest = x.iter().map(|p| p.y).fold(f64::INFINITY, f64::min);
    println!("{built} {} {lowest:.17e}", IN_USE.load(Ordering::Relaxed));
}
