//! `clothsim._core`: conversion between Python and the engine, nothing else.
//!
//! The Python package `clothsim` is the public face; nothing here is meant to be called by a person.

mod bending;
mod collision;
mod convert;
mod detach;
mod device;
mod errors;
mod examples;
mod friction;
mod mesh;
mod scene;
mod session;
mod simulation;

use pyo3::prelude::*;

/// Gives memory that a call has freed less than [`KEPT`] ago to the next call without a fault per page, on every thread;
/// Python's own stays as it is.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// How long freed memory is kept before the system gets it back [ms]: detections of a script lie seconds apart.
const KEPT: std::ffi::c_long = 60_000;

/// `mi_option_purge_delay` of `mimalloc.h`, which the bindings do not name.
const PURGE_DELAY: libmimalloc_sys::mi_option_t = 15;

/// The compiled half of clothsim. Private: use the package.
#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    // SAFETY: the option exists in every version that the bindings compile, and may be set at any time.
    unsafe { libmimalloc_sys::mi_option_set(PURGE_DELAY, KEPT) };

    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("BUILD_PROFILE", if cfg!(debug_assertions) { "debug" } else { "release" })?;

    module.add_function(wrap_pyfunction!(mesh::check_mesh, module)?)?;
    module.add_function(wrap_pyfunction!(mesh::grid, module)?)?;
    module.add_function(wrap_pyfunction!(mesh::disc, module)?)?;
    module.add_function(wrap_pyfunction!(mesh::ribbon, module)?)?;
    module.add_function(wrap_pyfunction!(mesh::cylinder, module)?)?;
    module.add_function(wrap_pyfunction!(mesh::cone, module)?)?;
    module.add_function(wrap_pyfunction!(mesh::capsule, module)?)?;
    module.add_function(wrap_pyfunction!(mesh::sphere, module)?)?;
    module.add_function(wrap_pyfunction!(mesh::cuboid, module)?)?;

    module.add_function(wrap_pyfunction!(bending::bending_trace, module)?)?;

    module.add_function(wrap_pyfunction!(friction::friction_force, module)?)?;
    module.add_function(wrap_pyfunction!(friction::friction_pairs, module)?)?;
    module.add_function(wrap_pyfunction!(friction::friction_sources, module)?)?;

    module.add_function(wrap_pyfunction!(collision::detect, module)?)?;
    module.add_function(wrap_pyfunction!(collision::vertex_triangle_ccd, module)?)?;
    module.add_function(wrap_pyfunction!(collision::edge_edge_ccd, module)?)?;
    module.add_function(wrap_pyfunction!(collision::self_intersections, module)?)?;

    module.add_function(wrap_pyfunction!(device::gpu_adapters, module)?)?;
    module.add_function(wrap_pyfunction!(device::lose_gpu, module)?)?;
    module.add_function(wrap_pyfunction!(device::let_auto_take_software, module)?)?;

    module.add_class::<session::PySkippingSession>()?;

    module.add_class::<scene::PyScene>()?;
    module.add_function(wrap_pyfunction!(examples::example_scenes, module)?)?;
    module.add_function(wrap_pyfunction!(scene::scene_schema, module)?)?;
    module.add_function(wrap_pyfunction!(scene::material_names, module)?)?;
    module.add_function(wrap_pyfunction!(scene::material_named, module)?)?;
    module.add_function(wrap_pyfunction!(scene::bending_laws, module)?)?;
    module.add_function(wrap_pyfunction!(scene::fabric, module)?)?;
    module.add_function(wrap_pyfunction!(scene::fabric_sources, module)?)?;
    module.add_function(wrap_pyfunction!(scene::check_material, module)?)?;

    module.add_class::<simulation::PySimulation>()?;
    Ok(())
}
