//! A device or a reason to skip, and seeded numbers, shared by the tests.
#![allow(dead_code, reason = "each test binary uses its part")]
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]
#![allow(clippy::print_stderr, reason = "a skipped test says so")]

pub(crate) mod npz;

use bytemuck::Pod;
use cloth_gpu::collision::{Body, BruteForce, CollisionMesh, Contacts, Detector, Query, Vec3};
use cloth_gpu::{Array, Gpu, GpuError, GpuOptions, Recorder};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

/// A device that no other test of this binary uses meanwhile.
pub(crate) struct Device {
    pub(crate) gpu: Arc<Gpu>,
    _turn: MutexGuard<'static, ()>,
}

/// A device; without any adapter None, with the reason on the standard error stream. With `CLOTHSIM_REQUIRE_GPU=1` a
/// missing adapter is a failure.
pub(crate) fn device(options: GpuOptions) -> Option<Device> {
    let turn = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    match Gpu::new(options) {
        Ok(gpu) => Some(Device { gpu, _turn: turn }),
        Err(reason @ GpuError::NoAdapter { .. })
            if std::env::var("CLOTHSIM_REQUIRE_GPU").is_ok_and(|v| v == "1") =>
        {
            panic!("CLOTHSIM_REQUIRE_GPU=1, but {reason}")
        }
        Err(reason @ GpuError::NoAdapter { .. }) => {
            eprintln!("skipped: {reason}");
            None
        }
        Err(reason) => panic!("{reason}"),
    }
}

/// With subgroup operations, without, with every dispatch folded to two dimensions, and without wgpu's guards.
pub(crate) fn variants() -> [GpuOptions; 4] {
    let plain = GpuOptions::default();
    [
        plain,
        GpuOptions { subgroups: false, ..plain },
        GpuOptions { max_workgroups_per_dimension: Some(24), ..plain },
        GpuOptions { shader_checks: false, ..plain },
    ]
}

/// Copies an array back.
pub(crate) fn whole<T: Pod>(recorder: &mut Recorder<'_>, array: &Array<T>) -> usize {
    recorder.download(array, 0..array.capacity())
}

/// The first n elements.
pub(crate) fn first<T>(mut list: Vec<T>, n: usize) -> Vec<T> {
    assert!(n <= list.len(), "{n} in {}", list.len());
    list.truncate(n);
    list
}

/// SplitMix64.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    /// Uniform in [0, 1).
    pub(crate) fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }
    pub(crate) fn within(&mut self, half: f64) -> f64 {
        (2.0 * self.unit() - 1.0) * half
    }
    pub(crate) fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }
    pub(crate) fn vector(&mut self, half: f64) -> Vec3 {
        Vec3::new(self.within(half), self.within(half), self.within(half))
    }
}

pub(crate) fn pool(threads: usize) -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap()
}

/// A wavy n × n sheet of unit size.
pub(crate) fn sheet(n: usize, random: &mut Random) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let phase = random.within(3.0);
    let mut vertices = Vec::new();
    for j in 0..n {
        for i in 0..n {
            let (u, v) = (i as f64 / (n - 1) as f64, j as f64 / (n - 1) as f64);
            vertices.push(Vec3::new(u, 0.2 * (7.0 * u + phase).sin() * (5.0 * v).cos(), v));
        }
    }
    let mut triangles = Vec::new();
    for j in 0..n as u32 - 1 {
        for i in 0..n as u32 - 1 {
            let a = j * n as u32 + i;
            let (b, c, d) = (a + 1, a + n as u32, a + n as u32 + 1);
            triangles.extend([[a, c, b], [b, c, d]]);
        }
    }
    (vertices, triangles)
}

/// Loose triangles about a unit cube; some vertices are shared.
pub(crate) fn soup(count: usize, size: f64, random: &mut Random) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let (mut vertices, mut triangles): (Vec<Vec3>, Vec<[u32; 3]>) = (vec![], vec![]);
    for _ in 0..count {
        let centre = random.vector(0.5);
        let first = vertices.len() as u32;
        let mut corners = [first, first + 1, first + 2];
        vertices.extend([(); 3].map(|()| centre + random.vector(size)));
        if first > 0 && random.below(3) == 0 {
            corners[0] = random.below(first as usize) as u32;
        }
        triangles.push(corners);
    }
    (vertices, triangles)
}

/// Each vertex moved by at most `by` along each axis.
pub(crate) fn moved(x: &[Vec3], by: f64, random: &mut Random) -> Vec<Vec3> {
    x.iter().map(|x| x + random.vector(by)).collect()
}

/// Dynamic and static bodies, with and without self-collision, some vertices attached.
pub(crate) fn bodies(random: &mut Random) -> (CollisionMesh, Vec<Vec3>) {
    let kinds = [(true, true), (true, false), (false, false), (false, true), (false, false)];
    let parts: Vec<(Vec<Vec3>, Vec<[u32; 3]>)> = kinds.iter().map(|_| soup(12, 0.3, random)).collect();
    let list: Vec<(Body, usize, &[[u32; 3]])> = kinds
        .iter()
        .zip(&parts)
        .map(|(&(dynamic, self_collision), (v, t))| (Body { dynamic, self_collision }, v.len(), t.as_slice()))
        .collect();
    let mut mesh = CollisionMesh::new(&list).unwrap();
    for _ in 0..6 {
        let vertex = random.below(parts[0].0.len()) as u32;
        mesh.set_attachment(vertex, 1 + random.below(4) as u32);
    }
    (mesh, parts.into_iter().flat_map(|p| p.0).collect())
}

/// Asks each method twice, then with the room of the first time, an octree three times, whose levels adapt; compares with brute force;
/// returns the contacts' number, once for each method.
pub(crate) fn agree<'m, D: Detector + ?Sized + 'm>(
    methods: impl IntoIterator<Item = &'m mut D>,
    mesh: &CollisionMesh,
    query: &Query<'_>,
    what: &str,
) -> usize {
    let pool = pool(2);
    let expected = BruteForce.detect(mesh, query, &pool).unwrap();
    let mut found = 0;
    for method in methods {
        let turns = if method.name().starts_with("octree") { 3 } else { 2 };
        for turn in 0..turns {
            let got = method.detect(mesh, query, &pool).unwrap();
            assert_eq!(difference(&expected, &got), None, "{}, {what}, {turn}", method.name());
            assert!(got.stats.candidates_edge_edge >= got.edge_edge.len() as u64);
        }
        found += expected.vertex_triangle.len() + expected.edge_edge.len();
    }
    found
}

/// None if the contacts are equal, pairs and times; else what differs.
pub(crate) fn difference(a: &Contacts, b: &Contacts) -> Option<String> {
    for (what, p, q) in [
        ("vertex-triangle", &a.vertex_triangle, &b.vertex_triangle),
        ("edge-edge", &a.edge_edge, &b.edge_edge),
    ] {
        if p != q {
            let only = |p: &Vec<[u32; 2]>, q: &Vec<[u32; 2]>| p.iter().find(|x| !q.contains(x)).copied();
            return Some(format!(
                "{what}: {} and {}, only first {:?}, only second {:?}",
                p.len(),
                q.len(),
                only(p, q),
                only(q, p)
            ));
        }
    }
    if a.time_vertex_triangle != b.time_vertex_triangle || a.time_edge_edge != b.time_edge_edge {
        return Some("times".to_owned());
    }
    None
}
