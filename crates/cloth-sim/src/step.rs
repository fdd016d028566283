//! One step, stages in reading order.
//!
//! Prescribed targets at t + dt → dynamics → response → guard → commit. A step that fails at any stage leaves the state
//! as it was and is retried with half the size, down to `time.max_halvings` halvings; then the run stops.

use crate::bodies::Bodies;
use crate::constraints::{Holds, failure};
use crate::contact::{ContactStage, stage};
use crate::guard::Alarm;
use crate::pins::PinSet;
use crate::report::add_seconds;
use crate::{SimError, Simulation, StepReport, Vec3};
use cloth_collision::DetectError;
use cloth_core::{Pins, StepInfo};
use cloth_response::{ResponseError, ResponseInfo};
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
        Self { time, step: 0, x, v, contact_force: Vec::new(), holds: Holds::default() }
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
    /// The GPU gave no answer, for this reason.
    Device(String),
    /// Not a matter of the step's size.
    Stop(SimError),
}

impl Simulation {
    /// One step of `dt` [s] that ends at `end` [s], in sub-steps if need be.
    pub(crate) fn step_to(&mut self, end: f64, dt: f64) -> Result<(), SimError> {
        let started = Instant::now();
        let t0 = self.state.time;
        // Sub-steps are counted in units of dt/2^halvings, so that the last one ends exactly at `end`.
        let whole = 1_u64 << self.scene.time.max_halvings;
        let fraction = |units: u64| units as f64 / whole as f64;
        let mut report = StepReport { dt, converged: true, ..StepReport::default() };
        let (mut done, mut size) = (0, whole);
        while done < whole {
            let t1 = if done + size == whole { end } else { t0 + dt * fraction(done + size) };
            match self.attempt(t1, dt * fraction(size), &mut report) {
                Ok(()) => {
                    done += size;
                    report.substeps += 1;
                }
                Err(Failure::Stop(error)) => return Err(error),
                Err(Failure::Device(reason)) => self.lose_device(&reason)?,
                Err(_) if size > 1 => {
                    size /= 2;
                    report.retries += 1;
                }
                Err(Failure::Alarm(Alarm { reason, vertices })) => {
                    return Err(SimError::Diverged { time: self.state.time, reason, vertices });
                }
                Err(Failure::Unresolved { pairs, vertices }) => {
                    return Err(SimError::Stuck { time: self.state.time, pairs, vertices });
                }
            }
        }
        self.state.step += 1;
        report.step = self.state.step;
        report.time = self.state.time;
        if self.contact.as_ref().is_some_and(|c| c.allow) {
            let clock = Instant::now();
            report.intersections = Some(self.intersections()?.len());
            add_seconds(&mut report.seconds, "intersection count", clock.elapsed().as_secs_f64());
        }
        self.report.push(report, started.elapsed().as_secs_f64());
        if let Some(contact) = &self.contact {
            self.report.grow("contact", contact.bytes());
            self.report.grow_on_device(contact.continuous.device_bytes());
        }
        Ok(())
    }

    /// Goes on without the GPU that gave no answer, or stops; the state is as before the attempt, which may then be made again.
    fn lose_device(&mut self, reason: &str) -> Result<(), SimError> {
        let Some(contact) = &mut self.contact else { return Ok(()) };
        let fallback = contact.continuous.fall_back(self.state.step + 1, self.state.time, reason)?;
        self.report.detection = Some(contact.continuous.detection.clone());
        self.report.fallbacks.push(fallback);
        Ok(())
    }

    /// The motion over `dt` to time `t1`: accepted and written, or given up without a trace.
    fn attempt(&mut self, t1: f64, dt: f64, report: &mut StepReport) -> Result<(), Failure> {
        #[cfg(test)]
        if (self.fail)(self.state.time, dt) {
            return Err(Failure::Alarm(Alarm { reason: "planted".into(), vertices: vec![0] }));
        }
        let (mut x, mut v) = (self.state.x.clone(), self.state.v.clone());

        self.move_colliders(t1, dt, &mut x, &mut v, report);
        let (pin_x, pin_v) = self.move_pins(t1, dt, &x, report);
        self.integrator.set_time(t1);
        let (dynamics, holds, solves) = self.dynamics(dt, &mut x, &mut v, &pin_x, &pin_v, report)?;
        self.check(&x, &v, report)?;
        let v_free = self.contact.is_some().then(|| v.clone());
        if let Some(info) = self.response(dt, &mut x, &mut v, report)? {
            self.check(&x, &v, report)?;
            let contact = report.contact.get_or_insert_default();
            contact.add(&info);
            contact.add_constraints(&holds, solves);
        }

        report.newton_iterations += dynamics.newton_iterations;
        report.linear_iterations += dynamics.linear_iterations;
        report.residual = report.residual.max(dynamics.residual);
        report.converged &= dynamics.converged;
        if let Some(v_free) = v_free {
            let force = |i: usize| {
                if self.inv_mass[i] > 0.0 {
                    (v[i] - v_free[i]) / (dt * self.inv_mass[i])
                } else {
                    Vec3::zeros()
                }
            };
            self.state.contact_force = (0..v.len()).map(force).collect();
        }
        self.integrator.accept();
        self.state.holds = holds;
        self.state.x = x;
        self.state.v = v;
        self.state.time = t1;
        Ok(())
    }

    /// Adds the impulse that contact is expected to give, dt f/m with the force f of the last step.
    ///
    /// Response works on single vertices, the implicit step on all that hang together: cloth that presses on a collider
    /// would give way inwards as a whole and be put back vertex by vertex, stretched. With the expected force the
    /// implicit step finds the balance that contact will keep. [`Simulation::forget_contact`] takes the same impulse
    /// out again, so that response decides freshly: a contact that is gone leaves nothing.
    fn expect_contact(&self, dt: f64, v: &mut [Vec3]) {
        for (i, force) in self.state.contact_force.iter().enumerate() {
            v[i] += force * (dt * self.inv_mass[i]);
        }
    }

    /// Takes the expected impulse out of the velocity and of the motion.
    fn forget_contact(&self, dt: f64, x: &mut [Vec3], v: &mut [Vec3]) {
        for (i, force) in self.state.contact_force.iter().enumerate() {
            let change = force * (dt * self.inv_mass[i]);
            v[i] -= change;
            x[i] -= change * dt;
        }
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
        let constrained = self.constrained_dynamics(dt, x, v, pin_x, pin_v, report)?;
        let (info, holds, solves) = if let Some(done) = constrained {
            done
        } else {
            let pins = Pins { vertices: &self.pins.vertices, x_t1: pin_x, v_t1: pin_v };
            self.expect_contact(dt, v);
            let info = self.integrator.step(x, v, self.state.time, dt, &pins).map_err(failure)?;
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
        let result = match continuous.other() {
            None => responder.respond(mesh, bvh, masses, x_t0, x, v, dt, pool),
            Some(other) => responder.respond_with(mesh, bvh, other, masses, x_t0, x, v, dt, pool),
        };
        let info = result.map_err(|error| match error {
            ResponseError::Unresolved { pairs, vertices } => Failure::Unresolved { pairs, vertices },
            ResponseError::NotFinite { name, vertex } => {
                Failure::Alarm(Alarm { reason: format!("{name} not finite"), vertices: vec![vertex as u32] })
            }
            ResponseError::Detect(DetectError::Device { reason, .. }) => Failure::Device(reason),
            other => Failure::Stop(stage("contact", &other)),
        })?;
        for (name, seconds) in &info.seconds {
            add_seconds(&mut report.seconds, name, *seconds);
        }
        Ok(Some(info))
    }

    /// Writes where colliders are at `t1`, and the mean velocity of their way there.
    fn move_colliders(&self, t1: f64, dt: f64, x: &mut [Vec3], v: &mut [Vec3], report: &mut StepReport) {
        let clock = Instant::now();
        let mut any = false;
        for body in self.bodies.colliders.iter().filter(|body| body.motion.moves()) {
            let range = body.first_vertex..body.first_vertex + body.motion.vertex_count();
            body.motion.write(t1, &mut x[range.clone()]);
            for i in range {
                v[i] = (x[i] - self.state.x[i]) / dt;
            }
            any = true;
        }
        if any {
            add_seconds(&mut report.seconds, "moving colliders", clock.elapsed().as_secs_f64());
        }
    }

    /// Where pins are at `t1`, when colliders are as in `x`, and the mean velocity of their way there.
    fn move_pins(&self, t1: f64, dt: f64, x: &[Vec3], report: &mut StepReport) -> (Vec<Vec3>, Vec<Vec3>) {
        if self.pins.vertices.is_empty() {
            return (Vec::new(), Vec::new());
        }
        let clock = Instant::now();
        let mut pin_x = vec![Vec3::zeros(); self.pins.vertices.len()];
        self.pins.write(&self.bodies, t1, x, &mut pin_x);
        let start = |i: u32| self.state.x[i as usize];
        let pin_v = self.pins.vertices.iter().zip(&pin_x).map(|(&i, p)| (p - start(i)) / dt).collect();
        add_seconds(&mut report.seconds, "pins", clock.elapsed().as_secs_f64());
        (pin_x, pin_v)
    }

    fn check(&self, x: &[Vec3], v: &[Vec3], report: &mut StepReport) -> Result<(), Failure> {
        let clock = Instant::now();
        let result = self.guard.check(&self.state.x, x, v).map_err(Failure::Alarm);
        add_seconds(&mut report.seconds, "guard", clock.elapsed().as_secs_f64());
        result
    }
}

#[cfg(test)]
mod tests {
    use crate::{Assets, Scene, SimError, Simulation, SimulationOptions};

    const SCENE: &str = r#"
duration = 1.0
[time]
dt = 0.01
max_halvings = 3
[[cloth]]
name = "cloth"
mesh = { generator = "grid", width = 1.0, height = 1.0, nx = 6, ny = 6 }
material = { areal_density = 0.2, in_plane = { model = "spring", stiffness = 50.0 } }
pins = [{ vertices = [0], keyframes = [{ time = 0.0 }, { time = 1.0, position = [0.0, 1.0, 0.0] }] }]
"#;

    fn simulation() -> Simulation {
        let scene = Scene::parse_toml(SCENE, "test.toml").unwrap();
        let options = SimulationOptions { threads: Some(1), ..SimulationOptions::default() };
        Simulation::new(&scene, Assets::default(), options).unwrap()
    }

    #[test]
    fn a_retry_leaves_no_trace() {
        let mut retried = simulation();
        retried.fail = |time, dt| time < 0.005 && dt > 0.006;
        retried.step().unwrap();
        assert_eq!((retried.report.steps[0].retries, retried.report.steps[0].substeps), (1, 2));
        let mut straight = simulation();
        straight.step_to(0.005, 0.005).unwrap();
        straight.step_to(0.01, 0.005).unwrap();
        assert_eq!(retried.state.x, straight.state.x);
        assert_eq!(retried.state.v, straight.state.v);
        assert_eq!((retried.state.time, retried.state.step), (0.01, 1));
        let mut whole = simulation();
        whole.step().unwrap();
        assert_ne!(retried.state.x, whole.state.x, "the comparison sees a difference");
    }

    /// The scene with a law that remembers, folded far enough by its pin for friction to be overcome.
    fn remembering() -> Simulation {
        let text = SCENE.replace(
            "in_plane = { model = \"spring\", stiffness = 50.0 } }",
            "in_plane = { model = \"spring\", stiffness = 50.0 }, \
             bending = { model = \"hysteresis\", b1 = 2e-3, b2 = 1e-3, c1 = -5e-3, plasticity = 0.3, fatigue = 0.1 } }",
        );
        let scene = Scene::parse_toml(&text, "test.toml").unwrap();
        let options = SimulationOptions { threads: Some(1), ..SimulationOptions::default() };
        Simulation::new(&scene, Assets::default(), options).unwrap()
    }

    #[test]
    fn history_is_committed_once_per_accepted_step() {
        let mut retried = remembering();
        assert!(retried.integrator.system().remembers());
        // Both halves of the first attempt at full size fail, and so does one at half size.
        retried.fail = |time, dt| (time < 0.005 && dt > 0.006) || (time < 0.03 && time > 0.015 && dt > 0.003);
        for _ in 0..5 {
            retried.step().unwrap();
        }
        let retries: u32 = retried.report.steps.iter().map(|s| s.retries).sum();
        assert!(retries >= 2, "{retries}");
        let mut straight = remembering();
        for step in &retried.report.steps {
            // The sizes that were accepted, one after the other.
            let (start, substeps) = (straight.time(), step.substeps);
            for k in 1..=substeps {
                let end = if k == substeps {
                    step.time
                } else {
                    start + step.dt * f64::from(k) / f64::from(substeps)
                };
                straight.step_to(end, step.dt / f64::from(substeps)).unwrap();
            }
        }
        let memory = retried.memory();
        assert_eq!(memory, straight.memory());
        assert_eq!(retried.state.x, straight.state.x);
        let mut whole = remembering();
        for _ in 0..5 {
            whole.step().unwrap();
        }
        assert_ne!(memory, whole.memory(), "the comparison sees a difference");
        assert!(memory.iter().any(|m| *m != 0.0));
    }

    #[test]
    fn history_survives_a_checkpoint_to_the_same_bits() {
        let mut sim = remembering();
        for _ in 0..30 {
            sim.step().unwrap();
        }
        let mut resumed = Simulation::resume(&sim.checkpoint(), Some(2)).unwrap();
        assert_eq!(resumed.hinges(), sim.hinges());
        let mut forgetful = Simulation::resume(&sim.checkpoint(), Some(2)).unwrap();
        let nothing = remembering().memory();
        forgetful.integrator.set_memory(&nothing).unwrap();
        for _ in 0..30 {
            for sim in [&mut sim, &mut resumed, &mut forgetful] {
                sim.step().unwrap();
            }
        }
        assert_eq!(resumed.state, sim.state);
        assert_eq!(resumed.hinges(), sim.hinges());
        assert_ne!(forgetful.state.x, sim.state.x, "memory that is lost is seen");
        assert!(sim.hinges().iter().any(|h| h.place.rest_curvature != 0.0), "some bend has stayed");
    }

    #[test]
    fn a_step_that_fails_at_every_size_keeps_the_last_good_state() {
        let mut sim = simulation();
        sim.step().unwrap();
        let good = sim.state.clone();
        sim.fail = |_, _| true;
        let error = sim.step().unwrap_err();
        assert_eq!(error, SimError::Diverged { time: 0.01, reason: "planted".into(), vertices: vec![0] });
        assert_eq!(sim.state, good);
        assert_eq!(sim.report.steps.len(), 1);
        sim.fail = |_, _| false;
        sim.step().unwrap();
        let mut straight = simulation();
        straight.step().unwrap();
        straight.step().unwrap();
        assert_eq!(sim.state, straight.state);
    }

    /// A card that slides down a slope, held by contact constraints.
    fn sliding() -> Simulation {
        let text = r#"
duration = 1.0
[time]
dt = 0.01
[contact]
method = "constraints"
thickness = 0.01
friction = { law = "coulomb-stiction", mu_c = 0.1, mu_s = 0.2 }
[[cloth]]
name = "card"
mesh = { generator = "grid", width = 1.0, height = 1.0, nx = 6, ny = 6 }
material = { areal_density = 0.2, in_plane = { model = "spring", stiffness = 50.0 } }
position = [-0.003, 0.01, 0.0]
rotation = { axis = [0, 0, 1], angle = 0.3 }
[[collider]]
name = "slope"
shape = { type = "plane", half_size = 3.0 }
rotation = { axis = [0, 0, 1], angle = 0.3 }
"#;
        let scene = Scene::parse_toml(text, "test.toml").unwrap();
        let options = SimulationOptions { threads: Some(1), ..SimulationOptions::default() };
        Simulation::new(&scene, Assets::default(), options).unwrap()
    }

    #[test]
    fn a_retry_leaves_no_trace_in_contact_constraints() {
        let mut retried = sliding();
        retried.step().unwrap();
        // An attempt that the guard gives up, after a search of its own.
        let good = retried.state.clone();
        retried.state.v[7].x = 1e6;
        let before = retried.state.clone();
        assert!(retried.attempt(0.02, 0.01, &mut crate::StepReport::default()).is_err());
        assert_eq!(retried.state, before);
        retried.state = good;
        retried.fail = |time, dt| time < 0.015 && dt > 0.006;
        retried.step().unwrap();
        let mut straight = sliding();
        for [end, dt] in [[0.01, 0.01], [0.015, 0.005], [0.02, 0.005]] {
            straight.step_to(end, dt).unwrap();
        }
        let state = |sim: &Simulation| (sim.state.x.clone(), sim.state.v.clone(), sim.state.holds.clone());
        assert!(state(&retried) == state(&straight));
        assert!(retried.state.holds.sliding.iter().any(|s| *s));
        let mut whole = sliding();
        whole.step().unwrap();
        whole.step().unwrap();
        assert!(state(&retried) != state(&whole), "the comparison sees a difference");
        // What is not a number comes out as an alarm that names vertices, and the state stays.
        let good = retried.state.clone();
        retried.fail = |_, _| false;
        retried.state.v[7].x = f64::NAN;
        let SimError::Diverged { vertices, .. } = retried.step().unwrap_err() else { panic!("diverged") };
        assert!(!vertices.is_empty());
        assert_eq!(retried.state.x, good.x);
    }

    #[test]
    fn sub_steps_that_succeed_before_one_that_fails_are_kept() {
        let mut sim = simulation();
        sim.fail = |time, dt| dt > 0.006 || time > 0.004;
        let SimError::Diverged { time, .. } = sim.step().unwrap_err() else { panic!("diverged") };
        assert_eq!(time, 0.005);
        assert_eq!(sim.time(), 0.005);
    }

    #[test]
    fn a_scene_without_contact_builds_none() {
        let sim = simulation();
        assert!(sim.contact.is_none());
        assert!(sim.plan.running().all(|name| !name.contains("contact") && name != "friction"));
    }
}
