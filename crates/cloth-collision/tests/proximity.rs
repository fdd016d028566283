//! Pairs within a distance: complete, right, once each.
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

mod support;

use cloth_collision::distance::{edge_edge, vertex_triangle};
use cloth_collision::mesh::NONE;
use cloth_collision::{
    Bvh, CollisionMesh, DetectError, Stencil, StencilKind, Vec3, stencil_at_contact_edge_edge,
    stencil_at_contact_vertex_triangle,
};
use std::collections::BTreeSet;
use support::{Random, bodies, pool, sheet, soup};

/// Rounding at sizes of about 1.
const ROUNDING: f64 = 1e-12;

fn check(stencil: &Stencil, x: &[Vec3], thickness: f64) {
    let w = stencil.weights;
    assert!(w.iter().sum::<f64>().abs() < ROUNDING, "weights {w:?} do not sum to zero");
    let r: Vec3 = (0..4).map(|k| x[stencil.vertices[k] as usize] * w[k]).sum();
    assert!((r.norm() - stencil.distance).abs() < ROUNDING);
    assert!(stencil.distance <= thickness);
    assert!((stencil.normal.norm() - 1.0).abs() < ROUNDING);
    assert!(
        (r - stencil.normal * stencil.distance).norm() < 1e-9,
        "normal {:?} is not along {r:?}",
        stencil.normal
    );
    match stencil.kind {
        StencilKind::VertexTriangle => {
            assert!(w[0] == 1.0 && w[1..].iter().all(|&w| (-1.0..=0.0).contains(&w)));
        }
        StencilKind::EdgeEdge => assert!(w[0] >= 0.0 && w[1] >= 0.0 && w[2] <= 0.0 && w[3] <= 0.0),
    }
}

/// Every admissible pair within the thickness: (vertex, closest feature of the triangle) and edge pairs, inner points.
fn every_pair(mesh: &CollisionMesh, x: &[Vec3], thickness: f64) -> (BTreeSet<Vec<u32>>, BTreeSet<[u32; 2]>) {
    let (mut vertices, mut edges) = (BTreeSet::new(), BTreeSet::new());
    for v in (0..mesh.vertex_count as u32).filter(|&v| mesh.vertex_owner[v as usize] != NONE) {
        for t in 0..mesh.triangles.len() as u32 {
            let [a, b, c] = mesh.triangles[t as usize];
            let p = [v, a, b, c].map(|k| x[k as usize]);
            let w = vertex_triangle::closest_point(&p);
            let distance = (p[0] - p[1] * w[0] - p[2] * w[1] - p[3] * w[2]).norm();
            if distance <= thickness && mesh.vertex_triangle_admissible(v, t) {
                let mut feature: Vec<u32> =
                    [a, b, c].into_iter().zip(w).filter(|f| f.1 != 0.0).map(|f| f.0).collect();
                feature.sort_unstable();
                if let [other] = feature[..] {
                    vertices.insert(vec![v.min(other), v.max(other)]);
                } else {
                    feature.insert(0, v);
                    vertices.insert(feature);
                }
            }
        }
    }
    for i in 0..mesh.edges.len() as u32 {
        for j in i + 1..mesh.edges.len() as u32 {
            let ([a0, a1], [b0, b1]) = (mesh.edges[i as usize], mesh.edges[j as usize]);
            let p = [a0, a1, b0, b1].map(|k| x[k as usize]);
            let (s, t) = edge_edge::closest_points(&p);
            let distance = (p[0] * (1.0 - s) + p[1] * s - p[2] * (1.0 - t) - p[3] * t).norm();
            let inner = s > 0.0 && s < 1.0 && t > 0.0 && t < 1.0;
            if inner && distance <= thickness && mesh.edge_edge_admissible(i, j) {
                edges.insert([i, j]);
            }
        }
    }
    (vertices, edges)
}

fn compare(mesh: &CollisionMesh, x: &[Vec3], thickness: f64) -> usize {
    let mut bvh = Bvh::new(mesh, x).unwrap();
    let found = bvh.proximity(mesh, x, thickness, None, &pool(1)).unwrap();
    assert_eq!(found, bvh.proximity(mesh, x, thickness, None, &pool(2)).unwrap(), "two threads");
    let (mut vertices, mut edges) = (vec![], vec![]);
    for stencil in &found {
        check(stencil, x, thickness);
        let [v, a, b, c] = stencil.vertices;
        match stencil.kind {
            StencilKind::VertexTriangle => {
                let mut feature: Vec<u32> = [a, b, c]
                    .into_iter()
                    .zip(&stencil.weights[1..])
                    .filter(|f| *f.1 != 0.0)
                    .map(|f| f.0)
                    .collect();
                feature.sort_unstable();
                if let [other] = feature[..] {
                    vertices.push(vec![v.min(other), v.max(other)]);
                } else {
                    feature.insert(0, v);
                    vertices.push(feature);
                }
            }
            StencilKind::EdgeEdge => {
                let find = |e: [u32; 2]| mesh.edges.binary_search(&e).unwrap() as u32;
                edges.push([find([v, a]), find([b, c])]);
            }
        }
    }
    let (expected_vertices, expected_edges) = every_pair(mesh, x, thickness);
    assert_eq!(vertices.len(), expected_vertices.len(), "each once");
    assert_eq!(vertices.into_iter().collect::<BTreeSet<_>>(), expected_vertices);
    assert!(edges.is_sorted(), "sorted");
    assert_eq!(edges.into_iter().collect::<BTreeSet<_>>(), expected_edges);
    found.len()
}

#[test]
fn random_scenes_agree_with_every_pair() {
    let mut total = 0;
    for seed in 0..6 {
        let mut random = Random(seed);
        for thickness in [0.0, 0.01, 0.1] {
            let (x, triangles) = soup(50, 0.2, &mut random);
            total += compare(&CollisionMesh::single(x.len(), &triangles).unwrap(), &x, thickness);
            let (mesh, x) = bodies(&mut random);
            total += compare(&mesh, &x, thickness);
        }
    }
    assert!(total > 1000, "the scenes must hold pairs, found {total}");
}

#[test]
fn two_layers_are_seen_in_all_regions() {
    // A grid over itself, shifted: vertices over faces, over sides and over vertices; sides across sides.
    let mut random = Random(2);
    let (mut x, triangles) = sheet(6, &mut random);
    for p in &mut x {
        p.y = 0.0;
    }
    for shift in [[0.0, 0.0], [0.1, 0.0], [0.05, 0.03]] {
        let second: Vec<Vec3> = x.iter().map(|p| p + Vec3::new(shift[0], 0.01, shift[1])).collect();
        let both: Vec<Vec3> = x.iter().chain(&second).copied().collect();
        let n = x.len() as u32;
        let all: Vec<[u32; 3]> =
            triangles.iter().copied().chain(triangles.iter().map(|t| t.map(|v| v + n))).collect();
        let mesh = CollisionMesh::single(both.len(), &all).unwrap();
        assert!(compare(&mesh, &both, 0.011) >= 16, "shift {shift:?}");
    }
}

#[test]
fn only_active_pairs() {
    let mut random = Random(3);
    let (x, triangles) = soup(40, 0.3, &mut random);
    let mesh = CollisionMesh::single(x.len(), &triangles).unwrap();
    let mask: Vec<bool> = (0..x.len()).map(|v| v % 7 == 0).collect();
    let mut bvh = Bvh::new(&mesh, &x).unwrap();
    let all = bvh.proximity(&mesh, &x, 0.05, None, &pool(1)).unwrap();
    let some = bvh.proximity(&mesh, &x, 0.05, Some(&mask), &pool(1)).unwrap();
    let inner =
        |s: &&Stencil| s.kind == StencilKind::EdgeEdge && s.vertices.iter().any(|&v| mask[v as usize]);
    assert_eq!(some.iter().filter(inner).collect::<Vec<_>>(), all.iter().filter(inner).collect::<Vec<_>>());
    assert!(some.iter().all(|s| s.vertices.iter().any(|&v| mask[v as usize])));
    assert!(some.len() < all.len() && !some.is_empty());
}

#[test]
fn stencils_at_contact_point_to_where_the_vertex_came_from() {
    let mesh = CollisionMesh::single(4, &[[1, 2, 3], [0, 1, 2]]).unwrap();
    let triangle = [Vec3::zeros(), Vec3::new(4.0, 0.0, 0.0), Vec3::new(0.0, 0.0, 4.0)];
    for (from, normal) in [
        (Vec3::new(1.0, 1.0, 1.0), Vec3::y()),
        (Vec3::new(1.0, -1.0, 1.0), -Vec3::y()),
        // In the plane, into the side x = 0.
        (Vec3::new(-1.0, 0.0, 1.0), -Vec3::x()),
    ] {
        let to = Vec3::new(1.0, 0.0, 1.0) * 2.0 - from;
        let x_t0 = [from, triangle[0], triangle[1], triangle[2]];
        let x_t1 = [to, triangle[0], triangle[1], triangle[2]];
        let p = [x_t0[0], x_t0[1], x_t0[2], x_t0[3], x_t1[0], x_t1[1], x_t1[2], x_t1[3]];
        let time = cloth_collision::vertex_triangle_ccd(&p, 0.0).unwrap();
        let stencil = stencil_at_contact_vertex_triangle(&mesh, [0, 0], time, &x_t0, &x_t1);
        assert!((stencil.normal - normal).norm() < 1e-6, "from {from:?}: {:?}", stencil.normal);
        assert!(stencil.distance < 1e-6 && stencil.weights.iter().sum::<f64>().abs() < ROUNDING);
    }
    // Touching all the way: the plane's normal, against the motion.
    let x_t0 = [Vec3::new(1.0, 0.0, 1.0), triangle[0], triangle[1], triangle[2]];
    let mut x_t1 = x_t0;
    x_t1[0].y = -1.0;
    let stencil = stencil_at_contact_vertex_triangle(&mesh, [0, 0], 0.0, &x_t0, &x_t1);
    assert!((stencil.normal - Vec3::y()).norm() < 1e-12);
}

#[test]
fn stencils_at_contact_of_edges() {
    let mesh = CollisionMesh::single(6, &[[0, 1, 2], [3, 4, 5]]).unwrap();
    let mut x_t0 = vec![
        Vec3::new(-1.0, 0.0, 0.0),
        Vec3::new(1.0, 0.0, 0.0),
        Vec3::new(0.0, -5.0, 0.0),
        Vec3::new(0.25, 1.0, -1.0),
        Vec3::new(0.25, 1.0, 1.0),
        Vec3::new(0.25, 5.0, 0.0),
    ];
    let edge = |e: [u32; 2]| mesh.edges.binary_search(&e).unwrap() as u32;
    let pair = [edge([0, 1]), edge([3, 4])];
    for side in [1.0, -1.0] {
        x_t0[3].y = side;
        x_t0[4].y = side;
        let mut x_t1 = x_t0.clone();
        x_t1[3].y = -side;
        x_t1[4].y = -side;
        let stencil = stencil_at_contact_edge_edge(&mesh, pair, 0.5, &x_t0, &x_t1);
        assert!((stencil.normal - Vec3::new(0.0, -side, 0.0)).norm() < 1e-9, "{:?}", stencil.normal);
        assert!((stencil.weights[1] - 0.625).abs() < 1e-12 && (stencil.weights[3] + 0.5).abs() < 1e-12);
    }
}

#[test]
fn bad_input_is_named() {
    let x = vec![Vec3::zeros(), Vec3::x(), Vec3::y()];
    let mesh = CollisionMesh::single(3, &[[0, 1, 2]]).unwrap();
    let mut bvh = Bvh::new(&mesh, &x).unwrap();
    assert!(matches!(
        bvh.proximity(&mesh, &x, -1.0, None, &pool(1)),
        Err(DetectError::Parameter { parameter: "thickness", .. })
    ));
    assert!(matches!(bvh.proximity(&mesh, &x[..1], 0.1, None, &pool(1)), Err(DetectError::Length { .. })));
}

/// A sheet of n × n vertices, flat, waved, or folded over onto itself.
fn shaped(n: usize, kind: usize) -> (CollisionMesh, Vec<Vec3>) {
    let sheet = cloth_collision::mesh::generators::grid(1.0, 1.0, n, n).unwrap();
    let bend = |p: &Vec3| match kind {
        0 => *p,
        1 => Vec3::new(p.x, 0.05 * (9.0 * p.x).sin() * (7.0 * p.z).cos(), p.z),
        _ => {
            let r = 0.02;
            let angle = (p.x.max(0.0) / r).min(std::f64::consts::PI);
            let along = if p.x > 0.0 { r * angle.sin() - (p.x - r * angle) } else { p.x };
            Vec3::new(along, r * (1.0 - angle.cos()), p.z)
        }
    };
    let x = sheet.vertices.iter().map(bend).collect();
    (CollisionMesh::single(n * n, &sheet.triangles).unwrap(), x)
}

#[test]
fn proofs_of_flatness_change_nothing() {
    let pool = pool(2);
    for n in [12, 40] {
        for kind in 0..3 {
            let (mesh, x) = shaped(n, kind);
            // Below the mesh's own distances, among them, and above.
            for thickness in [1e-3, 0.01, 0.05, 0.1] {
                let mut bvh = Bvh::new(&mesh, &x).unwrap();
                let whole = bvh.proximity(&mesh, &x, thickness, None, &pool).unwrap();
                assert_eq!(bvh.flat_triangles(), 0);
                let bytes = bvh.bytes();
                bvh.prove_flatness(true);
                assert_eq!(bvh.proximity(&mesh, &x, thickness, None, &pool).unwrap(), whole);
                let flat = bvh.flat_triangles();
                assert!(bvh.bytes() > bytes);
                let all = mesh.triangles.len() as u64;
                match kind {
                    0 if thickness < 0.5 / n as f64 => assert_eq!(flat, all, "{n} {thickness}"),
                    2 if thickness >= 0.05 => assert!(flat < all && !whole.is_empty(), "{n} {thickness}"),
                    _ => assert!(flat <= all),
                }
                bvh.prove_flatness(false);
                assert_eq!((bvh.bytes(), bvh.flat_triangles()), (bytes, 0));
            }
        }
    }
}
