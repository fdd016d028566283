//! The engine as one object: built from a scene, stepped, asked.

use crate::bodies::{Bodies, ClothBody};
use crate::contact::ContactStage;
use crate::device::{Device, SharedGpu};
use crate::guard::Guard;
use crate::pace::{Pending, UnderWay};
use crate::pins::PinSet;
use crate::scene::{Choice, Contact, Start};
use crate::sleep::{Rest, Sleeper};
use crate::step::State;
use crate::untangle::{Limits, Tangled, untangle};
use crate::{Assets, BodyInfo, EffectCost, Plan, Report, Scene, SimError, Vec3, plan};
use cloth_core::{ClothPart, ClothSystem, CoreError, Energy, Environment, Integrator, IntegratorParams};
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
    /// With `effects.sleep`.
    pub(crate) sleeper: Option<Sleeper>,
    pub(crate) inv_mass: Vec<f64>,
    /// Whether steps are judged by their energy, see [`crate::ledger`].
    pub(crate) audited: bool,
    pub(crate) state: State,
    pub(crate) pending: Option<Pending>,
    /// A step of which some parts have been accepted.
    pub(crate) under_way: Option<UnderWay>,
    pub(crate) plan: Plan,
    pub(crate) report: Report,
    /// Steps (start time, size) that fail on purpose.
    #[cfg(test)]
    pub(crate) fail: fn(f64, f64) -> bool,
    /// End and size of each attempt that was accepted.
    #[cfg(test)]
    pub(crate) accepted: Vec<[f64; 2]>,
}

impl Simulation {
    /// Checks the scene, builds what its plan calls for and nothing else, and checks the start state.
    ///
    /// # Errors
    /// [`SimError::InvalidScene`] naming file, line and key; [`SimError::StartIntersections`];
    /// [`SimError::InvalidArgument`] for a number of threads that is zero or cannot be had; [`SimError::Device`] for a GPU that was
    /// asked for and cannot be had.
    pub fn new(scene: &Scene, assets: Assets, options: SimulationOptions) -> Result<Self, SimError> {
        let mut sim = Self::build(scene, assets, options, None)?;
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
        let core_error = |error: CoreError| SimError::InvalidScene(plan::core_error(scene, &error));
        let mut system =
            ClothSystem::new(&parts, &environment(scene), bodies.cloth_vertices).map_err(core_error)?;
        system.sew(bodies.stitches()).map_err(core_error)?;
        keep_history(scene, &mut system).map_err(core_error)?;
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
        let mut sim = Self {
            infos: bodies.infos(scene),
            guard: Guard::new(&bodies),
            sleeper: None,
            scene: scene.clone(),
            assets,
            options,
            bodies,
            pins,
            pool,
            integrator,
            contact,
            inv_mass,
            audited: !scene.time.integrator.is_explicit(),
            state,
            pending: None,
            under_way: None,
            plan,
            report,
            #[cfg(test)]
            fail: |_, _| false,
            #[cfg(test)]
            accepted: Vec::new(),
        };
        sim.sleeper = Sleeper::new(&sim);
        if sim.sleeper.is_some() && sim.state.rest.asleep.len() != sim.bodies.cloth.len() {
            sim.state.rest = Rest::awake(sim.bodies.cloth.len());
        }
        Ok(sim)
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
        self.energy_at(&self.state.x, &self.state.v)
    }

    /// That of a state near this one, with what laws remember of the path to here.
    pub(crate) fn energy_at(&self, x: &[Vec3], v: &[Vec3]) -> Energy {
        match self.sleeper.as_ref().and_then(|s| s.awake.as_ref()) {
            None => self.integrator.system().energy(x, v),
            Some(awake) => awake.energy(x, v),
        }
    }

    /// Lumped mass of each cloth vertex [kg].
    pub fn masses(&self) -> &[f64] {
        self.integrator.system().masses()
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

    /// Refuses a start state with intersections, or repairs it, as the scene says.
    pub(crate) fn check_start(&mut self) -> Result<(), SimError> {
        let Some(contact) = &self.contact else { return Ok(()) };
        let allow = contact.allow;
        if self.scene.start == Start::Untangle {
            return match self.untangle()? {
                Ok(()) => Ok(()),
                Err(_) if allow => Ok(()),
                Err(Tangled { before, left }) => Err(self.tangled(left, Some(before))),
            };
        }
        if allow {
            return Ok(());
        }
        let pairs = self.intersections()?;
        if pairs.is_empty() { Ok(()) } else { Err(self.tangled(pairs, None)) }
    }

    /// Moves what passes through each other a little apart, and says so in report and plan.
    fn untangle(&mut self) -> Result<Result<(), Tangled>, SimError> {
        /// Farthest that a vertex is moved, of the smallest cloth's size: beyond, no side can be told to be the right one.
        const REACH: f64 = 0.1;
        /// Distance left between surfaces: of the thickness, to which contact opens them gently, and at most of an edge.
        const GAP: [f64; 2] = [0.5, 0.25];
        /// Way of one pass along the gradient, of an edge.
        const PACE: f64 = 0.1;
        let (Some(stage), Some(contact)) = (&self.contact, &self.scene.contact) else { return Ok(Ok(())) };
        let least = |sizes: &mut dyn Iterator<Item = f64>| sizes.fold(f64::INFINITY, f64::min);
        let edge = least(&mut self.bodies.cloth.iter().map(ClothBody::median_edge));
        let size = |body: &ClothBody| body.mesh.bounds().map_or(0.0, |(lo, hi)| (hi - lo).norm());
        let free: Vec<bool> = self.inv_mass.iter().map(|w| *w > 0.0).collect();
        let limits = Limits {
            free: &free,
            gap: (GAP[0] * contact.thickness).min(GAP[1] * edge),
            reach: REACH * least(&mut self.bodies.cloth.iter().map(size)),
            pace: PACE * edge,
        };
        let done = untangle(&stage.mesh, &mut self.state.x, &limits, &self.pool)
            .map_err(|e| crate::contact::stage("untangle", &e))?;
        let untangled = match done {
            Ok(untangled) => untangled,
            Err(tangled) => return Ok(Err(tangled)),
        };
        self.plan.note_untangled(&untangled);
        self.report.untangled = (untangled.pairs > 0).then_some(untangled);
        Ok(Ok(()))
    }

    /// The error of pairs of triangles that pass through each other at the start; with those before if some were resolved.
    fn tangled(&self, pairs: Vec<[u32; 2]>, tangled: Option<usize>) -> SimError {
        /// Pairs listed in an error.
        const LISTED: usize = 64;
        /// Pairs put in words.
        const NAMED: usize = 4;
        let names = pairs
            .iter()
            .take(NAMED)
            .map(|p| format!("{} through {}", self.triangle_name(p[0]), self.triangle_name(p[1])))
            .collect();
        let count = pairs.len();
        SimError::StartIntersections {
            count,
            pairs: pairs.into_iter().take(LISTED).collect(),
            names,
            tangled,
        }
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
    body.parts.iter().map(|p| part(&p.material, Some(p.triangles.as_slice()))).collect()
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

pub(crate) fn environment(scene: &Scene) -> Environment {
    Environment {
        gravity: scene.gravity().into(),
        wind: scene.air.wind.into(),
        air_density: scene.air.density,
        drag: scene.air.drag,
        lift: scene.air.lift,
        air_damping: scene.air.damping,
    }
}

/// Lets laws with memory remember what the scene asks for.
pub(crate) fn keep_history(scene: &Scene, system: &mut ClothSystem) -> Result<(), CoreError> {
    match scene.effects.history {
        Choice::On => Ok(()),
        Choice::Auto => system.remember_beyond(scene.effects.history_tolerance),
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
