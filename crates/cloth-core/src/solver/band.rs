//! Symmetric positive definite band matrix: Cholesky factorisation and solution in place.

/// Lower band, row by row: row r holds columns r − width ..= r.
pub(super) struct Band {
    size: usize,
    width: usize,
    values: Vec<f64>,
    /// 1 / diagonal of the factor.
    inverse: Vec<f64>,
}

impl Band {
    pub(super) fn new(size: usize, width: usize) -> Self {
        Self { size, width, values: vec![0.0; size * (width + 1)], inverse: vec![0.0; size] }
    }

    pub(super) fn bytes(&self) -> usize {
        8 * (self.values.len() + self.inverse.len())
    }

    pub(super) fn clear(&mut self) {
        self.values.fill(0.0);
    }

    /// Adds to entry (row, column ≤ row) within the band.
    #[inline]
    pub(super) fn add(&mut self, row: usize, column: usize, value: f64) {
        self.values[row * (self.width + 1) + self.width + column - row] += value;
    }

    /// Replaces the matrix by its factor L with L Lᵀ. A row without entries becomes that of the identity; false if a pivot is
    /// not positive.
    pub(super) fn factorise(&mut self) -> bool {
        let stride = self.width + 1;
        for row in 0..self.size {
            let first = row.saturating_sub(self.width);
            let (done, rest) = self.values.split_at_mut(row * stride);
            let mine = &mut rest[..stride];
            // Entry (row, c) lies at c + shift.
            let shift = |r: usize| self.width.wrapping_sub(r);
            for column in first..row {
                let other = &done[column * stride..(column + 1) * stride];
                let start = first.max(column.saturating_sub(self.width));
                let a = &mine[start.wrapping_add(shift(row))..column.wrapping_add(shift(row))];
                let b = &other[start.wrapping_add(shift(column))..column.wrapping_add(shift(column))];
                let at = column.wrapping_add(shift(row));
                mine[at] = (mine[at] - dot(a, b)) * self.inverse[column];
            }
            let squares = dot(&mine[..self.width], &mine[..self.width]);
            let diagonal = mine[self.width];
            let pivot = if diagonal == 0.0 { 1.0 } else { diagonal - squares };
            if !(pivot > 0.0 && pivot.is_finite()) {
                return false;
            }
            let root = pivot.sqrt();
            mine[self.width] = root;
            self.inverse[row] = 1.0 / root;
        }
        true
    }

    /// Solves L Lᵀ x = b in place.
    pub(super) fn solve(&self, x: &mut [f64]) {
        let stride = self.width + 1;
        for row in 0..self.size {
            let first = row.saturating_sub(self.width);
            let entries = &self.values[row * stride + self.width - (row - first)..row * stride + self.width];
            x[row] = (x[row] - dot(entries, &x[first..row])) * self.inverse[row];
        }
        for row in (0..self.size).rev() {
            let first = row.saturating_sub(self.width);
            let entries = &self.values[row * stride + self.width - (row - first)..row * stride + self.width];
            let value = x[row] * self.inverse[row];
            x[row] = value;
            for (x, l) in x[first..row].iter_mut().zip(entries) {
                *x -= l * value;
            }
        }
    }
}

/// Dot product in eight interleaved partial sums.
#[inline]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (a8, a_rest) = a.as_chunks::<8>();
    let (b8, b_rest) = b.as_chunks::<8>();
    for (a, b) in a8.iter().zip(b8) {
        for l in 0..8 {
            sums[l] += a[l] * b[l];
        }
    }
    for (l, (a, b)) in a_rest.iter().zip(b_rest).enumerate() {
        sums[l] += a * b;
    }
    ((sums[0] + sums[4]) + (sums[1] + sums[5])) + ((sums[2] + sums[6]) + (sums[3] + sums[7]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_a_band_system() {
        for (size, width) in [(1, 0), (5, 2), (40, 13), (7, 20)] {
            let entry = |r: usize, c: usize| {
                if r == c { 10.0 + r as f64 } else { ((r * 7 + c * 3) % 5) as f64 * 0.1 - 0.2 }
            };
            let mut band = Band::new(size, width);
            for r in 0..size {
                for c in r.saturating_sub(width)..=r {
                    band.add(r, c, entry(r, c));
                }
            }
            let x: Vec<f64> = (0..size).map(|i| (i as f64 * 0.7).sin() + 0.3).collect();
            let mut b: Vec<f64> = (0..size)
                .map(|r| {
                    (0..size)
                        .filter(|c| r.abs_diff(*c) <= width)
                        .map(|c| entry(r.max(c), r.min(c)) * x[c])
                        .sum()
                })
                .collect();
            assert!(band.factorise());
            band.solve(&mut b);
            let error = x.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(error < 1e-12, "{size} {width}: {error:e}");
        }
    }

    #[test]
    fn refuses_an_indefinite_matrix_and_passes_an_empty_row() {
        let mut band = Band::new(2, 1);
        band.add(0, 0, 1.0);
        band.add(1, 0, 2.0);
        band.add(1, 1, 1.0);
        assert!(!band.factorise());
        band.clear();
        band.add(1, 1, 4.0);
        assert!(band.factorise());
        let mut x = [3.0, 8.0];
        band.solve(&mut x);
        assert_eq!(x, [3.0, 2.0]);
    }
}
