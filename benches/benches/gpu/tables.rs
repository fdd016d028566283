//! Stages and methods side by side, as tables: seconds by stage and counts of work.

use super::folded;
use cloth_gpu::collision::mesh::Vec3;
use cloth_gpu::collision::{Bvh, CollisionMesh, Contacts, Detector, Mode, Query};
use cloth_gpu::{Distribution, Duplicates, Gpu, GridGpu, GridOptions, OctreeGpu};
use std::sync::Arc;
use std::time::Instant;

#[path = "../../../crates/cloth-gpu/tests/support/npz.rs"]
mod npz;

/// Sides of the folded sheet [vertices]: 2,048, 25,088 and 100,352 triangles.
const SIDES: [usize; 3] = [33, 113, 225];
/// Tests beyond which a software adapter takes minutes.
const MANY_TRIANGLES: usize = 100_000;

/// Whether the command line asks for what has this name, or for nothing in particular.
fn is_wanted(name: &str) -> bool {
    // Numbers are the values of options.
    let is_filter = |a: &String| !a.starts_with('-') && a.parse::<f64>().is_err();
    let mut filters = std::env::args().skip(1).filter(is_filter).peekable();
    filters.peek().is_none() || filters.any(|f| name.contains(&f))
}

type Frames = (Vec<[u32; 3]>, Vec<Vec3>, Vec<Vec3>);

/// A published pair of frames; None, with the reason, where it is not.
fn published(name: &str) -> Option<Frames> {
    let folder = std::env::var("CLOTHSIM_DATA")
        .unwrap_or_else(|_| format!("{}/../../shared/data", env!("CARGO_MANIFEST_DIR")));
    let path = format!("{folder}/ccd/{name}.npz");
    let Ok(archive) = std::fs::read(&path) else {
        eprintln!("{name}: skipped, no file {path}");
        return None;
    };
    let positions = |member: &str| {
        let rows = npz::rows(&npz::array(&archive, member).unwrap(), f64::from_le_bytes);
        rows.into_iter().map(Vec3::from).collect()
    };
    let triangles = npz::rows(&npz::array(&archive, "F.npy").unwrap(), u32::from_le_bytes);
    Some((triangles, positions("V0.npy"), positions("V1.npy")))
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// The last of some runs after a first one, with the medians of all seconds; those of the whole call first.
fn measured(
    detector: &mut dyn Detector,
    mesh: &CollisionMesh,
    query: &Query<'_>,
    runs: usize,
) -> (Contacts, Vec<(&'static str, f64)>) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    let mut found = detector.detect(mesh, query, &pool).unwrap();
    let mut seconds: Vec<(&'static str, Vec<f64>)> = vec![("all", vec![])];
    for _ in 0..runs {
        let clock = Instant::now();
        found = detector.detect(mesh, query, &pool).unwrap();
        seconds[0].1.push(clock.elapsed().as_secs_f64());
        for &(name, s) in &found.stats.seconds {
            match seconds.iter_mut().find(|entry| entry.0 == name) {
                Some(entry) => entry.1.push(s),
                None => seconds.push((name, vec![s])),
            }
        }
    }
    (found, seconds.into_iter().map(|(name, values)| (name, median(values))).collect())
}

fn print(what: &str, found: &Contacts, seconds: &[(&'static str, f64)]) {
    let ms = |s: &(&'static str, f64)| format!("{} {:.3}", s.0, 1e3 * s.1);
    let s = &found.stats;
    let counts: Vec<String> = s.counts.iter().map(|(name, count)| format!("{name} {count}")).collect();
    eprintln!("{what}");
    eprintln!("    ms: {}", seconds.iter().map(ms).collect::<Vec<_>>().join(", "));
    eprintln!(
        "    tests {}, triangle pairs {}, candidates {} + {}, contacts {} + {}, {}",
        s.broad_phase_tests,
        s.leaf_pairs,
        s.candidates_vertex_triangle,
        s.candidates_edge_edge,
        found.vertex_triangle.len(),
        found.edge_edge.len(),
        counts.join(", "),
    );
}

fn methods(gpu: &Arc<Gpu>, mesh: &CollisionMesh, x: &[Vec3]) -> Vec<(&'static str, Box<dyn Detector>)> {
    let parts = GridOptions { subdivision: Some(1.2), ..GridOptions::default() };
    let with = |options| -> Box<dyn Detector> {
        Box::new(GridGpu::with_options(gpu.clone(), mesh, options).unwrap())
    };
    vec![
        ("bvh on the processor, 2 threads", Box::new(Bvh::new(mesh, x).unwrap())),
        ("grid", with(GridOptions::default())),
        ("virtual subdivision", with(parts)),
        ("octree, single", Box::new(OctreeGpu::single(gpu.clone(), mesh).unwrap())),
        ("octree", Box::new(OctreeGpu::new(gpu.clone(), mesh).unwrap())),
        (
            "virtual subdivision, segmented scan",
            with(GridOptions { distribution: Distribution::SegmentedScan, ..parts }),
        ),
        ("virtual subdivision, all duplicates", with(GridOptions { duplicates: Duplicates::All, ..parts })),
        ("virtual subdivision, no 18-DOPs", with(GridOptions { dops: false, ..parts })),
        ("virtual subdivision, no filter", with(GridOptions { device_filter: false, ..parts })),
    ]
}

/// Seconds of each stage over sizes.
pub(crate) fn stages(gpu: &Arc<Gpu>) {
    if !is_wanted("stages") {
        return;
    }
    for side in SIDES {
        let (triangles, x_t0, x_t1) = folded(side);
        let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
        let query =
            Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.004, mode: Mode::Continuous, active: None };
        for (name, detector) in &mut methods(gpu, &mesh, &x_t0)[1..5] {
            let (found, seconds) = measured(detector.as_mut(), &mesh, &query, 3);
            print(&format!("stages: {name}, {} triangles", triangles.len()), &found, &seconds);
        }
    }
}

/// All methods on the published frames.
pub(crate) fn scenes(gpu: &Arc<Gpu>) {
    for scene in ["cloth-ball", "cloth-funnel", "n-body-simulation"] {
        if !is_wanted(&format!("scenes {scene}")) {
            continue;
        }
        let Some((triangles, x_t0, x_t1)) = published(scene) else { continue };
        let mesh = CollisionMesh::single(x_t0.len(), &triangles).unwrap();
        let runs = if gpu.is_software() { 1 } else { 10 };
        for mode in [Mode::Continuous, Mode::Discrete] {
            let query = Query { x_t0: &x_t0, x_t1: &x_t1, thickness: 0.0, mode, active: None };
            for (name, mut detector) in methods(gpu, &mesh, &x_t0) {
                if name == "grid" && gpu.is_software() && triangles.len() > MANY_TRIANGLES {
                    eprintln!("scenes: {scene}, {name}: skipped, minutes on a software adapter");
                    continue;
                }
                let (found, seconds) = measured(detector.as_mut(), &mesh, &query, runs);
                print(&format!("scenes: {scene}, {mode:?}, {name}"), &found, &seconds);
            }
        }
    }
}
