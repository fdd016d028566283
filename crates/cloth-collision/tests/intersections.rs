//! Triangles that pass through each other.
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

mod support;

use cloth_collision::{
    BruteForce, Bvh, CollisionMesh, DetectError, Detector, Mode, Query, Vec3, intersections,
    self_intersections,
};
use support::{Random, bodies, pool, sheet, soup};

const TARGET: [[f64; 3]; 3] = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 0.0, 4.0]];

/// Whether a lone triangle and the target meet.
fn meets(corners: [[f64; 3]; 3]) -> bool {
    let x: Vec<Vec3> = TARGET.iter().chain(&corners).map(|&p| Vec3::from(p)).collect();
    let both = self_intersections(&[[0, 1, 2], [3, 4, 5]], &x, &pool(1)).unwrap();
    let turned = self_intersections(&[[4, 3, 5], [2, 0, 1]], &x, &pool(1)).unwrap();
    assert_eq!(both, turned, "order must not matter: {corners:?}");
    both == [[0, 1]]
}

#[test]
fn named_cases() {
    let up = [1.0, 1.0, 1.0];
    assert!(meets([[1.0, -1.0, 1.0], up, [9.0, 1.0, 9.0]]), "pierces the face");
    assert!(meets([[-5.0, 0.5, 1.0], [5.0, -0.5, 1.0], [0.0, -9.0, 1.0]]), "cuts a side");
    assert!(meets([[1.0, 0.0, 1.0], up, [2.0, 1.0, 1.0]]), "a corner touches the face");
    assert!(meets([[4.0, 0.0, 0.0], up, [9.0, 1.0, 1.0]]), "a corner touches a corner");
    assert!(meets([[2.0, 0.0, -1.0], [2.0, 0.0, 1.0], [2.0, 1.0, 0.0]]), "a side lies in the face");
    assert!(meets([[1.0, 0.0, 1.0], [1.5, 0.0, 1.0], [1.0, 0.0, 1.5]]), "coplanar, inside");
    assert!(meets([[-9.0, 0.0, -9.0], [90.0, 0.0, -9.0], [-9.0, 0.0, 90.0]]), "coplanar, around");
    assert!(meets([[1.0, 0.0, -1.0], [1.5, 0.0, 9.0], [1.0, 0.0, 9.0]]), "coplanar, across");
    assert!(meets([[5.0, 0.0, 0.0], [3.0, 0.0, 0.0], [5.0, 1.0, 0.0]]), "sides overlap in one line");

    assert!(!meets([[1.0, 1e-300, 1.0], up, [2.0, 1.0, 1.0]]), "a hair above");
    assert!(!meets([[3.0, -1.0, 3.0], [3.0, 1.0, 3.0], [9.0, 0.0, 9.0]]), "beside, across the plane");
    assert!(!meets([[2.0, 0.0, 2.000_000_1], [5.0, 0.0, 5.0], [2.0, 0.0, 9.0]]), "coplanar, beside");
    assert!(!meets([[5.0, 0.0, 0.0], [6.0, 0.0, 0.0], [5.0, 1.0, 0.0]]), "in the line of a side, beyond");
    assert!(meets([[1.0, -1.0, 1.0], up, [1.0, 3.0, 1.0]]), "a triangle without area pierces");
    assert!(
        !meets([[3.0, -1.0, 3.0], [3.0, 1.0, 3.0], [3.0, 3.0, 3.0]]),
        "a triangle without area passes by"
    );
}

#[test]
fn neighbours_meet_only_past_what_they_share() {
    let pairs = |apex: [f64; 3], shared: usize| {
        let mut x: Vec<Vec3> = TARGET.iter().map(|&p| Vec3::from(p)).collect();
        x.push(Vec3::new(-1.0, -1.0, 1.0));
        x.push(Vec3::from(apex));
        let second = if shared == 1 { [0, 3, 4] } else { [0, 1, 4] };
        self_intersections(&[[0, 1, 2], second], &x, &pool(1)).unwrap().len()
    };
    assert_eq!(pairs([-1.0, 1.0, 1.0], 1), 0, "touching at the common vertex alone");
    assert_eq!(pairs([2.0, 1.0, 1.0], 1), 1, "the side opposite to it passes through");
    assert_eq!(pairs([2.0, 0.0, 1.0], 2), 0, "folded onto each other along a common side");
}

/// Every pair of triangles, in floating point.
fn by_every_pair(mesh: &CollisionMesh, x: &[Vec3]) -> Vec<[u32; 2]> {
    let mut found = vec![];
    let n = mesh.triangles.len() as u32;
    for s in 0..n {
        for t in s + 1..n {
            let (first, second) = (mesh.triangles[s as usize], mesh.triangles[t as usize]);
            let (a, b) = (mesh.vertex_body[first[0] as usize], mesh.vertex_body[second[0] as usize]);
            let attached = first.iter().any(|&v| mesh.attached_to[v as usize] == b)
                || second.iter().any(|&v| mesh.attached_to[v as usize] == a);
            if first.iter().filter(|v| second.contains(v)).count() >= 2 || !mesh.bodies_meet(a, b) || attached
            {
                continue;
            }
            let mut sides = vec![];
            for (one, other) in [(first, second), (second, first)] {
                for k in 0..3 {
                    let side = [one[k], one[(k + 1) % 3]];
                    if !side.iter().any(|v| other.contains(v)) {
                        sides.push((side, other));
                    }
                }
            }
            if sides
                .iter()
                .any(|&(side, other)| pierces(side.map(|v| x[v as usize]), other.map(|v| x[v as usize])))
            {
                found.push([s, t]);
            }
        }
    }
    found
}

/// Generic position only: the segment crosses the plane inside the triangle.
fn pierces([p, q]: [Vec3; 2], [a, b, c]: [Vec3; 3]) -> bool {
    let n = (b - a).cross(&(c - a));
    let (hp, hq) = (n.dot(&(p - a)), n.dot(&(q - a)));
    if (hp > 0.0) == (hq > 0.0) {
        return false;
    }
    let x = p + (q - p) * (hp / (hp - hq));
    [(a, b), (b, c), (c, a)].iter().all(|(r, s)| (s - r).cross(&(x - r)).dot(&n) >= 0.0)
}

#[test]
fn random_scenes_agree_with_every_pair() {
    let mut total = 0;
    for seed in 0..8 {
        let mut random = Random(seed);
        let (x, triangles) = soup(60, 0.3, &mut random);
        let expected = by_every_pair(&CollisionMesh::single(x.len(), &triangles).unwrap(), &x);
        for threads in [1, 2] {
            assert_eq!(self_intersections(&triangles, &x, &pool(threads)).unwrap(), expected);
        }
        let (mesh, x) = bodies(&mut random);
        let with_rules = by_every_pair(&mesh, &x);
        assert_eq!(intersections(&mesh, &x, &pool(1)).unwrap(), with_rules);
        assert_eq!(Bvh::new(&mesh, &x).unwrap().intersections(&mesh, &x, &pool(2)).unwrap(), with_rules);
        total += expected.len() + with_rules.len();
    }
    assert!(total > 500, "the scenes must hold intersections, found {total}");
}

#[test]
fn crumpled_sheets_agree_with_every_pair() {
    let mut total = 0;
    for seed in 0..12 {
        let mut random = Random(50 + seed);
        let (mut x, triangles) = sheet(12, &mut random);
        let half = [0.05, 0.1, 0.2][seed as usize % 3];
        for p in &mut x {
            *p += random.vector(half);
        }
        let mesh = CollisionMesh::single(x.len(), &triangles).unwrap();
        let expected = by_every_pair(&mesh, &x);
        assert_eq!(self_intersections(&triangles, &x, &pool(1)).unwrap(), expected);
        // Neighbours at one vertex among them: the fans that fold over.
        total += expected
            .iter()
            .filter(|p| {
                let [s, t] = p.map(|t| triangles[t as usize]);
                s.iter().any(|v| t.contains(v))
            })
            .count();
    }
    assert!(total > 100, "neighbours must meet, found {total}");
}

/// [`self_intersections`] on one thread, which must be what other numbers of threads find.
fn found(triangles: &[[u32; 3]], x: &[Vec3]) -> Vec<[u32; 2]> {
    let found = self_intersections(triangles, x, pool_of_one()).unwrap();
    for threads in [2, 5] {
        assert_eq!(self_intersections(triangles, x, &pool(threads)).unwrap(), found, "{threads} threads");
    }
    found
}

#[test]
fn a_large_crumpled_sheet_agrees_with_every_pair() {
    let mut random = Random(70);
    let (mut x, triangles) = sheet(48, &mut random);
    for p in &mut x {
        *p = Vec3::new(0.4 * p.x, p.y, p.z) + random.vector(0.01);
    }
    let expected = by_every_pair(&CollisionMesh::single(x.len(), &triangles).unwrap(), &x);
    assert!(expected.len() > 300, "the sheet must meet itself, found {}", expected.len());
    assert_eq!(found(&triangles, &x), expected);
}

#[test]
fn nothing_and_next_to_nothing() {
    assert!(found(&[], &[]).is_empty());
    let x = TARGET.map(Vec3::from);
    assert!(found(&[], &x).is_empty());
    assert!(found(&[[0, 1, 2]], &x).is_empty());
    assert!(found(&[[0, 1, 2], [2, 1, 0]], &x).is_empty(), "one triangle, twice");
}

#[test]
fn one_huge_triangle_among_many_small_ones() {
    let mut random = Random(71);
    let (mut x, mut triangles) = soup(700, 0.01, &mut random);
    let first = x.len() as u32;
    x.extend([[-4e3, -5e3, 0.01], [6e3, -3e3, 0.02], [1e2, 7e3, -0.03]].map(Vec3::from));
    triangles.insert(350, [first, first + 1, first + 2]);
    let expected = by_every_pair(&CollisionMesh::single(x.len(), &triangles).unwrap(), &x);
    assert!(expected.iter().filter(|p| p.contains(&350)).count() > 5);
    assert_eq!(found(&triangles, &x), expected);
}

#[test]
fn far_from_the_origin_and_with_an_outlier() {
    let mut random = Random(72);
    let (near, mut triangles) = soup(300, 0.1, &mut random);
    let mut x: Vec<Vec3> = near.iter().map(|p| p + Vec3::repeat(1e6)).collect();
    let expected = by_every_pair(&CollisionMesh::single(x.len(), &triangles).unwrap(), &x);
    assert!(expected.len() > 100);
    assert_eq!(found(&triangles, &x), expected);
    // Far beyond the rest: in single precision all others are one point.
    let first = x.len() as u32;
    x.extend([Vec3::repeat(1e18), Vec3::new(1e18, 1e18, 2e18), Vec3::new(1e18, 2e18, 1e18)]);
    triangles.push([first, first + 1, first + 2]);
    assert_eq!(found(&triangles, &x), expected);
}

#[test]
fn triangles_in_one_place() {
    // Without area, all in one point: none meets.
    let points = vec![Vec3::new(0.3, 0.2, 0.1); 90];
    let triangles: Vec<[u32; 3]> = (0..30).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    assert!(found(&triangles, &points).is_empty());
    // With area, all alike: each meets each.
    let alike: Vec<Vec3> = (0..30).flat_map(|_| TARGET).map(Vec3::from).collect();
    let every: Vec<[u32; 2]> = (0..30).flat_map(|s| (s + 1..30).map(move |t| [s, t])).collect();
    assert_eq!(found(&triangles, &alike), every);
}

#[test]
fn a_gap_below_single_precision_is_seen() {
    let gap = 1e-11;
    for (height, meets) in [(gap, false), (-gap, true)] {
        // A corner above the inside of a triangle, a side above a side, a lid above a face.
        for second in [
            [[1.0, height, 1.0], [1.0, 2.0, 1.5], [1.5, 2.0, 1.0]],
            [[1.0, height, -1.0], [1.0, height, 1.0], [1.0, 2.0, 0.5]],
            [[1.0, height, 1.0], [1.0, 2.0 * gap, 2.0], [2.0, 2.0 * gap, 1.0]],
        ] {
            let x: Vec<Vec3> = TARGET.iter().chain(&second).map(|&p| Vec3::from(p)).collect();
            assert_eq!(!found(&[[0, 1, 2], [3, 4, 5]], &x).is_empty(), meets, "{second:?}");
        }
    }
}

#[test]
fn a_flat_sheet_does_not_meet_itself() {
    let mut random = Random(1);
    for offset in [0.0, 1e5] {
        let (mut x, triangles) = sheet(40, &mut random);
        for p in &mut x {
            *p = Vec3::new(p.x + offset, 1.0, p.z + offset);
        }
        assert!(self_intersections(&triangles, &x, &pool(1)).unwrap().is_empty());
    }
}

#[test]
fn motion_free_of_contact_makes_no_intersection() {
    let mut random = Random(9);
    let (mut free, mut hit) = (0, 0);
    for _ in 0..2000 {
        let (x_t0, triangles) = soup(3, 0.4, &mut random);
        if !self_intersections(&triangles, &x_t0, pool_of_one()).unwrap().is_empty() {
            continue;
        }
        let x_t1: Vec<Vec3> = x_t0.iter().map(|x| x + random.vector(0.4)).collect();
        let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
        let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.0, mode: Mode::Continuous, active: None };
        let contacts = BruteForce.detect(&mesh, &query, pool_of_one()).unwrap();
        if contacts.vertex_triangle.is_empty() && contacts.edge_edge.is_empty() {
            free += 1;
            assert!(self_intersections(&triangles, &x_t1, pool_of_one()).unwrap().is_empty());
        } else {
            hit += 1;
        }
    }
    assert!(free > 50 && hit > 50, "{free} free motions, {hit} with contacts");
}

fn pool_of_one() -> &'static rayon::ThreadPool {
    static POOL: std::sync::OnceLock<rayon::ThreadPool> = std::sync::OnceLock::new();
    POOL.get_or_init(|| pool(1))
}

#[test]
fn bad_input_is_named() {
    let x = vec![Vec3::zeros(), Vec3::x(), Vec3::new(0.0, f64::NAN, 0.0)];
    assert!(matches!(
        self_intersections(&[[0, 1, 2]], &x, &pool(1)),
        Err(DetectError::NotFinite { vertex: 2, .. })
    ));
    assert!(matches!(
        self_intersections(&[[0, 1, 3]], &x, &pool(1)),
        Err(DetectError::IndexOutOfRange { index: 3, .. })
    ));
}

#[test]
fn extreme_sizes_are_decided() {
    let corners = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.2, 0.2, -1.0],
        [0.2, 0.2, 1.0],
        [0.3, 0.3, 1.0],
    ];
    for exponent in [-300, -160, -59, 0, 61, 103, 300] {
        let size = 10.0f64.powi(exponent);
        let x: Vec<Vec3> = corners.iter().map(|&p| Vec3::from(p) * size).collect();
        let found = self_intersections(&[[0, 1, 2], [3, 4, 5]], &x, &pool(1)).unwrap();
        assert_eq!(found, [[0, 1]], "size {size:e}");
        let apart: Vec<Vec3> =
            x.iter().enumerate().map(|(i, p)| if i < 3 { *p } else { p + Vec3::x() * 2.0 * size }).collect();
        assert!(
            self_intersections(&[[0, 1, 2], [3, 4, 5]], &apart, &pool(1)).unwrap().is_empty(),
            "size {size:e}"
        );
    }
}
