//! Primitives on the device that `GpuOptions::default()` opens, over sizes: seconds on the device where it can tell, else until the
//! answer is back. Then tables: the stages on a folded sheet over sizes, and all methods on the published frames beside the
//! tree on the processor. `cargo bench --bench gpu -- stages`, `-- scenes`, `-- cloth-ball` and the like select. Without any adapter
//! nothing is measured.

#![allow(missing_docs, reason = "criterion's macros make public items")]
#![allow(clippy::unwrap_used, reason = "a bench that cannot start has nothing to measure")]
#![allow(clippy::print_stderr, reason = "a bench that measures nothing says so")]

use cloth_gpu::collision::mesh::{Vec3, generators};
use cloth_gpu::stages::{compact::Compact, scan::Scan, sort::Sort};
use cloth_gpu::{Array, Gpu, GpuOptions, Length, Recorder};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use std::time::{Duration, Instant};

#[path = "gpu/tables.rs"]
mod tables;

/// The last one on GPUs only.
const SIZES: [u32; 4] = [10_000, 100_000, 1_000_000, 10_000_000];

fn words(n: u32) -> Vec<u32> {
    (0..n).map(|i| i.wrapping_mul(2_654_435_761)).collect()
}

/// Time of one submission.
fn seconds(gpu: &Gpu, record: &mut dyn FnMut(&mut Recorder<'_>)) -> Duration {
    let mut recorder = Recorder::new(gpu);
    recorder.stage("all");
    record(&mut recorder);
    let start = Instant::now();
    let answer = recorder.run().unwrap();
    answer.seconds.first().map_or_else(|| start.elapsed(), |s| Duration::from_secs_f64(s.1))
}

fn primitives(c: &mut Criterion) {
    let gpu = match Gpu::new(GpuOptions::default()) {
        Ok(gpu) => gpu,
        Err(reason) => return eprintln!("nothing measured: {reason}"),
    };
    eprintln!("{}, subgroups: {}", gpu.description(), gpu.has_subgroups());
    if gpu.is_software() {
        eprintln!("a software adapter: a processor that plays a GPU; its times say nothing about a GPU");
    }
    let array = |data: &[u32]| Array::with(&gpu, "bench", data).unwrap();
    for n in SIZES.into_iter().take(if gpu.is_software() { 3 } else { 4 }) {
        let (input, flags) = (words(n), words(n).iter().map(|w| w >> 31).collect::<Vec<_>>());
        let (keys, high, values, flags) = (array(&input), array(&input), array(&input), array(&flags));
        let output = Array::<u32>::new(&gpu, "bench", n as usize + 1).unwrap();
        let wide = Array::<[u32; 2]>::new(&gpu, "bench", n as usize + 1).unwrap();
        let (mut scan, mut scan_wide) =
            (Scan::<u32>::new(&gpu).unwrap(), Scan::<[u32; 2]>::new(&gpu).unwrap());
        let (mut sort, mut compact) = (Sort::new(&gpu).unwrap(), Compact::new(&gpu).unwrap());
        let n_host = Length::host(n);
        let mut group = c.benchmark_group("gpu");
        group.sample_size(10).throughput(Throughput::Elements(n.into()));
        let mut bench = |name: &str, record: &mut dyn FnMut(&mut Recorder<'_>)| {
            group.bench_function(BenchmarkId::new(name, n), |b| {
                b.iter_custom(|times| (0..times).map(|_| seconds(&gpu, record)).sum());
            });
        };
        bench("scan", &mut |r| scan.record(r, &keys, n_host, &output).unwrap());
        bench("scan into 64 bits", &mut |r| scan_wide.record(r, &keys, n_host, &wide).unwrap());
        bench("compaction", &mut |r| {
            compact.record(r, &flags, &values, n_host, &output, &high).unwrap();
        });
        // What is sorted stays sorted: the passes do the same work on any order.
        bench("sort, 32 bits", &mut |r| sort.record(r, &keys, &values, n_host, 32).unwrap());
        bench("sort, 64 bits", &mut |r| sort.record_wide(r, &keys, &high, &values, n_host, 64).unwrap());
    }
}

/// A 2 m sheet of n × n vertices, folded, its layers 3 mm apart and with waves; it moves on by a few centimetres.
fn folded(n: usize) -> (Vec<[u32; 3]>, Vec<Vec3>, Vec<Vec3>) {
    let sheet = generators::grid(2.0, 2.0, n, n).unwrap();
    let fold = |p: &Vec3| {
        let wave = 0.01 * (12.0 * p.z).sin() * (9.0 * p.x.abs()).cos();
        let upper = if p.x > 0.0 { 0.003 } else { 0.0 };
        Vec3::new(p.x.abs() + 0.0013 * p.z, upper + wave, p.z + 0.0007 * p.x)
    };
    let x_t0: Vec<Vec3> = sheet.vertices.iter().map(fold).collect();
    let moved = |p: &Vec3| p + Vec3::new(0.01, -0.03, 0.002 * (20.0 * p.x).sin());
    let x_t1 = x_t0.iter().map(moved).collect();
    (sheet.triangles, x_t0, x_t1)
}

fn tables(_: &mut Criterion) {
    let Ok(gpu) = Gpu::new(GpuOptions::default()) else { return };
    tables::stages(&gpu);
    tables::scenes(&gpu);
}

criterion_group!(benches, primitives, tables);
criterion_main!(benches);
