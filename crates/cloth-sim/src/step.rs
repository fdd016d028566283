//! One step, stages in reading order.
//!
//! Prescribed targets at t + dt → dynamics → response → guard → commit. A step that fails at any stage leaves the state
//! as it was; how it is tried again is said in [`crate::pace`].

mod response;
mod targets;

use crate::bodies::Bodies;
use crate::constraints::{Holds, failure};
use crate::contact::seconds_of_detection;
use crate::guard::Alarm;
use crate::pace::Pace;
use crate::pins::PinSet;
use crate::report::add_seconds;
use crate::sleep::Rest;
use crate::{SimError, Simulation, StepReport, Vec3};
use cloth_core::{Pins, StepInfo};
use cloth_response::ResponseInfo;
use std::time::Instant;

/// The state that a checkpoint holds.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct State {
    pub(crate) time: f64,
    pub(crate) step: u64,
    pub(crate) x: Vec<Vec3>,
    pub(crate) v: Vec<Vec3>,
    /// What contact did to each vertex in the last step \[N\]; empty in a scene without contact.
    pub(crate) contact_force: Vec<Vec3>,
    /// What contact constraints did in the last step; empty in a scene without.
    pub(crate) holds: Holds,
    /// How large the next attempt is.
    pub(crate) pace: Pace,
    /// What sleeps; empty in a scene where nothing may.
    pub(crate) rest: Rest,
}

impl State {
    /// Cloth as placed, colliders at t = 0.
    pub(crate) fn start(bodies: &Bodies) -> Self {
        Self::start_at(bodies, 0.0)
    }

    /// Cloth as placed, colliders where they are at `time` \[s\].
    pub(crate) fn start_at(bodies: &Bodies, time: f64) -> Self {
        let mut x = Vec::with_capacity(bodies.vertices);
        let mut v = Vec::with_capacity(bodies.vertices);
        for body in &bodies.cloth {
            x.extend_from_slice(&body.x);
            v.extend_from_slice(&body.v);
        }
        x.resize(bodies.vertices, Vec3::zeros());
        v.resize(bodies.vertices, Vec3::zeros());
        for body in &bodies.colliders {
            let range = body.first_vertex..body.first_vertex + body.motion.vertex_count();
            body.motion.write(time, &mut x[range]);
        }
        Self {
            time,
            step: 0,
            x,
            v,
            contact_force: Vec::new(),
            holds: Holds::default(),
            pace: Pace::default(),
            rest: Rest::default(),
        }
    }

    /// Moves pinned vertices to where their motion starts, at rest.
    pub(crate) fn place_pins(&mut self, bodies: &Bodies, pins: &PinSet) {
        let mut targets = vec![Vec3::zeros(); pins.vertices.len()];
        pins.write(bodies, self.time, &self.x, &mut targets);
        for (&v, target) in pins.vertices.iter().zip(targets) {
            self.x[v as usize] = target;
            self.v[v as usize] = Vec3::zeros();
        }
    }
}

/// Why an attempt at a step was given up; the state is as before it.
pub(crate) enum Failure {
    Alarm(Alarm),
    Unresolved {
        pairs: Vec<[u32; 4]>,
        vertices: Vec<u32>,
    },
    /// Strain limits that contact, pins or zones left no room for: these edges, and the largest excess of their length.
    Strained {
        edges: Vec<[u32; 2]>,
        excess: f64,
    },
    /// Contact made so much energy beyond what there may be [J].
    Energy {
        made: f64,
        level: f64,
    },
    /// The GPU gave no answer, for this reason.
    Device(String),
    /// Sleeping cloth with these vertices is to wake.
    Wake(Vec<u32>),
    /// Not a matter of the step's size.
    Stop(SimError),
}

/// The end of a motion that has passed every check and is not written yet.
pub(crate) struct Trial {
    pub(crate) state: State,
    dynamics: StepInfo,
    /// What response did, and the solves of contact constraints.
    contact: Option<(ResponseInfo, usize)>,
    /// What it took [s].
    seconds: f64,
}

impl Trial {
    /// Seconds of continuous detection, and of all.
    pub(crate) fn seconds(&self) -> [f64; 2] {
        [self.contact.as_ref().map_or(0.0, |(info, _)| seconds_of_detection(info)), self.seconds]
    }

    /// Σ m times the way of repulsion's pushes [kg m].
    pub(crate) fn pushed(&self) -> Vec3 {
        self.contact.as_ref().map_or_else(Vec3::zeros, |(info, _)| info.pushed)
    }

    /// Adds the counts of its dynamics to the step's.
    pub(crate) fn note_work(&self, report: &mut StepReport) {
        let dynamics = &self.dynamics;
        report.newton_iterations += dynamics.newton_iterations;
        report.linear_iterations += dynamics.linear_iterations;
        report.residual = report.residual.max(dynamics.residual);
        report.converged &= dynamics.converged;
    }

    /// Adds its counts to the step's.
    pub(crate) fn note(&self, report: &mut StepReport) {
        self.note_work(report);
        if let Some((info, solves)) = &self.contact {
            let contact = report.contact.get_or_insert_default();
            contact.add(info);
            contact.add_constraints(&self.state.holds, *solves);
        }
    }
}

/// Whether contact or a strain limit did anything in the step before a state.
pub(crate) fn touches(state: &State) -> bool {
    state.contact_force.iter().chain(&state.holds.force).any(|f| *f != Vec3::zeros())
}

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Alarm(alarm) => write!(f, "diverged: {}", alarm.reason),
            Self::Unresolved { pairs, .. } => write!(f, "stuck: {} pairs still collide", pairs.len()),
            Self::Strained { edges, excess } => {
                let count = edges.len();
                write!(
                    f,
                    "{count} edges stay beyond their strain limit, by up to {excess:.1e} of their length"
                )
            }
            Self::Energy { made, level } => {
                write!(f, "contact made {made:.3e} J of mechanical energy beyond {level:.3e} J")
            }
            Self::Device(reason) => write!(f, "no answer of the GPU: {reason}"),
            Self::Wake(vertices) => write!(f, "{} sleeping vertices are to wake", vertices.len()),
            Self::Stop(error) => error.fmt(f),
        }
    }
}

impl Simulation {
    /// The motion over `dt` to time `t1`: accepted and written, or given up without a trace. At the `floor` of step sizes
    /// energy that contact makes is accepted and reported; where it is more than there was in the motion, the cloth stops instead.
    pub(crate) fn attempt(
        &mut self,
        t1: f64,
        dt: f64,
        floor: bool,
        report: &mut StepReport,
    ) -> Result<(), Failure> {
        let mut trial = self.trial(t1, dt, report)?;
        let floor = floor || 0.5 * dt < self.scene.time.dt_min;
        trial.state.pace.ledger = match self.audit(&trial.state, dt, trial.pushed(), floor, report) {
            Err(failure @ Failure::Energy { .. }) if floor => {
                self.refuse(dt, &failure);
                trial.note_work(report);
                self.stand_still(t1);
                return Ok(());
            }
            judged => judged?,
        };
        trial.note(report);
        let seconds = trial.seconds();
        self.commit(trial.state, seconds);
        Ok(())
    }

    /// Writes a state that has passed every check; laws with memory move on to it, and contact to the last response.
    /// `seconds`: of continuous detection, and of all.
    pub(crate) fn commit(&mut self, state: State, seconds: [f64; 2]) {
        match self.sleeper.as_mut().and_then(|s| s.awake.as_mut()) {
            None => self.integrator.accept(),
            Some(awake) => awake.accept(),
        }
        self.state = state;
        self.accept_contact(seconds);
    }

    /// The motion over `dt` to time `t1` from the state as it is, which stays.
    pub(crate) fn trial(&mut self, t1: f64, dt: f64, report: &mut StepReport) -> Result<Trial, Failure> {
        #[cfg(test)]
        if (self.fail)(self.state.time, dt) {
            return Err(Failure::Alarm(Alarm { reason: "planted".into(), vertices: vec![0] }));
        }
        let started = Instant::now();
        let (mut x, mut v) = (self.state.x.clone(), self.state.v.clone());

        self.move_colliders(t1, dt, &mut x, &mut v, report);
        let (pin_x, pin_v) = self.move_pins(t1, dt, &x, report);
        self.mark_moving(dt, &x, &pin_x)?;
        self.integrator.set_time(t1);
        let (dynamics, holds, solves) = self.dynamics(dt, &mut x, &mut v, &pin_x, &pin_v, report)?;
        self.check(&x, &v, report)?;
        let (state, info) = self.meet(t1, dt, x, v, holds, report)?;
        let seconds = started.elapsed().as_secs_f64();
        Ok(Trial { state, dynamics, contact: info.map(|info| (info, solves)), seconds })
    }

    /// The end of the step without contact but for constraints, what those did, and their solves.
    fn dynamics(
        &mut self,
        dt: f64,
        x: &mut [Vec3],
        v: &mut [Vec3],
        pin_x: &[Vec3],
        pin_v: &[Vec3],
        report: &mut StepReport,
    ) -> Result<(StepInfo, Holds, usize), Failure> {
        self.integrator.mend_overshoots(!touches(&self.state));
        let constrained = self.constrained_dynamics(dt, x, v, pin_x, pin_v, report)?;
        let (info, holds, solves) = if let Some(done) = constrained {
            done
        } else {
            let pins = Pins { vertices: &self.pins.vertices, x_t1: pin_x, v_t1: pin_v };
            self.expect_contact(dt, v);
            let info = match self.sleeper.as_mut().and_then(|s| s.awake.as_mut()) {
                None => self.integrator.step(x, v, self.state.time, dt, &pins).map_err(failure)?,
                Some(awake) => awake.step(x, v, self.state.time, dt, &pins)?,
            };
            self.forget_contact(dt, x, v);
            (info, Holds::default(), 0)
        };
        for (name, seconds) in &info.seconds {
            add_seconds(&mut report.seconds, name, *seconds);
        }
        for (name, seconds) in &info.forces {
            add_seconds(&mut report.forces, name, *seconds);
        }
        Ok((info, holds, solves))
    }

    pub(crate) fn check(&mut self, x: &[Vec3], v: &[Vec3], report: &mut StepReport) -> Result<(), Failure> {
        let clock = Instant::now();
        let result = self.guard.check(&self.state.x, x, v).map_err(Failure::Alarm);
        add_seconds(&mut report.seconds, "guard", clock.elapsed().as_secs_f64());
        result
    }
}

#[cfg(test)]
mod tests;
