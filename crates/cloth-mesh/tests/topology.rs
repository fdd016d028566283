//! Topology against definitions applied pair by pair.

use cloth_mesh::{NONE, Topology};
use proptest::prelude::*;

/// Random triangles with three different vertices each, over few vertices so that edges are shared and non-manifold
/// ones occur.
fn triangles() -> impl Strategy<Value = (usize, Vec<[u32; 3]>)> {
    (3usize..12).prop_flat_map(|n| {
        let corner = 0..n as u32;
        let triangle = [corner.clone(), corner.clone(), corner]
            .prop_filter("different", |[a, b, c]| a != b && b != c && c != a);
        (Just(n), proptest::collection::vec(triangle, 0..25))
    })
}

fn shares(t: &[u32; 3], a: u32, b: u32) -> bool {
    t.contains(&a) && t.contains(&b)
}

/// What is wrong with `topology`, by definition.
fn complaint(n: usize, triangles: &[[u32; 3]], topology: &Topology) -> Option<String> {
    let mut edge = 0;
    let (mut hinges, mut boundary, mut non_manifold) = (0, 0, 0);
    for a in 0..n as u32 {
        for b in a + 1..n as u32 {
            let users: Vec<u32> =
                (0..triangles.len() as u32).filter(|&t| shares(&triangles[t as usize], a, b)).collect();
            if users.is_empty() {
                continue;
            }
            if topology.edges.get(edge) != Some(&[a, b]) {
                return Some(format!("edge {edge}: expected ({a}, {b})"));
            }
            let first = [users[0], users.get(1).copied().unwrap_or(NONE)];
            if topology.edge_triangles[edge] != first {
                return Some(format!("edge {edge}: triangles"));
            }
            match users.len() {
                1 => {
                    if topology.boundary_edges.get(boundary) != Some(&(edge as u32)) {
                        return Some(format!("edge {edge}: boundary"));
                    }
                    boundary += 1;
                }
                2 => {
                    let Some(h) = topology.hinges.get(hinges) else {
                        return Some(format!("edge {edge}: no hinge"));
                    };
                    let opposite = users.iter().map(|&t| {
                        *triangles[t as usize]
                            .iter()
                            .find(|v| **v != a && **v != b)
                            .expect("a triangle has a third vertex")
                    });
                    let sorted = [h.edge[0].min(h.edge[1]), h.edge[0].max(h.edge[1])];
                    let first = triangles[users[0] as usize];
                    let walks = (0..3).any(|k| [first[k], first[(k + 1) % 3]] == h.edge);
                    if sorted != [a, b] || !walks || h.triangles != users[..] || !opposite.eq(h.opposite) {
                        return Some(format!("hinge {hinges}: {h:?}"));
                    }
                    hinges += 1;
                }
                count => {
                    if topology.non_manifold_edges.get(non_manifold) != Some(&(edge as u32, count as u32)) {
                        return Some(format!("edge {edge}: non-manifold"));
                    }
                    non_manifold += 1;
                }
            }
            edge += 1;
        }
    }
    if (edge, hinges, boundary, non_manifold)
        != (
            topology.edges.len(),
            topology.hinges.len(),
            topology.boundary_edges.len(),
            topology.non_manifold_edges.len(),
        )
    {
        return Some("counts".into());
    }
    for (t, corners) in triangles.iter().enumerate() {
        for side in 0..3 {
            let (a, b) = (corners[side], corners[(side + 1) % 3]);
            if topology.edges[topology.triangle_edges[t][side] as usize] != [a.min(b), a.max(b)] {
                return Some(format!("triangle {t}: side {side}"));
            }
        }
    }
    for v in 0..n as u32 {
        let users: Vec<u32> =
            (0..triangles.len() as u32).filter(|&t| triangles[t as usize].contains(&v)).collect();
        if topology.vertex_triangles(v) != users {
            return Some(format!("vertex {v}: triangles"));
        }
    }
    None
}

proptest! {
    #[test]
    fn topology_is_what_the_definitions_say((n, triangles) in triangles()) {
        let topology = Topology::new(n, &triangles);
        prop_assert_eq!(complaint(n, &triangles, &topology), None);
        prop_assert_eq!(topology.require_manifold().is_ok(),
            topology.non_manifold_edges.is_empty() && topology.hinges.iter().all(|h| h.opposite[0] != h.opposite[1]));
    }
}

#[test]
fn a_planted_fault_is_found() {
    let triangles = [[0, 1, 2], [2, 1, 3], [3, 1, 4]];
    let good = Topology::new(5, &triangles);
    assert_eq!(complaint(5, &triangles, &good), None);
    let mut bad = good.clone();
    bad.hinges[1].opposite.swap(0, 1);
    assert!(complaint(5, &triangles, &bad).is_some());
    let mut bad = good.clone();
    bad.triangle_edges[0].swap(0, 1);
    assert!(complaint(5, &triangles, &bad).is_some());
    let mut bad = good;
    bad.boundary_edges.pop();
    assert!(complaint(5, &triangles, &bad).is_some());
}
