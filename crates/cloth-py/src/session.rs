//! Detection over a sequence of frames: `clothsim.collision.SkippingSession`, a frozen class over a lock.

use std::sync::{Mutex, PoisonError};

use cloth_sim::collision::mesh::Vec3;
use cloth_sim::collision::{
    Adapt, Body, CollisionMesh, DetectError, Detector, FrameKind, Frames, Query, SessionOptions,
    SessionStats, SkippingSession, Variant,
};
use numpy::IntoPyArray;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::ThreadPool;

use crate::collision::{Pairs, mode_from};
use crate::convert::{indices_to_numpy, triangles_from, vertices_from, vertices_into};
use crate::detach::{detached, pool};
use crate::errors::{detect_error, invalid_input};

/// Vertex count, dynamic, self-collision.
type BodyTuple = (usize, bool, bool);

/// The topology with its rules, and the detector for it, built with the first frame.
struct Built {
    mesh: CollisionMesh,
    session: SkippingSession,
}

struct State {
    options: SessionOptions,
    triangles: Vec<[u32; 3]>,
    bodies: Option<Vec<BodyTuple>>,
    rest: Option<Vec<Vec3>>,
    pool: ThreadPool,
    built: Option<Built>,
}

/// Detection that skips tree updates and traversals.
#[pyclass(frozen, module = "clothsim._core", name = "SkippingSession")]
pub(crate) struct PySkippingSession {
    state: Mutex<State>,
    /// Memory for the positions of both ends of a step.
    positions: Mutex<[Vec<Vec3>; 2]>,
}

#[pymethods]
impl PySkippingSession {
    #[new]
    #[pyo3(signature = (triangles, bodies, rest, variant, frames, alpha, first_frames, most_frames, beta, gamma, adapt,
        low_curvature, threads))]
    fn new(
        py: Python<'_>,
        triangles: &Bound<'_, PyAny>,
        bodies: Option<Vec<BodyTuple>>,
        rest: Option<&Bound<'_, PyAny>>,
        variant: &str,
        frames: Option<u32>,
        alpha: Option<f64>,
        first_frames: u32,
        most_frames: u32,
        beta: f64,
        gamma: f64,
        adapt: &str,
        low_curvature: bool,
        threads: Option<usize>,
    ) -> PyResult<Self> {
        let variant = match variant {
            "NoDup" => Variant::NoDup,
            "R-TRI" => Variant::RTri,
            "nSwD" => Variant::NSwD,
            "SwD" => Variant::SwD,
            other => {
                let expected = "one of \"NoDup\", \"R-TRI\", \"nSwD\", \"SwD\"";
                return Err(invalid_input(py, "variant", expected, &format!("\"{other}\"")));
            }
        };
        let adapt = match adapt {
            "work" => Adapt::Work,
            "time" => Adapt::Time,
            other => {
                return Err(invalid_input(py, "adapt", "one of \"work\", \"time\"", &format!("\"{other}\"")));
            }
        };
        let frames = match frames {
            Some(frames) => Frames::Fixed { frames, alpha },
            None => Frames::Adaptive { first: first_frames, most: most_frames },
        };
        let options = SessionOptions { variant, frames, beta, gamma, adapt, low_curvature };
        options.check().map_err(|error| detect_error(py, &error))?;
        let rest = rest.map(|x| vertices_from(x, "rest")).transpose()?;
        let most = rest.as_ref().map_or(u32::MAX as usize, Vec::len);
        let triangles = triangles_from(triangles, "triangles", most)?;
        let pool = pool(py, threads)?;
        let state = State { options, triangles, bodies, rest, pool, built: None };
        Ok(Self { state: Mutex::new(state), positions: Mutex::default() })
    }

    /// All pairs in contact in one frame, and what the session did.
    fn detect<'py>(
        &self,
        py: Python<'py>,
        x_t0: &Bound<'py, PyAny>,
        x_t1: &Bound<'py, PyAny>,
        thickness: f64,
        mode: &str,
    ) -> PyResult<(Pairs<'py>, Bound<'py, PyDict>)> {
        let mode = mode_from(py, mode)?;
        // Memory of the last frame, unless another thread is using it.
        let [mut x_t0s, mut x_t1s] =
            std::mem::take(&mut *self.positions.lock().unwrap_or_else(PoisonError::into_inner));
        vertices_into(x_t0, "x_t0", &mut x_t0s)?;
        vertices_into(x_t1, "x_t1", &mut x_t1s)?;
        let (x_t0, x_t1) = (&x_t0s, &x_t1s);
        let work = || {
            let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
            let State { options, triangles, bodies, rest, pool, built } = &mut *state;
            let Built { mesh, session } = if let Some(built) = built {
                built
            } else {
                let mesh = mesh_of(triangles, bodies.as_deref(), x_t0.len())?;
                let x = rest.as_deref().unwrap_or(x_t0);
                let session = SkippingSession::new(&mesh, x, *options)?;
                built.insert(Built { mesh, session })
            };
            let query = Query { x_t0, x_t1, thickness, mode, active: None };
            let contacts = session.detect(mesh, &query, pool)?;
            let edges: Vec<[u32; 4]> = contacts
                .edge_edge
                .iter()
                .map(|&[a, b]| {
                    let (a, b) = (mesh.edges[a as usize], mesh.edges[b as usize]);
                    [a[0], a[1], b[0], b[1]]
                })
                .collect();
            Ok::<_, DetectError>((contacts, edges, session.stats().clone()))
        };
        let done = detached(py, work, detect_error);
        *self.positions.lock().unwrap_or_else(PoisonError::into_inner) = [x_t0s, x_t1s];
        let (contacts, edges, stats) = done?;
        let dict = stats_to_dict(py, &stats)?;
        dict.set_item("broad_phase_tests", contacts.stats.broad_phase_tests)?;
        dict.set_item("leaf_pairs", contacts.stats.leaf_pairs)?;
        dict.set_item("root_searches", contacts.stats.root_searches)?;
        let pairs = (
            indices_to_numpy(py, contacts.vertex_triangle.into_iter()),
            contacts.time_vertex_triangle.into_pyarray(py),
            indices_to_numpy(py, edges.into_iter()),
            contacts.time_edge_edge.into_pyarray(py),
        );
        Ok((pairs, dict))
    }

    /// The next frame starts a session.
    fn restart(&self, py: Python<'_>) {
        py.detach(|| {
            let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(built) = &mut state.built {
                built.session.restart();
            }
        });
    }
}

/// One body of everything, or the given ones, whose triangles come in their order.
fn mesh_of(
    triangles: &[[u32; 3]],
    bodies: Option<&[BodyTuple]>,
    vertex_count: usize,
) -> Result<CollisionMesh, DetectError> {
    let Some(bodies) = bodies else { return CollisionMesh::single(vertex_count, triangles) };
    let counted: usize = bodies.iter().map(|b| b.0).sum();
    if counted != vertex_count {
        return Err(DetectError::Length { array: "x_t0", expected: counted, got: vertex_count });
    }
    let (mut first, mut rest, mut local) = (0u32, triangles, vec![]);
    for &(count, dynamic, self_collision) in bodies {
        let end = first + count as u32;
        let own = rest.iter().take_while(|t| t[0] < end).count();
        let (of_body, others) = rest.split_at(own);
        // A vertex of an earlier body turns into an index that no body has.
        local.push((
            Body { dynamic, self_collision },
            count,
            of_body.iter().map(|t| t.map(|v| v.wrapping_sub(first))).collect::<Vec<_>>(),
        ));
        (first, rest) = (end, others);
    }
    if let Some(&[index, ..]) = rest.first() {
        return Err(DetectError::IndexOutOfRange { body: bodies.len(), triangle: 0, index, vertex_count });
    }
    let list: Vec<_> = local.iter().map(|(body, count, own)| (*body, *count, own.as_slice())).collect();
    CollisionMesh::new(&list)
}

fn stats_to_dict<'py>(py: Python<'py>, stats: &SessionStats) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    let frame = match stats.kind {
        FrameKind::Alone => "alone",
        FrameKind::First => "first",
        FrameKind::Skipping => "skipping",
    };
    dict.set_item("frame", frame)?;
    dict.set_item("frames", stats.frames)?;
    dict.set_item("alpha", stats.alpha)?;
    dict.set_item("pending", stats.pending)?;
    dict.set_item("admissible", stats.admissible)?;
    dict.set_item("colliding", stats.colliding)?;
    dict.set_item("dangling_vertices", stats.dangling_vertices)?;
    dict.set_item("dangling_triangles", stats.dangling_triangles)?;
    dict.set_item("flat_surfaces", stats.flat_surfaces)?;
    dict.set_item("flat_triangles", stats.flat_triangles)?;
    dict.set_item("work", stats.work)?;
    dict.set_item("pair_bytes", stats.pair_bytes)?;
    let seconds = PyDict::new(py);
    seconds.set_item("BVHU", stats.update_seconds)?;
    seconds.set_item("BVHT", stats.traversal_seconds)?;
    seconds.set_item("ETP", stats.elementary_seconds)?;
    dict.set_item("seconds", seconds)?;
    Ok(dict)
}
