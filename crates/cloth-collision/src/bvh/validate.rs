//! Checks of the tree's invariants, for tests.

use super::Bvh;
use crate::CollisionMesh;
use crate::bounds::LANES;
use cloth_mesh::NONE;

impl Bvh {
    /// Whether the tree holds every triangle, owned vertex and edge once, every node lies below the root once, and,
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
        let mut parents = vec![0u32; tree.nodes.len()];
        for (n, node) in tree.nodes.iter().enumerate() {
            if (node.leaf == NONE) != (node.right != NONE) {
                return Err(format!("node {n} is neither leaf nor inner node"));
            }
            if node.leaf != NONE {
                if tree.leaves[node.leaf as usize].node as usize != n {
                    return Err(format!("leaf {} does not name its node {n}", node.leaf));
                }
                continue;
            }
            for child in [n + 1, node.right as usize] {
                if child <= n || child >= tree.nodes.len() {
                    return Err(format!("node {n} has child {child} out of order"));
                }
                parents[child] += 1;
                if let (Some(outer), Some(inner)) = (self.boxes.nodes.get(n), self.boxes.nodes.get(child))
                    && !outer.contains(inner)
                {
                    return Err(format!("box of node {child} leaves that of its parent {n}"));
                }
            }
        }
        if let Some(n) = (1..parents.len()).find(|&n| parents[n] != 1) {
            return Err(format!("node {n} has {} parents", parents[n]));
        }
        for (leaf, ids) in tree.triangle_ids.iter().enumerate() {
            let Some(bounds) = self.boxes.nodes.get(tree.leaves[leaf].node as usize) else { continue };
            for &v in ids.iter().filter(|&&t| t != NONE).flat_map(|&t| &mesh.triangles[t as usize]) {
                if !bounds.contains(&self.boxes.vertices[v as usize]) {
                    return Err(format!("vertex {v} leaves the box of leaf {leaf}"));
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
        let (mesh, x) = strip(50);
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
        assert!(fault(&|b| b.tree.nodes[0].right += 1).contains("node"));
        assert!(fault(&|b| b.boxes.nodes[1].hi[1][0] += 1e6).contains("box"));
        assert!(fault(&|b| b.boxes.vertices[7].lo[0][2] -= 1e6).contains("vertex 7"));
    }
}
