//! Sides of single pairs.

use super::touching::votes;
use super::*;
use crate::Vec3;
use crate::motion::MotionBuffers;
use cloth_collision::{Body, Bvh};

/// A triangle of ground and a small one of cloth whose corner 3 is at `p`, the two others at the height
/// `rise` above it.
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

/// A distance that rounding leaves no direction still has a side; on the plane itself the remembered one
/// counts.
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

/// Another side than the remembered one: gone round where it was seen all the way, gone through where it was
/// exempt.
#[test]
fn another_side_is_round_or_through() {
    let mut pair = Pair::new(Vec3::new(0.0, -1e-4, 0.0), 0.5);
    let (sides, round) = pair.step(&remembered(true, true), Vec3::zeros());
    let round = round.unwrap();
    assert!(round.normal.y < -0.99 && round.distance > 0.0 && !sides.get(VERTEX, CORNER).unwrap().positive);
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
        assert_eq!(f64::from(sides.get(VERTEX, CORNER).unwrap().sign()), stencil.unwrap().normal.y.signum());
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
    let mut x = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]].map(|[x, z]| Vec3::new(x, 0.0, z)).to_vec();
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
        assert!(matches!(Sides::new(bad.clone(), &pair.mesh), Err(ResponseError::Side { .. })), "{bad:?}");
    }
}
