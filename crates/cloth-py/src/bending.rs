//! Bending laws alone: `clothsim.bending`.

use cloth_sim::core::{
    Bending, CoreError,
    bending::{HingeState, Trace, trace},
};
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::prelude::*;

use crate::convert::{indices_to_numpy, numbers_from};
use crate::detach::detached;
use crate::errors::{core_error, invalid_input};

/// One column of a result.
type Column<'py> = Bound<'py, PyArray1<f64>>;

/// `(moment, rest_curvature, b1, frictional_moment, dissipated)`, all of the path's length.
type Traced<'py> = (Column<'py>, Column<'py>, Column<'py>, Column<'py>, Column<'py>);

/// `(vertices, curvature, moment, rest_curvature, b1, frictional_moment)`, one row per hinge.
pub(crate) type Hinges<'py> =
    (Bound<'py, PyArray2<i64>>, Column<'py>, Column<'py>, Column<'py>, Column<'py>, Column<'py>);

/// A law, as JSON of a material's bending, along a path of curvatures [1/m].
#[pyfunction]
#[pyo3(signature = (curvature, law))]
pub(crate) fn bending_trace<'py>(
    py: Python<'py>,
    curvature: &Bound<'py, PyAny>,
    law: &str,
) -> PyResult<Traced<'py>> {
    let path = numbers_from(curvature, "curvature")?;
    let bending: Bending = serde_json::from_str(law)
        .map_err(|error| invalid_input(py, "model", "the keys of a bending law", &error.to_string()))?;
    let law = bending.law().map_err(|error| argument_error(py, &error))?;
    let Some(law) = law else {
        return Err(invalid_input(py, "model", "a law of moment over curvature", "one without"));
    };
    let traced = detached(py, || trace(&law, &path), core_error)?;
    let Trace { moment, rest_curvature, b1, frictional_moment, dissipated } = traced;
    let column = |values: Vec<f64>| values.into_pyarray(py);
    Ok((column(moment), column(rest_curvature), column(b1), column(frictional_moment), column(dissipated)))
}

/// A parameter of a law under its name as an argument.
fn argument_error(py: Python<'_>, error: &CoreError) -> PyErr {
    let argument = |name: &'static str| name.strip_prefix("bending.").unwrap_or(name);
    match error {
        CoreError::Parameter { name, expected, got } => {
            core_error(py, &CoreError::Parameter { name: argument(name), expected, got: *got })
        }
        CoreError::Missing { name, expected } => {
            core_error(py, &CoreError::Missing { name: argument(name), expected })
        }
        other => core_error(py, other),
    }
}

/// Hinges as arrays.
pub(crate) fn hinges_to_numpy<'py>(py: Python<'py>, hinges: &[HingeState]) -> Hinges<'py> {
    let column =
        |value: fn(&HingeState) -> f64| hinges.iter().map(value).collect::<Vec<_>>().into_pyarray(py);
    (
        indices_to_numpy(py, hinges.iter().map(|h| h.vertices)),
        column(|h| h.curvature),
        column(|h| h.moment),
        column(|h| h.place.rest_curvature),
        column(|h| h.place.b1),
        column(|h| h.place.frictional_moment),
    )
}
