//! What contact and strain limits need, built once.

use crate::bodies::Bodies;
use crate::constraints::ConstraintStage;
use crate::device::{Continuous, DeviceError};
use crate::pins::PinSet;
use crate::scene::{Choice, Contact, ContactMethod};
use crate::{Scene, SimError, Simulation, SimulationOptions, Vec3};
use cloth_collision::{Body, Bvh, CollisionMesh, intersections};
use cloth_response::{FrictionRule, Responder, ResponseInfo, ResponseParams};

/// What a scene with contact has and one without does not.
pub(crate) struct ContactStage {
    pub(crate) mesh: CollisionMesh,
    pub(crate) bvh: Bvh,
    /// With `contact.method = "constraints"`.
    pub(crate) constraints: Option<ConstraintStage>,
    /// Who detects continuously.
    pub(crate) continuous: Continuous,
    pub(crate) responder: Responder,
    /// Whether known intersections are allowed.
    pub(crate) allow: bool,
    /// Edges whose strain is limited.
    pub(crate) limited_edges: usize,
}

impl ContactStage {
    pub(crate) fn new(
        scene: &Scene,
        contact: &Contact,
        options: SimulationOptions,
        bodies: &Bodies,
        pins: &PinSet,
        x: &[Vec3],
    ) -> Result<Self, SimError> {
        let allow = options.allow_intersections || contact.allow_intersections;
        // Strain limits alone: nothing meets anything.
        let meets = scene.contact.is_some();
        let cloth = bodies.cloth.iter().zip(&scene.cloth).map(|(body, source)| {
            let self_collision = meets && contact.self_collision && source.self_collision;
            (Body { dynamic: meets, self_collision }, body.x.len(), &body.mesh.triangles[..])
        });
        let colliders = bodies.colliders.iter().map(|body| {
            let rule = Body { dynamic: false, self_collision: false };
            (rule, body.motion.vertex_count(), &body.triangles[..])
        });
        let list: Vec<_> = cloth.chain(colliders).collect();
        let mut mesh = CollisionMesh::new(&list).map_err(|e| stage("collision mesh", &e))?;
        for &(vertex, collider) in &pins.attachments {
            mesh.set_attachment(vertex, (bodies.cloth.len() + collider) as u32);
        }
        mesh.sew(&bodies.joined());
        let mut bvh = Bvh::new(&mesh, x).map_err(|e| stage("collision mesh", &e))?;
        bvh.prove_flatness(meets && scene.effects.self_collision == Choice::Auto);
        let continuous = if meets {
            Continuous::choose(&contact.detector, options.device, options.gpu, &mesh, x)
                .map_err(|error| refused(scene, error))?
        } else {
            Continuous::tree("nothing meets anything")
        };
        let friction = FrictionRule::from_pairs(list.len(), |a, b| scene.friction_law(contact, a, b));
        let constraints = (meets && contact.method == ContactMethod::Constraints)
            .then(|| ConstraintStage::new(&mesh, contact.thickness, friction.clone(), bodies));
        let params = ResponseParams {
            thickness: contact.thickness,
            repulsion_stiffness: contact.repulsion_stiffness,
            friction,
            max_passes: contact.max_passes,
            max_zone_passes: contact.max_zone_passes,
            vertices_carry: constraints.is_some(),
            friction_tolerance: (meets && constraints.is_none() && scene.effects.friction == Choice::Auto)
                .then_some(scene.effects.friction_tolerance),
            skip_proved: meets && scene.effects.ccd == Choice::Auto,
            allow_initial_contacts: allow,
            ..ResponseParams::default()
        };
        let mut responder = Responder::new(&mesh, params).map_err(|e| stage("contact", &e))?;
        let mut rest_x = x.to_vec();
        for body in &bodies.cloth {
            rest_x[body.first_vertex..body.first_vertex + body.x.len()].copy_from_slice(&body.mesh.vertices);
        }
        responder.set_rest(&mesh, &rest_x).map_err(|e| stage("contact", &e))?;
        let limited = bodies.limited_edges(scene, &pins.vertices);
        let limited_edges = limited.len();
        responder.set_strain_limits(&mesh, limited).map_err(|e| stage("strain limit", &e))?;
        Ok(Self { mesh, bvh, constraints, continuous, responder, allow, limited_edges })
    }

    pub(crate) fn intersections(
        &self,
        x: &[Vec3],
        pool: &rayon::ThreadPool,
    ) -> Result<Vec<[u32; 2]>, SimError> {
        intersections(&self.mesh, x, pool).map_err(|e| stage("intersections", &e))
    }

    /// Memory of the collision topology, of the detection's tree and boxes, and of the response's buffers, which grow with
    /// the contacts [B].
    pub(crate) fn bytes(&self) -> usize {
        let mesh = &self.mesh;
        size_of_val(&mesh.triangles[..])
            + size_of_val(&mesh.edges[..])
            + size_of_val(&mesh.triangle_edges[..])
            + size_of_val(&mesh.vertex_body[..])
            + size_of_val(&mesh.attached_to[..])
            + size_of_val(&mesh.sewn[..])
            + size_of_val(&mesh.vertex_owner[..])
            + size_of_val(&mesh.edge_owner[..])
            + mesh.vertex_triangles.bytes()
            + self.bvh.bytes()
            + self.continuous.bytes()
            + self.responder.bytes()
            + self.constraints.as_ref().map_or(0, ConstraintStage::bytes)
    }
}

impl Simulation {
    /// What contact remembers of the step that is now the state, in which detection took so many seconds, and
    /// all so many.
    pub(crate) fn accept_contact(&mut self, seconds: [f64; 2]) {
        let (Some(contact), state) = (&mut self.contact, &self.state) else { return };
        contact.responder.accept();
        let (mesh, step) = (&contact.mesh, state.step + 1);
        if let Some(chosen) = contact.continuous.observe(seconds, mesh, &state.x, step, state.time) {
            self.report.detection = Some(contact.continuous.detection.clone());
            self.report.choices.push(chosen);
        }
    }
}

/// Seconds of the continuous detection.
pub(crate) fn seconds_of_detection(info: &ResponseInfo) -> f64 {
    info.seconds.iter().find(|(stage, _)| *stage == "detection").map_or(0.0, |(_, seconds)| *seconds)
}

/// The error of a detector that cannot be had, in terms of the scene where it is the scene's.
fn refused(scene: &Scene, error: DeviceError) -> SimError {
    match error {
        DeviceError::WrongDevice { method, expected } => {
            SimError::InvalidScene(scene.error("contact.detector", expected, format!("\"{method}\"")))
        }
        DeviceError::Query(error) => stage("detector", &error),
        error => SimError::Device(error),
    }
}

pub(crate) fn stage(stage: &'static str, error: &dyn std::error::Error) -> SimError {
    SimError::Stage { stage, message: error.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Assets;
    use cloth_response::{Side, Sides};

    /// A card that falls on another one on the ground; `contact`: more of that table.
    fn cards(contact: &str) -> Simulation {
        let text = format!(
            r#"
duration = 1.0
[time]
dt = 0.004
max_halvings = 3
[contact]
thickness = 0.004
{contact}
[[cloth]]
name = "upper"
mesh = {{ generator = "grid", width = 0.3, height = 0.3, nx = 7, ny = 7 }}
material = {{ areal_density = 0.2, in_plane = {{ model = "spring", stiffness = 50.0 }} }}
position = [0.01, 0.0085, 0.02]
rotation = {{ axis = [0, 1, 0], angle = 0.3 }}
[[cloth]]
name = "lower"
mesh = {{ generator = "grid", width = 0.3, height = 0.3, nx = 6, ny = 6 }}
material = {{ areal_density = 0.2, in_plane = {{ model = "spring", stiffness = 50.0 }} }}
position = [0.0, 0.0042, 0.0]
[[collider]]
name = "ground"
shape = {{ type = "plane", half_size = 1.0 }}
"#
        );
        let scene = Scene::parse_toml(&text, "test.toml").unwrap();
        let options = SimulationOptions {
            threads: Some(1),
            device: crate::device::Device::Cpu,
            ..SimulationOptions::default()
        };
        Simulation::new(&scene, Assets::default(), options).unwrap()
    }

    fn sides(sim: &Simulation) -> &Sides {
        sim.contact.as_ref().unwrap().responder.sides()
    }

    fn set_sides(sim: &mut Simulation, sides: Sides) {
        sim.contact.as_mut().unwrap().responder.set_sides(sides);
    }

    #[test]
    fn sides_are_committed_once_per_accepted_step() {
        let mut retried = cards("");
        retried.fail = |time, dt| (0.03..0.034).contains(&time) && dt > 0.003;
        for _ in 0..12 {
            retried.step().unwrap();
        }
        assert_eq!(retried.report.steps.iter().map(|s| s.retries).sum::<u32>(), 1);
        let mut straight = cards("");
        for step in &retried.report.steps {
            let start = straight.time();
            for k in 1..=step.substeps {
                let end =
                    if k == step.substeps { step.time } else { start + step.dt / f64::from(step.substeps) };
                straight.step_to(end, step.dt / f64::from(step.substeps)).unwrap();
            }
        }
        assert_eq!(sides(&retried), sides(&straight));
        assert_eq!(retried.state.x, straight.state.x);
        // An attempt that the guard gives up after its response leaves what was remembered.
        let before = sides(&retried).clone();
        retried.state.v[7].x = 1e6;
        assert!(retried.attempt(0.052, 0.004, false, &mut crate::StepReport::default()).is_err());
        assert_eq!(sides(&retried), &before);
        retried.state.v[7].x = 0.0;
        // The steps are reduced still: sides change over a few of them.
        for _ in 0..10 {
            retried.step().unwrap();
        }
        assert_ne!(sides(&retried), &before, "the comparison sees a step");
    }

    #[test]
    fn sides_survive_a_checkpoint_to_the_same_bits() {
        let mut sim = cards("allow_intersections = true");
        for _ in 0..30 {
            sim.step().unwrap();
        }
        // A vertex of the upper card that went through: it comes back where that is remembered, and else stays.
        let v = 24;
        sim.state.x[v].y = sim.state.x[v].y.min(0.003);
        let told = |s: &Side| {
            let is_own = s.vertices[0] == v as u32;
            Side { certain: !is_own, ..*s }
        };
        let list: Vec<Side> = sides(&sim).pairs().iter().map(told).collect();
        assert!(list.iter().any(|s| !s.certain) && list.len() > 100);
        let told = Sides::new(list, &sim.contact.as_ref().unwrap().mesh).unwrap();
        set_sides(&mut sim, told);
        let bytes = sim.checkpoint();
        let mut resumed = Simulation::resume(&bytes, Some(2)).unwrap();
        assert_eq!(sides(&resumed), sides(&sim));
        let mut forgetful = Simulation::resume(&bytes, Some(2)).unwrap();
        set_sides(&mut forgetful, Sides::default());
        for _ in 0..10 {
            for sim in [&mut sim, &mut resumed, &mut forgetful] {
                sim.step().unwrap();
            }
        }
        assert_eq!(resumed.state, sim.state);
        assert_eq!(sides(&resumed), sides(&sim));
        assert_ne!(forgetful.state.x, sim.state.x, "sides that are lost are seen");
        assert!(sim.report.steps.iter().any(|s| s.contact.as_ref().unwrap().by_side > 0));
    }

    #[test]
    fn every_detector_leaves_the_same_sides() {
        let run = |detector: &str| {
            let mut sim = cards(&format!("detector = \"{detector}\""));
            for _ in 0..15 {
                sim.step().unwrap();
            }
            (sides(&sim).clone(), sim.state.x)
        };
        let expected = run("bvh");
        assert!(expected.0.pairs().len() > 100);
        for detector in ["session", "brute", "auto"] {
            assert!(run(detector) == expected, "{detector}");
        }
    }

    /// What is measured decides who detects, and nothing else.
    #[test]
    fn auto_takes_the_cheapest_and_keeps_the_bits() {
        const STEPS: usize = 230;
        let run = |plant: Option<fn(&str) -> f64>| {
            let mut sim = cards("detector = \"auto\"");
            let why = sim.plan().detection.clone().unwrap().why;
            assert!(why.starts_with("device \"cpu\"; measured against \"session\""), "{why}");
            if let Some(plant) = plant {
                sim.contact.as_mut().unwrap().continuous.plant(plant);
            }
            for _ in 0..STEPS {
                sim.step().unwrap();
            }
            sim
        };
        let mut named = cards("detector = \"bvh\"");
        for _ in 0..STEPS {
            named.step().unwrap();
        }
        assert!(named.report.choices.is_empty());
        let cheap_session = run(Some(|name| if name == "session" { 1e-3 } else { 4e-3 }));
        let cheap_tree = run(Some(|name| if name == "session" { 4e-3 } else { 1e-3 }));
        for (sim, expected) in [(&cheap_session, "session"), (&cheap_tree, "bvh")] {
            assert!(sim.state == named.state && sides(sim) == sides(&named), "{expected}");
            let report = sim.report();
            assert!(report.choices.len() == 2 && report.choices.iter().all(|c| c.detector == expected));
            let first = &report.choices[0];
            assert_eq!(
                (first.time, first.seconds_per_step.len()),
                (report.steps[first.step as usize - 1].time, 2)
            );
            let detection = report.detection.clone().unwrap();
            assert_eq!((detection.detector.as_str(), &detection.why), (expected, &report.choices[1].why));
            assert!(detection.why.starts_with("measured: 1.000 ms per step against 4.000 ms with"));
            // Once it is chosen, the others are gone with their memory.
            let continuous = &sim.contact.as_ref().unwrap().continuous;
            assert_eq!((continuous.waiting(), continuous.bytes() > 0), (0, expected == "session"));
        }
        // The choices stay through a checkpoint; the run that is resumed measures anew.
        let resumed = Simulation::resume(&cheap_session.checkpoint(), Some(1)).unwrap();
        assert_eq!(resumed.report.choices, cheap_session.report.choices);
        assert_eq!(resumed.report.detection.clone().unwrap().detector, "bvh");
        // Real seconds decide who knows what, and the bits are those.
        assert!(run(None).state == named.state);
    }

    /// Far from everything nothing is remembered; without contact there is nothing that could.
    #[test]
    fn a_scene_that_touches_nothing_remembers_nothing() {
        let mut sim = cards("");
        let before = sim.contact.as_ref().unwrap().bytes();
        sim.state.x[..49].iter_mut().for_each(|p| p.y += 0.5);
        sim.state.x[49..85].iter_mut().for_each(|p| p.y += 0.3);
        sim.step().unwrap();
        assert_eq!(sides(&sim), &Sides::default());
        sim.state.x[..49].iter_mut().for_each(|p| p.y -= 0.2);
        sim.step().unwrap();
        let remembered = sides(&sim).pairs().len();
        assert!(remembered > 20);
        let grown = sim.contact.as_ref().unwrap().bytes() - before;
        assert!(grown >= size_of_val(sides(&sim).pairs()), "{grown} B for {remembered} pairs");
    }
}
