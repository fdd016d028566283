//! Checks of the tree's invariants, for tests.

use super::Bvh;
use crate::CollisionMesh;
use cloth_mesh::NONE;

impl Bvh {
    /// Whether the tree holds every triangle, owned vertex and edge once, every node lies below the root once, and,
    /// after a refit, every box holds its children's. O(n), for tests.
    ///
    /// # Errors
    /// The first violation, in words.
    pub fn validate(&self, mesh: &CollisionMesh) -> Result<(), String> {
        let tree = &self.tree;
        let count = |blocks: &[[u32; crate::bounds::LANES]], n: usize, what: &str| {
            let mut seen = vec![0u32; n];
            blocks.iter().flatten().filter(|&&id| id != NONE).for_each(|&id| seen[id as usize] += 1);
            Ok::<_, String>((seen, what.to_owned()))
        };
        let (seen, _) = count(&tree.triangle_ids, mesh.triangles.len(), "triangle")?;
        if let Some(t) = seen.iter().position(|&n| n != 1) {
            return Err(format!("triangle {t} is in {} leaves", seen[t]));
        }
        let (seen, _) = count(&tree.edge_ids, mesh.edges.len(), "edge")?;
        if let Some(e) = seen.iter().position(|&n| n != 1) {
            return Err(format!("edge {e} is in {} leaves", seen[e]));
        }
        let (seen, _) = count(&tree.vertex_ids, mesh.vertex_count, "vertex")?;
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
