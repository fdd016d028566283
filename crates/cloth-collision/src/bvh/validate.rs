//! Checks of the tree's invariants, for tests.

use super::Bvh;
use super::build::Tree;
use super::refit::Boxes;
use crate::CollisionMesh;
use crate::bounds::LANES;
use cloth_mesh::NONE;

impl Bvh {
    /// Whether the tree holds every triangle, owned vertex and edge once, every block lies below one root once, and,
    /// after a refit, every box holds its children's. O(n), for tests.
    ///
    /// # Errors
    /// The first violation, in words.
    pub fn validate(&self, mesh: &CollisionMesh) -> Result<(), String> {
        let tree = &self.tree;
        let count = |blocks: &[[u32; LANES]], n: usize| {
            let mut seen = vec![0u32; n];
            blocks.iter().flatten().filter(|&&id| id != NONE).for_each(|&id| seen[id as usize] += 1);
            seen
        };
        let seen = count(&tree.triangle_ids, mesh.triangles.len());
        if let Some(t) = seen.iter().position(|&n| n != 1) {
            return Err(format!("triangle {t} is in {} leaves", seen[t]));
        }
        let seen = count(&tree.edge_ids, mesh.edges.len());
        if let Some(e) = seen.iter().position(|&n| n != 1) {
            return Err(format!("edge {e} is in {} leaves", seen[e]));
        }
        let seen = count(&tree.vertex_ids, mesh.vertex_count);
        if let Some(v) = (0..seen.len()).find(|&v| seen[v] != u32::from(mesh.vertex_owner[v] != NONE)) {
            return Err(format!("vertex {v} is in {} leaves", seen[v]));
        }
        self.validate_ranks(mesh)?;
        let mut parents = vec![0u32; tree.block_count()];
        for root in &tree.roots {
            parents[root.block as usize] += 1;
        }
        for (k, inner) in tree.inner.iter().enumerate() {
            let children = inner.first..inner.first + inner.count;
            if inner.count == 0 || children.end as usize > tree.leaves.len() + k {
                return Err(format!("block {} has children {children:?}", tree.leaves.len() + k));
            }
            children.for_each(|child| parents[child as usize] += 1);
        }
        if let Some(b) = parents.iter().position(|&n| n != 1) {
            return Err(format!("block {b} has {} parents", parents[b]));
        }
        self.moving.validate(tree, mesh)?;
        self.still.validate(tree, mesh)
    }
}

impl Bvh {
    /// Whether each place has the ranks of its feature's vertices.
    fn validate_ranks(&self, mesh: &CollisionMesh) -> Result<(), String> {
        let tree = &self.tree;
        let vertex = |rank: u32| tree.vertex_order[rank as usize];
        let ids = |blocks: &[[u32; LANES]]| -> Vec<(usize, usize)> {
            let used = blocks.as_flattened().iter().enumerate().filter(|p| *p.1 != NONE);
            used.map(|(place, &id)| (place, id as usize)).collect()
        };
        for (place, v) in ids(&tree.vertex_ids) {
            if vertex(tree.vertex_ranks.as_flattened()[place]) != v as u32 {
                return Err(format!("rank of vertex {v}"));
            }
        }
        for (place, t) in ids(&tree.triangle_ids) {
            if tree.triangle_ranks[place].map(vertex) != mesh.triangles[t] {
                return Err(format!("ranks of triangle {t}"));
            }
        }
        for (place, e) in ids(&tree.edge_ids) {
            if tree.edge_ranks[place].map(vertex) != mesh.edges[e] {
                return Err(format!("ranks of edge {e}"));
            }
            if [0, 1].map(|end| tree.edge_ends[place / LANES][end][place % LANES]) != mesh.edges[e] {
                return Err(format!("ends of edge {e}"));
            }
        }
        Ok(())
    }
}

impl<const ENDS: usize> Boxes<ENDS> {
    fn validate(&self, tree: &Tree, mesh: &CollisionMesh) -> Result<(), String> {
        if self.hulls.is_empty() {
            return Ok(());
        }
        for (k, inner) in tree.inner.iter().enumerate() {
            let block = tree.leaves.len() + k;
            for lane in 0..inner.count {
                let child = inner.first + lane;
                let (outer, inside) = (&self.blocks[block].get(lane as usize), &self.hulls[child as usize]);
                if !outer.contains(inside) || !self.hulls[block].contains(outer) {
                    return Err(format!("box of block {child} leaves that of its parent {block}"));
                }
            }
        }
        for (leaf, diagonals) in self.diagonals.iter().enumerate() {
            let vertices = tree.corners[leaf].as_flattened().iter().filter(|&&v| v != NONE);
            if let Some(v) = vertices.clone().find(|&&v| !diagonals.hold(&self.vertices[v as usize])) {
                return Err(format!("vertex {v} leaves the diagonals of leaf {leaf}"));
            }
        }
        for (leaf, ids) in tree.triangle_ids.iter().enumerate() {
            for (lane, &t) in ids.iter().enumerate().filter(|&(_, &t)| t != NONE) {
                let bounds = self.blocks[leaf].get(lane);
                for v in mesh.triangles[t as usize] {
                    if !bounds.contains(&self.vertices[v as usize]) || !self.hulls[leaf].contains(&bounds) {
                        return Err(format!("vertex {v} leaves the box of leaf {leaf}"));
                    }
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use crate::{Bvh, CollisionMesh, Vec3};

    fn strip(n: u32) -> (CollisionMesh, Vec<Vec3>) {
        let triangles: Vec<[u32; 3]> = (0..n).map(|k| [k, k + 1, k + 2]).collect();
        let x: Vec<Vec3> =
            (0..n + 2).map(|k| Vec3::new(f64::from(k), f64::from(k % 2), f64::from(k * k % 7))).collect();
        (CollisionMesh::single(x.len(), &triangles).unwrap(), x)
    }

    #[test]
    fn trees_of_all_small_sizes_are_valid_before_and_after_a_refit() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        for n in 0..100 {
            let (mesh, x) = strip(n);
            let mut bvh = Bvh::new(&mesh, &x).unwrap();
            bvh.validate(&mesh).unwrap();
            bvh.intersections(&mesh, &x, &pool).unwrap();
            bvh.validate(&mesh).unwrap();
        }
    }

    #[test]
    fn planted_faults_are_found() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let (mesh, x) = strip(200);
        let mut good = Bvh::new(&mesh, &x).unwrap();
        good.intersections(&mesh, &x, &pool).unwrap();
        let fault = |plant: &dyn Fn(&mut Bvh)| {
            let mut bad = good.clone();
            plant(&mut bad);
            bad.validate(&mesh).expect_err("a fault was planted")
        };
        assert!(fault(&|b| b.tree.triangle_ids[0][0] = b.tree.triangle_ids[1][0]).contains("triangle"));
        assert!(fault(&|b| b.tree.edge_ids[0][0] = cloth_mesh::NONE).contains("edge"));
        assert!(fault(&|b| b.tree.vertex_ids[0][0] = cloth_mesh::NONE).contains("vertex"));
        assert!(fault(&|b| b.tree.vertex_order.swap(0, 1)).contains("rank of vertex"));
        assert!(fault(&|b| b.tree.edge_ranks.swap(0, 1)).contains("ranks of edge"));
        assert!(fault(&|b| b.tree.edge_ends[1][0].swap(2, 3)).contains("ends of edge"));
        assert!(fault(&|b| b.tree.triangle_ranks.swap(0, 1)).contains("ranks of triangle"));
        assert!(fault(&|b| b.tree.inner[0].first += 1).contains("parents"));
        assert!(fault(&|b| b.tree.inner[0].count = 0).contains("children"));
        assert!(fault(&|b| b.still.hulls[1].hi[0][0] += 1e6).contains("box"));
        assert!(fault(&|b| b.still.vertices[7].lo[0][2] -= 1e6).contains("vertex 7"));
    }
}
