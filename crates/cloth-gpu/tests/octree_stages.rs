//! Each stage of the octree on the device equals its twin, given the same input.
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

mod support;

use cloth_gpu::collision::{CollisionMesh, Mode, Query, Vec3};
use cloth_gpu::layout::{Bounds, Entry, OctreeParams};
use cloth_gpu::limits::{WORKGROUP, status};
use cloth_gpu::stages::bounds::Scene;
use cloth_gpu::stages::octree::{Levels, Octree, nodes, params};
use cloth_gpu::stages::pairs::Pairs;
use cloth_gpu::twin::octree::{
    Place, Range, Registration, cell_number, cell_place, octree_counts, octree_gather, octree_leaf,
    octree_pairs, octree_ranges, octree_register, octree_tree, octree_visits, pack, tests_of,
};
use cloth_gpu::twin::pairs::SPHERE_FACTOR;
use cloth_gpu::{Frame, Gpu, Recorder};
use support::{Random, device, first, pool, soup, variants, whole};

/// The spheres' distances may differ by the rounding of a few operations.
const ROUNDING: f32 = 1e-6;
/// Room for visits, registrations and pairs, in as many workgroups as the smallest variant takes.
const ROOM: usize = 1 << 15;
/// One test per invocation and turn.
const TESTS: u32 = 1 << 20;

/// What every stage of one run left on the device.
#[derive(Clone)]
struct Run {
    params: OctreeParams,
    bounds: Vec<Bounds>,
    spheres: Vec<[f32; 4]>,
    ranges: Vec<[u32; 2]>,
    offsets: Vec<[u32; 2]>,
    counts: Vec<u32>,
    firsts: Vec<u32>,
    members: Vec<u32>,
    selected: Vec<u32>,
    costs: Vec<[u32; 2]>,
    types: Vec<u32>,
    kinds: Vec<u32>,
    leaves: Vec<u32>,
    keys: Vec<u32>,
    registered: Vec<u32>,
    entries: Vec<Entry>,
    tally: Vec<u32>,
    tests: u64,
    pairs: Vec<[u32; 2]>,
}

fn wide([low, high]: [u32; 2]) -> u64 {
    u64::from(low) | u64::from(high) << 32
}

fn run(gpu: &Gpu, mesh: &CollisionMesh, query: &Query<'_>, levels: Levels, is_two_stage: bool) -> Run {
    let frame = Frame::new(query, &pool(1));
    let n = mesh.triangles.len();
    let mut scene = Scene::new(gpu, mesh).unwrap();
    scene.upload(gpu, query, &frame);
    let mut octree = Octree::new(gpu, n as u32, ROOM, is_two_stage).unwrap();
    let mut pairs = Pairs::new(gpu, ROOM, false).unwrap();
    let mut recorder = Recorder::new(gpu);
    scene.record(&mut recorder);
    octree.record(&mut recorder, &scene, frame.reach(), levels).unwrap();
    pairs.record_counts(&mut recorder, octree.entries()).unwrap();
    pairs.record_tests(&mut recorder, &scene, octree.entries(), 0, TESTS).unwrap();
    let r = &mut recorder;
    let copies = [
        whole(r, &scene.bounds),
        whole(r, &scene.spheres),
        whole(r, &scene.status),
        whole(r, &octree.ranges),
        whole(r, &octree.offsets),
        whole(r, &octree.counts),
        whole(r, &octree.firsts),
        whole(r, &octree.members),
        whole(r, &octree.costs),
        whole(r, &octree.types),
        whole(r, &octree.kinds),
        whole(r, &octree.leaves),
        whole(r, &octree.sums),
        whole(r, &octree.keys),
        whole(r, &octree.registered),
        whole(r, &octree.entries),
        whole(r, &octree.tally),
        whole(r, &pairs.found),
        whole(r, &octree.selected),
        whole(r, &octree.selected_before),
    ];
    let answer = recorder.run().unwrap();
    let words: Vec<u32> = answer.read(copies[2]);
    let params = params(&scene.params, frame.reach(), levels, octree.room(), is_two_stage);
    let (pages, nodes) = (1 << (3 * params.page), nodes(params.page));
    let offsets = first(answer.read::<[u32; 2]>(copies[4]), n + 1);
    let sums = first(answer.read::<[u32; 2]>(copies[12]), octree.room() as usize + 1);
    let (visits, registrations) = (wide(offsets[n]) as usize, wide(*sums.last().unwrap()) as usize);
    let trees = answer.read::<u32>(copies[19])[pages] as usize;
    let tests = wide([words[status::PAIRS as usize], words[status::PAIRS as usize + 1]]);
    assert!(tests < TESTS.into(), "{tests} tests: all in one part");
    Run {
        params,
        bounds: first(answer.read(copies[0]), n),
        spheres: first(answer.read(copies[1]), n),
        ranges: first(answer.read(copies[3]), n),
        offsets,
        counts: first(answer.read(copies[5]), nodes),
        firsts: first(answer.read(copies[6]), pages + 1),
        members: first(answer.read(copies[7]), visits),
        selected: first(answer.read(copies[18]), trees),
        costs: first(answer.read(copies[8]), nodes),
        types: first(answer.read(copies[9]), 3 * pages),
        kinds: first(answer.read(copies[10]), nodes),
        leaves: first(answer.read(copies[11]), pages),
        keys: first(answer.read(copies[13]), registrations),
        registered: first(answer.read(copies[14]), registrations),
        entries: first(answer.read(copies[15]), registrations),
        tally: answer.read(copies[16]),
        tests,
        pairs: first(answer.read(copies[17]), words[status::TRIANGLE_PAIRS as usize] as usize),
    }
}

fn sorted<T: Ord>(mut list: Vec<T>) -> Vec<T> {
    list.sort_unstable();
    list
}

/// Where a level begins in the dense trees.
fn start(page: u32, level: u32) -> usize {
    nodes(page) - nodes(level)
}

/// Bit of a cell in the types of its page.
fn type_bit(p: &OctreeParams, types: &[u32], level: u32, place: Place) -> bool {
    let below = level - p.page;
    let page = cell_number(p.page, place.map(|x| x >> below)) as usize;
    let within = place.map(|x| x & ((1 << below) - 1));
    let bit = ((1usize << (3 * below)) - 1) / 7 + cell_number(below, within) as usize;
    types[3 * page + bit / 32] >> (bit % 32) & 1 != 0
}

/// The first stage that differs from its twin; None if all agree.
fn difference(r: &Run) -> Option<&'static str> {
    let p = &r.params;
    let ranges = octree_ranges(p, &r.bounds);
    if !ranges.iter().map(|range: &Range| range.map(pack)).eq(r.ranges.iter().copied()) {
        return Some("ranges");
    }
    let visits = octree_visits(p, &ranges);
    let before = |t: usize| visits.partition_point(|v| (v.0 as usize) < t) as u64;
    if !(0..=ranges.len()).all(|t| wide(r.offsets[t]) == before(t)) {
        return Some("offsets");
    }
    for level in 0..=p.page {
        let (from, cells) = (start(p.page, level), 1 << (3 * level));
        let expected =
            if level >= p.top.min(p.page) { octree_counts(p, &ranges, level) } else { vec![0; cells] };
        if expected != r.counts[from..from + cells] {
            return Some("counts");
        }
    }
    let pages = r.leaves.len();
    let placed: Vec<(u32, u32)> = (0..pages)
        .flat_map(|page| {
            let members = r.firsts[page] as usize..r.firsts[page + 1] as usize;
            members.map(move |m| (page as u32, r.members.get(m).copied().unwrap_or(u32::MAX)))
        })
        .collect();
    if sorted(placed) != sorted(visits.iter().map(|&(t, page)| (page, t)).collect()) {
        return Some("members");
    }
    let members = |page: &u32| r.counts[*page as usize];
    let has_tree =
        |page: &u32| p.base > p.page && (members(page) > 1 || (members(page) == 1 && p.top > p.page));
    if !(0..pages as u32).filter(has_tree).eq(r.selected.iter().copied()) {
        return Some("selected");
    }
    let tree = octree_tree(p, &ranges, tests_of);
    for level in p.page..p.base {
        let is_right = |cell: u32| {
            let place = cell_place(level, cell);
            let page = cell_number(p.page, place.map(|x| x >> (level - p.page))) as usize;
            let is_divided = if level < p.top {
                r.counts[page] > 0
            } else {
                tree.is_divided[level as usize][cell as usize]
            };
            type_bit(p, &r.types, level, place) == is_divided
        };
        if !(0..1 << (3 * level)).all(is_right) {
            return Some("types");
        }
    }
    for level in p.top..=p.page {
        let (from, cells) = (start(p.page, level), 1usize << (3 * level));
        let is_right = |cell: usize| {
            wide(r.costs[from + cell]) == tree.costs[level as usize][cell]
                && (level == p.page || (r.kinds[from + cell] != 0) == tree.is_divided[level as usize][cell])
        };
        if !(0..cells).all(is_right) {
            return Some("bottom-up");
        }
    }
    let depth = p.base - p.page;
    let is_right = |page: usize| {
        let corner = cell_place(p.page, page as u32).map(|x| x << depth);
        r.leaves[page] == octree_leaf(p, &tree, corner).min(p.page)
    };
    if !(0..pages).all(is_right) {
        return Some("top-down");
    }
    let registrations = octree_register(p, &ranges, &tree);
    let got: Vec<Registration> = r
        .keys
        .iter()
        .zip(&r.registered)
        .map(|(&key, &word)| Registration { key, triangle: word & 0x0fff_ffff, level: p.base - (word >> 28) })
        .collect();
    if registrations != got {
        return Some("registrations");
    }
    let (entries, tally) = octree_gather(p, &registrations, &ranges, &r.spheres);
    if entries != r.entries {
        return Some("entries");
    }
    if tally != r.tally {
        return Some("tally");
    }
    let leaves = entries.chunk_by(|a, b| a.key == b.key);
    if leaves.map(|leaf| tests_of(leaf.len() as u32)).sum::<u64>() != r.tests {
        return Some("tests");
    }
    let tests = |factor| sorted(octree_pairs(&r.entries, &r.bounds, true, factor));
    let (least, most, found) =
        (tests(SPHERE_FACTOR - ROUNDING), tests(SPHERE_FACTOR + ROUNDING), sorted(r.pairs.clone()));
    let is_within = |a: &[[u32; 2]], b: &[[u32; 2]]| a.iter().all(|p| b.binary_search(p).is_ok());
    let is_right =
        is_within(&least, &found) && is_within(&found, &most) && found.windows(2).all(|w| w[0] != w[1]);
    (!is_right).then_some("triangle pairs")
}

/// Loose triangles in motion, most of them small and about one corner, some large.
fn scene(n: usize, random: &mut Random) -> (CollisionMesh, Vec<Vec3>, Vec<Vec3>) {
    let size = 0.4 / (n as f64).cbrt();
    let (mut x_t0, mut triangles) = soup(n, size, random);
    for (t, corners) in triangles.iter_mut().enumerate() {
        corners[0] = 3 * t as u32;
        if t % 3 > 0 {
            for v in *corners {
                x_t0[v as usize] *= 0.2;
            }
        }
        if t % 50 == 7 {
            x_t0[corners[1] as usize] += Vec3::new(0.3, 0.4, -0.5);
        }
    }
    let x_t1 = x_t0.iter().map(|x| x + random.vector(0.2 * size)).collect();
    (CollisionMesh::single(x_t0.len(), &triangles).unwrap(), x_t0, x_t1)
}

const LEVELS: [Levels; 7] = [
    Levels { top: 0, base: 0 },
    Levels { top: 0, base: 1 },
    Levels { top: 0, base: 3 },
    Levels { top: 0, base: 6 },
    Levels { top: 2, base: 5 },
    Levels { top: 4, base: 5 },
    Levels { top: 5, base: 5 },
];

#[test]
fn stages_match_their_twins() {
    let w = WORKGROUP as usize;
    for (k, options) in variants().into_iter().enumerate() {
        let Some(device) = device(options) else { return };
        let mut random = Random(1);
        let (sizes, levels) = if k == 0 {
            (vec![1, 2, w - 1, w, w + 1, 3 * w + 77], &LEVELS[..])
        } else {
            (vec![2, 3 * w + 77], &LEVELS[3..5])
        };
        for n in sizes {
            let (mesh, x_t0, x_t1) = scene(n, &mut random);
            for (k, &levels) in levels.iter().enumerate() {
                let mode = if k % 2 == 0 { Mode::Discrete } else { Mode::Continuous };
                for is_two_stage in [true, false] {
                    let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.001, mode, active: None };
                    let got = run(&device.gpu, &mesh, &query, levels, is_two_stage);
                    assert_eq!(difference(&got), None, "{n}, {levels:?}, {is_two_stage}");
                    assert!(n < 500 || !got.pairs.is_empty());
                }
            }
        }
    }
}

type Fault = fn(&mut Run);

#[test]
fn planted_faults_are_caught() {
    let Some(device) = device(variants()[0]) else { return };
    let (mesh, x_t0, x_t1) = scene(500, &mut Random(4));
    let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.0, mode: Mode::Continuous, active: None };
    let good = run(&device.gpu, &mesh, &query, Levels { top: 1, base: 5 }, true);
    assert_eq!(difference(&good), None);
    assert!(good.kinds.contains(&1) && good.leaves.contains(&2) && good.types.iter().any(|&t| t > 1));
    let faults: [(&str, Fault); 18] = [
        ("ranges", |r| r.ranges[3][0] += 1),
        ("offsets", |r| r.offsets[9][0] += 1),
        ("counts", |r| r.counts[1] += 1),
        ("counts", |r| *r.counts.last_mut().unwrap() += 1),
        ("members", |r| r.members[5] ^= 1),
        ("members", |r| r.firsts[7] += 1),
        ("selected", |r| r.selected.truncate(3)),
        ("types", |r| r.types[0] ^= 1),
        ("types", |r| r.types[2] ^= 1 << 5),
        ("bottom-up", |r| r.costs[0][0] += 1),
        ("bottom-up", |r| r.kinds[start(2, 1)] ^= 1),
        ("top-down", |r| r.leaves[3] ^= 1),
        ("registrations", |r| r.keys[50] ^= 2),
        ("registrations", |r| r.registered.rotate_left(1)),
        ("entries", |r| r.entries[20].control ^= 1),
        ("tally", |r| r.tally[3] += 1),
        ("tests", |r| r.tests += 1),
        ("triangle pairs", |r| r.pairs.push(r.pairs[0])),
    ];
    for (stage, fault) in faults {
        let mut bad = good.clone();
        fault(&mut bad);
        assert_eq!(difference(&bad), Some(stage));
    }
}
