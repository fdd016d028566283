//! Long work outside the interpreter.

use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::errors::invalid_input;

/// Runs `work` with the interpreter released, so that other Python threads go on; its error goes through `map`.
///
/// # Errors
/// What `map` makes of the error of `work`.
pub(crate) fn detached<T: Send, E: Send>(
    py: Python<'_>,
    work: impl FnOnce() -> Result<T, E> + Send,
    map: impl FnOnce(Python<'_>, &E) -> PyErr,
) -> PyResult<T> {
    py.detach(work).map_err(|error| map(py, &error))
}

/// A thread pool of its own for one call: `threads` workers, or as many as the machine runs at once.
///
/// # Errors
/// `InvalidInput` for no threads or more than the system gives.
pub(crate) fn pool(py: Python<'_>, threads: Option<usize>) -> PyResult<ThreadPool> {
    if threads == Some(0) {
        return Err(invalid_input(py, "threads", "at least 1", "0"));
    }
    ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build().map_err(|error| {
        invalid_input(py, "threads", "a number of threads that the system gives", &error.to_string())
    })
}
