//! Seeded random scenes and pools, shared by the tests.
#![allow(dead_code, reason = "each test binary uses its part")]
#![allow(clippy::unwrap_used, reason = "a failed set-up is a failed test")]

use cloth_collision::{Body, CollisionMesh, Vec3};

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
    pub(crate) fn vector(&mut self, half: f64) -> Vec3 {
        Vec3::new(self.within(half), self.within(half), self.within(half))
    }
    pub(crate) fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
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

/// Frames along a path, each step starting where the last one ended.
pub(crate) fn along(count: usize, position: impl Fn(usize) -> Vec<Vec3>) -> Vec<[Vec<Vec3>; 2]> {
    (0..count).map(|k| [position(k), position(k + 1)]).collect()
}

/// Two sheets of unit size, one above the other; the upper one rests on the lower one's waves.
pub(crate) fn layers(n: usize, random: &mut Random) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let (mut x, mut triangles) = sheet(n, random);
    let (count, lower) = (x.len() as u32, triangles.clone());
    x.extend_from_within(..);
    for v in &mut x[count as usize..] {
        v.y += 0.015;
        v.x += 0.3 / n as f64;
    }
    triangles.extend(lower.iter().map(|t| t.map(|v| v + count)));
    (x, triangles)
}

/// A coherent motion: waves that travel through the layers, and a slow drift.
pub(crate) fn waves(x: &[Vec3], speed: f64) -> impl Fn(usize) -> Vec<Vec3> + '_ {
    move |k| {
        let time = speed * k as f64;
        let wave = |p: &Vec3| {
            Vec3::new(0.2 * time, 0.01 * (9.0 * p.x + 40.0 * time).sin() * (7.0 * p.z).cos(), 0.1 * time)
        };
        x.iter().enumerate().map(|(v, p)| p + wave(p) * if v % 2 == 0 { 1.0 } else { 1.1 }).collect()
    }
}
