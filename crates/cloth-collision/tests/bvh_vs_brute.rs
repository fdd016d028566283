//! The tree finds exactly what testing every pair finds.
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

mod support;

use cloth_collision::{
    BruteForce, Bvh, CollisionMesh, Contacts, DetectError, Detector, Mode, Query, Vec3, detector, detector_in,
};
use support::{Random, bodies, pool, sheet, soup};

/// None if equal, else what differs.
fn difference(a: &Contacts, b: &Contacts) -> Option<String> {
    for (what, p, q) in [
        ("vertex-triangle", &a.vertex_triangle, &b.vertex_triangle),
        ("edge-edge", &a.edge_edge, &b.edge_edge),
    ] {
        if p != q {
            let only = |p: &Vec<[u32; 2]>, q: &Vec<[u32; 2]>| p.iter().find(|x| !q.contains(x)).copied();
            return Some(format!("{what}: only first {:?}, only second {:?}", only(p, q), only(q, p)));
        }
    }
    if a.time_vertex_triangle != b.time_vertex_triangle || a.time_edge_edge != b.time_edge_edge {
        return Some("times".to_owned());
    }
    None
}

fn compare(mesh: &CollisionMesh, query: &Query<'_>, what: &str) -> usize {
    let (one, two) = (pool(1), pool(2));
    let expected = BruteForce.detect(mesh, query, &one).unwrap();
    let mut bvh = Bvh::new(mesh, query.x_t0).unwrap();
    bvh.validate(mesh).unwrap();
    let got = bvh.detect(mesh, query, &one).unwrap();
    bvh.validate(mesh).unwrap();
    assert_eq!(difference(&expected, &got), None, "{what}");
    // Reused, with two threads: the same bits.
    let again = bvh.detect(mesh, query, &two).unwrap();
    assert_eq!(difference(&expected, &again), None, "{what}, two threads");
    assert_eq!(got.stats.candidates_edge_edge, again.stats.candidates_edge_edge);
    expected.vertex_triangle.len() + expected.edge_edge.len()
}

fn compare_all(mesh: &CollisionMesh, x_t0: &[Vec3], x_t1: &[Vec3], random: &mut Random, what: &str) -> usize {
    let mut found = 0;
    let mask: Vec<bool> = (0..mesh.vertex_count).map(|_| random.below(10) == 0).collect();
    let none = vec![false; mesh.vertex_count];
    for mode in [Mode::Continuous, Mode::Discrete] {
        for thickness in [0.0, 0.02] {
            for active in [None, Some(&mask[..]), Some(&none[..])] {
                let query = Query { x_t0, x_t1, thickness, mode, active };
                found +=
                    compare(mesh, &query, &format!("{what}, {mode:?}, {thickness}, {}", active.is_some()));
            }
        }
    }
    found
}

#[test]
fn soups_of_many_sizes_agree() {
    let mut found = 0;
    for (seed, count) in [0, 1, 2, 3, 7, 8, 9, 16, 17, 40, 90].into_iter().enumerate() {
        let mut random = Random(seed as u64);
        let (x_t0, triangles) = soup(count, 0.25, &mut random);
        let x_t1: Vec<Vec3> = x_t0.iter().map(|x| x + random.vector(0.3)).collect();
        let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
        found += compare_all(&mesh, &x_t0, &x_t1, &mut random, &format!("soup of {count}"));
    }
    assert!(found > 1000, "the scenes must hold contacts, found {found}");
}

#[test]
fn sheets_far_from_the_origin_agree() {
    for (seed, offset) in [(1, 0.0), (2, 1e3), (3, -1e6)] {
        let mut random = Random(seed);
        let (mut x_t0, triangles) = sheet(10, &mut random);
        for x in &mut x_t0 {
            *x += Vec3::repeat(offset);
        }
        let x_t1: Vec<Vec3> = x_t0.iter().map(|x| x + random.vector(0.15)).collect();
        let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
        let found = compare_all(&mesh, &x_t0, &x_t1, &mut random, &format!("sheet at {offset}"));
        assert!(found > 10, "the scene must hold contacts, found {found}");
    }
}

#[test]
fn rules_of_bodies_and_attachments_agree() {
    for seed in 0..4 {
        let mut random = Random(100 + seed);
        let (mesh, x_t0) = bodies(&mut random);
        let x_t1: Vec<Vec3> = x_t0.iter().map(|x| x + random.vector(0.4)).collect();
        assert!(compare_all(&mesh, &x_t0, &x_t1, &mut random, "bodies") > 100);
        let contacts = Bvh::new(&mesh, &x_t0)
            .unwrap()
            .detect(
                &mesh,
                &Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.0, mode: Mode::Continuous, active: None },
                &pool(1),
            )
            .unwrap();
        for [v, t] in contacts.vertex_triangle {
            let corner = mesh.triangles[t as usize][0] as usize;
            let (a, b) = (mesh.vertex_body[v as usize], mesh.vertex_body[corner]);
            assert!(mesh.bodies_meet(a, b) && mesh.attached_to[v as usize] != b);
        }
    }
}

#[test]
fn sewn_vertices_are_as_one() {
    let (mut removed, mut kept) = (0, 0);
    for seed in 0..4 {
        let mut random = Random(300 + seed);
        let (x_t0, triangles) = soup(60, 0.3, &mut random);
        let x_t1: Vec<Vec3> = x_t0.iter().map(|x| x + random.vector(0.3)).collect();
        let loose = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
        // Pairs, and chains where a vertex is drawn twice.
        let pairs: Vec<[u32; 2]> = (0..30)
            .map(|_| [(); 2].map(|()| random.below(x_t0.len()) as u32))
            .filter(|[a, b]| a != b)
            .collect();
        let mut sewn = loose.clone();
        sewn.sew(&pairs);
        assert!(compare_all(&sewn, &x_t0, &x_t1, &mut random, "sewn") > 100);
        // What is sewn to what, by walking from pair to pair.
        let joined = |a: u32, b: u32| {
            let mut reached = vec![a];
            while let Some(&[p, q]) = pairs.iter().find(|[p, q]| reached.contains(p) != reached.contains(q)) {
                reached.push(if reached.contains(&p) { q } else { p });
            }
            a != b && reached.contains(&b)
        };
        let apart =
            |first: &[u32], second: &[u32]| !first.iter().any(|&v| second.iter().any(|&w| joined(v, w)));
        let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.02, mode: Mode::Continuous, active: None };
        let find =
            |mesh: &CollisionMesh| Bvh::new(mesh, &x_t0).unwrap().detect(mesh, &query, &pool(1)).unwrap();
        let (all, some) = (find(&loose), find(&sewn));
        let expected: Vec<_> = all
            .vertex_triangle
            .iter()
            .filter(|p| apart(&[p[0]], &loose.triangles[p[1] as usize]))
            .copied()
            .collect();
        assert_eq!(some.vertex_triangle, expected);
        let expected: Vec<_> = all
            .edge_edge
            .iter()
            .filter(|p| apart(&loose.edges[p[0] as usize], &loose.edges[p[1] as usize]))
            .copied()
            .collect();
        assert_eq!(some.edge_edge, expected);
        kept += expected.len();
        removed += all.edge_edge.len() - expected.len();
        let through = |mesh: &CollisionMesh| cloth_collision::intersections(mesh, &x_t0, &pool(1)).unwrap();
        let expected: Vec<_> = through(&loose)
            .into_iter()
            .filter(|p| apart(&loose.triangles[p[0] as usize], &loose.triangles[p[1] as usize]))
            .collect();
        assert_eq!(through(&sewn), expected);
    }
    assert!(removed > 10 && kept > 1000, "removed {removed}, kept {kept}");
}

#[test]
fn what_is_made_on_a_pool_is_the_same() {
    let mut random = Random(8);
    // More triangles than one task takes.
    let (x_t0, triangles) = sheet(60, &mut random);
    let x_t1: Vec<Vec3> = x_t0.iter().map(|x| x + random.vector(0.02)).collect();
    let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
    let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.0, mode: Mode::Continuous, active: None };
    let expected = Bvh::new(&mesh, &x_t0).unwrap().detect(&mesh, &query, &pool(1)).unwrap();
    for threads in [1, 2, 3] {
        let pool = pool(threads);
        assert!(CollisionMesh::single_in(x_t0.len(), &triangles, &pool).unwrap() == mesh);
        let mut bvh = Bvh::new_in(&mesh, &x_t0, &pool).unwrap();
        bvh.validate(&mesh).unwrap();
        let got = bvh.detect(&mesh, &query, &pool).unwrap();
        assert_eq!(difference(&expected, &got), None, "{threads} threads");
        assert_eq!(got.stats.broad_phase_tests, expected.stats.broad_phase_tests);
        let by_name = detector_in("bvh", &mesh, &x_t0, &pool).unwrap().detect(&mesh, &query, &pool).unwrap();
        assert_eq!(difference(&expected, &by_name), None, "{threads} threads");
    }
}

#[test]
fn a_missing_contact_is_noticed() {
    let mut random = Random(7);
    let (x_t0, triangles) = soup(30, 0.3, &mut random);
    let x_t1: Vec<Vec3> = x_t0.iter().map(|x| x + random.vector(0.3)).collect();
    let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
    let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.0, mode: Mode::Continuous, active: None };
    let good = BruteForce.detect(&mesh, &query, &pool(1)).unwrap();
    let mut bad = good.clone();
    bad.edge_edge.remove(bad.edge_edge.len() / 2);
    assert!(difference(&good, &bad).is_some_and(|d| d.contains("edge-edge")));
    let mut late = good.clone();
    late.time_vertex_triangle[0] += 1e-9;
    assert_eq!(difference(&good, &late).as_deref(), Some("times"));
}

#[test]
fn huge_coordinates_lose_nothing() {
    let mut random = Random(5);
    let (x_t0, triangles) = soup(10, 0.4, &mut random);
    // Beyond the range of single precision, and of squares in double precision.
    for scale in [1e40, 1e160, 1e305] {
        let x_t0: Vec<Vec3> = x_t0.iter().map(|x| x * scale).collect();
        let x_t1: Vec<Vec3> = x_t0.iter().map(|x| x + random.vector(0.3 * scale)).collect();
        let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
        let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.0, mode: Mode::Continuous, active: None };
        assert!(compare(&mesh, &query, "huge") > 0);
    }
}

#[test]
fn bad_input_is_named() {
    let x = vec![Vec3::zeros(), Vec3::x(), Vec3::y()];
    let mesh = CollisionMesh::single(3, &[[0, 1, 2]]).unwrap();
    let good = Query { x_t0: &x, x_t1: &x, thickness: 0.0, mode: Mode::Continuous, active: None };
    for name in ["brute", "bvh"] {
        let mut detector = detector(name, &mesh, &x).unwrap();
        let mut ask = |query: &Query<'_>| detector.detect(&mesh, query, &pool(1)).map(|_| ());
        assert_eq!(ask(&good), Ok(()));
        for thickness in [-1e-3, f64::NAN, f64::INFINITY] {
            assert!(matches!(
                ask(&Query { thickness, ..good }),
                Err(DetectError::Parameter { parameter: "thickness", .. })
            ));
        }
        for bad in [f64::NAN, f64::NEG_INFINITY] {
            let mut y = x.clone();
            y[2].z = bad;
            assert!(matches!(
                ask(&Query { x_t1: &y, ..good }),
                Err(DetectError::NotFinite { array: "x_t1", vertex: 2, .. })
            ));
        }
        assert!(matches!(
            ask(&Query { x_t0: &x[..2], ..good }),
            Err(DetectError::Length { array: "x_t0", expected: 3, got: 2 })
        ));
        assert!(matches!(
            ask(&Query { active: Some(&[true]), ..good }),
            Err(DetectError::Length { array: "active", expected: 3, got: 1 })
        ));
    }
    assert!(matches!(
        CollisionMesh::single(3, &[[0, 1, 2], [0, 1, 3]]),
        Err(DetectError::IndexOutOfRange { triangle: 1, index: 3, vertex_count: 3, .. })
    ));
    assert!(matches!(
        CollisionMesh::single(3, &[[0, 1, 1]]),
        Err(DetectError::RepeatedVertex { triangle: 0, .. })
    ));
    assert!(
        matches!(detector("grid", &mesh, &x), Err(DetectError::UnknownDetector { got, .. }) if got == "grid")
    );
    let other = CollisionMesh::single(4, &[[0, 1, 2], [1, 2, 3]]).unwrap();
    assert!(matches!(
        Bvh::new(&mesh, &x).unwrap().detect(
            &other,
            &Query {
                x_t0: &[x.clone(), vec![Vec3::z()]].concat(),
                x_t1: &[x.clone(), vec![Vec3::z()]].concat(),
                ..good
            },
            &pool(1)
        ),
        Err(DetectError::OtherMesh { expected: 1, got: 2 })
    ));
}
