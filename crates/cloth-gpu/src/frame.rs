//! Positions for the device: relative to the scene's centre, scaled, in single precision with a radius that covers what was
//! lost.

use crate::collision::{Mode, Query, Vec3};
use rayon::prelude::*;

/// Added to every radius. In units of the scene it is far above what the narrow phase can be unsure of, so that every pair that it
/// may call a contact is among the candidates, and far above the smallest normal number.
const SLACK: f64 = 1.0 / (1 << 24) as f64;
/// A margin of so much joins everything: the scene lies within [−1, 1].
const MAX_MARGIN: f64 = 4.0;
/// Vertices per task.
const CHUNK: usize = 8192;

/// The positions of one query as the device gets them.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Units of the scene per metre: a power of two.
    pub scale: f64,
    /// Centre of the scene [m].
    pub origin: Vec3,
    /// Half the sides of the scene's box about the origin, in its units: at most 1.
    pub half: [f32; 3],
    /// Index of the first position at t1: 0 if there is one end only.
    pub second: u32,
    /// Thickness in units of the scene, not less than the exact one; what joins everything if that is more.
    pub thickness: f32,
    /// (x, y, z, r) per vertex at t0 (moving queries), then at t1: along each axis the vertex lies within r − half the
    /// thickness of it.
    pub positions: Vec<[f32; 4]>,
}

impl Frame {
    /// Converts the positions of a query that has passed [`Query::check`].
    ///
    /// x̃ = fl((x − origin) · scale) and r = fl↑(max |x̃ − (x − origin) · scale| + 2⁻⁵¹ |x̃| + thickness/2 · scale + 2⁻²⁴), all
    /// in double precision but the results. The scale brings the scene into [−1, 1] and is exact, so neither far, huge nor
    /// tiny scenes overflow or lose digits.
    pub fn new(query: &Query<'_>, pool: &rayon::ThreadPool) -> Self {
        let is_moving = query.mode == Mode::Continuous;
        let ends: Vec<&[Vec3]> = if is_moving { vec![query.x_t0, query.x_t1] } else { vec![query.x_t1] };
        let (low, high) = pool.install(|| {
            ends.iter().map(|x| bounding_box(x)).reduce(join).unwrap_or((Vec3::zeros(), Vec3::zeros()))
        });
        // Halves before sum and difference: neither overflows.
        let origin = low * 0.5 + high * 0.5;
        let half = high * 0.5 - low * 0.5;
        let scale = unit_scale(half.max());
        let margin = (0.5 * query.thickness * scale).min(MAX_MARGIN);
        let mut positions = vec![[0.0; 4]; ends.iter().map(|x| x.len()).sum()];
        pool.install(|| {
            for (x, out) in ends.iter().zip(positions.chunks_mut(query.x_t1.len().max(1))) {
                out.par_chunks_mut(CHUNK).zip(x.par_chunks(CHUNK)).for_each(|(out, x)| {
                    for (out, x) in out.iter_mut().zip(x) {
                        *out = position(x, &origin, scale, margin);
                    }
                });
            }
        });
        Self {
            scale,
            origin,
            half: [0, 1, 2].map(|k| ((half[k] * scale) as f32).next_up()),
            second: if is_moving { query.x_t0.len() as u32 } else { 0 },
            thickness: ((2.0 * margin) as f32).next_up(),
            positions,
        }
    }
}

impl Frame {
    /// Largest radius of a position.
    pub fn reach(&self) -> f32 {
        self.positions.iter().fold(0.0, |r, p| r.max(p[3]))
    }
}

fn position(x: &Vec3, origin: &Vec3, scale: f64, margin: f64) -> [f32; 4] {
    let mut out = [0.0; 4];
    let mut radius = 0.0f64;
    for k in 0..3 {
        let exact = (x[k] - origin[k]) * scale;
        out[k] = exact as f32;
        radius = radius.max((f64::from(out[k]) - exact).abs() + exact.abs() * (2.0 * f64::EPSILON));
    }
    out[3] = ((radius + margin + SLACK) as f32).next_up();
    out
}

/// The power of two that brings `extent` into [0.5, 1), as far as there is one; 1 for 0.
fn unit_scale(extent: f64) -> f64 {
    if extent == 0.0 {
        return 1.0;
    }
    let exponent = 1022 - (extent.to_bits() >> 52) as i64;
    // Below 2^-1022 powers of two are subnormal: one bit of the fraction.
    let bits =
        if exponent >= -1022 { (exponent.min(1023) + 1023) << 52 } else { 1 << (52 + 1022 + exponent) };
    f64::from_bits(bits.cast_unsigned())
}

fn bounding_box(x: &[Vec3]) -> (Vec3, Vec3) {
    x.par_chunks(CHUNK)
        .map(|x| x[1..].iter().fold((x[0], x[0]), |b, p| (b.0.inf(p), b.1.sup(p))))
        .reduce_with(join)
        .unwrap_or((Vec3::zeros(), Vec3::zeros()))
}

fn join(a: (Vec3, Vec3), b: (Vec3, Vec3)) -> (Vec3, Vec3) {
    (a.0.inf(&b.0), a.1.sup(&b.1))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(x_t0: &[Vec3], x_t1: &[Vec3], thickness: f64) -> Frame {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let query = Query { x_t0, x_t1, thickness, mode: Mode::Continuous, active: None };
        Frame::new(&query, &pool)
    }

    #[test]
    fn positions_lie_within_their_radius_at_any_size_and_place() {
        let mut state = 1u64;
        let mut unit = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        for (size, offset) in [
            (1.0, 0.0),
            (1.0, 1e6),
            (1e-3, -1e6),
            (1e305, 0.0),
            (1e-300, 0.0),
            (5e-324, 0.0),
            (1.79e308, 0.0),
        ] {
            let x: Vec<Vec3> = (0..100)
                .map(|_| {
                    Vec3::new(2.0 * unit() - 1.0, 2.0 * unit() - 1.0, unit()) * size + Vec3::repeat(offset)
                })
                .collect();
            let thickness = 0.01 * size;
            let f = frame(&x[..50], &x[50..], thickness);
            assert_eq!((f.second, f.positions.len()), (50, 100));
            let margin = 0.5 * thickness * f.scale;
            for (x, p) in x.iter().zip(&f.positions) {
                for k in 0..3 {
                    let exact = (x[k] - f.origin[k]) * f.scale;
                    assert!(p[k].abs() <= 1.0 && p[k].abs() <= f.half[k], "{size}: {p:?}, {:?}", f.half);
                    assert!((f64::from(p[k]) - exact).abs() + margin <= f64::from(p[3]), "{size}: {p:?}");
                }
                assert!(f64::from(p[3]) < margin + 1e-6, "{size}: {p:?}");
            }
        }
    }

    #[test]
    fn one_point_and_a_huge_thickness_stay_finite() {
        let x = [Vec3::repeat(3.0); 3];
        let f = frame(&x, &x, 1e300);
        assert!(f.positions.iter().all(|p| p[..3] == [0.0; 3] && (4.0..5.0).contains(&p[3])));
    }
}
