//! One contact of a cloth vertex with a collider: the plane that it must not pass.

use super::{BAND, ConstraintStage};
use crate::Vec3;
use cloth_collision::mesh::NONE;
use cloth_collision::{CollisionMesh, Nearest, Stencil, StencilKind, plane, side};
use cloth_response::{FrictionLaw, Side, Sides};
use nalgebra::Matrix3;

/// The part of the overlap that one step undoes, that of the velocity filter.
const PUSH_FRACTION: f64 = 0.1;
/// Contacts end farther by this part of the thickness than the velocity filter asks for, well above rounding: a filter that
/// has to give even a rounding error of a normal impulse gives all of a viscous force.
const MARGIN: f64 = 1e-9;
/// What a vertex may lack of its distance at the end of a step, as a part of the thickness.
const GAP_TOLERANCE: f64 = 1e-4;
/// Least cosine between two normals of one contact.
const LEAST_AGREEMENT: f64 = 0.5;
/// Closest points nearer to each other than this part of the thickness are one contact.
const SAME_POINT: f64 = 1e-6;
/// Far vertices are looked at that come so much nearer as to touch, and a part more.
const APPROACH: f64 = 1.5;
/// A contact that has let go this often in a step does not take hold again in it.
const MAX_RELEASES: u8 = 2;

/// Positions at both ends of a step.
#[derive(Clone, Copy)]
pub(super) struct Motion<'a> {
    pub(super) stage: &'a ConstraintStage,
    pub(super) mesh: &'a CollisionMesh,
    /// Cloth at the start [m].
    pub(super) cloth: &'a [Vec3],
    /// Colliders at the start and at the end [m].
    pub(super) colliders: [&'a [Vec3]; 2],
    /// What is remembered of near pairs.
    pub(super) sides: &'a Sides,
    pub(super) dt: f64,
}

impl Motion<'_> {
    fn corners(&self, end: usize, triangle: u32) -> [Vec3; 3] {
        let base = self.cloth.len();
        self.mesh.triangles[triangle as usize].map(|v| self.colliders[end][v as usize - base])
    }

    fn nearest(&self, end: usize, triangle: u32, p: &Vec3) -> Nearest {
        let base = self.cloth.len();
        self.mesh.nearest(triangle, p, |v| self.colliders[end][v as usize - base], NONE)
    }
}

/// n · u ≥ `least` for the mean velocity u of the vertex.
#[derive(Debug, Clone, Copy)]
pub(super) struct Contact {
    triangle: u32,
    pub(super) law: FrictionLaw,
    /// Distance at the end of the step [m].
    target: f64,
    /// Mean velocity of a vertex that goes with the surface [m/s].
    pub(super) ride: Vec3,
    /// From the surface to the vertex at the end of the step; a unit vector.
    pub(super) normal: Vec3,
    /// [m/s]
    pub(super) least: f64,
    pub(super) held: bool,
    releases: u8,
    /// Nearest point at the start [m], and the distance.
    point: Vec3,
    gap_t0: f64,
}

impl Contact {
    /// The contact of a vertex with the surface around `triangle`, found at the start of the step. `None` without a distance, and
    /// for a vertex on the wrong side, which the velocity filter brings back.
    pub(super) fn new(motion: &Motion<'_>, vertex: u32, triangle: u32) -> Option<Self> {
        let x = motion.cloth[vertex as usize];
        let mut start = motion.nearest(0, triangle, &x);
        let gap_t0 = start.r.norm();
        let corners = [0, 1].map(|end| motion.corners(end, start.triangle));
        let (kind, [a, b, c]) = (StencilKind::VertexTriangle, motion.mesh.triangles[start.triangle as usize]);
        let p = [x, corners[0][0], corners[0][1], corners[0][2]];
        let here = side(kind, &p);
        let known = motion.sides.get(kind, [vertex, a, b, c]);
        if gap_t0 <= 0.0 || known.is_some_and(|k| !k.certain && k.sign() * here < 0) {
            return None;
        }
        let stencil = Stencil {
            kind,
            vertices: [vertex, a, b, c],
            weights: [1.0, -start.weights[0], -start.weights[1], -start.weights[2]],
            normal: start.r,
            distance: gap_t0,
        };
        if !stencil.has_direction(&p) {
            // Rounding has no direction: the plane's, to the side where the vertex is.
            let sign = if here == 0 { known.map_or(0, Side::sign) } else { here };
            start.r = plane(kind, &p)? * (f64::from(sign) * gap_t0);
        }
        let (ride, r) = if corners[0] == corners[1] {
            (Vec3::zeros(), start.r)
        } else {
            let turned = frame(&corners[1]) * (frame(&corners[0]).transpose() * start.r);
            let moved: Vec3 = (0..3).map(|k| (corners[1][k] - corners[0][k]) * start.weights[k]).sum();
            ((moved + (turned - start.r)) / motion.dt, turned)
        };
        let thickness = motion.stage.thickness;
        let rest = if gap_t0 > thickness { thickness } else { gap_t0 + PUSH_FRACTION * (thickness - gap_t0) };
        let target = rest + MARGIN * thickness;
        let normal = r.try_normalize(0.0)?;
        let bodies = [vertex, motion.mesh.triangles[start.triangle as usize][0]];
        let [a, b] = bodies.map(|v| motion.mesh.vertex_body[v as usize]);
        Some(Self {
            triangle: start.triangle,
            law: *motion.stage.friction.law(&motion.mesh.bodies, a, b),
            target,
            ride,
            normal,
            least: normal.dot(&ride) + (target - gap_t0) / motion.dt,
            held: false,
            releases: 0,
            point: x - start.r,
            gap_t0,
        })
    }

    /// Whether a vertex that would go with the mean velocity `u` [m/s] may come to touch.
    pub(super) fn may_touch(&self, motion: &Motion<'_>, u: &Vec3) -> bool {
        let thickness = motion.stage.thickness;
        let way = self.normal.dot(&(u - self.ride)) * motion.dt;
        self.gap_t0 <= BAND * thickness || self.gap_t0 + APPROACH * way <= thickness
    }

    /// Whether both are at the same point of the surface.
    pub(super) fn same(&self, other: &Self, stage: &ConstraintStage) -> bool {
        (self.point - other.point).norm() <= SAME_POINT * stage.thickness
    }

    pub(super) fn distance(&self) -> f64 {
        self.gap_t0
    }

    pub(super) fn release(&mut self) {
        self.held = false;
        self.releases += 1;
    }

    /// Moves the plane to where the vertex comes with the mean velocity `u`, unless that is far from here.
    pub(super) fn follow(&mut self, motion: &Motion<'_>, vertex: u32, u: &Vec3) {
        let (gap, normal, triangle) = self.at(motion, vertex, u);
        if normal.dot(&self.normal) > LEAST_AGREEMENT {
            self.normal = normal;
            self.triangle = triangle;
            self.least = normal.dot(u) + (self.target - gap) / motion.dt;
        }
    }

    /// Distance at the end of the step (negative: on the other side), normal there, triangle.
    fn at(&self, motion: &Motion<'_>, vertex: u32, u: &Vec3) -> (f64, Vec3, u32) {
        let end = motion.cloth[vertex as usize] + u * motion.dt;
        let now = motion.nearest(1, self.triangle, &end);
        let side = if now.r.dot(&self.normal) < 0.0 { -1.0 } else { 1.0 };
        let gap = now.r.norm();
        let normal = (now.r * side).try_normalize(0.0).unwrap_or(self.normal);
        (side * gap, normal, now.triangle)
    }

    /// Takes hold, or follows the surface, where the vertex would end too near with the mean velocity `u` [m/s]; whether it did.
    pub(super) fn catch(&mut self, motion: &Motion<'_>, vertex: u32, u: &Vec3) -> bool {
        let tolerance = GAP_TOLERANCE * motion.stage.thickness;
        // Far from its plane a vertex is far from the surface, or on its other side.
        let way = self.normal.dot(u) - self.least;
        if !self.held && (self.releases >= MAX_RELEASES || way * motion.dt > motion.stage.thickness) {
            return false;
        }
        let (gap, normal, triangle) = self.at(motion, vertex, u);
        let lacking = self.target - gap;
        if lacking.is_nan() || lacking <= tolerance {
            return false;
        }
        if normal.dot(&self.normal) > LEAST_AGREEMENT {
            self.normal = normal;
            self.triangle = triangle;
            self.least = normal.dot(u) + (self.target - gap) / motion.dt;
        } else if self.held {
            return false;
        }
        self.held = true;
        true
    }
}

/// The triangle's own axes as columns: along its first side, across it, and its normal. No axes (zero) without area.
fn frame(p: &[Vec3; 3]) -> Matrix3<f64> {
    let along = (p[1] - p[0]).try_normalize(0.0).unwrap_or_default();
    let normal = (p[1] - p[0]).cross(&(p[2] - p[0])).try_normalize(0.0).unwrap_or_default();
    Matrix3::from_columns(&[along, normal.cross(&along), normal])
}
