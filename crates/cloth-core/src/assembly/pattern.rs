//! Sparsity of a symmetric block matrix: the upper blocks row by row, and for each row where its lower blocks lie.

use super::ROWS_PER_CHUNK;

/// Pattern over `rows` vertices. Upper block k couples its row to `columns[k]` > row.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Pattern {
    pub(crate) rows: usize,
    /// First upper block of each row, and the number of blocks at the end.
    pub(crate) offsets: Vec<u32>,
    pub(crate) columns: Vec<u32>,
    /// First lower entry of each row.
    pub(crate) lower_offsets: Vec<u32>,
    /// Lower entries: (column < row, upper block whose transpose it is), ascending.
    pub(crate) lower: Vec<[u32; 2]>,
}

impl Pattern {
    /// From pairs (lower vertex, higher vertex), sorted and unique.
    pub(crate) fn new(rows: usize, pairs: &[[u32; 2]]) -> Self {
        let mut offsets = vec![0u32; rows + 1];
        let mut lower_offsets = vec![0u32; rows + 1];
        for &[i, j] in pairs {
            offsets[i as usize + 1] += 1;
            lower_offsets[j as usize + 1] += 1;
        }
        for row in 0..rows {
            offsets[row + 1] += offsets[row];
            lower_offsets[row + 1] += lower_offsets[row];
        }
        let mut next = lower_offsets.clone();
        let mut lower = vec![[0u32; 2]; pairs.len()];
        for (k, &[i, j]) in pairs.iter().enumerate() {
            lower[next[j as usize] as usize] = [i, k as u32];
            next[j as usize] += 1;
        }
        Self { rows, offsets, columns: pairs.iter().map(|p| p[1]).collect(), lower_offsets, lower }
    }

    /// Number of upper blocks.
    pub(crate) fn upper_count(&self) -> usize {
        self.columns.len()
    }

    /// Units of parallel work.
    pub(crate) fn chunks(&self) -> usize {
        self.rows.div_ceil(ROWS_PER_CHUNK)
    }

    /// Rows of a chunk.
    pub(crate) fn chunk_rows(&self, chunk: usize) -> std::ops::Range<usize> {
        chunk * ROWS_PER_CHUNK..((chunk + 1) * ROWS_PER_CHUNK).min(self.rows)
    }

    /// Upper blocks of a row.
    pub(crate) fn upper_of(&self, row: usize) -> std::ops::Range<usize> {
        self.offsets[row] as usize..self.offsets[row + 1] as usize
    }

    /// Lower entries of a row.
    pub(crate) fn lower_of(&self, row: usize) -> &[[u32; 2]] {
        &self.lower[self.lower_offsets[row] as usize..self.lower_offsets[row + 1] as usize]
    }

    /// Memory [B].
    pub(crate) fn bytes(&self) -> usize {
        4 * (self.offsets.len() + self.columns.len() + self.lower_offsets.len()) + 8 * self.lower.len()
    }
}
