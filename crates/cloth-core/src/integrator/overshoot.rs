//! Whether a linearised step went so far that it made elastic energy.
//!
//! The linear solve carries each element along the tangent of its motion: a pair of vertices at the distance e that moves by
//! Δe in the step grows longer by δ = |Δe_⊥|²/(2 |e|) than the solve has seen, and holds ½ k δ² that nothing has paid for. Soft or
//! slow cloth makes next to none and backward Euler damps it away; where a stiff cloth turns fast within a step it exceeds the
//! energy of the motion, and the next step starts from what the last one made.
//!
//! The sum over all coupled pairs, with k from the blocks of the step's own matrix, is compared with the kinetic energy about
//! the mean motion. Neither depends on the frame, the units or the mesh's size, and the check costs a pass over the blocks.

use rayon::prelude::*;

use crate::{assembly::BlockMatrix, mesh::Vec3};

/// Energy that a step may make, relative to the kinetic energy: far below what shows, far above what the steps of
/// ordinary scenes make.
const ALLOWED: f64 = 0.05;

/// The motion that a linear solve gives.
pub(super) struct Candidate<'a> {
    pub(super) x: &'a [Vec3],
    pub(super) v: &'a [Vec3],
    pub(super) dv: &'a [Vec3],
    pub(super) dt: f64,
    pub(super) masses: &'a [f64],
}

/// Whether the motion makes more energy than it may. Call on the pool.
pub(super) fn overshoots(matrix: &BlockMatrix, step: &Candidate<'_>) -> bool {
    let pattern = &matrix.pattern;
    let end = |i: usize| step.v[i] + step.dv[i];
    // Per chunk: what is made [J], mass [kg], momentum and twice the kinetic energy at both ends.
    let sums: Vec<(f64, f64, [Vec3; 2], [f64; 2])> = (0..pattern.chunks())
        .into_par_iter()
        .map(|chunk| {
            let (mut made, mut mass, mut momentum, mut energy) = (0.0, 0.0, [Vec3::zeros(); 2], [0.0; 2]);
            for i in pattern.chunk_rows(chunk) {
                let (m, v) = (step.masses[i], [step.v[i], end(i)]);
                mass += m;
                for k in 0..2 {
                    momentum[k] += v[k] * m;
                    energy[k] += m * v[k].norm_squared();
                }
                for k in pattern.upper_of(i) {
                    let j = pattern.columns[k] as usize;
                    let e = step.x[j] - step.x[i];
                    let moved = (end(j) - v[1]) * step.dt;
                    let e2 = e.norm_squared();
                    let across = moved.norm_squared() - moved.dot(&e).powi(2) / e2;
                    let block = &matrix.upper[9 * k..9 * k + 9];
                    let stiffness = (block[0] + block[4] + block[8]).abs();
                    let part = stiffness * across * across / (8.0 * e2);
                    // Vertices in one place have no direction.
                    if part.is_finite() {
                        made += part;
                    }
                }
            }
            (made, mass, momentum, energy)
        })
        .collect();
    let (mut made, mut mass, mut momentum, mut energy) = (0.0, 0.0, [Vec3::zeros(); 2], [0.0; 2]);
    for (part, m, p, e) in sums {
        made += part;
        mass += m;
        for k in 0..2 {
            momentum[k] += p[k];
            energy[k] += e[k];
        }
    }
    let kinetic = |k: usize| 0.5 * (energy[k] - momentum[k].norm_squared() / mass);
    // Blocks hold dt² k.
    made / (step.dt * step.dt) > ALLOWED * kinetic(0).max(kinetic(1))
}
