//! Takes directions of single vertices out of the matrix, and puts them back.
//!
//! With the projector P_i onto what vertex i is free to do (I elsewhere), the blocks become P_i A_ij P_j; the vertex's
//! own block becomes P_i (A_ii + D_i) P_i + s (I − P_i) with s = tr A_ii / 3, so that the matrix stays positive definite
//! and the solution has no part in what is taken out. Only the rows and columns of the listed vertices are touched.
//!
//! Source: Baraff and Witkin 1998, section 5.3, with the filter in the matrix instead of in the iteration (Ascher and Boxerman
//! 2003): every solver works with it.

use nalgebra::Matrix3;

use super::BlockMatrix;

/// A vertex that is not free, or has more on its diagonal.
pub(crate) struct Freedom {
    pub(crate) vertex: u32,
    /// P_i.
    pub(crate) free: Matrix3<f64>,
    /// D_i [kg], symmetric and positive semi-definite.
    pub(crate) added: Matrix3<f64>,
}

/// The blocks that a projection has replaced.
#[derive(Default)]
pub(crate) struct Projection {
    /// Entry of each vertex plus 1, else 0; all 0 between calls.
    entry: Vec<u32>,
    diagonal: Vec<(u32, [f64; 9])>,
    upper: Vec<(u32, [f64; 9])>,
}

impl Projection {
    /// Projects `matrix`; `list` by ascending vertices. [`Self::restore`] must come before the next one.
    pub(crate) fn project(&mut self, matrix: &mut BlockMatrix, list: &[Freedom]) {
        let pattern = matrix.pattern.clone();
        self.entry.resize(pattern.rows, 0);
        for (k, freedom) in list.iter().enumerate() {
            self.entry[freedom.vertex as usize] = k as u32 + 1;
        }
        for Freedom { vertex, free, added } in list {
            let i = *vertex as usize;
            let block = &mut matrix.diagonal[i];
            self.diagonal.push((*vertex, *block));
            let own = Matrix3::from_column_slice(&*block);
            let held = (Matrix3::identity() - free) * (own.trace() / 3.0);
            let mut own = free * (own + added) * free + held;
            // Exactly symmetric again: solvers read either half.
            own = (own + own.transpose()) * 0.5;
            block.copy_from_slice(own.as_slice());
            for k in pattern.upper_of(i) {
                let other = self.entry[pattern.columns[k] as usize];
                let right = (other > 0).then(|| &list[other as usize - 1].free);
                self.replace(matrix, k, Some(free), right);
            }
            for &[j, k] in pattern.lower_of(i) {
                // Where the other end is in the list too, its own turn takes the block.
                if self.entry[j as usize] == 0 {
                    self.replace(matrix, k as usize, None, Some(free));
                }
            }
        }
        for freedom in list {
            self.entry[freedom.vertex as usize] = 0;
        }
    }

    fn replace(
        &mut self,
        matrix: &mut BlockMatrix,
        k: usize,
        left: Option<&Matrix3<f64>>,
        right: Option<&Matrix3<f64>>,
    ) {
        let values = &mut matrix.upper[9 * k..9 * k + 9];
        let mut saved = [0.0; 9];
        saved.copy_from_slice(values);
        self.upper.push((k as u32, saved));
        let mut block = Matrix3::from_column_slice(&saved);
        if let Some(left) = left {
            block = left * block;
        }
        if let Some(right) = right {
            block *= right;
        }
        values.copy_from_slice(block.as_slice());
    }

    /// Puts back what the last projection replaced.
    pub(crate) fn restore(&mut self, matrix: &mut BlockMatrix) {
        for (row, block) in self.diagonal.drain(..) {
            matrix.diagonal[row as usize] = block;
        }
        for (k, block) in self.upper.drain(..) {
            matrix.upper[9 * k as usize..9 * k as usize + 9].copy_from_slice(&block);
        }
    }

    /// Memory [B].
    pub(crate) fn bytes(&self) -> usize {
        4 * self.entry.capacity()
            + size_of::<(u32, [f64; 9])>() * (self.diagonal.capacity() + self.upper.capacity())
    }
}
