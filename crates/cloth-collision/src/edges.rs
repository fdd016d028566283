//! The edges of triangles, on a pool where there is one: those of [`cloth_mesh::Topology`], without what else it finds.

use rayon::prelude::*;

/// Vertices or triangles per task; fixed, though nothing here depends on it.
const CHUNK: usize = 4096;

/// Edges and what they have to do with the triangles.
#[derive(Debug, PartialEq)]
pub(crate) struct Edges {
    /// As (lower, higher) vertex, sorted.
    pub(crate) list: Vec<[u32; 2]>,
    /// The first triangle with each.
    pub(crate) first_triangle: Vec<u32>,
    /// Edge of each triangle's sides (01, 12, 20).
    pub(crate) of_triangle: Vec<[u32; 3]>,
}

/// Those of `triangles`, whose indices are below `vertex_count`; three times their number is below 2³².
///
/// The sides get a place by their lower vertex, then an order among the few with the same one.
pub(crate) fn edges(vertex_count: usize, triangles: &[[u32; 3]], pool: Option<&rayon::ThreadPool>) -> Edges {
    let ends = |&[a, b, c]: &[u32; 3]| [[a.min(b), a.max(b)], [b.min(c), b.max(c)], [c.min(a), c.max(a)]];
    let mut places = vec![0_u32; vertex_count + 1];
    for [lower, _] in triangles.iter().flat_map(ends) {
        places[lower as usize + 1] += 1;
    }
    for v in 0..vertex_count {
        places[v + 1] += places[v];
    }
    let starts = places.clone();
    // The higher vertex above the number of the side: three times its triangle plus 0, 1, 2.
    let mut sides = vec![0_u64; 3 * triangles.len()];
    for (side, [lower, higher]) in triangles.iter().flat_map(ends).enumerate() {
        let place = &mut places[lower as usize];
        sides[*place as usize] = u64::from(higher) << 32 | side as u64;
        *place += 1;
    }

    // The sides of a chunk of vertices lie together.
    let mut chunks = Vec::with_capacity(vertex_count / CHUNK + 1);
    let mut rest = &mut sides[..];
    for starts in
        (0..vertex_count).step_by(CHUNK).map(|first| &starts[first..=vertex_count.min(first + CHUNK)])
    {
        let (chunk, after) = rest.split_at_mut((starts[starts.len() - 1] - starts[0]) as usize);
        chunks.push((starts, chunk));
        rest = after;
    }
    let sort = |(starts, mut rest): (&[u32], &mut [u64])| {
        for ends in starts.windows(2) {
            let (of_vertex, after) = rest.split_at_mut((ends[1] - ends[0]) as usize);
            sort_few(of_vertex);
            rest = after;
        }
    };
    match pool {
        Some(pool) => pool.install(|| chunks.into_par_iter().with_max_len(1).for_each(sort)),
        None => chunks.into_iter().for_each(sort),
    }

    let most = sides.len();
    let (mut edges, mut first_triangle) = (Vec::with_capacity(most), Vec::with_capacity(most));
    let mut of_triangle = vec![[0; 3]; triangles.len()];
    let of_side = of_triangle.as_flattened_mut();
    for (v, ends) in starts.windows(2).enumerate() {
        let mut last = u32::MAX;
        for &side in &sides[ends[0] as usize..ends[1] as usize] {
            let (higher, side) = ((side >> 32) as u32, side as u32);
            if higher != last {
                edges.push([v as u32, higher]);
                first_triangle.push(side / 3);
                last = higher;
            }
            of_side[side as usize] = edges.len() as u32 - 1;
        }
    }
    edges.shrink_to_fit();
    first_triangle.shrink_to_fit();
    Edges { list: edges, first_triangle, of_triangle }
}

/// Sorts numbers, of which there are few as a rule.
fn sort_few(list: &mut [u64]) {
    if list.len() > 16 {
        list.sort_unstable();
        return;
    }
    for k in 1..list.len() {
        let (value, mut place) = (list[k], k);
        while place > 0 && list[place - 1] > value {
            list[place] = list[place - 1];
            place -= 1;
        }
        list[place] = value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use cloth_mesh::Topology;

    /// Triangles of random vertices: edges with many triangles, vertices without any, one with very many.
    fn random(vertex_count: u32, count: u32) -> Vec<[u32; 3]> {
        let mut state = 3_u32;
        let mut random = |below: u32| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) % below
        };
        (0..count)
            .map(|k| {
                let a = if k % 3 == 0 { 0 } else { random(vertex_count - 2) };
                let b = a + 1 + random((vertex_count - a - 2).min(9));
                let c = b + 1 + random((vertex_count - b - 1).min(30));
                if k % 2 == 0 { [a, b, c] } else { [c, a, b] }
            })
            .collect()
    }

    fn of_topology(vertex_count: usize, triangles: &[[u32; 3]]) -> Edges {
        let Topology { edges, triangle_edges, edge_triangles, .. } = Topology::new(vertex_count, triangles);
        let first_triangle = edge_triangles.iter().map(|both| both[0]).collect();
        Edges { list: edges, first_triangle, of_triangle: triangle_edges }
    }

    #[test]
    fn edges_are_those_of_the_topology() {
        let two = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
        for (vertex_count, count) in [(3, 0), (3, 1), (10, 40), (5000, 30), (9000, 20_000), (20_000, 20_000)]
        {
            let triangles = random(vertex_count, count);
            let expected = of_topology(vertex_count as usize, &triangles);
            for pool in [None, Some(&two)] {
                assert!(edges(vertex_count as usize, &triangles, pool) == expected, "{vertex_count} {count}");
            }
        }
    }

    #[test]
    fn another_triangle_is_another_list() {
        let mut triangles = random(500, 900);
        let expected = of_topology(500, &triangles);
        triangles[17].swap(0, 1);
        assert!(edges(500, &triangles, None) != expected);
        triangles[17].swap(0, 1);
        triangles[17][2] = 499;
        assert!(edges(500, &triangles, None) != expected);
    }
}
