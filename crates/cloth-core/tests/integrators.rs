//! Orders of convergence, stability limits, pins and conservation of the time integration schemes.

#![allow(clippy::unwrap_used, reason = "a failure fails the test")]

mod support;

use cloth_core::{
    Bending, Environment, HingeCoupling, InPlane, Integrator, IntegratorParams, Material, Method, Pins, Psd,
    SolverMethod, SolverParams, StepError, mesh::Vec3,
};
use support::{FREE, SOFT, SPRINGS, distance, integrator, params, sheet, system, undamped, wavy};

const AIR: Environment = Environment {
    gravity: Vec3::new(0.0, -9.81, 0.0),
    wind: Vec3::new(1.0, 0.3, 2.0),
    air_density: 1.2,
    drag: 0.8,
    lift: 0.4,
    air_damping: 0.3,
};

/// A row of pinned vertices that move along a smooth path.
struct Rail {
    vertices: Vec<u32>,
    start: Vec<Vec3>,
}

impl Rail {
    fn new(x: &[Vec3], n: u32) -> Self {
        let vertices: Vec<u32> = (0..n).collect();
        let start = vertices.iter().map(|&v| x[v as usize]).collect();
        Self { vertices, start }
    }

    /// Positions and velocities at a time.
    fn at(&self, time: f64) -> (Vec<Vec3>, Vec<Vec3>) {
        let (s, c) = (6.0 * time).sin_cos();
        let x = self.start.iter().map(|x| x + Vec3::new(0.02 * s, 0.03 * (1.0 - c), 0.0)).collect();
        let v = self.start.iter().map(|_| Vec3::new(0.12 * c, 0.18 * s, 0.0)).collect();
        (x, v)
    }
}

/// State after `duration` in `steps` equal steps, first row on the rail.
fn run(
    integrator: &mut Integrator,
    x: &[Vec3],
    v: &[Vec3],
    n: u32,
    duration: f64,
    steps: usize,
) -> (Vec<Vec3>, Vec<Vec3>) {
    let rail = Rail::new(x, n);
    let (mut x, mut v) = (x.to_vec(), v.to_vec());
    let start = rail.at(0.0);
    for (k, &vertex) in rail.vertices.iter().enumerate() {
        (x[vertex as usize], v[vertex as usize]) = (start.0[k], start.1[k]);
    }
    let dt = duration / steps as f64;
    for step in 0..steps {
        let (x_t1, v_t1) = rail.at((step + 1) as f64 * dt);
        let pins = Pins { vertices: &rail.vertices, x_t1: &x_t1, v_t1: &v_t1 };
        let info = integrator.step(&mut x, &mut v, step as f64 * dt, dt, &pins).unwrap();
        assert!(info.converged, "step {step}: {info:?}");
    }
    (x, v)
}

/// Steps of the coarsest run per method: small enough for the error to be in its asymptotic range.
fn coarsest(method: Method) -> usize {
    match method {
        Method::ExplicitEuler => 3200,
        Method::Rk4 => 100,
        Method::Midpoint | Method::ImplicitEuler | Method::ImplicitNewton | Method::SemiImplicit => 400,
    }
}

fn measured_order(method: Method, sub_steps: usize, material: &Material, env: &Environment) -> f64 {
    const N: usize = 5;
    const DURATION: f64 = 0.4;
    let mesh = sheet(0.4, N);
    let (x, v) = wavy(&mesh, 0.01, 0.2);
    let mut fine = integrator(system(&mesh, material, env), params(Method::Rk4));
    let reference = run(&mut fine, &x, &v, N as u32, DURATION, 3200).0;
    let mut params = params(method);
    params.solver.tolerance = 1e-11;
    params.newton_tolerance = 1e-10;
    params.bending_substeps = sub_steps;
    params.psd = Psd::Raw;
    let mut integrator = integrator(system(&mesh, material, env), params);
    let steps = coarsest(method);
    let error = |integrator: &mut Integrator, steps| {
        distance(&run(integrator, &x, &v, N as u32, DURATION, steps).0, &reference)
    };
    let (coarse, finer) = (error(&mut integrator, steps), error(&mut integrator, 2 * steps));
    (coarse / finer).log2()
}

#[test]
fn orders_of_convergence_are_1_2_4_and_1() {
    /// Distance of a measured order from its limit at these steps.
    const SLACK: f64 = 0.15;
    for material in [SOFT, SPRINGS] {
        for (method, sub_steps, order) in [
            (Method::ExplicitEuler, 1, 1.0),
            (Method::Midpoint, 1, 2.0),
            (Method::Rk4, 1, 4.0),
            (Method::ImplicitEuler, 1, 1.0),
            (Method::ImplicitNewton, 1, 1.0),
            (Method::SemiImplicit, 1, 1.0),
            (Method::SemiImplicit, 3, 1.0),
        ] {
            let got = measured_order(method, sub_steps, &material, &AIR);
            println!("{method:?}, {sub_steps} bending sub-steps: order {got:.3}");
            assert!((got - order).abs() < SLACK, "{method:?}: {got}");
        }
    }
}

#[test]
fn explicit_steps_are_stable_below_the_estimate_and_diverge_above() {
    /// Growth that only an unstable step reaches in this many steps.
    const DIVERGED: f64 = 1e3;
    const STEPS: usize = 3000;
    let still = Environment { gravity: Vec3::zeros(), ..Environment::default() };
    for material in [SOFT, SPRINGS, undamped(&SOFT)] {
        for method in [Method::ExplicitEuler, Method::Midpoint, Method::Rk4] {
            if material == undamped(&SOFT) && method != Method::Rk4 {
                continue; // grows a little at any step: no sharp limit
            }
            let mesh = sheet(0.5, 7);
            let mut integrator = integrator(system(&mesh, &material, &still), params(method));
            let limit = integrator.stable_step(&mesh.vertices, &vec![Vec3::zeros(); mesh.vertices.len()]);
            let mut largest = |factor: f64| {
                let (mut x, mut v) = (mesh.vertices.clone(), vec![Vec3::zeros(); mesh.vertices.len()]);
                // A tiny rough disturbance, so that the sheet stays near its rest state while stable.
                for (i, v) in v.iter_mut().enumerate() {
                    let sign = if i % 2 == 0 { 1.0 } else { -1.0 };
                    *v = Vec3::new(sign, 0.7, -sign) * (1e-6 * (1.0 + (i % 5) as f64));
                }
                for _ in 0..STEPS {
                    integrator.step(&mut x, &mut v, 0.0, factor * limit, &FREE).unwrap();
                }
                // A sum, because a maximum would pass over NaN.
                let size = v.iter().map(Vec3::norm).sum::<f64>() / (1e-5 * v.len() as f64);
                if size.is_finite() { size } else { f64::INFINITY }
            };
            let (below, above) = (largest(0.9), largest(1.5));
            println!("{method:?}: limit {limit:.3e} s, growth {below:.2e} below, {above:.2e} above");
            assert!(below < 10.0, "{method:?} at 0.9: {below:e}");
            assert!(above > DIVERGED, "{method:?} at 1.5: {above:e}");
        }
    }
    let mesh = sheet(0.5, 3);
    let implicit = integrator(system(&mesh, &SOFT, &still), params(Method::ImplicitEuler));
    assert_eq!(implicit.stable_step(&mesh.vertices, &mesh.vertices), f64::INFINITY);
}

#[test]
fn bending_sub_steps_set_the_limit_of_the_semi_implicit_scheme() {
    const DIVERGED: f64 = 1e3;
    const STEPS: usize = 2000;
    let still = Environment { gravity: Vec3::zeros(), ..Environment::default() };
    let mesh = sheet(0.5, 7);
    let stiff = Material {
        bending: Bending::Hinge { rigidity: 0.05, damping: 0.0, hinges: HingeCoupling::Coupled },
        ..SOFT
    };
    let mut limits = Vec::new();
    for sub_steps in [1, 3] {
        let mut params = params(Method::SemiImplicit);
        params.bending_substeps = sub_steps;
        params.solver.tolerance = 1e-10;
        let mut integrator = integrator(system(&mesh, &stiff, &still), params);
        let limit = integrator.stable_step(&mesh.vertices, &vec![Vec3::zeros(); mesh.vertices.len()]);
        let mut growth = |factor: f64| {
            let (mut x, mut v) = (mesh.vertices.clone(), vec![Vec3::zeros(); mesh.vertices.len()]);
            for (i, v) in v.iter_mut().enumerate() {
                *v = Vec3::y() * (if i % 2 == 0 { 1e-6 } else { -1e-6 } * (1.0 + (i % 5) as f64));
            }
            for _ in 0..STEPS {
                if integrator.step(&mut x, &mut v, 0.0, factor * limit, &FREE).is_err() {
                    return f64::INFINITY;
                }
            }
            let size = v.iter().map(Vec3::norm).sum::<f64>() / (1e-6 * v.len() as f64);
            if size.is_finite() { size } else { f64::INFINITY }
        };
        let (below, above) = (growth(0.9), growth(1.3));
        println!("{sub_steps} sub-steps: limit {limit:.3e} s, growth {below:.2e} below, {above:.2e} above");
        assert!(below < 10.0 && above > DIVERGED, "{sub_steps}: {below:e} {above:e}");
        limits.push(limit);
    }
    assert!((limits[1] / limits[0] - 3.0).abs() < 1e-6, "{limits:?}");
}

#[test]
fn momentum_is_kept_without_gravity_and_air() {
    /// Relative change: rounding for explicit schemes, the linear solver's tolerance for implicit ones.
    const EXPLICIT: f64 = 1e-11;
    const IMPLICIT: f64 = 1e-8;
    let still = Environment { gravity: Vec3::zeros(), ..Environment::default() };
    for material in [SOFT, SPRINGS] {
        for method in [
            Method::ExplicitEuler,
            Method::Rk4,
            Method::ImplicitEuler,
            Method::ImplicitNewton,
            Method::SemiImplicit,
        ] {
            let mesh = sheet(0.4, 8);
            let (mut x, mut v) = wavy(&mesh, 0.03, 0.5);
            let mut params = params(method);
            params.solver.tolerance = 1e-12;
            params.newton_tolerance = 1e-11;
            let mut integrator = integrator(system(&mesh, &material, &still), params);
            let masses = integrator.system().masses().to_vec();
            let linear = |v: &[Vec3]| -> Vec3 { masses.iter().zip(v).map(|(m, v)| v * *m).sum() };
            let angular = |x: &[Vec3], v: &[Vec3]| -> Vec3 {
                masses.iter().zip(x.iter().zip(v)).map(|(m, (x, v))| x.cross(v) * *m).sum()
            };
            let size: f64 = masses.iter().zip(&v).map(|(m, v)| m * v.norm()).sum();
            let (p0, l0) = (linear(&v), angular(&x, &v));
            for step in 0..50 {
                integrator.step(&mut x, &mut v, step as f64 * 1e-3, 1e-3, &FREE).unwrap();
            }
            let bound = size * if method.is_explicit() { EXPLICIT } else { IMPLICIT };
            let drift = (linear(&v) - p0).norm();
            assert!(drift < bound, "{method:?}: linear {drift:e} of {size:e}");
            // Angular momentum: exact forces, so only the scheme's error of order dt remains.
            let turn = (angular(&x, &v) - l0).norm();
            assert!(turn < 0.02 * size * 0.4, "{method:?}: angular {turn:e} of {size:e}");
            v[0] *= 1.0 + 1e-3;
            assert!((linear(&v) - p0).norm() > bound, "a fault must be seen");
        }
    }
}

#[test]
fn free_fall_follows_the_scheme() {
    let mesh = sheet(0.5, 5);
    let dt = 0.01;
    let g = Vec3::new(0.0, -9.81, 0.0);
    for (method, expected) in [
        (Method::ExplicitEuler, 45.0),
        (Method::Midpoint, 50.0),
        (Method::Rk4, 50.0),
        (Method::ImplicitEuler, 55.0),
        (Method::ImplicitNewton, 55.0),
        (Method::SemiImplicit, 55.0),
    ] {
        let (mut x, mut v) = (mesh.vertices.clone(), vec![Vec3::zeros(); mesh.vertices.len()]);
        let mut params = params(method);
        params.solver.tolerance = 1e-10;
        let mut integrator = integrator(system(&mesh, &SOFT, &Environment::default()), params);
        for step in 0..10 {
            integrator.step(&mut x, &mut v, step as f64 * dt, dt, &FREE).unwrap();
        }
        // Sum of the velocities used: 0+…+9, ½+…, 1+…+10 times g dt².
        for (x, rest) in x.iter().zip(&mesh.vertices) {
            let error = (x - rest - g * (expected * dt * dt)).norm();
            assert!(error < 1e-9, "{method:?}: {error:e}");
        }
    }
}

#[test]
fn pins_end_at_their_targets_and_implicit_steps_are_position_consistent() {
    let mesh = sheet(0.5, 6);
    let dt = 2e-3;
    for method in [
        Method::ExplicitEuler,
        Method::Midpoint,
        Method::Rk4,
        Method::ImplicitEuler,
        Method::ImplicitNewton,
        Method::SemiImplicit,
    ] {
        let (x0, v0) = wavy(&mesh, 0.02, 0.3);
        let (mut x, mut v) = (x0.clone(), v0.clone());
        x.push(Vec3::new(7.0, 7.0, 7.0)); // a collider's vertex: not touched
        v.push(Vec3::new(8.0, 8.0, 8.0));
        let mut integrator = integrator(system(&mesh, &SOFT, &Environment::default()), params(method));
        let targets = [x0[3] + Vec3::new(0.004, 0.001, 0.0), x0[17]];
        let speeds = [Vec3::new(2.0, 0.5, 0.0), Vec3::zeros()];
        let pins = Pins { vertices: &[3, 17], x_t1: &targets, v_t1: &speeds };
        integrator.step(&mut x, &mut v, 0.0, dt, &pins).unwrap();
        assert_eq!((x[3], x[17], v[3], v[17]), (targets[0], targets[1], speeds[0], speeds[1]));
        assert_eq!((x[36].x, v[36].x), (7.0, 8.0));
        // The moving pin pulls its neighbour along within one implicit step.
        if !method.is_explicit() {
            for i in (0..36).filter(|i| ![3, 17].contains(i)) {
                assert!((x[i] - x0[i] - v[i] * dt).norm() < 1e-14, "{method:?} {i}");
            }
            let mut still = (x0.clone(), v0.clone());
            let here = [x0[3], x0[17]];
            let zero = [Vec3::zeros(); 2];
            let fixed = Pins { vertices: &[3, 17], x_t1: &here, v_t1: &zero };
            integrator.step(&mut still.0, &mut still.1, 0.0, dt, &fixed).unwrap();
            assert!((x[4] - still.0[4]).norm() > 1e-5, "{method:?}");
        }
    }
}

#[test]
fn newton_reaches_its_tolerance_where_one_linear_step_does_not() {
    let mesh = sheet(0.5, 10);
    let stiff = Material {
        in_plane: cloth_core::InPlane::BaraffWitkin { warp: 400.0, weft: 300.0, shear: 80.0, damping: 0.0 },
        ..undamped(&SOFT)
    };
    for material in [stiff, SOFT] {
        let (x0, v0) = wavy(&mesh, 0.05, 1.5);
        let dt = 0.02;
        let env = Environment::default();
        let mut params = params(Method::ImplicitNewton);
        params.solver = SolverParams { tolerance: 1e-6, ..params.solver };
        params.newton_tolerance = 1e-8;
        let mut newton = integrator(system(&mesh, &material, &env), params);
        let (mut x, mut v) = (x0.clone(), v0.clone());
        let info = newton.step(&mut x, &mut v, 0.0, dt, &FREE).unwrap();
        println!("{info:?}");
        assert!(info.converged && info.newton_iterations > 2 && info.residual <= 1e-8, "{info:?}");
        // M (v1 − v0) = dt f(x1, v1), by the public forces.
        let residual = |system: &cloth_core::ClothSystem, x: &[Vec3], v: &[Vec3]| {
            let mut f = vec![Vec3::zeros(); x.len()];
            system.forces(x, v, &mut f, &support::pool(1));
            let r: f64 =
                (0..x.len()).map(|i| ((v[i] - v0[i]) * system.masses()[i] - f[i] * dt).norm_squared()).sum();
            r.sqrt()
        };
        let solved = residual(newton.system(), &x, &v);
        let mut linear = integrator(system(&mesh, &material, &env), support::params(Method::ImplicitEuler));
        let (mut x, mut v) = (x0.clone(), v0.clone());
        linear.step(&mut x, &mut v, 0.0, dt, &FREE).unwrap();
        let once = residual(linear.system(), &x, &v);
        assert!(solved < 1e-4 * once, "{solved:e} {once:e}");
    }
}

#[test]
fn bad_steps_are_refused_and_change_nothing() {
    let mesh = sheet(0.5, 4);
    let mut integrator =
        integrator(system(&mesh, &SOFT, &Environment::default()), params(Method::ImplicitEuler));
    let (x0, v0) = wavy(&mesh, 0.02, 0.3);
    let (mut x, mut v) = (x0.clone(), v0.clone());
    for dt in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(integrator.step(&mut x, &mut v, 0.0, dt, &FREE), Err(StepError::TimeStep { .. })));
    }
    let p = [Vec3::zeros(); 2];
    for vertices in [[5, 5], [7, 2], [3, 16]] {
        let pins = Pins { vertices: &vertices, x_t1: &p, v_t1: &p };
        assert_eq!(integrator.step(&mut x, &mut v, 0.0, 0.01, &pins), Err(StepError::Pins { entry: 1 }));
    }
    assert!(matches!(
        integrator.step(&mut x[..3], &mut v, 0.0, 0.01, &FREE),
        Err(StepError::Length { name: "x", expected: 16, got: 3 })
    ));
    assert_eq!((&x, &v), (&x0, &v0));
    x[2].y = f64::NAN;
    match integrator.step(&mut x, &mut v, 0.0, 0.01, &FREE) {
        Err(StepError::Solver { vertices, .. }) => {
            // Vertex 2 and those that share an element with it.
            assert!(vertices.contains(&2) && vertices.len() < 16, "{vertices:?}");
        }
        other => panic!("{other:?}"),
    }
}

/// An indefinite matrix is said with the vertices where it is: a sheet pressed together at one place, exact Hessians.
#[test]
fn a_solver_that_fails_names_vertices() {
    let mesh = sheet(1.0, 9);
    let stiff = Material { in_plane: InPlane::Spring { stiffness: 1e5, damping: 0.0 }, ..SPRINGS };
    for method in [SolverMethod::Pcg, SolverMethod::PcgJacobi, SolverMethod::FaerCg, SolverMethod::FaerLlt] {
        let solver = SolverParams { method, ..SolverParams::default() };
        let raw = IntegratorParams { psd: Psd::Raw, solver, ..params(Method::ImplicitEuler) };
        let mut integrator = integrator(system(&mesh, &stiff, &Environment::default()), raw);
        let (mut x, mut v) = (mesh.vertices.clone(), vec![Vec3::zeros(); 81]);
        // The middle's neighbourhood to a tenth: springs under that pressure push across.
        for i in [30, 31, 32, 39, 40, 41, 48, 49, 50] {
            x[i] = x[40] + (x[i] - x[40]) * 0.1;
        }
        let before = x.clone();
        match integrator.step(&mut x, &mut v, 0.0, 0.01, &FREE) {
            Err(StepError::Solver { vertices, error }) => {
                assert!(!vertices.is_empty() && vertices.len() < 40, "{method:?}: {vertices:?} {error}");
                assert!(vertices.is_sorted(), "{vertices:?}");
                assert!(vertices.contains(&40), "{method:?}: {vertices:?} {error}");
            }
            other => panic!("{method:?}: {other:?}"),
        }
        assert_eq!(x, before);
    }
}

/// Sums of clock readings in two orders.
const CLOCK_ROUNDING: f64 = 1e-12;

#[test]
fn every_force_that_is_built_is_timed_within_its_stages() {
    let mesh = sheet(1.0, 20);
    let (x, v) = wavy(&mesh, 0.05, 1.0);
    let still = Environment { air_density: 0.0, air_damping: 0.0, ..AIR };
    for method in [Method::Rk4, Method::ImplicitEuler, Method::ImplicitNewton] {
        for (material, env, expected) in [
            (SOFT, AIR, &["baraff-witkin", "hinge", "wind", "gravity", "air-damping"][..]),
            (SPRINGS, still, &["spring", "bending-spring", "gravity"][..]),
        ] {
            let mut integrator = integrator(system(&mesh, &material, &env), params(method));
            let (mut x, mut v) = (x.clone(), v.clone());
            for _ in 0..2 {
                let info = integrator.step(&mut x, &mut v, 0.0, 1e-3, &FREE).unwrap();
                let names: Vec<_> = info.forces.iter().map(|f| f.0).collect();
                assert_eq!(names, expected, "{method:?}");
                assert!(info.forces.iter().all(|f| f.1 > 0.0), "{method:?}: {:?}", info.forces);
                // Each reading lies between the two readings of a stage, and the stages do not overlap.
                let forces: f64 = info.forces.iter().map(|f| f.1).sum();
                let stages: f64 = info.seconds.iter().filter(|s| s.0 != "solve").map(|s| s.1).sum();
                assert!(forces <= stages * (1.0 + CLOCK_ROUNDING), "{method:?}: {info:?}");
            }
        }
    }
}
