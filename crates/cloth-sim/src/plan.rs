//! Which effects a scene runs, which it does not, and why: known before the first step.

use crate::bodies::Bodies;
use crate::contact::ContactStage;
use crate::cost;
use crate::friction::LawName;
use crate::pins::PinSet;
use crate::report::Detection;
use crate::scene::{Choice, Contact, ContactMethod, Start};
use crate::step::State;
use crate::{Scene, SceneError};
use cloth_core::{CoreError, Integrator};
use cloth_response::FrictionLaw;
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

fn plan_contact(effects: &mut Effects, scene: &Scene, bodies: &Bodies, stage: Option<&ContactStage>) {
    let (Some(stage), Some(contact)) = (stage, &scene.contact) else {
        for name in ["contact", "contact constraints", "self-contact", "collider contact", "friction"] {
            effects.off(name, "the scene has no [contact]");
        }
        for law in LawName::ALL {
            effects.off(&law_effect(law), "the scene has no [contact]");
        }
        effects.off("intersection count", "the scene has no [contact]");
        return;
    };
    let mesh = &stage.mesh;
    effects.on(
        "contact",
        format!("[contact] with detector \"{}\"", stage.continuous.detection.detector),
        mesh.triangles.len(),
        stage.bytes(),
    );
    match contact.method {
        ContactMethod::VelocityFilter => {
            effects.off("contact constraints", "contact.method = \"velocity-filter\"");
        }
        ContactMethod::Constraints => {
            let why =
                "contact.method = \"constraints\": cloth vertices on colliders (its memory is contact's)";
            effects.on("contact constraints", why, bodies.cloth_vertices, 0);
        }
    }
    let selves = bodies.cloth.iter().zip(&mesh.bodies).filter(|(_, rule)| rule.self_collision);
    let self_triangles: usize = selves.map(|(c, _)| c.mesh.triangles.len()).sum();
    if self_triangles > 0 {
        effects.on("self-contact", "contact.self and cloth.self_collision", self_triangles, 0);
    } else {
        effects.off("self-contact", "contact.self is false, or each cloth's self_collision is");
    }
    let others: usize = bodies.colliders.iter().map(|c| c.triangles.len()).sum();
    if others > 0 {
        effects.on("collider contact", "the scene has colliders", others, 0);
    } else {
        effects.off("collider contact", "the scene has no collider");
    }
    plan_friction(effects, scene, contact, stage);
    if stage.allow {
        effects.on("intersection count", "intersections are allowed", mesh.triangles.len(), 0);
    } else {
        effects.off("intersection count", "intersections are not allowed, so there are none");
    }
}

/// Name of the effect of a friction law.
fn law_effect(law: LawName) -> String {
    format!("friction {}", law.name())
}

/// One effect per friction law, with the number of pairs of bodies that have it, and one for all of them.
fn plan_friction(effects: &mut Effects, scene: &Scene, contact: &Contact, stage: &ContactStage) {
    /// Keys that are named.
    const NAMED: usize = 4;
    let (cloths, bodies) = (scene.cloth.len(), stage.mesh.bodies.len());
    let meeting = (0..cloths)
        .flat_map(|a| (a..bodies).map(move |b| (a, b)))
        .filter(|&(a, b)| a != b || stage.mesh.bodies[a].self_collision);
    // Of each law: pairs, and the keys that ask for it with the kind of pair.
    let mut found = LawName::ALL.map(|law| (law, 0, Vec::<String>::new()));
    for (a, b) in meeting {
        let law = scene.friction_law(contact, a, b);
        let viscous = matches!(law, FrictionLaw::Viscous { f_v, .. } if f_v > 0.0);
        if !(law.static_coefficient() > 0.0 || viscous) {
            continue;
        }
        let kind = match (a == b, b < cloths) {
            (true, _) => "self-contact",
            (_, true) => "cloth on cloth",
            _ => "colliders",
        };
        let Some((_, pairs, keys)) = found.iter_mut().find(|(name, ..)| name.name() == law.name()) else {
            continue;
        };
        *pairs += 1;
        let key = format!("{kind}: {}", scene.friction_entry(contact, a, b).0);
        if !keys.contains(&key) {
            keys.push(key);
        }
    }
    let pairs = found.iter().map(|(_, pairs, _)| pairs).sum();
    if pairs > 0 {
        let table = size_of::<u16>() * bodies * bodies;
        effects.on("friction", "a coefficient of friction above zero", pairs, table);
    } else {
        effects.off("friction", "every coefficient of friction is zero");
    }
    for (law, pairs, keys) in found {
        if pairs == 0 {
            effects
                .off(&law_effect(law), format!("no pair of bodies that meet has law = \"{}\"", law.name()));
            continue;
        }
        let more =
            if keys.len() > NAMED { format!(" and {} more", keys.len() - NAMED) } else { String::new() };
        let why = keys[..keys.len().min(NAMED)].join(", ") + &more;
        effects.on(&law_effect(law), why, pairs, 0);
    }
}

/// The effect of limited edges.
fn plan_strain(effects: &mut Effects, scene: &Scene, stage: Option<&ContactStage>) {
    match stage.filter(|stage| stage.limited_edges > 0) {
        None => effects.off("strain limit", "no cloth has a strain_limit"),
        Some(stage) if scene.contact.is_some() => {
            let why = "cloth with strain_limit (its memory is contact's)";
            effects.on("strain limit", why, stage.limited_edges, 0);
        }
        Some(stage) => {
            effects.on("strain limit", "cloth with strain_limit", stage.limited_edges, stage.bytes());
        }
    }
}

/// What the engine decides by itself, step by step.
fn plan_auto(effects: &mut Effects, scene: &Scene, bodies: &Bodies, stage: Option<&ContactStage>) {
    let meeting = stage.filter(|_| scene.contact.is_some());
    let selves = meeting.is_some_and(|s| s.mesh.bodies.iter().any(|b| b.self_collision));
    match (scene.effects.self_collision, meeting) {
        (Choice::On, _) => effects.off("flatness proofs", "effects.self_collision = \"on\""),
        (Choice::Auto, Some(stage)) if selves => {
            let why = "effects.self_collision = \"auto\": no search of cloth near itself where normals and contour prove it flat";
            effects.on("flatness proofs", why, stage.mesh.triangles.len(), 0);
        }
        (Choice::Auto, _) => effects.off("flatness proofs", "no cloth meets itself"),
    }
    match (scene.effects.ccd, meeting) {
        (Choice::On, _) => effects.off("gap proofs", "effects.ccd = \"on\""),
        (Choice::Auto, Some(stage)) => {
            let why = "effects.ccd = \"auto\": no continuous detection of what moves less than its gap";
            effects.on("gap proofs", why, stage.mesh.vertex_count, 0);
        }
        (Choice::Auto, None) => effects.off("gap proofs", "the scene has no [contact]"),
    }
    plan_slow_friction(effects, scene, meeting);
    match scene.effects.sleep {
        None => effects.off("sleep", "the scene has no effects.sleep"),
        Some(sleep) => {
            let why = format!("effects.sleep: cloth slower than {} m/s for {} s", sleep.speed, sleep.time);
            effects.on("sleep", why, bodies.cloth.len(), 2 * bodies.vertices);
        }
    }
}

/// Steps without the terms of friction that depend on speed.
fn plan_slow_friction(effects: &mut Effects, scene: &Scene, meeting: Option<&ContactStage>) {
    let name = "slow friction";
    if scene.effects.friction == Choice::On {
        return effects.off(name, "effects.friction = \"on\"");
    }
    let Some(stage) = meeting else {
        return effects.off(name, "the scene has no [contact]");
    };
    if stage.constraints.is_some() {
        return effects.off(name, "contact.method = \"constraints\" has a friction of its own");
    }
    let Some(speed) = stage.responder.slow_speed() else {
        return effects.off(name, "all laws are Coulomb's: no term depends on speed");
    };
    let when = if speed == f64::INFINITY {
        "in all steps, as no law differs by more".to_owned()
    } else if speed > 0.0 {
        format!("while no contact can slide faster than {speed:.3e} m/s")
    } else {
        "while all contacts stick".to_owned()
    };
    let tolerance = scene.effects.friction_tolerance;
    let why = format!("effects.friction = \"auto\": Coulomb's law {when} (friction_tolerance {tolerance})");
    effects.on(name, why, stage.mesh.bodies.len(), 0);
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
