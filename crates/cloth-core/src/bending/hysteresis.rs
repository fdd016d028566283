//! The hysteresis loop: friction between the yarns, residual curvature, fatigue.
//!
//! M = b_2 K + m: an elastic part and the friction moment m ∈ [−M_0, M_0], which a window of curvatures carries. The
//! window [z − K_0, z + K_0] has its corners on the two straight sides of the loop, M = b_2 K ± M_0. A motion in
//! direction σ = ±1 from (K_p, m_p) heads for the corner d = z + σ K_0 on a parabola that joins the side there with its
//! slope, whatever point it starts at; past the corner it stays on the side and drags the window along:
//!
//!   m(K) = σ M_0 − (σ M_0 − m_p) ((d − K)/(d − K_p))²   up to d,   then   m = σ M_0, z = K − σ K_0.
//!
//! That is (4.2) from the origin, (4.5) from one side to the other, and (4.8) from anywhere. Any point of a parabola
//! leads to the same corner on the same parabola, so a place remembers how bowed its parabola is and no list of
//! reversals: m(K) = σ (M_0 − β |c_1| (d − K)²) with β = 1 on the first loading, 1/2 from side to side.
//!
//! Stored energy, per area: Ψ = ½ b_2 K² + ½ M_0 K_0 (u² + (m/M_0 − u)²) with u = (K − z)/K_0. Along a parabola
//! M K̇ − Ψ̇ = 2 M_0 (m/M_0 − u)² |K̇|/(1 − σ u) ≥ 0 and along a side M_0 |K̇|: the law never gives more than it took.
//!
//! A cycle is bending (M K̇ > 0) and recovery (M K̇ < 0). It ends when recovery turns into bending, or when M reaches zero.
//! If friction had been overcome in it (the bending went along a side, and |M_m| > M_a = M_0 + b_2 K_0 where recovery
//! began) the rest curvature moves by ξ λ K_r (4.6) and friction shrinks, M_0 ← (1 − μ ξ) M_0 (4.11, 4.12), with
//! ξ = min(1, |M_m − M|/(2 M_a)) (4.7) and K_r the curvature at which the recovery curve meets M = 0. θ and M are
//! held in that moment: K drops by what the rest curvature gains, and u moves as much as m/M_0, so that λ = 1 and a
//! complete recovery leave an unused place about the new rest curvature. Where friction shrinks below |m|, m goes with it.
//!
//! A loop has no elastic range, but a small one while |K| ≤ ρ K_0 on every path so far. There a = (1 − m/M_0)/(1 − u)² and
//! d = (1 + m/M_0)/(1 + u)², of which a motion upward keeps a and one downward d, stay in [1/(1 + ρ), 1/(1 − ρ)]: at the ends of that
//! range the best that a turn can do for one is to put the other back where it was. Hence m is nowhere farther from the first loading
//! than 2 ρ/(2 + ρ) M_0. Later motions along the same curvatures only bring the two closer together, so a place that is
//! taken as unused until it leaves the range has its moment right to that share of M_0 for ever.
//!
//! Source: thesis 4.3.2–4.3.5.

#![allow(clippy::inline_always, reason = "measured: a call per hinge costs a third of the kernel")]

use bytemuck::{Pod, Zeroable};

use super::{BendingLaw, Curve, Moment, Place};
use crate::CoreError;

/// Law of the loop for one material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hysteresis {
    curve: Curve,
    /// K_0, M_0 of an unused place.
    k0: f64,
    m0: f64,
    plasticity: f64,
    fatigue: f64,
}

/// Where a place stands in its loop: 48 bytes.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Loop {
    /// Rest curvature (θ_r − θ_0)/h̄ [1/m].
    rest: f64,
    /// Share of K_0 that fatigue has left: b_1 = b_2 + `left` (b_1 − b_2), M_0 goes with its square.
    left: f64,
    /// z: middle of the window, from the rest curvature [1/m].
    window: f64,
    /// K: curvature from the rest curvature [1/m].
    curvature: f64,
    /// β with the sign of the direction σ: the parabola it moved along last.
    bow: f64,
    /// M_m: moment at which the recovery under way began, if it may leave a trace; else 0 [N].
    peak: f64,
}

impl Default for Loop {
    /// An unused place, flat.
    fn default() -> Self {
        Self { rest: 0.0, left: 1.0, window: 0.0, curvature: 0.0, bow: 1.0, peak: 0.0 }
    }
}

/// The parabola, and the side after it, that a motion follows from a place.
struct Branch {
    /// Direction of motion: +1 or −1.
    sigma: f64,
    /// M_0 [N].
    m0: f64,
    /// β |c_1| [N m²].
    bow: f64,
    /// Curvature of the corner d [1/m].
    corner: f64,
}

impl Branch {
    /// Way to the corner; 0 from there on [1/m].
    #[inline(always)]
    fn way(&self, curvature: f64) -> f64 {
        (self.sigma * (self.corner - curvature)).max(0.0)
    }

    /// m at a way from the corner.
    #[inline(always)]
    fn friction(&self, way: f64) -> f64 {
        self.sigma * (self.m0 - self.bow * way * way)
    }
}

impl Hysteresis {
    /// From the curve of first loading, λ `plasticity` (share of a residual curvature that stays) and μ `fatigue` (share
    /// of the friction that a full cycle takes), both in [0, 1].
    ///
    /// # Errors
    /// [`CoreError::Parameter`] for λ or μ out of range.
    pub fn new(curve: Curve, plasticity: f64, fatigue: f64) -> Result<Self, CoreError> {
        for (name, got) in [("bending.plasticity", plasticity), ("bending.fatigue", fatigue)] {
            if !(0.0..=1.0).contains(&got) {
                return Err(CoreError::Parameter { name, expected: "a share in [0, 1]", got });
            }
        }
        // So written that M is exactly zero at the origin.
        let m0 = -curve.c1() * (curve.k0() * curve.k0());
        Ok(Self { curve, k0: curve.k0(), m0, plasticity, fatigue })
    }

    /// The curve of first loading of an unused place.
    pub fn curve(&self) -> &Curve {
        &self.curve
    }

    /// Initial rigidity b_1 that fatigue has left at a place [N m].
    fn b1(&self, place: &Loop) -> f64 {
        self.curve.b2() + place.left * (self.curve.b1() - self.curve.b2())
    }

    /// Frictional moment M_0 that fatigue has left at a place [N].
    #[inline(always)]
    fn frictional_moment(&self, place: &Loop) -> f64 {
        place.left * place.left * self.m0
    }

    /// Moment per width at a place [N].
    #[inline(always)]
    fn moment_at(&self, place: &Loop) -> f64 {
        self.curve.b2() * place.curvature + self.friction(place)
    }

    /// K_0 that fatigue has left at a place [1/m].
    #[inline(always)]
    fn transition(&self, place: &Loop) -> f64 {
        place.left * self.k0
    }

    /// The branch that a place moved along last.
    #[inline(always)]
    fn last_branch(&self, place: &Loop) -> Branch {
        let sigma = 1f64.copysign(place.bow);
        Branch {
            sigma,
            m0: self.frictional_moment(place),
            bow: place.bow.abs() * -self.curve.c1(),
            corner: place.window + sigma * self.transition(place),
        }
    }

    /// Friction moment m at a place [N].
    #[inline(always)]
    fn friction(&self, place: &Loop) -> f64 {
        let branch = self.last_branch(place);
        branch.friction(branch.way(place.curvature))
    }

    /// The branch that leaves a place in direction `sigma`.
    #[inline(always)]
    fn branch(&self, place: &Loop, sigma: f64) -> Branch {
        let last = self.last_branch(place);
        if sigma == last.sigma {
            return last;
        }
        let friction = last.friction(last.way(place.curvature));
        self.parabola(place, sigma, friction)
    }

    /// The branch in direction `sigma` through a place where the friction moment is `friction`.
    #[inline(always)]
    fn parabola(&self, place: &Loop, sigma: f64, friction: f64) -> Branch {
        let m0 = self.frictional_moment(place);
        let corner = place.window + sigma * self.transition(place);
        let way = sigma * (corner - place.curvature);
        let bow = if way > 0.0 { (m0 - sigma * friction) / (way * way) } else { 0.0 };
        Branch { sigma, m0, bow, corner }
    }

    /// `bow` of a place that moves along a branch.
    #[inline(always)]
    fn bow(&self, branch: &Branch) -> f64 {
        let scale = -self.curve.c1();
        (if scale > 0.0 { branch.bow / scale } else { 0.0 }).copysign(branch.sigma)
    }

    /// Ψ [J/m²].
    #[inline(always)]
    fn stored(&self, place: &Loop, curvature: f64, window: f64, friction: f64) -> f64 {
        let (k0, m0) = (self.transition(place), self.frictional_moment(place));
        let elastic = 0.5 * self.curve.b2() * curvature * curvature;
        if m0 == 0.0 {
            return elastic;
        }
        let u = (curvature - window) / k0;
        let w = friction / m0 - u;
        elastic + 0.5 * m0 * k0 * (u * u + w * w)
    }

    /// Moves a place monotonically, without the end of a cycle in between. Returns the work per area [J/m²].
    #[inline(always)]
    fn follow(&self, place: &mut Loop, sigma: f64, curvature: f64) -> f64 {
        if sigma != 1f64.copysign(place.bow) {
            place.bow = self.bow(&self.branch(place, sigma));
        }
        let branch = self.last_branch(place);
        let (from, b2) = (place.curvature, self.curve.b2());
        let (start, end) = (branch.way(from), branch.way(curvature));
        place.curvature = curvature;
        if end == 0.0 {
            place.window = curvature - sigma * self.transition(place);
        }
        0.5 * b2 * (curvature - from) * (curvature + from) + sigma * branch.m0 * (curvature - from)
            - branch.bow / 3.0 * (start * start * start - end * end * end)
    }

    /// Whether a motion in direction `sigma` is the start of a recovery that may leave a trace.
    #[inline(always)]
    fn begins_recovery(&self, place: &Loop, sigma: f64) -> bool {
        let last = self.last_branch(place);
        // On the side it came along, where |M| > M_a is |K| > K_0.
        sigma != last.sigma
            && last.m0 > 0.0
            && last.friction(last.way(place.curvature)) == last.sigma * last.m0
            && last.sigma * place.curvature > self.transition(place)
    }

    /// The place as the end of its cycle leaves it, about to move in direction `sigma`.
    #[cold]
    fn ended(&self, mut place: Loop, sigma: f64) -> Loop {
        let friction = self.friction(&place);
        self.end_cycle(&mut place, sigma, friction);
        place
    }

    /// The place where its recovery in direction `sigma` meets M = 0 and its cycle ends, and the work per area on the way
    /// there [J/m²].
    #[cold]
    fn recovered(&self, mut place: Loop, sigma: f64) -> (Loop, f64) {
        let unloaded = self.unloaded(&place, sigma);
        let work = self.follow(&mut place, sigma, unloaded);
        self.end_cycle(&mut place, sigma, -self.curve.b2() * unloaded);
        (place, work)
    }

    /// Curvature from the rest curvature at which a recovery in direction `sigma` meets M = 0 [1/m].
    fn unloaded(&self, place: &Loop, sigma: f64) -> f64 {
        let (branch, b2) = (self.branch(place, sigma), self.curve.b2());
        // σ M at the corner, from which it falls by b_2 w + bow w² over the way w.
        let corner = sigma * b2 * branch.corner + branch.m0;
        if corner <= 0.0 {
            return -sigma * branch.m0 / b2;
        }
        branch.corner - sigma * 2.0 * corner / (b2 + (b2 * b2 + 4.0 * branch.bow * corner).sqrt())
    }

    /// The end of a cycle that began its recovery at `place.peak`: (4.6), (4.7), (4.11), (4.12). `friction` is m there,
    /// `sigma` the direction of the motion that follows.
    fn end_cycle(&self, place: &mut Loop, sigma: f64, friction: f64) {
        let (b1, b2, c1) = (self.b1(place), self.curve.b2(), -self.curve.c1());
        let (k0, m0) = (self.transition(place), self.frictional_moment(place));
        let full = 2.0 * (m0 + b2 * k0);
        let (peak, side) = (place.peak.abs(), place.peak.signum());
        place.peak = 0.0;
        let moment = b2 * place.curvature + friction;
        let share = ((peak - side * moment) / full).min(1.0);
        let unloaded = if peak <= full {
            (peak - m0) / b2 - (b1 - (b1 * b1 - 2.0 * c1 * peak).max(0.0).sqrt()) / c1
        } else {
            m0 / b2
        };
        let (u, relative) = ((place.curvature - place.window) / k0, friction / m0);
        let moved = side * share * self.plasticity * unloaded;
        place.rest += moved;
        place.curvature -= moved;
        place.left *= (1.0 - self.fatigue * share).sqrt();
        let m0 = self.frictional_moment(place);
        let held = (friction + b2 * moved).clamp(-m0, m0);
        let moved = if m0 > 0.0 { held / m0 - relative } else { -u };
        place.window = place.curvature - (u + moved).clamp(-1.0, 1.0) * self.transition(place);
        place.bow = self.bow(&self.parabola(place, sigma, held));
    }
}

impl BendingLaw for Hysteresis {
    const NAME: &'static str = "hysteresis";
    const CONSERVATIVE: bool = false;
    type Memory = Loop;

    #[inline(always)]
    fn moment(&self, place: &Loop, curvature: f64, rate: f64) -> Moment {
        let (curvature, b2) = (curvature - place.rest, self.curve.b2());
        let moved = curvature - place.curvature;
        let sigma = 1f64.copysign(if moved == 0.0 { rate } else { moved });
        let branch = self.branch(place, sigma);
        let way = branch.way(curvature);
        let friction = branch.friction(way);
        let window = if way > 0.0 { place.window } else { curvature - sigma * self.transition(place) };
        Moment {
            moment: b2 * curvature + friction,
            slope: b2 + 2.0 * branch.bow * way,
            energy: self.stored(place, curvature, window, friction),
        }
    }

    #[inline(always)]
    fn advance(&self, place: &mut Loop, curvature: f64) -> f64 {
        let moved = curvature - place.rest - place.curvature;
        if moved == 0.0 || moved.is_nan() {
            return 0.0;
        }
        let sigma = 1f64.copysign(moved);
        // Copies that rare cases replace as a whole: in all others they stay in registers.
        let mut start = *place;
        if start.peak == 0.0 {
            if self.begins_recovery(&start, sigma) {
                start.peak = self.moment_at(&start);
            }
        } else if sigma * self.moment_at(&start) >= 0.0 {
            start = self.ended(start, sigma);
        }
        let mut end = start;
        let mut work = self.follow(&mut end, sigma, curvature - start.rest);
        if start.peak != 0.0 && sigma * self.moment_at(&end) >= 0.0 {
            (end, work) = self.recovered(start, sigma);
            let rest = end.rest;
            work += self.follow(&mut end, sigma, curvature - rest);
        }
        *place = end;
        work
    }

    /// Beyond ρ K_0 with 2 ρ/(2 + ρ) = `neglected`; never without a loop.
    #[inline(always)]
    fn leaves(&self, curvature: f64, neglected: f64) -> bool {
        self.m0 > 0.0 && curvature.abs() > 2.0 * neglected / (2.0 - neglected) * self.k0
    }

    /// The curve of first loading, there and back.
    #[inline(always)]
    fn fresh(&self, curvature: f64, rate: f64) -> Moment {
        BendingLaw::moment(&self.curve, &(), curvature, rate)
    }

    fn place(&self, place: &Loop) -> Place {
        Place {
            rest_curvature: place.rest,
            b1: self.b1(place),
            frictional_moment: self.frictional_moment(place),
        }
    }

    /// 2 b_1 − b_2: loading again right after a little unloading from a side.
    fn stiffening(&self) -> f64 {
        2.0 - self.curve.b2() / self.curve.b1()
    }

    fn elastic_rigidity(&self) -> f64 {
        self.curve.b2()
    }

    #[inline(always)]
    fn elastic(&self, place: &Loop, curvature: f64) -> f64 {
        curvature - place.rest
    }

    fn last(place: &Loop) -> Option<f64> {
        Some(place.rest + place.curvature)
    }
}
