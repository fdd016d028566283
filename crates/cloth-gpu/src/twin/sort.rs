//! Twins of `radix_count.wgsl` and `radix_scatter.wgsl`.

use crate::limits::{DIGIT_BITS, RADIX, SORT_BLOCK};

/// A key with its value.
pub type Entry = (u64, u32);

fn digit(key: u64, shift: u32) -> usize {
    (key >> shift) as usize & (RADIX as usize - 1)
}

/// `counts[d · blocks + b]`: keys of block b with the digit d at bit `shift`.
pub fn radix_count(entries: &[Entry], shift: u32) -> Vec<u64> {
    let blocks = entries.len().div_ceil(SORT_BLOCK as usize);
    let mut counts = vec![0; RADIX as usize * blocks];
    for (b, block) in entries.chunks(SORT_BLOCK as usize).enumerate() {
        for &(key, _) in block {
            counts[digit(key, shift) * blocks + b] += 1;
        }
    }
    counts
}

/// The entries by one digit, in their order where it is equal. `offsets`: exclusive scan of the counts.
pub fn radix_scatter(entries: &[Entry], offsets: &[u64], shift: u32) -> Vec<Entry> {
    let blocks = entries.len().div_ceil(SORT_BLOCK as usize);
    let mut out = vec![(0, 0); entries.len()];
    for (b, block) in entries.chunks(SORT_BLOCK as usize).enumerate() {
        let mut next: Vec<u64> = (0..RADIX as usize).map(|d| offsets[d * blocks + b]).collect();
        for &entry in block {
            let place = &mut next[digit(entry.0, shift)];
            out[*place as usize] = entry;
            *place += 1;
        }
    }
    out
}

/// All passes: the entries by the lowest `bits` bits of their keys, in their order where these are equal.
pub fn sort(entries: &[Entry], bits: u32) -> Vec<Entry> {
    let mut entries = entries.to_vec();
    for shift in (0..bits).step_by(DIGIT_BITS as usize) {
        let offsets = super::scan::scan(&radix_count(&entries, shift));
        entries = radix_scatter(&entries, &offsets, shift);
    }
    entries
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twin_matches_definition() {
        let block = SORT_BLOCK as usize;
        for n in [0, 1, block - 1, block, block + 1, 5 * block + 3] {
            for bits in [32, 64] {
                let mask = if bits == 64 { u64::MAX } else { 0xffff_ffff };
                // Few different keys: the order of equal ones shows.
                let key = |i: usize| {
                    let few = (i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 57;
                    few.wrapping_mul(0x0123_4567_89ab_cdef) & mask
                };
                let entries: Vec<Entry> = (0..n).map(|i| (key(i), i as u32)).collect();
                let mut expected = entries.clone();
                expected.sort_by_key(|e| e.0);
                assert_eq!(sort(&entries, bits), expected, "{n}, {bits}");
            }
        }
    }
}
