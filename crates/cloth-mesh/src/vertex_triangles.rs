//! The triangles at each vertex.

/// For each vertex the triangles that use it, ascending.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct VertexTriangles {
    /// Where the list of each vertex begins; one more at the end.
    offsets: Vec<u32>,
    list: Vec<u32>,
}

impl VertexTriangles {
    /// Of `triangles` over `vertex_count` vertices; indices must be in range.
    pub fn new(vertex_count: usize, triangles: &[[u32; 3]]) -> Self {
        let mut offsets = vec![0u32; vertex_count + 1];
        for &v in triangles.iter().flatten() {
            offsets[v as usize + 1] += 1;
        }
        for v in 0..vertex_count {
            offsets[v + 1] += offsets[v];
        }
        let mut next = offsets.clone();
        let mut list = vec![0u32; 3 * triangles.len()];
        for (t, triangle) in triangles.iter().enumerate() {
            for &v in triangle {
                list[next[v as usize] as usize] = t as u32;
                next[v as usize] += 1;
            }
        }
        Self { offsets, list }
    }

    /// Triangles that use `vertex`, ascending.
    #[inline]
    pub fn of(&self, vertex: u32) -> &[u32] {
        let v = vertex as usize;
        &self.list[self.offsets[v] as usize..self.offsets[v + 1] as usize]
    }

    /// Memory [B].
    pub fn bytes(&self) -> usize {
        size_of_val(&self.offsets[..]) + size_of_val(&self.list[..])
    }
}
