//! The block matrix as a faer sparse matrix of scalars, its pattern and slot map made once.

use faer::sparse::{SparseColMat, SymbolicSparseColMat};

use crate::assembly::{BlockMatrix, Lanes, Pattern};

/// Which triangle of the symmetric matrix is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    Full,
    Lower,
}

/// Column-compressed scalars. Column 3 j + c holds column c of the blocks of column j.
pub(super) struct Scalar {
    part: Part,
    pub(super) matrix: SparseColMat<u32, f64>,
}

impl Scalar {
    pub(super) fn new(pattern: &Pattern, part: Part) -> Self {
        let n = 3 * pattern.rows;
        let mut column_starts = vec![0u32];
        let mut rows = Vec::new();
        for j in 0..pattern.rows {
            for c in 0..3 {
                let lowest = if part == Part::Lower { c } else { 0 };
                if part == Part::Full {
                    for &[i, _] in pattern.lower_of(j) {
                        rows.extend((0..3).map(|r| 3 * i + r));
                    }
                }
                rows.extend((lowest as u32..3).map(|r| 3 * j as u32 + r));
                // Row j's upper blocks are column j's lower ones, transposed.
                for k in pattern.upper_of(j) {
                    rows.extend((0..3).map(|r| 3 * pattern.columns[k] + r));
                }
                column_starts.push(rows.len() as u32);
            }
        }
        let values = vec![0.0; rows.len()];
        // Ascending and in range by the pattern's construction; the check is that of the constructor.
        let symbolic = SymbolicSparseColMat::new_checked(n, n, column_starts, None, rows);
        Self { part, matrix: SparseColMat::new(symbolic, values) }
    }

    /// Takes over the values of `a`, with rows and columns of pinned vertices replaced by those of the identity.
    pub(super) fn fill(&mut self, a: &BlockMatrix, pinned: &[bool]) {
        let pattern = &a.pattern;
        let mut values = self.matrix.val_mut().iter_mut();
        let mut push = |value: f64| {
            if let Some(slot) = values.next() {
                *slot = value;
            }
        };
        for j in 0..pattern.rows {
            for c in 0..3 {
                if self.part == Part::Full {
                    for &[i, k] in pattern.lower_of(j) {
                        let free = !(pinned[j] || pinned[i as usize]);
                        for r in 0..3 {
                            push(if free { a.upper[9 * k as usize + 3 * c + r] } else { 0.0 });
                        }
                    }
                }
                for r in if self.part == Part::Lower { c } else { 0 }..3 {
                    let identity = f64::from(u8::from(r == c));
                    push(if pinned[j] { identity } else { a.diagonal[j][3 * c + r] });
                }
                for k in pattern.upper_of(j) {
                    let free = !(pinned[j] || pinned[pattern.columns[k] as usize]);
                    for r in 0..3 {
                        push(if free { a.upper[9 * k + 3 * r + c] } else { 0.0 });
                    }
                }
            }
        }
    }

    /// Memory [B].
    pub(super) fn bytes(&self) -> usize {
        12 * self.matrix.val().len() + 4 * (self.matrix.ncols() + 1)
    }
}

/// b_f − A_fp x_p at free vertices and zero at pinned ones, into scalars.
pub(super) fn eliminated(
    a: &BlockMatrix,
    b: &[crate::mesh::Vec3],
    pinned: &[bool],
    x: &[crate::mesh::Vec3],
    rhs: &mut [f64],
) {
    let known: Vec<Lanes> =
        (0..b.len()).map(|i| if pinned[i] { Lanes::from_vec(&x[i]) } else { Lanes::ZERO }).collect();
    let mut product = vec![Lanes::ZERO; b.len()];
    if known.iter().any(|l| *l != Lanes::ZERO) {
        a.multiply_rows(0, &known, &mut product);
    }
    for (i, rhs) in rhs.chunks_exact_mut(3).enumerate() {
        for l in 0..3 {
            rhs[l] = if pinned[i] { 0.0 } else { b[i][l] - product[i].0[l] };
        }
    }
}

/// Copies the free vertices of `solution` into `x`.
pub(super) fn scatter(solution: &[f64], pinned: &[bool], x: &mut [crate::mesh::Vec3]) {
    for (i, value) in solution.chunks_exact(3).enumerate() {
        if !pinned[i] {
            x[i].copy_from_slice(value);
        }
    }
}
