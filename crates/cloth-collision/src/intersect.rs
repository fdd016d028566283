//! Triangles that pass through each other.

use crate::{CollisionMesh, DetectError, Vec3};

/// Pairs of triangles of one mesh that pass through each other, sorted.
///
/// # Errors
/// As [`intersections`] and [`CollisionMesh::single`].
pub fn self_intersections(
    triangles: &[[u32; 3]],
    vertices: &[Vec3],
    pool: &rayon::ThreadPool,
) -> Result<Vec<[u32; 2]>, DetectError> {
    intersections(&CollisionMesh::single(vertices.len(), triangles)?, vertices, pool)
}

/// Pairs of triangles (lower, higher) at `x` \[m\] that pass through each other, under the rules of bodies, sorted.
///
/// # Errors
/// [`DetectError::Length`], [`DetectError::NotFinite`].
pub fn intersections(
    mesh: &CollisionMesh,
    x: &[Vec3],
    _pool: &rayon::ThreadPool,
) -> Result<Vec<[u32; 2]>, DetectError> {
    crate::contact::check_positions("vertices", x, mesh.vertex_count)?;
    let mut out = Vec::new();
    for i in 0..mesh.triangles.len() as u32 {
        for j in i + 1..mesh.triangles.len() as u32 {
            if mesh.triangles_admissible(i, j)
                && triangles_intersect(mesh.triangles[i as usize], mesh.triangles[j as usize], x)
            {
                out.push([i, j]);
            }
        }
    }
    Ok(out)
}

fn triangles_intersect(a: [u32; 3], b: [u32; 3], x: &[Vec3]) -> bool {
    let shared = a.iter().filter(|v| b.contains(v)).count();
    if shared >= 2 {
        return false;
    }
    [(a, b), (b, a)].iter().any(|(e, t)| {
        (0..3).any(|k| {
            let (p, q) = (e[k], e[(k + 1) % 3]);
            !t.contains(&p)
                && !t.contains(&q)
                && edge_meets_triangle(x[p as usize], x[q as usize], t.map(|v| x[v as usize]))
        })
    })
}

fn orient(a: Vec3, b: Vec3, c: Vec3, d: Vec3) -> f64 {
    let coord = |p: Vec3| robust::Coord3D { x: p.x, y: p.y, z: p.z };
    robust::orient3d(coord(a), coord(b), coord(c), coord(d))
}

fn edge_meets_triangle(p: Vec3, q: Vec3, [a, b, c]: [Vec3; 3]) -> bool {
    let (sp, sq) = (orient(a, b, c, p), orient(a, b, c, q));
    if (sp > 0.0 && sq > 0.0) || (sp < 0.0 && sq < 0.0) || (sp == 0.0 && sq == 0.0) {
        return false;
    }
    let s = [orient(p, q, a, b), orient(p, q, b, c), orient(p, q, c, a)];
    s.iter().all(|&v| v >= 0.0) || s.iter().all(|&v| v <= 0.0)
}
