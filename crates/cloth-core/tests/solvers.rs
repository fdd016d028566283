//! The linear solvers agree, and the bits do not depend on the number of threads.

#![allow(clippy::unwrap_used, reason = "a failure fails the test")]

mod support;

use cloth_core::{Environment, Integrator, IntegratorParams, Method, Pins, SolverMethod, mesh::Vec3};
use support::{FREE, SOFT, SPRINGS, distance, integrator, params, pool, sheet, system, wavy};

const ALL: [SolverMethod; 4] =
    [SolverMethod::Pcg, SolverMethod::PcgJacobi, SolverMethod::FaerCg, SolverMethod::FaerLlt];

fn with(method: SolverMethod, tolerance: f64) -> IntegratorParams {
    let mut params = params(Method::ImplicitEuler);
    params.solver.method = method;
    params.solver.tolerance = tolerance;
    params.solver.max_iterations = 2000;
    params
}

#[test]
fn all_solvers_agree_with_fixed_and_moving_pins() {
    /// Distance of velocities [m/s] at a residual of 1e-11: the condition number is about 10³.
    const AGREEMENT: f64 = 1e-7;
    let mesh = sheet(1.0, 24);
    let env = Environment::default();
    for material in [SOFT, SPRINGS] {
        let mut states = Vec::new();
        for method in ALL {
            let (mut x, mut v) = wavy(&mesh, 0.03, 0.4);
            let mut integrator = integrator(system(&mesh, &material, &env), with(method, 1e-11));
            for step in 0..5 {
                let targets = [x[0] + Vec3::new(0.0, 0.002, 0.001), mesh.vertices[23], x[300]];
                let speeds = [Vec3::new(0.0, 0.4, 0.2), Vec3::zeros(), Vec3::zeros()];
                let pins = Pins { vertices: &[0, 23, 300], x_t1: &targets, v_t1: &speeds };
                let info = integrator.step(&mut x, &mut v, 0.0, 0.005, &pins).unwrap();
                assert!(info.converged && info.residual <= 1e-11, "{method:?} {step}: {info:?}");
            }
            states.push(v);
        }
        for (method, v) in ALL.iter().zip(&states).skip(1) {
            let error = distance(v, &states[0]);
            assert!(error < AGREEMENT, "{method:?}: {error:e}");
        }
        let mut faulty = states[0].clone();
        faulty[100].x += 10.0 * AGREEMENT;
        assert!(distance(&faulty, &states[1]) > AGREEMENT);
    }
}

#[test]
fn the_residual_is_that_of_the_system_and_a_cap_is_data() {
    let mesh = sheet(1.0, 20);
    for method in [SolverMethod::Pcg, SolverMethod::PcgJacobi, SolverMethod::FaerCg] {
        let (x0, v0) = wavy(&mesh, 0.03, 0.4);
        let mut params = with(method, 1e-9);
        params.solver.max_iterations = 3;
        let mut capped = integrator(system(&mesh, &SOFT, &Environment::default()), params);
        let (mut x, mut v) = (x0.clone(), v0.clone());
        let info = capped.step(&mut x, &mut v, 0.0, 0.01, &FREE).unwrap();
        assert!(!info.converged && info.linear_iterations == 3, "{method:?}: {info:?}");
        assert!(info.residual > 1e-9 && info.residual < 1.0, "{method:?}: {info:?}");
        // The better solution is near the capped one in proportion to the residual.
        let mut full = integrator(system(&mesh, &SOFT, &Environment::default()), with(method, 1e-9));
        let (mut y, mut w) = (x0, v0);
        let better = full.step(&mut y, &mut w, 0.0, 0.01, &FREE).unwrap();
        assert!(better.converged && better.residual <= 1e-9 && better.linear_iterations > 3);
        assert!(distance(&v, &w) > 1e-9);
    }
}

#[test]
fn a_system_at_rest_needs_no_iteration() {
    let mesh = sheet(1.0, 6);
    let still = Environment { gravity: Vec3::zeros(), ..Environment::default() };
    for method in ALL {
        let (mut x, mut v) = (mesh.vertices.clone(), vec![Vec3::zeros(); mesh.vertices.len()]);
        let mut integrator = integrator(system(&mesh, &SPRINGS, &still), with(method, 1e-6));
        let info = integrator.step(&mut x, &mut v, 0.0, 0.01, &FREE).unwrap();
        assert!(info.converged && info.residual < 1e-6, "{method:?}: {info:?}");
        assert!(distance(&x, &mesh.vertices) < 1e-12, "{method:?}");
    }
}

#[test]
fn all_vertices_pinned_leaves_nothing_to_solve() {
    let mesh = sheet(1.0, 3);
    let vertices: Vec<u32> = (0..9).collect();
    let targets: Vec<Vec3> = mesh.vertices.iter().map(|x| x + Vec3::new(0.0, 0.1, 0.0)).collect();
    let speeds = vec![Vec3::new(0.0, 1.0, 0.0); 9];
    for method in ALL {
        let (mut x, mut v) = (mesh.vertices.clone(), vec![Vec3::zeros(); 9]);
        let mut integrator = integrator(system(&mesh, &SOFT, &Environment::default()), with(method, 1e-6));
        let pins = Pins { vertices: &vertices, x_t1: &targets, v_t1: &speeds };
        assert!(integrator.step(&mut x, &mut v, 0.0, 0.1, &pins).unwrap().converged, "{method:?}");
        assert_eq!((x, v), (targets.clone(), speeds.clone()));
    }
}

#[test]
fn sweeps_in_several_domains_solve_the_whole_system() {
    /// Distance of velocities [m/s] at a residual of 1e-11.
    const AGREEMENT: f64 = 1e-7;
    // 3600 rows are three domains with blocks across.
    let mesh = sheet(1.0, 60);
    let target = [mesh.vertices[0] + Vec3::new(0.0, 0.003, 0.0)];
    let pins = Pins { vertices: &[0], x_t1: &target, v_t1: &[Vec3::zeros()] };
    let run = |method| {
        let (mut x, mut v) = wavy(&mesh, 0.02, 0.4);
        let mut integrator = integrator(system(&mesh, &SOFT, &Environment::default()), with(method, 1e-11));
        let info = integrator.step(&mut x, &mut v, 0.0, 0.01, &pins).unwrap();
        assert!(info.converged, "{method:?}: {info:?}");
        (v, info.linear_iterations)
    };
    let (swept, iterations) = run(SolverMethod::Pcg);
    let (direct, _) = run(SolverMethod::FaerLlt);
    assert!(distance(&swept, &direct) < AGREEMENT, "{:e}", distance(&swept, &direct));
    let (_, jacobi) = run(SolverMethod::PcgJacobi);
    assert!(2 * iterations < jacobi, "{iterations} against {jacobi} with block-Jacobi alone");
}

#[test]
fn bits_do_not_depend_on_threads() {
    let mesh = sheet(1.0, 60);
    let env = Environment { drag: 0.5, lift: 0.2, wind: Vec3::new(1.0, 0.0, 0.5), ..Environment::default() };
    for method in [SolverMethod::Pcg, SolverMethod::PcgJacobi] {
        for scheme in [Method::ImplicitEuler, Method::ImplicitNewton, Method::Rk4] {
            let states: Vec<_> = [1, 2, 3]
                .into_iter()
                .map(|threads| {
                    let (mut x, mut v) = wavy(&mesh, 0.02, 0.4);
                    let mut params = with(method, 1e-5);
                    params.method = scheme;
                    let mut integrator =
                        Integrator::new(system(&mesh, &SOFT, &env), params, pool(threads)).unwrap();
                    for _ in 0..3 {
                        integrator.step(&mut x, &mut v, 0.0, 2e-3, &FREE).unwrap();
                    }
                    let mut f = vec![Vec3::zeros(); x.len()];
                    integrator.system().forces(&x, &v, &mut f, &pool(threads));
                    let bits =
                        |v: &[Vec3]| v.iter().flat_map(|v| v.iter().map(|c| c.to_bits())).collect::<Vec<_>>();
                    (bits(&x), bits(&v), bits(&f))
                })
                .collect();
            assert!(states[0] == states[1] && states[0] == states[2], "{method:?} {scheme:?}");
        }
    }
}

#[test]
fn vertex_order_and_pieces_do_not_matter() {
    // Two separate sheets whose vertices are shuffled: far from banded, and two connected pieces.
    let one = sheet(0.6, 30);
    let n = one.vertices.len();
    let place = |i: usize| (i * 1009) % (2 * n); // 1009 is prime to 2 n
    let mut mesh = cloth_core::mesh::TriMesh { vertices: vec![Vec3::zeros(); 2 * n], ..Default::default() };
    for copy in 0..2 {
        for (i, x) in one.vertices.iter().enumerate() {
            mesh.vertices[place(copy * n + i)] = x + Vec3::new(2.0 * copy as f64, 0.0, 0.0);
        }
        mesh.triangles.extend(one.triangles.iter().map(|t| t.map(|v| place(copy * n + v as usize) as u32)));
    }
    let run = |mesh: &cloth_core::mesh::TriMesh, method| {
        let (mut x, mut v) = (mesh.vertices.clone(), vec![Vec3::zeros(); mesh.vertices.len()]);
        for (x, v) in x.iter().zip(v.iter_mut()) {
            *v = Vec3::new((3.0 * x.z).sin(), (5.0 * x.x).cos(), 0.0);
        }
        let mut integrator = integrator(system(mesh, &SOFT, &Environment::default()), with(method, 1e-10));
        let info = integrator.step(&mut x, &mut v, 0.0, 0.005, &FREE).unwrap();
        assert!(info.converged);
        (v, info.linear_iterations)
    };
    let (shuffled, iterations) = run(&mesh, SolverMethod::Pcg);
    let (direct, _) = run(&mesh, SolverMethod::FaerLlt);
    assert!(distance(&shuffled, &direct) < 1e-7);
    let (_, jacobi) = run(&mesh, SolverMethod::PcgJacobi);
    assert!(3 * iterations < 2 * jacobi, "{iterations} against {jacobi} with block-Jacobi alone");
}
