//! Seams: which vertices of a cloth are sewn to which.

use crate::regions::check_indices;
use crate::scene::{Cloth, Seam};
use crate::{Scene, SceneError, Vec3};
use cloth_core::mesh::{RestShape, Topology, TriMesh};
use cloth_core::{InPlane, Material, Stitch};
use std::collections::{BTreeMap, BTreeSet, BinaryHeap};

/// The seams of a cloth, over its own vertices.
#[derive(Default)]
pub(crate) struct Seams {
    /// The threads.
    pub(crate) stitches: Vec<Stitch>,
    /// Vertices that lie on each other when the seams are closed: to contact they are as one.
    pub(crate) joined: Vec<[u32; 2]>,
    /// What may be meant otherwise.
    pub(crate) warnings: Vec<String>,
}

/// Runs that are so many times as long as the other are warned of: even a full gather is made of less.
const UNLIKE: f64 = 3.0;

/// Builds the seams of a cloth; `x`: start positions \[m\].
pub(crate) fn build(
    scene: &Scene,
    source: &Cloth,
    materials: &[Material],
    mesh: &TriMesh,
    shape: (&Topology, &RestShape),
    x: &[Vec3],
    key: &str,
) -> Result<Seams, SceneError> {
    let mut seams = Seams::default();
    let mut seen = BTreeSet::new();
    for (i, seam) in source.seams.iter().enumerate() {
        let key = format!("{key}.seams[{i}]");
        let stiffness = seam.stiffness.unwrap_or_else(|| largest_stiffness(materials));
        if stiffness <= 0.0 {
            let expected = "a stiffness > 0 [N/m] (the material has none in its plane)";
            return Err(scene.error(&format!("{key}.stiffness"), expected, "nothing"));
        }
        let pairs = match (&seam.pairs, &seam.edges) {
            (Some(pairs), _) => listed(scene, source, pairs, mesh, &format!("{key}.pairs"))?,
            (None, Some(runs)) => {
                let key = format!("{key}.edges");
                let [sewn, joined] = matched(scene, source, runs, mesh, shape, &key, &mut seams.warnings)?;
                if sewn.iter().all(|[a, b]| a == b) {
                    let expected = "two runs of different vertices";
                    return Err(scene.error(&key, expected, format!("{runs:?}, the same vertices")));
                }
                seams.joined.extend(joined);
                sewn
            }
            (None, None) => Vec::new(),
        };
        seams.joined.extend(&pairs);
        for vertices in pairs {
            let [a, b] = vertices;
            if a != b && seen.insert([a.min(b), a.max(b)]) {
                let gap = (x[a as usize] - x[b as usize]).norm();
                let Seam { start, duration, .. } = *seam;
                seams.stitches.push(Stitch { vertices, gap, stiffness, start, duration });
            }
        }
    }
    Ok(seams)
}

fn largest_stiffness(materials: &[Material]) -> f64 {
    let of = |material: &Material| match material.in_plane {
        InPlane::Spring { stiffness, .. } => stiffness,
        InPlane::BaraffWitkin { warp, weft, .. } => warp.max(weft),
    };
    materials.iter().map(of).fold(0.0, f64::max)
}

fn listed(
    scene: &Scene,
    source: &Cloth,
    pairs: &[[u32; 2]],
    mesh: &TriMesh,
    key: &str,
) -> Result<Vec<[u32; 2]>, SceneError> {
    if pairs.is_empty() {
        return Err(scene.error(key, "at least one pair", "none"));
    }
    for (i, pair) in pairs.iter().enumerate() {
        let key = format!("{key}[{i}]");
        check_indices(scene, source, pair, mesh.vertices.len(), "vertex", &key)?;
        if pair[0] == pair[1] {
            return Err(scene.error(&key, "two different vertices", format!("{pair:?}")));
        }
    }
    Ok(pairs.to_vec())
}

/// A run along the boundary: its vertices in order, and how far along each is, as a share of the whole.
struct Run {
    vertices: Vec<u32>,
    share: Vec<f64>,
    /// The whole \[m\], undeformed.
    length: f64,
}

/// By their shares of the length: each vertex of the run with fewer vertices with the nearest of the other, and each of the
/// other with the nearest of these.
///
/// Only the first are sewn: a thread for every vertex of the finer run would draw neighbours to one point.
fn matched(
    scene: &Scene,
    source: &Cloth,
    runs: &[Vec<u32>; 2],
    mesh: &TriMesh,
    (topology, rest): (&Topology, &RestShape),
    key: &str,
    warnings: &mut Vec<String>,
) -> Result<[Vec<[u32; 2]>; 2], SceneError> {
    let boundary = boundary_lengths(mesh, topology, rest);
    let run = |which: usize| -> Result<Run, SceneError> {
        let key = format!("{key}[{which}]");
        check_indices(scene, source, &runs[which], mesh.vertices.len(), "vertex", &key)?;
        along(scene, source, &runs[which], &boundary, &key)
    };
    let (first, second) = (run(0)?, run(1)?);
    let (a, b) = (first.length, second.length);
    if a.max(b) > UNLIKE * a.min(b) {
        warnings.push(format!(
            "{key}: the runs of \"{}\" are {a:.3} m and {b:.3} m long: the longer will lie in folds",
            source.name
        ));
    }
    let swap = second.vertices.len() < first.vertices.len();
    let (few, many) = if swap { (&second, &first) } else { (&first, &second) };
    Ok([nearest(few, many), nearest(many, few)])
}

/// Each vertex of `of` with the vertex of `to` at the nearest share; of two as near that with the smaller share.
fn nearest(of: &Run, to: &Run) -> Vec<[u32; 2]> {
    let mut at = 0;
    let pair = |(&v, share): (&u32, &f64)| {
        let away = |k: usize| (to.share[k] - share).abs();
        while at + 1 < to.share.len() && away(at + 1) < away(at) {
            at += 1;
        }
        [v, to.vertices[at]]
    };
    of.vertices.iter().zip(&of.share).map(pair).collect()
}

/// Neighbours of each boundary vertex along the boundary, and how far they are at rest \[m\].
fn boundary_lengths(mesh: &TriMesh, topology: &Topology, rest: &RestShape) -> BTreeMap<u32, Vec<(u32, f64)>> {
    let mut neighbours: BTreeMap<u32, Vec<(u32, f64)>> = BTreeMap::new();
    for &edge in &topology.boundary_edges {
        let t = topology.edge_triangles[edge as usize][0] as usize;
        let Some(side) = topology.triangle_edges[t].iter().position(|&e| e == edge) else { continue };
        let length = rest.side_lengths[t][side];
        let [a, b] = [mesh.triangles[t][side], mesh.triangles[t][(side + 1) % 3]];
        neighbours.entry(a).or_default().push((b, length));
        neighbours.entry(b).or_default().push((a, length));
    }
    neighbours
}

fn along(
    scene: &Scene,
    source: &Cloth,
    stations: &[u32],
    boundary: &BTreeMap<u32, Vec<(u32, f64)>>,
    key: &str,
) -> Result<Run, SceneError> {
    if let Some(i) = stations.iter().position(|v| !boundary.contains_key(v)) {
        let expected = format!("a vertex on the boundary of \"{}\"", source.name);
        return Err(scene.error(&format!("{key}[{i}]"), expected, stations[i].to_string()));
    }
    let (mut vertices, mut length) = (vec![stations[0]], vec![0.0]);
    for (i, leg) in stations.windows(2).enumerate() {
        let Some(steps) = shortest(leg[0], leg[1], boundary) else {
            let expected = format!("a vertex on the same boundary as {}", leg[0]);
            return Err(scene.error(&format!("{key}[{}]", i + 1), expected, leg[1].to_string()));
        };
        let start = length[length.len() - 1];
        for (v, along) in steps {
            vertices.push(v);
            length.push(start + along);
        }
    }
    let mut sorted = vertices.clone();
    sorted.sort_unstable();
    if let Some([twice, _]) = sorted.windows(2).find(|w| w[0] == w[1]) {
        let expected = "a run that meets each vertex once (more vertices on the way say which way round)";
        return Err(scene.error(key, expected, format!("vertex {twice} twice")));
    }
    let whole = length[length.len() - 1];
    if vertices.len() < 2 {
        return Err(scene.error(key, "a run to another vertex", format!("{stations:?}")));
    }
    let share = length.iter().map(|l| l / whole).collect();
    Ok(Run { vertices, share, length: whole })
}

/// The shorter way along the boundary from `from` to `to` (Dijkstra; of equal ways that by lower vertices), without `from`: each
/// vertex and its distance \[m\].
fn shortest(from: u32, to: u32, boundary: &BTreeMap<u32, Vec<(u32, f64)>>) -> Option<Vec<(u32, f64)>> {
    /// Distances are lengths, so that their bits are in their order.
    type Waiting = std::cmp::Reverse<(u64, u32, u32)>;
    let mut reached: BTreeMap<u32, (f64, u32)> = BTreeMap::new();
    let mut waiting: BinaryHeap<Waiting> = BinaryHeap::from([std::cmp::Reverse((0, from, from))]);
    while let Some(std::cmp::Reverse((bits, v, before))) = waiting.pop() {
        if reached.contains_key(&v) {
            continue;
        }
        let distance = f64::from_bits(bits);
        reached.insert(v, (distance, before));
        if v == to {
            break;
        }
        for &(next, length) in boundary.get(&v).into_iter().flatten() {
            waiting.push(std::cmp::Reverse(((distance + length).to_bits(), next, v)));
        }
    }
    let mut way = Vec::new();
    let mut v = to;
    while v != from {
        let &(distance, before) = reached.get(&v)?;
        way.push((v, distance));
        v = before;
    }
    way.reverse();
    Some(way)
}
