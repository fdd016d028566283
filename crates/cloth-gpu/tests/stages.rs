//! Each stage of the grid on the device equals its twin, given the same input.
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

mod support;

use bytemuck::Pod;
use cloth_gpu::collision::{CollisionMesh, Mode, Query, Vec3};
use cloth_gpu::layout::{Bounds, Entry, Grid, SceneParams, SubdivisionParams};
use cloth_gpu::limits::{REACH, WORKGROUP, status};
use cloth_gpu::stages::bounds::{Scene, active_words, feature_words, triangle_words};
use cloth_gpu::stages::subdivision::{self, Subdivision};
use cloth_gpu::stages::{cells::Cells, features::Features, pairs::Pairs};
use cloth_gpu::twin::{self, pairs::SPHERE_FACTOR};
use cloth_gpu::{Array, Frame, Gpu, Recorder};
use support::{Random, bodies, device, moved, pool, soup, variants};

/// Radii and distances may differ by the rounding of a few operations and of a square root.
const ROUNDING: f32 = 1e-6;
/// Room for pairs and candidates, in as many workgroups as the smallest variant takes.
const ROOM: u32 = 1 << 17;

/// What every stage of one run left on the device.
#[derive(Clone)]
struct Run {
    params: SceneParams,
    triangles: Vec<[u32; 4]>,
    features: Vec<[u32; 4]>,
    positions: Vec<[f32; 4]>,
    active: Vec<u32>,
    bounds: Vec<Bounds>,
    spheres: Vec<[f32; 4]>,
    status: Vec<u32>,
    grid: Vec<Grid>,
    homes: Vec<u32>,
    controls: Vec<u32>,
    offsets: Vec<u32>,
    keys: Vec<u32>,
    registered: Vec<u32>,
    entries: Vec<Entry>,
    counts: Vec<u32>,
    sums: Vec<[u32; 2]>,
    pairs: Vec<[u32; 2]>,
    vertex_triangle: Vec<[u32; 2]>,
    edge_edge: Vec<[u32; 2]>,
}

fn whole<T: Pod>(recorder: &mut Recorder<'_>, array: &Array<T>) -> usize {
    recorder.download(array, 0..array.capacity())
}

fn first<T>(mut list: Vec<T>, n: usize) -> Vec<T> {
    assert!(n <= list.len(), "{n} in {}", list.len());
    list.truncate(n);
    list
}

/// With room for so many pairs and candidates, and for eight times as many tests.
fn run(gpu: &Gpu, mesh: &CollisionMesh, query: &Query<'_>, room: u32) -> Run {
    let frame = Frame::new(query, &pool(1));
    let (n, tests) = (mesh.triangles.len(), 8 * room);
    let room = room as usize;
    let mut scene = Scene::new(gpu, mesh).unwrap();
    scene.upload(gpu, query, &frame);
    let mut cells = Cells::new(gpu, n as u32, 8 * n).unwrap();
    let mut pairs = Pairs::new(gpu, room, false).unwrap();
    let features = Features::new(gpu, room, true).unwrap();
    let mut recorder = Recorder::new(gpu);
    scene.record(&mut recorder);
    cells.record_setup(&mut recorder, &scene);
    cells.record(&mut recorder, scene.registered(), &scene.spheres, 32).unwrap();
    pairs.record_counts(&mut recorder, &cells).unwrap();
    pairs.record_tests(&mut recorder, &scene, &cells, 0, tests).unwrap();
    features.record(&mut recorder, &scene, &pairs.found, room as u32);
    let r = &mut recorder;
    let copies = [
        whole(r, &scene.bounds),
        whole(r, &scene.spheres),
        whole(r, &scene.status),
        whole(r, &cells.grid),
        whole(r, &cells.homes),
        whole(r, &cells.controls),
        whole(r, &cells.offsets),
        whole(r, &cells.keys),
        whole(r, &cells.registered),
        whole(r, &cells.entries),
        whole(r, &pairs.counts),
        whole(r, &pairs.sums),
        whole(r, &pairs.found),
        whole(r, &features.vertex_triangle),
        whole(r, &features.edge_edge),
    ];
    let answer = recorder.run().unwrap();
    let words: Vec<u32> = answer.read(copies[2]);
    let count = |k: u32| words[k as usize] as usize;
    assert!(count(status::PAIRS) < tests as usize && count(status::PAIRS + 1) == 0, "all tests in one part");
    let registrations = count(status::REGISTRATIONS);
    Run {
        params: scene.params,
        triangles: triangle_words(mesh),
        features: feature_words(mesh),
        positions: frame.positions,
        active: query.active.map(active_words).unwrap_or_default(),
        bounds: first(answer.read(copies[0]), n),
        spheres: first(answer.read(copies[1]), n),
        grid: answer.read(copies[3]),
        homes: first(answer.read(copies[4]), n),
        controls: first(answer.read(copies[5]), n),
        offsets: first(answer.read(copies[6]), n + 1),
        keys: first(answer.read(copies[7]), registrations),
        registered: first(answer.read(copies[8]), registrations),
        entries: first(answer.read(copies[9]), registrations),
        counts: first(answer.read(copies[10]), registrations),
        sums: first(answer.read(copies[11]), registrations + 1),
        pairs: first(answer.read(copies[12]), count(status::TRIANGLE_PAIRS)),
        vertex_triangle: first(answer.read(copies[13]), count(status::VERTEX_TRIANGLE)),
        edge_edge: first(answer.read(copies[14]), count(status::EDGE_EDGE)),
        status: words,
    }
}

fn sorted(mut list: Vec<[u32; 2]>) -> Vec<[u32; 2]> {
    list.sort_unstable();
    list
}

/// The first stage that differs from its twin; None if all agree.
fn difference(r: &Run) -> Option<&'static str> {
    let (bounds, spheres, _) =
        twin::bounds::triangle_bounds(&r.params, &r.triangles, &r.positions, &r.active);
    if bounds != r.bounds {
        return Some("bounds");
    }
    let near = |a: &[f32; 4], b: &[f32; 4]| a[..3] == b[..3] && (a[3] - b[3]).abs() <= ROUNDING * a[3];
    if !spheres.iter().zip(&r.spheres).all(|(a, b)| near(a, b)) {
        return Some("spheres");
    }
    let radius = r.spheres.iter().fold(0.0f32, |m, s| m.max(s[3]));
    if radius.to_bits() != r.status[status::RADIUS as usize] {
        return Some("largest radius");
    }
    let (grid, bits) = twin::cells::grid_setup(&r.params, radius);
    let got = r.grid[0];
    if (grid.cells, grid.low) != (got.cells, got.low)
        || bits != r.status[status::KEY_BITS as usize]
        || (grid.size - got.size).abs() > ROUNDING * grid.size
        || (grid.inverse - got.inverse).abs() > ROUNDING * grid.inverse
    {
        return Some("grid");
    }
    let (homes, least) = twin::cells::cells_count(&got, &r.spheres, REACH * (1.0 - ROUNDING));
    let (_, most) = twin::cells::cells_count(&got, &r.spheres, REACH * (1.0 + ROUNDING));
    if homes != r.homes {
        return Some("home cells");
    }
    if !(0..homes.len()).all(|t| least[t] & !r.controls[t] == 0 && r.controls[t] & !most[t] == 0) {
        return Some("control bits");
    }
    let wide: Vec<u64> = r.controls.iter().map(|&c| twin::cells::cell_count(c).into()).collect();
    if !twin::scan::scan(&wide).iter().eq(r.offsets.iter().map(|&o| u64::from(o)).collect::<Vec<_>>().iter())
    {
        return Some("offsets");
    }
    let registrations = twin::sort::sort(&twin::cells::cells_register(&got, &r.homes, &r.controls), 32);
    let pairs: Vec<(u64, u32)> = r.keys.iter().zip(&r.registered).map(|(&k, &t)| (k.into(), t)).collect();
    if registrations != pairs {
        return Some("registrations");
    }
    if twin::cells::cells_gather(&registrations, &r.spheres, &r.controls) != r.entries {
        return Some("entries");
    }
    let counts = twin::pairs::pairs_count(&r.keys);
    if counts != r.counts {
        return Some("test counts");
    }
    let sums = twin::scan::scan(&counts.iter().map(|&c| c.into()).collect::<Vec<_>>());
    if !sums.iter().map(|&s| [s as u32, (s >> 32) as u32]).eq(r.sums.iter().copied()) {
        return Some("test sums");
    }
    let total = sums[counts.len()];
    let tests = |f| sorted(twin::pairs::pairs_test(&counts, &r.entries, &r.bounds, 0, total, f));
    let (least, most, found) =
        (tests(SPHERE_FACTOR - ROUNDING), tests(SPHERE_FACTOR + ROUNDING), sorted(r.pairs.clone()));
    let is_within = |a: &[[u32; 2]], b: &[[u32; 2]]| a.iter().all(|p| b.binary_search(p).is_ok());
    if !is_within(&least, &found) || !is_within(&found, &most) || found.windows(2).any(|w| w[0] == w[1]) {
        return Some("triangle pairs");
    }
    let (vertex_triangle, edge_edge) = twin::features::feature_pairs(
        &r.params,
        &r.triangles,
        &r.features,
        &r.positions,
        &r.active,
        &r.pairs,
        Some(twin::dops::SLACK),
    );
    if sorted(vertex_triangle) != sorted(r.vertex_triangle.clone()) {
        return Some("vertex-triangle candidates");
    }
    (sorted(edge_edge) != sorted(r.edge_edge.clone())).then_some("edge-edge candidates")
}

/// A soup of n loose triangles, moving.
fn scene(n: usize, random: &mut Random) -> (CollisionMesh, Vec<Vec3>, Vec<Vec3>) {
    let size = 0.4 / (n as f64).cbrt();
    let (x_t0, mut triangles) = soup(n, size, random);
    for (t, corners) in triangles.iter_mut().enumerate() {
        corners[0] = 3 * t as u32;
    }
    let x_t1 = moved(&x_t0, 0.5 * size, random);
    (CollisionMesh::single(x_t0.len(), &triangles).unwrap(), x_t0, x_t1)
}

#[test]
fn stages_match_their_twins() {
    for options in variants() {
        let Some(device) = device(options) else { return };
        let mut random = Random(1);
        let w = WORKGROUP as usize;
        for n in [1, 2, w - 1, w, w + 1, 5 * w + 77] {
            let (mesh, x_t0, x_t1) = scene(n, &mut random);
            let mask: Vec<bool> = x_t0.iter().map(|_| random.below(5) == 0).collect();
            for (mode, thickness, active) in [
                (Mode::Continuous, 0.0, None),
                (Mode::Continuous, 0.01, Some(&mask[..])),
                (Mode::Discrete, 0.02, None),
            ] {
                let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness, mode, active };
                let got = run(&device.gpu, &mesh, &query, ROOM);
                assert_eq!(difference(&got), None, "{n}, {mode:?}, {thickness}");
                assert!(n < 100 || !got.edge_edge.is_empty());
            }
        }
    }
}

#[test]
fn stages_match_their_twins_over_bodies() {
    let Some(device) = device(variants()[0]) else { return };
    let mut random = Random(2);
    let (mesh, x_t0) = bodies(&mut random);
    let x_t1 = moved(&x_t0, 0.2, &mut random);
    let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.0, mode: Mode::Continuous, active: None };
    assert_eq!(difference(&run(&device.gpu, &mesh, &query, ROOM)), None);
}

#[test]
fn many_triangles_match_their_twins() {
    let Some(device) = device(variants()[0]) else { return };
    let (mesh, x_t0, x_t1) = scene(100_003, &mut Random(3));
    let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.0, mode: Mode::Continuous, active: None };
    assert_eq!(difference(&run(&device.gpu, &mesh, &query, 16 * ROOM)), None);
}

type Fault = fn(&mut Run);

#[test]
fn planted_faults_are_caught() {
    let Some(device) = device(variants()[0]) else { return };
    let (mesh, x_t0, x_t1) = scene(500, &mut Random(4));
    let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.0, mode: Mode::Continuous, active: None };
    let good = run(&device.gpu, &mesh, &query, ROOM);
    assert_eq!(difference(&good), None);
    let faults: [(&str, Fault); 16] = [
        ("bounds", |r| r.bounds[99].low_1[2] = r.bounds[99].low_1[2].next_up()),
        ("bounds", |r| r.bounds[7].is_active ^= 1),
        ("spheres", |r| r.spheres[3][3] *= 0.999),
        ("largest radius", |r| r.status[status::RADIUS as usize] -= 1),
        ("grid", |r| r.grid[0].cells[1] += 1),
        ("home cells", |r| r.homes[499] += 1),
        ("control bits", |r| r.controls[10] ^= 1 << 12),
        ("offsets", |r| r.offsets[500] += 1),
        ("registrations", |r| r.keys[50] ^= 1),
        ("registrations", |r| r.registered.swap(0, 1)),
        ("entries", |r| r.entries[20].key ^= 1),
        ("test counts", |r| r.counts[30] += 1),
        ("test sums", |r| r.sums[40][1] += 1),
        ("triangle pairs", |r| r.pairs.truncate(r.pairs.len() - 1)),
        ("triangle pairs", |r| r.pairs.push(r.pairs[0])),
        ("edge-edge candidates", |r| r.edge_edge[0][0] ^= 1),
    ];
    for (stage, fault) in faults {
        let mut bad = good.clone();
        fault(&mut bad);
        assert_eq!(difference(&bad), Some(stage));
    }
}

/// What the stages of the virtual subdivision left on the device.
#[derive(Clone)]
struct Parts {
    params: SubdivisionParams,
    triangles: Vec<[u32; 4]>,
    positions: Vec<[f32; 4]>,
    spheres: Vec<[f32; 4]>,
    grid: Vec<Grid>,
    plans: Vec<u32>,
    sums: Vec<[u32; 2]>,
    roots: Vec<u32>,
    balls: Vec<[f32; 4]>,
    keys: Vec<u32>,
    registered: Vec<u32>,
    marks: Vec<u32>,
    entries: Vec<Entry>,
}

fn run_parts(gpu: &Gpu, mesh: &CollisionMesh, query: &Query<'_>, room: u32) -> Parts {
    let frame = Frame::new(query, &pool(1));
    let n = mesh.triangles.len();
    let mut scene = Scene::new(gpu, mesh).unwrap();
    scene.upload(gpu, query, &frame);
    let mut cells = Cells::new(gpu, room, 4 * room as usize).unwrap();
    let mut stage = Subdivision::new(gpu, n as u32, room as usize).unwrap();
    let params = subdivision::params(&scene, &frame, room, 1.2);
    let mut recorder = Recorder::new(gpu);
    scene.record(&mut recorder);
    stage.record(&mut recorder, &scene, &cells, &params).unwrap();
    cells.record(&mut recorder, stage.registered(n as u32), &scene.spheres, 32).unwrap();
    let r = &mut recorder;
    let copies = [
        whole(r, &scene.spheres),
        whole(r, &cells.grid),
        whole(r, &stage.plans),
        whole(r, &stage.sums),
        whole(r, &stage.roots),
        whole(r, &stage.parts),
        whole(r, &cells.keys),
        whole(r, &cells.registered),
        whole(r, &cells.marks),
        whole(r, &cells.entries),
        whole(r, &cells.offsets),
        whole(r, &cells.kept),
        whole(r, &scene.status),
    ];
    let answer = recorder.run().unwrap();
    assert_eq!(answer.read::<u32>(copies[12])[status::TOO_FINE as usize], 0);
    let sums = first(answer.read::<[u32; 2]>(copies[3]), n + 1);
    let count = sums[n][0] as usize;
    let registrations = answer.read::<u32>(copies[10])[room as usize] as usize;
    let kept = answer.read::<u32>(copies[11])[4 * room as usize] as usize;
    Parts {
        params,
        triangles: triangle_words(mesh),
        positions: frame.positions,
        spheres: first(answer.read(copies[0]), n),
        grid: answer.read(copies[1]),
        plans: first(answer.read(copies[2]), n),
        sums,
        roots: first(answer.read(copies[4]), count),
        balls: first(answer.read(copies[5]), count),
        keys: first(answer.read(copies[6]), registrations),
        registered: first(answer.read(copies[7]), registrations),
        marks: first(answer.read(copies[8]), registrations),
        entries: first(answer.read(copies[9]), kept),
    }
}

/// The first stage of the subdivision that differs from its twin; None if all agree.
fn part_difference(r: &Parts) -> Option<&'static str> {
    let sum = twin::subdivision::radius_words(&r.spheres).iter().map(|&w| u64::from(w)).sum();
    let (grid, _) = twin::subdivision::subdivision_setup(&r.params, sum);
    let got = r.grid[0];
    if grid.cells != got.cells || (grid.size - got.size).abs() > ROUNDING * grid.size {
        return Some("grid");
    }
    let mut before = 0;
    for (t, corners) in r.triangles.iter().enumerate() {
        let motion = twin::subdivision::motion(&r.params, &r.positions, corners);
        let plan = |f: f32| {
            let limit = twin::subdivision::limit(got.size) * f;
            twin::subdivision::subdivision_plan(r.params.least, limit, r.spheres[t][3], &motion)
        };
        // Rounding may decide otherwise where a size is at the limit.
        let found = (r.plans[t] & 0xff, r.plans[t] >> 8);
        if ![1.0, 1.0 - ROUNDING, 1.0 + ROUNDING].iter().any(|&f| plan(f) == Some(found)) {
            return Some("plans");
        }
        if r.sums[t] != [before, 0] {
            return Some("sums");
        }
        for number in 0..1 << (2 * found.0 + found.1) {
            let k = (before + number) as usize;
            let (weights, times) = twin::subdivision::part(number, found.0, found.1);
            let sphere = match found {
                (0, 0) => r.spheres[t],
                _ => twin::subdivision::part_sphere(&motion, &weights, times),
            };
            let is_near = (0..4).all(|c| (sphere[c] - r.balls[k][c]).abs() <= 2.0 * ROUNDING);
            if !is_near {
                return Some("parts");
            }
            if r.roots[k] != t as u32 {
                return Some("roots");
            }
        }
        before += 1 << (2 * found.0 + found.1);
    }
    if r.sums[r.triangles.len()] != [before, 0] {
        return Some("sums");
    }
    let registrations: Vec<(u64, u32)> =
        r.keys.iter().zip(&r.registered).map(|(&k, &t)| (k.into(), t)).collect();
    let marks = twin::subdivision::cells_mark(&registrations, &r.roots);
    if !marks.iter().map(|&m| u32::from(m)).eq(r.marks.iter().copied()) {
        return Some("marks");
    }
    let kept: Vec<(u32, u32, f32)> = (0..marks.len())
        .filter(|&k| marks[k])
        .map(|k| (r.keys[k], r.roots[r.registered[k] as usize]))
        .map(|(key, root)| (key, root, r.spheres[root as usize][3]))
        .collect();
    let entries = r.entries.iter().map(|e| (e.key, e.triangle, e.radius));
    (!entries.eq(kept)).then_some("entries")
}

/// Loose triangles of which some are large and some fast.
fn mixed(n: usize, random: &mut Random) -> (CollisionMesh, Vec<Vec3>, Vec<Vec3>) {
    let (mesh, mut x_t0, mut x_t1) = scene(n, random);
    for t in (0..n).step_by(20) {
        for v in 3 * t..3 * t + 3 {
            let (by, along) = (random.vector(0.3), Vec3::new(0.7, 0.1 * t as f64 / n as f64, 0.0));
            x_t0[v] += by;
            x_t1[v] += if t % 40 == 0 { by } else { by * 0.1 + along };
        }
    }
    (mesh, x_t0, x_t1)
}

#[test]
fn subdivision_matches_its_twins() {
    for options in variants() {
        let Some(device) = device(options) else { return };
        let mut random = Random(12);
        for n in [1, 2, 255, 256, 257, 500] {
            let (mesh, x_t0, x_t1) = mixed(n, &mut random);
            for mode in [Mode::Continuous, Mode::Discrete] {
                let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.001, mode, active: None };
                let got = run_parts(&device.gpu, &mesh, &query, 1 << 15);
                assert_eq!(part_difference(&got), None, "{n}, {mode:?}");
                assert!(n < 100 || got.balls.len() > n + 100, "{} parts", got.balls.len());
                assert!(n < 100 || got.entries.len() < got.keys.len());
            }
        }
    }
}

type PartFault = fn(&mut Parts);

#[test]
fn planted_faults_of_the_subdivision_are_caught() {
    let Some(device) = device(variants()[0]) else { return };
    let (mesh, x_t0, x_t1) = mixed(500, &mut Random(13));
    let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.0, mode: Mode::Continuous, active: None };
    let good = run_parts(&device.gpu, &mesh, &query, 1 << 15);
    assert_eq!(part_difference(&good), None);
    let faults: [(&str, PartFault); 8] = [
        ("grid", |r| r.grid[0].size *= 1.001),
        ("plans", |r| r.plans[0] += 1),
        ("sums", |r| r.sums[1][0] += 1),
        ("parts", |r| r.balls[10][0] += 1e-4),
        ("roots", |r| r.roots[0] = 1),
        ("marks", |r| r.marks[5] ^= 1),
        ("entries", |r| r.entries[5].triangle ^= 1),
        ("entries", |r| r.entries.truncate(r.entries.len() - 1)),
    ];
    for (stage, fault) in faults {
        let mut bad = good.clone();
        fault(&mut bad);
        assert_eq!(part_difference(&bad), Some(stage));
    }
}
