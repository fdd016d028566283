//! Parts of a surface that are on the wrong side of another, and their way back.

use super::{Moves, crossings::Crossing};
use crate::Vec3;
use cloth_collision::{CollisionMesh, distance::vertex_triangle};
use std::collections::BTreeMap;

/// A part of a surface that crossed edges separate from the larger rest.
pub(super) struct Region {
    vertices: Vec<u32>,
    /// Crossings of the edges that lead out of it, and the sign of their triangle's normal that points to the right side.
    cuts: Vec<(Crossing, f64)>,
}

impl Region {
    /// Whether the crossing goes once the region is back.
    pub(super) fn explains(&self, mesh: &CollisionMesh, crossing: &Crossing) -> bool {
        let has = |v: &u32| self.vertices.binary_search(v).is_ok();
        crossing.edge.iter().any(has) || mesh.triangles[crossing.triangle as usize].iter().any(has)
    }
}

/// Sets of vertices that hang together.
struct Sets(Vec<u32>);

impl Sets {
    fn new(count: usize) -> Self {
        Self((0..count as u32).collect())
    }

    fn root(&mut self, mut v: u32) -> u32 {
        while self.0[v as usize] != v {
            self.0[v as usize] = self.0[self.0[v as usize] as usize];
            v = self.0[v as usize];
        }
        v
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}

/// The regions that the crossings make.
pub(super) fn find(mesh: &CollisionMesh, x: &[Vec3], crossings: &[Crossing]) -> Vec<Region> {
    // An edge that passes an even number of times through a body ends on the side on which it began.
    let body = |c: &Crossing| mesh.vertex_body[mesh.triangles[c.triangle as usize][0] as usize];
    let mut passes: BTreeMap<[u32; 2], BTreeMap<u32, u32>> = BTreeMap::new();
    for c in crossings {
        *passes.entry(c.edge).or_default().entry(body(c)).or_default() += 1;
    }
    let cut = |edge: &[u32; 2]| passes.get(edge).is_some_and(|p| p.values().any(|n| n % 2 == 1));
    let (mut surface, mut part) = (Sets::new(x.len()), Sets::new(x.len()));
    for edge in &mesh.edges {
        surface.join(edge[0], edge[1]);
        if !cut(edge) {
            part.join(edge[0], edge[1]);
        }
    }
    let mut parts: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for v in 0..x.len() as u32 {
        parts.entry(part.root(v)).or_default().push(v);
    }
    // Of each surface the largest part is where it should be; the first of equal ones.
    let mut largest: BTreeMap<u32, (usize, u32)> = BTreeMap::new();
    for (&root, vertices) in &parts {
        let entry = largest.entry(surface.root(root)).or_insert((0, root));
        if vertices.len() > entry.0 {
            *entry = (vertices.len(), root);
        }
    }
    let mut regions = Vec::new();
    for (&root, vertices) in &parts {
        if largest[&surface.root(root)].1 == root {
            continue;
        }
        let cuts: Vec<(Crossing, f64)> = crossings
            .iter()
            .filter_map(|c| {
                let inside = c.edge.map(|v| part.root(v) == root);
                let out = match inside {
                    [true, false] => c.edge[1],
                    [false, true] => c.edge[0],
                    _ => return None,
                };
                let [a, ..] = mesh.triangles[c.triangle as usize];
                Some((*c, (x[out as usize] - x[a as usize]).dot(&c.normal).signum()))
            })
            .collect();
        regions.push(Region { vertices: vertices.clone(), cuts });
    }
    regions
}

/// Moves each vertex of a region back through the surface, to the gap beyond.
pub(super) fn leave(mesh: &CollisionMesh, x: &[Vec3], region: &Region, gap: f64, moves: &mut Moves<'_>) {
    let at = |v: u32| x[v as usize];
    for &v in &region.vertices {
        let p = at(v);
        let distance = |c: &Crossing| {
            let [a, b, d] = mesh.triangles[c.triangle as usize].map(at);
            let w = vertex_triangle::closest_point(&[p, a, b, d]);
            ((p - a) * w[0] + (p - b) * w[1] + (p - d) * w[2]).norm_squared()
        };
        let Some((start, side)) = region.cuts.iter().min_by(|a, b| distance(&a.0).total_cmp(&distance(&b.0)))
        else {
            continue;
        };
        let near = mesh.nearest(start.triangle, &p, at, v);
        let corners = mesh.triangles[near.triangle as usize];
        let [a, b, c] = corners.map(at);
        let Some(n) = (b - a).cross(&(c - a)).try_normalize(0.0) else { continue };
        let out = n * *side;
        let height = near.r.dot(&out);
        if height >= gap {
            continue;
        }
        // Past a border or a sharp edge the way back is not along the normal.
        let way = if height < 0.0 { (-near.r).try_normalize(1e-3 * gap).unwrap_or(out) } else { out };
        let shift = if height < 0.0 { way * gap - near.r } else { out * (gap - height) };
        let weights = [0, 1, 2].map(|k| (corners[k], near.weights[k]));
        moves.relative(&[(v, 1.0)], &weights, shift);
    }
}
