//! A simulation as a frozen class over a lock: threads may share it, and each call has it alone.
//!
//! The lock is taken after the interpreter is released, so that a thread that waits for it holds nobody up.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::{Mutex, MutexGuard, PoisonError};

use cloth_sim::scene::Rotation;
use cloth_sim::{Advance, Assets, BodyInfo, BodyKind, Sequence, SimError, Simulation, SimulationOptions};
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use serde::Serialize;

use crate::convert::{frames_from, points_to_numpy, triangles_from, vertices_from};
use crate::errors::{device_error, invalid_input, sim_error};
use crate::mesh::{Arrays, mesh_from, mesh_to_numpy};
use crate::scene::PyScene;

/// Name, kind, vertex range in the global array, and the mesh's triangles and UV (with no vertices).
type BodyTuple<'py> = (String, &'static str, (usize, usize), Arrays<'py>);

/// Vertices, triangles and UV of a mesh, and its groups of triangles by name.
type MeshTuple<'py> =
    (Bound<'py, PyAny>, Bound<'py, PyAny>, Option<Bound<'py, PyAny>>, BTreeMap<String, Vec<u32>>);

/// A scene being simulated.
#[pyclass(frozen, module = "clothsim._core", name = "Simulation")]
pub(crate) struct PySimulation {
    simulation: Mutex<Simulation>,
}

#[pymethods]
impl PySimulation {
    #[new]
    #[pyo3(signature = (scene, meshes, sequences, velocities, threads, device, allow_intersections, start))]
    fn new(
        py: Python<'_>,
        scene: &Bound<'_, PyScene>,
        meshes: &Bound<'_, PyDict>,
        sequences: &Bound<'_, PyDict>,
        velocities: &Bound<'_, PyDict>,
        threads: Option<usize>,
        device: &str,
        allow_intersections: bool,
        start: Option<(f64, Bound<'_, PyAny>, Bound<'_, PyAny>)>,
    ) -> PyResult<Self> {
        let assets = assets_from(meshes, sequences, velocities)?;
        let options = options_from(py, threads, device, allow_intersections)?;
        let scene = &scene.get().scene;
        let start = match start {
            Some((time, x, v)) => {
                Some((time, vertices_from(&x, "positions")?, vertices_from(&v, "velocities")?))
            }
            None => None,
        };
        Self::built(py, || {
            match &start {
                Some((time, x, v)) => Simulation::start_from(scene, assets, options, *time, x, v),
                None => Simulation::new(scene, assets, options),
            }
            .map_err(Box::new)
        })
    }

    /// The simulation that a checkpoint holds.
    #[staticmethod]
    #[pyo3(signature = (bytes, threads, device))]
    fn resume(py: Python<'_>, bytes: &[u8], threads: Option<usize>, device: &str) -> PyResult<Self> {
        let options = options_from(py, threads, device, false)?;
        Self::built(py, || Simulation::resume_on(bytes, options).map_err(Box::new))
    }

    /// The scene from a state on that `frame_state` gave.
    #[staticmethod]
    #[pyo3(signature = (state, scene, meshes, sequences, velocities, threads, device, allow_intersections))]
    fn continue_from(
        py: Python<'_>,
        state: &[u8],
        scene: &Bound<'_, PyScene>,
        meshes: &Bound<'_, PyDict>,
        sequences: &Bound<'_, PyDict>,
        velocities: &Bound<'_, PyDict>,
        threads: Option<usize>,
        device: &str,
        allow_intersections: bool,
    ) -> PyResult<Self> {
        let assets = assets_from(meshes, sequences, velocities)?;
        let options = options_from(py, threads, device, allow_intersections)?;
        let scene = &scene.get().scene;
        Self::built(py, || Simulation::continue_from(state, scene, assets, options).map_err(Box::new))
    }

    /// Take one step of the scene's size.
    fn step(&self, py: Python<'_>) -> PyResult<()> {
        self.detached(py, |simulation| simulation.step().map_err(Box::new))
    }

    /// Round positions and velocities of the cloth to f32.
    fn round_state(&self, py: Python<'_>) {
        py.detach(|| self.lock().round_state());
    }

    /// Advance in equal steps; Ctrl-C is looked for before each. Returns the number of steps.
    fn advance(&self, py: Python<'_>, seconds: f64) -> PyResult<usize> {
        self.interruptible(py, |simulation, check| simulation.advance(seconds, check).map_err(Box::new))
    }

    /// Do what an interrupted `advance` has left.
    fn finish_advance(&self, py: Python<'_>) -> PyResult<usize> {
        self.interruptible(py, |simulation, check| simulation.finish_advance(check).map_err(Box::new))
    }

    /// Have a pin reach a pose (displacement, axis and angle) in so many seconds.
    fn steer(
        &self,
        py: Python<'_>,
        cloth: usize,
        pin: usize,
        position: [f64; 3],
        rotation: Option<([f64; 3], f64)>,
        seconds: f64,
    ) -> PyResult<()> {
        let rotation = rotation.map(|(axis, angle)| Rotation { axis, angle });
        self.detached(py, |simulation| {
            simulation.steer(cloth, pin, position, rotation, seconds).map_err(Box::new)
        })
    }

    /// Whether an interrupted `advance` has something left.
    #[getter]
    fn interrupted(&self, py: Python<'_>) -> bool {
        self.read(py, Simulation::is_interrupted)
    }

    /// Simulated time [s].
    #[getter]
    fn time(&self, py: Python<'_>) -> f64 {
        self.read(py, Simulation::time)
    }

    /// Steps taken since the start.
    #[getter]
    fn step_count(&self, py: Python<'_>) -> u64 {
        self.read(py, Simulation::step_count)
    }

    /// Positions of all cloth vertices [m], (n, 3); a copy.
    fn positions<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let points = self.read(py, |simulation| simulation.positions().to_vec());
        points_to_numpy(py, &points)
    }

    /// Velocities of all cloth vertices [m/s], (n, 3); a copy.
    fn velocities<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let points = self.read(py, |simulation| simulation.velocities().to_vec());
        points_to_numpy(py, &points)
    }

    /// Start positions of all cloth vertices [m] as the scene places them, before pins, (n, 3); a copy.
    fn start_positions<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let points = self.read(py, Simulation::start_positions);
        points_to_numpy(py, &points)
    }

    /// Positions of all collider vertices [m], (n, 3); a copy.
    fn collider_positions<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let points = self.read(py, |simulation| simulation.collider_positions().to_vec());
        points_to_numpy(py, &points)
    }

    /// Force of contact on each cloth vertex in the last step [N], (n, 3); a copy.
    fn contact_forces<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let forces = self.read(py, Simulation::contact_forces);
        points_to_numpy(py, &forces)
    }

    /// Lumped mass of each cloth vertex [kg], (n,); a copy.
    fn masses<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.read(py, |simulation| simulation.masses().to_vec()).into_pyarray(py)
    }

    /// The bodies, cloth first: name, kind, range of vertices, and their mesh without vertices.
    fn bodies<'py>(&self, py: Python<'py>) -> PyResult<Vec<BodyTuple<'py>>> {
        let bodies = self.read(py, |simulation| simulation.bodies().to_vec());
        bodies
            .into_iter()
            .map(|body| {
                let kind = match body.kind {
                    BodyKind::Cloth => "cloth",
                    BodyKind::Collider => "collider",
                };
                let arrays = mesh_to_numpy(py, &[], body.triangles, body.uv)?;
                Ok((body.name, kind, (body.vertices.start, body.vertices.end), arrays))
            })
            .collect()
    }

    /// Regions of material: number of the body, number of the region in its cloth, and the triangles (k,) of it.
    fn regions<'py>(&self, py: Python<'py>) -> Vec<(usize, usize, Bound<'py, PyArray1<u32>>)> {
        let regions = self.read(py, |simulation| {
            let of = |body: &BodyInfo| body.regions.clone();
            simulation.bodies().iter().map(of).collect::<Vec<_>>()
        });
        let each = regions.into_iter().enumerate();
        each.flat_map(|(body, regions)| regions.into_iter().map(move |(region, list)| (body, region, list)))
            .map(|(body, region, list)| (body, region, list.into_pyarray(py)))
            .collect()
    }

    /// Mechanical energy of the cloth by kind [J], as JSON.
    fn energy(&self, py: Python<'_>) -> PyResult<String> {
        let energy = self.read(py, Simulation::energy);
        json(py, &energy)
    }

    /// The plan as JSON and as a table for people.
    fn plan(&self, py: Python<'_>) -> PyResult<(String, String)> {
        let plan = self.read(py, |simulation| simulation.plan().clone());
        Ok((json(py, &plan)?, plan.to_string()))
    }

    /// The report without its steps, as JSON.
    fn summary(&self, py: Python<'_>) -> PyResult<String> {
        let report = self.read(py, |simulation| simulation.report().without_steps());
        json(py, &report)
    }

    /// The GPUs that were asked for and could not be had, or failed on the way, as JSON.
    fn fallbacks(&self, py: Python<'_>) -> PyResult<String> {
        let fallbacks = self.read(py, |simulation| simulation.report().fallbacks.clone());
        json(py, &fallbacks)
    }

    /// The detectors that were chosen by measuring, as JSON.
    fn choices(&self, py: Python<'_>) -> PyResult<String> {
        let choices = self.read(py, |simulation| simulation.report().choices.clone());
        json(py, &choices)
    }

    /// The reports of the steps from number `first` (from 0, those left out counted) on, as JSON.
    fn steps(&self, py: Python<'_>, first: usize) -> PyResult<String> {
        let steps = self.read(py, |simulation| simulation.report().steps_from(first).to_vec());
        json(py, &steps)
    }

    /// The scene as JSON, defaults written out.
    fn scene(&self, py: Python<'_>) -> PyResult<String> {
        let scene = self.read(py, |simulation| simulation.scene().clone());
        json(py, &scene)
    }

    /// Pairs of triangles that pass through each other now, (k, 2).
    fn intersections<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i64>>> {
        let pairs = self.detached(py, |simulation| simulation.intersections().map_err(Box::new))?;
        Ok(crate::convert::indices_to_numpy(py, pairs.into_iter()))
    }

    /// Hinges of bending laws with memory: vertices (h, 4), then curvature, moment, rest curvature, b1, frictional moment.
    fn hinges<'py>(&self, py: Python<'py>) -> crate::bending::Hinges<'py> {
        let hinges = self.read(py, Simulation::hinges);
        crate::bending::hinges_to_numpy(py, &hinges)
    }

    /// Everything but the reports of the steps before number `first`, as bytes.
    fn checkpoint<'py>(&self, py: Python<'py>, first: usize) -> Bound<'py, PyBytes> {
        let bytes = self.read(py, |simulation| simulation.checkpoint_from(first));
        PyBytes::new(py, &bytes)
    }

    /// The full state without meshes and report, as bytes.
    fn frame_state<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        let bytes = self.read(py, Simulation::frame_state);
        PyBytes::new(py, &bytes)
    }
}

impl PySimulation {
    fn lock(&self) -> MutexGuard<'_, Simulation> {
        self.simulation.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn read<T: Send>(&self, py: Python<'_>, look: impl FnOnce(&Simulation) -> T + Send) -> T {
        py.detach(|| look(&self.lock()))
    }

    /// What `build` makes while the interpreter is released.
    fn built(
        py: Python<'_>,
        build: impl FnOnce() -> Result<Simulation, Box<SimError>> + Send,
    ) -> PyResult<Self> {
        let simulation = py.detach(build).map_err(|error| sim_error(py, &error))?;
        Ok(Self { simulation: Mutex::new(simulation) })
    }

    fn detached<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Simulation) -> Result<T, Box<SimError>> + Send,
    ) -> PyResult<T> {
        py.detach(|| work(&mut self.lock())).map_err(|error| sim_error(py, &error))
    }

    /// Runs an advance that can be stopped between steps by a Python signal handler that raises.
    fn interruptible(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Simulation, &mut dyn FnMut() -> ControlFlow<()>) -> Result<Advance, Box<SimError>>
        + Send,
    ) -> PyResult<usize> {
        let mut raised: Option<PyErr> = None;
        let mut check = || match Python::attach(check_signals) {
            Ok(()) => ControlFlow::Continue(()),
            Err(error) => {
                raised = Some(error);
                ControlFlow::Break(())
            }
        };
        let advance = self.detached(py, |simulation| work(simulation, &mut check))?;
        match raised {
            Some(error) => Err(error),
            None => Ok(advance.steps),
        }
    }
}

/// What a run may use: `threads`, and the detector's `device` by its name.
fn options_from(
    py: Python<'_>,
    threads: Option<usize>,
    device: &str,
    allow_intersections: bool,
) -> PyResult<SimulationOptions> {
    let device = device.parse().map_err(|error| device_error(py, &error))?;
    Ok(SimulationOptions { threads, allow_intersections, device, ..SimulationOptions::default() })
}

/// The arrays that a scene names.
fn assets_from(
    meshes: &Bound<'_, PyDict>,
    sequences: &Bound<'_, PyDict>,
    velocities: &Bound<'_, PyDict>,
) -> PyResult<Assets> {
    let mut assets = Assets::default();
    for (name, arrays) in meshes {
        let (vertices, triangles, uv, groups): MeshTuple<'_> = arrays.extract()?;
        let name: String = name.extract()?;
        assets.meshes.insert(name.clone(), mesh_from(&vertices, &triangles, uv.as_ref())?);
        if !groups.is_empty() {
            assets.groups.insert(name, groups);
        }
    }
    for (name, arrays) in sequences {
        let (frames, triangles, fps): (Bound<'_, PyAny>, Bound<'_, PyAny>, Option<f64>) = arrays.extract()?;
        let frames = frames_from(&frames, "positions")?;
        let vertex_count = frames.first().map_or(0, Vec::len);
        let triangles = triangles_from(&triangles, "triangles", vertex_count)?;
        assets.sequences.insert(name.extract()?, Sequence { triangles, frames, fps });
    }
    for (name, array) in velocities {
        assets.velocities.insert(name.extract()?, vertices_from(&array, "velocities")?);
    }
    Ok(assets)
}

/// Runs the handlers of signals that have come; one that raises (Ctrl-C) is the error.
fn check_signals(py: Python<'_>) -> PyResult<()> {
    py.check_signals()
}

fn json(py: Python<'_>, value: &impl Serialize) -> PyResult<String> {
    serde_json::to_string(value)
        .map_err(|error| invalid_input(py, "report", "values that JSON can hold", &error.to_string()))
}
