use super::{Pairing, Places};
use crate::bounds::LANES;
use crate::bvh::leaf_pair::{self, Candidates};
use crate::{Bvh, CollisionMesh, Query, Vec3};
use cloth_mesh::NONE;

/// Triangles anywhere in a unit cube that share vertices now and then; a last one that reaches to infinity in single
/// precision.
fn soup(count: u32) -> (CollisionMesh, Vec<Vec3>, Vec<Vec3>) {
    let mut state = 7_u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 16) / 65_536.0
    };
    let mut triangles: Vec<[u32; 3]> = (0..count).map(|k| [2 * k, 2 * k + 1, 2 * k + 2]).collect();
    let n = 2 * count + 1;
    triangles.push([n, n + 1, n + 2]);
    let mut x: Vec<Vec3> = vec![];
    for k in 0..n {
        let near = if k % 8 == 0 { Vec3::new(random(), random(), random()) } else { x[k as usize - 1] };
        x.push(near + Vec3::new(random(), random(), random()) * 0.2);
    }
    x.extend([Vec3::repeat(-1e39), Vec3::repeat(1e39), Vec3::new(1e39, -1e39, 0.0)]);
    let moved = x.iter().map(|p| p + Vec3::new(random(), random(), random()) * 0.1).collect();
    (CollisionMesh::single(x.len(), &triangles).unwrap(), x, moved)
}

/// The pairs of all leaves, sorted: as `pairing` finds them by places, and as [`leaf_pair`] finds them by numbers.
fn pairs(bvh: &Bvh, pairing: Pairing) -> [[Vec<[u32; 2]>; 2]; 2] {
    let (tree, boxes) = (&bvh.tree, &bvh.moving);
    let (mut places, mut candidates) = (Places::default(), Candidates::default());
    for a in 0..tree.leaves.len() as u32 {
        for b in a..tree.leaves.len() as u32 {
            // Either leaf may come first.
            let (a, b) = if (a + b) % 3 == 0 { (b, a) } else { (a, b) };
            pairing.features(tree, boxes, a, b, &mut places);
            leaf_pair::features(tree, boxes, a, b, &mut candidates);
        }
    }
    let id = |blocks: &[[u32; LANES]], place: u32| blocks.as_flattened()[place as usize];
    let of = |list: &super::PlacePairs, first: &[[u32; LANES]], second: &[[u32; LANES]]| {
        let mut pairs: Vec<_> =
            (0..list.len()).map(|k| list.get(k)).map(|[p, q]| [id(first, p), id(second, q)]).collect();
        pairs.sort_unstable();
        pairs
    };
    let by_place = [
        of(&places.vertex_triangle, &tree.vertex_ids, &tree.triangle_ids),
        of(&places.edge_edge, &tree.edge_ids, &tree.edge_ids),
    ];
    let is_used = |pair: &[u32; 2]| !pair.contains(&NONE);
    let mut vertex_triangle = candidates.vertex_triangle;
    let mut edge_edge: Vec<_> =
        candidates.edge_edge.iter().map(|&[e, f]| [e.min(f), e.max(f)]).filter(is_used).collect();
    vertex_triangle.retain(is_used);
    vertex_triangle.sort_unstable();
    edge_edge.sort_unstable();
    [by_place, [vertex_triangle, edge_edge]]
}

fn fitted(count: u32) -> Bvh {
    let (mesh, x_t0, x_t1) = soup(count);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let mut bvh = Bvh::new(&mesh, &x_t0).unwrap();
    let query =
        Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.0, mode: crate::Mode::Continuous, active: None };
    bvh.refit_moving(&mesh, &query, &pool);
    bvh
}

#[test]
fn places_name_the_pairs_that_numbers_name() {
    for count in [1, 7, 8, 9, 40, 333] {
        let bvh = fitted(count);
        for pairing in Pairing::there() {
            let [by_place, by_number] = pairs(&bvh, pairing);
            assert!(by_place == by_number, "{pairing:?}, {count} triangles");
            if count == 333 {
                let found = by_place.map(|list| list.len());
                assert!(found[0] > 1000 && found[1] > 3000 && found[1] < 400_000, "{found:?}");
            }
        }
    }
}

#[test]
fn a_box_too_small_is_seen() {
    for pairing in Pairing::there() {
        let mut bvh = fitted(40);
        let [whole, _] = pairs(&bvh, pairing);
        for block in &mut bvh.moving.edge_blocks {
            block.hi[0][1][3] = f32::NEG_INFINITY;
            block.hi[1][1][3] = f32::NEG_INFINITY;
        }
        let [part, same_part] = pairs(&bvh, pairing);
        assert!(part[1].len() < whole[1].len() && part == same_part, "{pairing:?}");
    }
}
