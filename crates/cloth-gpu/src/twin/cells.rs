//! Twins of `grid_setup.wgsl`, `cells_count.wgsl`, `cells_register.wgsl` and `cells_gather.wgsl`, with the functions of
//! `control.wgsl`.

use crate::layout::{Entry, Grid, SceneParams};
use crate::limits::{CELL_RADII, MAX_CELLS, MIN_CELL, PLANE_SLACK, REACH};

/// Size and number of the cells for a largest radius, and the bits of their keys.
pub fn grid_setup(params: &SceneParams, radius: f32) -> (Grid, u32) {
    let mut size = (CELL_RADII * radius).max(2.02 * (REACH * radius + 2.0 * PLANE_SLACK)).max(MIN_CELL);
    let cells_of = |size: f32| [0, 1, 2].map(|k| ((params.high[k] - params.low[k]) / size).ceil().max(1.0));
    let mut cells = cells_of(size);
    while cells.iter().product::<f32>() > MAX_CELLS {
        size *= 1.25;
        cells = cells_of(size);
    }
    let cells = cells.map(|c| c as u32);
    let keys = 2 * cells.iter().product::<u32>();
    (Grid { low: params.low, size, cells, inverse: 1.0 / size }, 32 - (keys - 1).leading_zeros())
}

/// Type of the home cell.
pub fn home_type(control: u32) -> u32 {
    control & 7
}

/// Whether the triangle is registered in its cell of that type.
pub fn meets_type(control: u32, cell_type: u32) -> bool {
    control >> (3 + cell_type) & 1 != 0
}

/// Whether the pair of a triangle at home here and a guest is left to the guest's home.
pub fn is_left_to_other_cell(home: u32, guest: u32) -> bool {
    let differ = home_type(home) ^ home_type(guest);
    let opposite = (home ^ guest) >> 11 & differ;
    meets_type(home, home_type(guest)) && opposite == differ && home_type(guest) < home_type(home)
}

/// Place of the cell that holds `x`.
pub fn cell_of(grid: &Grid, x: [f32; 3]) -> [u32; 3] {
    [0, 1, 2].map(|k| {
        let place = ((x[k] - grid.low[k]) * grid.inverse).floor();
        place.clamp(0.0, (grid.cells[k] - 1) as f32) as u32
    })
}

/// Home cells and control bits. `reach`: what radii are multiplied by; the kernel has [`REACH`].
pub fn cells_count(grid: &Grid, spheres: &[[f32; 4]], reach: f32) -> (Vec<u32>, Vec<u32>) {
    spheres
        .iter()
        .map(|&[x, y, z, radius]| {
            let centre = [x, y, z];
            let reach = reach * radius + PLANE_SLACK;
            let home = cell_of(grid, centre);
            let first = cell_of(grid, centre.map(|c| c - reach));
            let last = cell_of(grid, centre.map(|c| c + reach));
            let (mut own_type, mut directions, mut gap, mut reaches) = (0, 0, [0.0; 3], [false; 3]);
            for k in 0..3 {
                let next = u32::from(last[k] > home[k]);
                own_type |= (home[k] & 1) << k;
                directions |= next << (11 + k);
                reaches[k] = next != 0 || first[k] < home[k];
                let plane = grid.low[k] + (home[k] + next) as f32 * grid.size;
                gap[k] = (centre[k] - plane) * (centre[k] - plane);
            }
            let mut types = 0;
            for other in 0..8u32 {
                let moved = [0, 1, 2].map(|k| other >> k & 1 != 0);
                let distance: f32 = (0..3).filter(|&k| moved[k]).map(|k| gap[k]).sum();
                if (0..3).all(|k| !moved[k] || reaches[k]) && distance <= reach * reach {
                    types |= 1 << (own_type ^ other);
                }
            }
            let number = home[0] + grid.cells[0] * (home[1] + grid.cells[1] * home[2]);
            (number, own_type | types << 3 | directions)
        })
        .unzip()
}

/// In how many cells the triangle with these control bits is registered.
pub fn cell_count(control: u32) -> u32 {
    (control >> 3 & 0xff).count_ones()
}

/// Registrations (key, triangle), triangle by triangle: 2 · cell, plus 1 where it is not the home.
pub fn cells_register(grid: &Grid, homes: &[u32], controls: &[u32]) -> Vec<(u64, u32)> {
    let strides = [1, grid.cells[0], grid.cells[0] * grid.cells[1]];
    let mut out = vec![];
    for (t, (&home, &control)) in homes.iter().zip(controls).enumerate() {
        let own_type = home_type(control);
        for cell_type in (0..8).filter(|&c| meets_type(control, c)) {
            let mut cell = home;
            for k in (0..3).filter(|k| (own_type ^ cell_type) >> k & 1 != 0) {
                let is_next = control >> (11 + k) & 1 != 0;
                cell = if is_next { cell + strides[k] } else { cell - strides[k] };
            }
            out.push((u64::from(2 * cell + u32::from(cell_type != own_type)), t as u32));
        }
    }
    out
}

/// The registrations with what their tests ask first.
pub fn cells_gather(registrations: &[(u64, u32)], spheres: &[[f32; 4]], controls: &[u32]) -> Vec<Entry> {
    let entry = |&(key, t): &(u64, u32)| {
        let [x, y, z, radius] = spheres[t as usize];
        let control = controls[t as usize];
        Entry { centre: [x, y, z], radius, triangle: t, control, key: key as u32, level: 0 }
    };
    registrations.iter().map(entry).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Spheres of nearly the largest radius, about all over the box.
    fn scene(n: usize, radius: f32) -> (Grid, Vec<[f32; 4]>) {
        let params = SceneParams { low: [-1.0, -0.7, -0.3], high: [1.0, 0.7, 0.3], ..Default::default() };
        let mut state = 3u64;
        let mut unit = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1u32 << 24) as f32
        };
        let spheres = (0..n)
            .map(|_| {
                [2.0 * unit() - 1.0, 1.4 * unit() - 0.7, 0.6 * unit() - 0.3, radius * (1.0 - 0.2 * unit())]
            })
            .collect();
        (grid_setup(&params, radius).0, spheres)
    }

    /// How often each pair of overlapping spheres is tested: none, once, more often.
    fn tests((grid, spheres): &(Grid, Vec<[f32; 4]>), reach: f32, fault: fn(u32) -> u32) -> [usize; 3] {
        let n = spheres.len();
        let (homes, mut controls) = cells_count(grid, spheres, reach);
        let registrations = cells_register(grid, &homes, &controls);
        for control in &mut controls {
            *control = fault(*control);
        }
        let mut counts = std::collections::BTreeMap::new();
        for &(key, a) in registrations.iter().filter(|r| r.0 & 1 == 0) {
            for &(other, b) in registrations.iter().filter(|r| r.0 / 2 == key / 2) {
                let is_home = other & 1 == 0;
                let is_here = if is_home {
                    a < b
                } else {
                    !is_left_to_other_cell(controls[a as usize], controls[b as usize])
                };
                if is_here {
                    *counts.entry((a.min(b), a.max(b))).or_insert(0) += 1;
                }
            }
        }
        let mut out = [0; 3];
        for a in 0..n {
            for b in a + 1..n {
                let distance: f32 = (0..3).map(|k| (spheres[a][k] - spheres[b][k]).powi(2)).sum();
                let count = counts.get(&(a as u32, b as u32)).copied().unwrap_or(0);
                if distance.sqrt() <= spheres[a][3] + spheres[b][3] {
                    out[count.min(2)] += 1;
                }
            }
        }
        out
    }

    #[test]
    fn overlapping_spheres_are_tested_once() {
        for (n, radius) in [(900, 0.06), (900, 0.03), (300, 0.2), (100, 5.0), (500, 1e-4)] {
            let [never, once, more] = tests(&scene(n, radius), REACH, |c| c);
            assert_eq!((never, more), (0, 0), "{n} of {radius}");
            assert!(once > 100 || radius < 1e-3, "{n} of {radius}: {once}");
        }
    }

    #[test]
    fn spheres_across_a_cell_edge_need_the_factor() {
        let scene = scene(900, 0.06);
        assert!(tests(&scene, 1.0, |c| c)[0] > 0);
        // Homes diagonal to each other; both spheres touch the two cells between, and overlap there.
        let grid = scene.0;
        let edge = [0, 1, 2].map(|k| grid.low[k] + 2.0 * grid.size);
        let d = 0.3 * grid.size;
        let radius = 0.71 * d;
        let a = [edge[0] - d, edge[1] - 1e-3 * d, edge[2] + d, radius];
        let b = [edge[0] + 1e-3 * d, edge[1] + d, edge[2] + d, radius];
        let corner = (grid, vec![a, b]);
        assert_eq!(tests(&corner, REACH, |c| c), [0, 1, 0]);
        assert_eq!(tests(&corner, 1.38, |c| c), [1, 0, 0]);
    }

    #[test]
    fn wrong_control_bits_are_caught() {
        let scene = scene(900, 0.06);
        // As if all went the same way; as if all were registered everywhere; as if no guest were.
        assert!(tests(&scene, REACH, |c| c | 7 << 11)[2] > 0);
        assert!(tests(&scene, REACH, |c| c | 0xff << 3)[0] > 0);
        assert!(tests(&scene, REACH, |c| c & !(0xff << 3))[2] > 0);
    }

    #[test]
    fn few_bits_hold_the_keys() {
        for (radius, half) in [(0.1f32, 1.0f32), (1e-6, 1.0), (0.0, 0.0), (7.0, 1.0)] {
            let params = SceneParams { low: [-half; 3], high: [half; 3], ..Default::default() };
            let (grid, bits) = grid_setup(&params, radius);
            let cells = grid.cells.iter().map(|&c| u64::from(c)).product::<u64>();
            assert!(cells <= 1 << 30 && 2 * cells - 1 < 1 << bits, "{grid:?}");
            assert!(grid.size >= 3.0 * radius);
        }
    }
}
