//! What is built, what is refused, and what the public sums say.

#![allow(clippy::unwrap_used, reason = "a failure fails the test")]

mod support;

use cloth_core::{
    Bending, ClothPart, ClothSystem, CoreError, Environment, HingeCoupling, InPlane, Integrator,
    IntegratorParams, Material,
    material::library,
    mesh::{RestShape, Topology, TriMesh, Vec3},
};
use support::{SOFT, SPRINGS, pool, sheet, system, undamped, wavy};

#[test]
fn only_what_is_called_for_is_built() {
    let mesh = sheet(1.0, 5);
    let names = |material: &Material, env: &Environment| -> Vec<&'static str> {
        system(&mesh, material, env).effects().iter().map(|e| e.name).collect()
    };
    let space = Environment { gravity: Vec3::zeros(), ..Environment::default() };
    assert_eq!(names(&SOFT, &space), ["baraff-witkin", "hinge"]);
    assert_eq!(names(&SPRINGS, &Environment::default()), ["spring", "bending-spring", "gravity"]);
    assert_eq!(names(&Material { bending: Bending::None, ..SOFT }, &space), ["baraff-witkin"]);
    let limp = Bending::Hinge { rigidity: 0.0, damping: 1.0, hinges: HingeCoupling::Coupled };
    assert_eq!(names(&Material { bending: limp, ..SOFT }, &space), ["baraff-witkin"]);
    let loose = InPlane::Spring { stiffness: 0.0, damping: 0.0 };
    assert_eq!(
        names(&Material { in_plane: loose, bending: Bending::None, areal_density: 1.0 }, &space),
        [""; 0]
    );
    let windy = Environment { drag: 0.1, air_damping: 0.2, ..Environment::default() };
    assert_eq!(names(&SOFT, &windy), ["baraff-witkin", "hinge", "wind", "gravity", "air-damping"]);
    let vacuum = Environment { air_density: 0.0, ..windy };
    assert!(!names(&SOFT, &vacuum).contains(&"wind"));

    let effects = system(&mesh, &SOFT, &windy).effects();
    // 16 cells: 32 triangles, 56 edges of which 16 on the boundary: 40 hinges.
    assert_eq!(effects.iter().map(|e| e.elements).collect::<Vec<_>>(), [32, 40, 32, 25, 25]);
    assert!(effects[..3].iter().all(|e| e.bytes > 0));
}

#[test]
fn masses_sum_to_area_times_density() {
    let mesh = sheet(2.0, 9);
    let cotton = library::named("cotton").unwrap();
    let system = system(&mesh, &cotton, &Environment::default());
    let total: f64 = system.masses().iter().sum();
    assert!((total - 4.0 * cotton.areal_density).abs() < 1e-12);
}

#[test]
fn forces_are_minus_the_gradient_of_the_energy() {
    /// Central differences at a step of 1e-6 m of energies of order 1 J.
    const TOLERANCE: f64 = 1e-5;
    let mesh = sheet(0.5, 6);
    for material in [undamped(&SOFT), undamped(&SPRINGS)] {
        let system = system(&mesh, &material, &Environment::default());
        let (mut x, _) = wavy(&mesh, 0.04, 0.0);
        let v = vec![Vec3::zeros(); x.len()];
        let mut f = vec![Vec3::zeros(); x.len()];
        system.forces(&x, &v, &mut f, &pool(2));
        let size = f.iter().map(Vec3::norm).fold(0.0, f64::max);
        for (i, axis) in [(0, 0), (7, 1), (20, 2), (35, 1)] {
            let at = x[i][axis];
            x[i][axis] = at + 1e-6;
            let plus = system.energy(&x, &v).total();
            x[i][axis] = at - 1e-6;
            let minus = system.energy(&x, &v).total();
            x[i][axis] = at;
            let expected = -(plus - minus) / 2e-6;
            assert!((f[i][axis] - expected).abs() < TOLERANCE * size, "{} {expected}", f[i][axis]);
            assert!((f[i][axis] + 1e-3 * size - expected).abs() > TOLERANCE * size, "a fault must be seen");
        }
    }
}

#[test]
fn energies_by_hand() {
    let mesh = sheet(1.0, 3);
    let system = system(&mesh, &SOFT, &Environment::default());
    let x: Vec<Vec3> = mesh.vertices.iter().map(|x| Vec3::new(1.1 * x.x, 2.0, x.z)).collect();
    let energy = system.energy(&x, &vec![Vec3::new(0.0, 3.0, 4.0); 9]);
    // 0.3 kg at 5 m/s and 2 m; 1 m² stretched by 10 % along the warp of 8 N/m.
    let close = |got: f64, expected: f64| assert!((got - expected).abs() < 1e-12, "{got} {expected}");
    close(energy.kinetic, 3.75);
    close(energy.gravity, 0.3 * 9.81 * 2.0);
    close(energy.stretch, 0.5 * 8.0 * 0.01);
    close(energy.shear, 0.0);
    close(energy.bending, 0.0);
    close(energy.total(), 3.75 + 0.3 * 9.81 * 2.0 + 0.04);
}

#[test]
fn a_cylinder_bends_with_the_rigidity_of_the_material() {
    let (n, length, radius, rigidity) = (41, 0.4, 0.5, 3e-4);
    let mesh = sheet(length, n);
    let material = Material {
        bending: Bending::Hinge { rigidity, damping: 0.0, hinges: HingeCoupling::Coupled },
        ..SOFT
    };
    let system = system(&mesh, &material, &Environment { gravity: Vec3::zeros(), ..Environment::default() });
    let x: Vec<Vec3> = mesh
        .vertices
        .iter()
        .map(|p| {
            let (s, c) = (p.x / radius).sin_cos();
            Vec3::new(radius * s, radius * (1.0 - c), p.z)
        })
        .collect();
    let v = vec![Vec3::zeros(); x.len()];
    let energy = system.energy(&x, &v).bending;
    // ½ B κ² per area; only hinges across the bending direction are bent, diagonals of a developed cylinder are flat.
    let expected = 0.5 * rigidity / (radius * radius) * length * length;
    assert!((energy / expected - 1.0).abs() < 0.05, "{energy:e} {expected:e}");
}

#[test]
fn several_parts_share_one_vertex_array() {
    let mesh = sheet(1.0, 4);
    let topology = Topology::new(16, &mesh.triangles);
    let rest = RestShape::new(&mesh, Vec3::x()).unwrap();
    let part = |material, first_vertex| ClothPart {
        mesh: &mesh,
        topology: &topology,
        rest: &rest,
        material,
        first_vertex,
        triangles: None,
    };
    let env = Environment::default();
    let both = ClothSystem::new(&[part(&SOFT, 0), part(&SPRINGS, 16)], &env, 32).unwrap();
    let (x, v) = wavy(&mesh, 0.05, 0.4);
    let (xx, vv) = ([x.clone(), x.clone()].concat(), [v.clone(), v.clone()].concat());
    let mut f = vec![Vec3::zeros(); 32];
    both.forces(&xx, &vv, &mut f, &pool(1));
    for (material, offset) in [(&SOFT, 0), (&SPRINGS, 16)] {
        let mut alone = vec![Vec3::zeros(); 16];
        system(&mesh, material, &env).forces(&x, &v, &mut alone, &pool(1));
        assert_eq!(f[offset..offset + 16], alone);
    }
    assert_ne!(f[..16], f[16..]);
    let gap = ClothSystem::new(&[part(&SOFT, 0)], &env, 17);
    assert_eq!(gap.err(), Some(CoreError::Massless { vertex: 16 }));
    let over = ClothSystem::new(&[part(&SOFT, 1)], &env, 16);
    assert!(matches!(over.err(), Some(CoreError::Length { expected: 16, got: 17, .. })));
}

#[test]
fn bad_materials_and_surroundings_name_the_parameter() {
    let expect = |material: Material, parameter: &str| {
        let error = material.check().unwrap_err();
        assert!(error.to_string().starts_with(parameter), "{error}");
    };
    expect(Material { areal_density: 0.0, ..SOFT }, "areal_density: expected a value > 0 in kg/m², got 0");
    expect(Material { areal_density: f64::NAN, ..SOFT }, "areal_density");
    let bw = |warp, weft, shear, damping| Material {
        in_plane: InPlane::BaraffWitkin { warp, weft, shear, damping },
        ..SOFT
    };
    expect(bw(-1.0, 1.0, 1.0, 0.0), "in_plane.warp: expected a value ≥ 0 in N/m, got -1");
    expect(bw(1.0, f64::NAN, 1.0, 0.0), "in_plane.weft");
    expect(bw(1.0, 1.0, f64::INFINITY, 0.0), "in_plane.shear");
    expect(bw(1.0, 1.0, 1.0, -0.1), "in_plane.damping");
    let bends = |bending| Material { bending, ..SOFT };
    expect(
        bends(Bending::Hinge { rigidity: -1.0, damping: 0.0, hinges: HingeCoupling::Coupled }),
        "bending.rigidity",
    );
    expect(
        bends(Bending::Hinge { rigidity: 1.0, damping: f64::NAN, hinges: HingeCoupling::Coupled }),
        "bending.damping",
    );
    expect(bends(Bending::Spring { stiffness: -1.0, damping: 0.0 }), "bending.stiffness");
    let env = Environment { drag: -1.0, ..Environment::default() };
    assert!(env.check().unwrap_err().to_string().starts_with("air.drag"));
    let env = Environment { wind: Vec3::new(0.0, f64::NAN, 0.0), ..Environment::default() };
    assert!(env.check().unwrap_err().to_string().starts_with("air.wind"));
    let mesh = sheet(1.0, 2);
    let system = system(&mesh, &SOFT, &Environment::default());
    let mut params = IntegratorParams::default();
    params.solver.tolerance = -1.0;
    let error = Integrator::new(system, params, pool(1)).err().unwrap();
    assert!(error.to_string().starts_with("solver.tolerance"), "{error}");
}

#[test]
fn bending_across_a_fan_of_three_triangles_is_refused_and_stretch_is_not() {
    let mesh = TriMesh {
        vertices: vec![Vec3::zeros(), Vec3::x(), Vec3::y(), Vec3::z(), Vec3::new(0.0, -1.0, 0.0)],
        triangles: vec![[0, 1, 2], [0, 1, 3], [0, 1, 4]],
        uv: None,
    };
    let topology = Topology::new(5, &mesh.triangles);
    let rest = RestShape::new(&mesh, Vec3::x()).unwrap();
    let build = |material: &Material| {
        let part = ClothPart {
            mesh: &mesh,
            topology: &topology,
            rest: &rest,
            material,
            first_vertex: 0,
            triangles: None,
        };
        ClothSystem::new(&[part], &Environment::default(), 5).map(|_| ())
    };
    assert!(matches!(build(&SOFT), Err(CoreError::Mesh(_))));
    assert_eq!(build(&Material { bending: Bending::None, ..SOFT }), Ok(()));
}

#[test]
fn parameters_read_as_in_a_scene_file() {
    let material: Material = serde_json::from_str(
        r#"{"areal_density": 0.2, "in_plane": {"model": "baraff-witkin", "warp": 1.0, "weft": 2.0, "shear": 3.0},
            "bending": {"model": "hinge", "rigidity": 1e-5, "damping": 0.01}}"#,
    )
    .unwrap();
    assert_eq!(material.in_plane, InPlane::BaraffWitkin { warp: 1.0, weft: 2.0, shear: 3.0, damping: 0.0 });
    let again: Material = serde_json::from_str(&serde_json::to_string(&material).unwrap()).unwrap();
    assert_eq!(again, material);
    let wrong = serde_json::from_str::<Material>(
        r#"{"areal_density": 0.2, "in_plane": {"model": "spring", "stiffness": 1.0, "warp": 1.0}}"#,
    );
    assert!(wrong.unwrap_err().to_string().contains("warp"));
    let params: IntegratorParams =
        serde_json::from_str(r#"{"method": "implicit-newton", "solver": {"method": "faer-llt"}}"#).unwrap();
    assert_eq!(params.solver.tolerance, 1e-4);
}

#[test]
fn parts_of_one_mesh_add_up_to_it() {
    let mesh = sheet(1.0, 6);
    let n = mesh.vertices.len();
    let topology = Topology::new(n, &mesh.triangles);
    let rest = RestShape::new(&mesh, Vec3::x()).unwrap();
    let (left, right): (Vec<u32>, Vec<u32>) = (0..mesh.triangles.len() as u32).partition(|t| t % 7 < 3);
    let env = Environment { air_density: 1.2, drag: 0.5, ..Environment::default() };
    let (x, v) = wavy(&mesh, 0.05, 0.4);
    let forces = |materials: [Material; 2], lists: [Option<&[u32]>; 2]| {
        let parts: Vec<_> = materials
            .iter()
            .zip(lists)
            .filter(|(_, list)| list.is_none_or(|list| !list.is_empty()))
            .map(|(material, triangles)| ClothPart {
                mesh: &mesh,
                topology: &topology,
                rest: &rest,
                material,
                first_vertex: 0,
                triangles,
            })
            .collect();
        let system = ClothSystem::new(&parts, &env, n).unwrap();
        let mut f = vec![Vec3::zeros(); n];
        system.forces(&x, &v, &mut f, &pool(1));
        (f, system.masses().to_vec())
    };
    let far = |a: &[Vec3], b: &[Vec3]| a.iter().zip(b).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
    for mut material in [SOFT, SPRINGS] {
        // Hinges of two parts do not couple; alone each is in one part.
        material.bending = material.bending.with_hinges(HingeCoupling::Independent);
        let (whole, masses) = forces([material; 2], [None, Some(&[])]);
        let (split, split_masses) = forces([material; 2], [Some(&left), Some(&right)]);
        let scale = whole.iter().map(Vec3::norm).fold(0.0, f64::max);
        // Sums in another order.
        assert!(far(&whole, &split) <= 1e-12 * scale);
        assert!(masses.iter().zip(&split_masses).all(|(a, b)| (a - b).abs() <= 1e-14 * a));
        let other = Material { areal_density: 2.0 * material.areal_density, ..material };
        let (heavier, _) = forces([material, other], [Some(&left), Some(&right)]);
        assert!(far(&whole, &heavier) > 1e-3 * scale, "a material of its own is seen");
    }
}
