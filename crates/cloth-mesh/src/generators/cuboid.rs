//! The box.

use super::{count, length};
use crate::{MeshError, TriMesh, Vec3};

/// Most points of the lattice in which those of the surface are numbered: half a gigabyte.
const MAX_LATTICE: usize = 1 << 27;

/// A closed box of `size` (x, y, z) [m], centred, each side cut into `cells` along the three axes, two triangles per
/// cell. Faces share the vertices on the box's edges.
///
/// # Errors
/// [`MeshError::Parameter`] for a size that is not positive and finite or no cell along an axis.
pub fn cuboid(size: [f64; 3], cells: [usize; 3]) -> Result<TriMesh, MeshError> {
    for (axis, name) in ["size.x", "size.y", "size.z"].into_iter().enumerate() {
        length(name, size[axis])?;
    }
    for (axis, name) in ["cells.x", "cells.y", "cells.z"].into_iter().enumerate() {
        /// The lattice (n+1)³ is walked once.
        const MAX_CELLS: usize = 1000;
        if cells[axis] > MAX_CELLS {
            return Err(MeshError::Parameter {
                parameter: name,
                expected: "1 to 1000 cells",
                got: cells[axis] as f64,
            });
        }
        count(name, cells[axis], 1, "1 to 1000 cells")?;
    }

    let points = cells.map(|c| c + 1);
    let lattice = points.iter().product::<usize>();
    if lattice > MAX_LATTICE {
        return Err(MeshError::Parameter {
            parameter: "cells",
            expected: "at most 2²⁷ points in the lattice",
            got: lattice as f64,
        });
    }
    let flat = |[i, j, k]: [usize; 3]| (k * points[1] + j) * points[0] + i;
    // Numbers of the lattice's surface points, in lattice order.
    let mut index = vec![u32::MAX; points[0] * points[1] * points[2]];
    let mut vertices = Vec::new();
    for k in 0..points[2] {
        for j in 0..points[1] {
            for i in 0..points[0] {
                let at = [i, j, k];
                if (0..3).any(|a| at[a] == 0 || at[a] == cells[a]) {
                    index[flat(at)] = vertices.len() as u32;
                    vertices.push(Vec3::from_fn(|a, _| size[a] * (at[a] as f64 / cells[a] as f64 - 0.5)));
                }
            }
        }
    }
    let mut triangles = Vec::new();
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for high in [false, true] {
            for p in 0..cells[u] {
                for q in 0..cells[v] {
                    let corner = |du: usize, dv: usize| {
                        let mut at = [0; 3];
                        at[axis] = if high { cells[axis] } else { 0 };
                        at[u] = p + du;
                        at[v] = q + dv;
                        index[flat(at)]
                    };
                    let [a, b, c, d] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                    // u × v points along +axis.
                    if high {
                        triangles.extend([[a, b, c], [a, c, d]]);
                    } else {
                        triangles.extend([[a, c, b], [a, d, c]]);
                    }
                }
            }
        }
    }
    Ok(TriMesh { vertices, triangles, uv: None })
}
