//! Twin of `compact.wgsl`.

/// `kept[offsets[i]] = values[i]` wherever `flags[i]` is not 0; `offsets`: exclusive scan of `flags`, total last.
pub fn compact(flags: &[u32], offsets: &[u64], values: &[u32]) -> Vec<u32> {
    let mut kept = vec![0; offsets[flags.len()] as usize];
    for i in 0..flags.len() {
        if flags[i] != 0 {
            kept[offsets[i] as usize] = values[i];
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn twin_matches_definition() {
        let flags: Vec<u32> = (0..1000).map(|i| u32::from(i % 7 < 3)).collect();
        let values: Vec<u32> = (0..1000).map(|i| i * i).collect();
        let wide: Vec<u64> = flags.iter().map(|&f| f.into()).collect();
        let expected: Vec<u32> =
            flags.iter().zip(&values).filter(|(f, _)| **f != 0).map(|(_, v)| *v).collect();
        assert_eq!(compact(&flags, &crate::twin::scan::scan(&wide), &values), expected);
        assert_eq!(compact(&[], &[0], &[]), [0; 0]);
    }
}
