//! The pattern in the solver's order, cut into domains, and work over domains.

use super::Partial;
use crate::assembly::{BlockMatrix, Pattern};

/// Rows per domain: few enough domains that their borders do not weaken the sweeps, enough for the threads.
const DOMAIN_ROWS: usize = 1200;
/// Most domains.
const MAX_DOMAINS: usize = 64;

/// The pattern in the solver's order.
pub(super) struct Rows {
    /// Original vertex of each row.
    pub(super) order: Vec<u32>,
    /// First row of each domain, and the number of rows.
    pub(super) domains: Vec<usize>,
    /// Upper blocks of row i: `upper[i]..middle[i]` inside its domain, `middle[i]..upper[i + 1]` across.
    pub(super) upper: Vec<u32>,
    pub(super) middle: Vec<u32>,
    pub(super) columns: Vec<u32>,
    /// Original upper block × 2, plus 1 where its transpose is taken.
    pub(super) source: Vec<u32>,
    /// Lower entries (column, upper block) of row i, inside its domain and across.
    pub(super) lower: Vec<u32>,
    pub(super) lower_middle: Vec<u32>,
    pub(super) lower_entries: Vec<[u32; 2]>,
}

impl Rows {
    pub(super) fn new(pattern: &Pattern, order: Vec<u32>) -> Self {
        let n = pattern.rows;
        let mut place = vec![0u32; n];
        for (i, &v) in order.iter().enumerate() {
            place[v as usize] = i as u32;
        }
        let count = n.div_ceil(DOMAIN_ROWS).clamp(1, MAX_DOMAINS);
        let domains: Vec<usize> = (0..=count).map(|d| d * n / count).collect();
        let mut domain_of = vec![0u32; n];
        for d in 0..count {
            domain_of[domains[d]..domains[d + 1]].fill(d as u32);
        }
        // (row, across, column, source), sorted.
        let mut blocks = Vec::with_capacity(pattern.upper_count());
        for i in 0..n {
            for k in pattern.upper_of(i) {
                let (a, b) = (place[i], place[pattern.columns[k] as usize]);
                let across = domain_of[a as usize] != domain_of[b as usize];
                blocks.push((a.min(b), across, a.max(b), 2 * k as u32 + u32::from(a > b)));
            }
        }
        blocks.sort_unstable();
        let mut upper = vec![0u32; n + 1];
        let mut inside = vec![0u32; n];
        let mut entries = Vec::with_capacity(blocks.len());
        for (k, &(row, across, column, _)) in blocks.iter().enumerate() {
            upper[row as usize + 1] += 1;
            inside[row as usize] += u32::from(!across);
            entries.push((column, across, row, k as u32));
        }
        entries.sort_unstable();
        let mut lower = vec![0u32; n + 1];
        let mut lower_inside = vec![0u32; n];
        for &(column, across, ..) in &entries {
            lower[column as usize + 1] += 1;
            lower_inside[column as usize] += u32::from(!across);
        }
        for i in 0..n {
            upper[i + 1] += upper[i];
            lower[i + 1] += lower[i];
        }
        Self {
            middle: (0..n).map(|i| upper[i] + inside[i]).collect(),
            lower_middle: (0..n).map(|i| lower[i] + lower_inside[i]).collect(),
            columns: blocks.iter().map(|b| b.2).collect(),
            source: blocks.iter().map(|b| b.3).collect(),
            lower_entries: entries.iter().map(|e| [e.2, e.3]).collect(),
            order,
            domains,
            upper,
            lower,
        }
    }

    pub(super) fn len(&self) -> usize {
        self.order.len()
    }

    pub(super) fn domains(&self) -> usize {
        self.domains.len() - 1
    }

    pub(super) fn bytes(&self) -> usize {
        4 * (self.order.len()
            + self.upper.len()
            + self.middle.len()
            + self.columns.len()
            + self.source.len()
            + self.lower.len()
            + self.lower_middle.len())
            + 8 * self.lower_entries.len()
    }
}

/// Original block, or its transpose.
#[inline]
pub(super) fn oriented(a: &BlockMatrix, source: u32) -> [f64; 9] {
    let k = 9 * (source >> 1) as usize;
    let values = &a.upper[k..k + 9];
    let mut block = [0.0; 9];
    if source & 1 == 0 {
        block.copy_from_slice(values);
    } else {
        for i in 0..9 {
            block[i] = values[3 * (i % 3) + i / 3];
        }
    }
    block
}

/// Slices with one entry per row that are cut at the same rows.
pub(super) trait Parts: Send {
    fn split(self, at: usize) -> (Self, Self)
    where
        Self: Sized;
}

impl Parts for () {
    fn split(self, _at: usize) -> (Self, Self) {
        ((), ())
    }
}

impl<T: Send> Parts for &mut [T] {
    fn split(self, at: usize) -> (Self, Self) {
        self.split_at_mut(at)
    }
}

impl<A: Parts, B: Parts> Parts for (A, B) {
    fn split(self, at: usize) -> (Self, Self) {
        let ((a, c), (b, d)) = (self.0.split(at), self.1.split(at));
        ((a, b), (c, d))
    }
}

/// Runs `f(domain, its rows of parts, its partial sums)` for all domains, in parallel.
pub(super) fn for_domains<P: Parts>(
    bounds: &[usize],
    parts: P,
    partial: &mut [Partial],
    f: &(impl Fn(usize, P, &mut Partial) + Sync),
) {
    fn recurse<P: Parts>(
        bounds: &[usize],
        first: usize,
        parts: P,
        partial: &mut [Partial],
        f: &(impl Fn(usize, P, &mut Partial) + Sync),
    ) {
        match partial {
            [] => {}
            [one] => f(first, parts, one),
            _ => {
                let half = partial.len() / 2;
                let (a, b) = parts.split(bounds[first + half] - bounds[first]);
                let (left, right) = partial.split_at_mut(half);
                rayon::join(
                    || recurse(bounds, first, a, left, f),
                    || recurse(bounds, first + half, b, right, f),
                );
            }
        }
    }
    recurse(bounds, 0, parts, partial, f);
}
