//! Coherent sequences by formula, for detection over many frames: no dynamics, any number of triangles.

use cloth_collision::mesh::{MeshError, TriMesh, Vec3, generators};
use cloth_collision::{Body, CollisionMesh, DetectError};
use std::f64::consts::PI;

/// Duration of a frame [s].
pub const DT: f64 = 0.005;
/// Radius of the ball [m].
const RADIUS: f64 = 0.3;
/// Height of its bumps, and of the cloth above it [m].
const BUMP: f64 = 0.012;
/// Its rate [rad/s].
const RATE: f64 = 0.8;

/// A scene's topology and where its vertices are at any time.
pub struct Sequence {
    /// Bodies in contact.
    pub mesh: CollisionMesh,
    /// Positions with the cloth flat [m]: they shape the trees.
    pub rest: Vec<Vec3>,
    position: Box<dyn Fn(f64) -> Vec<Vec3> + Send + Sync>,
}

impl Sequence {
    /// Positions [m] after so many frames.
    pub fn at(&self, frame: u32) -> Vec<Vec3> {
        self.at_time(f64::from(frame) * DT)
    }

    /// Positions [m] at a time [s].
    pub fn at_time(&self, time: f64) -> Vec<Vec3> {
        (self.position)(time)
    }
}

/// Why a sequence cannot be made.
#[derive(Debug)]
pub enum SequenceError {
    /// Of a generator.
    Mesh(MeshError),
    /// Of the scene's topology.
    Detect(DetectError),
}

impl From<MeshError> for SequenceError {
    fn from(error: MeshError) -> Self {
        Self::Mesh(error)
    }
}

impl From<DetectError> for SequenceError {
    fn from(error: DetectError) -> Self {
        Self::Detect(error)
    }
}

fn rest(cloth: &TriMesh, ball: &TriMesh) -> Vec<Vec3> {
    cloth.vertices.iter().chain(&ball.vertices).copied().collect()
}

fn scene(cloth: &TriMesh, ball: &TriMesh) -> Result<CollisionMesh, DetectError> {
    CollisionMesh::new(&[
        (Body { dynamic: true, self_collision: true }, cloth.vertices.len(), &cloth.triangles),
        (Body { dynamic: false, self_collision: false }, ball.vertices.len(), &ball.triangles),
    ])
}

/// A cloth of n × n vertices, 1.8 m wide, on a bumpy ball that spins: it lies on the bumps, hangs in folds that overhang and turns
/// with the ball, its rim behind.
///
/// # Errors
/// If `n` is too small for a mesh.
pub fn spinning_ball(n: usize) -> Result<Sequence, SequenceError> {
    let (cloth, ball) = (generators::grid(1.8, 1.8, n, n)?, generators::sphere(RADIUS, 4)?);
    let (mesh, rest) = (scene(&cloth, &ball)?, rest(&cloth, &ball));
    let bump = |direction: &Vec3, angle: f64| {
        let around = direction.z.atan2(direction.x) - angle;
        BUMP * (9.0 * around).sin() * (11.0 * direction.y).cos()
    };
    let spin = |p: Vec3, angle: f64| {
        let (sin, cos) = angle.sin_cos();
        Vec3::new(cos * p.x - sin * p.z, p.y, sin * p.x + cos * p.z)
    };
    let position = move |time: f64| {
        let angle = RATE * time;
        let on_cloth = cloth.vertices.iter().map(|p| {
            let (r, around) = (p.x.hypot(p.z), p.z.atan2(p.x));
            let arc = (r / RADIUS).min(0.5 * PI);
            let hanging = (r - 0.5 * PI * RADIUS).max(0.0);
            let fold = (hanging / 0.2).min(1.0);
            // Overhanging folds: between crest and trough they turn back.
            let folds = 14.0;
            let phase = folds * around + 0.8 * (3.0 * time).sin();
            let out = RADIUS * arc.sin() + 0.035 * fold * phase.sin() + 0.15 * hanging;
            let sideways = around - fold * 0.8 / folds * (2.0 * phase).sin();
            let lag = angle - 0.25 * fold * (1.0 - (-time).exp());
            let on_ball = Vec3::new(arc.sin() * around.cos(), arc.cos(), arc.sin() * around.sin());
            let lift = BUMP * 0.2 + bump(&on_ball, angle - lag) * (1.0 - fold);
            let out = out + lift * arc.sin();
            let height = RADIUS * arc.cos() + lift * arc.cos() - hanging;
            let p = Vec3::new(out * sideways.cos(), height, out * sideways.sin());
            spin(p, lag)
        });
        let on_ball = ball.vertices.iter().map(|p| {
            let direction = p / RADIUS;
            spin(direction * (RADIUS + bump(&direction, 0.0)), angle)
        });
        on_cloth.chain(on_ball).collect()
    };
    Ok(Sequence { mesh, rest, position: Box::new(position) })
}

/// A cloth of n × n vertices, 1.8 m wide, over a ball of 20 · 4^`level` triangles that turns with it: it lies `lift` \[m\] above the
/// ball and hangs in six folds that do not overhang or touch. With n · 2^k vertices, `level` + k, and `lift` and time between
/// frames over 2^k, all is the same in lengths of edges, but for the curvature.
///
/// # Errors
/// If `n` is too small for a mesh, or `level` too large.
pub fn draped_ball(n: usize, level: u32, lift: f64) -> Result<Sequence, SequenceError> {
    let (cloth, ball) = (generators::grid(1.8, 1.8, n, n)?, generators::sphere(RADIUS, level)?);
    let (mesh, rest) = (scene(&cloth, &ball)?, rest(&cloth, &ball));
    let position = move |time: f64| {
        let (sin, cos) = (RATE * time).sin_cos();
        let spin = |p: Vec3| Vec3::new(cos * p.x - sin * p.z, p.y, sin * p.x + cos * p.z);
        let on_cloth = cloth.vertices.iter().map(|p| {
            let (r, around) = (p.x.hypot(p.z), p.z.atan2(p.x));
            let arc = (r / RADIUS).min(0.5 * PI);
            let hanging = (r - 0.5 * PI * RADIUS).max(0.0);
            let fold = (hanging / 0.3).min(1.0);
            let phase = 6.0 * around + 0.8 * (3.0 * time).sin();
            let out = (RADIUS + lift) * arc.sin() + 0.2 * hanging + 0.05 * fold * phase.sin();
            let height = (RADIUS + lift) * arc.cos() - hanging;
            spin(Vec3::new(out * around.cos(), height, out * around.sin()))
        });
        let on_ball = ball.vertices.iter().map(|&p| spin(p));
        on_cloth.chain(on_ball).collect()
    };
    Ok(Sequence { mesh, rest, position: Box::new(position) })
}

/// A cloth of n × n vertices, 2 m wide, that is folded in the middle and settles onto itself from 20 mm to 2 mm, with travelling
/// waves and shivers; a ball below it.
///
/// # Errors
/// If `n` is too small for a mesh.
pub fn folding(n: usize) -> Result<Sequence, SequenceError> {
    let (cloth, ball) = (generators::grid(2.0, 2.0, n, n)?, generators::sphere(0.2, 3)?);
    let (mesh, rest) = (scene(&cloth, &ball)?, rest(&cloth, &ball));
    let position = move |time: f64| {
        let gap = 0.002 + 0.018 * (-2.0 * time).exp();
        let on_cloth = cloth.vertices.iter().map(|p| {
            // The two halves meet in a half circle.
            let bend = 0.5 * gap * PI;
            let along = p.x.abs() - 0.5 * bend;
            let (x, y) = if along < 0.0 {
                let angle = p.x / (0.5 * bend) * 0.5 * PI;
                (0.5 * gap * (1.0 - angle.cos()), 0.5 * gap * angle.sin())
            } else {
                (0.5 * gap + along, 0.5 * gap * p.x.signum())
            };
            let wave = 0.01 * (12.0 * p.z + 2.0 * time).sin() * (9.0 * x - 3.0 * time).cos();
            let shiver = 0.0002 * (40.0 * time + 70.0 * p.x).sin();
            Vec3::new(x + 0.02 * time, y + wave + shiver, p.z + 0.01 * time)
        });
        let on_ball = ball.vertices.iter().map(|p| p + Vec3::new(0.4, -0.22, 0.0));
        on_cloth.chain(on_ball).collect()
    };
    Ok(Sequence { mesh, rest, position: Box::new(position) })
}
