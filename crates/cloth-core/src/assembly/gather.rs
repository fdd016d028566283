//! Rows gather their blocks from the elements.

use super::{BlockMatrix, ElementBuffers, Pattern, for_parts};
use crate::forces::{CouplingKind, ForceModel, Psd, corner_pairs};

/// Slot maps from elements to matrix blocks, and room for the elements' couplings.
pub(crate) struct Assembler {
    pub(crate) elements: ElementBuffers,
    /// First entry of `block_refs` of each upper block.
    block_offsets: Vec<u32>,
    /// Element block × 2, plus 1 where its transpose is added.
    block_refs: Vec<u32>,
    /// First entry of `outer_refs` of each upper block.
    outer_offsets: Vec<u32>,
    /// Outer element × 16 + row corner × 4 + column corner.
    outer_refs: Vec<u32>,
    /// First entry of `diagonal_refs` of each row.
    diagonal_offsets: Vec<u32>,
    /// Scalar element.
    diagonal_refs: Vec<u32>,
}

impl Assembler {
    /// Analyses all models' stencils over `rows` vertices: the pattern and the slot maps.
    pub(crate) fn new(rows: usize, models: &[Box<dyn ForceModel>], psd: Psd) -> (Self, Pattern) {
        // (pair, reference), sorted: runs of equal pairs are the matrix blocks; within a run by reference.
        let (mut blocks, mut outer, mut diagonal) = (Vec::new(), Vec::new(), Vec::new());
        let (mut block_base, mut outer_base, mut diagonal_base) = (0u32, 0u32, 0u32);
        for model in models {
            let n = model.corners();
            let pairs = corner_pairs(n);
            let kind = model.coupling(psd);
            for (element, vertices) in model.vertices().chunks_exact(n).enumerate() {
                let element = element as u32;
                if kind == CouplingKind::Diagonal {
                    diagonal.extend(vertices.iter().map(|&v| (v, diagonal_base + element)));
                    continue;
                }
                for (p, &(a, b)) in pairs.iter().enumerate() {
                    let (i, j) = (vertices[a], vertices[b]);
                    // A coupling of a vertex with itself is on the diagonal, which follows from the others.
                    if i == j {
                        continue;
                    }
                    let swapped = i > j;
                    let key = [i.min(j), i.max(j)];
                    if kind == CouplingKind::Blocks {
                        let block = block_base + element * pairs.len() as u32 + p as u32;
                        blocks.push((key, 2 * block + u32::from(swapped)));
                    } else {
                        let (row, column) = if swapped { (b, a) } else { (a, b) };
                        outer.push((key, 16 * (outer_base + element) + 4 * row as u32 + column as u32));
                    }
                }
            }
            let count = model.count() as u32;
            match kind {
                CouplingKind::Blocks => block_base += count * pairs.len() as u32,
                CouplingKind::Outer => outer_base += count,
                CouplingKind::Diagonal => diagonal_base += count,
            }
        }
        blocks.sort_unstable();
        outer.sort_unstable();
        diagonal.sort_unstable();

        let mut keys: Vec<[u32; 2]> = blocks.iter().chain(&outer).map(|(key, _)| *key).collect();
        keys.sort_unstable();
        keys.dedup();
        let pattern = Pattern::new(rows, &keys);
        let offsets = |refs: &[([u32; 2], u32)]| {
            let mut offsets = vec![0u32];
            let mut at = 0;
            for key in &keys {
                at += refs[at..].iter().take_while(|(k, _)| k == key).count();
                offsets.push(at as u32);
            }
            offsets
        };
        let mut diagonal_offsets = vec![0u32; rows + 1];
        for &(v, _) in &diagonal {
            diagonal_offsets[v as usize + 1] += 1;
        }
        for row in 0..rows {
            diagonal_offsets[row + 1] += diagonal_offsets[row];
        }
        let assembler = Self {
            elements: ElementBuffers::new(models, psd),
            block_offsets: offsets(&blocks),
            block_refs: blocks.iter().map(|r| r.1).collect(),
            outer_offsets: offsets(&outer),
            outer_refs: outer.iter().map(|r| r.1).collect(),
            diagonal_offsets,
            diagonal_refs: diagonal.iter().map(|r| r.1).collect(),
        };
        (assembler, pattern)
    }

    /// Memory of maps and element arrays [B].
    pub(crate) fn bytes(&self) -> usize {
        4 * (self.block_offsets.len()
            + self.block_refs.len()
            + self.outer_offsets.len()
            + self.outer_refs.len()
            + self.diagonal_offsets.len()
            + self.diagonal_refs.len())
            + self.elements.bytes()
    }

    /// Fills `matrix` with `diagonal(row)` I plus the elements' couplings. Call on the pool.
    pub(crate) fn gather(&self, matrix: &mut BlockMatrix, diagonal: &(impl Fn(usize) -> f64 + Sync)) {
        let pattern = matrix.pattern.clone();
        let end = |chunk: usize| 9 * pattern.offsets[pattern.chunk_rows(chunk).end] as usize;
        let values = 9 * pattern.upper_count();
        for_parts(0..pattern.chunks(), &mut matrix.upper[..values], &end, &|chunk, out| {
            let rows = pattern.chunk_rows(chunk);
            let first = pattern.offsets[rows.start] as usize;
            for (k, block) in out.as_chunks_mut::<9>().0.iter_mut().enumerate() {
                *block = self.upper_block(first + k);
            }
        });
        let upper = &matrix.upper;
        let rows_end = |chunk: usize| pattern.chunk_rows(chunk).end;
        for_parts(0..pattern.chunks(), &mut matrix.diagonal, &rows_end, &|chunk, out| {
            for (row, block) in pattern.chunk_rows(chunk).zip(out) {
                let refs = self.diagonal_offsets[row] as usize..self.diagonal_offsets[row + 1] as usize;
                let scalar: f64 =
                    self.diagonal_refs[refs].iter().map(|&r| self.elements.diagonal[r as usize]).sum();
                *block = diagonal_block(&pattern, upper, row, diagonal(row) + scalar);
            }
        });
    }

    /// Sum of what the elements couple between the two vertices of upper block `k`.
    #[inline]
    fn upper_block(&self, k: usize) -> [f64; 9] {
        let mut direct = [0.0; 9];
        let mut transposed = [0.0; 9];
        for &r in &self.block_refs[self.block_offsets[k] as usize..self.block_offsets[k + 1] as usize] {
            let block = &self.elements.blocks[(r >> 1) as usize];
            let sum = if r & 1 == 0 { &mut direct } else { &mut transposed };
            for i in 0..9 {
                sum[i] += block[i];
            }
        }
        for &r in &self.outer_refs[self.outer_offsets[k] as usize..self.outer_offsets[k + 1] as usize] {
            let outer = &self.elements.outer[(r >> 4) as usize];
            let (row, column) = (&outer.gradient[(r >> 2 & 3) as usize], &outer.gradient[(r & 3) as usize]);
            for c in 0..3 {
                let s = outer.scale * column[c];
                for i in 0..3 {
                    direct[3 * c + i] += s * row[i];
                }
            }
        }
        for i in 0..9 {
            direct[i] += transposed[3 * (i % 3) + i / 3];
        }
        direct
    }
}

/// `scalar` I minus the sum of the row's other blocks, made exactly symmetric.
#[inline]
fn diagonal_block(pattern: &Pattern, upper: &[f64], row: usize, scalar: f64) -> [f64; 9] {
    let mut sum = [0.0; 9];
    let mut transposed = [0.0; 9];
    for k in pattern.upper_of(row) {
        for i in 0..9 {
            sum[i] -= upper[9 * k + i];
        }
    }
    for &[_, k] in pattern.lower_of(row) {
        let block = &upper[9 * k as usize..9 * k as usize + 9];
        for i in 0..9 {
            transposed[i] -= block[i];
        }
    }
    let mut block = [0.0; 9];
    for column in 0..3 {
        for row in 0..3 {
            let (i, t) = (3 * column + row, 3 * row + column);
            block[i] = 0.5 * ((sum[i] + transposed[t]) + (sum[t] + transposed[i]));
        }
        block[4 * column] += scalar;
    }
    block
}
