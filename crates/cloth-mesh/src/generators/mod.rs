//! Meshes made by formula: grid, disc, ribbon, cylinder, sphere, capsule, cone, cuboid. Sizes in metres.
//!
//! Axes are +y and bodies are centred at the origin. Closed surfaces have outward normals and no UV; sheets that can be
//! unrolled (grid, disc, ribbon, open cylinder) have UV in metres with u × v along the front normal.

mod cuboid;
mod round;
mod sheet;

pub use cuboid::cuboid;
pub use round::{capsule, cone, cylinder, sphere, sphere_within};
pub use sheet::{Diagonals, disc, grid, grid_with, ribbon};

use crate::MeshError;

/// Most vertices along one side or subdivisions of a circle: 2³² vertex indices must hold two of them multiplied.
const MAX_COUNT: usize = 65_535;

fn length(parameter: &'static str, value: f64) -> Result<(), MeshError> {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(MeshError::Parameter { parameter, expected: "a positive, finite length [m]", got: value })
    }
}

fn count(
    parameter: &'static str,
    value: usize,
    least: usize,
    expected: &'static str,
) -> Result<(), MeshError> {
    if (least..=MAX_COUNT).contains(&value) {
        Ok(())
    } else {
        Err(MeshError::Parameter { parameter, expected, got: value as f64 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Topology, TriMesh};

    /// Sums over a few thousand triangles of products near one.
    const ROUNDING: f64 = 1e-11;

    fn euler(mesh: &TriMesh) -> i64 {
        let topology = Topology::new(mesh.vertices.len(), &mesh.triangles);
        mesh.vertices.len() as i64 - topology.edges.len() as i64 + mesh.triangles.len() as i64
    }

    /// Sound, manifold, oriented, closed or not, with the given Euler characteristic.
    fn check(name: &str, mesh: &TriMesh, closed: bool, characteristic: i64) {
        assert_eq!(mesh.check(), Ok(()), "{name}");
        let topology = Topology::new(mesh.vertices.len(), &mesh.triangles);
        assert_eq!(topology.require_manifold(), Ok(()), "{name}");
        assert!(topology.is_oriented(&mesh.triangles), "{name}: orientation");
        assert_eq!(topology.is_closed(), closed, "{name}: closed");
        assert_eq!(euler(mesh), characteristic, "{name}: Euler characteristic");
        if closed {
            assert!(mesh.signed_volume() > 0.0, "{name}: outward");
        }
        if let Some(uv) = &mesh.uv {
            for (t, c) in uv.iter().enumerate() {
                let determinant =
                    (c[1][0] - c[0][0]) * (c[2][1] - c[0][1]) - (c[2][0] - c[0][0]) * (c[1][1] - c[0][1]);
                assert!(determinant > 0.0, "{name}: triangle {t} is mirrored in its panel");
            }
        }
    }

    #[test]
    fn sheets() {
        for pattern in [Diagonals::Alternating, Diagonals::OneWay, Diagonals::Crossed] {
            for (nx, ny) in [(2, 2), (3, 2), (5, 8)] {
                let mesh = grid_with(2.0, 3.0, nx, ny, pattern).unwrap();
                check("grid", &mesh, false, 1);
                assert!((mesh.area() - 6.0).abs() < ROUNDING);
                for t in 0..mesh.triangles.len() {
                    let [a, b, c] = mesh.corners(t);
                    assert!((b - a).cross(&(c - a)).y > 0.0, "normal up");
                }
            }
        }
        let mesh = disc(0.5, 4).unwrap();
        check("disc", &mesh, false, 1);
        let n = 24.0;
        assert!((mesh.area() - 0.5 * n * 0.25 * (std::f64::consts::TAU / n).sin()).abs() < ROUNDING);
        check("disc of one ring", &disc(1.0, 1).unwrap(), false, 1);
        check("ribbon", &ribbon(2.0, 0.1, 41, 3, 0.0).unwrap(), false, 1);
        check("twisted ribbon", &ribbon(2.0, 0.1, 41, 3, 7.0).unwrap(), false, 1);
    }

    #[test]
    fn grid_order_is_row_by_row() {
        let mesh = grid(2.0, 4.0, 3, 2).unwrap();
        assert_eq!(mesh.vertices[0], crate::Vec3::new(-1.0, 0.0, -2.0));
        assert_eq!(mesh.vertices[2], crate::Vec3::new(1.0, 0.0, -2.0));
        assert_eq!(mesh.vertices[3], crate::Vec3::new(-1.0, 0.0, 2.0));
    }

    #[test]
    fn round_bodies() {
        let tau = std::f64::consts::TAU;
        let open = cylinder(0.5, 2.0, 12, 4, false).unwrap();
        check("tube", &open, false, 0);
        let side = 12.0 * 2.0 * 0.5 * (tau / 24.0).sin() * 2.0;
        assert!((open.area() - side).abs() < ROUNDING);
        let closed = cylinder(0.5, 2.0, 12, 4, true).unwrap();
        check("cylinder", &closed, true, 2);
        let base = 0.5 * 12.0 * 0.25 * (tau / 12.0).sin();
        assert!((closed.signed_volume() - 2.0 * base).abs() < ROUNDING);
        assert!((closed.area() - side - 2.0 * base).abs() < ROUNDING);

        let mesh = cone(0.5, 2.0, 12).unwrap();
        check("cone", &mesh, true, 2);
        assert!((mesh.signed_volume() - base * 2.0 / 3.0).abs() < ROUNDING);
        assert_eq!(mesh.bounds().unwrap().1.y, 1.0);

        for n in 0..4 {
            let mesh = sphere(2.0, n).unwrap();
            check("sphere", &mesh, true, 2);
            assert_eq!(mesh.triangles.len(), 20 << (2 * n));
            for p in &mesh.vertices {
                assert!((p.norm() - 2.0).abs() < ROUNDING);
            }
        }
        let fine = sphere(1.0, 5).unwrap();
        assert!((fine.signed_volume() / (2.0 / 3.0 * tau) - 1.0).abs() < 2e-3, "first term of h²/R²");
        assert!((fine.area() / (2.0 * tau) - 1.0).abs() < 2e-3);

        let mesh = capsule(0.5, 1.0, 24, 6).unwrap();
        check("capsule", &mesh, true, 2);
        let exact = tau / 2.0 * 0.25 * 2.0 + 2.0 / 3.0 * tau * 0.125;
        assert!(mesh.signed_volume() < exact && mesh.signed_volume() > 0.97 * exact);
        assert_eq!(mesh.bounds().unwrap().1.y, 1.5);
    }

    #[test]
    fn the_sphere_keeps_its_tolerance() {
        for tolerance in [0.1, 1e-2, 1e-3, 5e-4] {
            let mesh = sphere_within(0.5, tolerance).unwrap();
            let worst = (0..mesh.triangles.len())
                .map(|t| {
                    let [a, b, c] = mesh.corners(t);
                    0.5 - (b - a).cross(&(c - a)).normalize().dot(&a)
                })
                .fold(0.0, f64::max);
            assert!(worst <= tolerance, "{worst} > {tolerance}");
            assert!(worst > tolerance / 64.0, "needlessly fine: {worst} for {tolerance}");
        }
    }

    #[test]
    fn boxes() {
        for cells in [[1, 1, 1], [2, 3, 4]] {
            let mesh = cuboid([1.0, 2.0, 3.0], cells).unwrap();
            check("cuboid", &mesh, true, 2);
            assert!((mesh.signed_volume() - 6.0).abs() < ROUNDING);
            assert!((mesh.area() - 22.0).abs() < ROUNDING);
            assert_eq!(mesh.bounds().unwrap().1, crate::Vec3::new(0.5, 1.0, 1.5));
        }
    }

    #[test]
    fn an_open_cylinder_unrolls_without_strain() {
        let mesh = cylinder(0.5, 2.0, 12, 4, false).unwrap();
        for (t, corners) in mesh.uv.as_ref().unwrap().iter().enumerate() {
            let p = mesh.corners(t);
            for k in 0..3 {
                let (a, b) = (corners[k], corners[(k + 1) % 3]);
                let flat = (a[0] - b[0]).hypot(a[1] - b[1]);
                assert!((flat - (p[k] - p[(k + 1) % 3]).norm()).abs() < ROUNDING);
            }
        }
    }

    #[test]
    fn sizes_out_of_range_are_named() {
        let name = |result: Result<TriMesh, MeshError>| match result {
            Err(MeshError::Parameter { parameter, .. }) => parameter,
            other => panic!("expected a parameter error, got {other:?}"),
        };
        assert_eq!(name(grid(0.0, 1.0, 2, 2)), "width");
        assert_eq!(name(grid(1.0, f64::NAN, 2, 2)), "height");
        assert_eq!(name(grid(1.0, 1.0, 1, 2)), "nx");
        assert_eq!(name(grid(1.0, 1.0, 2, 1 << 20)), "ny");
        assert_eq!(name(disc(-1.0, 2)), "radius");
        assert_eq!(name(disc(1.0, 0)), "rings");
        assert_eq!(name(ribbon(1.0, 0.1, 2, 2, f64::INFINITY)), "twist");
        assert_eq!(name(ribbon(0.0, 0.1, 2, 2, 0.0)), "length");
        assert_eq!(name(cylinder(1.0, 1.0, 2, 1, true)), "segments");
        assert_eq!(name(cylinder(1.0, 1.0, 3, 0, true)), "rows");
        assert_eq!(name(cone(1.0, -1.0, 3)), "height");
        assert_eq!(name(sphere(1.0, 40)), "subdivisions");
        assert_eq!(name(sphere_within(1.0, 0.0)), "tolerance");
        assert_eq!(name(sphere_within(1.0, 1e-12)), "tolerance");
        assert_eq!(name(capsule(1.0, -0.5, 8, 2)), "half_height");
        assert_eq!(name(capsule(1.0, 0.5, 8, 0)), "rings");
        assert_eq!(name(cuboid([1.0, 0.0, 1.0], [1; 3])), "size.y");
        assert_eq!(name(cuboid([1.0; 3], [1, 1, 0])), "cells.z");
    }
}
