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
//! A block of the tree that certainly does not meet itself ([`flat`]) is not traversed against itself.
//!
//! Nothing of a session is part of an answer: a session that starts in any frame finds the same contacts.
//!
//! Source: \[wong2010\].

mod adapt;
mod balls;
pub(crate) mod contour;
mod dangling;
pub(crate) mod distance;
mod every_frame;
pub(crate) mod flat;
mod frame;
mod meeting;
mod options;
mod pairs;
mod reach;
mod room;
mod samples;
mod stages;
mod stats;
mod work;

use crate::bvh::refit::Boxes;
use crate::ccd::motions::Motions;
use crate::{Body, Bvh, CollisionMesh, Contacts, DetectError, Detector, Query, Vec3};
use adapt::{Adaptation, Plan};
use contour::Contours;
use dangling::Upwards;
use meeting::Featured;
use pairs::Pairs;
use reach::Reach;
use room::{Room, Weights};
use samples::Samples;
use std::time::Instant;
use work::Work;

pub use options::{Adapt, Frames, MOST_FRAMES, SessionOptions, Variant};
pub use stats::{FrameKind, SessionStats};

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
    /// Those of the present session.
    pairs: Pairs,
    /// Which vertices have pairs, or had some in this session.
    has_pairs: Vec<bool>,
    boxes: Boxes<1>,
    featured: Featured,
    upwards: Option<Upwards>,
    contours: Option<Contours>,
    samples: Samples,
    reach: Reach,
    /// Of the vertices that have pairs.
    motions: Motions,
    /// Tests per dangling leaf when last met one by one, and all at once.
    tests_per_leaf: [Option<f64>; 2],
    stats: SessionStats,
}

/// The present session.
#[derive(Debug, Clone)]
struct Running {
    room: Room,
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
            pairs: Pairs::default(),
            has_pairs: vec![],
            boxes: Boxes::default(),
            featured: Featured::all(),
            upwards: None,
            contours: None,
            samples: Samples::new(mesh),
            reach: Reach::default(),
            motions: Motions::default(),
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
        if self.triangles != mesh.triangles {
            let differs = |&t: &usize| self.triangles[t] != mesh.triangles[t];
            let triangle = (0..self.triangles.len()).find(differs).unwrap_or(0);
            return Err(DetectError::ChangedTopology { triangle });
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
            session.room.reach(mesh, query, false, &mut self.reach, pool);
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
            if self.adaptation.is_fresh() {
                self.adaptation.starts_with(room::steps_in_edges(mesh, &self.samples, query));
            }
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
            if running.is_none() {
                self.stats.kind = FrameKind::Alone;
                return self.alone(mesh, query, is_planned, pool);
            }
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

impl Detector for SkippingSession {
    fn name(&self) -> &'static str {
        "session"
    }

    fn host_bytes(&self) -> usize {
        let lists = size_of_val(&self.triangles[..]) + size_of_val(&self.vertex_body[..]);
        let pairs = if self.running.is_some() { self.stats.pair_bytes as usize } else { 0 };
        self.bvh.bytes() + lists + pairs
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
