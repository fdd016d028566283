//! Cloth to test with.

#![allow(dead_code, reason = "each test binary uses a part of this")]
#![allow(clippy::unwrap_used, reason = "test support: a failure here fails the test")]

use std::sync::Arc;

use cloth_core::{
    Bending, ClothPart, ClothSystem, Environment, HingeCoupling, InPlane, Integrator, IntegratorParams,
    Material, Method, Pins,
    mesh::{RestShape, Topology, TriMesh, Vec3, generators},
};

pub(crate) fn pool(threads: usize) -> Arc<rayon::ThreadPool> {
    Arc::new(rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap())
}

/// A square sheet in the xz-plane.
pub(crate) fn sheet(size: f64, n: usize) -> TriMesh {
    generators::grid(size, size, n, n).unwrap()
}

pub(crate) fn system(mesh: &TriMesh, material: &Material, env: &Environment) -> ClothSystem {
    let topology = Topology::new(mesh.vertices.len(), &mesh.triangles);
    let rest = RestShape::new(mesh, Vec3::x()).unwrap();
    let part =
        ClothPart { mesh, topology: &topology, rest: &rest, material, first_vertex: 0, triangles: None };
    ClothSystem::new(&[part], env, mesh.vertices.len()).unwrap()
}

/// Soft and damped, so that explicit schemes have large steps.
pub(crate) const SOFT: Material = Material {
    areal_density: 0.3,
    in_plane: InPlane::BaraffWitkin { warp: 8.0, weft: 6.0, shear: 2.0, damping: 0.02 },
    bending: Bending::Hinge { rigidity: 1e-3, damping: 0.02, hinges: HingeCoupling::Coupled },
};

pub(crate) const SPRINGS: Material = Material {
    areal_density: 0.3,
    in_plane: InPlane::Spring { stiffness: 6.0, damping: 0.05 },
    bending: Bending::Spring { stiffness: 0.5, damping: 0.01 },
};

/// A material without damping.
pub(crate) fn undamped(material: &Material) -> Material {
    let mut material = *material;
    match &mut material.in_plane {
        InPlane::Spring { damping, .. } | InPlane::BaraffWitkin { damping, .. } => *damping = 0.0,
    }
    match &mut material.bending {
        Bending::None => {}
        Bending::Spring { damping, .. } | Bending::Hinge { damping, .. } => *damping = 0.0,
        Bending::Nonlinear(law) => law.damping = 0.0,
        Bending::Plastic(law) => law.damping = 0.0,
        Bending::Hysteresis(law) => law.damping = 0.0,
    }
    material
}

pub(crate) fn integrator(system: ClothSystem, params: IntegratorParams) -> Integrator {
    Integrator::new(system, params, pool(1)).unwrap()
}

pub(crate) fn params(method: Method) -> IntegratorParams {
    IntegratorParams { method, ..IntegratorParams::default() }
}

/// A smooth state away from rest: wavy positions and velocities.
pub(crate) fn wavy(mesh: &TriMesh, height: f64, speed: f64) -> (Vec<Vec3>, Vec<Vec3>) {
    let x = mesh
        .vertices
        .iter()
        .map(|p| {
            let bump = height * ((5.0 * p.x).sin() + (4.0 * p.z + 0.5).cos());
            Vec3::new(1.02 * p.x, p.y + bump, 0.99 * p.z + 0.3 * height * (3.0 * p.x).cos())
        })
        .collect();
    let v = mesh
        .vertices
        .iter()
        .map(|p| Vec3::new(0.2 * (3.0 * p.z).sin(), (4.0 * p.x + p.z).cos(), 0.3 * (2.0 * p.x).sin()) * speed)
        .collect();
    (x, v)
}

pub(crate) const FREE: Pins<'static> = Pins { vertices: &[], x_t1: &[], v_t1: &[] };

/// Distance of two states over all vertices; NaN if any coordinate is.
pub(crate) fn distance(a: &[Vec3], b: &[Vec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).norm_squared()).sum::<f64>().sqrt()
}
