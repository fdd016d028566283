//! What coupling the hinges of a triangle gives: the rigidity of the material on any mesh, and nothing where it is off.

#![allow(clippy::unwrap_used, reason = "a failure fails the test")]

mod support;

use cloth_core::{
    Bending, ClothPart, ClothSystem, Environment, HingeCoupling, InPlane, Material, Method, Pins,
    SolverMethod,
    material::{HysteresisBending, NonlinearBending, PlasticBending},
    mesh::{
        RestShape, Topology, TriMesh, Vec3,
        generators::{self, Diagonals},
    },
};
use support::{FREE, SOFT, distance, integrator, params, pool, sheet, system, undamped, wavy};

use HingeCoupling::{Coupled, Independent};

fn with_hinges(material: &Material, coupling: HingeCoupling) -> Material {
    Material { bending: material.bending.with_hinges(coupling), ..*material }
}

/// Every law with hinges.
fn laws() -> [Bending; 4] {
    let (b1, b2, c1) = (Some(2e-3), Some(1e-3), Some(-1e-4));
    [
        SOFT.bending,
        Bending::Nonlinear(NonlinearBending { b1, b2, c1, ..NonlinearBending::default() }),
        Bending::Plastic(PlasticBending {
            rigidity: 1e-3,
            elastic_limit: 2.0,
            hardening: 0.0,
            damping: 0.0,
            hinges: Coupled,
        }),
        Bending::Hysteresis(HysteresisBending {
            b1,
            b2,
            c1,
            plasticity: 0.3,
            fatigue: 0.1,
            ..HysteresisBending::default()
        }),
    ]
}

#[test]
fn what_is_off_costs_nothing() {
    let mesh = sheet(1.0, 5);
    for bending in laws() {
        let material = Material { bending, ..SOFT };
        let system_of = |coupling| system(&mesh, &with_hinges(&material, coupling), &Environment::default());
        let (on, off) = (system_of(Coupled), system_of(Independent));
        assert_eq!(on.effects(), off.effects());
        assert_eq!((off.hinge_coupling().elements, off.hinge_coupling().bytes), (0, 0));
        // Four neighbours with a factor each, two bounds, and two numbers to work with.
        let coupling = on.hinge_coupling();
        assert_eq!((coupling.elements, coupling.bytes), (40, 40 * (4 * 4 + 4 * 8 + 2 * 8 + 2 * 8)));
    }
    // One hinge has no neighbour.
    let two = TriMesh {
        vertices: vec![Vec3::zeros(), Vec3::x(), Vec3::z(), Vec3::new(1.0, 0.0, 1.0)],
        triangles: vec![[0, 2, 1], [1, 2, 3]],
        uv: None,
    };
    assert_eq!(system(&two, &SOFT, &Environment::default()).hinge_coupling().elements, 0);
}

#[test]
fn a_cylinder_on_a_union_jack_mesh_has_exactly_its_energy() {
    /// Rounding of angles of 1e-2 rad, relative.
    const ROUNDING: f64 = 1e-10;
    let (n, length, radius, rigidity) = (21, 0.4, 0.5, 3e-4);
    let mesh = sheet(length, n);
    let bent = Material { bending: Bending::Hinge { rigidity, damping: 0.0, hinges: Coupled }, ..SOFT };
    let shape = |height: fn(f64, f64) -> (f64, f64)| -> Vec<Vec3> {
        let place = |p: &Vec3| {
            let (along, up) = height(p.x / 0.5, p.z / 0.5);
            Vec3::new(0.5 * along, 0.5 * up, p.z)
        };
        mesh.vertices.iter().map(place).collect()
    };
    let energy = |coupling, x: &[Vec3]| {
        let still = vec![Vec3::zeros(); x.len()];
        system(&mesh, &with_hinges(&bent, coupling), &Environment::default()).energy(x, &still).bending
    };
    let cylinder = shape(|x, _| (x.sin(), 1.0 - x.cos()));
    // Chords turn by h/R at each inner row, which stands for the width of a cell; the outer half cells are flat.
    let rows = (n - 2) as f64 / (n - 1) as f64;
    let expected = 0.5 * rigidity / (radius * radius) * length * length * rows;
    let got = energy(Coupled, &cylinder);
    assert!((got / expected - 1.0).abs() < ROUNDING, "{got:e} {expected:e}");
    // Where legs and diagonals bend, products count.
    let wave = shape(|x, z| (x, 0.1 * (20.0 * x).sin() * (17.0 * z).cos()));
    assert!((energy(Coupled, &wave) / energy(Independent, &wave) - 1.0).abs() > 0.01);
}

/// Rigidity over the material's that a strip shows which its own weight bends a little, clamped at one end.
fn rigidity(mesh: &TriMesh, cell: f64, coupling: HingeCoupling) -> f64 {
    const LOAD: f64 = 0.05;
    let (density, gravity) = (0.15, 9.81);
    let ends = mesh.vertices.iter().map(|x| x.x);
    let (start, end) = ends.fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(x), b.max(x)));
    // The clamp line lies midway between the two pinned columns.
    let length = end - start - 0.5 * cell;
    let stiffness = 1e4 * density * gravity * length;
    let true_rigidity = density * gravity * length.powi(3) / LOAD;
    let material = Material {
        areal_density: density,
        in_plane: InPlane::BaraffWitkin { warp: stiffness, weft: stiffness, shear: stiffness, damping: 0.0 },
        bending: Bending::Hinge { rigidity: true_rigidity, damping: 0.0, hinges: coupling },
    };
    let env = Environment { air_damping: 1.0, ..Environment::default() };
    let mut params = params(Method::ImplicitNewton);
    params.solver.method = SolverMethod::FaerLlt;
    params.newton_tolerance = 1e-8;
    params.newton_max_iterations = 100;
    let mut integrator = integrator(system(mesh, &material, &env), params);
    let pinned: Vec<u32> = (0..mesh.vertices.len() as u32)
        .filter(|&v| mesh.vertices[v as usize].x < start + 1.1 * cell)
        .collect();
    let targets: Vec<Vec3> = pinned.iter().map(|&v| mesh.vertices[v as usize]).collect();
    let still = vec![Vec3::zeros(); pinned.len()];
    let pins = Pins { vertices: &pinned, x_t1: &targets, v_t1: &still };
    let (mut x, mut v) = (mesh.vertices.clone(), vec![Vec3::zeros(); mesh.vertices.len()]);
    for _ in 0..4 {
        let info = integrator.step(&mut x, &mut v, 0.0, 1.0, &pins).unwrap();
        assert!(info.converged, "{info:?}");
    }
    let tip: Vec<f64> =
        (0..x.len()).filter(|&i| mesh.vertices[i].x > end - 0.1 * cell).map(|i| -x[i].y).collect();
    let droop = tip.iter().sum::<f64>() / tip.len() as f64;
    LOAD * length / 8.0 / droop
}

#[test]
fn strips_bend_with_the_rigidity_of_the_material() {
    /// Two boundary layers one cell wide at 20 cells along, and a slope of LOAD/6 in the beam that is compared with.
    const TOLERANCE: f64 = 0.005;
    /// Vertices off by up to 30 % of a cell: the curvature of a triangle is then no longer that of the sheet.
    const IRREGULAR: f64 = 0.1;
    for (diagonals, alone) in [(Diagonals::Alternating, 0.85), (Diagonals::OneWay, 0.85)] {
        let mesh = generators::grid_with(0.21, 0.04, 22, 5, diagonals).unwrap();
        let got = rigidity(&mesh, 0.01, Coupled);
        let independent = rigidity(&mesh, 0.01, Independent);
        println!("{diagonals:?}: {got:.4}, independent hinges {independent:.4}");
        assert!((got - 1.0).abs() < TOLERANCE, "{diagonals:?}: {got}");
        assert!(independent < alone, "{diagonals:?}: {independent}");
    }
    // Cut at random: no two triangles alike.
    let mut mesh = generators::grid(0.21, 0.04, 22, 5).unwrap();
    mesh.uv = None;
    for (i, x) in mesh.vertices.iter_mut().enumerate() {
        let hash = |k: u64| {
            ((i as u64 * 3 + k + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40) as f64 / 2f64.powi(24)
        };
        if x.x.abs() < 0.09 && x.z.abs() < 0.019 {
            *x += Vec3::new(hash(0) - 0.5, 0.0, hash(1) - 0.5) * 0.006;
        }
    }
    let got = rigidity(&mesh, 0.01, Coupled);
    println!("irregular: {got:.4}");
    assert!((got - 1.0).abs() < IRREGULAR, "{got}");
}

#[test]
fn long_implicit_steps_settle_for_every_law() {
    /// Energy that only a step that overshoots adds, relative to what was there.
    const GROWTH: f64 = 1e-9;
    let mesh = sheet(0.5, 9);
    let still = Environment { gravity: Vec3::zeros(), ..Environment::default() };
    for bending in laws() {
        let material = undamped(&Material { bending, ..SOFT });
        for dt in [1e-3, 0.1, 10.0] {
            let mut integrator = integrator(system(&mesh, &material, &still), params(Method::ImplicitEuler));
            let (mut x, mut v) = (mesh.vertices.clone(), vec![Vec3::zeros(); mesh.vertices.len()]);
            for (i, x) in x.iter_mut().enumerate() {
                x.y = if i % 3 == 0 { 1e-3 } else { -1e-3 };
            }
            let start = integrator.system().energy(&x, &v).total();
            for _ in 0..50 {
                integrator.step(&mut x, &mut v, 0.0, dt, &FREE).unwrap();
                integrator.accept();
            }
            let end = integrator.system().energy(&x, &v).total();
            assert!(end <= start * (1.0 + GROWTH), "{bending:?} {dt}: {start:e} {end:e}");
        }
    }
}

#[test]
fn semi_implicit_and_retries_see_the_coupling() {
    // Both kinds of step converge to the same motion, which is not that of independent hinges.
    let mesh = sheet(0.4, 7);
    let (x0, v0) = wavy(&mesh, 0.02, 0.2);
    let end = |method, coupling, steps: u32| {
        let material = with_hinges(&SOFT, coupling);
        let mut integrator = integrator(system(&mesh, &material, &Environment::default()), params(method));
        let (mut x, mut v) = (x0.clone(), v0.clone());
        for _ in 0..steps {
            integrator.step(&mut x, &mut v, 0.0, 0.1 / f64::from(steps), &FREE).unwrap();
        }
        x
    };
    let exact = end(Method::Rk4, Coupled, 400);
    let other = distance(&exact, &end(Method::Rk4, Independent, 400));
    for method in [Method::SemiImplicit, Method::ImplicitEuler, Method::ImplicitNewton] {
        let error = distance(&exact, &end(method, Coupled, 1600));
        assert!(error < 0.2 * other, "{method:?}: {error:e} {other:e}");
    }
    assert_eq!(end(Method::ImplicitEuler, Coupled, 50), end(Method::ImplicitEuler, Coupled, 50));
}

#[test]
fn two_parts_do_not_couple_with_each_other() {
    let mesh = sheet(0.5, 5);
    let topology = Topology::new(mesh.vertices.len(), &mesh.triangles);
    let rest = RestShape::new(&mesh, Vec3::x()).unwrap();
    let part = |first_vertex| ClothPart {
        mesh: &mesh,
        topology: &topology,
        rest: &rest,
        material: &SOFT,
        first_vertex,
        triangles: None,
    };
    let n = mesh.vertices.len();
    let env = Environment { gravity: Vec3::zeros(), ..Environment::default() };
    let both = ClothSystem::new(&[part(0), part(n)], &env, 2 * n).unwrap();
    let one = system(&mesh, &SOFT, &env);
    let (bent, _) = wavy(&mesh, 0.05, 0.0);
    let x = [bent.clone(), mesh.vertices.clone()].concat();
    let forces = |system: &ClothSystem, x: &[Vec3]| {
        let mut out = vec![Vec3::zeros(); x.len()];
        system.forces(x, &vec![Vec3::zeros(); x.len()], &mut out, &pool(2));
        out
    };
    let got = forces(&both, &x);
    assert_eq!(got[..n], forces(&one, &bent)[..]);
    assert!(got[n..].iter().all(|f| f.norm() < 1e-15));
}
