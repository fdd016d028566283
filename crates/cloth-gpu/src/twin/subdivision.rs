//! Twins of `radius_words.wgsl`, `subdivision_setup.wgsl`, `subdivision_plan.wgsl`, `subdivision_parts.wgsl` and
//! `cells_mark.wgsl`.

use crate::layout::{Grid, SubdivisionParams};
use crate::limits::{CELL_RADII, MAX_CELLS, MAX_PART_BITS, MIN_CELL, PART_SLACK, PLANE_SLACK, REACH};

type Point = [f32; 3];

fn each(f: impl Fn(usize) -> f32) -> Point {
    [f(0), f(1), f(2)]
}

fn length(a: Point) -> f32 {
    (a[0] * a[0] + a[1] * a[1] + a[2] * a[2]).sqrt()
}

/// Corners of a triangle at both ends, (x, y, z, r).
pub type Motion = [[[f32; 4]; 3]; 2];

/// The corners of triangle `corners` at both ends.
pub fn motion(params: &SubdivisionParams, positions: &[[f32; 4]], corners: &[u32; 4]) -> Motion {
    [0, params.second].map(|end| [0, 1, 2].map(|k| positions[(end + corners[k]) as usize]))
}

/// Radii as words: units of 2⁻²⁰, rounded up.
pub fn radius_words(spheres: &[[f32; 4]]) -> Vec<u32> {
    spheres.iter().map(|s| (s[3] * 1_048_576.0).ceil() as u32).collect()
}

/// The cells for radii that add up to `sum`, in units of 2⁻²⁰, and the bits of their keys.
pub fn subdivision_setup(params: &SubdivisionParams, sum: u64) -> (Grid, u32) {
    let average = sum as f32 / params.triangles as f32 / 1_048_576.0;
    let mut size = (CELL_RADII * (params.coarseness * average).max(2.0 * params.least)).max(MIN_CELL);
    let cells_of = |size: f32| each(|k| ((params.high[k] - params.low[k]) / size).ceil().max(1.0));
    let mut cells = cells_of(size);
    while cells.iter().product::<f32>() > MAX_CELLS {
        size *= 1.25;
        cells = cells_of(size);
    }
    let cells = cells.map(|c| c as u32);
    let keys = 2 * cells.iter().product::<u32>();
    (Grid { low: params.low, size, cells, inverse: 1.0 / size }, 32 - (keys - 1).leading_zeros())
}

/// What a part's radius may be in cells of this size.
pub fn limit(size: f32) -> f32 {
    (size / CELL_RADII).min((size / 2.02 - 2.0 * PLANE_SLACK) / REACH)
}

/// How often a triangle with a sphere of `radius` is halved in space and in time; None: too often.
pub fn subdivision_plan(least: f32, limit: f32, radius: f32, motion: &Motion) -> Option<(u32, u32)> {
    if radius <= limit {
        return Some((0, 0));
    }
    let [p, q] = motion;
    let centre = |p: &[[f32; 4]; 3]| each(|k| (p[0][k] + p[1][k] + p[2][k]) / 3.0);
    let (centre_0, centre_1) = (centre(p), centre(q));
    let (mut extent, mut moved) = (0.0f32, 0.0f32);
    for i in 0..3 {
        extent = extent.max(length(each(|k| p[i][k] - centre_0[k])));
        extent = extent.max(length(each(|k| q[i][k] - centre_1[k])));
        moved = moved.max(0.5 * length(each(|k| q[i][k] - p[i][k])));
    }
    let rest = 0.999 * limit - least;
    let (mut in_space, mut in_time) = (0, 0);
    while extent + moved > rest && 2 * in_space + in_time < MAX_PART_BITS {
        if extent > moved {
            extent *= 0.5;
            in_space += 1;
        } else {
            moved *= 0.5;
            in_time += 1;
        }
    }
    (extent + moved <= rest && 2 * in_space + in_time <= MAX_PART_BITS).then_some((in_space, in_time))
}

/// The part `number` of a triangle that is halved `in_space` and `in_time`: its corners in barycentric coordinates, and its part of
/// the time.
pub fn part(number: u32, in_space: u32, in_time: u32) -> ([Point; 3], [f32; 2]) {
    let half = |a: Point, b: Point| each(|k| 0.5 * (a[k] + b[k]));
    let (mut a, mut b, mut c) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    for level in 0..in_space {
        let (ab, bc, ca) = (half(a, b), half(b, c), half(c, a));
        (a, b, c) = match number >> (in_time + 2 * level) & 3 {
            0 => (a, ab, ca),
            1 => (ab, b, bc),
            2 => (ca, bc, c),
            _ => (ab, bc, ca),
        };
    }
    let interval = 1.0 / (1u32 << in_time) as f32;
    let start = (number & ((1 << in_time) - 1)) as f32 * interval;
    ([a, b, c], [start, start + interval])
}

/// Centre and radius of a ball that holds the part of a moving triangle during its part of the time.
pub fn part_sphere(motion: &Motion, corners: &[Point; 3], times: [f32; 2]) -> [f32; 4] {
    let mut at = vec![];
    for time in times {
        let x = [0, 1, 2].map(|i| each(|k| (1.0 - time) * motion[0][i][k] + time * motion[1][i][k]));
        at.extend(corners.iter().map(|w| each(|k| w[0] * x[0][k] + w[1] * x[1][k] + w[2] * x[2][k])));
    }
    let reach = motion.iter().flatten().fold(0.0f32, |r, p| r.max(p[3]));
    let centre = each(|k| at.iter().map(|p| p[k]).sum::<f32>() / 6.0);
    let distance = at.iter().fold(0.0f32, |d, p| d.max(length(each(|k| p[k] - centre[k]))));
    [centre[0], centre[1], centre[2], (distance + 1.7321 * reach + PART_SLACK) * 1.00001]
}

/// Which registrations (key, part) are kept; sorted by key, then by part. `roots`: the triangle of each part.
pub fn cells_mark(registrations: &[(u64, u32)], roots: &[u32]) -> Vec<bool> {
    let mut seen = std::collections::BTreeSet::new();
    let keep = |&(key, part): &(u64, u32)| {
        // At home comes before guest in each cell.
        let root = roots[part as usize];
        seen.insert((key, root)) && (key & 1 == 0 || !seen.contains(&(key - 1, root)))
    };
    registrations.iter().map(keep).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn random(state: &mut u64) -> f32 {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*state >> 40) as f32 / (1u32 << 23) as f32 - 1.0
    }

    /// Points of the triangle at times of the step that no part with that time holds; `broken`: parts as if only three of
    /// four children were there.
    fn uncovered(broken: bool) -> usize {
        let (mut state, mut lost) = (5, 0);
        for _ in 0..40 {
            let motion: Motion = [(); 2].map(|()| {
                [(); 3].map(|()| [(); 4].map(|()| random(&mut state))).map(|p| [p[0], p[1], p[2], 1e-3])
            });
            let (least, limit) = (0.002, 0.15);
            let (l, m) = subdivision_plan(least, limit, 9.0, &motion).unwrap();
            let parts: Vec<([f32; 4], [f32; 2])> = (0..1u32 << (2 * l + m))
                .filter(|k| !broken || k >> m & 3 != 3)
                .map(|k| part(k, l, m))
                .map(|(corners, times)| (part_sphere(&motion, &corners, times), times))
                .collect();
            assert!(parts.iter().all(|p| p.0[3] <= limit), "a part is larger than allowed");
            for _ in 0..50 {
                let (u, v, t) =
                    (random(&mut state).abs(), random(&mut state).abs(), random(&mut state).abs());
                let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
                let x = each(|k| {
                    let at = |i: usize| (1.0 - t) * motion[0][i][k] + t * motion[1][i][k];
                    (1.0 - u - v) * at(0) + u * at(1) + v * at(2)
                });
                let holds = |(s, times): &([f32; 4], [f32; 2])| {
                    times[0] <= t && t <= times[1] && length(each(|k| x[k] - s[k])) <= s[3]
                };
                lost += usize::from(!parts.iter().any(holds));
            }
        }
        lost
    }

    #[test]
    fn parts_cover_the_triangle_at_all_times() {
        assert_eq!(uncovered(false), 0);
    }

    #[test]
    fn a_missing_child_is_caught() {
        assert!(uncovered(true) > 0);
    }

    #[test]
    fn one_part_per_triangle_and_cell_is_kept_one_at_home_if_there_is_any() {
        // Parts 0..3 of triangle 0, 4 and 5 of triangle 1, 6 of triangle 2.
        let roots = [0, 0, 0, 0, 1, 1, 2];
        let list = [(8, 1), (8, 2), (8, 4), (9, 0), (9, 3), (9, 5), (9, 6), (10, 6), (11, 0), (11, 2)];
        let kept = cells_mark(&list, &roots);
        assert_eq!(kept, [true, false, true, false, false, false, true, true, true, false]);
    }

    #[test]
    fn what_never_fits_is_said() {
        let still: Motion = [[[0.0, 0.0, 0.0, 0.1], [1.0, 0.0, 0.0, 0.1], [0.0, 1.0, 0.0, 0.1]]; 2];
        assert_eq!(subdivision_plan(0.2, 0.19, 1.0, &still), None);
        assert_eq!(subdivision_plan(0.2, 0.5, 0.4, &still), Some((0, 0)));
        assert_eq!(subdivision_plan(0.2, 0.6, 1.0, &still), Some((1, 0)));
    }
}
