//! Detection over coherent sequences by every variant of the session, frame by frame in turn: seconds per stage and counts.
//!
//! `cargo run --release -p cloth-collision --example session -- [vertices per side] [frames] [thickness in mm] [threads]
//! [variant]`; with a variant alone, a profiler counts what that one does. `... -- sizes [threads]`: a draped ball from 17,000
//! to a million triangles, everything in proportion to the edges, and the exponent of the cost.

#![allow(clippy::unwrap_used, reason = "a measurement that cannot start has nothing to report")]
#![allow(clippy::print_stdout, reason = "the table is its result")]

#[path = "../../../benches/src/sequences.rs"]
#[allow(dead_code, unreachable_pub, reason = "a module of the benches")]
mod sequences;

use cloth_collision::{
    Detector, FrameKind, Frames, Mode, Query, SessionOptions, SessionStats, SkippingSession, Variant,
};
use sequences::{Sequence, draped_ball, folding, spinning_ball};
use std::time::Instant;

#[derive(Default)]
struct Sum {
    seconds: f64,
    update: f64,
    traversal: f64,
    elementary: f64,
    pending: u64,
    admissible: u64,
    colliding: u64,
    work: u64,
    skipping: u32,
    first: u32,
    dangling: u64,
    flat: u64,
    frames: u64,
}

impl Sum {
    fn add(&mut self, seconds: f64, stats: &SessionStats) {
        self.seconds += seconds;
        self.update += stats.update_seconds;
        self.traversal += stats.traversal_seconds;
        self.elementary += stats.elementary_seconds;
        self.pending += stats.pending;
        self.admissible += stats.admissible;
        self.colliding += stats.colliding;
        self.work += stats.work;
        self.skipping += u32::from(stats.kind == FrameKind::Skipping);
        self.first += u32::from(stats.kind == FrameKind::First);
        self.dangling += stats.dangling_triangles;
        self.flat += stats.flat_triangles;
        self.frames += u64::from(stats.frames);
    }
}

fn measure(name: &str, sequence: &Sequence, frames: u32, thickness: f64, threads: usize) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let fixed = |frames| SessionOptions {
        frames: Frames::Fixed { frames, alpha: None },
        ..SessionOptions::default()
    };
    let plain = |variant| SessionOptions { variant, ..SessionOptions::default() };
    let rows = [
        ("NoDup", plain(Variant::NoDup)),
        ("R-TRI", plain(Variant::RTri)),
        ("nSwD", plain(Variant::NSwD)),
        ("a1f2", fixed(2)),
        ("a3f4", fixed(4)),
        ("a7f8", fixed(8)),
        ("a15f16", fixed(16)),
        ("SwD", SessionOptions::default()),
        ("curved", SessionOptions { low_curvature: false, ..SessionOptions::default() }),
    ];
    let only = std::env::args().nth(5);
    let rows: Vec<_> = rows.into_iter().filter(|r| only.as_ref().is_none_or(|name| name == r.0)).collect();
    let x = sequence.rest.clone();
    let mesh = &sequence.mesh;
    let mut sessions: Vec<SkippingSession> =
        rows.iter().map(|r| SkippingSession::new(mesh, &x, r.1).unwrap()).collect();
    let mut sums: Vec<Sum> = rows.iter().map(|_| Sum::default()).collect();
    let mut x_t0 = sequence.at(0);
    for frame in 0..frames {
        let x_t1 = sequence.at(frame + 1);
        let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness, mode: Mode::Continuous, active: None };
        for (session, sum) in sessions.iter_mut().zip(&mut sums) {
            let start = Instant::now();
            session.detect(mesh, &query, &pool).unwrap();
            sum.add(start.elapsed().as_secs_f64(), session.stats());
        }
        x_t0 = x_t1;
    }
    let per_frame = f64::from(frames);
    println!("{name}: {} triangles, {frames} frames, {threads} threads, ms per frame", mesh.triangles.len());
    println!(
        "{:>10} {:>7} {:>6} {:>7} {:>7} {:>7} {:>6} {:>9} {:>9} {:>8} {:>8} {:>9} {:>7} {:>7} {:>5}",
        "",
        "total",
        "times",
        "BVHU",
        "BVHT",
        "ETP",
        "work",
        "pending",
        "admiss.",
        "collid.",
        "dangling",
        "flat",
        "first",
        "skip",
        "n_f"
    );
    for ((label, _), sum) in rows.iter().zip(&sums) {
        let ms = |seconds: f64| seconds * 1e3 / per_frame;
        let mean = |count: u64| count as f64 / per_frame;
        println!(
            "{label:>10} {:>7.2} {:>6.2} {:>7.2} {:>7.2} {:>7.2} {:>6.1} {:>9.0} {:>9.0} {:>8.0} {:>8.0} {:>9.0} {:>7} {:>7} {:>5.1}",
            ms(sum.seconds),
            sums[0].seconds / sum.seconds,
            ms(sum.update),
            ms(sum.traversal),
            ms(sum.elementary),
            mean(sum.work) * 1e-6,
            mean(sum.pending),
            mean(sum.admissible),
            mean(sum.colliding),
            mean(sum.dangling),
            mean(sum.flat),
            sum.first,
            sum.skipping,
            mean(sum.frames),
        );
    }
}

/// Vertices along a side of the coarsest cloth, and the subdivisions of its ball; each size has edges half as long.
const COARSEST: (usize, u32) = (76, 4);
const SIZES: u32 = 4;
const FRAMES: u32 = 24;

fn sizes(threads: usize) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    println!("draped ball, SwD, {FRAMES} frames, {threads} threads, means per frame");
    println!(
        "{:>10} {:>9} {:>14} {:>9} {:>10} {:>10} {:>21}",
        "triangles", "ms", "ns / triangle", "work", "admissible", "colliding", "colliding / triangle"
    );
    let mut points = vec![];
    for k in 0..SIZES {
        let shorter = f64::from(1u32 << k);
        let thickness = 0.003 / shorter;
        let sequence = draped_ball(COARSEST.0 << k, COARSEST.1 + k, 0.5 * thickness).unwrap();
        let (mesh, rest) = (&sequence.mesh, &sequence.rest);
        let at = |frame: u32| sequence.at_time(f64::from(frame) * 2.0 * sequences::DT / shorter);
        let mut session = SkippingSession::new(mesh, rest, SessionOptions::default()).unwrap();
        let mut sum = Sum::default();
        let mut x_t0 = at(0);
        for frame in 0..FRAMES {
            let x_t1 = at(frame + 1);
            let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness, mode: Mode::Continuous, active: None };
            let start = Instant::now();
            session.detect(mesh, &query, &pool).unwrap();
            sum.add(start.elapsed().as_secs_f64(), session.stats());
            x_t0 = x_t1;
        }
        let (triangles, frames) = (mesh.triangles.len() as f64, f64::from(FRAMES));
        let seconds = sum.seconds / frames;
        let [work, admissible, colliding] =
            [sum.work, sum.admissible, sum.colliding].map(|count| count as f64 / frames);
        let per_triangle = 1e9 * seconds / triangles;
        println!(
            "{triangles:>10} {:>9.2} {per_triangle:>14.1} {:>9.1} {admissible:>10.0} {colliding:>10.0} {:>21.3}",
            1e3 * seconds,
            1e-6 * work,
            colliding / triangles
        );
        points.push([triangles.ln(), seconds.ln(), work.ln()]);
    }
    println!("exponent by least squares: time {:.3}, work {:.3}", slope(&points, 1), slope(&points, 2));
}

/// Of a straight line through the points of column `k` over the first.
fn slope(points: &[[f64; 3]], k: usize) -> f64 {
    let mean = |k: usize| points.iter().map(|p| p[k]).sum::<f64>() / points.len() as f64;
    let (x, y) = (mean(0), mean(k));
    let (mut above, mut below) = (0.0, 0.0);
    for p in points {
        above += (p[0] - x) * (p[k] - y);
        below += (p[0] - x) * (p[0] - x);
    }
    above / below
}

fn main() {
    if std::env::args().nth(1).as_deref() == Some("sizes") {
        sizes(std::env::args().nth(2).map_or(1, |text| text.parse().unwrap()));
        return;
    }
    let number =
        |k: usize, default: f64| std::env::args().nth(k).map_or(default, |text| text.parse().unwrap());
    let (n, frames) = (number(1, 221.0) as usize, number(2, 60.0) as u32);
    let (thickness, threads) = (number(3, 1.0) * 1e-3, number(4, 1.0) as usize);
    measure("spinning ball", &spinning_ball(n).unwrap(), frames, thickness, threads);
    measure("folding", &folding(n).unwrap(), frames, thickness, threads);
}
