//! The filter of the narrow phase and the 18-DOPs reject nothing that the code in double precision calls a contact.
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

mod support;

use cloth_gpu::collision::{
    BruteForce, CollisionMesh, Detector, Mode, Query, Vec3, edge_edge_ccd, vertex_triangle_ccd,
};
use cloth_gpu::layout::SceneParams;
use cloth_gpu::limits::status;
use cloth_gpu::stages::{bounds::Scene, narrow_filter::NarrowFilter};
use cloth_gpu::twin::dops::{self, Dop, vertex_dop};
use cloth_gpu::twin::narrow_filter::{Bounds, edge_edge_apart, vertex_triangle_apart};
use cloth_gpu::{Array, Frame, Gpu, GpuOptions, GridGpu, GridOptions, Recorder};
use support::{Random, device, difference, pool, soup, variants};

/// Loose triangles two by two: pair k has the triangles 2k and 2k + 1 with the vertices 6k to 6k + 5. Its candidates are the first
/// vertex of the first triangle against the second one, and the first edges of both.
struct Pairs {
    x_t0: Vec<Vec3>,
    x_t1: Vec<Vec3>,
}

impl Pairs {
    fn len(&self) -> usize {
        self.x_t0.len() / 6
    }

    fn triangles(&self) -> Vec<[u32; 3]> {
        (0..self.x_t0.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect()
    }
}

/// Where the four points of a candidate lie among the six vertices of its pair.
const VERTEX_TRIANGLE: [usize; 4] = [0, 3, 4, 5];
const EDGE_EDGE: [usize; 4] = [0, 1, 3, 4];

fn unit(random: &mut Random) -> Vec3 {
    let v = random.vector(1.0);
    v / v.norm().max(1e-3)
}

/// Pairs that nearly touch at some time, more or less, in general position and in none, small and large.
fn pairs(count: usize, centre: f64, random: &mut Random) -> Pairs {
    // Some a little less than the thicknesses that are asked about.
    let gaps = [0.0, 1e-12, 1e-9, 1e-8, 6e-8, 9.99e-8, 2.5e-7, 1e-6, 1e-5, 9.9999e-5, 9.99999e-4, 0.1];
    let mut out = Pairs { x_t0: vec![], x_t1: vec![] };
    for k in 0..count {
        let size = [0.3, 0.01, 1e-4, 1e-6][random.below(4)];
        let speed = size * [0.0, 1e-3, 1.0, 30.0][random.below(4)];
        let place = random.vector(0.6);
        let mut p: [Vec3; 6] = [(); 6].map(|()| random.vector(size));
        let normal = unit(random);
        if k % 3 == 0 {
            // All in one plane.
            for p in &mut p {
                *p -= normal * p.dot(&normal);
            }
        }
        match random.below(8) {
            0 => p[1] = p[0],
            1 => p[5] = p[3] + (p[4] - p[3]) * random.unit(),
            2 => p[4] = p[3] + (p[1] - p[0]),
            3 => p[5] = p[4],
            _ => {}
        }
        // Both candidates touch at first: a vertex, or a point of the first edge, on a point of the other feature.
        let (s, t) = (random.unit(), random.unit());
        let (own, other) = if random.below(2) == 0 {
            let corner = [0.0, 0.3, 1.0][random.below(3)];
            (p[0], p[3] + (p[4] - p[3]) * (s * corner) + (p[5] - p[3]) * ((1.0 - s) * t * corner))
        } else {
            (p[0] + (p[1] - p[0]) * s, p[3] + (p[4] - p[3]) * t)
        };
        let gap = gaps[random.below(gaps.len())] * [1.0, -1.0, size][random.below(3)];
        let apart = other - own + if random.below(3) == 0 { unit(random) } else { normal } * gap;
        for p in &mut p[..3] {
            *p += apart;
        }
        let time = [0.0, 1.0, random.unit()][random.below(3)];
        let drift = random.vector(speed);
        let own_speed = speed * [0.0, 1.0][random.below(2)];
        let v: [Vec3; 6] = [(); 6].map(|()| random.vector(own_speed));
        for i in 0..6 {
            let along = if random.below(2) == 0 { drift - normal * drift.dot(&normal) } else { drift };
            let v = v[i] + if i < 3 { along } else { Vec3::zeros() };
            let x = p[i] + place + Vec3::repeat(centre);
            let keep = |x: Vec3| x.map(|c| c.clamp(centre - 1.0, centre + 1.0));
            out.x_t0.push(keep(x - v * time));
            out.x_t1.push(keep(x + v * (1.0 - time)));
        }
    }
    // The scene's size.
    for (k, x) in [-1.0, 1.0, 0.9, -0.9, 0.8, -0.8].into_iter().enumerate() {
        let x = Vec3::new(x, if k % 2 == 0 { x } else { -x }, x) + Vec3::repeat(centre);
        out.x_t0.push(x);
        out.x_t1.push(x);
    }
    out
}

/// What is known of each candidate.
#[derive(Default)]
struct Tally {
    contacts: usize,
    apart: usize,
    rejected: usize,
    /// Contacts that were rejected.
    lost: usize,
}

impl Tally {
    fn count(&mut self, is_contact: bool, is_rejected: bool) {
        self.contacts += usize::from(is_contact);
        self.apart += usize::from(!is_contact);
        self.rejected += usize::from(is_rejected);
        self.lost += usize::from(is_contact && is_rejected);
    }
}

fn query(pairs: &Pairs, mode: Mode, thickness: f64) -> Query<'_> {
    Query { x_t0: &pairs.x_t0, x_t1: &pairs.x_t1, thickness, mode, active: None }
}

const CASES: [(Mode, f64); 6] = [
    (Mode::Continuous, 0.0),
    (Mode::Discrete, 0.0),
    (Mode::Continuous, 1e-7),
    (Mode::Discrete, 1e-4),
    (Mode::Continuous, 1e-3),
    (Mode::Continuous, 1e-310),
];

/// Whether the four points of a candidate are a contact, and their places on the device.
fn candidate(
    query: &Query<'_>,
    frame: &Frame,
    pair: usize,
    points: [usize; 4],
) -> ([Vec3; 8], [[f32; 4]; 8]) {
    let start = if query.mode == Mode::Continuous { query.x_t0 } else { query.x_t1 };
    let v = points.map(|p| 6 * pair + p);
    let (p, q) = (v.map(|v| start[v]), v.map(|v| query.x_t1[v]));
    let at = |v: usize, end: usize| frame.positions[v + end * frame.second as usize];
    let places = std::array::from_fn(|k| at(v[k % 4], k / 4));
    ([p[0], p[1], p[2], p[3], q[0], q[1], q[2], q[3]], places)
}

/// Asks `rejects` about every candidate; vertices and triangles first.
fn tally(
    pairs: &Pairs,
    mode: Mode,
    thickness: f64,
    rejects: impl Fn(bool, &[[f32; 4]; 8], &Frame) -> bool,
) -> Tally {
    let query = query(pairs, mode, thickness);
    let frame = Frame::new(&query, &pool(1));
    let mut out = Tally::default();
    for k in 0..pairs.len() {
        let (x, places) = candidate(&query, &frame, k, VERTEX_TRIANGLE);
        out.count(vertex_triangle_ccd(&x, thickness).is_some(), rejects(false, &places, &frame));
        let (x, places) = candidate(&query, &frame, k, EDGE_EDGE);
        out.count(edge_edge_ccd(&x, thickness).is_some(), rejects(true, &places, &frame));
    }
    out
}

fn filter(thickness: f64, bounds: Bounds) -> impl Fn(bool, &[[f32; 4]; 8], &Frame) -> bool {
    move |edges, places, frame| {
        let p = places.map(|p| [p[0], p[1], p[2]]);
        let is_thin = thickness == 0.0;
        if edges {
            edge_edge_apart(&p, frame.thickness, is_thin, bounds)
        } else {
            vertex_triangle_apart(&p, frame.thickness, is_thin, bounds)
        }
    }
}

fn slabs(slack: f32) -> impl Fn(bool, &[[f32; 4]; 8], &Frame) -> bool {
    move |edges, places, frame| {
        let whole = |range: std::ops::Range<usize>| {
            let of = |k: usize| vertex_dop(places[k], places[k + 4], frame.thickness, slack);
            range.map(of).reduce(Dop::hull).unwrap()
        };
        let first = if edges { 2 } else { 1 };
        !whole(0..first).may_touch(&whole(first..4))
    }
}

#[test]
fn what_is_rejected_is_no_contact() {
    for (seed, centre) in [(1, 0.0), (2, 1e6), (3, -3e3)] {
        let pairs = pairs(30_000, centre, &mut Random(seed));
        for (mode, thickness) in CASES {
            let found = tally(&pairs, mode, thickness, filter(thickness, Bounds::default()));
            assert_eq!(found.lost, 0, "filter at {centre}, {mode:?}, {thickness}");
            assert!(found.contacts > 500 && found.apart > 1000, "{} {}", found.contacts, found.apart);
            // Half of what is apart is nearer than the positions' rounding.
            assert!(2 * found.rejected > found.apart / 2, "{} of {}", found.rejected, found.apart);
            let found = tally(&pairs, mode, thickness, slabs(dops::SLACK));
            assert_eq!(found.lost, 0, "18-DOPs at {centre}, {mode:?}, {thickness}");
            assert!(found.rejected > 100);
        }
    }
}

#[test]
fn bounds_that_are_too_small_lose_contacts() {
    let pairs = pairs(30_000, 0.0, &mut Random(4));
    let none = Bounds { rounding: 0.0, position: 0.0 };
    let rounding_alone = Bounds { position: 0.0, ..Bounds::default() };
    for (mode, thickness) in [(Mode::Continuous, 0.0), (Mode::Discrete, 0.0), (Mode::Discrete, 1e-4)] {
        assert!(tally(&pairs, mode, thickness, filter(thickness, none)).lost > 0, "{mode:?}, {thickness}");
        assert!(tally(&pairs, mode, thickness, filter(thickness, rounding_alone)).lost > 0);
        // Features at rest that touch have slabs that do.
        let is_moving = mode == Mode::Continuous;
        assert!(!is_moving || tally(&pairs, mode, thickness, slabs(0.0)).lost > 0);
        // The thickness forgotten.
        let thin = |edges, places: &[[f32; 4]; 8], frame: &Frame| {
            filter(thickness, Bounds::default())(edges, places, &Frame { thickness: 0.0, ..frame.clone() })
        };
        assert!(thickness == 0.0 || tally(&pairs, mode, thickness, thin).lost > 0);
        let thin = |edges, places: &[[f32; 4]; 8], frame: &Frame| {
            slabs(dops::SLACK)(edges, places, &Frame { thickness: 0.0, ..frame.clone() })
        };
        assert!(thickness == 0.0 || tally(&pairs, mode, thickness, thin).lost > 0);
    }
    // Never coplanar is not farther than the thickness.
    let (thickness, taken_as) = (1e-3, 0.0);
    assert!(tally(&pairs, Mode::Discrete, thickness, filter(taken_as, Bounds::default())).lost > 0);
}

/// Which candidates the device leaves: of vertices and triangles, of edges.
fn on_device(gpu: &Gpu, pairs: &Pairs, query: &Query<'_>, room: usize) -> ([Vec<u32>; 2], [u32; 2]) {
    let mesh = CollisionMesh::single(pairs.x_t0.len(), &pairs.triangles()).unwrap();
    let frame = Frame::new(query, &pool(1));
    let mut scene = Scene::new(gpu, &mesh).unwrap();
    scene.upload(gpu, query, &frame);
    let edge = |a: usize| mesh.edges.binary_search(&[a as u32, a as u32 + 1]).unwrap() as u32;
    let n = pairs.len();
    let vertex_triangle: Vec<[u32; 2]> = (0..n as u32).map(|k| [6 * k, 2 * k + 1]).collect();
    let edge_edge: Vec<[u32; 2]> = (0..n).map(|k| [edge(6 * k), edge(6 * k + 3)]).collect();
    let candidates = [&vertex_triangle, &edge_edge].map(|list| Array::with(gpu, "candidates", list).unwrap());
    let mut words = [0; status::LENGTH as usize];
    words[status::VERTEX_TRIANGLE as usize] = n as u32;
    words[status::EDGE_EDGE as usize] = n as u32;
    scene.status.write(gpu, &words);
    let stage = NarrowFilter::new(gpu, room).unwrap();
    let mut recorder = Recorder::new(gpu);
    stage.record(&mut recorder, &scene, candidates.each_ref(), [n as u32; 2]);
    let copies = [0, 1].map(|k| recorder.download(&stage.left[k], 0..stage.left[k].capacity()));
    let words = recorder.download(&scene.status, 0..status::LENGTH as usize);
    let answer = recorder.run().unwrap();
    let words: Vec<u32> = answer.read(words);
    let counts = [0, 1].map(|k| words[(status::LEFT + k) as usize]);
    let mut left = [vec![], vec![]];
    for k in 0..2 {
        let found: Vec<[u32; 2]> = answer.read(copies[k]);
        let pair = |p: &[u32; 2]| if k == 0 { p[0] / 6 } else { mesh.edges[p[0] as usize][0] / 6 };
        left[k] = found[..(counts[k] as usize).min(room)].iter().map(pair).collect();
        left[k].sort_unstable();
    }
    (left, counts)
}

#[test]
fn the_device_leaves_what_the_twin_leaves() {
    for options in variants() {
        let Some(device) = device(options) else { return };
        for (seed, count) in [(5, 1), (6, 255), (7, 256), (8, 3000)] {
            let pairs = pairs(count, 0.0, &mut Random(seed));
            for (mode, thickness) in CASES {
                let query = query(&pairs, mode, thickness);
                let frame = Frame::new(&query, &pool(1));
                let (left, counts) = on_device(&device.gpu, &pairs, &query, pairs.len());
                assert!(left[0].len() == counts[0] as usize && left[1].len() == counts[1] as usize);
                let mut otherwise = 0;
                for k in 0..pairs.len() {
                    for (kind, points) in [VERTEX_TRIANGLE, EDGE_EDGE].into_iter().enumerate() {
                        let (x, places) = candidate(&query, &frame, k, points);
                        let is_left = left[kind].binary_search(&(k as u32)).is_ok();
                        let rejects = filter(thickness, Bounds::default())(kind == 1, &places, &frame);
                        otherwise += usize::from(is_left == rejects);
                        let is_contact = if kind == 0 {
                            vertex_triangle_ccd(&x, thickness).is_some()
                        } else {
                            edge_edge_ccd(&x, thickness).is_some()
                        };
                        assert!(is_left || !is_contact, "pair {k} is lost: {mode:?}, {thickness}");
                    }
                }
                // Rounding may decide otherwise where a pair is at the bound.
                assert!(otherwise <= pairs.len() / 100, "{otherwise} of {}", pairs.len());
            }
        }
    }
}

#[test]
fn what_does_not_fit_is_counted() {
    let Some(device) = device(GpuOptions::default()) else { return };
    let pairs = pairs(1000, 0.0, &mut Random(9));
    let query = query(&pairs, Mode::Continuous, 0.0);
    let (all, counts) = on_device(&device.gpu, &pairs, &query, 2000);
    let (some, again) = on_device(&device.gpu, &pairs, &query, 100);
    assert!(counts == again && counts[0] > 100 && counts[1] > 100);
    for k in 0..2 {
        assert!(some[k].len() == 100 && some[k].iter().all(|p| all[k].binary_search(p).is_ok()));
    }
}

/// With and without them the contacts are the same, and the candidates fewer.
#[test]
fn filter_and_dops_save_candidates_and_no_contact() {
    let Some(device) = device(GpuOptions::default()) else { return };
    let mut random = Random(10);
    let (x_t0, triangles) = soup(400, 0.15, &mut random);
    let x_t1: Vec<Vec3> = x_t0.iter().map(|x| x + random.vector(0.05)).collect();
    let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
    for (mode, thickness) in [(Mode::Continuous, 0.0), (Mode::Discrete, 0.01), (Mode::Continuous, 0.01)] {
        let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness, mode, active: None };
        let expected = BruteForce.detect(&mesh, &query, &pool(1)).unwrap();
        let mut counts = vec![];
        for (dops, device_filter) in [(false, false), (true, false), (false, true), (true, true)] {
            let options = GridOptions { dops, device_filter, ..GridOptions::default() };
            let mut grid = GridGpu::with_options(device.gpu.clone(), &mesh, options).unwrap();
            let got = grid.detect(&mesh, &query, &pool(1)).unwrap();
            assert_eq!(difference(&expected, &got), None, "{dops}, {device_filter}");
            let s = got.stats;
            counts.push((
                s.candidates_vertex_triangle + s.candidates_edge_edge,
                s.count("left_vertex_triangle") + s.count("left_edge_edge"),
            ));
        }
        let [boxes, dops, filtered, both] = counts[..] else { panic!("four") };
        assert!(boxes.0 == boxes.1 && dops.0 == dops.1, "{counts:?}");
        assert!(boxes.0 == filtered.0 && dops.0 == both.0 && 10 * dops.0 < 9 * boxes.0, "{counts:?}");
        assert!(3 * filtered.1 < 2 * boxes.0 && both.1 <= filtered.1, "{counts:?}");
    }
}

#[test]
fn parameters_say_how_thick() {
    let Some(device) = device(GpuOptions::default()) else { return };
    let x = [Vec3::zeros(), Vec3::x(), Vec3::y()];
    let mesh = CollisionMesh::single(3, &[[0, 1, 2]]).unwrap();
    let params = |thickness: f64| -> SceneParams {
        let query = Query { x_t0: &x, x_t1: &x, thickness, mode: Mode::Continuous, active: None };
        let mut scene = Scene::new(&device.gpu, &mesh).unwrap();
        scene.upload(&device.gpu, &query, &Frame::new(&query, &pool(1)));
        scene.params
    };
    assert_eq!(params(0.0).is_thin, 1);
    // Nothing on the device, and yet not thin.
    assert_eq!(params(1e-320).is_thin, 0);
    let thick = params(0.1);
    assert!(thick.is_thin == 0 && f64::from(thick.thickness) >= 0.1 && f64::from(thick.thickness) < 0.11);
}
