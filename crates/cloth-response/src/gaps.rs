//! Which vertices the first continuous detection of a step has to look at: those that could carry a pair across its gap.
//!
//! The near pairs of the start are all pairs within the band B. With u(v) the way of a vertex in the step, two features whose
//! distance is D come no nearer than D − max u − max u, the maxima over the vertices of each. So a pair can come within ε only
//! if one of its vertices has both
//!
//! - u(v) ≥ (D − ε)/2, as the two maxima sum to at least D − ε, and
//! - u(v) ≥ D − ε − U, with U the largest way of all that the vertex' body meets.
//!
//! The vertex with the larger of the two maxima has both. With g(v) ≤ D, a lower bound of the distance of every feature with the
//! vertex v to every other, vertices with neither are left out; a detection over pairs with at least one of the others finds the
//! same contacts as one over all. Where no vertex is left there is nothing to look at.
//!
//! Between two bodies g is the distance of near pairs, else B or the gap between the bodies' boxes; ways are as they are. Within one
//! body ways are taken relative to the mean way of the body: what all do together changes no distance.
//!
//! A near pair stands for all pairs with the same closest points (see [`cloth_collision::Bvh::proximity`]); their features share
//! triangles with the pair's, so g is handed on within each triangle. Two edges whose nearest points are an end and a point of a
//! border of the end's own triangle are no near pair: the least height of each triangle counts as a distance within its body. A
//! triangle with an attached or sewn vertex has gap 0: its pairs may be no near pairs while those of its edges would be.

use crate::Vec3;
use crate::motion::{Motion, bytes_of};
use cloth_collision::mesh::NONE;
use cloth_collision::{CollisionMesh, Stencil};

/// A computed distance counts as this part of itself: closest points are good to 1e-6 of it or better where that matters, and
/// the narrow phase may call a pair a contact that is 1e-14 of its size beyond.
const SURE: f64 = 0.99;
/// What sums and differences of coordinates round, in units of the largest coordinate.
const ROUNDING: f64 = 64.0 * f64::EPSILON;
/// Bodies are compared box by box up to this number.
const MOST_BODIES: usize = 256;

/// Distances and ways of the vertices in one step, kept as buffers.
#[derive(Default)]
pub(crate) struct Gaps {
    /// Lower bounds of the distances to other bodies, and within the body [m].
    between: Vec<f64>,
    within: Vec<f64>,
    bodies: Vec<BodyWay>,
    /// Vertices that are to be looked at.
    mask: Vec<bool>,
    /// More than 1 in a test: gaps are taken as larger than they are.
    #[cfg(test)]
    pub(crate) planted: f64,
}

#[derive(Debug, Clone, Copy)]
struct BodyWay {
    /// Box at the start [m].
    lo: Vec3,
    hi: Vec3,
    /// Mean way of its vertices, and their number.
    mean: Vec3,
    count: usize,
    /// Largest way [m].
    largest: f64,
    /// Least distance of its box to those of the bodies that it meets [m].
    gap: f64,
    /// Largest way of those [m]; none where it meets no other.
    met: Option<f64>,
}

impl BodyWay {
    const NONE: Self = Self {
        lo: Vec3::new(f64::INFINITY, f64::INFINITY, f64::INFINITY),
        hi: Vec3::new(f64::NEG_INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY),
        mean: Vec3::new(0.0, 0.0, 0.0),
        count: 0,
        largest: 0.0,
        gap: f64::INFINITY,
        met: None,
    };
}

impl Gaps {
    /// Memory [B].
    pub(crate) fn bytes(&self) -> usize {
        bytes_of(&self.between) + bytes_of(&self.within) + bytes_of(&self.bodies) + bytes_of(&self.mask)
    }

    /// The vertices whose pairs may come within `approach` \[m\] during the motion, and their number. `near`: all near pairs within
    /// `band` \[m\] at its start. `moving`: pairs without such a vertex are nobody's concern.
    pub(crate) fn vertices_in_reach(
        &mut self,
        mesh: &CollisionMesh,
        motion: &Motion<'_>,
        near: &[Stencil],
        band: f64,
        approach: f64,
        moving: Option<&[bool]>,
    ) -> (&[bool], usize) {
        let extent = self.measure(mesh, motion);
        self.fill(mesh, motion.x_t0, near, band);
        let rounding = ROUNDING * extent;
        let approach = approach + 4.0 * rounding;
        #[cfg(test)]
        let sure = SURE * self.planted.max(1.0);
        #[cfg(not(test))]
        let sure = SURE;
        self.mask.clear();
        self.mask.resize(mesh.vertex_count, false);
        let mut count = 0;
        for (v, mask) in self.mask.iter_mut().enumerate().filter(|(v, _)| mesh.vertex_owner[*v] != NONE) {
            let body = &self.bodies[mesh.vertex_body[v] as usize];
            let way = motion.buffers.end[v] - motion.x_t0[v];
            let (length, room) = (way.norm(), sure * self.between[v] - approach);
            let to_others = 2.0 * length >= room && body.met.is_some_and(|met| length + met >= room);
            let within = 2.0 * (way - body.mean).norm() >= sure * self.within[v] - approach;
            *mask = (to_others || within) && moving.is_none_or(|moving| moving[v]);
            count += usize::from(*mask);
        }
        (&self.mask, count)
    }

    /// Boxes, ways and what each body meets; the largest coordinate [m].
    fn measure(&mut self, mesh: &CollisionMesh, motion: &Motion<'_>) -> f64 {
        let (x_t0, end) = (motion.x_t0, &motion.buffers.end);
        self.bodies.clear();
        self.bodies.resize(mesh.bodies.len(), BodyWay::NONE);
        let mut extent: f64 = 0.0;
        for v in (0..mesh.vertex_count).filter(|&v| mesh.vertex_owner[v] != NONE) {
            let body = &mut self.bodies[mesh.vertex_body[v] as usize];
            let way = end[v] - x_t0[v];
            body.lo = body.lo.inf(&x_t0[v]);
            body.hi = body.hi.sup(&x_t0[v]);
            body.mean += way;
            body.count += 1;
            body.largest = body.largest.max(way.norm());
            extent = extent.max(x_t0[v].amax()).max(end[v].amax());
        }
        for body in &mut self.bodies {
            body.mean /= body.count.max(1) as f64;
        }
        let count = self.bodies.len();
        let largest = self.bodies.iter().map(|b| b.largest).fold(0.0, f64::max);
        for a in 0..count {
            if count > MOST_BODIES {
                (self.bodies[a].gap, self.bodies[a].met) = (0.0, Some(largest));
                continue;
            }
            let (mut gap, mut met) = (f64::INFINITY, None);
            for b in (0..count).filter(|&b| b != a && mesh.bodies_meet(a as u32, b as u32)) {
                let (first, second) = (&self.bodies[a], &self.bodies[b]);
                let apart = (first.lo - second.hi).sup(&(second.lo - first.hi)).sup(&Vec3::zeros());
                gap = gap.min(apart.norm());
                met = Some(second.largest.max(met.unwrap_or(0.0)));
            }
            (self.bodies[a].gap, self.bodies[a].met) = (gap, met);
        }
        extent
    }

    /// The bounds g of all vertices at the start.
    fn fill(&mut self, mesh: &CollisionMesh, x: &[Vec3], near: &[Stencil], band: f64) {
        let Self { between, within, bodies, .. } = self;
        between.clear();
        between.extend(mesh.vertex_body.iter().map(|&b| bodies[b as usize].gap.max(band)));
        within.clear();
        let of_body = |b: &u32| if mesh.bodies_meet(*b, *b) { band } else { f64::INFINITY };
        within.extend(mesh.vertex_body.iter().map(of_body));
        for stencil in near {
            let bodies = [0, 3].map(|k| mesh.vertex_body[stencil.vertices[k] as usize]);
            let gaps = if bodies[0] == bodies[1] { &mut *within } else { &mut *between };
            for v in stencil.vertices {
                let gap = &mut gaps[v as usize];
                *gap = gap.min(stencil.distance);
            }
        }
        // First what triangles are themselves, then what they hand on: two passes, as handing on goes one triangle far.
        for t in &mesh.triangles {
            let attached = t.iter().any(|&v| mesh.attached_to[v as usize] != NONE);
            let height =
                if within[t[0] as usize] < f64::INFINITY { least_height(t, x) } else { f64::INFINITY };
            let sewn = t.iter().any(|&v| mesh.sewn.get(v as usize).is_some_and(|group| *group != NONE));
            for &v in t {
                if sewn {
                    (between[v as usize], within[v as usize]) = (0.0, 0.0);
                }
                if height < within[v as usize] {
                    within[v as usize] = height;
                }
                if attached {
                    between[v as usize] = 0.0;
                }
            }
        }
        for gaps in [between, within] {
            let own = gaps.clone();
            for t in &mesh.triangles {
                let least = t.iter().map(|&v| own[v as usize]).fold(f64::INFINITY, f64::min);
                for &v in t {
                    let gap = &mut gaps[v as usize];
                    *gap = gap.min(least);
                }
            }
        }
    }
}

/// Least height of a triangle [m]: twice its area over its longest side.
fn least_height(t: &[u32; 3], x: &[Vec3]) -> f64 {
    let [a, b, c] = t.map(|v| x[v as usize]);
    let longest = (b - a).norm_squared().max((c - b).norm_squared()).max((a - c).norm_squared());
    if longest > 0.0 { (b - a).cross(&(c - a)).norm() / longest.sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::MotionBuffers;
    use cloth_collision::mesh::generators::grid;
    use cloth_collision::{Body, Bvh, Contacts, Detector, Mode, Query};

    const THICKNESS: f64 = 0.01;
    const BAND: f64 = 1.25 * THICKNESS;
    const APPROACH: f64 = 1e-3 * THICKNESS;

    struct Random(u64);

    impl Random {
        /// Uniform in [-1, 1].
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 33) as f64 / (1u64 << 30) as f64 - 1.0
        }

        fn point(&mut self) -> Vec3 {
            Vec3::new(self.next(), self.next(), self.next())
        }
    }

    /// Two wavy sheets, the first folded over onto itself, `fine` vertices a side, and a collider below; not touching.
    fn bodies(random: &mut Random, fine: usize) -> (CollisionMesh, Vec<Vec3>) {
        let sheet = grid(0.2, 0.2, fine, fine).unwrap();
        let bodies = [(true, true), (true, false), (false, false)]
            .map(|(dynamic, self_collision)| Body { dynamic, self_collision });
        let mesh =
            CollisionMesh::new(&bodies.map(|b| (b, sheet.vertices.len(), &sheet.triangles[..]))).unwrap();
        let mut x = vec![];
        for body in 0..3 {
            let (wave, apart) = (0.002 * random.next(), 0.6 * THICKNESS * (1.2 + random.next()));
            for p in &sheet.vertices {
                let mut q = Vec3::new(p.x, wave * (40.0 * p.z).sin(), p.z);
                if body == 0 && p.x > 0.0 {
                    // Around a bend of radius r and back above itself.
                    let r = 0.6 * THICKNESS;
                    let angle = (p.x / r).min(std::f64::consts::PI);
                    q = Vec3::new(r * angle.sin() - (p.x - r * angle), q.y + r * (1.0 - angle.cos()), p.z);
                }
                x.push(q - Vec3::y() * (f64::from(body) * (apart + 0.005)));
            }
        }
        (mesh, x)
    }

    fn detect(mesh: &CollisionMesh, x: [&[Vec3]; 2], active: Option<&[bool]>) -> Contacts {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let query = Query { x_t0: x[0], x_t1: x[1], thickness: APPROACH, mode: Mode::Continuous, active };
        Bvh::new(mesh, x[0]).unwrap().detect(mesh, &query, &pool).unwrap()
    }

    /// Cases in which the masked detection differs from the whole one, cases with contacts, and vertices left out.
    fn compare(planted: f64) -> [usize; 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let (mut random, mut found) = (Random(7), [0; 3]);
        for case in 0..60 {
            // Meshes coarser and finer than the thickness; ways from far below the gaps to far above.
            let (mesh, x_t0) = bodies(&mut random, [6, 11, 21][case % 3]);
            let size = THICKNESS * 10f64.powf(-1.2 + 0.4 * (case % 5) as f64);
            let shift = random.point() * (4.0 * THICKNESS * f64::from(u8::from(case % 2 == 0)));
            let moves = |v: usize| mesh.vertex_body[v] < 2;
            let x_t1: Vec<Vec3> = x_t0
                .iter()
                .enumerate()
                .map(|(v, p)| {
                    let fast = random.next() > 0.9;
                    let way = random.point() * if fast { size } else { 0.1 * size };
                    if moves(v) { p + way + shift } else { *p }
                })
                .collect();
            let mut buffers = MotionBuffers::default();
            let inv_mass = vec![1.0; x_t0.len()];
            let motion = Motion::new(&mut buffers, &inv_mass, &x_t0, &x_t1, 0.01);
            let near = Bvh::new(&mesh, &x_t0).unwrap().proximity(&mesh, &x_t0, BAND, None, &pool).unwrap();
            let mut gaps = Gaps { planted, ..Gaps::default() };
            let (mask, count) = gaps.vertices_in_reach(&mesh, &motion, &near, BAND, APPROACH, None);
            let whole = detect(&mesh, [&x_t0, &x_t1], None);
            let masked = detect(&mesh, [&x_t0, &x_t1], Some(mask));
            let answer = |c: &Contacts| {
                let bits = |times: &[f64]| times.iter().map(|t| t.to_bits()).collect::<Vec<_>>();
                let times = [bits(&c.time_vertex_triangle), bits(&c.time_edge_edge)];
                (c.vertex_triangle.clone(), c.edge_edge.clone(), times)
            };
            found[0] += usize::from(answer(&whole) != answer(&masked));
            found[1] += usize::from(!whole.vertex_triangle.is_empty() || !whole.edge_edge.is_empty());
            found[2] += mesh.vertex_count - count;
        }
        found
    }

    #[test]
    fn what_is_left_out_meets_nothing() {
        let [different, with_contacts, left_out] = compare(1.0);
        assert_eq!(different, 0);
        assert!(with_contacts > 15 && left_out > 3_000, "{with_contacts} {left_out}");
        assert!(compare(3.0)[0] > 0, "planted: gaps three times as large lose contacts");
    }

    #[test]
    fn an_edge_across_the_border_of_its_own_triangle_is_looked_at() {
        // (0, 3) swings against the border edge (1, 2) of its neighbour triangle: no near pair holds the two edges.
        let triangles = [[0, 1, 2], [0, 2, 3]];
        let mesh = CollisionMesh::single(4, &triangles).unwrap();
        let x_t0 = [[0.0, 0.0, 0.0], [0.1, 0.0, -0.001], [0.1, 0.0, 0.1], [0.0, 0.0, 0.1]].map(Vec3::from);
        let mut x_t1 = x_t0;
        x_t1[1] = Vec3::new(-0.02, 0.0, 0.05);
        let mut buffers = MotionBuffers::default();
        let motion = Motion::new(&mut buffers, &[1.0; 4], &x_t0, &x_t1, 0.01);
        let mut gaps = Gaps::default();
        let (_, count) = gaps.vertices_in_reach(&mesh, &motion, &[], BAND, APPROACH, None);
        assert!(!detect(&mesh, [&x_t0, &x_t1], None).edge_edge.is_empty() && count > 0);
    }
}
