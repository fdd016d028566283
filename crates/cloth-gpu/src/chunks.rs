//! Scenes that are too large for the device, in chunks, for any method.
//!
//! A chunk is a set of triangles with their vertices, detected as a scene of its own. A plane splits a set in two: each side gets the
//! triangles whose boxes over the whole step, half the thickness included, reach to it. Two triangles whose boxes overlap have a
//! point in common, so both lie in the chunk of the side that it is on; two whose boxes do not overlap are no contact, which the
//! narrow phase tells exactly along an axis. So every contact is found in some chunk, and vertices keep their order, so its
//! time has the same bits there. A contact may be found in several chunks: it is reported once.
//!
//! Where no plane makes both sides smaller (many triangles about one point, or as long as the scene), the set is split in three by
//! number, and each two thirds are a chunk: any two triangles are in one of them.

use crate::collision::mesh::NONE;
use crate::collision::{CollisionMesh, Contacts, DetectStats, Mode, Query, Vec3};
use crate::error::GpuError;
use crate::seconds::Seconds;

/// A side with more than this part of the triangles makes a split useless.
const MOST_ON_A_SIDE: f64 = 0.85;
/// Fewer triangles are not split: what they need is not what the limit is about.
const LEAST: usize = 8;
/// Relative error of a few operations in double precision, with room.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

/// Whether an error may go away with fewer triangles at a time.
pub fn would_help(error: &GpuError) -> bool {
    matches!(
        error,
        GpuError::TooLarge { .. } | GpuError::OutOfMemory { .. } | GpuError::TooManyWorkgroups { .. }
    )
}

/// Box of a triangle over the whole step, half the thickness included.
#[derive(Debug, Clone, Copy)]
struct Extent {
    low: Vec3,
    high: Vec3,
}

/// All contacts of a query that has passed [`Query::check`], at most `most` triangles at a time; fewer where `run` finds that
/// too many ([`would_help`]).
///
/// # Errors
/// Of `run`.
pub fn detect(
    mesh: &CollisionMesh,
    query: &Query<'_>,
    most: usize,
    run: impl FnMut(&CollisionMesh, &Query<'_>) -> Result<Contacts, GpuError>,
) -> Result<Contacts, GpuError> {
    detect_with(mesh, query, most, query.thickness, run)
}

/// [`detect`] with boxes for another thickness: a smaller one loses contacts.
fn detect_with(
    mesh: &CollisionMesh,
    query: &Query<'_>,
    most: usize,
    thickness: f64,
    mut run: impl FnMut(&CollisionMesh, &Query<'_>) -> Result<Contacts, GpuError>,
) -> Result<Contacts, GpuError> {
    let extents: Vec<Extent> = mesh.triangles.iter().map(|t| extent(query, t, thickness)).collect();
    let mut waiting = vec![(0..mesh.triangles.len() as u32).collect::<Vec<u32>>()];
    let mut parts = Parts::default();
    while let Some(set) = waiting.pop() {
        if set.len() <= most.max(LEAST) {
            let chunk = Chunk::new(mesh, query, &set)?;
            match chunk.run(query, &mut run) {
                Err(error) if would_help(&error) && set.len() > LEAST => {}
                answer => {
                    parts.add(&chunk, mesh, answer?);
                    continue;
                }
            }
        }
        waiting.extend(split(&extents, &set));
    }
    Ok(parts.finish())
}

fn extent(query: &Query<'_>, corners: &[u32; 3], thickness: f64) -> Extent {
    let ends = [if query.mode == Mode::Continuous { query.x_t0 } else { query.x_t1 }, query.x_t1];
    let at = |v: u32| ends.map(|x| x[v as usize]);
    let [first, _] = at(corners[0]);
    let (mut low, mut high) = (first, first);
    for x in corners.iter().flat_map(|&v| at(v)) {
        (low, high) = (low.inf(&x), high.sup(&x));
    }
    let margin = 0.5 * thickness;
    let off = |x: f64| margin + (margin + x.abs()) * ROUNDING;
    Extent { low: low.map(|x| x - off(x)), high: high.map(|x| x + off(x)) }
}

/// Sets of which at least one holds any two triangles whose boxes overlap; each is smaller.
fn split(extents: &[Extent], set: &[u32]) -> Vec<Vec<u32>> {
    let middle = |t: u32, axis: usize| {
        let Extent { low, high } = &extents[t as usize];
        0.5 * low[axis] + 0.5 * high[axis]
    };
    let spread = |axis: usize| {
        let (low, high) = set
            .iter()
            .fold((f64::MAX, f64::MIN), |b, &t| (b.0.min(middle(t, axis)), b.1.max(middle(t, axis))));
        0.5 * high - 0.5 * low
    };
    let axis = (0..3).max_by(|&a, &b| spread(a).total_cmp(&spread(b))).unwrap_or(0);
    let mut middles: Vec<f64> = set.iter().map(|&t| middle(t, axis)).collect();
    let half = middles.len() / 2;
    let plane = *middles.select_nth_unstable_by(half, f64::total_cmp).1;
    let side = |is_in: &dyn Fn(&Extent) -> bool| -> Vec<u32> {
        set.iter().copied().filter(|&t| is_in(&extents[t as usize])).collect()
    };
    let sides = [side(&|e| e.low[axis] <= plane), side(&|e| e.high[axis] >= plane)];
    if sides.iter().all(|s| (s.len() as f64) < MOST_ON_A_SIDE * set.len() as f64) {
        return sides.into();
    }
    let third = |k: usize| &set[k * set.len() / 3..(k + 1) * set.len() / 3];
    [(0, 1), (0, 2), (1, 2)].map(|(a, b)| [third(a), third(b)].concat()).into()
}

/// A set of triangles as a scene of its own.
struct Chunk {
    mesh: CollisionMesh,
    /// Triangle and vertex of the whole scene, of each one here; ascending.
    triangles: Vec<u32>,
    vertices: Vec<u32>,
    x: [Vec<Vec3>; 2],
    active: Option<Vec<bool>>,
}

impl Chunk {
    /// `set`: ascending.
    fn new(mesh: &CollisionMesh, query: &Query<'_>, set: &[u32]) -> Result<Self, GpuError> {
        let mut here = vec![NONE; mesh.vertex_count];
        for &t in set {
            for v in mesh.triangles[t as usize] {
                here[v as usize] = 0;
            }
        }
        let vertices: Vec<u32> = (0..here.len() as u32).filter(|&v| here[v as usize] == 0).collect();
        let body = |v: u32| mesh.vertex_body[v as usize] as usize;
        let mut counts = vec![0; mesh.bodies.len()];
        for &v in &vertices {
            // Numbers within the body.
            here[v as usize] = counts[body(v)] as u32;
            counts[body(v)] += 1;
        }
        let mut lists = vec![vec![]; mesh.bodies.len()];
        for &t in set {
            let corners = mesh.triangles[t as usize];
            lists[body(corners[0])].push(corners.map(|v| here[v as usize]));
        }
        let bodies: Vec<_> = (0..lists.len()).map(|b| (mesh.bodies[b], counts[b], &lists[b][..])).collect();
        let mut part = CollisionMesh::new(&bodies)?;
        for (v, &whole) in vertices.iter().enumerate() {
            if mesh.attached_to[whole as usize] != NONE {
                part.set_attachment(v as u32, mesh.attached_to[whole as usize]);
            }
        }
        if !mesh.sewn.is_empty() {
            part.sewn = vertices.iter().map(|&whole| mesh.sewn[whole as usize]).collect();
        }
        let pick = |x: &[Vec3]| vertices.iter().map(|&v| x[v as usize]).collect();
        Ok(Self {
            mesh: part,
            triangles: set.to_vec(),
            x: [pick(query.x_t0), pick(query.x_t1)],
            active: query.active.map(|mask| vertices.iter().map(|&v| mask[v as usize]).collect()),
            vertices,
        })
    }

    fn run(
        &self,
        query: &Query<'_>,
        run: &mut impl FnMut(&CollisionMesh, &Query<'_>) -> Result<Contacts, GpuError>,
    ) -> Result<Contacts, GpuError> {
        if self.active.as_ref().is_some_and(|mask| !mask.contains(&true)) {
            return Ok(Contacts::default());
        }
        let query = Query { x_t0: &self.x[0], x_t1: &self.x[1], active: self.active.as_deref(), ..*query };
        run(&self.mesh, &query)
    }
}

/// What the chunks found.
#[derive(Default)]
struct Parts {
    vertex_triangle: Vec<([u32; 2], f64)>,
    edge_edge: Vec<([u32; 2], f64)>,
    stats: DetectStats,
    counts: Vec<(&'static str, u64)>,
    seconds: Seconds,
    chunks: u64,
}

impl Parts {
    fn add(&mut self, chunk: &Chunk, mesh: &CollisionMesh, found: Contacts) {
        let edge = |e: u32| {
            let ends = chunk.mesh.edges[e as usize].map(|v| chunk.vertices[v as usize]);
            // Every edge of a triangle is one of the scene.
            mesh.edges.partition_point(|other| *other < ends) as u32
        };
        self.vertex_triangle.extend(
            found
                .vertex_triangle
                .iter()
                .map(|&[v, t]| [chunk.vertices[v as usize], chunk.triangles[t as usize]])
                .zip(found.time_vertex_triangle),
        );
        self.edge_edge
            .extend(found.edge_edge.iter().map(|&[e, f]| [edge(e), edge(f)]).zip(found.time_edge_edge));
        let stats = &found.stats;
        self.stats.broad_phase_tests += stats.broad_phase_tests;
        self.stats.leaf_pairs += stats.leaf_pairs;
        self.stats.candidates_vertex_triangle += stats.candidates_vertex_triangle;
        self.stats.candidates_edge_edge += stats.candidates_edge_edge;
        self.stats.root_searches += stats.root_searches;
        for &(name, count) in &stats.counts {
            match self.counts.iter_mut().find(|c| c.0 == name) {
                Some(entry) => entry.1 += count,
                None => self.counts.push((name, count)),
            }
        }
        for &(name, s) in &stats.seconds {
            self.seconds.add(name, s);
        }
        self.chunks += 1;
    }

    fn finish(mut self) -> Contacts {
        let mut out = Contacts { stats: self.stats, ..Contacts::default() };
        (out.vertex_triangle, out.time_vertex_triangle) = unique(self.vertex_triangle);
        (out.edge_edge, out.time_edge_edge) = unique(self.edge_edge);
        self.counts.push(("chunks", self.chunks));
        out.stats.counts = self.counts;
        out.stats.seconds = self.seconds.0;
        out
    }
}

fn unique(mut list: Vec<([u32; 2], f64)>) -> (Vec<[u32; 2]>, Vec<f64>) {
    list.sort_unstable_by_key(|c| c.0);
    list.dedup_by_key(|c| c.0);
    list.into_iter().unzip()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]
mod tests {
    use super::*;
    use crate::collision::{BruteForce, Detector};

    /// Triangles about a cube, side by side in pairs that are a little less than the thickness apart.
    fn scene(size: f64, thickness: f64) -> (CollisionMesh, Vec<Vec3>) {
        let mut state = 1u64;
        let mut unit = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        let (mut x, mut triangles) = (vec![], vec![]);
        for _ in 0..60 {
            let place = Vec3::new(unit(), unit(), unit());
            let corners = [Vec3::zeros(), Vec3::y() * size, Vec3::z() * size];
            for side in 0..2 {
                let first = x.len() as u32;
                triangles.push([first, first + 1, first + 2]);
                x.extend(corners.map(|c| place + c + Vec3::x() * (f64::from(side) * 0.99 * thickness)));
            }
        }
        (CollisionMesh::single(x.len(), &triangles).unwrap(), x)
    }

    fn contacts(size: f64, thickness: f64, margin: f64) -> [Contacts; 2] {
        let (mesh, x) = scene(size, thickness);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let query = Query { x_t0: &x, x_t1: &x, thickness, mode: Mode::Discrete, active: None };
        let run =
            |mesh: &CollisionMesh, query: &Query<'_>| Ok(BruteForce.detect(mesh, query, &pool).unwrap());
        let whole = run(&mesh, &query).unwrap();
        [whole, detect_with(&mesh, &query, 10, margin, run).unwrap()]
    }

    #[test]
    fn chunks_find_what_the_whole_has() {
        for (size, thickness) in [(0.1, 0.05), (0.001, 0.01), (3.0, 0.0)] {
            let [whole, chunks] = contacts(size, thickness, thickness);
            assert!(chunks.stats.count("chunks") > 10 && whole.edge_edge.len() > 60);
            assert_eq!(whole.vertex_triangle, chunks.vertex_triangle);
            assert_eq!(whole.edge_edge, chunks.edge_edge);
        }
    }

    #[test]
    fn boxes_without_the_thickness_lose_contacts() {
        let [whole, chunks] = contacts(0.1, 0.05, 0.0);
        assert!(chunks.edge_edge.len() < whole.edge_edge.len());
    }

    #[test]
    fn every_split_is_smaller_and_keeps_neighbours_together() {
        for (size, thickness) in [(0.1, 0.05), (5.0, 0.0), (0.0, 0.0)] {
            let (mesh, x) = scene(size, thickness);
            let query = Query { x_t0: &x, x_t1: &x, thickness, mode: Mode::Discrete, active: None };
            let extents: Vec<Extent> = mesh.triangles.iter().map(|t| extent(&query, t, thickness)).collect();
            let set: Vec<u32> = (0..extents.len() as u32).collect();
            let parts = split(&extents, &set);
            assert!(parts.iter().all(|part| part.len() < set.len()));
            for a in &set {
                for b in &set {
                    let (p, q) = (&extents[*a as usize], &extents[*b as usize]);
                    let meet = (0..3).all(|k| p.low[k] <= q.high[k] && q.low[k] <= p.high[k]);
                    assert!(!meet || parts.iter().any(|s| s.contains(a) && s.contains(b)), "{a}, {b}");
                }
            }
        }
    }
}
