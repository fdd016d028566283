//! The coarse space: motions that are constant on each aggregate of vertices.

use super::{
    super::band::Band,
    rows::{Rows, oriented},
};
use crate::assembly::{BlockMatrix, Lanes};

/// The coarse space.
pub(super) struct Coarse {
    /// Aggregate of each row.
    pub(super) aggregate: Vec<u32>,
    /// Entries of T ᵀW of row i: `offsets[i]..offsets[i + 1]`, the row's own aggregate first.
    pub(super) offsets: Vec<u32>,
    pub(super) columns: Vec<u32>,
    /// One more block at the end, so that any column can be read four wide.
    pub(super) values: Vec<[f64; 9]>,
    /// Entry that each upper block inside a domain counts to.
    pub(super) slots: Vec<u32>,
    pub(super) band: Band,
    /// Aggregates that the rows of each domain touch: first, and one past the last.
    pub(super) reach: Vec<[u32; 2]>,
    /// Restricted residual and its solution, three values per aggregate.
    pub(super) residual: Vec<f64>,
    scratch: Vec<f64>,
    /// The solution, one vector per aggregate.
    pub(super) solution: Vec<Lanes>,
}

impl Coarse {
    pub(super) fn new(rows: &Rows, aggregate_of_vertex: &[u32], count: usize) -> Self {
        // Aggregates numbered in the order in which rows meet them, which keeps the band narrow.
        let mut number = vec![u32::MAX; count];
        let mut next = 0;
        let aggregate: Vec<u32> = rows
            .order
            .iter()
            .map(|&v| {
                let slot = &mut number[aggregate_of_vertex[v as usize] as usize];
                if *slot == u32::MAX {
                    *slot = next;
                    next += 1;
                }
                *slot
            })
            .collect();
        let (mut offsets, mut columns) = (vec![0u32], Vec::new());
        let mut slots = vec![0u32; rows.columns.len()];
        let mut width = 0;
        for i in 0..rows.len() {
            let first = columns.len();
            columns.push(aggregate[i]);
            for k in rows.upper[i] as usize..rows.upper[i + 1] as usize {
                let other = aggregate[rows.columns[k] as usize];
                width = width.max(other.abs_diff(aggregate[i]));
                if k < rows.middle[i] as usize {
                    let known = columns[first..].iter().position(|&c| c == other);
                    slots[k] = (first + known.unwrap_or(columns.len() - first)) as u32;
                    if known.is_none() {
                        columns.push(other);
                    }
                }
            }
            offsets.push(columns.len() as u32);
        }
        let reach_of = |d: usize| {
            let entries = offsets[rows.domains[d]] as usize..offsets[rows.domains[d + 1]] as usize;
            let touched = columns[entries].iter();
            [touched.clone().min().map_or(0, |c| *c), touched.max().map_or(0, |c| *c + 1)]
        };
        let reach = (0..rows.domains()).map(reach_of).collect();
        let size = 3 * count;
        Self {
            aggregate,
            offsets,
            reach,
            values: vec![[0.0; 9]; columns.len() + 1],
            columns,
            slots,
            band: Band::new(size, 3 * width as usize + 2),
            residual: vec![0.0; size],
            scratch: vec![0.0; size],
            solution: vec![Lanes::ZERO; count],
        }
    }

    pub(super) fn bytes(&self) -> usize {
        4 * (self.aggregate.len() + self.offsets.len() + self.columns.len() + self.slots.len())
            + size_of_val(self.values.as_slice())
            + self.band.bytes()
    }
}

impl Coarse {
    /// Coarse solution y of the restricted residual; returns their dot product.
    pub(super) fn solve(&mut self) -> f64 {
        self.scratch.copy_from_slice(&self.residual);
        self.band.solve(&mut self.scratch);
        for (lanes, y) in self.solution.iter_mut().zip(self.scratch.as_chunks::<3>().0) {
            *lanes = Lanes([y[0], y[1], y[2], 0.0]);
        }
        self.residual.iter().zip(&self.scratch).map(|(r, y)| r * y).sum()
    }
}

/// Factor of E = Wᵀ A W over the free vertices, into `band`; false if it is not positive definite.
pub(super) fn build_band(
    band: &mut Band,
    aggregate: &[u32],
    rows: &Rows,
    a: &BlockMatrix,
    pinned: &[bool],
) -> bool {
    band.clear();
    for i in 0..rows.len() {
        let vertex = rows.order[i] as usize;
        if pinned[vertex] {
            continue;
        }
        let own = 3 * aggregate[i] as usize;
        let mut diagonal = a.diagonal[vertex];
        for k in rows.upper[i] as usize..rows.upper[i + 1] as usize {
            let j = rows.columns[k] as usize;
            if pinned[rows.order[j] as usize] {
                continue;
            }
            let block = oriented(a, rows.source[k]);
            let other = 3 * aggregate[j] as usize;
            if other == own {
                for i in 0..9 {
                    diagonal[i] += block[i] + block[3 * (i % 3) + i / 3];
                }
            } else {
                for c in 0..3 {
                    for r in 0..3 {
                        // The lower part of E: the row is the later aggregate.
                        if other > own {
                            band.add(other + c, own + r, block[3 * c + r]);
                        } else {
                            band.add(own + r, other + c, block[3 * c + r]);
                        }
                    }
                }
            }
        }
        for c in 0..3 {
            for r in c..3 {
                band.add(own + r, own + c, diagonal[3 * c + r]);
            }
        }
    }
    band.factorise()
}
