//! The responder: what goes in, what comes out, what is kept between steps.

use crate::collisions::Detection;
use crate::friction::general::General;
use crate::friction::kernel::Coulomb;
use crate::friction::slow::Slow;
use crate::motion::{Motion, MotionBuffers};
use crate::stages::Stages;
use crate::strain::limiter::Limiter;
use crate::sweeps::ContactSet;
use crate::{LimitedEdge, ResponseError, ResponseInfo, ResponseParams, Resting, Sides, Vec3};
use cloth_collision::{Bvh, CollisionMesh, Detector};

/// Turns the unconstrained end of a step into an accepted one.
///
/// Holds parameters, reusable buffers, and the [`Sides`] of near pairs, which a checkpoint has to have: a step's answer depends on
/// these and on the arguments alone, and not on the number of threads.
pub struct Responder {
    params: ResponseParams,
    buffers: MotionBuffers,
    contacts: Contacts,
    stages: Stages,
    /// Tried before `contacts`.
    slow: Option<ContactSet<Slow>>,
}

/// The contacts, with the kernel of friction that the scene asks for.
enum Contacts {
    Coulomb(ContactSet<Coulomb>),
    General(ContactSet<General>),
}

impl Responder {
    /// A responder for the bodies of `mesh`.
    ///
    /// # Errors
    /// What [`ResponseParams::check`] refuses.
    pub fn new(mesh: &CollisionMesh, params: ResponseParams) -> Result<Self, ResponseError> {
        params.check(mesh.bodies.len())?;
        Ok(Self {
            buffers: MotionBuffers::with_capacity(mesh.vertex_count),
            contacts: if params.friction.is_coulomb() {
                Contacts::Coulomb(ContactSet::new(Coulomb::new(params.friction.laws())))
            } else {
                Contacts::General(ContactSet::new(General::new(params.friction.laws())))
            },
            stages: Stages::new(params.skip_proved),
            slow: Slow::new(&params.friction, params.friction_tolerance).map(ContactSet::new),
            params,
        })
    }

    /// Declares the undeformed positions \[m\] of all vertices, one per vertex.
    ///
    /// Two points of one body then rest at no more than half of the distance that they have undeformed (instead of
    /// at the thickness), so that a mesh finer than the thickness is not blown up by its own neighbours. Viscous friction
    /// takes the areas of contact from them, else from where the first step starts.
    ///
    /// # Errors
    /// [`ResponseError::Length`], [`ResponseError::NotFinite`].
    pub fn set_rest(&mut self, mesh: &CollisionMesh, rest_x: &[Vec3]) -> Result<(), ResponseError> {
        check("rest_x", rest_x, mesh.vertex_count)?;
        self.stages.rest_x = rest_x.to_vec();
        if let Contacts::General(contacts) = &mut self.contacts {
            contacts.kernel.set_areas(mesh, rest_x);
        }
        Ok(())
    }

    /// Sets the edges whose strain is limited; none: the effect is off.
    ///
    /// # Errors
    /// [`ResponseError::Parameter`] for a limit or a rest length out of range, or an edge with a vertex that `mesh` does not have.
    pub fn set_strain_limits(
        &mut self,
        mesh: &CollisionMesh,
        edges: Vec<LimitedEdge>,
    ) -> Result<(), ResponseError> {
        for edge in &edges {
            edge.check(mesh.vertex_count)?;
        }
        self.stages.limiter = Limiter::new(edges);
        Ok(())
    }

    /// Takes the last response as the step that happened: its sides of near pairs are remembered. Without this the next response
    /// decides as the last one did, so that a step may be tried again.
    pub fn accept(&mut self) {
        self.stages.accept();
    }

    /// The remembered sides of near pairs.
    pub fn sides(&self) -> &Sides {
        &self.stages.sides
    }

    /// Goes on with these sides of near pairs.
    pub fn set_sides(&mut self, sides: Sides) {
        self.stages.sides = sides;
    }

    /// Least speed \[m/s\] from which a law is taken as it is, with [`ResponseParams::friction_tolerance`]; 0: as soon as a contact
    /// slides. `None` where nothing is left out.
    pub fn slow_speed(&self) -> Option<f64> {
        self.slow.as_ref().map(|contacts| contacts.kernel.speed())
    }

    /// Memory of the buffers that are kept from step to step \[B\]: what each vertex needs from the start, and what the
    /// contacts of the steps so far have needed.
    pub fn bytes(&self) -> usize {
        let contacts = match &self.contacts {
            Contacts::Coulomb(contacts) => contacts.bytes(),
            Contacts::General(contacts) => contacts.bytes(),
        };
        let slow = self.slow.as_ref().map_or(0, ContactSet::bytes);
        self.buffers.bytes() + contacts + slow + self.stages.bytes()
    }

    /// Changes `x_t1` and `v` so that the straight motion `x_t0` → `x_t1` has no known collision.
    ///
    /// - `bvh`: built for `mesh`; finds proximities and continuous contacts.
    /// - `inv_mass` \[1/kg\]: 0 for prescribed vertices, whose `x_t1` and `v` are left as they are.
    /// - `x_t0` \[m\]: the accepted start. `x_t1` \[m\], `v` \[m/s\]: the end of the step without contact.
    /// - `dt` \[s\] > 0.
    ///
    /// With the average velocity v̄ = (x_t1 − x_t0)/dt the stages are: repulsion and resting contact of near pairs;
    /// passes of continuous detection and impulses with friction; rigid impact zones; holding back. Strain limits join the
    /// impulses; if zones or holding back broke one, the passes are run again, a few times at most. After the first
    /// detection over all pairs each further one looks at the pairs with a changed vertex (the others stand
    /// certified). `v` changes by the change of v̄, without what pushes overlapping pairs apart: that moves positions alone.
    ///
    /// # Errors
    /// [`ResponseError::Unresolved`] if cloth is caught between prescribed motions (retry with a smaller step), or if
    /// pairs touch at `x_t0` and `allow_initial_contacts` is off; [`ResponseError::Strained`] if a strain limit could not
    /// be kept (retry with a smaller step); [`ResponseError::Length`],
    /// [`ResponseError::NotFinite`], [`ResponseError::Parameter`] for input that is refused. In each case `x_t1` and
    /// `v` are as they were.
    pub fn respond(
        &mut self,
        mesh: &CollisionMesh,
        bvh: &mut Bvh,
        inv_mass: &[f64],
        x_t0: &[Vec3],
        x_t1: &mut [Vec3],
        v: &mut [Vec3],
        dt: f64,
        pool: &rayon::ThreadPool,
    ) -> Result<ResponseInfo, ResponseError> {
        self.run(Detection { mesh, bvh, other: None, resting: None, pool }, inv_mass, x_t0, x_t1, v, dt)
    }

    /// [`Responder::respond`] with another method for the continuous detection; `bvh` still finds proximities, and pairs with a
    /// changed vertex where the method does not narrow ([`Detector::narrows`]).
    ///
    /// # Errors
    /// As [`Responder::respond`].
    pub fn respond_with(
        &mut self,
        mesh: &CollisionMesh,
        bvh: &mut Bvh,
        continuous: &mut dyn Detector,
        inv_mass: &[f64],
        x_t0: &[Vec3],
        x_t1: &mut [Vec3],
        v: &mut [Vec3],
        dt: f64,
        pool: &rayon::ThreadPool,
    ) -> Result<ResponseInfo, ResponseError> {
        self.run(
            Detection { mesh, bvh, other: Some(continuous), resting: None, pool },
            inv_mass,
            x_t0,
            x_t1,
            v,
            dt,
        )
    }

    /// [`Responder::respond`] where some cloth sleeps: pairs without a vertex that moves are passed over, and
    /// [`ResponseInfo::meetings`] says which bodies are near each other. `other`: as in [`Responder::respond_with`].
    ///
    /// # Errors
    /// [`ResponseError::Asleep`] if something that moves is near sleeping cloth or meets it; else as [`Responder::respond`].
    pub fn respond_resting(
        &mut self,
        mesh: &CollisionMesh,
        bvh: &mut Bvh,
        other: Option<&mut dyn Detector>,
        resting: Resting<'_>,
        inv_mass: &[f64],
        x_t0: &[Vec3],
        x_t1: &mut [Vec3],
        v: &mut [Vec3],
        dt: f64,
        pool: &rayon::ThreadPool,
    ) -> Result<ResponseInfo, ResponseError> {
        for (name, list) in [("moving", resting.moving), ("asleep", resting.asleep)] {
            if list.len() != mesh.vertex_count {
                return Err(ResponseError::Length { name, expected: mesh.vertex_count, got: list.len() });
            }
        }
        #[allow(
            clippy::needless_match,
            reason = "put together anew, it may live as short as the other references"
        )]
        let other: Option<&mut dyn Detector> = match other {
            Some(detector) => Some(detector),
            None => None,
        };
        self.run(Detection { mesh, bvh, other, resting: Some(resting), pool }, inv_mass, x_t0, x_t1, v, dt)
    }

    fn run(
        &mut self,
        mut detection: Detection<'_>,
        inv_mass: &[f64],
        x_t0: &[Vec3],
        x_t1: &mut [Vec3],
        v: &mut [Vec3],
        dt: f64,
    ) -> Result<ResponseInfo, ResponseError> {
        let mesh = detection.mesh;
        check_input(mesh.vertex_count, inv_mass, x_t0, x_t1, v, dt)?;
        if let Some(contacts) = &mut self.slow {
            let motion = &mut Motion::new(&mut self.buffers, inv_mass, x_t0, x_t1, dt);
            // What fails here may not fail with the whole law.
            if let Ok(Some(info)) = self.stages.run(&self.params, contacts, &mut detection, motion) {
                let pushed = self.write(inv_mass, x_t1, v, dt);
                return Ok(ResponseInfo { slow_friction: true, pushed, ..info });
            }
        }
        let motion = &mut Motion::new(&mut self.buffers, inv_mass, x_t0, x_t1, dt);
        let info = match &mut self.contacts {
            Contacts::Coulomb(contacts) => self.stages.run(&self.params, contacts, &mut detection, motion)?,
            Contacts::General(contacts) => {
                if contacts.kernel.wants_areas() {
                    contacts.kernel.set_areas(mesh, x_t0);
                }
                contacts.kernel.start(dt);
                self.stages.run(&self.params, contacts, &mut detection, motion)?
            }
        };
        let pushed = self.write(inv_mass, x_t1, v, dt);
        // Only a tentative kernel is given up.
        Ok(ResponseInfo { pushed, ..info.unwrap_or_default() })
    }

    /// Writes the motion of what is not prescribed; Σ m times the way of pushes [kg m].
    fn write(&self, inv_mass: &[f64], x_t1: &mut [Vec3], v: &mut [Vec3], dt: f64) -> Vec3 {
        let mut pushed = Vec3::zeros();
        for i in 0..x_t1.len() {
            let buffers = &self.buffers;
            if inv_mass[i] > 0.0 && buffers.velocity[i] != buffers.velocity_start[i] {
                x_t1[i] = buffers.end[i];
            }
            let change = buffers.kept()[i] - buffers.velocity_start[i];
            if inv_mass[i] > 0.0 && change != Vec3::zeros() {
                v[i] += change;
            }
            let push = buffers.velocity[i] - buffers.kept()[i];
            if inv_mass[i] > 0.0 && push != Vec3::zeros() {
                pushed += push * (dt / inv_mass[i]);
            }
        }
        pushed
    }
}

fn check_input(
    count: usize,
    inv_mass: &[f64],
    x_t0: &[Vec3],
    x_t1: &[Vec3],
    v: &[Vec3],
    dt: f64,
) -> Result<(), ResponseError> {
    if !(dt.is_finite() && dt > 0.0) {
        return Err(ResponseError::Parameter { name: "dt", expected: "a finite time > 0 s", got: dt });
    }
    if inv_mass.len() != count {
        return Err(ResponseError::Length { name: "inv_mass", expected: count, got: inv_mass.len() });
    }
    if let Some(&got) = inv_mass.iter().find(|m| !(m.is_finite() && **m >= 0.0)) {
        return Err(ResponseError::Parameter { name: "inv_mass", expected: "a finite number ≥ 0", got });
    }
    check("x_t0", x_t0, count)?;
    check("x_t1", x_t1, count)?;
    check("v", v, count)
}

fn check(name: &'static str, values: &[Vec3], count: usize) -> Result<(), ResponseError> {
    if values.len() != count {
        return Err(ResponseError::Length { name, expected: count, got: values.len() });
    }
    match values.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
        Some(vertex) => Err(ResponseError::NotFinite { name, vertex }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FrictionLaw, FrictionRule};
    use cloth_collision::Body;
    use cloth_collision::mesh::{TriMesh, generators::grid};

    /// Rounding of sums over 74 vertices and some thousand impulses, relative to their size.
    const ROUNDING: f64 = 1e-12;

    /// What one step did to two pieces of cloth in space.
    #[derive(Debug)]
    struct Met {
        /// Changes of momentum and of angular momentum.
        momentum: Vec3,
        angular: Vec3,
        /// Σ r × p and Σ |p| over the contacts.
        moments: Vec3,
        impulses: f64,
        contacts: usize,
    }

    /// One step in which `upper` comes down on `lower` at 3 m/s, sliding by `slide` \[m/s\].
    fn meet(upper: &TriMesh, lower: &TriMesh, shift: Vec3, slide: f64, friction: f64) -> Met {
        let body = Body { dynamic: true, self_collision: true };
        let bodies = [upper, lower].map(|m| (body, m.vertices.len(), &m.triangles[..]));
        let mesh = CollisionMesh::new(&bodies).unwrap();
        let x_t0: Vec<Vec3> =
            upper.vertices.iter().map(|p| p + shift).chain(lower.vertices.iter().copied()).collect();
        let (count, first) = (x_t0.len(), upper.vertices.len());
        let speed = |i: usize| if i < first { Vec3::new(slide, -3.0, 0.5 * slide) } else { Vec3::zeros() };
        let v_t0: Vec<Vec3> = (0..count).map(speed).collect();
        let inv_mass: Vec<f64> = (0..count).map(|i| 1e3 * (1.0 + (i % 5) as f64)).collect();
        let dt = 0.005;
        let mut x_t1: Vec<Vec3> = x_t0.iter().zip(&v_t0).map(|(x, v)| x + v * dt).collect();
        let mut v = v_t0.clone();
        let friction = FrictionRule::uniform(FrictionLaw::Coulomb { mu_c: friction });
        let params = ResponseParams { thickness: 0.004, friction, ..ResponseParams::default() };
        let mut responder = Responder::new(&mesh, params).unwrap();
        let mut bvh = Bvh::new(&mesh, &x_t0).unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let info =
            responder.respond(&mesh, &mut bvh, &inv_mass, &x_t0, &mut x_t1, &mut v, dt, &pool).unwrap();
        assert_eq!((info.zones, info.held_vertices), (0, 0));
        let mut met = Met {
            momentum: Vec3::zeros(),
            angular: Vec3::zeros(),
            moments: Vec3::zeros(),
            impulses: 0.0,
            contacts: info.impulses,
        };
        for i in 0..count {
            let change = (v[i] - v_t0[i]) / inv_mass[i];
            met.momentum += change;
            met.angular += x_t0[i].cross(&change);
        }
        let Contacts::Coulomb(contacts) = &responder.contacts else { panic!("all laws are Coulomb") };
        for contact in contacts.contacts() {
            let r: Vec3 = (0..4).map(|k| x_t0[contact.vertices[k] as usize] * contact.weights[k]).sum();
            met.moments += r.cross(&contact.impulse);
            met.impulses += contact.impulse.norm();
        }
        met
    }

    /// Momentum is kept; angular momentum changes by Σ r × p over the contacts and by nothing else.
    #[test]
    fn momenta_change_as_the_impulses_say() {
        let (mut upper, lower) = (grid(0.1, 0.1, 5, 5).unwrap(), grid(0.1, 0.1, 7, 7).unwrap());
        upper.vertices.iter_mut().for_each(|p| p.y = 0.05 * p.x);
        // By impulses of collisions, and by repulsion of what is near already.
        for gap in [0.012, 0.003] {
            for friction in [0.0, 0.3] {
                let met = meet(&upper, &lower, Vec3::new(0.033, gap, 0.017), 1.0, friction);
                let size = 0.1 * met.impulses;
                assert!(met.contacts > 20 && met.momentum.norm() < ROUNDING * met.impulses, "{met:?}");
                assert!((met.angular - met.moments).norm() < ROUNDING * size, "{met:?}");
                if friction > 0.0 {
                    assert!(met.moments.norm() > 1e-4 * size, "friction makes a moment: {met:?}");
                }
            }
        }
    }

    /// A corner that comes straight down on a triangle sets it spinning, and no angular momentum is made.
    #[test]
    fn a_contact_head_on_keeps_angular_momentum() {
        let triangle = |p: [[f64; 3]; 3]| TriMesh {
            vertices: p.map(Vec3::from).to_vec(),
            triangles: vec![[0, 1, 2]],
            uv: None,
        };
        let lower = triangle([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]);
        let upper = triangle([[0.0, 0.0, 0.0], [0.3, 0.5, 0.0], [0.0, 0.5, 0.3]]);
        for gap in [0.012, 0.003] {
            for friction in [0.0, 0.3] {
                let met = meet(&upper, &lower, Vec3::new(0.2, gap, 0.3), 0.0, friction);
                assert!(met.contacts == 1 && met.impulses > 1e-4, "{met:?}");
                assert!(met.momentum.norm() < ROUNDING * met.impulses, "{met:?}");
                assert!(met.angular.norm() < ROUNDING * met.impulses, "{met:?}");
                // Planted: a contact that slides with friction across its gap makes a couple.
                let slid = meet(&upper, &lower, Vec3::new(0.2, gap, 0.3), 1.0, friction);
                assert!(friction == 0.0 || slid.angular.norm() > 1e-4 * slid.impulses, "{slid:?}");
            }
        }
    }
}
