//! Twin of `feature_pairs.wgsl`.

use crate::layout::SceneParams;
use crate::twin::bounds::{MovingBox, is_active, vertex_box};
use crate::twin::dops::{self, Dop};

/// Candidates (vertex, triangle) and (edge, edge) of triangle pairs, in the order of the pairs. `dop_slack`: [`dops::SLACK`],
/// or None for boxes alone.
pub fn feature_pairs(
    params: &SceneParams,
    triangles: &[[u32; 4]],
    features: &[[u32; 4]],
    positions: &[[f32; 4]],
    active: &[u32],
    pairs: &[[u32; 2]],
    dop_slack: Option<f32>,
) -> (Vec<[u32; 2]>, Vec<[u32; 2]>) {
    let corner = |v: u32| vertex_box(positions[v as usize], positions[(params.second + v) as usize]);
    let live = |vertices: &[u32]| vertices.iter().any(|&v| is_active(params, active, v));
    let owns = |t: u32, bit: usize| features[t as usize][3] >> bit & 1 != 0;
    let corners = |t: u32| -> [u32; 3] { [0, 1, 2].map(|k| triangles[t as usize][k]) };
    let whole = |t: u32| corners(t).map(corner).into_iter().reduce(MovingBox::hull);
    let slabs = |vertices: &[u32]| {
        let ends = |v: u32| (positions[v as usize], positions[(params.second + v) as usize]);
        let of = |(p, q)| dops::vertex_dop(p, q, params.thickness, dop_slack.unwrap_or(0.0));
        vertices.iter().map(|&v| of(ends(v))).reduce(Dop::hull)
    };
    let dops_touch = |a: &[u32], b: &[u32]| match (dop_slack, slabs(a), slabs(b)) {
        (Some(_), Some(a), Some(b)) => a.may_touch(&b),
        _ => true,
    };
    let (mut vertex_triangle, mut edge_edge) = (vec![], vec![]);
    for &[a, b] in pairs {
        if !dops_touch(&corners(a), &corners(b)) {
            continue;
        }
        for (s, t) in [(a, b), (b, a)] {
            let others = corners(t);
            for (k, v) in corners(s).into_iter().enumerate() {
                let is_near =
                    || whole(t).is_some_and(|w| corner(v).may_touch(&w)) && dops_touch(&[v], &others);
                let is_live = live(&[v]) || live(&others);
                if owns(s, k) && !others.contains(&v) && is_live && is_near() {
                    vertex_triangle.push([v, t]);
                }
            }
        }
        for i in 0..3 {
            let e = [corners(a)[i], corners(a)[(i + 1) % 3]];
            for j in 0..3 {
                let f = [corners(b)[j], corners(b)[(j + 1) % 3]];
                let edge = |e: [u32; 2]| corner(e[0]).hull(corner(e[1]));
                if owns(a, 3 + i)
                    && owns(b, 3 + j)
                    && !e.iter().any(|v| f.contains(v))
                    && (live(&e) || live(&f))
                    && edge(e).may_touch(&edge(f))
                    && dops_touch(&e, &f)
                {
                    edge_edge.push([features[a as usize][i], features[b as usize][j]]);
                }
            }
        }
    }
    (vertex_triangle, edge_edge)
}
