//! What happened: per step, in total, and per effect.

use serde::{Deserialize, Serialize};

/// Everything a run reports.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Report {
    /// One entry per step (of `advance`'s size; sub-steps of a retried step are summed in it), without the first ones that
    /// a checkpoint has left out.
    pub steps: Vec<StepReport>,
    /// How many steps before `steps[0]` were left out; the totals have them.
    pub left_out: usize,
    /// Sums and extremes over all steps.
    pub totals: Totals,
    /// What each effect costs.
    pub effects: Vec<EffectCost>,
    /// Threads of the pool.
    pub threads: usize,
    /// Who detects continuously; none without contact.
    #[serde(default)]
    pub detection: Option<Detection>,
    /// GPUs that were asked for and could not be had, or failed on the way.
    #[serde(default)]
    pub fallbacks: Vec<Fallback>,
    /// What `contact.detector = "auto"` chose by measuring.
    #[serde(default)]
    pub choices: Vec<Chosen>,
    /// The first attempts at a step that were given up (at most 64; `totals.retries` counts all).
    #[serde(default)]
    pub refused: Vec<Refused>,
    /// What `start = "untangle"` did; none where the start state was clean.
    #[serde(default)]
    pub untangled: Option<crate::Untangled>,
    /// From what state the simulation went on, and what was other then; none where it began at the scene's start.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub continued: Option<crate::Continued>,
}

/// Attempts that a report lists.
pub(crate) const MAX_REFUSED: usize = 64;

/// An attempt at a step that was given up without a trace.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Refused {
    /// Number of the step, from 1.
    pub step: u64,
    /// Where the attempt began [s].
    pub time: f64,
    /// Its size [s].
    pub dt: f64,
    /// What was wrong.
    pub reason: String,
}

/// A detector that was chosen by measuring.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Chosen {
    /// Number of the step after which it was chosen.
    pub step: u64,
    /// Time at the end of that step [s].
    pub time: f64,
    /// Name of the method.
    pub detector: String,
    /// `"cpu"`, or the GPU with its driver.
    pub device: String,
    /// Why, in words.
    pub why: String,
    /// Seconds of detection per step of each method that was measured.
    pub seconds_per_step: Vec<(String, f64)>,
}

/// Who detects continuously in a simulation.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Detection {
    /// Name of the method.
    pub detector: String,
    /// `"cpu"`, or the GPU with its driver.
    pub device: String,
    /// What chose it.
    pub why: String,
    /// Most memory on the GPU so far [B]; 0 on the CPU.
    pub device_bytes: u64,
}

impl Detection {
    pub(crate) fn on_cpu(detector: &str, why: &str) -> Self {
        Self { detector: detector.into(), device: "cpu".into(), why: why.into(), device_bytes: 0 }
    }
}

/// A GPU that was done without from a step on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Fallback {
    /// Number of the step in which it failed, from 1, and which was done again on the CPU; of a GPU that could not be had at the
    /// start, the number of steps before.
    pub step: u64,
    /// Start of that step [s].
    pub time: f64,
    /// Name of the method.
    pub detector: String,
    /// The GPU with its driver, or `"no GPU"`.
    pub device: String,
    /// What is wrong.
    pub reason: String,
}

impl std::fmt::Display for Fallback {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { step, detector, device, reason, .. } = self;
        write!(
            f,
            "detector \"{detector}\": on the CPU instead of a GPU since step {step}: {device}: {reason}"
        )
    }
}

/// One step.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct StepReport {
    /// Number of the step, from 1.
    pub step: u64,
    /// Time at its end [s].
    pub time: f64,
    /// Its size [s].
    pub dt: f64,
    /// Sub-steps taken: 1 unless the size was reduced.
    pub substeps: u32,
    /// Attempts given up on the way.
    pub retries: u32,
    /// Size of the smallest sub-step [s]; under `time.dt = "auto"` the step's, which is taken in two halves.
    #[serde(default)]
    pub smallest_dt: f64,
    /// Energy that contact made out of nothing, and smaller sub-steps too [J].
    #[serde(default)]
    pub energy_made: f64,
    /// Energy and work, where contact touched under an implicit integrator or `effects.energy_account` asks for them.
    #[serde(default)]
    pub energy: Option<EnergyReport>,
    /// Attempts refused because of their error, under `time.dt = "auto"`.
    #[serde(default)]
    pub rejected: u32,
    /// Estimated error [m], under `time.dt = "auto"`.
    #[serde(default)]
    pub error: Option<f64>,
    /// Whether that is above the tolerance, and smaller steps did not help.
    #[serde(default)]
    pub above_tolerance: bool,
    /// Newton iterations.
    pub newton_iterations: usize,
    /// Iterations of the linear solver.
    pub linear_iterations: usize,
    /// Largest relative residual reached.
    pub residual: f64,
    /// Whether every tolerance was met before its cap.
    pub converged: bool,
    /// Pieces of cloth that sleep at the end.
    #[serde(default)]
    pub asleep: usize,
    /// Hinges that remember their path as the last attempt begins, with `effects.history = "auto"`.
    #[serde(default)]
    pub remembering: Option<usize>,
    /// Contact, if the scene has it.
    pub contact: Option<ContactReport>,
    /// Pairs of triangles that pass through each other at the end, counted where the scene allows them.
    pub intersections: Option<usize>,
    /// Seconds per stage, in the order in which the stages run.
    pub seconds: Vec<(String, f64)>,
    /// Seconds per force model, a part of the stages' ("forces", "linearise", "assemble", "line search").
    pub forces: Vec<(String, f64)>,
}

/// Mechanical energy of the cloth, and what was done to it.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct EnergyReport {
    /// Kinetic, elastic and gravity energy at the end of the step [J].
    pub total: f64,
    /// Work of pins on the cloth in the step [J].
    pub pins: f64,
    /// Work of the air on the cloth in the step [J]: of wind, or against drag.
    pub air: f64,
}

/// Contact in one step.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ContactReport {
    /// Pairs within the thickness at the start.
    pub proximities: usize,
    /// Those of them whose side is remembered.
    #[serde(default)]
    pub remembered: usize,
    /// Pairs whose normal their remembered side decided: they touch but for rounding, or went through.
    #[serde(default)]
    pub by_side: usize,
    /// Triangles that were proved not to come near their own surface and not searched for it (`effects.self_collision = "auto"`).
    #[serde(default)]
    pub flat_triangles: u64,
    /// Vertices that the first continuous detection looked at; 0: it was proved to find nothing and left out
    /// (`effects.ccd = "auto"`).
    #[serde(default)]
    pub looked_at: usize,
    /// Sub-steps in which friction was Coulomb's, as no contact was fast enough for more (`effects.friction = "auto"`).
    #[serde(default)]
    pub slow_friction: usize,
    /// Continuous detections over the step.
    pub passes: usize,
    /// Pairs that collided in the first of them.
    pub collisions: usize,
    /// Contacts that carry an impulse.
    pub impulses: usize,
    /// Sweeps over the contacts.
    pub sweeps: usize,
    /// Largest error of a contact's relative velocity [m/s].
    pub residual: f64,
    /// Rigid impact zones.
    pub zones: usize,
    /// Vertices in them.
    pub zone_vertices: usize,
    /// Vertices whose motion was held back.
    pub held_vertices: usize,
    /// Pairs exempt because they touch already at the start.
    pub exempt: usize,
    /// Contacts that carry an impulse and stick.
    pub sticking: usize,
    /// Contacts that carry an impulse and slide.
    pub sliding: usize,
    /// Edges that the strain limit pulled or pushed.
    pub limited_edges: usize,
    /// Times that the strain limit was linearised anew.
    pub strain_passes: usize,
    /// Largest stretch l/l₀ − 1 of a limited edge after the step [-].
    pub largest_stretch: f64,
    /// Largest compression 1 − l/l₀ of an edge whose compression is limited, after the step [-].
    pub largest_compression: f64,
    /// Cloth vertices that constraints held on colliders so that they stuck.
    #[serde(default)]
    pub constrained_sticking: usize,
    /// Cloth vertices that constraints held on colliders and that slid.
    #[serde(default)]
    pub constrained_sliding: usize,
    /// Solves of the search for which stick and which slide.
    #[serde(default)]
    pub constraint_solves: usize,
}

impl ContactReport {
    pub(crate) fn add(&mut self, info: &cloth_response::ResponseInfo) {
        self.proximities += info.proximities;
        self.remembered += info.remembered;
        self.by_side += info.by_side;
        self.flat_triangles += info.flat_triangles;
        self.looked_at += info.looked_at;
        self.slow_friction += usize::from(info.slow_friction);
        self.passes += info.passes;
        self.collisions += info.collisions;
        self.impulses += info.impulses;
        self.sweeps += info.sweeps;
        self.residual = self.residual.max(info.residual);
        self.zones += info.zones;
        self.zone_vertices += info.zone_vertices;
        self.held_vertices += info.held_vertices;
        self.exempt = self.exempt.max(info.exempt);
        self.sticking += info.sticking;
        self.sliding += info.sliding;
        self.limited_edges += info.limited_edges;
        self.strain_passes += info.strain_passes;
        self.largest_stretch = self.largest_stretch.max(info.largest_stretch);
        self.largest_compression = self.largest_compression.max(info.largest_compression);
    }

    /// Adds what constraints did to vertices in the solves of one step.
    pub(crate) fn add_constraints(&mut self, holds: &crate::constraints::Holds, solves: usize) {
        for (force, sliding) in holds.force.iter().zip(&holds.sliding) {
            if *sliding {
                self.constrained_sliding += 1;
            } else if *force != crate::Vec3::zeros() {
                self.constrained_sticking += 1;
            }
        }
        self.constraint_solves += solves;
    }
}

/// Sums and extremes over all steps.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Totals {
    /// Steps.
    pub steps: u64,
    /// Sub-steps.
    pub substeps: u64,
    /// Attempts given up.
    pub retries: u64,
    /// Attempts refused because of their error, under `time.dt = "auto"`.
    #[serde(default)]
    pub rejected: u64,
    /// Steps whose estimated error is above the tolerance all the same.
    #[serde(default)]
    pub above_tolerance: u64,
    /// Energy that contact made out of nothing, smaller sub-steps too [J].
    #[serde(default)]
    pub energy_made: f64,
    /// Size of the largest step [s].
    #[serde(default)]
    pub largest_dt: f64,
    /// Steps whose size was reduced because one failed.
    #[serde(default)]
    pub reduced: u64,
    /// Size of the smallest sub-step [s]; none before the first step.
    #[serde(default)]
    pub smallest_dt: Option<f64>,
    /// End of the first step that has one of that size [s].
    #[serde(default)]
    pub smallest_dt_time: Option<f64>,
    /// Newton iterations.
    pub newton_iterations: u64,
    /// Iterations of the linear solver.
    pub linear_iterations: u64,
    /// Steps in which a tolerance was not met before its cap.
    pub not_converged: u64,
    /// Rigid impact zones.
    pub zones: u64,
    /// Vertices whose motion was held back.
    pub held_vertices: u64,
    /// Largest number of intersecting pairs at the end of a step, where they are allowed.
    pub max_intersections: Option<usize>,
    /// Wall-clock seconds in steps.
    pub wall_seconds: f64,
    /// Wall-clock seconds per stage, in the order in which the stages run.
    pub seconds: Vec<(String, f64)>,
}

/// What an effect costs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EffectCost {
    /// Name of the effect, as in the plan.
    pub name: String,
    /// Number of elements.
    pub elements: usize,
    /// Memory of its data [B]; for contact, whose buffers grow with what touches, the most so far.
    pub bytes: usize,
    /// Wall-clock milliseconds in all steps so far; the rows do not overlap and add up to the stages. `None` for an
    /// effect that is timed as part of another (self-contact and friction as part of contact).
    ///
    /// A force model has what its elements take: forces, couplings and energies. Summing corner forces at the vertices
    /// and couplings into the matrix goes over all models at once; it is the integrator's, as is all that its stages
    /// take besides the models.
    pub milliseconds: Option<f64>,
}

/// The effect whose stages hold the time of the force models.
const FORCES_WITHIN: &str = "integrator";

/// Strain limits: in a scene without contact all that response takes is for them.
const STRAIN: &str = "strain limit";

/// The effect that a stage of the step is counted under: an effect of the stage's own name, or one of these.
const STAGES: [(&str, &str); 12] = [
    ("bending sub-steps", FORCES_WITHIN),
    ("forces", FORCES_WITHIN),
    ("linearise", FORCES_WITHIN),
    ("assemble", FORCES_WITHIN),
    ("line search", FORCES_WITHIN),
    ("solve", "linear solver"),
    ("proximity", "contact"),
    ("impulses", "contact"),
    ("detection", "contact"),
    ("zones", "contact"),
    ("hold", "contact"),
    ("strain", STRAIN),
];

impl Report {
    /// The reports of the steps from number `first` (from 0, those left out counted) on.
    pub fn steps_from(&self, first: usize) -> &[StepReport] {
        &self.steps[first.saturating_sub(self.left_out).min(self.steps.len())..]
    }

    /// The same with no table of a step.
    #[must_use]
    pub fn without_steps(&self) -> Self {
        Self { left_out: self.left_out, ..self.without_steps_before(usize::MAX) }
    }

    /// The same without the steps before number `first`.
    pub(crate) fn without_steps_before(&self, first: usize) -> Self {
        let steps = self.steps_from(first).to_vec();
        let left_out = self.left_out + self.steps.len() - steps.len();
        Self {
            steps,
            left_out,
            totals: self.totals.clone(),
            effects: self.effects.clone(),
            threads: self.threads,
            detection: self.detection.clone(),
            fallbacks: self.fallbacks.clone(),
            choices: self.choices.clone(),
            refused: self.refused.clone(),
            untangled: self.untangled.clone(),
            continued: self.continued.clone(),
        }
    }

    /// Notes an attempt that was given up.
    pub(crate) fn refuse(&mut self, refused: impl FnOnce() -> Refused) {
        if self.refused.len() < MAX_REFUSED {
            self.refused.push(refused());
        }
    }

    /// Notes the memory that an effect holds now [B].
    pub(crate) fn grow(&mut self, effect: &str, bytes: usize) {
        if let Some(effect) = self.effects.iter_mut().find(|e| e.name == effect) {
            effect.bytes = effect.bytes.max(bytes);
        }
    }

    /// Notes the memory that detection holds on the GPU now [B].
    pub(crate) fn grow_on_device(&mut self, bytes: u64) {
        if let Some(detection) = &mut self.detection {
            detection.device_bytes = detection.device_bytes.max(bytes);
        }
    }

    /// Adds a step and its wall-clock seconds.
    pub(crate) fn push(&mut self, step: StepReport, wall_seconds: f64) {
        let t = &mut self.totals;
        t.steps += 1;
        t.substeps += u64::from(step.substeps);
        t.retries += u64::from(step.retries);
        t.rejected += u64::from(step.rejected);
        t.above_tolerance += u64::from(step.above_tolerance);
        t.energy_made += step.energy_made;
        t.largest_dt = t.largest_dt.max(step.dt);
        t.reduced += u64::from(step.smallest_dt < step.dt);
        if t.smallest_dt.is_none_or(|dt| step.smallest_dt < dt) {
            (t.smallest_dt, t.smallest_dt_time) = (Some(step.smallest_dt), Some(step.time));
        }
        t.newton_iterations += step.newton_iterations as u64;
        t.linear_iterations += step.linear_iterations as u64;
        t.not_converged += u64::from(!step.converged);
        if let Some(contact) = &step.contact {
            t.zones += contact.zones as u64;
            t.held_vertices += contact.held_vertices as u64;
        }
        t.max_intersections = t.max_intersections.max(step.intersections);
        t.wall_seconds += wall_seconds;
        for (name, seconds) in &step.seconds {
            add_seconds(&mut t.seconds, name, *seconds);
        }
        let alone = !self.effects.iter().any(|e| e.name == "contact");
        for (stage, seconds) in &step.seconds {
            let name = STAGES.iter().find(|(known, _)| known == stage).map_or(stage.as_str(), |s| s.1);
            let name = if alone && name == "contact" { STRAIN } else { name };
            add_milliseconds(&mut self.effects, name, 1e3 * seconds);
        }
        for (name, seconds) in &step.forces {
            add_milliseconds(&mut self.effects, name, 1e3 * seconds);
            add_milliseconds(&mut self.effects, FORCES_WITHIN, -1e3 * seconds);
        }
        self.steps.push(step);
    }
}

fn add_milliseconds(effects: &mut [EffectCost], name: &str, milliseconds: f64) {
    if let Some(effect) = effects.iter_mut().find(|e| e.name == name) {
        *effect.milliseconds.get_or_insert(0.0) += milliseconds;
    }
}

/// Adds to the entry of that name; new names keep the place of their first mention.
pub(crate) fn add_seconds(list: &mut Vec<(String, f64)>, name: &str, seconds: f64) {
    match list.iter_mut().find(|(known, _)| known == name) {
        Some((_, sum)) => *sum += seconds,
        None => list.push((name.into(), seconds)),
    }
}
