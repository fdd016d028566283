//! Tessellated shapes: closed, outward, within their tolerance.
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use cloth_collision::DetectError;
use cloth_collision::distance::vertex_triangle::closest_point;
use cloth_collision::mesh::{Topology, TriMesh, Vec3};
use cloth_collision::shapes::{Shape, tessellate};

const SHAPES: [Shape; 4] = [
    Shape::Sphere { radius: 0.5 },
    Shape::Capsule { radius: 0.2, half_height: 0.7 },
    Shape::Box { half_extents: [0.3, 0.5, 0.2] },
    Shape::Cone { radius: 0.4, height: 0.9 },
];
/// Rounding of coordinates of about 1 m.
const ROUNDING: f64 = 1e-12;

/// Signed distance to the true surface.
fn true_distance(shape: &Shape, p: Vec3) -> f64 {
    match *shape {
        Shape::Sphere { radius } => p.norm() - radius,
        Shape::Capsule { radius, half_height } => {
            (p - Vec3::new(0.0, p.y.clamp(-half_height, half_height), 0.0)).norm() - radius
        }
        Shape::Box { half_extents } => {
            let d = p.abs() - Vec3::from(half_extents);
            d.sup(&Vec3::zeros()).norm() + d.max().min(0.0)
        }
        Shape::Plane { .. } => p.y,
        Shape::Cone { radius, height } => {
            // Half plane through the axis: sides of the triangle apex, rim, middle of the base.
            let q = Vec3::new((p.x * p.x + p.z * p.z).sqrt(), p.y, 0.0);
            let (apex, rim, middle) = (
                Vec3::new(0.0, height / 2.0, 0.0),
                Vec3::new(radius, -height / 2.0, 0.0),
                Vec3::new(0.0, -height / 2.0, 0.0),
            );
            let to = |a: Vec3, b: Vec3| {
                let t = ((q - a).dot(&(b - a)) / (b - a).norm_squared()).clamp(0.0, 1.0);
                (q - a - (b - a) * t).norm()
            };
            to(apex, rim).min(to(rim, middle))
        }
    }
}

/// Largest distance of points of the mesh from the true surface.
fn deviation(shape: &Shape, mesh: &TriMesh) -> f64 {
    let mut worst = 0.0f64;
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|v| mesh.vertices[v as usize]);
        for i in 0..=12 {
            for j in 0..=12 - i {
                let p = a + (b - a) * (i as f64 / 12.0) + (c - a) * (j as f64 / 12.0);
                worst = worst.max(true_distance(shape, p).abs());
            }
        }
    }
    worst
}

#[test]
fn meshes_stay_within_the_tolerance_of_the_surface() {
    for shape in &SHAPES {
        for tolerance in [0.1, 1e-2, 1e-3, 1e-4] {
            let mesh = tessellate(shape, tolerance).unwrap();
            let worst = deviation(shape, &mesh);
            assert!(worst <= tolerance + ROUNDING, "{shape:?} at {tolerance}: {worst}");
        }
    }
}

#[test]
fn a_coarser_mesh_fails_the_deviation_check() {
    let coarse = tessellate(&Shape::Sphere { radius: 0.5 }, 1e-2).unwrap();
    assert!(deviation(&Shape::Sphere { radius: 0.5 }, &coarse) > 1e-3, "the check must see a coarse mesh");
}

#[test]
fn surface_points_are_within_the_tolerance_of_the_mesh() {
    let tolerance = 5e-3;
    for shape in &SHAPES {
        let mesh = tessellate(shape, tolerance).unwrap();
        // Rays from the inside leave through the surface: bisect for the point on it.
        for k in 0..200u32 {
            let z = 1.0 - (2.0 * f64::from(k) + 1.0) / 200.0;
            let angle = f64::from(k) * 2.399_963_229_728_653;
            let direction =
                Vec3::new((1.0 - z * z).sqrt() * angle.cos(), z, (1.0 - z * z).sqrt() * angle.sin());
            let inside = |s: f64| match *shape {
                Shape::Cone { radius, height } => {
                    let p = direction * s;
                    p.y > -height / 2.0
                        && (p.x * p.x + p.z * p.z).sqrt() < radius * (height / 2.0 - p.y) / height
                }
                _ => true_distance(shape, direction * s) < 0.0,
            };
            let (mut lo, mut hi) = (0.0, 10.0);
            for _ in 0..60 {
                let mid = 0.5 * (lo + hi);
                if inside(mid) { lo = mid } else { hi = mid }
            }
            let p = direction * lo;
            let nearest = mesh
                .triangles
                .iter()
                .map(|t| {
                    let q = t.map(|v| mesh.vertices[v as usize]);
                    let w = closest_point(&[p, q[0], q[1], q[2]]);
                    (q[0] * w[0] + q[1] * w[1] + q[2] * w[2] - p).norm()
                })
                .fold(f64::INFINITY, f64::min);
            assert!(nearest <= tolerance + ROUNDING, "{shape:?}: {p:?} is {nearest} away");
        }
    }
}

#[test]
fn meshes_are_closed_manifold_and_outward() {
    for shape in &SHAPES {
        let mesh = tessellate(shape, 1e-2).unwrap();
        mesh.check().unwrap();
        let topology = Topology::new(mesh.vertices.len(), &mesh.triangles);
        assert!(topology.boundary_edges.is_empty() && topology.non_manifold_edges.is_empty(), "{shape:?}");
        let v = mesh.vertices.len() as i64;
        assert_eq!(
            v - topology.edges.len() as i64 + mesh.triangles.len() as i64,
            2,
            "{shape:?} is one closed surface"
        );
        // All shapes are convex about the origin: every triangle faces away from it, all the same way round.
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|v| mesh.vertices[v as usize]);
            assert!(
                (b - a).cross(&(c - a)).dot(&(a + b + c)) > 0.0,
                "{shape:?}: triangle {t:?} faces inwards"
            );
        }
    }
}

#[test]
fn the_plane_is_a_square_that_faces_up() {
    let mesh = tessellate(&Shape::Plane { half_size: 2.0 }, 1e-3).unwrap();
    mesh.check().unwrap();
    let area: f64 = mesh
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|v| mesh.vertices[v as usize]);
            let n = (b - a).cross(&(c - a));
            assert!(n.y > 0.0, "triangle {t:?} faces down");
            0.5 * n.norm()
        })
        .sum();
    assert_eq!(area, 16.0);
}

#[test]
fn bad_sizes_are_named() {
    let bad = |shape: Shape, tolerance: f64| match tessellate(&shape, tolerance) {
        Err(DetectError::Parameter { parameter, .. }) => parameter,
        other => panic!("expected an error, got {other:?}"),
    };
    assert_eq!(bad(Shape::Sphere { radius: -1.0 }, 1e-3), "radius");
    assert_eq!(bad(Shape::Sphere { radius: 1.0 }, 0.0), "tolerance");
    assert_eq!(bad(Shape::Sphere { radius: 1.0 }, 1e-12), "tolerance");
    assert_eq!(bad(Shape::Capsule { radius: 1.0, half_height: f64::NAN }, 1e-3), "half_height");
    assert_eq!(bad(Shape::Capsule { radius: 1.0, half_height: 1.0 }, 1e-12), "tolerance");
    assert_eq!(bad(Shape::Box { half_extents: [1.0, 0.0, 1.0] }, 1e-3), "half_extents.y");
    assert_eq!(bad(Shape::Plane { half_size: f64::INFINITY }, 1e-3), "half_size");
    assert_eq!(bad(Shape::Cone { radius: 1.0, height: -0.5 }, 1e-3), "height");
}
