//! Cloth that slides down an inclined plane, a quarter of it folded back onto itself: one step of the response.

use cloth_response::collision::mesh::{Vec3, generators::grid};
use cloth_response::collision::{Body, Bvh, CollisionMesh};
use cloth_response::{FrictionLaw, FrictionRule, Responder, ResponseError, ResponseInfo, ResponseParams};

/// Vertices on a side of the cloth: 8192 triangles, as the scene of the thesis's Table 7.2 has 8.1 thousand.
const SIDE: usize = 65;
/// [m]
const THICKNESS: f64 = 0.004;
/// [s]
const DT: f64 = 0.001;
/// tan of the plane's angle.
const SLOPE: f64 = 0.3;
/// [kg/m²]
const AREAL_DENSITY: f64 = 0.2;

/// The state before the response, by formula.
pub struct Incline {
    mesh: CollisionMesh,
    bvh: Bvh,
    responder: Responder,
    inv_mass: Vec<f64>,
    x_t0: Vec<Vec3>,
    x_t1: Vec<Vec3>,
    v: Vec<Vec3>,
    pool: rayon::ThreadPool,
    work: (Vec<Vec3>, Vec<Vec3>),
}

impl Incline {
    /// 1 m² of cloth on a plane of 3 m with 17 × 17 vertices; it slides at about 0.5 m/s, not all parts alike.
    ///
    /// # Errors
    /// What the response refuses, as text.
    pub fn new(friction: FrictionRule, threads: usize) -> Result<Self, Box<dyn std::error::Error>> {
        let cloth = grid(1.0, 1.0, SIDE, SIDE)?;
        let plane = grid(3.0, 3.0, 17, 17)?;
        let dynamic = Body { dynamic: true, self_collision: true };
        let fixed = Body { dynamic: false, self_collision: false };
        let mesh = CollisionMesh::new(&[
            (dynamic, cloth.vertices.len(), &cloth.triangles[..]),
            (fixed, plane.vertices.len(), &plane.triangles[..]),
        ])?;
        let turn = nalgebra::Rotation3::from_scaled_axis(Vec3::z() * SLOPE.atan());
        // The part beyond the crease lies one thickness above the rest, a little aside.
        let crease = 0.25;
        let laid = |p: &Vec3| {
            let over = (p.x - crease).max(0.0);
            let lift = if over > 0.0 { THICKNESS } else { 0.0 };
            Vec3::new(p.x - 2.0 * over, THICKNESS + lift, p.z + 0.003 * over.min(0.01) * 100.0)
        };
        let free = cloth.vertices.len();
        let x_t0: Vec<Vec3> = cloth
            .vertices
            .iter()
            .map(|p| turn * laid(p))
            .chain(plane.vertices.iter().map(|p| turn * p))
            .collect();
        let mass = AREAL_DENSITY / free as f64;
        let inv_mass = (0..x_t0.len()).map(|i| if i < free { 1.0 / mass } else { 0.0 }).collect();
        let speed = |i: usize| {
            let p = &cloth.vertices[i];
            let wave = (20.0 * p.x).sin() * (15.0 * p.z).cos();
            turn * Vec3::new(-0.5 - 0.2 * wave, 0.02 * wave, 0.05 * (11.0 * p.x).sin())
                - Vec3::y() * (9.81 * DT)
        };
        let v: Vec<Vec3> = (0..x_t0.len()).map(|i| if i < free { speed(i) } else { Vec3::zeros() }).collect();
        let x_t1: Vec<Vec3> = x_t0.iter().zip(&v).map(|(x, v)| x + v * DT).collect();
        let params = ResponseParams { thickness: THICKNESS, friction, ..ResponseParams::default() };
        let mut responder = Responder::new(&mesh, params)?;
        let rest_x: Vec<Vec3> = cloth.vertices.iter().chain(&plane.vertices).copied().collect();
        responder.set_rest(&mesh, &rest_x)?;
        Ok(Self {
            bvh: Bvh::new(&mesh, &x_t0)?,
            responder,
            mesh,
            inv_mass,
            work: (x_t1.clone(), v.clone()),
            x_t0,
            x_t1,
            v,
            pool: rayon::ThreadPoolBuilder::new().num_threads(threads).build()?,
        })
    }

    /// The response to the step; the same each time.
    ///
    /// # Errors
    /// As [`Responder::respond`].
    pub fn respond(&mut self) -> Result<ResponseInfo, ResponseError> {
        let (x, v) = &mut self.work;
        x.clone_from(&self.x_t1);
        v.clone_from(&self.v);
        self.responder.respond(&self.mesh, &mut self.bvh, &self.inv_mass, &self.x_t0, x, v, DT, &self.pool)
    }
}

/// The law of a name, with the parameters of the thesis's cards; `None`: no law is called that.
pub fn law(name: &str) -> Option<FrictionLaw> {
    let (mu_c, mu_s, v_s, delta_s) = (0.1, 0.2, 0.4, 0.2);
    Some(match name {
        "coulomb" => FrictionLaw::Coulomb { mu_c },
        "coulomb-stiction" => FrictionLaw::CoulombStiction { mu_c, mu_s },
        "stribeck" => FrictionLaw::Stribeck { mu_c, mu_s, v_s, delta_s },
        "viscous" => {
            FrictionLaw::Viscous { mu_c, mu_s, v_s, delta_s, f_v: 0.6 * AREAL_DENSITY, delta_v: 1.0 }
        }
        _ => return None,
    })
}
