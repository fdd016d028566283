//! The coplanarity cubic in Bernstein form, with an error bound.

use super::filter::determinant;
use super::lanes::{Lanes, Mask, Vector};

/// Σ b_i C(3,i) t^i (1−t)^(3−i) on \[0, 1\], known to ± `error` there.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cubic<L> {
    pub(crate) b: [L; 4],
    pub(crate) error: L,
}

/// Steps of Bézier clipping before the present bound is returned as it stands.
const MAX_CLIPS: usize = 64;
/// Steps of Halley's method; three are usual.
const MAX_STEPS: usize = 16;
/// The method triples the digits: a step of this size lands within about its cube of the root.
const LAST_STEP: f64 = 1e-4;
/// A clip that moves on by less than this fraction of the step has arrived, and a root found by Halley's method is
/// approached to it.
const ROOT_STEP: f64 = 1e-10;

/// Where a polynomial less its error bound, divided by the sign of its first coefficient, stands.
struct Shifted<L: Lanes> {
    c: [L; 4],
    /// The first coefficient is not beyond the error bound.
    starts_at_root: L::Mask,
    is_positive: L::Mask,
}

impl<L: Lanes> Cubic<L> {
    /// det(x, y, z) of three vectors that move linearly from `[0]` to `[1]`.
    #[inline(always)]
    pub(crate) fn determinant(x: [Vector<L>; 2], y: [Vector<L>; 2], z: [Vector<L>; 2]) -> Self {
        let (b, error) = determinant(x, y, z);
        Self { b, error }
    }

    /// Where there is certainly no root in \[t, 1\]; elsewhere a time that is not later than the first one.
    #[inline(always)]
    pub(crate) fn first_root_bound(&self, t: L) -> (L::Mask, L) {
        let Shifted { c, starts_at_root, is_positive } = self.shifted(t);
        let rootless = is_positive & !starts_at_root;
        let open = !(is_positive | starts_at_root);
        if !open.any() {
            return (rootless, t);
        }
        let Approach { found, none, x } = approach(&c, open);
        let (rootless, bound) = (rootless | none, L::select(found, t + x * (L::splat(1.0) - t), t));
        let hard = open & !(found | none);
        if !hard.any() {
            return (rootless, bound);
        }
        let (none, clipped) = self.clip(t, hard);
        (rootless | none, L::select(hard, clipped, bound))
    }

    /// The polynomial less its error bound on \[t, 1\]: a true root cannot come before its first root.
    #[inline(always)]
    fn shifted(&self, t: L) -> Shifted<L> {
        let zero = L::splat(0.0);
        let c = restrict(&self.b, t);
        let starts_at_root = !c[0].abs().greater(self.error);
        let sign = L::select(c[0].greater(zero), L::splat(1.0), L::splat(-1.0));
        // Not `map`: what is not inlined here knows nothing of the vector instructions.
        let c = [
            c[0] * sign - self.error,
            c[1] * sign - self.error,
            c[2] * sign - self.error,
            c[3] * sign - self.error,
        ];
        Shifted { c, starts_at_root, is_positive: all_positive(&c) }
    }

    /// [`Cubic::first_root_bound`] without luck, where `wanted`: clips away what lies before the hull of the control
    /// points reaches zero, again and again.
    #[inline(always)]
    fn clip(&self, t: L, wanted: L::Mask) -> (L::Mask, L) {
        let (zero, one) = (L::splat(0.0), L::splat(1.0));
        let (mut t, mut moving, mut rootless) = (t, wanted, zero.greater(zero));
        for _ in 0..MAX_CLIPS {
            let Shifted { c, starts_at_root, is_positive } = self.shifted(t);
            rootless = rootless | (moving & is_positive & !starts_at_root);
            moving = moving & !(is_positive | starts_at_root);
            if !moving.any() {
                break;
            }
            let mut first = one;
            for i in 0..3 {
                for j in i + 1..4 {
                    let falls = c[i].greater(zero) & !c[j].greater(zero);
                    let x = (L::splat(i as f64) + L::splat((j - i) as f64) * c[i] / (c[i] - c[j]))
                        / L::splat(3.0);
                    first = L::select(falls, x.min(first), first);
                }
            }
            // The rounding of `first`; that of the sum is in the error bound.
            let step = first * (one - t) * L::splat(1.0 - 8.0 * f64::EPSILON);
            moving = moving & !L::splat(ROOT_STEP).greater(step);
            let next = t + step;
            let at_end = !one.greater(next);
            t = L::select(moving, L::select(at_end, L::splat(1.0 - f64::EPSILON), next), t);
            moving = moving & !at_end;
        }
        (rootless, t)
    }
}

#[inline(always)]
fn all_positive<L: Lanes>(c: &[L; 4]) -> L::Mask {
    let zero = L::splat(0.0);
    c[0].greater(zero) & c[1].greater(zero) & c[2].greater(zero) & c[3].greater(zero)
}

/// What [`approach`] has found.
struct Approach<L: Lanes> {
    /// Where [`Approach::x`] is a parameter shortly before the first root.
    found: L::Mask,
    /// Where there is no root.
    none: L::Mask,
    x: L,
}

/// Where `wanted`, the first root of the polynomial with coefficients `c`, c0 > 0; what it says it has certified, but it
/// does not always find an answer.
///
/// With c3 > 0 the polynomial has no root or two, on both sides of its minimum at m: a root is looked for in \[0, m\].
#[inline(always)]
fn approach<L: Lanes>(c: &[L; 4], wanted: L::Mask) -> Approach<L> {
    let (zero, one, half) = (L::splat(0.0), L::splat(1.0), L::splat(0.5));
    let (two, three) = (L::splat(2.0), L::splat(3.0));
    let slopes =
        [three * (c[1] - c[0]), three * (c[2] - two * c[1] + c[0]), c[3] - three * (c[2] - c[1]) - c[0]];
    let at = |x: L| c[0] + x * (slopes[0] + x * (slopes[1] + x * slopes[2]));
    let (mut end, mut last, mut none) = (one, c[3], zero.greater(zero));
    let returns = wanted & c[3].greater(zero);
    if returns.any() {
        let middle = minimum(&slopes);
        let is_between = middle.greater(zero) & one.greater(middle);
        // Without a minimum in between, half is as good as any other parameter.
        let middle = L::select(is_between, middle, half);
        let value = at(middle);
        end = L::select(returns, middle, end);
        last = L::select(returns, value, last);
        let stays = returns & value.greater(zero);
        if stays.any() {
            let [left, right] = split(c, middle);
            none = stays & is_positive(&left, stays) & is_positive(&right, stays);
        }
    }
    // The coefficient at the end decides where it was used as it is, the value elsewhere.
    let wanted = wanted & !last.greater(zero);
    let (mut lo, mut hi, mut x) = (zero, end, end * c[0] / (c[0] - last));
    let mut running = wanted;
    for _ in 0..MAX_STEPS {
        if !running.any() {
            break;
        }
        let value = at(x);
        let slope = slopes[0] + x * (two * slopes[1] + x * three * slopes[2]);
        let bend = slopes[1] + x * three * slopes[2];
        let is_before = value.greater(zero);
        lo = L::select(is_before, x, lo);
        hi = L::select(is_before, hi, x);
        let next = x - value * slope / (slope * slope - value * bend);
        let next = L::select(next.greater(lo) & hi.greater(next), next, half * (lo + hi));
        let arrived = L::splat(LAST_STEP).greater((next - x).abs());
        x = L::select(running, next, x);
        running = running & !arrived;
    }
    let x = x - L::splat(ROOT_STEP);
    let found = wanted & x.greater(zero);
    let [left, _] = split(c, x);
    Approach { found: found & is_positive(&left, found), none, x }
}

/// Where the polynomial c0 + s0 x + s1 x² + s2 x³ has its local minimum; no number or any number where it has none.
#[inline(always)]
fn minimum<L: Lanes>(slopes: &[L; 3]) -> L {
    let zero = L::splat(0.0);
    let thrice = L::splat(3.0) * slopes[2];
    let root = (slopes[1] * slopes[1] - thrice * slopes[0]).sqrt();
    // Of the two forms of the solution the one that adds numbers of one sign.
    let is_late = slopes[1].greater(zero);
    let below = L::select(is_late, zero - slopes[1] - root, thrice);
    L::select(is_late, slopes[0], root - slopes[1]) / below
}

/// Where `wanted`: whether the coefficients are positive, or those on both halves.
#[inline(always)]
fn is_positive<L: Lanes>(c: &[L; 4], wanted: L::Mask) -> L::Mask {
    let at_once = all_positive(c);
    if !(wanted & !at_once).any() {
        return at_once;
    }
    let [first, second] = split(c, L::splat(0.5));
    at_once | (all_positive(&first) & all_positive(&second))
}

/// Bernstein coefficients on \[0, x\] and on \[x, 1\] (de Casteljau).
#[inline(always)]
fn split<L: Lanes>(c: &[L; 4], x: L) -> [[L; 4]; 2] {
    let (p, q, r) = (mix(c[0], c[1], x), mix(c[1], c[2], x), mix(c[2], c[3], x));
    let (pq, qr) = (mix(p, q, x), mix(q, r, x));
    let pqr = mix(pq, qr, x);
    [[c[0], p, pq, pqr], [pqr, qr, r, c[3]]]
}

#[inline(always)]
fn mix<L: Lanes>(p: L, q: L, x: L) -> L {
    p * (L::splat(1.0) - x) + q * x
}

/// Bernstein coefficients of the same polynomial on \[t, 1\].
#[inline(always)]
fn restrict<L: Lanes>(b: &[L; 4], t: L) -> [L; 4] {
    let is_later = t.greater(L::splat(0.0));
    if !is_later.any() {
        return *b;
    }
    let [_, mut right] = split(b, t);
    for k in 0..4 {
        right[k] = L::select(is_later, right[k], b[k]);
    }
    right
}
