//! The step's dynamics under contact constraints.

use super::{Holds, Settings, Sites};
use crate::contact::{ContactStage, stage};
use crate::report::add_seconds;
use crate::step::Failure;
use crate::{Simulation, StepReport, Vec3};
use cloth_core::{Pins, StepError, StepInfo};
use std::time::Instant;

/// Name of the stage, and of the effect that it counts under.
const STAGE: &str = "contact constraints";

impl Simulation {
    /// The end of the step with cloth vertices on colliders held by constraints, what those did, and the number of solves;
    /// `None` for a scene without.
    ///
    /// What contact is expected to give beside the constraints goes in before and out again afterwards, as without them:
    /// but not where it lifts a vertex that a constraint holds, which gives that itself.
    pub(crate) fn constrained_dynamics(
        &mut self,
        dt: f64,
        x: &mut [Vec3],
        v: &mut [Vec3],
        pin_x: &[Vec3],
        pin_v: &[Vec3],
        report: &mut StepReport,
    ) -> Result<Option<(StepInfo, Holds, usize)>, Failure> {
        let Self { contact, integrator, state, pins, inv_mass, pool, scene, .. } = self;
        let Some(ContactStage { mesh, bvh, constraints: Some(own), responder, .. }) = contact else {
            return Ok(None);
        };
        let clock = Instant::now();
        let masses = integrator.system().masses();
        let cloth = masses.len();
        // Colliders' velocities are those of this step, cloth's those of its start.
        let fastest = |v: &[Vec3]| v.iter().map(Vec3::norm_squared).fold(0.0, f64::max).sqrt();
        let gravity: Vec3 = scene.gravity().into();
        let way = dt * (fastest(&v[..cloth]) + fastest(&v[cloth..]) + dt * gravity.norm());
        let near = own
            .near(mesh, bvh, &state.x, inv_mass, way, pool)
            .map_err(|e| Failure::Stop(stage("contact constraints", &e)))?;
        let (cloth_x, colliders) = x.split_at_mut(cloth);
        let settings = Settings { dt, gravity };
        let sides = responder.sides();
        let mut sites = Sites::new(
            own,
            mesh,
            &near,
            &state.x,
            &state.v,
            colliders,
            masses,
            &state.holds,
            sides,
            settings,
        );
        let mut expected = state.contact_force.clone();
        if !expected.is_empty() {
            for (vertex, normal) in sites.held() {
                let force = &mut expected[vertex as usize];
                if normal.dot(force) > 0.0 {
                    *force = Vec3::zeros();
                }
            }
        }
        for (i, force) in expected.iter().enumerate() {
            v[i] += force * (dt * inv_mass[i]);
        }
        let mut seconds = clock.elapsed().as_secs_f64();
        let pins = Pins { vertices: &pins.vertices, x_t1: pin_x, v_t1: pin_v };
        let info = integrator.step_with(cloth_x, v, dt, &pins, &mut sites);
        seconds += sites.seconds();
        add_seconds(&mut report.seconds, STAGE, seconds);
        let info = info.map_err(failure)?;
        // Vertices of colliders have no expectations.
        for (i, force) in expected.iter().enumerate().take(cloth) {
            let change = force * (dt * inv_mass[i]);
            v[i] -= change;
            cloth_x[i] -= change * dt;
        }
        Ok(Some((info, sites.finish(cloth), sites.solves())))
    }
}

/// What an error of the integrator is to the step loop.
pub(crate) fn failure(error: StepError) -> Failure {
    match error {
        StepError::Solver { error, vertices } => {
            Failure::Alarm(crate::guard::Alarm { reason: error.to_string(), vertices })
        }
        other => Failure::Stop(stage("dynamics", &other)),
    }
}
