//! One step's response, stages in reading order.

use crate::collisions::{APPROACH, Detection, Hit, look_again, unresolved};
use crate::frames::Frames;
use crate::hold::hold_back;
use crate::motion::{Motion, MotionBuffers, bytes_of};
use crate::repulsion::{self, BAND};
use crate::sweeps::ContactSet;
use crate::zones::{Zones, move_zones};
use crate::{ResponseError, ResponseInfo, ResponseParams, Vec3};
use cloth_collision::{Bvh, CollisionMesh, Detector, StencilKind};
use std::collections::HashSet;
use std::time::Instant;

/// Turns the unconstrained end of a step into an accepted one.
///
/// Holds parameters and reusable buffers, no state that a checkpoint would miss: a step's answer depends on the
/// arguments alone, and not on the number of threads.
pub struct Responder {
    params: ResponseParams,
    rest_x: Vec<Vec3>,
    buffers: MotionBuffers,
    contacts: ContactSet,
    frames: Frames,
    zones: Zones,
    hits: Vec<Hit>,
    /// Contacts on sides and corners that are in the set already.
    shared: HashSet<[u32; 4]>,
}

impl Responder {
    /// A responder for the bodies of `mesh`.
    ///
    /// # Errors
    /// What [`ResponseParams::check`] refuses.
    pub fn new(mesh: &CollisionMesh, params: ResponseParams) -> Result<Self, ResponseError> {
        params.check(mesh.bodies.len())?;
        Ok(Self {
            params,
            rest_x: Vec::new(),
            buffers: MotionBuffers::with_capacity(mesh.vertex_count),
            contacts: ContactSet::default(),
            frames: Frames::default(),
            zones: Zones::default(),
            hits: Vec::new(),
            shared: HashSet::new(),
        })
    }

    /// Declares the undeformed positions \[m\] of all vertices, one per vertex.
    ///
    /// Two points of one body then rest at no more than half of the distance that they have undeformed (instead of
    /// at the thickness), so that a mesh finer than the thickness is not blown up by its own neighbours.
    ///
    /// # Errors
    /// [`ResponseError::Length`], [`ResponseError::NotFinite`].
    pub fn set_rest(&mut self, mesh: &CollisionMesh, rest_x: &[Vec3]) -> Result<(), ResponseError> {
        check("rest_x", rest_x, mesh.vertex_count)?;
        self.rest_x = rest_x.to_vec();
        Ok(())
    }

    /// Memory of the buffers that are kept from step to step \[B\]: what each vertex needs from the start, and what the
    /// contacts of the steps so far have needed.
    pub fn bytes(&self) -> usize {
        // A hash set's slots: one byte of control each.
        let slots = self.shared.capacity() * (size_of::<[u32; 4]>() + 1);
        bytes_of(&self.rest_x)
            + self.buffers.bytes()
            + self.contacts.bytes()
            + self.frames.bytes()
            + self.zones.bytes()
            + bytes_of(&self.hits)
            + slots
    }

    /// Changes `x_t1` and `v` so that the straight motion `x_t0` → `x_t1` has no known collision.
    ///
    /// - `bvh`: built for `mesh`; finds proximities and continuous contacts.
    /// - `inv_mass` \[1/kg\]: 0 for prescribed vertices, whose `x_t1` and `v` are left as they are.
    /// - `x_t0` \[m\]: the accepted start. `x_t1` \[m\], `v` \[m/s\]: the end of the step without contact.
    /// - `dt` \[s\] > 0.
    ///
    /// With the average velocity v̄ = (x_t1 − x_t0)/dt the stages are: repulsion and resting contact of near pairs;
    /// passes of continuous detection and impulses with friction; rigid impact zones; holding back. After the first
    /// detection over all pairs each further one looks at the pairs with a changed vertex (the others stand
    /// certified). `v` changes by the change of v̄.
    ///
    /// # Errors
    /// [`ResponseError::Unresolved`] if cloth is caught between prescribed motions (retry with a smaller step), or if
    /// pairs touch at `x_t0` and `allow_initial_contacts` is off; [`ResponseError::Length`],
    /// [`ResponseError::NotFinite`], [`ResponseError::Parameter`] for input that is refused. In each case `x_t1` and
    /// `v` are as they were.
    pub fn respond(
        &mut self,
        mesh: &CollisionMesh,
        bvh: &mut Bvh,
        inv_mass: &[f64],
        x_t0: &[Vec3],
        x_t1: &mut [Vec3],
        v: &mut [Vec3],
        dt: f64,
        pool: &rayon::ThreadPool,
    ) -> Result<ResponseInfo, ResponseError> {
        self.run(Detection { mesh, bvh, other: None, pool }, inv_mass, x_t0, x_t1, v, dt)
    }

    /// [`Responder::respond`] with another method for the continuous detection; `bvh` still finds proximities.
    ///
    /// # Errors
    /// As [`Responder::respond`].
    pub fn respond_with(
        &mut self,
        mesh: &CollisionMesh,
        bvh: &mut Bvh,
        continuous: &mut dyn Detector,
        inv_mass: &[f64],
        x_t0: &[Vec3],
        x_t1: &mut [Vec3],
        v: &mut [Vec3],
        dt: f64,
        pool: &rayon::ThreadPool,
    ) -> Result<ResponseInfo, ResponseError> {
        self.run(Detection { mesh, bvh, other: Some(continuous), pool }, inv_mass, x_t0, x_t1, v, dt)
    }

    fn run(
        &mut self,
        mut detection: Detection<'_>,
        inv_mass: &[f64],
        x_t0: &[Vec3],
        x_t1: &mut [Vec3],
        v: &mut [Vec3],
        dt: f64,
    ) -> Result<ResponseInfo, ResponseError> {
        let Self { params, rest_x, buffers, contacts, frames, zones, hits, shared } = self;
        let (mesh, count) = (detection.mesh, detection.mesh.vertex_count);
        check_input(count, inv_mass, x_t0, x_t1, v, dt)?;
        let mut info = ResponseInfo::default();
        let mut clock = Clock(Instant::now());
        let motion = &mut Motion::new(buffers, inv_mass, x_t0, x_t1, dt);
        frames.clear(mesh.bodies.len());
        contacts.clear();
        hits.clear();

        // 1. Near pairs at the start: resting contact and repulsion.
        let near = detection.bvh.proximity(mesh, x_t0, BAND * params.thickness, None, detection.pool)?;
        info.proximities = near.len();
        clock.lap(&mut info, "proximity");
        shared.clear();
        for stencil in &near {
            if let Some(contact) = repulsion::contact(stencil, mesh, params, rest_x, motion)
                && contact.shared_feature().is_none_or(|key| shared.insert(key))
            {
                contacts.push(contact);
            }
        }
        relax(contacts, motion, params, &mut info);
        motion.write_ends();
        clock.lap(&mut info, "impulses");

        // 2. Collisions during the step, answered by impulses; the first look is at all pairs.
        let mut exempt = HashSet::new();
        let mut judge = |hits: &mut Vec<Hit>| {
            if params.allow_initial_contacts {
                hits.retain(|hit| {
                    let out = hit.touches_at_start(x_t0);
                    if out {
                        exempt.insert(hit.key());
                    }
                    !out
                });
            }
        };
        detection.hits(motion, APPROACH * params.thickness, false, hits)?;
        motion.clear_changed();
        info.passes = 1;
        judge(hits);
        info.collisions = hits.len();
        clock.lap(&mut info, "detection");
        let mut answered: HashSet<(StencilKind, [u32; 2])> = HashSet::new();
        while !hits.is_empty() && info.passes < params.max_passes {
            for hit in hits.iter() {
                answered.insert(hit.key());
                if let Some(contact) = hit.contact(mesh, params, rest_x, motion) {
                    contacts.push(contact);
                }
            }
            relax(contacts, motion, params, &mut info);
            let moved = motion.write_ends();
            clock.lap(&mut info, "impulses");
            if moved == 0 {
                break;
            }
            info.passes += 1;
            look_again(&mut detection, motion, APPROACH * params.thickness, hits)?;
            judge(hits);
            // A pair that was pushed apart and only comes near is no collision.
            hits.retain(|hit| !answered.contains(&hit.key()) || hit.collides(x_t0, &motion.buffers.end));
            clock.lap(&mut info, "detection");
        }
        hits.retain(|hit| hit.collides(x_t0, &motion.buffers.end));
        info.impulses = contacts.loaded();

        // 3. Rigid impact zones.
        if !hits.is_empty() && params.max_zone_passes > 0 {
            move_zones(zones, &mut detection, motion, frames, params, hits, &mut info, &mut judge)?;
            clock.lap(&mut info, "zones");
        }

        // 4. What still collides is held back.
        if !hits.is_empty() {
            hold_back(&mut detection, motion, frames, params.thickness, hits, &mut info, &mut judge)?;
            clock.lap(&mut info, "hold");
        }

        // 5. Every pair has been seen free of collision on the motion that it has now, or is exempt.
        if !hits.is_empty() {
            return Err(unresolved(hits));
        }
        info.exempt = exempt.len();
        for i in 0..count {
            let change = buffers.velocity[i] - buffers.velocity_start[i];
            if inv_mass[i] > 0.0 && change != Vec3::zeros() {
                x_t1[i] = buffers.end[i];
                v[i] += change;
            }
        }
        Ok(info)
    }
}

fn relax(
    contacts: &mut ContactSet,
    motion: &mut Motion<'_>,
    params: &ResponseParams,
    info: &mut ResponseInfo,
) {
    let sweeps = contacts.relax(motion, params.velocity_tolerance, params.max_sweeps);
    info.sweeps += sweeps.sweeps;
    info.residual = sweeps.residual;
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

fn check_input(
    count: usize,
    inv_mass: &[f64],
    x_t0: &[Vec3],
    x_t1: &[Vec3],
    v: &[Vec3],
    dt: f64,
) -> Result<(), ResponseError> {
    if !(dt.is_finite() && dt > 0.0) {
        return Err(ResponseError::Parameter { name: "dt", expected: "a finite time > 0 s", got: dt });
    }
    if inv_mass.len() != count {
        return Err(ResponseError::Length { name: "inv_mass", expected: count, got: inv_mass.len() });
    }
    if let Some(&got) = inv_mass.iter().find(|m| !(m.is_finite() && **m >= 0.0)) {
        return Err(ResponseError::Parameter { name: "inv_mass", expected: "a finite number ≥ 0", got });
    }
    check("x_t0", x_t0, count)?;
    check("x_t1", x_t1, count)?;
    check("v", v, count)
}

fn check(name: &'static str, values: &[Vec3], count: usize) -> Result<(), ResponseError> {
    if values.len() != count {
        return Err(ResponseError::Length { name, expected: count, got: values.len() });
    }
    match values.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
        Some(vertex) => Err(ResponseError::NotFinite { name, vertex }),
        None => Ok(()),
    }
}
