//! A linearised step that would make energy is found and solved to its end.

#![allow(clippy::unwrap_used, reason = "a failure fails the test")]

mod support;

use cloth_core::{Bending, Environment, InPlane, Integrator, Material, Method, Pins, mesh::Vec3};
use support::{integrator, params, sheet, system};

/// Energy [J] after each step of a stiff sheet that swings down from two corners, and Newton iterations in all.
fn swing(stiffness: f64, dt: f64, method: Method, mends: bool) -> (Vec<f64>, usize) {
    let mesh = sheet(0.3, 7);
    let material = Material {
        areal_density: 0.15,
        in_plane: InPlane::Spring { stiffness, damping: 0.0 },
        bending: Bending::None,
    };
    let gravity = Environment { gravity: Vec3::new(0.0, -9.81, 0.0), ..Environment::default() };
    let mut integrator: Integrator = integrator(system(&mesh, &material, &gravity), params(method));
    integrator.mend_overshoots(mends);
    let (mut x, mut v) = (mesh.vertices.clone(), vec![Vec3::zeros(); mesh.vertices.len()]);
    let held = [0, 6];
    let targets = held.map(|i| x[i as usize]);
    let pins = Pins { vertices: &held, x_t1: &targets, v_t1: &[Vec3::zeros(); 2] };
    let mut iterations = 0;
    let energies = (0..(0.5 / dt) as usize)
        .map(|_| {
            let info = integrator.step(&mut x, &mut v, 0.0, dt, &pins).unwrap();
            integrator.accept();
            iterations += info.newton_iterations;
            integrator.system().energy(&x, &v).total()
        })
        .collect();
    (energies, iterations)
}

/// Largest growth of the energy above the least one before, relative to what the fall sets free.
fn growth(energies: &[f64]) -> f64 {
    let (mut least, mut most) = (energies[0], 0.0_f64);
    for e in energies {
        most = most.max(e - least);
        least = least.min(*e);
    }
    let free = 0.15 * 0.09 * 9.81 * 0.15;
    most / free
}

#[test]
fn a_stiff_sheet_that_swings_makes_no_energy_at_large_steps() {
    for method in [Method::ImplicitEuler, Method::SemiImplicit] {
        for (stiffness, dt) in
            [(1e3, 1.0 / 24.0), (1e5, 1.0 / 24.0), (1e5, 1.0 / 60.0), (1e7, 1.0 / 60.0), (1e6, 0.005)]
        {
            let (mended, iterations) = swing(stiffness, dt, method, true);
            let (plain, _) = swing(stiffness, dt, method, false);
            println!(
                "{method:?} k = {stiffness:e}, dt = {dt:.4}: growth {:.2e}, {:.2e} without; {:.1} iterations a step",
                growth(&mended),
                growth(&plain),
                iterations as f64 / mended.len() as f64
            );
            // A tenth is below what shows in a picture; linearised steps alone make up to ten million times more.
            assert!(growth(&mended) < 0.1, "k = {stiffness:e}, dt = {dt}: {}", growth(&mended));
            assert!(
                dt < 0.01 || growth(&plain) > 1.0,
                "the measure sees what is not mended: {}",
                growth(&plain)
            );
        }
    }
}

#[test]
fn steps_that_make_none_stay_linear() {
    let (energies, iterations) = swing(100.0, 0.002, Method::ImplicitEuler, true);
    assert_eq!(iterations, energies.len());
    assert_eq!(energies, swing(100.0, 0.002, Method::ImplicitEuler, false).0, "to the bit");
}
