//! The engine as one object: built from a scene, stepped, asked.

use crate::bodies::{Bodies, ClothBody};
use crate::contact::ContactStage;
use crate::device::{Device, SharedGpu};
use crate::guard::Guard;
use crate::pins::PinSet;
use crate::scene::Contact;
use crate::step::State;
use crate::{Assets, BodyInfo, EffectCost, Plan, Report, Scene, SimError, Vec3, plan};
use cloth_core::{ClothPart, ClothSystem, Energy, Environment, Integrator, IntegratorParams};
use std::ops::ControlFlow;
use std::sync::Arc;

/// How to run, as opposed to what.
#[derive(Debug, Clone, Copy)]
pub struct SimulationOptions {
    /// Threads of the simulation's pool; by default all that the machine offers. Results do not depend on it.
    pub threads: Option<usize>,
    /// Runs from a start with intersections even if the scene does not say so.
    pub allow_intersections: bool,
    /// Where to detect continuously. Results do not depend on it.
    pub device: Device,
    /// The GPU, if one is used; by default the process's.
    pub gpu: &'static SharedGpu,
}

impl Default for SimulationOptions {
    fn default() -> Self {
        Self {
            threads: None,
            allow_intersections: false,
            device: Device::default(),
            gpu: SharedGpu::of_process(),
        }
    }
}

/// What [`Simulation::advance`] did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Advance {
    /// Steps taken.
    pub steps: usize,
    /// Whether the caller's check stopped it; [`Simulation::finish_advance`] then does the rest.
    pub interrupted: bool,
}

/// What an interrupted advance has left.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pending {
    pub(crate) steps: u64,
    pub(crate) dt: f64,
    /// Time after the last of them [s].
    pub(crate) end: f64,
}

/// A scene being simulated.
pub struct Simulation {
    pub(crate) scene: Scene,
    pub(crate) assets: Assets,
    pub(crate) options: SimulationOptions,
    pub(crate) infos: Vec<BodyInfo>,
    pub(crate) bodies: Bodies,
    pub(crate) pins: PinSet,
    pub(crate) pool: Arc<rayon::ThreadPool>,
    pub(crate) integrator: Integrator,
    pub(crate) contact: Option<ContactStage>,
    pub(crate) guard: Guard,
    pub(crate) inv_mass: Vec<f64>,
    pub(crate) state: State,
    pub(crate) pending: Option<Pending>,
    pub(crate) plan: Plan,
    pub(crate) report: Report,
    /// Steps (start time, size) that fail on purpose.
    #[cfg(test)]
    pub(crate) fail: fn(f64, f64) -> bool,
}

impl Simulation {
    /// Checks the scene, builds what its plan calls for and nothing else, and checks the start state.
    ///
    /// # Errors
    /// [`SimError::InvalidScene`] naming file, line and key; [`SimError::StartIntersections`];
    /// [`SimError::InvalidArgument`] for a number of threads that is zero or cannot be had; [`SimError::Device`] for a GPU that was
    /// asked for and cannot be had.
    pub fn new(scene: &Scene, assets: Assets, options: SimulationOptions) -> Result<Self, SimError> {
        let sim = Self::build(scene, assets, options, None)?;
        sim.check_start()?;
        Ok(sim)
    }

    /// Builds everything around the start state, or around `state` if it is given.
    pub(crate) fn build(
        scene: &Scene,
        assets: Assets,
        options: SimulationOptions,
        state: Option<State>,
    ) -> Result<Self, SimError> {
        scene.check()?;
        let bodies = Bodies::new(scene, &assets)?;
        let mut start = State::start(&bodies);
        let pins = PinSet::new(scene, &bodies, &start.x)?;
        start.place_pins(&bodies, &pins);
        let state = match state {
            Some(state) if state.x.len() == start.x.len() => state,
            Some(state) => {
                return Err(SimError::InvalidCheckpoint {
                    expected: format!("a state of {} vertices", start.x.len()),
                    got: format!("{}", state.x.len()),
                });
            }
            None => start,
        };

        let pool = Arc::new(thread_pool(options.threads)?);
        let parts: Vec<ClothPart<'_>> = bodies.cloth.iter().flat_map(cloth_parts).collect();
        let core_error =
            |error: cloth_core::CoreError| SimError::InvalidScene(plan::core_error(scene, &error));
        let mut system =
            ClothSystem::new(&parts, &environment(scene), bodies.cloth_vertices).map_err(core_error)?;
        system.sew(bodies.stitches()).map_err(core_error)?;
        let mut inv_mass: Vec<f64> = system.masses().iter().map(|m| m.recip()).collect();
        inv_mass.resize(bodies.vertices, 0.0);
        for &v in &pins.vertices {
            inv_mass[v as usize] = 0.0;
        }
        let mut integrator =
            Integrator::new(system, integrator_params(scene), Arc::clone(&pool)).map_err(core_error)?;
        integrator.set_time(state.time);
        let mut contact = match &scene.contact {
            Some(contact) => Some(ContactStage::new(scene, contact, options, &bodies, &pins, &state.x)?),
            // Strain limits are met by the response, also where there is no contact.
            None if scene.cloth.iter().any(|c| c.strain_limit.is_some()) => {
                let contact = Contact::default();
                Some(ContactStage::new(scene, &contact, options, &bodies, &pins, &state.x)?)
            }
            None => None,
        };
        if let Some(lack) = contact.as_mut().and_then(|stage| stage.continuous.lack.as_mut()) {
            (lack.step, lack.time) = (state.step, state.time);
        }
        let plan = plan::build(scene, &bodies, &integrator, contact.as_ref(), &pins, &state);
        let effects = plan
            .effects
            .iter()
            .filter(|e| e.on)
            .map(|e| EffectCost {
                name: e.name.clone(),
                elements: e.elements,
                bytes: e.bytes,
                milliseconds: None,
            })
            .collect();
        let detection = plan.detection.clone();
        let threads = pool.current_num_threads();
        let fallbacks = contact.iter().filter_map(|stage| stage.continuous.lack.clone()).collect();
        let report = Report { effects, threads, detection, fallbacks, ..Report::default() };
        Ok(Self {
            infos: bodies.infos(scene),
            guard: Guard::new(&bodies),
            scene: scene.clone(),
            assets,
            options,
            bodies,
            pins,
            pool,
            integrator,
            contact,
            inv_mass,
            state,
            pending: None,
            plan,
            report,
            #[cfg(test)]
            fail: |_, _| false,
        })
    }

    /// Takes one step of the scene's `time.dt`.
    ///
    /// # Errors
    /// [`SimError::Diverged`], [`SimError::Stuck`]: the step failed at every size tried; [`SimError::Device`]: the GPU that was asked
    /// for gave no answer. The state is the last good one.
    pub fn step(&mut self) -> Result<(), SimError> {
        let dt = self.scene.time.dt;
        self.step_to(self.state.time + dt, dt)
    }

    /// Advances by `seconds` in ⌈`seconds`/dt⌉ equal steps. `check` is asked before each; [`ControlFlow::Break`] stops,
    /// and [`Simulation::finish_advance`] (also after a checkpoint) does the rest with the same steps.
    ///
    /// # Errors
    /// [`SimError::InvalidArgument`] for `seconds` that are negative or not finite; else as [`Simulation::step`].
    pub fn advance(
        &mut self,
        seconds: f64,
        check: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Advance, SimError> {
        /// `seconds` that is a whole number of steps but for rounding makes no extra step.
        const ROUNDING: f64 = 1e-9;
        if !(seconds.is_finite() && seconds >= 0.0) {
            return Err(SimError::InvalidArgument {
                name: "seconds",
                expected: "a finite number ≥ 0 [s]",
                got: seconds.to_string(),
            });
        }
        let steps = (seconds / self.scene.time.dt - ROUNDING).ceil().max(0.0);
        let end = self.state.time + seconds;
        self.pending = (steps > 0.0).then(|| Pending { steps: steps as u64, dt: seconds / steps, end });
        self.finish_advance(check)
    }

    /// Does what an interrupted [`Simulation::advance`] has left; nothing if there is none.
    ///
    /// # Errors
    /// As [`Simulation::step`].
    pub fn finish_advance(
        &mut self,
        check: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Advance, SimError> {
        let mut steps = 0;
        while let Some(pending) = self.pending {
            if check().is_break() {
                return Ok(Advance { steps, interrupted: true });
            }
            let end = if pending.steps == 1 { pending.end } else { self.state.time + pending.dt };
            self.step_to(end, pending.dt)?;
            steps += 1;
            self.pending = (pending.steps > 1).then(|| Pending { steps: pending.steps - 1, ..pending });
        }
        Ok(Advance { steps, interrupted: false })
    }

    /// Whether an interrupted [`Simulation::advance`] has something left.
    pub fn is_interrupted(&self) -> bool {
        self.pending.is_some()
    }

    /// Simulated time [s].
    pub fn time(&self) -> f64 {
        self.state.time
    }

    /// Steps taken since the start (through checkpoints).
    pub fn step_count(&self) -> u64 {
        self.state.step
    }

    /// Positions of all cloth vertices [m].
    pub fn positions(&self) -> &[Vec3] {
        &self.state.x[..self.bodies.cloth_vertices]
    }

    /// Velocities of all cloth vertices [m/s].
    pub fn velocities(&self) -> &[Vec3] {
        &self.state.v[..self.bodies.cloth_vertices]
    }

    /// Positions of all collider vertices [m].
    pub fn collider_positions(&self) -> &[Vec3] {
        &self.state.x[self.bodies.cloth_vertices..]
    }

    /// Positions of all vertices [m], cloth first; [`BodyInfo::vertices`] index it.
    pub fn all_positions(&self) -> &[Vec3] {
        &self.state.x
    }

    /// The bodies, cloth first, in scene order.
    pub fn bodies(&self) -> &[BodyInfo] {
        &self.infos
    }

    /// Mechanical energy of the cloth [J].
    pub fn energy(&self) -> Energy {
        self.integrator.system().energy(&self.state.x, &self.state.v)
    }

    /// Lumped mass of each cloth vertex [kg].
    pub fn masses(&self) -> &[f64] {
        self.integrator.system().masses()
    }

    /// Each hinge of a bending law with memory as it stands; none where no material asks for memory.
    pub fn hinges(&self) -> Vec<cloth_core::bending::HingeState> {
        self.integrator.system().hinge_states(&self.state.x)
    }

    /// What bending laws remember of the path so far.
    pub(crate) fn memory(&self) -> Vec<f64> {
        self.integrator.system().memory(&self.state.x)
    }

    /// Force of contact on each cloth vertex in the last step [N]: of constraints and of impulses, divided by the step; zero
    /// before the first step, and in a scene without contact.
    pub fn contact_forces(&self) -> Vec<Vec3> {
        let mut forces = vec![Vec3::zeros(); self.bodies.cloth_vertices];
        for list in [&self.state.contact_force, &self.state.holds.force] {
            for (sum, force) in forces.iter_mut().zip(list) {
                *sum += force;
            }
        }
        forces
    }

    /// Which effects run and why.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// What happened so far.
    pub fn report(&self) -> &Report {
        &self.report
    }

    /// The scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Pairs of triangles that pass through each other now, as indices into the bodies' triangles one body after the
    /// other, under the scene's rules of contact; none without contact.
    ///
    /// # Errors
    /// [`SimError::Stage`] if detection refuses the state.
    pub fn intersections(&self) -> Result<Vec<[u32; 2]>, SimError> {
        match &self.contact {
            Some(contact) => contact.intersections(&self.state.x, &self.pool),
            None => Ok(Vec::new()),
        }
    }

    pub(crate) fn check_start(&self) -> Result<(), SimError> {
        /// Pairs listed in an error.
        const LISTED: usize = 64;
        /// Pairs put in words.
        const NAMED: usize = 4;
        let Some(contact) = &self.contact else { return Ok(()) };
        if contact.allow {
            return Ok(());
        }
        let pairs = self.intersections()?;
        if pairs.is_empty() {
            return Ok(());
        }
        let names = pairs
            .iter()
            .take(NAMED)
            .map(|p| format!("{} through {}", self.triangle_name(p[0]), self.triangle_name(p[1])))
            .collect();
        Err(SimError::StartIntersections {
            count: pairs.len(),
            pairs: pairs.into_iter().take(LISTED).collect(),
            names,
        })
    }

    /// Body and triangle of a global triangle index, in words.
    fn triangle_name(&self, triangle: u32) -> String {
        let mut t = triangle as usize;
        for info in &self.infos {
            if t < info.triangles.len() {
                return format!("triangle {t} of \"{}\"", info.name);
            }
            t -= info.triangles.len();
        }
        format!("triangle {triangle}")
    }
}

/// A cloth as a part of one material, or as its parts.
fn cloth_parts(body: &ClothBody) -> Vec<ClothPart<'_>> {
    let ClothBody { mesh, topology, rest, first_vertex, .. } = body;
    let part = |material, triangles| ClothPart {
        mesh,
        topology,
        rest,
        material,
        first_vertex: *first_vertex,
        triangles,
    };
    if body.parts.is_empty() {
        return vec![part(&body.material, None)];
    }
    body.parts.iter().map(|(material, triangles)| part(material, Some(triangles.as_slice()))).collect()
}

fn thread_pool(threads: Option<usize>) -> Result<rayon::ThreadPool, SimError> {
    let bad = |got: String| SimError::InvalidArgument {
        name: "threads",
        expected: "at least 1 thread that the machine can start",
        got,
    };
    if threads == Some(0) {
        return Err(bad("0".into()));
    }
    // Zero: as many as the machine offers.
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads.unwrap_or(0))
        .thread_name(|i| format!("clothsim-{i}"))
        .build()
        .map_err(|error| bad(error.to_string()))
}

fn environment(scene: &Scene) -> Environment {
    Environment {
        gravity: scene.gravity().into(),
        wind: scene.air.wind.into(),
        air_density: scene.air.density,
        drag: scene.air.drag,
        lift: scene.air.lift,
        air_damping: scene.air.damping,
    }
}

fn integrator_params(scene: &Scene) -> IntegratorParams {
    IntegratorParams {
        method: scene.time.integrator,
        solver: scene.solver,
        psd: scene.time.indefinite,
        newton_tolerance: scene.time.newton_tolerance,
        newton_max_iterations: scene.time.newton_max_iterations,
        bending_substeps: scene.time.bending_substeps,
        ..IntegratorParams::default()
    }
}
