//! The scene's collision topology: all bodies in one vertex array, features, their owners and the rules for pairs.

use crate::DetectError;
use crate::edges::{Edges, edges};
use cloth_mesh::{NONE, VertexTriangles};

/// What a body is to contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Body {
    /// It moves by forces (cloth). Two bodies of which neither is dynamic are not tested against each other.
    pub dynamic: bool,
    /// Its features are tested against each other.
    pub self_collision: bool,
}

/// Scene-wide collision topology, built once.
///
/// A pair of features is *admissible* if it shares no vertex; if both are of one body, that body has
/// `self_collision`; if they are of different bodies, one of these is dynamic; no feature has a vertex attached
/// to the other's body; and none has a vertex sewn to one of the other's. A vertex in no triangle is no part of a surface and meets nothing.
#[derive(Debug, Clone, PartialEq)]
pub struct CollisionMesh {
    /// Number of vertices of all bodies.
    pub vertex_count: usize,
    /// Triangles of all bodies, global vertex indices.
    pub triangles: Vec<[u32; 3]>,
    /// Edges as (lower, higher) vertex, sorted.
    pub edges: Vec<[u32; 2]>,
    /// Edge of each triangle's sides (01, 12, 20).
    pub triangle_edges: Vec<[u32; 3]>,
    /// Body of each vertex.
    pub vertex_body: Vec<u32>,
    /// The bodies, in vertex order.
    pub bodies: Vec<Body>,
    /// Body to which each vertex is attached, or [`NONE`].
    pub attached_to: Vec<u32>,
    /// Group of vertices that are sewn together to which each belongs, or [`NONE`]; empty where nothing is sewn.
    pub sewn: Vec<u32>,
    /// R-triangle assignment: the triangle that tests each vertex for all ([`NONE`]: the vertex is in no triangle).
    pub vertex_owner: Vec<u32>,
    /// R-triangle assignment: the triangle that tests each edge for all.
    pub edge_owner: Vec<u32>,
    /// The triangles at each vertex.
    pub vertex_triangles: VertexTriangles,
    has_attachments: bool,
}

impl CollisionMesh {
    /// One dynamic, self-colliding body.
    ///
    /// # Errors
    /// As [`CollisionMesh::new`].
    pub fn single(vertex_count: usize, triangles: &[[u32; 3]]) -> Result<Self, DetectError> {
        Self::new(&[(Body { dynamic: true, self_collision: true }, vertex_count, triangles)])
    }

    /// [`CollisionMesh::single`] on a pool: the same mesh for any number of threads.
    ///
    /// # Errors
    /// As [`CollisionMesh::new`].
    pub fn single_in(
        vertex_count: usize,
        triangles: &[[u32; 3]],
        pool: &rayon::ThreadPool,
    ) -> Result<Self, DetectError> {
        let mut mesh = Self::surface(vertex_count, triangles)?;
        mesh.find_features(Some(pool));
        Ok(mesh)
    }

    /// The given bodies, each with its vertex count and triangles (body-local indices), concatenated in order.
    ///
    /// # Errors
    /// [`DetectError::IndexOutOfRange`], [`DetectError::RepeatedVertex`], [`DetectError::TooLarge`].
    pub fn new(bodies: &[(Body, usize, &[[u32; 3]])]) -> Result<Self, DetectError> {
        Self::assemble(bodies, true)
    }

    /// [`CollisionMesh::single`] without edges and owners: enough to pair triangles.
    pub(crate) fn surface(vertex_count: usize, triangles: &[[u32; 3]]) -> Result<Self, DetectError> {
        Self::assemble(&[(Body { dynamic: true, self_collision: true }, vertex_count, triangles)], false)
    }

    fn assemble(bodies: &[(Body, usize, &[[u32; 3]])], with_features: bool) -> Result<Self, DetectError> {
        let limit = NONE as usize;
        let vertex_count: usize = bodies.iter().map(|b| b.1).sum();
        let triangle_count: usize = bodies.iter().map(|b| b.2.len()).sum();
        for (what, got) in [("vertices", vertex_count), ("triangle sides", 3 * triangle_count)] {
            if got >= limit {
                return Err(DetectError::TooLarge { what, limit, got });
            }
        }
        let mut triangles = Vec::with_capacity(triangle_count);
        let mut vertex_body = Vec::with_capacity(vertex_count);
        for (b, (_, count, list)) in bodies.iter().enumerate() {
            let first = vertex_body.len() as u32;
            for (t, &tri) in list.iter().enumerate() {
                if let Some(&index) = tri.iter().find(|&&v| v as usize >= *count) {
                    return Err(DetectError::IndexOutOfRange {
                        body: b,
                        triangle: t,
                        index,
                        vertex_count: *count,
                    });
                }
                if tri[0] == tri[1] || tri[1] == tri[2] || tri[2] == tri[0] {
                    return Err(DetectError::RepeatedVertex { body: b, triangle: t, vertices: tri });
                }
                triangles.push(tri.map(|v| v + first));
            }
            vertex_body.resize(vertex_body.len() + count, b as u32);
        }
        let mut mesh = Self {
            vertex_count,
            triangles,
            edges: vec![],
            triangle_edges: vec![],
            vertex_body,
            bodies: bodies.iter().map(|b| b.0).collect(),
            attached_to: vec![NONE; vertex_count],
            sewn: vec![],
            vertex_owner: vec![],
            edge_owner: vec![],
            vertex_triangles: VertexTriangles::default(),
            has_attachments: false,
        };
        if with_features {
            mesh.find_features(None);
        }
        Ok(mesh)
    }

    fn find_features(&mut self, pool: Option<&rayon::ThreadPool>) {
        let (vertex_count, triangles) = (self.vertex_count, &self.triangles[..]);
        let of_vertices = || {
            let around = VertexTriangles::new(vertex_count, triangles);
            let owners = (0..vertex_count as u32).map(|v| around.of(v).first().copied().unwrap_or(NONE));
            (owners.collect(), around)
        };
        let of_edges = || edges(vertex_count, triangles, pool);
        let (of_vertices, of_edges) = match pool {
            Some(pool) => pool.join(of_vertices, of_edges),
            None => (of_vertices(), of_edges()),
        };
        (self.vertex_owner, self.vertex_triangles) = of_vertices;
        Edges { list: self.edges, first_triangle: self.edge_owner, of_triangle: self.triangle_edges } =
            of_edges;
    }

    /// Declares that `vertex` is held by `body`: features with this vertex are not tested against that body.
    ///
    /// # Panics
    /// If there is no such vertex or body.
    pub fn set_attachment(&mut self, vertex: u32, body: u32) {
        assert!((body as usize) < self.bodies.len(), "no body {body}");
        self.attached_to[vertex as usize] = body;
        self.has_attachments = true;
    }

    /// Declares pairs of vertices that are sewn together: to contact they are as one vertex, so that features that have one
    /// of each are not tested against each other. What is sewn to the same vertex is sewn together.
    ///
    /// # Panics
    /// If there is no such vertex.
    pub fn sew(&mut self, pairs: &[[u32; 2]]) {
        if pairs.is_empty() {
            return;
        }
        // Disjoint sets; the lowest vertex of each stands for it.
        let mut leader: Vec<u32> = (0..self.vertex_count as u32).collect();
        let find = |leader: &[u32], mut v: u32| {
            while leader[v as usize] != v {
                v = leader[v as usize];
            }
            v
        };
        for &[a, b] in pairs {
            let (a, b) = (find(&leader, a), find(&leader, b));
            leader[a.max(b) as usize] = a.min(b);
        }
        self.sewn = vec![NONE; self.vertex_count];
        for v in pairs.iter().flatten() {
            self.sewn[*v as usize] = find(&leader, *v);
        }
    }

    /// Whether features of these two bodies may be in contact at all.
    pub fn bodies_meet(&self, a: u32, b: u32) -> bool {
        let (first, second) = (self.bodies[a as usize], self.bodies[b as usize]);
        if a == b { first.self_collision } else { first.dynamic || second.dynamic }
    }

    /// Whether the pair is admissible (see [`CollisionMesh`]).
    pub fn vertex_triangle_admissible(&self, vertex: u32, triangle: u32) -> bool {
        self.admissible(&[vertex], &self.triangles[triangle as usize])
    }

    /// Whether the pair is admissible (see [`CollisionMesh`]).
    pub fn edge_edge_admissible(&self, a: u32, b: u32) -> bool {
        self.admissible(&self.edges[a as usize], &self.edges[b as usize])
    }

    #[inline]
    fn admissible(&self, first: &[u32], second: &[u32]) -> bool {
        if first.iter().any(|v| second.contains(v)) {
            return false;
        }
        self.rules_allow(first, second)
    }

    /// The rules of bodies and attachments, without the shared-vertex rule.
    #[inline]
    pub(crate) fn rules_allow(&self, first: &[u32], second: &[u32]) -> bool {
        let (a, b) = (self.vertex_body[first[0] as usize], self.vertex_body[second[0] as usize]);
        if !self.bodies_meet(a, b) {
            return false;
        }
        !self.is_attached(first, second)
    }

    pub(crate) fn has_attachments(&self) -> bool {
        self.has_attachments || !self.sewn.is_empty()
    }

    /// Whether a vertex of one feature is attached to the other's body, or sewn to a vertex of the other.
    #[inline]
    pub(crate) fn is_attached(&self, first: &[u32], second: &[u32]) -> bool {
        if !self.sewn.is_empty() && self.is_sewn(first, second) {
            return true;
        }
        if !self.has_attachments {
            return false;
        }
        let (a, b) = (self.vertex_body[first[0] as usize], self.vertex_body[second[0] as usize]);
        first.iter().any(|&v| self.attached_to[v as usize] == b)
            || second.iter().any(|&v| self.attached_to[v as usize] == a)
    }

    fn is_sewn(&self, first: &[u32], second: &[u32]) -> bool {
        let group = |v: u32| self.sewn[v as usize];
        let to = |v: u32, w: u32| v != w && group(v) == group(w);
        first.iter().any(|&v| group(v) != NONE && second.iter().any(|&w| to(v, w)))
    }
}
