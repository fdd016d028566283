//! Two points in contact, as weights on four vertices.

use crate::distance::{edge_edge, vertex_triangle};
use crate::intersect::height_of;
use crate::{CollisionMesh, Vec3};

/// The two kinds of stencil.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum StencilKind {
    /// Vertices (v, a, b, c), weights (1, −w_a, −w_b, −w_c).
    VertexTriangle,
    /// Vertices (a0, a1, b0, b1), weights (1−s, s, −(1−t), −t).
    EdgeEdge,
}

/// Two points in contact: r = Σ `weights[k]` x\[`vertices[k]`\] is the vector from the second point (triangle, edge b)
/// to the first (vertex, edge a). Σ `weights` = 0 up to rounding.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stencil {
    /// Which kind.
    pub kind: StencilKind,
    /// The four vertices.
    pub vertices: [u32; 4],
    /// Their weights.
    pub weights: [f64; 4],
    /// Unit vector from the second point to the first.
    pub normal: Vec3,
    /// Length of r [m].
    pub distance: f64,
}

/// Below this fraction of the stencil's size r is rounding noise and gives no direction: differences of coordinates
/// are exact to 2⁻⁵³, the weights to about 1e-14 of the size in well-shaped stencils.
const DIRECTION_FLOOR: f64 = 1e-11;
/// How far before the contact the direction of r is looked up, as fractions of the step.
const LOOK_BACK: [f64; 5] = [0.0, 1e-6, 1e-4, 1e-2, 1.0];

impl Stencil {
    /// The stencil of these weights at the points `p`; its normal is r, or the plane's where r is rounding noise.
    pub(crate) fn new(kind: StencilKind, vertices: [u32; 4], weights: [f64; 4], p: &[Vec3; 4]) -> Self {
        let r = separation(p, &weights);
        let distance = r.norm();
        let normal = if distance > DIRECTION_FLOOR * size(p) { r / distance } else { plane_normal(kind, p) };
        Self { kind, vertices, weights, normal, distance }
    }

    /// Whether the distance at the points `p` \[m\] of the vertices is above rounding, so that the normal is the direction of r;
    /// else it is the plane's.
    pub fn has_direction(&self, p: &[Vec3; 4]) -> bool {
        self.distance > DIRECTION_FLOOR * size(p)
    }
}

/// The side of the first feature: the sign (1, 0, −1) of n · (first − second), without rounding, with the normal
/// n = (b−a)×(c−a) of the triangle or n = (a1−a0)×(b1−b0) of the edges; 0 for four points in a plane.
pub fn side(kind: StencilKind, p: &[Vec3; 4]) -> i8 {
    let [a, b, c, d] = p;
    // Negative where the last point is on the side to which the normal of the first three points.
    let below = match kind {
        StencilKind::VertexTriangle => height_of(b, c, d, a),
        StencilKind::EdgeEdge => height_of(a, b, c, d),
    };
    i8::from(below < 0.0) - i8::from(below > 0.0)
}

/// The unit vector along n of [`side`]; `None` where rounding leaves none (no area, parallel edges).
pub fn plane(kind: StencilKind, p: &[Vec3; 4]) -> Option<Vec3> {
    let (n, size) = (cross(kind, p), size(p));
    (n.norm() > DIRECTION_FLOOR * size * size).then(|| n.normalize())
}

/// r = Σ w_k p_k, from differences to p0 so that a far origin costs no digits.
fn separation(p: &[Vec3; 4], weights: &[f64; 4]) -> Vec3 {
    (p[1] - p[0]) * weights[1] + (p[2] - p[0]) * weights[2] + (p[3] - p[0]) * weights[3]
}

fn size(p: &[Vec3; 4]) -> f64 {
    (1..4).map(|k| (p[k] - p[0]).amax()).fold(0.0, f64::max)
}

/// (b−a)×(c−a) or (a1−a0)×(b1−b0), not normalised.
fn cross(kind: StencilKind, p: &[Vec3; 4]) -> Vec3 {
    match kind {
        StencilKind::VertexTriangle => (p[2] - p[1]).cross(&(p[3] - p[1])),
        StencilKind::EdgeEdge => (p[1] - p[0]).cross(&(p[3] - p[2])),
    }
}

/// The unit normal of the stencil's plane; where there is none (no area, parallel edges), a unit vector across its
/// longest side, or +y.
fn plane_normal(kind: StencilKind, p: &[Vec3; 4]) -> Vec3 {
    if let Some(n) = plane(kind, p) {
        return n;
    }
    let longest = (1..4).map(|k| p[k] - p[0]).max_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()));
    let d = longest.unwrap_or_default();
    let axis = if d.x.abs() <= d.y.abs().min(d.z.abs()) {
        Vec3::x()
    } else if d.y.abs() <= d.z.abs() {
        Vec3::y()
    } else {
        Vec3::z()
    };
    d.cross(&axis).try_normalize(0.0).unwrap_or_else(Vec3::y)
}

/// The stencil of a continuous contact of (vertex, triangle) at `time`.
///
/// Weights: closest points at `time`. Normal: the direction from the second point to the first at `time` or, where
/// their distance is rounding noise there, a little earlier (the side from which they came). Where they touch all
/// the way from t0, the plane's normal, on the side where the vertex was at t0 ([`side`]), else against the relative motion.
pub fn stencil_at_contact_vertex_triangle(
    mesh: &CollisionMesh,
    pair: [u32; 2],
    time: f64,
    x_t0: &[Vec3],
    x_t1: &[Vec3],
) -> Stencil {
    let [a, b, c] = mesh.triangles[pair[1] as usize];
    stencil_at_contact(StencilKind::VertexTriangle, [pair[0], a, b, c], time, x_t0, x_t1, 0)
}

/// The stencil of a continuous contact of two edges at `time`; weights and normal as in
/// [`stencil_at_contact_vertex_triangle`].
pub fn stencil_at_contact_edge_edge(
    mesh: &CollisionMesh,
    pair: [u32; 2],
    time: f64,
    x_t0: &[Vec3],
    x_t1: &[Vec3],
) -> Stencil {
    let ([a0, a1], [b0, b1]) = (mesh.edges[pair[0] as usize], mesh.edges[pair[1] as usize]);
    stencil_at_contact(StencilKind::EdgeEdge, [a0, a1, b0, b1], time, x_t0, x_t1, 0)
}

fn closest_weights(kind: StencilKind, p: &[Vec3; 4]) -> [f64; 4] {
    match kind {
        StencilKind::VertexTriangle => {
            let w = vertex_triangle::closest_point(p);
            [1.0, -w[0], -w[1], -w[2]]
        }
        StencilKind::EdgeEdge => {
            let (s, t) = edge_edge::closest_points(p);
            [1.0 - s, s, t - 1.0, -t]
        }
    }
}

/// The stencil of a continuous contact of these vertices at `time`, see [`stencil_at_contact_vertex_triangle`].
///
/// `known`: the pair's [`side`] as it is known from before the step, for points that lie in one plane at t0; 0: unknown.
pub fn stencil_at_contact(
    kind: StencilKind,
    vertices: [u32; 4],
    time: f64,
    x_t0: &[Vec3],
    x_t1: &[Vec3],
    known: i8,
) -> Stencil {
    let start = vertices.map(|v| x_t0[v as usize]);
    let end = vertices.map(|v| x_t1[v as usize]);
    let at = |t: f64| [0, 1, 2, 3].map(|k| start[k] * (1.0 - t) + end[k] * t);
    let now = at(time);
    let weights = closest_weights(kind, &now);
    let floor = 100.0 * DIRECTION_FLOOR * size(&now).max(size(&start));

    for back in LOOK_BACK {
        let earlier = at((time - back).max(0.0));
        let r = separation(&earlier, &closest_weights(kind, &earlier));
        let distance = r.norm();
        if distance > floor {
            return Stencil {
                kind,
                vertices,
                weights,
                normal: r / distance,
                distance: separation(&now, &weights).norm(),
            };
        }
    }
    let mut normal = plane_normal(kind, &now);
    let motion: [Vec3; 4] = [0, 1, 2, 3].map(|k| end[k] - start[k]);
    let is_other_side = match (plane(kind, &now), side(kind, &start)) {
        (Some(_), 0) if known != 0 => known < 0,
        (Some(_), side) if side != 0 => side < 0,
        _ => separation(&motion, &weights).dot(&normal) > 0.0,
    };
    if is_other_side {
        normal = -normal;
    }
    Stencil { kind, vertices, weights, normal, distance: separation(&now, &weights).norm() }
}
