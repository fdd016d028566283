//! A small world for tests: bodies, masses, explicit springs, prescribed motions, and an independent judge.

#![allow(dead_code, unreachable_pub, reason = "each test file is a crate and uses a part")]

use cloth_response::collision::mesh::{NONE, TriMesh};
use cloth_response::collision::{
    Body, BruteForce, Bvh, CollisionMesh, Contacts, Detector, Mode, Query, intersections,
};
use cloth_response::{Responder, ResponseError, ResponseInfo, ResponseParams, Vec3};

/// Mass per area of the test cloth [kg/m²].
pub const AREAL_DENSITY: f64 = 0.2;

/// A body as it enters the world.
pub struct Part {
    pub mesh: TriMesh,
    pub cloth: bool,
}

pub fn cloth(mesh: TriMesh) -> Part {
    Part { mesh, cloth: true }
}

pub fn collider(mesh: TriMesh) -> Part {
    Part { mesh, cloth: false }
}

pub struct World {
    pub mesh: CollisionMesh,
    pub bvh: Bvh,
    pub responder: Responder,
    pub inv_mass: Vec<f64>,
    pub x: Vec<Vec3>,
    pub v: Vec<Vec3>,
    /// First vertex of each body, and the end.
    pub first: Vec<usize>,
    pub gravity: Vec3,
    /// Along edges of cloth [N/m], cut to what is stable; 0: loose vertices that keep their shape only by chance.
    pub stiffness: f64,
    /// Along edges of cloth [N s/m].
    pub damping: f64,
    rest_length: Vec<f64>,
    pub pool: rayon::ThreadPool,
    pub time: f64,
}

/// What a step did.
pub struct Step {
    pub info: ResponseInfo,
    pub x_t0: Vec<Vec3>,
}

impl World {
    pub fn new(parts: &[Part], params: ResponseParams) -> Self {
        Self::with_threads(parts, params, 2)
    }

    pub fn with_threads(parts: &[Part], params: ResponseParams, threads: usize) -> Self {
        let bodies: Vec<_> = parts
            .iter()
            .map(|p| {
                let body = Body { dynamic: p.cloth, self_collision: p.cloth };
                (body, p.mesh.vertices.len(), &p.mesh.triangles[..])
            })
            .collect();
        let mesh = CollisionMesh::new(&bodies).unwrap();
        let x: Vec<Vec3> = parts.iter().flat_map(|p| p.mesh.vertices.iter().copied()).collect();
        let mut mass = vec![0.0; x.len()];
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|v| x[v as usize]);
            let area = 0.5 * (b - a).cross(&(c - a)).norm();
            for v in t {
                mass[*v as usize] += AREAL_DENSITY * area / 3.0;
            }
        }
        let inv_mass = (0..x.len())
            .map(|i| if mesh.bodies[mesh.vertex_body[i] as usize].dynamic { 1.0 / mass[i] } else { 0.0 })
            .collect();
        let mut first = vec![0];
        for p in parts {
            first.push(first[first.len() - 1] + p.mesh.vertices.len());
        }
        let mut responder = Responder::new(&mesh, params).unwrap();
        responder.set_rest(&mesh, &x).unwrap();
        let rest_length = mesh.edges.iter().map(|e| (x[e[1] as usize] - x[e[0] as usize]).norm()).collect();
        Self {
            bvh: Bvh::new(&mesh, &x).unwrap(),
            responder,
            inv_mass,
            v: vec![Vec3::zeros(); x.len()],
            x,
            first,
            gravity: Vec3::new(0.0, -9.81, 0.0),
            stiffness: 0.0,
            damping: 0.0,
            rest_length,
            pool: rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap(),
            mesh,
            time: 0.0,
        }
    }

    /// Vertices of a body.
    pub fn body(&self, b: usize) -> std::ops::Range<usize> {
        self.first[b]..self.first[b + 1]
    }

    pub fn pin(&mut self, vertex: usize) {
        self.inv_mass[vertex] = 0.0;
    }

    /// The unconstrained end of the step: semi-implicit Euler, prescribed vertices by `prescribe(vertex, x, time)`.
    pub fn candidate(
        &self,
        dt: f64,
        prescribe: &dyn Fn(usize, &Vec3, f64) -> Vec3,
    ) -> (Vec<Vec3>, Vec<Vec3>) {
        let mut v = self.v.clone();
        // Eight edges at a vertex: half of what explicit integration bears.
        let lightest = self.inv_mass.iter().copied().fold(0.0, f64::max);
        let stiffness = self.stiffness.min(0.125 / (dt * dt * lightest));
        let damping = self.damping.min(0.03 / (dt * lightest));
        for (e, edge) in self.mesh.edges.iter().enumerate() {
            let [a, b] = edge.map(|v| v as usize);
            if self.stiffness == 0.0 || self.inv_mass[a] + self.inv_mass[b] == 0.0 {
                continue;
            }
            let d = self.x[b] - self.x[a];
            let u = d.normalize();
            let pull =
                stiffness * (d.norm() - self.rest_length[e]) + damping * u.dot(&(self.v[b] - self.v[a]));
            v[a] += u * (pull * dt * self.inv_mass[a]);
            v[b] -= u * (pull * dt * self.inv_mass[b]);
        }
        let mut x = self.x.clone();
        for i in 0..x.len() {
            if self.inv_mass[i] > 0.0 {
                v[i] += self.gravity * dt;
                x[i] += v[i] * dt;
            } else {
                x[i] = prescribe(i, &self.x[i], self.time);
                v[i] = (x[i] - self.x[i]) / dt;
            }
        }
        (x, v)
    }

    /// One step; on an error the state stays, and the error must not have changed the candidate.
    pub fn try_step(
        &mut self,
        dt: f64,
        prescribe: &dyn Fn(usize, &Vec3, f64) -> Vec3,
    ) -> Result<Step, ResponseError> {
        let (mut x_t1, mut v) = self.candidate(dt, prescribe);
        let before = (x_t1.clone(), v.clone());
        let answer = self.responder.respond(
            &self.mesh,
            &mut self.bvh,
            &self.inv_mass,
            &self.x,
            &mut x_t1,
            &mut v,
            dt,
            &self.pool,
        );
        let info = match answer {
            Ok(info) => info,
            Err(error) => {
                assert!(before == (x_t1, v), "an error must leave the arrays alone");
                return Err(error);
            }
        };
        for i in 0..x_t1.len() {
            if self.inv_mass[i] == 0.0 {
                assert_eq!(x_t1[i], before.0[i], "prescribed vertex {i} was moved");
            }
        }
        self.responder.accept();
        self.v = v;
        self.time += dt;
        Ok(Step { info, x_t0: std::mem::replace(&mut self.x, x_t1) })
    }

    /// One step that must be accepted and hold the contract.
    pub fn step_moving(&mut self, dt: f64, prescribe: &dyn Fn(usize, &Vec3, f64) -> Vec3) -> ResponseInfo {
        let step = self.try_step(dt, prescribe).expect("the step is resolved");
        assert_eq!(judge(&self.mesh, &step.x_t0, &self.x, &self.pool), 0, "collisions in an accepted step");
        assert_eq!(intersections(&self.mesh, &self.x, &self.pool).unwrap(), Vec::<[u32; 2]>::new());
        step.info
    }

    /// [`World::step_moving`] with prescribed vertices at rest.
    pub fn step(&mut self, dt: f64) -> ResponseInfo {
        self.step_moving(dt, &|_, x, _| *x)
    }

    /// Σ m v and Σ m x × v of the free vertices.
    pub fn momentum(&self) -> (Vec3, Vec3) {
        let mut sum = (Vec3::zeros(), Vec3::zeros());
        for i in (0..self.x.len()).filter(|&i| self.inv_mass[i] > 0.0) {
            let p = self.v[i] / self.inv_mass[i];
            sum.0 += p;
            sum.1 += self.x[i].cross(&p);
        }
        sum
    }
}

/// All contacts of a motion at distance 0, by brute force.
pub fn collisions(mesh: &CollisionMesh, x_t0: &[Vec3], x_t1: &[Vec3], pool: &rayon::ThreadPool) -> Contacts {
    let query = Query { x_t0, x_t1, thickness: 0.0, mode: Mode::Continuous, active: None };
    BruteForce.detect(mesh, &query, pool).unwrap()
}

/// Number of collisions of a motion, by brute force.
pub fn judge(mesh: &CollisionMesh, x_t0: &[Vec3], x_t1: &[Vec3], pool: &rayon::ThreadPool) -> usize {
    let contacts = collisions(mesh, x_t0, x_t1, pool);
    contacts.vertex_triangle.len() + contacts.edge_edge.len()
}

/// A mesh moved by a rotation (axis times angle) and then a shift.
pub fn placed(mut mesh: TriMesh, axis_angle: [f64; 3], shift: [f64; 3]) -> TriMesh {
    let turn = nalgebra::Rotation3::from_scaled_axis(Vec3::from(axis_angle));
    for p in &mut mesh.vertices {
        *p = turn * *p + Vec3::from(shift);
    }
    mesh
}

/// splitmix64: the tests' only source of chance.
pub struct Random(pub u64);

impl Random {
    /// In [0, 1).
    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// In [-1, 1)³.
    pub fn vector(&mut self) -> Vec3 {
        Vec3::new(2.0 * self.unit() - 1.0, 2.0 * self.unit() - 1.0, 2.0 * self.unit() - 1.0)
    }
}

/// No attachment, for tests that set one.
pub const FREE: u32 = NONE;
