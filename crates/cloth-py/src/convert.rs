//! Checked NumPy in, NumPy out.
//!
//! Inputs are borrowed read-only and must be C-contiguous with the exact element type; the Python package makes
//! them so (`numpy.ascontiguousarray`). Outputs hand a `Vec` over to NumPy without a copy.
//! Each message names the parameter, what was expected and what came.

use cloth_sim::core::mesh::Vec3;
use numpy::{
    IntoPyArray, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3,
    PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use crate::errors::invalid_input;

/// `"shape (12, 4), float32"`, or the type's name where `value` is not an array.
fn describe(value: &Bound<'_, PyAny>) -> String {
    let Ok(array) = value.cast::<PyUntypedArray>() else {
        return value.get_type().name().map_or_else(|_| "another type".into(), |name| name.to_string());
    };
    let shape = match array.shape() {
        [one] => format!("({one},)"),
        more => format!("({})", more.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")),
    };
    let layout = if array.is_c_contiguous() { "" } else { ", not C-contiguous" };
    format!("shape {shape}, {}{layout}", array.dtype())
}

fn wrong(value: &Bound<'_, PyAny>, name: &str, expected: &str) -> PyErr {
    invalid_input(value.py(), name, expected, &describe(value))
}

/// Vertex positions [m] from an array of shape (n, 3), float64; every coordinate finite.
///
/// # Errors
/// `InvalidInput` naming the parameter, and for a coordinate that is not finite the vertex.
pub(crate) fn vertices_from(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<Vec3>> {
    let mut out = vec![];
    vertices_into(value, name, &mut out)?;
    Ok(out)
}

/// [`vertices_from`] in memory that is there.
///
/// # Errors
/// As [`vertices_from`].
pub(crate) fn vertices_into(value: &Bound<'_, PyAny>, name: &str, out: &mut Vec<Vec3>) -> PyResult<()> {
    const EXPECTED: &str = "shape (n, 3) and float64";
    let array: PyReadonlyArray2<'_, f64> = value.extract().map_err(|_| wrong(value, name, EXPECTED))?;
    let flat = array.as_slice().map_err(|_| wrong(value, name, EXPECTED))?;
    if array.shape()[1] != 3 {
        return Err(wrong(value, name, EXPECTED));
    }
    // Block by block without a branch per coordinate.
    let are_finite = |block: &[f64]| block.iter().fold(true, |all, x| all & x.is_finite());
    let found =
        if flat.chunks(1024).all(are_finite) { None } else { flat.iter().position(|x| !x.is_finite()) };
    if let Some(at) = found {
        let row = &flat[at / 3 * 3..at / 3 * 3 + 3];
        let got = format!("({}, {}, {}) at vertex {}", row[0], row[1], row[2], at / 3);
        return Err(invalid_input(value.py(), name, "finite coordinates", &got));
    }
    out.clear();
    out.extend_from_slice(bytemuck::cast_slice(flat));
    Ok(())
}

/// Triangles from an array of shape (m, 3), int32 or int64; every index in 0..`vertex_count`.
///
/// # Errors
/// `InvalidInput` naming the parameter, and for an index out of range the triangle.
pub(crate) fn triangles_from(
    value: &Bound<'_, PyAny>,
    name: &str,
    vertex_count: usize,
) -> PyResult<Vec<[u32; 3]>> {
    const EXPECTED: &str = "shape (m, 3) and int32 or int64";
    if value.cast::<PyUntypedArray>().is_ok_and(|array| array.ndim() != 2 || array.shape()[1] != 3) {
        return Err(wrong(value, name, EXPECTED));
    }
    let triangles = if let Ok(array) = value.extract::<PyReadonlyArray2<'_, i32>>() {
        narrowed(array.as_slice().map_err(|_| wrong(value, name, EXPECTED))?, vertex_count)
    } else if let Ok(array) = value.extract::<PyReadonlyArray2<'_, i64>>() {
        narrowed(array.as_slice().map_err(|_| wrong(value, name, EXPECTED))?, vertex_count)
    } else {
        return Err(wrong(value, name, EXPECTED));
    };
    triangles.map_err(|(index, triangle)| {
        let got = format!("{index} in triangle {triangle}");
        invalid_input(value.py(), name, &format!("indices in 0..{vertex_count}"), &got)
    })
}

/// Triangles of indices in 0..`vertex_count`; else the first other index and its triangle.
fn narrowed<T: Copy + Into<i64>>(flat: &[T], vertex_count: usize) -> Result<Vec<[u32; 3]>, (i64, usize)> {
    // As unsigned numbers negative indices are the largest.
    let outside = |index: T| index.into() as u64 >= vertex_count as u64;
    if flat.iter().fold(false, |any, &index| any | outside(index))
        && let Some(at) = flat.iter().position(|&index| outside(index))
    {
        return Err((flat[at].into(), at / 3));
    }
    Ok(flat.chunks_exact(3).map(|t| [t[0].into() as u32, t[1].into() as u32, t[2].into() as u32]).collect())
}

/// Numbers from an array of shape (n,), float64; finite or not.
///
/// # Errors
/// `InvalidInput` naming the parameter.
pub(crate) fn numbers_from(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<f64>> {
    const EXPECTED: &str = "shape (n,) and float64";
    let array: PyReadonlyArray1<'_, f64> = value.extract().map_err(|_| wrong(value, name, EXPECTED))?;
    Ok(array.as_slice().map_err(|_| wrong(value, name, EXPECTED))?.to_vec())
}

/// Material coordinates [m] of each triangle's corners, from an array of shape (m, 3, 2), float64, finite.
///
/// # Errors
/// `InvalidInput` naming the parameter.
pub(crate) fn corner_uv_from(
    value: &Bound<'_, PyAny>,
    name: &str,
    triangle_count: usize,
) -> PyResult<Vec<[[f64; 2]; 3]>> {
    let expected = format!("shape ({triangle_count}, 3, 2) and float64");
    let array: PyReadonlyArray3<'_, f64> = value.extract().map_err(|_| wrong(value, name, &expected))?;
    let flat = array.as_slice().map_err(|_| wrong(value, name, &expected))?;
    if array.shape() != [triangle_count, 3, 2] {
        return Err(wrong(value, name, &expected));
    }
    if let Some(at) = flat.iter().position(|coordinate| !coordinate.is_finite()) {
        let got = format!("{} in triangle {}", flat[at], at / 6);
        return Err(invalid_input(value.py(), name, "finite coordinates", &got));
    }
    Ok(bytemuck::cast_slice::<f64, [[f64; 2]; 3]>(flat).to_vec())
}

/// Positions of eight points per query from an array of shape (n, 8, 3), float64, finite.
///
/// # Errors
/// `InvalidInput` naming the parameter, and for a coordinate that is not finite the query.
pub(crate) fn queries_from(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<[Vec3; 8]>> {
    const EXPECTED: &str = "shape (n, 8, 3) and float64";
    let array: PyReadonlyArray3<'_, f64> = value.extract().map_err(|_| wrong(value, name, EXPECTED))?;
    let flat = array.as_slice().map_err(|_| wrong(value, name, EXPECTED))?;
    if array.shape()[1..] != [8, 3] {
        return Err(wrong(value, name, EXPECTED));
    }
    if let Some(at) = flat.iter().position(|coordinate| !coordinate.is_finite()) {
        let got = format!("{} in query {}", flat[at], at / 24);
        return Err(invalid_input(value.py(), name, "finite coordinates", &got));
    }
    let points = bytemuck::cast_slice::<f64, [[f64; 3]; 8]>(flat);
    Ok(points.iter().map(|query| query.map(Vec3::from)).collect())
}

/// Frames of one mesh from an array of shape (frames, n, 3), float64, finite.
///
/// # Errors
/// `InvalidInput` naming the parameter, and for a coordinate that is not finite the frame and vertex.
pub(crate) fn frames_from(value: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<Vec<Vec3>>> {
    const EXPECTED: &str = "shape (frames, n, 3) and float64";
    let array: PyReadonlyArray3<'_, f64> = value.extract().map_err(|_| wrong(value, name, EXPECTED))?;
    let flat = array.as_slice().map_err(|_| wrong(value, name, EXPECTED))?;
    let &[_, vertex_count, 3] = array.shape() else {
        return Err(wrong(value, name, EXPECTED));
    };
    if let Some(at) = flat.iter().position(|coordinate| !coordinate.is_finite()) {
        let got =
            format!("{} at frame {}, vertex {}", flat[at], at / (3 * vertex_count), at / 3 % vertex_count);
        return Err(invalid_input(value.py(), name, "finite coordinates", &got));
    }
    let points = bytemuck::cast_slice::<f64, [f64; 3]>(flat);
    Ok(points
        .chunks_exact(vertex_count.max(1))
        .map(|frame| frame.iter().map(|&p| Vec3::from(p)).collect())
        .collect())
}

/// An (n, 3) float64 array of points or vectors: a copy that NumPy owns.
pub(crate) fn points_to_numpy<'py>(py: Python<'py>, points: &[Vec3]) -> Bound<'py, PyArray2<f64>> {
    let flat: Vec<f64> = bytemuck::cast_slice(points).to_vec();
    rows_of(py, flat, points.len(), 3)
}

/// An (n, K) int64 array of indices: a copy that NumPy owns.
pub(crate) fn indices_to_numpy<const K: usize>(
    py: Python<'_>,
    rows: impl ExactSizeIterator<Item = [u32; K]>,
) -> Bound<'_, PyArray2<i64>> {
    let count = rows.len();
    let mut flat: Vec<i64> = Vec::with_capacity(K * count);
    for row in rows {
        flat.extend_from_slice(&row.map(i64::from));
    }
    rows_of(py, flat, count, K)
}

/// `flat` as `rows` × `columns`, which is its length.
fn rows_of<T: numpy::Element>(
    py: Python<'_>,
    flat: Vec<T>,
    rows: usize,
    columns: usize,
) -> Bound<'_, PyArray2<T>> {
    let shape = [rows, columns];
    flat.into_pyarray(py).reshape(shape).expect("rows × columns is the length")
}
