//! Friction laws alone and published coefficients: `clothsim.friction`.

use cloth_sim::friction::{FrictionTable, LawName, TableError, pairs};
use cloth_sim::scene::nearest;
use numpy::PyArray2;
use pyo3::prelude::*;

use crate::convert::{numbers_from, points_to_numpy, vertices_from};
use crate::detach::detached;
use crate::errors::invalid_input;

/// Equation 7.6 per row: forces [N] (n, 3) for normal forces [N] (n,), velocities [m/s] (n, 3), applied forces [N] (n, 3)
/// and areas [m²] (n,). The package has checked the ranges of these and made their lengths equal; the law's parameters
/// are checked here.
#[pyfunction]
#[pyo3(signature = (model, normal_force, velocity, applied, area, *, mu_c, mu_s, v_s, delta_s, f_v, delta_v))]
#[allow(clippy::too_many_arguments, reason = "the arguments of the Python function, one by one")]
pub(crate) fn friction_force<'py>(
    py: Python<'py>,
    model: &str,
    normal_force: &Bound<'py, PyAny>,
    velocity: &Bound<'py, PyAny>,
    applied: &Bound<'py, PyAny>,
    area: &Bound<'py, PyAny>,
    mu_c: Option<f64>,
    mu_s: Option<f64>,
    v_s: Option<f64>,
    delta_s: Option<f64>,
    f_v: Option<f64>,
    delta_v: Option<f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let refuse = |error: &TableError| argument_error(py, error);
    let law = Some(LawName::parse(model).map_err(|e| refuse(&e))?);
    let table = FrictionTable { law, pair: None, mu_c, mu_s, v_s, delta_s, f_v, delta_v };
    let law = table.law().map_err(|e| refuse(&e))?;
    let normal_force = numbers_from(normal_force, "normal_force")?;
    let area = numbers_from(area, "area")?;
    let velocity = vertices_from(velocity, "tangential_velocity")?;
    let applied = vertices_from(applied, "applied_force")?;
    let rows = velocity.len();
    let lengths =
        [("normal_force", normal_force.len()), ("applied_force", applied.len()), ("area", area.len())];
    if let Some((name, length)) = lengths.into_iter().find(|(_, length)| *length != rows) {
        return Err(invalid_input(py, name, &format!("{rows} rows"), &length.to_string()));
    }
    let work = || -> Result<_, TableError> {
        let row = |i: usize| law.force(normal_force[i], velocity[i], applied[i], area[i]);
        Ok((0..rows).map(row).collect::<Vec<_>>())
    };
    let forces = detached(py, work, argument_error)?;
    Ok(points_to_numpy(py, &forces))
}

/// A parameter under its name as an argument.
fn argument_error(py: Python<'_>, error: &TableError) -> PyErr {
    let key = if error.key == "law" { "model" } else { error.key };
    let near = error.unknown.as_ref().and_then(|(got, known)| nearest(got, known.iter().copied()));
    let hint = near.map_or_else(String::new, |name| format!(" (did you mean \"{name}\"?)"));
    invalid_input(py, key, &error.expected.replace("law = ", "model = "), &format!("{}{hint}", error.got))
}

/// Published pairs as JSON: name, about, and per coefficient value, kind, key and note.
#[pyfunction]
pub(crate) fn friction_pairs() -> String {
    let coefficient = |c: &pairs::Coefficient| {
        let (kind, key, note) = match c.source {
            pairs::Source::Published { key, at } => ("published", key, at),
            pairs::Source::SecondHand { key, at } => ("second-hand", key, at),
            pairs::Source::Estimate(basis) => ("estimate", "", basis),
        };
        serde_json::json!({ "value": c.value, "kind": kind, "source": key, "note": note })
    };
    let pair = |p: &pairs::Pair| {
        serde_json::json!({
            "name": p.name, "about": p.about, "static": coefficient(&p.fixed), "kinetic": coefficient(&p.kinetic),
        })
    };
    pairs::pairs().iter().map(pair).collect::<serde_json::Value>().to_string()
}

/// References of the published pairs: key, and what it is.
#[pyfunction]
pub(crate) fn friction_sources() -> Vec<(&'static str, &'static str)> {
    pairs::SOURCES.iter().map(|source| (source.key, source.about)).collect()
}
