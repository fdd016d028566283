//! Detection over a sequence of frames: tree update and traversal once per *skipping frame session* of n_f frames.
//!
//! The first frame gives each vertex a ball of [`room`] and traverses the tree of the balls' boxes; what it finds is
//! registered on the pending list of [`pairs`] with a lower bound of its distance, unless even at the far ends of their balls the
//! features stay apart. Every frame measures how far each vertex is from the middle of its ball. The front-end filter passes the
//! pairs that are apart by no more than that; the back-end filter is the narrow phase of [`crate::Bvh`], on assigned features.
//! A vertex beyond its ball *dangles*: it gets another one, its pairs come off the list, the tree is fitted to it and met again
//! where that happened ([`dangling`]), which registers its pairs anew. So the list is complete for the balls at all times,
//! whatever the motion, and the contacts are those of [`crate::Bvh`], bit for bit.
//!
//! Nothing of a session is part of an answer: a session that starts in any frame finds the same contacts.
//!
//! Source: \[wong2010\].

mod adapt;
mod dangling;
mod distance;
mod every_frame;
mod options;
mod pairs;
mod room;
mod stats;
mod work;

use crate::bvh::leaf_pair;
use crate::bvh::narrow::{Narrow, Scene, merge};
use crate::bvh::refit::Boxes;
use crate::bvh::traverse::{Candidates, Sink, Streaming, TraverseCounts, traverse};
use crate::{Body, Bvh, CollisionMesh, Contacts, DetectError, Detector, Query, Vec3};
use adapt::{Adaptation, Plan};
use dangling::{Upwards, ball_box, one_by_one, one_by_one_tests};
use pairs::{FrontEnd, Pairs, Register};
use room::{Reach, Room, Weights};
use std::time::Instant;
use work::Work;

pub use options::{Adapt, Frames, MOST_FRAMES, SessionOptions, Variant};
pub use stats::{FrameKind, SessionStats};

/// A session in which more than this share of the leaves dangles in one frame starts anew.
const MOST_DANGLING: f64 = 0.25;

/// Detector for a sequence of frames; see the module's head.
///
/// Frames may come in any order, and a step may start elsewhere than the last one ended.
#[derive(Debug, Clone)]
pub struct SkippingSession {
    options: SessionOptions,
    triangles: Vec<[u32; 3]>,
    vertex_body: Vec<u32>,
    bodies: Vec<Body>,
    bvh: Bvh,
    adaptation: Adaptation,
    running: Option<Running>,
    boxes: Boxes<1>,
    upwards: Option<Upwards>,
    reach: Reach,
    /// Tests per dangling leaf when last met one by one, and all at once.
    tests_per_leaf: [Option<f64>; 2],
    stats: SessionStats,
}

/// The present session.
#[derive(Debug, Clone)]
struct Running {
    room: Room,
    pairs: Pairs,
    frames: u32,
    frames_left: u32,
    /// Of the last frame.
    signature: u64,
}

impl SkippingSession {
    /// A detector for `mesh`; `x` \[m\] shapes its tree, not the answers.
    ///
    /// # Errors
    /// What [`SessionOptions::check`] and [`Bvh::new`] refuse.
    pub fn new(mesh: &CollisionMesh, x: &[Vec3], options: SessionOptions) -> Result<Self, DetectError> {
        options.check()?;
        Ok(Self {
            options,
            triangles: mesh.triangles.clone(),
            vertex_body: mesh.vertex_body.clone(),
            bodies: mesh.bodies.clone(),
            bvh: Bvh::new(mesh, x)?,
            adaptation: Adaptation::new(options.frames),
            running: None,
            boxes: Boxes::default(),
            upwards: None,
            reach: Reach::default(),
            tests_per_leaf: [None; 2],
            stats: SessionStats::default(),
        })
    }

    /// What the last call did and took.
    pub fn stats(&self) -> &SessionStats {
        &self.stats
    }

    /// The tree, for what a session does not answer ([`Bvh::proximity`], [`Bvh::intersections`]).
    pub fn bvh_mut(&mut self) -> &mut Bvh {
        &mut self.bvh
    }

    /// Ends the present session; the next frame starts another. No answer depends on it.
    pub fn restart(&mut self) {
        self.running = None;
        self.adaptation.session_ends();
    }

    fn check_mesh(&self, mesh: &CollisionMesh) -> Result<(), DetectError> {
        self.bvh.check_mesh(mesh)?;
        if let Some(t) = (0..self.triangles.len()).find(|&t| self.triangles[t] != mesh.triangles[t]) {
            return Err(DetectError::ChangedTopology { triangle: t });
        }
        if self.bodies != mesh.bodies || self.vertex_body != mesh.vertex_body {
            return Err(DetectError::ChangedBodies);
        }
        Ok(())
    }

    /// A frame on its own, by the tree's moving boxes.
    fn alone(
        &mut self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        was_planned: bool,
        pool: &rayon::ThreadPool,
    ) -> Result<Contacts, DetectError> {
        let start = Instant::now();
        let out = self.bvh.detect(mesh, query, pool)?;
        let work = Work::alone(mesh, &self.bvh.tree, &out.stats);
        self.stats.update_seconds = out.stats.seconds[0].1;
        self.stats.traversal_seconds = start.elapsed().as_secs_f64() - self.stats.update_seconds;
        self.stats.frames = 1;
        self.stats.admissible = out.stats.candidates_vertex_triangle + out.stats.candidates_edge_edge;
        self.stats.work = work.total();
        self.adaptation.frame_alone(self.cost(), was_planned);
        Ok(out)
    }

    /// What the adaptation goes by.
    fn cost(&self) -> f64 {
        match self.options.adapt {
            Adapt::Work => self.stats.work as f64,
            Adapt::Time => {
                self.stats.update_seconds + self.stats.traversal_seconds + self.stats.elementary_seconds
            }
        }
    }

    /// The first frame's tree update and traversal; None if the motion leaves no room for a session.
    fn start(
        &mut self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        (frames, weights): (u32, Weights),
        work: &mut Work,
        pool: &rayon::ThreadPool,
    ) -> Option<Running> {
        let start = Instant::now();
        let room = Room::new(mesh, query, weights, pool)?;
        let tree = &self.bvh.tree;
        let of_vertex = |v: usize| ball_box(&room.middles[v], room.radii[v], room.thickness);
        self.boxes.refit(tree, mesh, of_vertex, None, pool);
        work.updated(mesh.vertex_count, tree.block_count());
        let updated = Instant::now();
        let register =
            || Streaming::new(Register::new(mesh, &room.middles, &room.radii, None, room.thickness));
        let (visits, counts) = traverse(tree, &self.boxes, mesh, pool, register);
        let mut pairs = Pairs::default();
        take_registered(visits, counts, &mut pairs, work);
        self.stats.update_seconds += (updated - start).as_secs_f64();
        self.stats.traversal_seconds += updated.elapsed().as_secs_f64();
        // A room smaller than asked for lasts less long.
        let lasting = room.alpha as u32 + 1;
        let frames = if room.alpha < weights.alpha { frames.min(lasting) } else { frames };
        Some(Running { room, pairs, frames, frames_left: frames - 1, signature: 0 })
    }

    /// Gives dangling vertices other balls and registers their pairs anew; false if a new session is cheaper.
    fn take_in_dangling(
        &mut self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        running: &mut Running,
        work: &mut Work,
        pool: &rayon::ThreadPool,
    ) -> bool {
        let start = Instant::now();
        let tree = &self.bvh.tree;
        let upwards = self.upwards.get_or_insert_with(|| Upwards::new(tree, mesh));
        let leaves = upwards.leaves(&self.reach.dangling);
        if leaves.len() as f64 > MOST_DANGLING * tree.leaves.len() as f64 {
            return false;
        }
        let mut marked = vec![false; mesh.vertex_count];
        self.reach.dangling.iter().for_each(|&v| marked[v as usize] = true);
        running.room.move_balls(mesh, query, &mut self.reach, running.frames_left);
        running.pairs.remove(mesh, &marked);
        work.elementary(0, running.pairs.len() as u64, 0, 0);
        let Room { middles, radii, thickness, .. } = &running.room;
        let (triangles, fitted) = upwards.refit(
            &mut self.boxes,
            tree,
            mesh,
            (middles, radii, *thickness),
            &self.reach.dangling,
            &leaves,
        );
        work.updated(self.reach.dangling.len(), fitted as usize);
        self.stats.dangling_vertices = self.reach.dangling.len() as u64;
        self.stats.dangling_triangles = triangles;
        let updated = Instant::now();
        let register = || Streaming::new(Register::new(mesh, middles, radii, Some(&marked), *thickness));
        let expected = |tests: Option<f64>| tests.map(|t| (t * leaves.len() as f64) as u64);
        let one = expected(self.tests_per_leaf[0]).unwrap_or(one_by_one_tests(tree, leaves.len()));
        let all = expected(self.tests_per_leaf[1]).unwrap_or(tree.block_count() as u64);
        self.stats.one_by_one = one < all;
        let (visits, counts) = if self.stats.one_by_one {
            let (mut candidates, mut sink, mut counts) =
                (Candidates::default(), register().sink, TraverseCounts::default());
            counts.box_tests = one_by_one(tree, &self.boxes, mesh, &leaves, |a, b| {
                counts.leaf_pairs += 1;
                leaf_pair::features(tree, &self.boxes, a, b, &mut candidates);
                sink.take(&mut candidates);
            });
            (vec![Streaming::new(sink)], counts)
        } else {
            traverse(tree, &self.boxes, mesh, pool, register)
        };
        let which = usize::from(!self.stats.one_by_one);
        self.tests_per_leaf[which] = Some(counts.box_tests as f64 / leaves.len().max(1) as f64);
        take_registered(visits, counts, &mut running.pairs, work);
        self.stats.update_seconds += (updated - start).as_secs_f64();
        self.stats.traversal_seconds += updated.elapsed().as_secs_f64();
        true
    }

    /// Both filters on the pending list.
    fn elementary(
        &mut self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        running: &Running,
        work: &mut Work,
        pool: &rayon::ThreadPool,
    ) -> Contacts {
        let start = Instant::now();
        let scene = Scene::new_in(mesh, query, pool);
        let front_end = FrontEnd {
            mesh,
            reach: &self.reach.of_vertex,
            largest: self.reach.largest,
            thickness: query.thickness,
        };
        let decide = |mut candidates: Candidates| {
            let mut narrow = Narrow::new(&scene);
            let admissible = candidates.vertex_triangle.len() + candidates.edge_edge.len();
            narrow.take(&mut candidates);
            (narrow, admissible as u64)
        };
        let parts = front_end.run(&running.pairs, decide, pool);
        self.stats.admissible = parts.iter().map(|p| p.1).sum();
        let out = merge(parts.into_iter().map(|p| p.0));
        self.stats.pending = running.pairs.len() as u64;
        self.stats.pair_bytes = running.pairs.bytes() as u64;
        work.elementary(
            mesh.vertex_count,
            self.stats.pending,
            self.stats.admissible,
            out.stats.root_searches,
        );
        self.stats.elementary_seconds = start.elapsed().as_secs_f64();
        out
    }

    /// One frame, inside a session or as the first of one.
    fn frame(
        &mut self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        pool: &rayon::ThreadPool,
    ) -> Result<Contacts, DetectError> {
        let mut work = Work::default();
        let mut running = self.running.take().filter(|r| query.thickness <= r.room.thickness);
        let mut is_same_frame = false;
        let start = Instant::now();
        if let Some(session) = &mut running {
            session.room.reach(mesh, query, &mut self.reach, pool);
            is_same_frame = self.reach.signature == session.signature;
            self.stats.update_seconds += start.elapsed().as_secs_f64();
            if !is_same_frame && session.frames_left == 0
                || !self.reach.dangling.is_empty()
                    && !self.take_in_dangling(mesh, query, session, &mut work, pool)
            {
                running = None;
            }
        }
        self.stats.kind = FrameKind::Skipping;
        if running.is_none() {
            self.adaptation.session_ends();
            let plan = match self.options.variant {
                Variant::NSwD => Plan::Session { frames: 1, alpha: 0.0 },
                _ => self.adaptation.plan(),
            };
            let is_planned = plan == Plan::Alone;
            if let Plan::Session { frames, alpha } = plan {
                let is_one = frames == 1;
                let (beta, gamma) = if is_one { (0.0, 0.0) } else { (self.options.beta, self.options.gamma) };
                let weights = Weights { alpha, beta, gamma };
                running = self.start(mesh, query, (frames, weights), &mut work, pool);
            }
            let Some(session) = &running else {
                self.stats.kind = FrameKind::Alone;
                return self.alone(mesh, query, is_planned, pool);
            };
            let start = Instant::now();
            session.room.reach(mesh, query, &mut self.reach, pool);
            self.stats.update_seconds += start.elapsed().as_secs_f64();
            self.stats.kind = FrameKind::First;
        }
        let Some(mut session) = running else { unreachable!("a frame without a session has returned") };
        let mut out = self.elementary(mesh, query, &session, &mut work, pool);
        session.signature = self.reach.signature;
        (self.stats.frames, self.stats.alpha) = (session.frames, session.room.alpha);
        self.stats.work = work.total();
        let cost = self.cost();
        let has_better_end = match self.stats.kind {
            FrameKind::First => {
                self.adaptation.first_frame(cost);
                false
            }
            _ if is_same_frame => {
                self.adaptation.same_frame(cost);
                false
            }
            _ => {
                session.frames_left -= 1;
                self.adaptation.further_frame(cost)
            }
        };
        out.stats.broad_phase_tests = work.box_tests;
        out.stats.leaf_pairs = work.leaf_pairs;
        out.stats.seconds = vec![
            ("update", self.stats.update_seconds),
            ("traversal", self.stats.traversal_seconds),
            ("elementary tests", self.stats.elementary_seconds),
        ];
        self.running = (!has_better_end).then_some(session);
        Ok(out)
    }
}

fn take_registered(
    visits: Vec<Streaming<Register<'_>>>,
    counts: TraverseCounts,
    pairs: &mut Pairs,
    work: &mut Work,
) {
    let sinks: Vec<Register<'_>> = visits.into_iter().map(|v| v.sink).collect();
    let distance_tests = sinks.iter().map(|s| s.distance_tests).sum();
    pairs.append(&sinks.into_iter().map(|s| s.pairs).collect::<Vec<_>>());
    work.traversed(counts, distance_tests);
}

impl Detector for SkippingSession {
    fn name(&self) -> &'static str {
        "session"
    }

    fn detect(
        &mut self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        pool: &rayon::ThreadPool,
    ) -> Result<Contacts, DetectError> {
        query.check(mesh)?;
        self.check_mesh(mesh)?;
        self.stats = SessionStats::default();
        // Once into the pool, not once for every stage.
        let out = pool.install(|| match self.options.variant {
            Variant::NoDup | Variant::RTri => Ok(self.every_frame(mesh, query, pool)),
            Variant::NSwD | Variant::SwD => self.frame(mesh, query, pool),
        })?;
        self.stats.colliding = (out.vertex_triangle.len() + out.edge_edge.len()) as u64;
        Ok(out)
    }
}
