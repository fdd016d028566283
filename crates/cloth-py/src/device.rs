//! The GPUs of this machine, and two switches for tests.

use cloth_sim::device::{self, SharedGpu};
use pyo3::prelude::*;

use crate::errors::invalid_input;

/// All adapters as JSON, best first, and why there are none if so. Loads the drivers of all of them.
#[pyfunction]
pub(crate) fn gpu_adapters(py: Python<'_>) -> PyResult<(String, String)> {
    let (adapters, problem) = match py.detach(device::adapters) {
        Ok(adapters) => (adapters, String::new()),
        Err(problem) => (Vec::new(), problem),
    };
    let text = serde_json::to_string(&adapters)
        .map_err(|error| invalid_input(py, "adapters", "values that JSON can hold", &error.to_string()))?;
    Ok((text, problem))
}

/// For tests: close the GPU of this process under whoever works with it; whether one was open.
#[pyfunction]
pub(crate) fn lose_gpu(py: Python<'_>) -> bool {
    py.detach(|| SharedGpu::of_process().lose())
}

/// For tests: let the device "auto" take a software adapter too, which is slower than the CPU.
#[pyfunction]
pub(crate) fn let_auto_take_software(takes: bool) {
    SharedGpu::of_process().set_takes_software(takes);
}
