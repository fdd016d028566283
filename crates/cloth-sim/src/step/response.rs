//! The step's response to contact, and what dynamics are to expect of it.

use super::{Failure, State};
use crate::constraints::Holds;
use crate::contact::{ContactStage, stage};
use crate::guard::Alarm;
use crate::report::add_seconds;
use crate::{Simulation, StepReport, Vec3};
use cloth_collision::DetectError;
use cloth_response::{ResponseError, ResponseInfo, Resting};

impl Simulation {
    /// The state at `t1` after response to the motion from the state as it is to `x` with end velocities `v`.
    pub(crate) fn meet(
        &mut self,
        t1: f64,
        dt: f64,
        mut x: Vec<Vec3>,
        mut v: Vec<Vec3>,
        holds: Holds,
        report: &mut StepReport,
    ) -> Result<(State, Option<ResponseInfo>), Failure> {
        let v_free = self.contact.is_some().then(|| v.clone());
        let info = self.response(dt, &mut x, &mut v, report)?;
        if info.is_some() {
            self.check(&x, &v, report)?;
        }
        let contact_force = v_free.map_or_else(Vec::new, |v_free| {
            let force = |i: usize| {
                if self.inv_mass[i] > 0.0 {
                    (v[i] - v_free[i]) / (dt * self.inv_mass[i])
                } else {
                    self.resting_force(i)
                }
            };
            (0..v.len()).map(force).collect()
        });
        let (step, pace, rest) = (self.state.step, self.state.pace, self.state.rest.clone());
        Ok((State { time: t1, step, pace, rest, x, v, contact_force, holds }, info))
    }

    /// Adds the impulse that contact is expected to give, dt f/m with the force f of the last step.
    ///
    /// Response works on single vertices, the implicit step on all that hang together: cloth that presses on a collider
    /// would give way inwards as a whole and be put back vertex by vertex, stretched. With the expected force the
    /// implicit step finds the balance that contact will keep. [`Simulation::forget_contact`] takes the same impulse
    /// out again, so that response decides freshly: a contact that is gone leaves nothing.
    pub(super) fn expect_contact(&self, dt: f64, v: &mut [Vec3]) {
        for (i, force) in self.state.contact_force.iter().enumerate() {
            v[i] += force * (dt * self.inv_mass[i]);
        }
    }

    /// Takes the expected impulse out of the velocity and of the motion.
    pub(super) fn forget_contact(&self, dt: f64, x: &mut [Vec3], v: &mut [Vec3]) {
        for (i, force) in self.state.contact_force.iter().enumerate() {
            let change = force * (dt * self.inv_mass[i]);
            v[i] -= change;
            x[i] -= change * dt;
        }
    }

    /// Makes the motion free of known collisions; `None` for a scene without contact.
    fn response(
        &mut self,
        dt: f64,
        x: &mut [Vec3],
        v: &mut [Vec3],
        report: &mut StepReport,
    ) -> Result<Option<ResponseInfo>, Failure> {
        let Some(ContactStage { mesh, bvh, continuous, responder, .. }) = &mut self.contact else {
            return Ok(None);
        };
        let (x_t0, masses, pool) = (&self.state.x, &self.inv_mass, &self.pool);
        if let Some(sleeper) = &mut self.sleeper {
            let resting = Resting { moving: &sleeper.moving, asleep: &sleeper.asleep };
            let result = responder.respond_resting(
                mesh,
                bvh,
                continuous.other(),
                resting,
                masses,
                x_t0,
                x,
                v,
                dt,
                pool,
            );
            let mut info = result.map_err(|error| response_failure(error, &sleeper.asleep))?;
            sleeper.meetings = std::mem::take(&mut info.meetings);
            for (name, seconds) in &info.seconds {
                add_seconds(&mut report.seconds, name, *seconds);
            }
            return Ok(Some(info));
        }
        let result = match continuous.other() {
            None => responder.respond(mesh, bvh, masses, x_t0, x, v, dt, pool),
            Some(other) => responder.respond_with(mesh, bvh, other, masses, x_t0, x, v, dt, pool),
        };
        let info = result.map_err(|error| response_failure(error, &[]))?;
        for (name, seconds) in &info.seconds {
            add_seconds(&mut report.seconds, name, *seconds);
        }
        Ok(Some(info))
    }
}

/// What an error of the response is to the step loop. `asleep`: per vertex; empty where nothing sleeps.
fn response_failure(error: ResponseError, asleep: &[bool]) -> Failure {
    let sleeps = |v: &u32| asleep.get(*v as usize).copied().unwrap_or(false);
    match error {
        ResponseError::Asleep { vertices } => Failure::Wake(vertices),
        // Sleeping cloth does not give way; awake it may.
        ResponseError::Unresolved { vertices, .. } if vertices.iter().any(sleeps) => {
            Failure::Wake(vertices.into_iter().filter(sleeps).collect())
        }
        ResponseError::Unresolved { pairs, vertices } => Failure::Unresolved { pairs, vertices },
        ResponseError::Strained { edges, excess } => Failure::Strained { edges, excess },
        ResponseError::NotFinite { name, vertex } => {
            Failure::Alarm(Alarm { reason: format!("{name} not finite"), vertices: vec![vertex as u32] })
        }
        ResponseError::Detect(DetectError::Device { reason, .. }) => Failure::Device(reason),
        other => Failure::Stop(stage("contact", &other)),
    }
}
