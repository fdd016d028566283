//! Twin of `narrow_filter.wgsl`, whose header derives the bounds.

use crate::limits::{FILTER_STEPS, POSITION_ERROR, ROUNDING};

type Vector = [f32; 3];

/// What a filter takes numbers to be off by; the kernel has [`Bounds::default`], and less loses contacts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Relative error of one operation.
    pub rounding: f32,
    /// Error of a position along each axis.
    pub position: f32,
}

impl Default for Bounds {
    fn default() -> Self {
        Self { rounding: ROUNDING, position: POSITION_ERROR }
    }
}

fn minus(a: Vector, b: Vector) -> Vector {
    [0, 1, 2].map(|k| a[k] - b[k])
}

fn dot(a: Vector, b: Vector) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn largest(a: Vector) -> f32 {
    a.iter().fold(0.0, |m, x| x.abs().max(m))
}

/// Whether one of the directions that are tried has all differences beyond the thickness.
fn separated(d: &[Vector], thickness: f32, bounds: Bounds) -> bool {
    let extent = d.iter().fold(0.0f32, |m, &d| m.max(largest(d)));
    let mut n = [0, 1, 2].map(|k| d.iter().map(|d| d[k]).sum::<f32>() / d.len() as f32);
    for _ in 0..FILTER_STEPS {
        let (mut lowest, mut corner) = (dot(n, d[0]), d[0]);
        for &d in &d[1..] {
            let along = dot(n, d);
            if along < lowest {
                (lowest, corner) = (along, d);
            }
        }
        let sizes = n[0].abs() + n[1].abs() + n[2].abs();
        let squared = dot(n, n);
        let needed = thickness * squared.sqrt() * (1.0 + 16.0 * bounds.rounding)
            + sizes * (2.0 * bounds.position + 8.0 * bounds.rounding * extent)
            + 1e-17;
        if lowest > needed {
            return true;
        }
        let back = minus(n, corner);
        let length = dot(back, back);
        if length <= 1e-30 {
            return false;
        }
        let along = ((squared - lowest) / length).clamp(0.0, 1.0);
        n = [0, 1, 2].map(|k| n[k] - back[k] * along);
    }
    false
}

/// Whether the Bernstein coefficients of det(x, y, z), each from `[0]` to `[1]`, are certainly all of one sign.
fn rootless(x: [Vector; 2], y: [Vector; 2], z: [Vector; 2], bounds: Bounds) -> bool {
    let (first, second) = (cross(y[0], z[0]), cross(y[1], z[1]));
    let (p, q) = (cross(y[0], z[1]), cross(y[1], z[0]));
    let mixed = [0, 1, 2].map(|k| p[k] + q[k]);
    let b = [
        dot(x[0], first),
        (dot(x[0], mixed) + dot(x[1], first)) * (1.0 / 3.0),
        (dot(x[1], mixed) + dot(x[0], second)) * (1.0 / 3.0),
        dot(x[1], second),
    ];
    let sizes = [x, y, z].map(|v| largest(v[0]).max(largest(v[1])));
    let off = sizes.map(|s| 2.0 * bounds.position + bounds.rounding * s);
    let s = [0, 1, 2].map(|k| sizes[k] + off[k]);
    let error = 6.001 * (off[0] * s[1] * s[2] + s[0] * off[1] * s[2] + s[0] * s[1] * off[2])
        + 64.0 * bounds.rounding * s[0] * s[1] * s[2];
    b.iter().all(|&b| b > error) || b.iter().all(|&b| b < -error)
}

/// Whether the vertex certainly stays farther than `thickness` from the triangle; `p`: v, a, b, c at t0, then at t1.
pub fn vertex_triangle_apart(p: &[Vector; 8], thickness: f32, is_thin: bool, bounds: Bounds) -> bool {
    let d: [Vector; 6] = std::array::from_fn(|k| minus(p[k + 1 + k / 3], p[k / 3 * 4]));
    (is_thin && rootless([d[0], d[3]], [d[1], d[4]], [d[2], d[5]], bounds))
        || separated(&d, thickness, bounds)
}

/// Whether the edges certainly stay farther than `thickness` apart; `p`: a0, a1, b0, b1 at t0, then at t1.
pub fn edge_edge_apart(p: &[Vector; 8], thickness: f32, is_thin: bool, bounds: Bounds) -> bool {
    let d: [Vector; 8] = std::array::from_fn(|k| minus(p[k / 4 * 4 + k / 2 % 2], p[k / 4 * 4 + 2 + k % 2]));
    let (u, v) = ([minus(p[1], p[0]), minus(p[5], p[4])], [minus(p[3], p[2]), minus(p[7], p[6])]);
    (is_thin && rootless([d[0], d[4]], u, v, bounds)) || separated(&d, thickness, bounds)
}
