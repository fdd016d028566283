//! Which effects a scene runs, which it does not, and why: known before the first step.

mod contact;

use crate::bodies::Bodies;
use crate::contact::ContactStage;
use crate::cost;
use crate::pins::PinSet;
use crate::report::Detection;
use crate::scene::{Choice, Start};
use crate::step::State;
use crate::{Scene, SceneError};
use cloth_core::{CoreError, Integrator};
use contact::{plan_auto, plan_contact, plan_strain};
use serde::{Deserialize, Serialize};
use std::fmt;

/// One effect of the plan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Effect {
    /// Name.
    pub name: String,
    /// Whether it is built and runs.
    pub on: bool,
    /// Why, in words.
    pub why: String,
    /// Number of elements (0 if off).
    pub elements: usize,
    /// Memory of its data before the first step [B] (0 if off).
    pub bytes: usize,
    /// Estimate of what a step takes for it on one thread [ms]: its elements times what one took on the machine of the cost
    /// model. `None` for an effect that is timed as part of another, and for one that is off.
    #[serde(default)]
    pub milliseconds: Option<f64>,
}

/// The effects of a scene, those that run first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Name of the scene.
    pub scene: String,
    /// Effects in the order of the step, then those that are off.
    pub effects: Vec<Effect>,
    /// Cloth vertices, without colliders.
    pub cloth_vertices: usize,
    /// Triangles of all bodies.
    pub triangles: usize,
    /// Largest time step [s].
    pub dt: f64,
    /// Estimate of the largest stable step at the start [s], for explicit integrators.
    pub stable_dt: Option<f64>,
    /// Who detects continuously; none without contact.
    pub detection: Option<Detection>,
    /// What is likely to go wrong.
    pub warnings: Vec<String>,
}

impl Plan {
    /// Names of the effects that run.
    pub fn running(&self) -> impl Iterator<Item = &str> {
        self.effects.iter().filter(|e| e.on).map(|e| e.name.as_str())
    }

    /// Says what untangling the start state did.
    pub(crate) fn note_untangled(&mut self, done: &crate::Untangled) {
        if let Some(effect) = self.effects.iter_mut().find(|e| e.name == UNTANGLED) {
            effect.elements = done.moved.len();
            let what = match done.pairs {
                0 => "nothing passed through anything".to_owned(),
                n => format!("{n} pairs resolved, vertices moved by at most {:.3e} m", done.largest),
            };
            effect.why = format!("{}: {what}", effect.why);
        }
    }
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{}: {} cloth vertices, {} triangles, dt = {} s",
            self.scene, self.cloth_vertices, self.triangles, self.dt
        )?;
        if let Some(stable) = self.stable_dt {
            writeln!(f, "largest stable step at the start: about {stable:.3e} s")?;
        }
        if let Some(Detection { detector, device, why, .. }) = &self.detection {
            writeln!(f, "detection: \"{detector}\" on {device} ({why})")?;
        }
        let width = self.effects.iter().map(|e| e.name.chars().count()).max().unwrap_or(0);
        for effect in self.effects.iter().filter(|e| e.on) {
            let cost = effect.milliseconds.map_or_else(String::new, |ms| format!("{ms:.3} ms"));
            let size = format!("{:>9}  {:>9}  {cost:>10}", effect.elements, bytes(effect.bytes));
            writeln!(f, "  on   {:width$}  {size}  {}", effect.name, effect.why)?;
        }
        for effect in self.effects.iter().filter(|e| !e.on) {
            writeln!(f, "  off  {:width$}  {:32}  {}", effect.name, "", effect.why)?;
        }
        writeln!(
            f,
            "elements, bytes, and what a step takes on one thread: an estimate from {}",
            cost::source()
        )?;
        for warning in &self.warnings {
            writeln!(f, "warning: {warning}")?;
        }
        Ok(())
    }
}

fn bytes(count: usize) -> String {
    match count {
        0..=9_999 => format!("{count} B"),
        10_000..=9_999_999 => format!("{:.1} kB", count as f64 * 1e-3),
        _ => format!("{:.1} MB", count as f64 * 1e-6),
    }
}

/// Effects of the dynamics that a scene may call for, what calls for them, and what is the case where nothing does.
const DYNAMICS: [(&str, &str, &str); 11] = [
    ("gravity", "gravity is not zero", "gravity is zero"),
    ("wind", "air.drag or air.lift is above zero", "air.density, or air.drag and air.lift, are zero"),
    ("air-damping", "air.damping is above zero", "air.damping is zero"),
    ("spring", "in_plane.model = \"spring\"", "no material has in_plane.model = \"spring\""),
    (
        "baraff-witkin",
        "in_plane.model = \"baraff-witkin\"",
        "no material has in_plane.model = \"baraff-witkin\"",
    ),
    (
        "bending-spring",
        "bending.model = \"bending-spring\"",
        "no material has bending.model = \"bending-spring\" with a stiffness or damping",
    ),
    ("hinge", "bending.model = \"hinge\"", "no material has bending.model = \"hinge\" with a rigidity"),
    ("nonlinear", "bending.model = \"nonlinear\"", "no material has bending.model = \"nonlinear\""),
    ("plastic", "bending.model = \"plastic\"", "no material has bending.model = \"plastic\""),
    ("stitches", "cloth with seams", "no cloth has seams"),
    ("hysteresis", "bending.model = \"hysteresis\"", "no material has bending.model = \"hysteresis\""),
];

/// The effect of `start = "untangle"`.
const UNTANGLED: &str = "untangled start";

/// The effect of `effects.history = "auto"`.
pub(crate) const ELASTIC_HINGES: &str = "elastic hinges";

/// Collects effects that are on and effects that are off.
#[derive(Default)]
struct Effects {
    on: Vec<Effect>,
    off: Vec<Effect>,
}

impl Effects {
    fn on(&mut self, name: &str, why: impl Into<String>, elements: usize, bytes: usize) {
        match self.on.iter_mut().find(|e| e.name == name) {
            Some(known) => {
                known.elements += elements;
                known.bytes += bytes;
            }
            None => {
                self.on.push(Effect {
                    name: name.into(),
                    on: true,
                    why: why.into(),
                    elements,
                    bytes,
                    milliseconds: None,
                });
            }
        }
    }

    fn off(&mut self, name: &str, why: impl Into<String>) {
        let (name, why) = (name.into(), why.into());
        self.off.push(Effect { name, on: false, why, elements: 0, bytes: 0, milliseconds: None });
    }
}

/// The plan of what has been built.
pub(crate) fn build(
    scene: &Scene,
    bodies: &Bodies,
    integrator: &Integrator,
    contact: Option<&ContactStage>,
    pins: &PinSet,
    state: &State,
) -> Plan {
    let mut effects = Effects::default();
    let moving: Vec<_> = bodies.colliders.iter().filter(|c| c.motion.moves()).collect();
    if moving.is_empty() {
        effects.off("moving colliders", "no collider has keyframes or a sequence");
    } else {
        let vertices = moving.iter().map(|c| c.motion.vertex_count()).sum();
        let bytes = moving.iter().map(|c| c.motion.bytes()).sum();
        effects.on("moving colliders", "colliders with keyframes or a sequence", vertices, bytes);
    }
    if pins.vertices.is_empty() {
        effects.off("pins", "no cloth has pins");
    } else {
        effects.on("pins", "cloth with pins", pins.vertices.len(), pins.bytes());
    }

    let built = integrator.system().effects();
    for effect in &built {
        let why = DYNAMICS.iter().find(|(name, ..)| *name == effect.name).map_or("called for", |d| d.1);
        effects.on(effect.name, why, effect.elements, effect.bytes);
    }
    for (name, _, why) in DYNAMICS {
        if !built.iter().any(|e| e.name == name) {
            effects.off(name, why);
        }
    }
    let coupling = integrator.system().hinge_coupling();
    if coupling.elements > 0 {
        effects.on(coupling.name, "bending.hinges = \"coupled\"", coupling.elements, coupling.bytes);
    } else {
        effects.off(
            coupling.name,
            "no material has bending.hinges = \"coupled\" and hinges that share a triangle",
        );
    }
    let method = scene.time.integrator;
    effects.on(
        "integrator",
        format!("time.integrator = \"{}\"", kebab(&method)),
        bodies.cloth_vertices,
        integrator.bytes(),
    );
    plan_history(&mut effects, scene, integrator);
    plan_steps(&mut effects, scene, bodies);
    match (scene.start, &scene.contact) {
        (Start::Untangle, Some(_)) => effects.on(UNTANGLED, "start = \"untangle\"", 0, 0),
        (Start::Untangle, None) => effects.off(UNTANGLED, "the scene has no [contact]"),
        (Start::AsGiven, _) => effects.off(UNTANGLED, "start = \"as-given\""),
    }
    let explicit = method.is_explicit();
    if explicit {
        effects.off("linear solver", "the integrator is explicit");
    } else {
        effects.on(
            "linear solver",
            format!("solver.method = \"{}\" (its memory is the integrator's)", kebab(&scene.solver.method)),
            bodies.cloth_vertices,
            0,
        );
    }
    plan_contact(&mut effects, scene, bodies, contact);
    plan_strain(&mut effects, scene, contact);
    plan_auto(&mut effects, scene, bodies, contact);
    effects.on("guard", "always", bodies.cloth_vertices, 0);
    if scene.effects.energy_account {
        effects.on("energy account", "effects.energy_account", bodies.cloth_vertices, 0);
    } else {
        effects.off("energy account", "effects.energy_account is false: kept only where contact touches");
    }

    let mut warnings = Vec::new();
    let stable_dt = method.has_stability_limit().then(|| integrator.stable_step(&state.x, &state.v));
    if let Some(stable) = stable_dt.filter(|stable| scene.time.fixed().is_some_and(|dt| dt > *stable)) {
        warnings.push(format!(
            "time.dt = {} s is above the largest stable step of \"{}\", about {stable:.3e} s: the run is likely to diverge",
            scene.time.largest(),
            kebab(&method)
        ));
    }
    if contact.is_none() && !scene.collider.is_empty() {
        warnings.push("there are colliders but no [contact]: cloth passes through them".into());
    }
    if let Some(contact) = &scene.contact {
        warnings.extend(bodies.cloth.iter().zip(&scene.cloth).filter_map(|(body, source)| {
            let edge = body.median_edge();
            (contact.thickness > edge).then(|| {
                format!(
                    "contact.thickness = {} m is above the edge length of \"{}\", about {edge:.3e} m: every vertex is near \
                     many others, which takes time, and cloth keeps more distance than its mesh can show",
                    contact.thickness, source.name
                )
            })
        }));
    }
    warnings.extend(bodies.cloth.iter().flat_map(|body| body.seams.warnings.iter().cloned()));
    warnings.extend(contact.and_then(|stage| stage.continuous.lack.as_ref()).map(ToString::to_string));
    let triangles = bodies.cloth.iter().map(|c| c.mesh.triangles.len()).sum::<usize>()
        + bodies.colliders.iter().map(|c| c.triangles.len()).sum::<usize>();
    for effect in &mut effects.on {
        effect.milliseconds = cost::estimate(&effect.name, effect.elements);
    }
    effects.on.append(&mut effects.off);
    Plan {
        scene: scene.name.clone(),
        effects: effects.on,
        cloth_vertices: bodies.cloth_vertices,
        triangles,
        dt: scene.time.largest(),
        stable_dt: stable_dt.filter(|s| s.is_finite()),
        detection: contact
            .filter(|_| scene.contact.is_some())
            .map(|stage| stage.continuous.detection.clone()),
        warnings,
    }
}

/// Which hinges remember their path.
fn plan_history(effects: &mut Effects, scene: &Scene, integrator: &Integrator) {
    if scene.effects.history == Choice::On {
        return effects
            .off(ELASTIC_HINGES, "effects.history = \"on\": all hinges of laws with memory remember");
    }
    let histories = integrator.system().histories();
    let has = |law: &str| histories.iter().any(|h| h.law == law);
    let mut ranges = Vec::new();
    if has("plastic") {
        ranges.push("plastic up to its elastic_limit, which changes nothing".to_owned());
    }
    if has("hysteresis") {
        let tolerance = scene.effects.history_tolerance;
        let share = 100.0 * 2.0 * tolerance / (2.0 - tolerance);
        ranges.push(format!(
            "hysteresis up to {share:.3} % of its transition_curvature, with moments right to history_tolerance = {tolerance} of \
             the frictional moment"
        ));
    }
    if ranges.is_empty() {
        return effects.off(ELASTIC_HINGES, "no material has bending.model = \"plastic\" or \"hysteresis\"");
    }
    let why =
        format!("effects.history = \"auto\": no history before a hinge is bent more ({})", ranges.join("; "));
    effects.on(ELASTIC_HINGES, why, histories.iter().map(|h| h.hinges).sum(), 0);
}

/// How steps are cut: where one fails, and by their error.
fn plan_steps(effects: &mut Effects, scene: &Scene, bodies: &Bodies) {
    const ADAPTIVE: &str = "adaptive step";
    const CONTROLLED: &str = "error-controlled step";
    let time = &scene.time;
    let Some(dt) = time.fixed() else {
        let why = format!(
            "time.dt = \"auto\": steps of {} to {} s whose estimated error is at most {} m",
            time.dt_min, time.dt_max, time.dt_tolerance
        );
        // Four more states: position, velocity and force of contact.
        let bytes = 4 * 3 * size_of::<crate::Vec3>() * bodies.vertices;
        effects.on(CONTROLLED, why, bodies.cloth_vertices, bytes);
        effects
            .off(ADAPTIVE, "time.dt is \"auto\": a step that fails is halved by the error-controlled step");
        return;
    };
    let floor = (dt / (1_u64 << time.max_halvings) as f64).max(time.dt_min.min(dt));
    if floor < dt {
        let why =
            format!("a step that fails is halved, to {floor:.3e} s at the least, and grows back slowly");
        effects.on(ADAPTIVE, why, 0, 0);
    } else {
        effects.off(ADAPTIVE, "time.max_halvings is zero, or time.dt_min leaves no room");
    }
    effects.off(CONTROLLED, "time.dt is a number");
}

/// The name of a choice as a scene file writes it.
fn kebab<T: Serialize>(value: &T) -> String {
    match serde_json::to_value(value) {
        Ok(serde_json::Value::String(name)) => name,
        _ => String::new(),
    }
}

/// An error of the dynamics in terms of the scene.
pub(crate) fn core_error(scene: &Scene, error: &CoreError) -> SceneError {
    match error {
        CoreError::Parameter { name, expected, got } => scene.error(name, *expected, format!("{got}")),
        CoreError::Degenerate { model, element, vertices, measure, got } => scene.error(
            "cloth",
            format!("elements with an extent for \"{model}\""),
            format!("{measure} {got:e} at element {element} (vertices {vertices:?})"),
        ),
        other => scene.error("cloth", "cloth that can be built", other.to_string()),
    }
}
