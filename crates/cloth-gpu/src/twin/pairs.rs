//! Twins of `pairs_count.wgsl` and `pairs_test.wgsl`.

use crate::layout::{Bounds, Entry};
use crate::twin::bounds::MovingBox;
use crate::twin::cells::is_left_to_other_cell;

/// Factor of the kernel's sphere test.
pub const SPHERE_FACTOR: f32 = 1.00001;

/// How many tests each registration begins; `keys` sorted.
pub fn pairs_count(keys: &[u32]) -> Vec<u32> {
    let tests = |r: usize| match keys[r] & 1 {
        0 => keys[r..].partition_point(|&k| k <= keys[r] + 1) as u32 - 1,
        _ => 0,
    };
    (0..keys.len()).map(tests).collect()
}

/// Whether features of these bodies may meet; words as in [`crate::stages::bounds::triangle_words`].
pub fn bodies_meet(a: u32, b: u32) -> bool {
    if a >> 2 == b >> 2 { a & 1 != 0 } else { (a | b) & 2 != 0 }
}

/// Whether the squared distance of the spheres' centres is at most `factor` times that of touching ones.
pub fn spheres_touch(a: &Entry, b: &Entry, factor: f32) -> bool {
    let squared: f32 = (0..3).map(|k| (a.centre[k] - b.centre[k]) * (a.centre[k] - b.centre[k])).sum();
    squared <= (a.radius + b.radius) * (a.radius + b.radius) * factor
}

/// The triangle pairs of the tests from `start` on, `count` of them, that pass; in the order of the tests.
pub fn pairs_test(
    counts: &[u32],
    entries: &[Entry],
    bounds: &[Bounds],
    start: u64,
    count: u64,
    factor: f32,
) -> Vec<[u32; 2]> {
    let mut out = vec![];
    let mut before = 0u64;
    for (r, &tests) in counts.iter().enumerate() {
        let first = start.saturating_sub(before).min(tests.into());
        let last = (start + count).saturating_sub(before).min(tests.into());
        for partner in first as usize..last as usize {
            let (a, b) = (&entries[r], &entries[r + 1 + partner]);
            let (x, y) = (&bounds[a.triangle as usize], &bounds[b.triangle as usize]);
            if spheres_touch(a, b, factor)
                && (b.key & 1 == 0 || !is_left_to_other_cell(a.control, b.control))
                && (x.is_active | y.is_active) != 0
                && bodies_meet(x.body, y.body)
                && MovingBox::from(x).may_touch(&y.into())
            {
                out.push([a.triangle, b.triangle]);
            }
        }
        before += u64::from(tests);
    }
    out
}

/// The registration that begins each of the `count` tests from `start` on, for as many as there are.
pub fn pairs_owners(counts: &[u32], start: u64, count: u32) -> Vec<u32> {
    let (mut marks, mut before) = (vec![0u32; count as usize], 0u64);
    for (r, &tests) in counts.iter().enumerate() {
        let after = before + u64::from(tests);
        if before <= start && after > start {
            marks[0] += r as u32;
        } else if before > start && before - start < count.into() {
            marks[(before - start) as usize] += 1;
        }
        before = after;
    }
    let there = before.saturating_sub(start).min(count.into()) as usize;
    let mut sum = 0;
    marks.truncate(there);
    marks
        .iter()
        .map(|m| {
            sum += m;
            sum
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_those_of_the_definition() {
        let keys = [0, 0, 1, 1, 3, 4, 6, 6, 6, 9, 9, 12];
        // Per cell: pairs with one at home. Cell 0: 2 at home, 2 guests; 1: guests only; 3: 3 at home.
        assert_eq!(pairs_count(&keys), [3, 2, 0, 0, 0, 0, 2, 1, 0, 0, 0, 0]);
        assert!(pairs_count(&[]).is_empty());
    }

    #[test]
    fn owners_are_those_of_the_definition() {
        let counts = [0, 3, 0, 0, 2, 1, 0, 4, 0];
        let all = [1, 1, 1, 4, 4, 5, 7, 7, 7, 7];
        for start in 0..10 {
            for count in 1..12 {
                let expected = &all[start..(start + count).min(10)];
                assert_eq!(pairs_owners(&counts, start as u64, count as u32), expected, "{start}, {count}");
            }
        }
        assert!(pairs_owners(&[], 0, 4).is_empty());
    }

    #[test]
    fn parts_make_the_whole() {
        let entry =
            |k: u32| Entry { centre: [k as f32, 0.0, 0.0], radius: 1.0, triangle: k, ..Default::default() };
        let entries: Vec<Entry> = (0..20).map(entry).collect();
        let bounds = vec![Bounds { is_active: 1, body: 3, ..Default::default() }; 20];
        let counts = pairs_count(&[0; 20]);
        let all = pairs_test(&counts, &entries, &bounds, 0, 190, SPHERE_FACTOR);
        assert_eq!(all.len(), 19 + 18);
        let parts = |size: u64| {
            (0..190u64.div_ceil(size))
                .flat_map(|p| pairs_test(&counts, &entries, &bounds, p * size, size, SPHERE_FACTOR))
                .collect::<Vec<_>>()
        };
        assert_eq!(parts(7), all);
        assert_eq!(parts(64), all);
        assert_ne!(pairs_test(&counts, &entries, &bounds, 1, 189, SPHERE_FACTOR), all);
    }
}
