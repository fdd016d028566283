//! What follows from the triangles alone: edges, hinges, adjacency, boundary.

use crate::{MeshError, NONE, VertexTriangles};

/// How many triangles an error about an edge lists.
const MAX_NAMED_TRIANGLES: usize = 8;

/// Two triangles that share an edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Hinge {
    /// Vertices of the shared edge, in the order in which the first triangle walks it.
    pub edge: [u32; 2],
    /// The vertex opposite the edge in the first and in the second triangle.
    pub opposite: [u32; 2],
    /// The two triangles.
    pub triangles: [u32; 2],
}

/// Connectivity of a triangle mesh. Edges are sorted by (lower vertex, higher vertex), so equal triangles give equal
/// topologies.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Topology {
    /// Number of vertices.
    pub vertex_count: usize,
    /// Edges as (lower, higher) vertex, sorted.
    pub edges: Vec<[u32; 2]>,
    /// Edge of each triangle's sides (01, 12, 20).
    pub triangle_edges: Vec<[u32; 3]>,
    /// First two triangles of each edge; [`NONE`] where there is none.
    pub edge_triangles: Vec<[u32; 2]>,
    /// Edges with exactly two triangles, in edge order.
    pub hinges: Vec<Hinge>,
    /// Edges with exactly one triangle, in edge order.
    pub boundary_edges: Vec<u32>,
    /// Edges with more than two triangles, in edge order, with the number of triangles.
    pub non_manifold_edges: Vec<(u32, u32)>,
    /// The triangles at each vertex.
    pub vertex_triangles: VertexTriangles,
}

impl Topology {
    /// Connectivity of `triangles` over `vertex_count` vertices. Indices must be in range ([`crate::TriMesh::check`]).
    pub fn new(vertex_count: usize, triangles: &[[u32; 3]]) -> Self {
        let sides = sorted_sides(vertex_count, triangles);
        let mut topology =
            Self { vertex_count, triangle_edges: vec![[NONE; 3]; triangles.len()], ..Self::default() };
        for run in sides.chunk_by(|p, q| (p.0, p.1) == (q.0, q.1)) {
            let edge = topology.edges.len() as u32;
            topology.edges.push([run[0].0, run[0].1]);
            for &(_, _, t, side) in run {
                topology.triangle_edges[t as usize][side as usize] = edge;
            }
            topology.edge_triangles.push([run[0].2, run.get(1).map_or(NONE, |s| s.2)]);
            match run {
                [_] => topology.boundary_edges.push(edge),
                &[(_, _, t0, s0), (_, _, t1, s1)] => {
                    let (first, second) = (triangles[t0 as usize], triangles[t1 as usize]);
                    let (s0, s1) = (s0 as usize, s1 as usize);
                    topology.hinges.push(Hinge {
                        edge: [first[s0], first[(s0 + 1) % 3]],
                        opposite: [first[(s0 + 2) % 3], second[(s1 + 2) % 3]],
                        triangles: [t0, t1],
                    });
                }
                _ => topology.non_manifold_edges.push((edge, run.len() as u32)),
            }
        }

        topology.vertex_triangles = VertexTriangles::new(vertex_count, triangles);
        topology
    }

    /// Triangles that use `vertex`, ascending.
    pub fn vertex_triangles(&self, vertex: u32) -> &[u32] {
        self.vertex_triangles.of(vertex)
    }

    /// Whether every edge has exactly two triangles, i.e. the surface has no boundary.
    pub fn is_closed(&self) -> bool {
        self.boundary_edges.is_empty() && self.non_manifold_edges.is_empty() && !self.edges.is_empty()
    }

    /// Whether the two triangles of every hinge walk their edge in opposite directions, i.e. one side is the front
    /// everywhere. `triangles` are those the topology was made of.
    pub fn is_oriented(&self, triangles: &[[u32; 3]]) -> bool {
        self.hinges.iter().all(|hinge| {
            let second = triangles[hinge.triangles[1] as usize];
            (0..3).any(|k| [second[(k + 1) % 3], second[k]] == hinge.edge)
        })
    }

    /// Refuses what bending is not defined on: an edge with more than two triangles, or two triangles with the same
    /// three vertices.
    ///
    /// # Errors
    /// [`MeshError::NonManifoldEdge`] with the first such edge and its first eight triangles;
    /// [`MeshError::DuplicateTriangle`] with the first such pair.
    pub fn require_manifold(&self) -> Result<(), MeshError> {
        if let Some(&(edge, count)) = self.non_manifold_edges.first() {
            let [a, b] = self.edges[edge as usize];
            let triangles = self
                .vertex_triangles(a)
                .iter()
                .copied()
                .filter(|&t| self.triangle_edges[t as usize].contains(&edge))
                .take(MAX_NAMED_TRIANGLES)
                .collect();
            return Err(MeshError::NonManifoldEdge { edge: [a, b], count: count as usize, triangles });
        }
        match self.hinges.iter().find(|h| h.opposite[0] == h.opposite[1]) {
            Some(h) => Err(MeshError::DuplicateTriangle {
                triangles: h.triangles,
                vertices: [h.edge[0], h.edge[1], h.opposite[0]],
            }),
            None => Ok(()),
        }
    }
}

/// (lower vertex, higher vertex, triangle, side) of all triangles' sides, sorted: runs of equal vertex pairs are the edges.
///
/// A place for each by its lower vertex, then an order among the few with the same one.
fn sorted_sides(vertex_count: usize, triangles: &[[u32; 3]]) -> Vec<(u32, u32, u32, u8)> {
    let ends = |tri: &[u32; 3], side: usize| {
        let (a, b) = (tri[side], tri[(side + 1) % 3]);
        (a.min(b), a.max(b))
    };
    let mut place = vec![0_u32; vertex_count + 1];
    for tri in triangles {
        for side in 0..3 {
            place[ends(tri, side).0 as usize + 1] += 1;
        }
    }
    for v in 0..vertex_count {
        place[v + 1] += place[v];
    }
    let mut sides = vec![(0, 0, 0, 0); 3 * triangles.len()];
    for (t, tri) in triangles.iter().enumerate() {
        for side in 0..3 {
            let (lower, higher) = ends(tri, side);
            let place = &mut place[lower as usize];
            sides[*place as usize] = (lower, higher, t as u32, side as u8);
            *place += 1;
        }
    }
    for same in sides.chunk_by_mut(|p, q| p.0 == q.0) {
        same.sort_unstable();
    }
    sides
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sides_come_in_order() {
        // A fan of many triangles around vertex 7, walked in both directions.
        let triangles: Vec<[u32; 3]> = (0..40)
            .map(|k| {
                let (a, b) = (8 + k * 17 % 40, 8 + (k * 17 + 1) % 40);
                if k % 2 == 0 { [7, a, b] } else { [b, a, 7] }
            })
            .chain([[0, 1, 2], [2, 1, 3]])
            .collect();
        let sides = sorted_sides(48, &triangles);
        assert!(sides.is_sorted() && sides.len() == 3 * triangles.len());
        for &(lower, higher, t, side) in &sides {
            let tri = triangles[t as usize];
            let (a, b) = (tri[side as usize], tri[(side as usize + 1) % 3]);
            assert_eq!((lower, higher), (a.min(b), a.max(b)));
        }
        assert_eq!(Topology::new(48, &triangles).vertex_triangles(7).len(), 40);
    }

    #[test]
    fn two_triangles_make_one_hinge() {
        let triangles = [[0, 1, 2], [2, 1, 3]];
        let topology = Topology::new(4, &triangles);
        assert_eq!(topology.edges, [[0, 1], [0, 2], [1, 2], [1, 3], [2, 3]]);
        assert_eq!(topology.triangle_edges, [[0, 2, 1], [2, 3, 4]]);
        assert_eq!(topology.hinges, [Hinge { edge: [1, 2], opposite: [0, 3], triangles: [0, 1] }]);
        assert_eq!(topology.boundary_edges, [0, 1, 3, 4]);
        assert_eq!(topology.vertex_triangles(1), [0, 1]);
        assert_eq!(topology.vertex_triangles(3), [1]);
        assert_eq!(topology.require_manifold(), Ok(()));
        assert!(topology.is_oriented(&triangles) && !topology.is_closed());
    }

    #[test]
    fn a_flipped_triangle_is_seen() {
        let triangles = [[0, 1, 2], [1, 2, 3]];
        assert!(!Topology::new(4, &triangles).is_oriented(&triangles));
    }

    #[test]
    fn three_triangles_on_an_edge_are_refused_by_name() {
        let topology = Topology::new(5, &[[0, 1, 2], [1, 0, 3], [0, 1, 4]]);
        assert_eq!(
            topology.require_manifold(),
            Err(MeshError::NonManifoldEdge { edge: [0, 1], count: 3, triangles: vec![0, 1, 2] })
        );
        assert!(!topology.is_closed());
        let error = topology.require_manifold().unwrap_err().to_string();
        assert!(error.contains("edge (0, 1) has 3"), "{error}");
    }

    #[test]
    fn a_triangle_twice_is_refused_by_name() {
        let topology = Topology::new(3, &[[0, 1, 2], [1, 2, 0]]);
        assert!(matches!(
            topology.require_manifold(),
            Err(MeshError::DuplicateTriangle { triangles: [0, 1], .. })
        ));
    }

    #[test]
    fn nothing_at_all() {
        let topology = Topology::new(0, &[]);
        assert!(topology.edges.is_empty() && !topology.is_closed());
        assert_eq!(topology.require_manifold(), Ok(()));
    }
}
