//! The stages of a frame: tree update and traversal, dangling triangles, elementary tests.

use super::contour::{self, Contours};
use super::dangling::{Upwards, ball_box, one_by_one, one_by_one_tests};
use super::meeting::{Featured, is_by_need};
use super::pairs::{Admissible, Found, FrontEnd, Pairs, Register};
use super::room::{FARTHEST, Room, Weights};
use super::work::Work;
use super::{Running, SkippingSession, flat};
use crate::bvh::narrow::{self, Narrow, Scene, merge};
use crate::bvh::traverse::{Streaming, TraverseCounts};
use crate::{CollisionMesh, Contacts, Query, Vec3};
use std::time::Instant;

/// A session in which more than this share of the leaves dangles in one frame starts anew.
const MOST_DANGLING: f64 = 0.25;

impl SkippingSession {
    /// The first frame's tree update and traversal; None if the motion leaves no room for a session.
    pub(super) fn start(
        &mut self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        (frames, weights): (u32, Weights),
        work: &mut Work,
        pool: &rayon::ThreadPool,
    ) -> Option<Running> {
        let start = Instant::now();
        let mut room = Room::new(mesh, &self.samples, query, weights, pool)?;
        room.reach(mesh, query, true, &mut self.reach, pool);
        if !(self.reach.extent < FARTHEST) {
            return None;
        }
        let tree = &self.bvh.tree;
        let of_vertex = |v: usize| ball_box(&room.middles[v], room.radii[v], room.thickness);
        self.featured = if is_by_need(tree, mesh) {
            self.boxes.refit_blocks(tree, mesh, of_vertex, None, pool);
            Featured::none(tree)
        } else {
            self.boxes.refit(tree, mesh, of_vertex, None, pool);
            Featured::all()
        };
        work.updated(mesh.vertex_count, tree.block_count());
        if self.options.low_curvature && tree.roots.iter().any(|root| mesh.bodies_meet(root.body, root.body))
        {
            let contours = self.contours.get_or_insert_with(|| Contours::new(tree, mesh));
            let is_simple =
                |loops: &[Vec<u32>], axis: &Vec3, position: &(dyn Fn(u32) -> Vec3 + Sync), clearance| {
                    contour::is_simple(loops, axis, position, clearance)
                };
            let flat =
                flat::mark(&mut self.boxes, tree, mesh, &room.whereabouts(), contours, is_simple, pool);
            (self.stats.flat_surfaces, self.stats.flat_triangles) = (flat.surfaces, flat.triangles);
        }
        let updated = Instant::now();
        let register =
            || Streaming::new(Register::new(mesh, &room.middles, &room.radii, None, room.thickness));
        let (visits, counts) = self.featured.meet(tree, &mut self.boxes, mesh, register, pool);
        self.pairs.clear();
        self.has_pairs.clear();
        self.has_pairs.resize(mesh.vertex_count, false);
        take_registered(visits, counts, mesh, (&mut self.pairs, &mut self.has_pairs), work);
        self.stats.update_seconds += (updated - start).as_secs_f64();
        self.stats.traversal_seconds += updated.elapsed().as_secs_f64();
        // A room smaller than asked for lasts less long.
        let lasting = room.alpha as u32 + 1;
        let frames = if room.alpha < weights.alpha { frames.min(lasting) } else { frames };
        Some(Running { room, frames, frames_left: frames - 1, signature: 0 })
    }

    /// Gives dangling vertices other balls and registers their pairs anew; false if a new session is cheaper.
    pub(super) fn take_in_dangling(
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
        self.pairs.remove(&marked);
        work.elementary(0, self.pairs.len() as u64, 0, 0);
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
            let mut pairs = vec![];
            let box_tests = one_by_one(tree, &self.boxes, mesh, &leaves, |a, b| pairs.push([a, b]));
            let counts = TraverseCounts { box_tests, leaf_pairs: pairs.len() as u64 };
            (vec![self.featured.meet_pairs(tree, &mut self.boxes, &pairs, register(), pool)], counts)
        } else {
            self.featured.meet(tree, &mut self.boxes, mesh, register, pool)
        };
        let which = usize::from(!self.stats.one_by_one);
        self.tests_per_leaf[which] = Some(counts.box_tests as f64 / leaves.len().max(1) as f64);
        take_registered(visits, counts, mesh, (&mut self.pairs, &mut self.has_pairs), work);
        self.stats.update_seconds += (updated - start).as_secs_f64();
        self.stats.traversal_seconds += updated.elapsed().as_secs_f64();
        true
    }

    /// Both filters on the pending list.
    pub(super) fn elementary(
        &mut self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        running: &Running,
        work: &mut Work,
        pool: &rayon::ThreadPool,
    ) -> Contacts {
        let start = Instant::now();
        let mut motions = std::mem::take(&mut self.motions);
        let about = (running.room.origin, self.reach.extent);
        motions.refill([narrow::start(query), query.x_t1], query.thickness, about, &self.has_pairs, pool);
        let scene = Scene::with(mesh, query, motions);
        let front_end = FrontEnd { reach: &self.reach.of_vertex, thickness: query.thickness };
        let decide = |admissible: Admissible| {
            let mut narrow = Narrow::new(&scene);
            narrow.take_strangers(admissible.kind, &admissible.pairs, &admissible.vertices);
            (narrow, admissible.pairs.len() as u64)
        };
        let parts = front_end.run(&self.pairs, decide, pool);
        self.stats.admissible = parts.iter().map(|p| p.1).sum();
        let out = merge(parts.into_iter().map(|p| p.0));
        self.motions = scene.into_motions();
        self.stats.pending = self.pairs.len() as u64;
        self.stats.pair_bytes = self.pairs.bytes() as u64;
        work.elementary(
            mesh.vertex_count,
            self.stats.pending,
            self.stats.admissible,
            out.stats.root_searches,
        );
        self.stats.elementary_seconds = start.elapsed().as_secs_f64();
        out
    }
}

fn take_registered(
    visits: Vec<Streaming<Register<'_>>>,
    counts: TraverseCounts,
    mesh: &CollisionMesh,
    (pairs, has_pairs): (&mut Pairs, &mut [bool]),
    work: &mut Work,
) {
    let sinks: Vec<Register<'_>> = visits.into_iter().map(|v| v.sink).collect();
    let distance_tests = sinks.iter().map(|s| s.distance_tests).sum();
    let found: Vec<[Found; 2]> = sinks.into_iter().map(|s| s.found).collect();
    pairs.append(&found, mesh, has_pairs);
    work.traversed(counts, distance_tests);
}
