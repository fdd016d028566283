//! Constrained solves against dense systems with multipliers.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, Matrix3};

use super::{ActiveSet, Constraint};
use crate::{
    Bending, ClothPart, ClothSystem, Environment, InPlane, Integrator, IntegratorParams, Material, Method,
    Pins, SolverMethod, StepError, StepInfo,
    assembly::Lanes,
    integrator::{Scheme, implicit::Workspace},
    mesh::{RestShape, Topology, TriMesh, Vec3, generators},
};

const SOLVERS: [SolverMethod; 4] =
    [SolverMethod::Pcg, SolverMethod::PcgJacobi, SolverMethod::FaerCg, SolverMethod::FaerLlt];
const SIDE: usize = 5;
const DT: f64 = 0.01;
const FREE: Pins<'static> = Pins { vertices: &[], x_t1: &[], v_t1: &[] };
/// Distance of velocities [m/s] and of impulses relative to the largest: solves to 1e-12 with condition numbers of 1e3.
const AGREEMENT: f64 = 1e-8;

fn mesh() -> TriMesh {
    generators::grid(0.5, 0.4, SIDE, SIDE).unwrap()
}

fn integrator(mesh: &TriMesh, method: Method, solver: SolverMethod) -> Integrator {
    let material = Material {
        areal_density: 0.3,
        in_plane: InPlane::BaraffWitkin { warp: 80.0, weft: 60.0, shear: 20.0, damping: 0.002 },
        bending: Bending::Hinge { rigidity: 1e-3, damping: 0.002, hinges: crate::HingeCoupling::default() },
    };
    let topology = Topology::new(mesh.vertices.len(), &mesh.triangles);
    let rest = RestShape::new(mesh, Vec3::x()).unwrap();
    let part = ClothPart {
        mesh,
        topology: &topology,
        rest: &rest,
        material: &material,
        first_vertex: 0,
        triangles: None,
    };
    let system = ClothSystem::new(&[part], &Environment::default(), mesh.vertices.len()).unwrap();
    let mut params = IntegratorParams { method, newton_tolerance: 1e-11, ..IntegratorParams::default() };
    params.solver.method = solver;
    params.solver.tolerance = 1e-12;
    params.solver.max_iterations = 5000;
    let pool = Arc::new(rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap());
    Integrator::new(system, params, pool).unwrap()
}

fn state(mesh: &TriMesh) -> (Vec<Vec3>, Vec<Vec3>) {
    let wave = |p: &Vec3| Vec3::new((9.0 * p.z).sin(), (7.0 * p.x + 5.0 * p.z).cos(), (8.0 * p.x).sin());
    let x = mesh.vertices.iter().map(|p| p + wave(p) * 0.01).collect();
    (x, mesh.vertices.iter().map(|p| wave(p) * 0.3).collect())
}

/// The same constraints for every solve; notes what it is shown.
struct Fixed {
    list: Vec<Constraint>,
    impulses: Vec<Vec3>,
    motion: Vec<Vec3>,
    /// Solves still asked for.
    again: usize,
}

impl Fixed {
    fn new(list: Vec<Constraint>) -> Self {
        Self { list, impulses: vec![], motion: vec![], again: 0 }
    }
}

impl ActiveSet for Fixed {
    fn constraints(&mut self) -> &[Constraint] {
        &self.list
    }

    fn judge(&mut self, motion: &[Vec3], impulses: &[Vec3]) -> bool {
        (self.motion, self.impulses) = (motion.to_vec(), impulses.to_vec());
        let again = self.again > 0;
        self.again = self.again.saturating_sub(1);
        again
    }
}

/// One, two and three directions held, a push with drag on one that slides and on one that is free; neighbours among them.
fn constraints() -> Vec<Constraint> {
    let n = Vec3::new(0.2, 0.9, -0.3).normalize();
    let q = n.cross(&Vec3::x()).normalize();
    let base = Constraint::fixed(0, Vec3::zeros());
    let drag = Matrix3::new(2.0, 0.5, 0.0, 0.5, 1.0, 0.2, 0.0, 0.2, 0.7) * 1e-3;
    vec![
        Constraint {
            vertex: 3,
            count: 1,
            directions: [n, q, Vec3::x()],
            velocity: Vec3::new(0.1, -0.2, 0.3),
            impulse: Vec3::new(1e-4, 2e-5, -5e-5),
            drag,
        },
        Constraint { vertex: 6, count: 0, impulse: Vec3::new(0.0, 3e-5, 0.0), drag, ..base },
        Constraint { vertex: 7, count: 2, directions: [q, n, Vec3::x()], velocity: Vec3::y() * 0.1, ..base },
        Constraint::fixed(8, Vec3::new(0.05, 0.1, -0.02)),
        Constraint { vertex: 12, count: 1, directions: [Vec3::y(), n, q], ..base },
        Constraint { vertex: 13, count: 1, directions: [n, Vec3::x(), q], velocity: Vec3::z() * 0.2, ..base },
    ]
}

/// Δv and the impulses on the constrained vertices from the dense system with one multiplier per held direction.
fn dense(work: &Workspace, b: &[Vec3], v: &[Vec3], list: &[Constraint]) -> (Vec<Vec3>, Vec<Vec3>) {
    let n = 3 * v.len();
    let held: usize = list.iter().map(|c| c.count).sum();
    let mut a = DMatrix::<f64>::zeros(n, n);
    for column in 0..n {
        let mut unit = vec![Lanes::ZERO; v.len()];
        unit[column / 3].0[column % 3] = 1.0;
        let mut out = vec![Lanes::ZERO; v.len()];
        work.matrix.multiply_rows(0, &unit, &mut out);
        for row in 0..n {
            a[(row, column)] = out[row / 3].0[row % 3];
        }
    }
    let mut kkt = DMatrix::<f64>::zeros(n + held, n + held);
    kkt.view_mut((0, 0), (n, n)).copy_from(&a);
    let mut rhs = DVector::<f64>::zeros(n + held);
    for (i, b) in b.iter().enumerate() {
        rhs.fixed_rows_mut::<3>(3 * i).copy_from(b);
    }
    let mut row = n;
    for c in list {
        let i = c.vertex as usize;
        let mut own = kkt.fixed_view_mut::<3, 3>(3 * i, 3 * i);
        own += c.drag;
        let push = c.impulse - c.drag * v[i];
        let mut at = rhs.fixed_rows_mut::<3>(3 * i);
        at += push;
        for q in &c.directions[..c.count] {
            for l in 0..3 {
                kkt[(row, 3 * i + l)] = q[l];
                kkt[(3 * i + l, row)] = q[l];
            }
            rhs[row] = q.dot(&(c.velocity - v[i]));
            row += 1;
        }
    }
    let solution = kkt.lu().solve(&rhs).unwrap();
    let dv: Vec<Vec3> = (0..v.len()).map(|i| solution.fixed_rows::<3>(3 * i).into()).collect();
    let product = a * solution.rows(0, n);
    let impulses = list
        .iter()
        .map(|c| {
            let i = c.vertex as usize;
            Vec3::from(product.fixed_rows::<3>(3 * i)) - b[i]
        })
        .collect();
    (dv, impulses)
}

fn distance(a: &[Vec3], b: &[Vec3]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
}

fn step(integrator: &mut Integrator, set: &mut Fixed) -> Result<(Vec<Vec3>, Vec<Vec3>, StepInfo), StepError> {
    let (mut x, mut v) = state(&mesh());
    let info = integrator.step_with(&mut x, &mut v, DT, &FREE, set)?;
    Ok((x, v, info))
}

/// Every solver gives the motion and the impulses of the dense system, in one solve and over several.
#[test]
fn elimination_equals_multipliers() {
    let mesh = mesh();
    let (x, v) = state(&mesh);
    for solver in SOLVERS {
        for again in [0, 3] {
            let mut integrator = integrator(&mesh, Method::ImplicitEuler, solver);
            let mut set = Fixed { again, ..Fixed::new(constraints()) };
            let (x1, v1, info) = step(&mut integrator, &mut set).unwrap();
            assert!(info.converged, "{solver:?}: {info:?}");
            // The matrix is as it was assembled: what was projected is put back.
            let Scheme::Implicit(work) = &integrator.work else { panic!("implicit") };
            let (dv, impulses) = dense(work, &work.b, &v, &set.list);
            let expected: Vec<Vec3> = v.iter().zip(&dv).map(|(v, dv)| v + dv).collect();
            assert!(distance(&v1, &expected) < AGREEMENT, "{solver:?}: {:e}", distance(&v1, &expected));
            assert_eq!(distance(&set.motion, &v1), 0.0);
            let largest = impulses.iter().map(Vec3::norm).fold(0.0, f64::max);
            let error = distance(&set.impulses, &impulses) / largest;
            assert!(error < AGREEMENT, "{solver:?}: impulses {error:e}");
            for (c, u) in set.list.iter().map(|c| (c, v1[c.vertex as usize])) {
                for q in &c.directions[..c.count] {
                    assert!(q.dot(&(u - c.velocity)).abs() < 1e-14, "held exactly, whatever the tolerance");
                }
            }
            assert!(distance(&x1, &x) > 1e-4 && distance(&expected, &v) > 1e-2);
            // Planted: one constraint less, one direction turned, no drag, is another solution.
            let mut fewer = constraints();
            fewer.remove(4);
            let mut turned = constraints();
            turned[0].directions[0] = Vec3::y();
            let mut slick = constraints();
            slick[0].drag = Matrix3::zeros();
            for list in [fewer, turned, slick] {
                let (other, _) = dense(work, &work.b, &v, &list);
                assert!(distance(&other, &dv) > 1e3 * AGREEMENT, "{:e}", distance(&other, &dv));
            }
        }
    }
}

/// A loose solver still holds exactly; momentum is what the constraints and gravity gave.
#[test]
fn impulses_balance_momentum() {
    let mesh = mesh();
    for method in [Method::ImplicitEuler, Method::ImplicitNewton, Method::SemiImplicit] {
        let mut integrator = integrator(&mesh, method, SolverMethod::Pcg);
        // No drag: the push is given, and what is given is all that is not internal.
        let mut list = constraints();
        for c in &mut list {
            c.drag = Matrix3::zeros();
        }
        let mut set = Fixed::new(list);
        let (_, v) = state(&mesh);
        let (_, v1, _) = step(&mut integrator, &mut set).unwrap();
        let masses = integrator.system().masses();
        let change: Vec3 = v1.iter().zip(&v).zip(masses).map(|((a, b), m)| (a - b) * *m).sum();
        let weight = Vec3::new(0.0, -9.81, 0.0) * (masses.iter().sum::<f64>() * DT);
        let given: Vec3 = set.impulses.iter().sum();
        let size: f64 = set.impulses.iter().map(Vec3::norm).sum();
        let error = (change - weight - given).norm() / size;
        println!("{method:?}: {error:e}");
        assert!(error < 1e-9, "{method:?}: {error:e}");
        assert!((change - weight).norm() > 1e-3 * size, "the comparison sees the impulses");
    }
}

/// Newton's method holds what is held and solves for the rest: its residual is what the constraints give.
#[test]
fn newton_agrees_for_small_steps_and_holds_exactly() {
    let mesh = mesh();
    let mut states = Vec::new();
    for method in [Method::ImplicitEuler, Method::ImplicitNewton, Method::SemiImplicit] {
        let mut integrator = integrator(&mesh, method, SolverMethod::FaerLlt);
        let mut set = Fixed { again: 1, ..Fixed::new(constraints()) };
        let (mut x, mut v) = state(&mesh);
        let x0 = x.clone();
        let dt = 1e-4;
        let info = integrator.step_with(&mut x, &mut v, dt, &FREE, &mut set).unwrap();
        assert!(info.converged, "{method:?}: {info:?}");
        for c in &set.list {
            let i = c.vertex as usize;
            for q in &c.directions[..c.count] {
                assert!(q.dot(&(v[i] - c.velocity)).abs() < 1e-13, "{method:?}");
                assert!(q.dot(&((x[i] - x0[i]) / dt - c.velocity)).abs() < 1e-11, "{method:?}");
            }
        }
        states.push((v, set.impulses));
    }
    let (euler, forces) = &states[0];
    for (v, impulses) in &states[1..] {
        assert!(distance(v, euler) < 1e-4, "{:e}", distance(v, euler));
        let largest = forces.iter().map(Vec3::norm).fold(0.0, f64::max);
        assert!(distance(impulses, forces) < 1e-2 * largest, "{:e}", distance(impulses, forces) / largest);
    }
}

/// A step with an empty set is a step without, to the same bits; wrong entries are named, and the state stays.
#[test]
fn empty_sets_and_wrong_entries() {
    let mesh = mesh();
    for method in [Method::ImplicitEuler, Method::ImplicitNewton, Method::SemiImplicit] {
        let mut integrator = integrator(&mesh, method, SolverMethod::Pcg);
        let bytes = integrator.bytes();
        let (mut x, mut v) = state(&mesh);
        integrator.step(&mut x, &mut v, 0.0, DT, &FREE).unwrap();
        assert_eq!(integrator.bytes(), bytes, "no room without constraints");
        let (y, w, _) = step(&mut integrator, &mut Fixed::new(vec![])).unwrap();
        assert!((distance(&x, &y), distance(&v, &w)) == (0.0, 0.0), "{method:?}");
        assert!(integrator.bytes() > bytes);
    }
    let mut integrator = integrator(&mesh, Method::ImplicitEuler, SolverMethod::Pcg);
    let pinned = Pins { vertices: &[8], x_t1: &[Vec3::zeros()], v_t1: &[Vec3::zeros()] };
    let wrong = |change: &dyn Fn(&mut Vec<Constraint>)| {
        let mut list = constraints();
        change(&mut list);
        list
    };
    let cases: [(Vec<Constraint>, usize, &str); 5] = [
        (wrong(&|l| l.swap(0, 1)), 1, "ascending vertices"),
        (wrong(&|l| l[5].vertex = 25), 5, "a cloth vertex that is not pinned"),
        (wrong(&|l| l[2].directions[1] = l[2].directions[0]), 2, "orthonormal directions"),
        (wrong(&|l| l[0].impulse.x = f64::NAN), 0, "finite numbers"),
        (wrong(&|l| l[0].count = 4), 0, "at most 3 directions"),
    ];
    for (list, entry, expected) in cases {
        let got = step(&mut integrator, &mut Fixed::new(list)).err();
        assert_eq!(got, Some(StepError::Constraint { entry, expected }));
    }
    let (mut x, mut v) = state(&mesh);
    let before = x.clone();
    let got = integrator.step_with(&mut x, &mut v, DT, &pinned, &mut Fixed::new(constraints())).err();
    let expected = "a cloth vertex that is not pinned";
    assert_eq!(got, Some(StepError::Constraint { entry: 3, expected }));
    assert_eq!(distance(&x, &before), 0.0);
    let mut explicit = self::integrator(&mesh, Method::Rk4, SolverMethod::Pcg);
    let got = step(&mut explicit, &mut Fixed::new(vec![])).err();
    assert!(matches!(got, Some(StepError::Constraint { expected: "an implicit scheme", .. })), "{got:?}");
}
