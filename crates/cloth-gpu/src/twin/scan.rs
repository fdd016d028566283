//! Twins of `scan_reduce.wgsl` and `scan_apply.wgsl`.

use crate::limits::SCAN_BLOCK;

/// `sums[b]` = total of block b of `input`; wraps at 2^64 (the narrow kernel at 2^32).
pub fn scan_reduce(input: &[u64]) -> Vec<u64> {
    input
        .chunks(SCAN_BLOCK as usize)
        .map(|block| block.iter().fold(0u64, |s, &x| s.wrapping_add(x)))
        .collect()
}

/// `output[i]` = `bases` of i's block plus what comes before i in it, for i ≤ n. No `bases`: they are zero.
pub fn scan_apply(input: &[u64], bases: &[u64]) -> Vec<u64> {
    let block = SCAN_BLOCK as usize;
    let mut output = vec![0; input.len() + 1];
    for b in 0..input.len().div_ceil(block) {
        let mut sum = bases.get(b).copied().unwrap_or(0);
        for i in b * block..((b + 1) * block).min(input.len()) {
            output[i] = sum;
            sum = sum.wrapping_add(input[i]);
            output[i + 1] = sum;
        }
    }
    output
}

/// The levels in order: the exclusive scan of `input`, with the total at its end.
pub fn scan(input: &[u64]) -> Vec<u64> {
    if input.len() <= SCAN_BLOCK as usize {
        return scan_apply(input, &[]);
    }
    let bases = scan(&scan_reduce(input));
    scan_apply(input, &bases)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twin_matches_definition() {
        let block = SCAN_BLOCK as usize;
        for n in [0, 1, block - 1, block, block + 1, 3 * block + 7, block * block + 1] {
            let input: Vec<u64> = (0..n as u64).map(|i| i * i % 1001 + (1 << 40)).collect();
            let got = scan(&input);
            let mut sum = 0;
            for i in 0..n {
                assert_eq!(got[i], sum, "{n}: {i}");
                sum += input[i];
            }
            assert_eq!(got[n], sum);
        }
    }
}
