//! Closest points of near pairs at the candidate end of the step.
//!
//! A pair that slides by more than a fraction of its gap must not be judged by its closest points at the start: these
//! would take the motion along the surface for an approach. Nor by those on the triangle that it has left: the closest
//! point is then on a side, and a normal that leans into the sliding brakes what rests on a flat surface and pushes it
//! downhill. So the vertex is followed over the sides of triangles to the nearest of the surface around, and pairs that
//! come to the same triangle are one contact.

use crate::Vec3;
use cloth_collision::distance::edge_edge;
use cloth_collision::{CollisionMesh, Nearest, Stencil, StencilKind};

/// Least cosine between the normals at the start and at the candidate end of one contact.
const LEAST_AGREEMENT: f64 = 0.5;

/// A near pair at the start, and at the candidate end where it is the same contact there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Landed {
    /// The pair at `x_t0`.
    pub(crate) start: Stencil,
    /// Closest points, normal and gap at `x_t1`; the gap (`distance`) is negative where the vertex has gone through. `None`
    /// if the pair turns by more than 60° or two edges no longer cross.
    pub(crate) end: Option<Stencil>,
}

/// Where the near pairs of the start are at the positions `x_t1` \[m\].
///
/// `near`: as [`cloth_collision::Bvh::proximity`] sorts it. Of the pairs of one vertex that come to the same triangle
/// `take` sees the nearest at the start.
pub(crate) fn follow(near: &[Stencil], mesh: &CollisionMesh, x_t1: &[Vec3], mut take: impl FnMut(Landed)) {
    let one_vertex = |a: &Stencil, b: &Stencil| {
        a.kind == StencilKind::VertexTriangle && b.kind == a.kind && a.vertices[0] == b.vertices[0]
    };
    let mut landed: Vec<Landed> = Vec::new();
    for pairs in near.chunk_by(one_vertex) {
        landed.clear();
        for &start in pairs {
            let end = end_of(&start, mesh, x_t1);
            let same = |other: &&mut Landed| {
                end.is_some() && other.end.map(|o| o.vertices) == end.map(|e| e.vertices)
            };
            match landed.iter_mut().find(same) {
                Some(other) if start.distance < other.start.distance => *other = Landed { start, end },
                Some(_) => {}
                None => landed.push(Landed { start, end }),
            }
        }
        for &pair in &landed {
            take(pair);
        }
    }
}

/// The pair at the positions `x_t1`, see [`Landed::end`].
fn end_of(start: &Stencil, mesh: &CollisionMesh, x_t1: &[Vec3]) -> Option<Stencil> {
    let (vertices, weights) = match start.kind {
        StencilKind::VertexTriangle => nearest(start.vertices, mesh, x_t1)?,
        StencilKind::EdgeEdge => {
            let (s, t) = edge_edge::closest_points(&start.vertices.map(|v| x_t1[v as usize]));
            if s <= 0.0 || s >= 1.0 || t <= 0.0 || t >= 1.0 {
                return None;
            }
            (start.vertices, [1.0 - s, s, t - 1.0, -t])
        }
    };
    let p = vertices.map(|v| x_t1[v as usize]);
    let r = separation(&p, &weights);
    let inside = start.kind == StencilKind::VertexTriangle && weights[1..].iter().all(|w| *w != 0.0);
    let direction = if inside { (p[2] - p[1]).cross(&(p[3] - p[1])) } else { r };
    let unit = direction.try_normalize(0.0)?;
    // The plane of a triangle has two sides: the one on which the pair started.
    let normal = if inside && start.normal.dot(&unit) < 0.0 { -unit } else { unit };
    (start.normal.dot(&normal) > LEAST_AGREEMENT).then(|| Stencil {
        kind: start.kind,
        vertices,
        weights,
        normal,
        distance: normal.dot(&r),
    })
}

/// The vertex with the nearest triangle of the surface around, and the weights of the closest points.
fn nearest([v, a, b, c]: [u32; 4], mesh: &CollisionMesh, x: &[Vec3]) -> Option<([u32; 4], [f64; 4])> {
    let start = mesh.triangle_of([a, b, c])?;
    let Nearest { triangle, weights: w, .. } = mesh.nearest(start, &x[v as usize], |k| x[k as usize], v);
    let [a, b, c] = mesh.triangles[triangle as usize];
    Some(([v, a, b, c], [1.0, -w[0], -w[1], -w[2]]))
}

/// Vector from the second point to the first, from differences so that a far origin costs no digits.
fn separation(p: &[Vec3; 4], weights: &[f64; 4]) -> Vec3 {
    (1..4).map(|k| (p[k] - p[0]) * weights[k]).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use cloth_collision::Body;
    use cloth_collision::distance::vertex_triangle;
    use cloth_collision::mesh::generators::grid;

    /// A point of its own body over a level sheet of n × n points, cells 1 m, bent down by `fall` \[m/m\] for x > 0.
    struct Ground {
        mesh: CollisionMesh,
        x: Vec<Vec3>,
    }

    const POINTS: usize = 9;

    /// The pair, the weights of its closest points and their squared distance.
    fn at(vertices: [u32; 4], x: &[Vec3]) -> ([u32; 4], [f64; 4], f64) {
        let p = vertices.map(|v| x[v as usize]);
        let [a, b, c] = vertex_triangle::closest_point(&p);
        let weights = [1.0, -a, -b, -c];
        (vertices, weights, separation(&p, &weights).norm_squared())
    }

    impl Ground {
        fn new(fall: f64) -> Self {
            let side = (POINTS - 1) as f64;
            let mut sheet = grid(side, side, POINTS, POINTS).expect("valid");
            sheet.vertices.iter_mut().for_each(|p| p.y = -fall * p.x.max(0.0));
            let cloth = Body { dynamic: true, self_collision: false };
            let ground = Body { dynamic: false, self_collision: false };
            let bodies = [(cloth, 1, &[][..]), (ground, sheet.vertices.len(), &sheet.triangles[..])];
            let mesh = CollisionMesh::new(&bodies).expect("valid");
            let x = std::iter::once(Vec3::zeros()).chain(sheet.vertices).collect();
            Self { mesh, x }
        }

        fn with_point(&self, p: Vec3) -> Vec<Vec3> {
            let mut x = self.x.clone();
            x[0] = p;
            x
        }

        /// The stencils of the point with all triangles within `band` of it, sorted as by the hierarchy.
        fn near(&self, p: Vec3, band: f64) -> Vec<Stencil> {
            let x = self.with_point(p);
            let all = self.mesh.triangles.iter().map(|&[a, b, c]| at([0, a, b, c], &x));
            let near = all.filter(|f| f.2 <= band * band).map(|(vertices, weights, d2)| {
                let r = separation(&vertices.map(|v| x[v as usize]), &weights);
                let kind = StencilKind::VertexTriangle;
                Stencil { kind, vertices, weights, normal: r.normalize(), distance: d2.sqrt() }
            });
            near.collect()
        }

        fn land(&self, from: Vec3, to: Vec3, band: f64) -> Vec<Landed> {
            let mut landed = vec![];
            let x = self.with_point(to);
            follow(&self.near(from, band), &self.mesh, &x, |l| landed.push(l));
            // Closest points on one side or corner are taken once, as the contacts of a step are.
            let feature = |l: &Landed| {
                let end = l.end?;
                let mut key =
                    [0, 1, 2, 3].map(|k| if end.weights[k] == 0.0 { u32::MAX } else { end.vertices[k] });
                key.sort_unstable();
                Some(key)
            };
            landed.dedup_by_key(|l| feature(l));
            landed
        }
    }

    /// On flat ground a point meets one contact along the plane's normal, with its true gap, however far it slides
    /// and over whatever sides and corners; also below the plane.
    #[test]
    fn sliding_over_flat_ground_meets_the_ground_alone() {
        let ground = Ground::new(0.0);
        for from in
            [[0.3, 0.2], [0.499, 0.493], [0.003, 0.001], [0.02, 0.01]].map(|[x, z]| Vec3::new(x, 0.1, z))
        {
            for way in [[0.0, 0.0], [0.05, 0.0], [0.5, 0.2], [-1.7, 0.9], [-2.9, -3.1], [1.0, 1.0]] {
                for fall in [0.0, 0.03, 0.2] {
                    let to = from + Vec3::new(way[0], -fall, way[1]);
                    let landed = ground.land(from, to, 0.125);
                    assert_eq!(landed.len(), 1, "{from:?} {way:?} {landed:?}");
                    let end = landed[0].end.expect("the same contact");
                    assert!((end.normal - Vec3::y()).norm() < 1e-12, "{from:?} {way:?} {end:?}");
                    assert!((end.distance - to.y).abs() < 1e-12);
                    assert!((landed[0].start.distance - 0.1).abs() < 1e-12, "the nearest at the start");
                }
            }
        }
    }

    /// Planted: the triangle at the start alone leans its normal into the sliding.
    #[test]
    fn the_triangle_that_was_left_leans() {
        let ground = Ground::new(0.0);
        let (from, to) = (Vec3::new(0.3, 0.1, 0.2), Vec3::new(1.1, 0.1, 0.2));
        let start = ground.near(from, 0.1001)[0];
        let x = ground.with_point(to);
        let (_, weights, _) = at(start.vertices, &x);
        let r = separation(&start.vertices.map(|v| x[v as usize]), &weights);
        assert!(weights.contains(&0.0) && r.normalize().x > 0.5, "{r:?}");
        assert_eq!(ground.land(from, to, 0.1001)[0].end.unwrap().normal, Vec3::y());
    }

    /// Straight above a side, up to rounding to either hand, both triangles find the same point on it.
    #[test]
    fn above_a_side_is_one_contact() {
        let ground = Ground::new(0.0);
        for off in [-1e-15, -1e-17, 0.0, 1e-17, 1e-15] {
            let p = Vec3::new(0.3 + off, 0.1, 0.3 - off);
            let features = |l: &Landed| l.end.map(|e| e.weights.iter().filter(|w| **w == 0.0).count());
            let landed = ground.land(p, p, 0.125);
            assert_eq!(landed.iter().map(features).collect::<Vec<_>>(), [Some(1)], "{off} {landed:?}");
        }
    }

    /// Over a ridge the pair goes on to the falling side, with that side's normal; at the ridge itself the normal lies
    /// between the two.
    #[test]
    fn a_ridge_is_crossed() {
        let ground = Ground::new(0.5);
        let beyond = ground.land(Vec3::new(-0.05, 0.1, 0.2), Vec3::new(0.3, 0.0, 0.2), 0.11);
        let slope = Vec3::new(0.5, 1.0, 0.0).normalize();
        assert!(beyond.iter().all(|l| (l.end.unwrap().normal - slope).norm() < 1e-12), "{beyond:?}");
        let above = ground.land(Vec3::new(-0.05, 0.1, 0.2), Vec3::new(0.02, 0.1, 0.2), 0.11);
        let normal = above[0].end.unwrap().normal;
        assert!(normal.x > 0.1 && normal.x < slope.x, "{normal:?}");
    }

    /// In a valley both walls are met, each for itself.
    #[test]
    fn a_valley_has_two_walls() {
        let ground = Ground::new(-1.0);
        let landed = ground.land(Vec3::new(-0.03, 0.1, 0.2), Vec3::new(-0.02, 0.1, 0.21), 0.125);
        let mut tilts: Vec<f64> = landed.iter().map(|l| l.end.unwrap().normal.x).collect();
        tilts.sort_by(f64::total_cmp);
        assert_eq!(tilts.len(), 2, "{landed:?}");
        assert!((tilts[0] + 0.5_f64.sqrt()).abs() < 1e-12 && tilts[1].abs() < 1e-12);
    }

    /// Past the border of the ground there is none.
    #[test]
    fn past_the_border_the_gap_opens() {
        let ground = Ground::new(0.0);
        let landed = ground.land(Vec3::new(3.9, 0.1, 0.2), Vec3::new(4.05, 0.1, 0.2), 0.11);
        assert!(landed.iter().all(|l| l.end.is_none_or(|e| e.distance > 0.1)), "{landed:?}");
    }
}
