//! Conservative continuous collision detection of one pair.
//!
//! Every vertex moves linearly. All arithmetic is on differences of coordinates (each exact to a relative 2⁻⁵³, so a far
//! origin costs nothing), scaled by a power of two. The [`filter`] rejects most pairs; through the step of the others
//! a march is driven by two certified statements:
//!
//! * [`separation`]: along a fixed direction the signed gaps are linear in time; as long as all exceed their error
//!   bound the pair is apart. This needs no general position: coplanar, parallel and degenerate motion included.
//! * [`cubic`]: thin pairs can touch only where their four points are coplanar; Bézier clipping bounds the next root
//!   from below.
//!
//! A time that neither statement gets past is a contact. So nothing is missed, touching counts, and an undecided
//! case is a contact.

mod cubic;
mod edge_edge;
pub(crate) mod filter;
pub(crate) mod lanes;
mod separation;
mod vertex_triangle;

use crate::Vec3;
use cubic::Cubic;
use edge_edge::EdgeEdgeMotion;
use separation::Relative;
use vertex_triangle::VertexTriangleMotion;

/// Unit of the error bounds: 32 · 2⁻⁵³.
const ROUNDING: f64 = 16.0 * f64::EPSILON;
/// Progress, as a fraction of the step, below which the march has arrived at a contact. The returned time is earlier
/// than the true one by about this much at a transversal contact.
const MIN_PROGRESS: f64 = 1e-9;
/// Marches end at a contact after so many steps. Transversal contacts need about three; coplanar motion and
/// contacts at a thickness converge linearly.
const MAX_STEPS: usize = 512;
/// Weights above this and a distance below [`TOUCHING`] say "contact" without a search for a separating direction.
/// That can only add contacts.
const INSIDE_MARGIN: f64 = 1e-6;
/// Distance, in units of the pair's extent; at a transversal root [`cubic::Cubic::first_root_bound`] comes as close.
const TOUCHING: f64 = 1e-9;

/// What a stencil gives to the march.
trait Motion<const K: usize> {
    fn relative(&self) -> &Relative<K>;
    /// Multiplies all lengths by a power of two.
    fn scale(&mut self, factor: f64);
    /// det = 0 where the four points are coplanar.
    fn cubic(&self) -> Cubic;
    /// Whether the features all but touch at t, well inside both. No certificate.
    fn is_inside(&self, t: f64) -> bool;
    /// Directions along which the features may be apart at t, until `visit` is content. No certificate.
    fn directions(&self, t: f64, visit: impl FnMut(Vec3) -> bool);
}

/// Time of the first contact of a vertex with a triangle.
///
/// `p`: v, a, b, c at t0, then at t1 \[m\]; each moves linearly. `None`: certainly no contact. `Some(t)`: t is not
/// later than the first time in \[0, 1\] at which the distance is ≤ `thickness` \[m\]; a pair that stays farther apart
/// than about 1e-14 of its size at all times gets `None`. A coordinate that is not finite gives `Some(0)`.
pub fn vertex_triangle_ccd(p: &[Vec3; 8], thickness: f64) -> Option<f64> {
    if !is_finite(p) {
        return Some(0.0);
    }
    if filter::vertex_triangle_apart(&filter::points(p), thickness) {
        return None;
    }
    vertex_triangle_march(p, thickness)
}

/// Time of the first contact of two edges.
///
/// `p`: a0, a1, b0, b1 at t0, then at t1 \[m\]; each moves linearly. The answer is as in [`vertex_triangle_ccd`].
pub fn edge_edge_ccd(p: &[Vec3; 8], thickness: f64) -> Option<f64> {
    if !is_finite(p) {
        return Some(0.0);
    }
    if filter::edge_edge_apart(&filter::points(p), thickness) {
        return None;
    }
    edge_edge_march(p, thickness)
}

fn is_finite(p: &[Vec3; 8]) -> bool {
    p.iter().all(|p| p.x.is_finite() && p.y.is_finite() && p.z.is_finite())
}

/// [`vertex_triangle_ccd`] of finite points that the filter has not rejected.
pub(crate) fn vertex_triangle_march(p: &[Vec3; 8], thickness: f64) -> Option<f64> {
    march(VertexTriangleMotion::new(p, thickness))
}

/// [`edge_edge_ccd`] of finite points that the filter has not rejected.
pub(crate) fn edge_edge_march(p: &[Vec3; 8], thickness: f64) -> Option<f64> {
    march(EdgeEdgeMotion::new(p, thickness))
}

/// The power of two that brings `extent` near 1; None if it is zero or not finite.
#[inline]
fn unit_scale(extent: f64) -> Option<f64> {
    if !(extent > 0.0 && extent < f64::INFINITY) {
        return None;
    }
    // The exponent's bits; at the far ends of the range the scale is only brought closer to 1.
    let exponent = (extent.to_bits() >> 52) as i64 - 1023;
    let wanted = (-exponent).clamp(-1000, 1000);
    Some(f64::from_bits(((wanted + 1023) as u64) << 52))
}

fn march<const K: usize>(mut motion: impl Motion<K>) -> Option<f64> {
    if motion.relative().separated_by_axis() {
        return None;
    }
    let Some(factor) = unit_scale(motion.relative().extent) else { return Some(0.0) };
    motion.scale(factor);
    let relative = motion.relative();
    let thin = relative.thickness == 0.0;
    let cubic = motion.cubic();
    let mut t = 0.0;
    for _ in 0..MAX_STEPS {
        if thin {
            t = cubic.first_root_bound(t)?;
            if motion.is_inside(t) {
                return Some(t);
            }
        }
        let mut until = t;
        motion.directions(t, |n| {
            until = until.max(relative.separated_until(&n, t));
            until > 1.0
        });
        if until > 1.0 {
            return None;
        }
        if !(until - t > MIN_PROGRESS) {
            return Some(t);
        }
        t = until;
    }
    Some(t)
}

/// The narrow phase of a query: gathers the points and asks the single-pair tests.
pub(crate) mod narrow_test {
    use crate::{Mode, Query, Vec3};

    fn gather(query: &Query<'_>, v: [u32; 4]) -> [Vec3; 8] {
        let start = if query.mode == Mode::Continuous { query.x_t0 } else { query.x_t1 };
        let (x, y) = (v.map(|k| start[k as usize]), v.map(|k| query.x_t1[k as usize]));
        [x[0], x[1], x[2], x[3], y[0], y[1], y[2], y[3]]
    }

    fn time(query: &Query<'_>, time: f64) -> f64 {
        if query.mode == Mode::Continuous { time } else { 1.0 }
    }

    pub(crate) fn vertex_triangle(query: &Query<'_>, v: [u32; 4]) -> Option<f64> {
        super::vertex_triangle_ccd(&gather(query, v), query.thickness).map(|t| time(query, t))
    }

    pub(crate) fn edge_edge(query: &Query<'_>, v: [u32; 4]) -> Option<f64> {
        super::edge_edge_ccd(&gather(query, v), query.thickness).map(|t| time(query, t))
    }
}
