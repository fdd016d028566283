//! What contact and strain limits need, built once.

use crate::bodies::Bodies;
use crate::constraints::ConstraintStage;
use crate::device::{Continuous, DeviceError};
use crate::pins::PinSet;
use crate::scene::{Contact, ContactMethod};
use crate::{Scene, SimError, SimulationOptions, Vec3};
use cloth_collision::{Body, Bvh, CollisionMesh, intersections};
use cloth_response::{FrictionRule, Responder, ResponseParams};

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
        let bvh = Bvh::new(&mesh, x).map_err(|e| stage("collision mesh", &e))?;
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
            + self.responder.bytes()
            + self.constraints.as_ref().map_or(0, ConstraintStage::bytes)
    }
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
