//! Which side of each other the features of near pairs are on, remembered from step to step.
//!
//! A pair's side is the sign of n · (first − second) with the triangle's normal n, or the cross product of the two edges
//! ([`cloth_collision::side`]). It is known from when the pair comes near, straight above the triangle or with edges that cross,
//! until it is no longer near, and decides the contact's normal
//!
//! - where the distance is rounding and has no direction: the plane's normal, to the remembered side;
//! - where a pair went through, which only one can that touched at the start and was exempt: to the side where it was, with a
//!   negative gap, so that repulsion brings it back.
//!
//! A pair that was not exempt has been seen not to touch all the way: where its position says another side, it went round a border
//! (or two edges turned past parallel), and the side is that of the position.
//!
//! A pair that is met touching, with nothing remembered, takes the side of the first of these that says one: what is remembered
//! of the vertex with triangles beside; the cloth around the vertex; its motion (it came from where it does not go); else the later
//! body lies above, along the plane's normal that points to the positive side of the axis nearest to it.
//!
//! Source: Wong 2010, section 1, after Selle et al. 2009, "Robust high-resolution cloth using parallelism, history-based collisions,
//! and accurate friction": which pairs are followed and why; the rules above are this project's.

use crate::motion::{Motion, bytes_of};
use crate::{ResponseError, Vec3};
use cloth_collision::{CollisionMesh, Stencil, StencilKind, plane, side};

/// A relative velocity along the normal of less than this part of the vertices' speeds is none.
const SPEED_ROUNDING: f64 = 1e-9;

/// The side of one near pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Side {
    /// (v, a, b, c) or (a0, a1, b0, b1).
    pub vertices: [u32; 4],
    /// Which kind of pair.
    pub kind: StencilKind,
    /// Whether the first feature is where the normal points.
    pub positive: bool,
    /// Whether it has been seen not to pass to the other side; not so after a step in which the pair was exempt.
    pub certain: bool,
}

impl Side {
    fn key(&self) -> (StencilKind, [u32; 4]) {
        (self.kind, self.vertices)
    }

    /// 1 or −1, as [`cloth_collision::side`].
    pub fn sign(&self) -> i8 {
        if self.positive { 1 } else { -1 }
    }
}

/// The sides of all near pairs, sorted by kind and vertices.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sides {
    list: Vec<Side>,
    /// Pairs that are where they should not be, sorted; of the step at hand alone.
    through: Vec<(StencilKind, [u32; 4])>,
}

impl Sides {
    /// The sides as a checkpoint has them.
    ///
    /// # Errors
    /// [`ResponseError::Side`] for a pair that `mesh` cannot have, or that is not after the one before.
    pub fn new(list: Vec<Side>, mesh: &CollisionMesh) -> Result<Self, ResponseError> {
        for (k, side) in list.iter().enumerate() {
            let [a, b, c, d] = side.vertices;
            let features = side.vertices.iter().all(|v| (*v as usize) < mesh.vertex_count)
                && match side.kind {
                    StencilKind::VertexTriangle => {
                        mesh.triangle_of([b, c, d]).is_some() && ![b, c, d].contains(&a)
                    }
                    StencilKind::EdgeEdge => {
                        [[a, b], [c, d]].iter().all(|e| mesh.edges.binary_search(e).is_ok())
                    }
                };
            if !features {
                return Err(ResponseError::Side { pair: k, expected: "vertices of a pair of the mesh" });
            }
            if k > 0 && list[k - 1].key() >= side.key() {
                return Err(ResponseError::Side { pair: k, expected: "a pair after the one before" });
            }
        }
        Ok(Self { list, through: Vec::new() })
    }

    /// All of them.
    pub fn pairs(&self) -> &[Side] {
        &self.list
    }

    /// What is remembered of a pair.
    pub fn get(&self, kind: StencilKind, vertices: [u32; 4]) -> Option<&Side> {
        self.list.binary_search_by_key(&(kind, vertices), Side::key).ok().map(|k| &self.list[k])
    }

    /// Whether the pair is on the other side of where it should be.
    pub(crate) fn is_through(&self, kind: StencilKind, vertices: [u32; 4]) -> bool {
        !self.through.is_empty() && self.through.binary_search(&(kind, vertices)).is_ok()
    }

    /// Memory \[B\].
    pub(crate) fn bytes(&self) -> usize {
        bytes_of(&self.list) + bytes_of(&self.through)
    }

    /// Takes the sides of the pairs `near` from `past` and from where they are, and turns their normals to these sides.
    ///
    /// `near`: as [`cloth_collision::Bvh::proximity`] sorts it, at the start of `motion`. A pair that went through gets its gap as a
    /// negative distance. Returns the number of pairs whose normal the side decided, not the distance.
    pub(crate) fn renew(
        &mut self,
        past: &Self,
        near: &mut [Stencil],
        mesh: &CollisionMesh,
        motion: &Motion<'_>,
    ) -> usize {
        self.list.clear();
        self.through.clear();
        let mut decided = 0;
        let mut rest = &past.list[..];
        let lead = |kind: StencilKind, vertices: &[u32; 4]| (kind, vertices[0]);
        for stencil in near {
            // Both lists ascend by kind and first vertex.
            let own = lead(stencil.kind, &stencil.vertices);
            let skip = rest.iter().take_while(|s| lead(s.kind, &s.vertices) < own).count();
            rest = &rest[skip..];
            let group = rest.iter().take_while(|s| lead(s.kind, &s.vertices) == own);
            let known = group.clone().find(|s| s.vertices == stencil.vertices);
            self.take(stencil, known, past, mesh, motion, &mut decided);
        }
        self.list.sort_unstable_by_key(Side::key);
        self.list.dedup_by_key(|s| s.key());
        self.through.sort_unstable();
        decided
    }

    fn take(
        &mut self,
        stencil: &mut Stencil,
        known: Option<&Side>,
        past: &Self,
        mesh: &CollisionMesh,
        motion: &Motion<'_>,
        decided: &mut usize,
    ) {
        let Stencil { kind, vertices, .. } = *stencil;
        let p = vertices.map(|v| motion.x_t0[v as usize]);
        let here = side(kind, &p);
        let is_inside = stencil.weights.iter().all(|w| *w != 0.0);
        let has_direction = stencil.has_direction(&p);
        let of_plane = plane(kind, &p);
        let sign = match known {
            Some(known) if here == 0 || !is_inside || !known.certain => known.sign(),
            _ if is_inside && of_plane.is_some() => here,
            _ => 0,
        };
        if has_direction {
            let is_through = is_inside && sign * here < 0;
            if is_through {
                stencil.normal = -stencil.normal;
                stencil.distance = -stencil.distance;
                *decided += 1;
                self.through.push((kind, vertices));
            }
            if sign != 0 {
                let certain = known.is_none_or(|k| k.certain || here == sign);
                self.list.push(Side { vertices, kind, positive: sign > 0, certain });
            }
            return;
        }
        *decided += 1;
        let Some(normal) = of_plane else {
            // No plane, no side: as where nothing is remembered.
            if first_side(stencil, stencil.normal, past, mesh, motion) < 0 {
                stencil.normal = -stencil.normal;
            }
            return;
        };
        let sign = match sign {
            0 => match votes(stencil, normal, past, motion.x_t0) {
                0 if here != 0 => here,
                0 => first_side(stencil, normal, past, mesh, motion),
                vote => vote,
            },
            sign => sign,
        };
        stencil.normal = normal * f64::from(sign);
        if is_inside && sign * here < 0 {
            self.through.push((kind, vertices));
        }
        let certain = known.is_none_or(|k| k.certain || here == sign);
        self.list.push(Side { vertices, kind, positive: sign > 0, certain });
    }

    /// Ends the step at hand; exempt pairs may have passed in it.
    pub(crate) fn end_step(&mut self, is_exempt: impl Fn(StencilKind, [u32; 4]) -> bool) {
        self.through.clear();
        for side in &mut self.list {
            side.certain &= !is_exempt(side.kind, side.vertices);
        }
    }
}

/// The side of a pair with nothing remembered whose points lie in a plane; ±1. See the head of this file.
fn first_side(
    stencil: &Stencil,
    normal: Vec3,
    past: &Sides,
    mesh: &CollisionMesh,
    motion: &Motion<'_>,
) -> i8 {
    let vote = votes(stencil, normal, past, motion.x_t0);
    if vote != 0 {
        return vote;
    }
    let around = cloth_around(stencil, mesh, motion.x_t0);
    if around != 0 {
        return around;
    }
    let (mut u, mut speed) = (0.0, 0.0);
    for (v, weight) in stencil.vertices.iter().zip(&stencil.weights) {
        let velocity = &motion.buffers.velocity[*v as usize];
        u += weight * normal.dot(velocity);
        speed += weight.abs() * velocity.norm();
    }
    if u.abs() > SPEED_ROUNDING * speed {
        return if u > 0.0 { -1 } else { 1 };
    }
    let axis = normal.iamax();
    let [first, second] =
        [0, 3].map(|k| (mesh.vertex_body[stencil.vertices[k] as usize], stencil.vertices[k]));
    if (normal[axis] > 0.0) == (first > second) { 1 } else { -1 }
}

/// The side that the remembered pairs of the same vertices with features beside say; 0 where there are none.
fn votes(stencil: &Stencil, normal: Vec3, past: &Sides, x: &[Vec3]) -> i8 {
    let [a, b, c, d] = stencil.vertices;
    // Of the pairs of vertex `v` with triangles that have one of `corners`: the unit normal to v's side.
    let of_vertex = |v: u32, corners: &[u32]| -> Vec3 {
        let kind = StencilKind::VertexTriangle;
        let first = past.list.partition_point(|s| (s.kind, s.vertices[0]) < (kind, v));
        let group = past.list[first..].iter().take_while(|s| (s.kind, s.vertices[0]) == (kind, v));
        group
            .filter(|s| s.vertices[1..].iter().any(|k| corners.contains(k)))
            .filter_map(|s| plane(kind, &s.vertices.map(|v| x[v as usize])).map(|n| n * f64::from(s.sign())))
            .sum()
    };
    let direction = match stencil.kind {
        StencilKind::VertexTriangle => of_vertex(a, &[b, c, d]),
        StencilKind::EdgeEdge => {
            let first = of_vertex(a, &[c, d]) + of_vertex(b, &[c, d]);
            first - of_vertex(c, &[a, b]) - of_vertex(d, &[a, b])
        }
    };
    let along = normal.dot(&direction);
    i8::from(along > 0.0) - i8::from(along < 0.0)
}

/// The side of the triangle on which the vertices around the vertex are, if all that are not in its plane are on one; else 0.
fn cloth_around(stencil: &Stencil, mesh: &CollisionMesh, x: &[Vec3]) -> i8 {
    if stencil.kind == StencilKind::EdgeEdge {
        return 0;
    }
    let [v, a, b, c] = stencil.vertices;
    let mut all = 0;
    for &t in mesh.vertex_triangles.of(v) {
        for w in mesh.triangles[t as usize] {
            let own = side(stencil.kind, &[w, a, b, c].map(|k| x[k as usize]));
            if own * all < 0 {
                return 0;
            }
            if own != 0 {
                all = own;
            }
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::MotionBuffers;
    use cloth_collision::{Body, Bvh};

    /// A triangle of ground and a small one of cloth whose corner 3 is at `p`, the two others at the height `rise` above it.
    struct Pair {
        mesh: CollisionMesh,
        bvh: Bvh,
        x: Vec<Vec3>,
        pool: rayon::ThreadPool,
    }

    const NEAR: f64 = 0.01;

    impl Pair {
        fn new(p: Vec3, rise: f64) -> Self {
            let [ground, cloth] = [false, true].map(|dynamic| Body { dynamic, self_collision: false });
            let one = &[[0, 1, 2]][..];
            let mesh = CollisionMesh::new(&[(ground, 3, one), (cloth, 3, one)]).unwrap();
            // Its normal is +y.
            let mut x = vec![Vec3::new(-1.0, 0.0, -1.0), Vec3::new(0.0, 0.0, 2.0), Vec3::new(1.0, 0.0, -1.0)];
            x.extend([p, p + Vec3::new(0.1, rise, 0.0), p + Vec3::new(0.0, rise, 0.1)]);
            let bvh = Bvh::new(&mesh, &x).unwrap();
            let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
            Self { mesh, bvh, x, pool }
        }

        /// The pair of the corner with the ground after a step that starts here and moves the cloth by `way`.
        fn step(&mut self, past: &Sides, way: Vec3) -> (Sides, Option<Stencil>) {
            let mut near = self.bvh.proximity(&self.mesh, &self.x, NEAR, None, &self.pool).unwrap();
            let mut x_t1 = self.x.clone();
            x_t1[3..].iter_mut().for_each(|p| *p += way);
            let (mut buffers, inv_mass) = (MotionBuffers::default(), [0.0, 0.0, 0.0, 1.0, 1.0, 1.0]);
            let motion = Motion::new(&mut buffers, &inv_mass, &self.x, &x_t1, 0.01);
            let mut sides = Sides::default();
            sides.renew(past, &mut near, &self.mesh, &motion);
            (sides, near.into_iter().find(|s| s.vertices == CORNER))
        }
    }

    const CORNER: [u32; 4] = [3, 0, 1, 2];
    const VERTEX: StencilKind = StencilKind::VertexTriangle;

    fn remembered(positive: bool, certain: bool) -> Sides {
        let list = vec![Side { vertices: CORNER, kind: VERTEX, positive, certain }];
        Sides { list, ..Sides::default() }
    }

    /// A distance that rounding leaves no direction still has a side; on the plane itself the remembered one counts.
    #[test]
    fn near_touch_is_decided_by_the_side() {
        for height in [1e-5, 1e-12, 1e-13, 1e-15, 1e-30] {
            for sign in [1.0, -1.0] {
                let mut pair = Pair::new(Vec3::new(0.0, sign * height, 0.0), 0.0);
                let (sides, stencil) = pair.step(&Sides::default(), Vec3::zeros());
                assert!((stencil.unwrap().normal.y - sign).abs() < 1e-12, "{height} {sign}");
                assert_eq!(f64::from(sides.get(VERTEX, CORNER).unwrap().sign()), sign);
                // Then on the plane, whatever the motion.
                pair.x[3].y = 0.0;
                for way in [1e-3, 0.0, -1e-3] {
                    let (then, stencil) = pair.step(&sides, Vec3::new(0.0, way, 0.0));
                    assert!((stencil.unwrap().normal.y - sign).abs() < 1e-12);
                    assert_eq!(then.get(VERTEX, CORNER), sides.get(VERTEX, CORNER));
                }
            }
        }
    }

    /// Another side than the remembered one: gone round where it was seen all the way, gone through where it was exempt.
    #[test]
    fn another_side_is_round_or_through() {
        let mut pair = Pair::new(Vec3::new(0.0, -1e-4, 0.0), 0.5);
        let (sides, round) = pair.step(&remembered(true, true), Vec3::zeros());
        let round = round.unwrap();
        assert!(
            round.normal.y < -0.99 && round.distance > 0.0 && !sides.get(VERTEX, CORNER).unwrap().positive
        );
        let (mut sides, through) = pair.step(&remembered(true, false), Vec3::zeros());
        let through = through.unwrap();
        assert!(through.normal.y > 0.99 && (through.distance + 1e-4).abs() < 1e-15, "{through:?}");
        assert!(sides.is_through(VERTEX, CORNER) && sides.get(VERTEX, CORNER).unwrap().positive);
        // It stays so until the pair is back, which then is certain if the step saw it all the way.
        sides.end_step(|_, _| true);
        let (mut sides, _) = pair.step(&sides, Vec3::zeros());
        assert!(sides.is_through(VERTEX, CORNER));
        pair.x[3].y = 1e-4;
        sides.end_step(|_, _| true);
        let (mut sides, back) = pair.step(&sides, Vec3::zeros());
        assert!(back.unwrap().normal.y > 0.99 && back.unwrap().distance > 0.0);
        assert!(!sides.is_through(VERTEX, CORNER));
        sides.end_step(|_, _| false);
        assert_eq!(sides, remembered(true, true));
        // Beyond the distance nothing is remembered.
        pair.x[3].y = 0.02;
        assert_eq!(pair.step(&sides, Vec3::zeros()).0, Sides::default());
    }

    /// Without a memory: the cloth around, then the motion, then the order of the bodies.
    #[test]
    fn a_touching_start_takes_the_first_rule_that_says_one() {
        let origin = Vec3::zeros();
        let corner = |rise: f64, way: f64| {
            let mut pair = Pair::new(origin, rise);
            let (sides, stencil) = pair.step(&Sides::default(), Vec3::new(0.0, way, 0.0));
            assert_eq!(
                f64::from(sides.get(VERTEX, CORNER).unwrap().sign()),
                stencil.unwrap().normal.y.signum()
            );
            stencil.unwrap().normal.y
        };
        for rise in [0.05, -0.05] {
            for way in [1e-3, 0.0, -1e-3] {
                assert_eq!(corner(rise, way), rise.signum(), "the cloth around");
            }
        }
        assert_eq!((corner(0.0, 1e-3), corner(0.0, -1e-3)), (-1.0, 1.0), "against the motion");
        assert_eq!(corner(0.0, 0.0), 1.0, "the later body lies above");
        // Turned over, the ground is the same.
        let mut pair = Pair::new(origin, 0.0);
        pair.x.swap(0, 1);
        let (sides, stencil) = pair.step(&Sides::default(), Vec3::zeros());
        assert_eq!(stencil.unwrap().normal.y, 1.0);
        assert!(!sides.get(VERTEX, CORNER).unwrap().positive);
    }

    /// A pair that is new takes its side from the pairs of its vertex with triangles beside.
    #[test]
    fn a_side_goes_on_to_the_triangle_beside() {
        let [ground, cloth] = [false, true].map(|dynamic| Body { dynamic, self_collision: false });
        // Two triangles that are wound against each other, so that their sides have opposite signs.
        let two = [[0, 1, 2], [1, 2, 3]];
        let mesh = CollisionMesh::new(&[(ground, 4, &two), (cloth, 3, &[[0, 1, 2]])]).unwrap();
        let mut x =
            [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]].map(|[x, z]| Vec3::new(x, 0.0, z)).to_vec();
        x.extend([Vec3::new(0.6, 0.0, 0.6), Vec3::new(0.6, 0.0, 0.6), Vec3::new(0.6, 0.0, 0.6)]);
        let beside = StencilKind::VertexTriangle;
        let normal = |t: [u32; 3]| plane(beside, &[4, t[0], t[1], t[2]].map(|v| x[v as usize])).unwrap();
        let stencil = Stencil {
            kind: beside,
            vertices: [4, 1, 2, 3],
            weights: [1.0, -0.4, -0.4, -0.2],
            normal: normal([1, 2, 3]),
            distance: 0.0,
        };
        assert!(normal([0, 1, 2]).y * normal([1, 2, 3]).y < 0.0);
        for positive in [true, false] {
            let side = Side { vertices: [4, 0, 1, 2], kind: beside, positive, certain: true };
            let past = Sides::new(vec![side], &mesh).unwrap();
            let vote = votes(&stencil, stencil.normal, &past, &x);
            assert_eq!(f64::from(vote) * stencil.normal.y, f64::from(side.sign()) * normal([0, 1, 2]).y);
        }
        assert_eq!(votes(&stencil, stencil.normal, &Sides::default(), &x), 0);
    }

    #[test]
    fn sides_that_cannot_be_are_refused() {
        let pair = Pair::new(Vec3::zeros(), 0.0);
        let good = Side { vertices: CORNER, kind: VERTEX, positive: true, certain: true };
        let edges = Side { vertices: [0, 1, 3, 4], kind: StencilKind::EdgeEdge, ..good };
        assert_eq!(Sides::new(vec![good, edges], &pair.mesh).unwrap().pairs(), [good, edges]);
        for bad in [
            vec![Side { vertices: [3, 0, 1, 9], ..good }],
            vec![Side { vertices: [3, 1, 0, 2], ..good }],
            vec![Side { vertices: [0, 0, 1, 2], ..good }],
            vec![Side { vertices: [0, 3, 1, 4], ..edges }],
            vec![edges, good],
            vec![good, good],
        ] {
            assert!(
                matches!(Sides::new(bad.clone(), &pair.mesh), Err(ResponseError::Side { .. })),
                "{bad:?}"
            );
        }
    }
}
