//! The stages of one step's response, in reading order.

use crate::collisions::{APPROACH, Detection, Hit, look_again, unresolved};
use crate::frames::Frames;
use crate::friction::kernel::Kernel;
use crate::gaps::Gaps;
use crate::hold::hold_back;
use crate::landing::follow;
use crate::motion::{Motion, bytes_of};
use crate::repulsion::{self, BAND};
use crate::resting::{meetings, wake};
use crate::sides::Sides;
use crate::strain::limiter::Limiter;
use crate::sweeps::ContactSet;
use crate::zones::{Zones, move_zones};
use crate::{ResponseError, ResponseInfo, ResponseParams, Vec3};
use cloth_collision::{Stencil, StencilKind};
use std::collections::{BTreeSet, HashSet};
use std::time::Instant;

/// Cap on the times that strain limits are made anew within one pass.
const MAX_STRAIN_PASSES: usize = 40;
/// After so many of these the largest excess has to be less than this part of what it was, or no more are made.
const STRAIN_PASSES_APART: usize = 8;
const WORTH_GOING_ON: f64 = 0.9;
/// Cap on the rounds of passes, zones and holding back, where these leave a strain limit broken.
const MAX_ROUNDS: usize = 4;

/// What the stages keep from step to step: buffers, and what was declared.
#[derive(Default)]
pub(crate) struct Stages {
    /// Undeformed positions, or empty.
    pub(crate) rest_x: Vec<Vec3>,
    pub(crate) limiter: Limiter,
    frames: Frames,
    zones: Zones,
    hits: Vec<Hit>,
    /// Sides of the near pairs of the last accepted step.
    pub(crate) sides: Sides,
    /// Those of the step that may yet be accepted.
    next_sides: Option<Sides>,
    spare_sides: Sides,
    /// Contacts on sides and corners that are in the set already.
    shared: HashSet<[u32; 4]>,
    /// Which vertices the first detection looks at; none: all.
    pub(crate) gaps: Option<Gaps>,
    /// What a run that was given up leaves to the one that takes the step instead.
    left: Option<Left>,
}

/// Of a run with a tentative kernel.
struct Left {
    near: Vec<Stencil>,
    seconds: Vec<(&'static str, f64)>,
}

impl Stages {
    /// `skip_proved`: as in [`ResponseParams`].
    pub(crate) fn new(skip_proved: bool) -> Self {
        Self { gaps: skip_proved.then(Gaps::default), ..Self::default() }
    }

    /// Memory [B].
    pub(crate) fn bytes(&self) -> usize {
        // A hash set's slots: one byte of control each.
        let slots = self.shared.capacity() * (size_of::<[u32; 4]>() + 1);
        bytes_of(&self.rest_x)
            + self.limiter.bytes()
            + self.frames.bytes()
            + self.zones.bytes()
            + bytes_of(&self.hits)
            + self.sides.bytes()
            + self.next_sides.as_ref().map_or(0, Sides::bytes)
            + self.spare_sides.bytes()
            + slots
            + self.gaps.as_ref().map_or(0, Gaps::bytes)
            + self.left.as_ref().map_or(0, |left| bytes_of(&left.near))
    }

    /// Takes over what the last run found out about sides.
    pub(crate) fn accept(&mut self) {
        if let Some(next) = self.next_sides.take() {
            self.spare_sides = std::mem::replace(&mut self.sides, next);
        }
    }

    /// Changes the motion so that it has no known collision and keeps the strain limits.
    ///
    /// `None`: the kernel is tentative and does not hold ([`Kernel::holds`]); the motion is to be taken anew with another.
    pub(crate) fn run<K: Kernel>(
        &mut self,
        params: &ResponseParams,
        contacts: &mut ContactSet<K>,
        detection: &mut Detection<'_>,
        motion: &mut Motion<'_>,
    ) -> Result<Option<ResponseInfo>, ResponseError> {
        let left = self.left.take();
        let mut sides = self.next_sides.take().unwrap_or_else(|| std::mem::take(&mut self.spare_sides));
        let Self { rest_x, limiter, frames, zones, hits, shared, gaps, left: kept, .. } = self;
        let (mesh, x_t0, resting) = (detection.mesh, motion.x_t0, detection.resting);
        let moving = resting.map(|r| r.moving);
        let mut met = BTreeSet::new();
        let mut info = ResponseInfo::default();
        let mut clock = Clock(Instant::now());
        frames.clear(mesh.bodies.len());
        contacts.clear();
        limiter.begin();
        hits.clear();

        // 1. Near pairs at the start: resting contact and repulsion.
        let mut near = if let (Some(left), false) = (left, K::TENTATIVE) {
            info.seconds = left.seconds;
            left.near
        } else {
            detection.bvh.proximity(mesh, x_t0, BAND * params.thickness, moving, detection.pool)?
        };
        if K::TENTATIVE {
            *kept = Some(Left { near: near.clone(), seconds: Vec::new() });
        }
        info.proximities = near.len();
        info.flat_triangles = detection.bvh.flat_triangles();
        if let Some(resting) = resting {
            info.meetings = meetings(mesh, &near);
            met.extend(near.iter().flat_map(|s| resting.sleepers(s.vertices)));
            wake(&met)?;
        }
        info.by_side = sides.renew(&self.sides, &mut near, mesh, motion);
        info.remembered = sides.pairs().len();
        clock.lap(&mut info, "proximity");
        shared.clear();
        follow(&near, mesh, &motion.buffers.end, |pair| {
            if let Some(contact) = repulsion::contact(&pair, mesh, params, rest_x, motion, &contacts.kernel)
                && contact.shared_feature().is_none_or(|key| shared.insert(key))
            {
                contacts.push(contact);
            }
        });
        settle(contacts, limiter, motion, params, &mut info);
        clock.lap(&mut info, "impulses");
        if !contacts.hold(motion, params.velocity_tolerance) {
            return Ok(self.give_up(sides, info));
        }

        // 2. Collisions during the step, answered by impulses; the first look is at all pairs.
        let mut exempt = HashSet::new();
        let mut judge = |hits: &mut Vec<Hit>| {
            if let Some(resting) = resting {
                met.extend(hits.iter().flat_map(|hit| resting.sleepers(hit.vertices)));
            }
            if params.allow_initial_contacts {
                hits.retain(|hit| {
                    let out = hit.touches_at_start(x_t0) || sides.is_through(hit.kind, hit.vertices);
                    if out {
                        exempt.insert((hit.kind, hit.vertices));
                    }
                    !out
                });
            }
        };
        let approach = APPROACH * params.thickness;
        info.looked_at = mesh.vertex_count;
        if let Some(gaps) = gaps {
            let (only, count) =
                gaps.vertices_in_reach(mesh, motion, &near, BAND * params.thickness, approach, moving);
            info.looked_at = count;
            // Nearly all: a mask would only cost.
            let only = if count < mesh.vertex_count / 2 { Some(only) } else { moving };
            if count > 0 {
                detection.hits(motion, approach, only, hits)?;
            }
        } else {
            detection.hits(motion, approach, moving, hits)?;
        }
        motion.clear_changed();
        info.passes = 1;
        judge(hits);
        info.collisions = hits.len();
        clock.lap(&mut info, "detection");
        let mut worst = f64::INFINITY;
        let mut answered: HashSet<(StencilKind, [u32; 2])> = HashSet::new();
        for round in 1.. {
            let most = info.passes + params.max_passes - 1;
            while !hits.is_empty() && info.passes < most {
                for hit in hits.iter() {
                    answered.insert(hit.key());
                    if let Some(contact) = hit.contact(mesh, params, rest_x, motion, &contacts.kernel, &sides)
                    {
                        contacts.push(contact);
                    }
                }
                let moved = settle(contacts, limiter, motion, params, &mut info);
                clock.lap(&mut info, "impulses");
                if !contacts.hold(motion, params.velocity_tolerance) {
                    return Ok(self.give_up(sides, info));
                }
                if moved == 0 {
                    break;
                }
                info.passes += 1;
                look_again(detection, motion, APPROACH * params.thickness, hits)?;
                judge(hits);
                // A pair that was pushed apart and only comes near is no collision.
                hits.retain(|hit| !answered.contains(&hit.key()) || hit.collides(x_t0, &motion.buffers.end));
                clock.lap(&mut info, "detection");
            }
            hits.retain(|hit| hit.collides(x_t0, &motion.buffers.end));
            contacts.count(motion, params.velocity_tolerance, &mut info);

            // 3. Rigid impact zones.
            if !hits.is_empty() && params.max_zone_passes > 0 {
                move_zones(zones, detection, motion, frames, params, hits, &mut info, &mut judge)?;
                clock.lap(&mut info, "zones");
            }

            // 4. What still collides is held back.
            if !hits.is_empty() {
                hold_back(detection, motion, frames, params.thickness, hits, &mut info, &mut judge)?;
                clock.lap(&mut info, "hold");
            }

            // 5. Every pair has been seen free of collision on the motion that it has now, or is exempt.
            if !hits.is_empty() {
                return Err(unresolved(hits));
            }
            if limiter.is_off() {
                break;
            }
            // 6. Every limited edge is inside of its limit, or all is done again.
            let (edges, excess) = limiter.beyond(motion);
            if edges.is_empty() {
                limiter.measure(contacts, motion, &mut info);
                break;
            }
            if round == MAX_ROUNDS || excess > WORTH_GOING_ON * worst {
                return Err(ResponseError::Strained { edges, excess });
            }
            worst = excess;
            settle(contacts, limiter, motion, params, &mut info);
            info.passes += 1;
            look_again(detection, motion, APPROACH * params.thickness, hits)?;
            judge(hits);
            clock.lap(&mut info, "strain");
        }
        // Zones, holding back and limits move vertices too.
        if !contacts.hold(motion, params.velocity_tolerance) {
            return Ok(self.give_up(sides, info));
        }
        *kept = None;
        info.exempt = exempt.len();
        wake(&met)?;
        sides.end_step(|kind, vertices| exempt.contains(&(kind, vertices)));
        self.next_sides = Some(sides);
        Ok(Some(info))
    }

    /// Ends a run whose kernel does not hold.
    fn give_up(&mut self, sides: Sides, info: ResponseInfo) -> Option<ResponseInfo> {
        self.spare_sides = sides;
        if let Some(left) = &mut self.left {
            left.seconds = info.seconds;
        }
        None
    }
}

/// Relaxes the contacts, and the strain limits with them until all are kept; the number of vertices whose ends moved.
fn settle<K: Kernel>(
    contacts: &mut ContactSet<K>,
    limiter: &mut Limiter,
    motion: &mut Motion<'_>,
    params: &ResponseParams,
    info: &mut ResponseInfo,
) -> usize {
    let mut moved = 0;
    let mut earlier = f64::INFINITY;
    // Contacts first: where the motion goes through a collider, edges point there too.
    for pass in 1..=MAX_STRAIN_PASSES {
        let sweeps = contacts.relax(motion, params.velocity_tolerance, params.max_sweeps);
        info.sweeps += sweeps.sweeps;
        info.residual = sweeps.residual;
        moved += motion.write_ends();
        if limiter.is_off() {
            break;
        }
        info.strain_passes += 1;
        let excess = limiter.linearise(contacts, motion);
        if excess == 0.0 {
            break;
        }
        if pass % STRAIN_PASSES_APART == 0 {
            if excess > WORTH_GOING_ON * earlier {
                break;
            }
            earlier = excess;
        }
    }
    moved
}

struct Clock(Instant);

impl Clock {
    /// Books the time since the last lap on a stage.
    fn lap(&mut self, info: &mut ResponseInfo, stage: &'static str) {
        let now = Instant::now();
        info.add_seconds(stage, (now - self.0).as_secs_f64());
        self.0 = now;
    }
}
