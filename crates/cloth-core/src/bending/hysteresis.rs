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
//! leads to the same corner on the same parabola, so a place needs to remember its last point only: no list of
//! reversals.
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
//! Source: thesis 4.3.2–4.3.5.

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
    /// m: friction moment [N].
    friction: f64,
    /// M_m: moment at which the recovery under way began, if it may leave a trace; else 0 [N].
    peak: f64,
}

impl Default for Loop {
    /// An unused place, flat.
    fn default() -> Self {
        Self { rest: 0.0, left: 1.0, window: 0.0, curvature: 0.0, friction: 0.0, peak: 0.0 }
    }
}

/// The straight side or parabola that a motion follows from a place.
struct Branch {
    /// Direction of motion: +1 or −1.
    sigma: f64,
    /// M_0 [N].
    m0: f64,
    /// M_0 − σ m: friction still to come [N].
    lacking: f64,
    /// σ (d − K): way to the corner, ≤ 0 on a side [1/m].
    span: f64,
    /// K where it starts [1/m].
    start: f64,
}

impl Branch {
    /// Part of the way to the corner that is left at K: 1 at the start, 0 from the corner on.
    #[inline]
    fn remaining(&self, curvature: f64) -> f64 {
        let left = self.span - self.sigma * (curvature - self.start);
        if left > 0.0 { left / self.span } else { 0.0 }
    }

    /// m.
    #[inline]
    fn friction(&self, remaining: f64) -> f64 {
        self.sigma * (self.m0 - self.lacking * remaining * remaining)
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
        Ok(Self { curve, k0: curve.k0(), m0: curve.m0(), plasticity, fatigue })
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
    fn frictional_moment(&self, place: &Loop) -> f64 {
        place.left * place.left * self.m0
    }

    /// Moment per width at a place [N].
    fn moment_at(&self, place: &Loop) -> f64 {
        self.curve.b2() * place.curvature + place.friction
    }

    #[inline]
    fn branch(&self, place: &Loop, sigma: f64) -> Branch {
        let m0 = self.frictional_moment(place);
        Branch {
            sigma,
            m0,
            lacking: m0 - sigma * place.friction,
            span: place.left * self.k0 - sigma * (place.curvature - place.window),
            start: place.curvature,
        }
    }

    /// Ψ [J/m²].
    #[inline]
    fn stored(&self, place: &Loop, curvature: f64, window: f64, friction: f64) -> f64 {
        let (k0, m0) = (place.left * self.k0, self.frictional_moment(place));
        let elastic = 0.5 * self.curve.b2() * curvature * curvature;
        if m0 == 0.0 {
            return elastic;
        }
        let u = (curvature - window) / k0;
        let w = friction / m0 - u;
        elastic + 0.5 * m0 * k0 * (u * u + w * w)
    }

    /// Moves a place monotonically, without the end of a cycle in between. Returns the work per area [J/m²].
    fn follow(&self, place: &mut Loop, sigma: f64, curvature: f64) -> f64 {
        let branch = self.branch(place, sigma);
        let q = branch.remaining(curvature);
        let (from, b2) = (place.curvature, self.curve.b2());
        let work = 0.5 * b2 * (curvature - from) * (curvature + from)
            + sigma * branch.m0 * (curvature - from)
            - branch.lacking * branch.span.max(0.0) / 3.0 * (1.0 - q * q * q);
        place.friction = branch.friction(q);
        place.curvature = curvature;
        if q == 0.0 {
            place.window = curvature - sigma * place.left * self.k0;
        }
        work
    }

    /// Curvature from the rest curvature at which a recovery in direction `sigma` meets M = 0 [1/m].
    fn unloaded(&self, place: &Loop, sigma: f64) -> f64 {
        let branch = self.branch(place, sigma);
        let (b2, span) = (self.curve.b2(), branch.span.max(0.0));
        // σ M at the corner: with q of the way left, lacking q² + b_2 span q = corner.
        let corner = sigma * b2 * branch.start + b2 * span + branch.m0;
        if corner <= 0.0 || span == 0.0 {
            return -sigma * branch.m0 / b2;
        }
        let slope = b2 * span;
        let q = 2.0 * corner / (slope + (slope * slope + 4.0 * branch.lacking * corner).sqrt());
        branch.start + sigma * span * (1.0 - q)
    }

    /// The end of a cycle that began its recovery at `place.peak`: (4.6), (4.7), (4.11), (4.12).
    fn end_cycle(&self, place: &mut Loop) {
        let (b1, b2, c1) = (self.b1(place), self.curve.b2(), -self.curve.c1());
        let (k0, m0) = (place.left * self.k0, self.frictional_moment(place));
        let full = 2.0 * (m0 + b2 * k0);
        let (peak, side) = (place.peak.abs(), place.peak.signum());
        place.peak = 0.0;
        let share = ((peak - side * self.moment_at(place)) / full).min(1.0);
        let unloaded = if peak <= full {
            (peak - m0) / b2 - (b1 - (b1 * b1 - 2.0 * c1 * peak).max(0.0).sqrt()) / c1
        } else {
            m0 / b2
        };
        let (u, relative) = ((place.curvature - place.window) / k0, place.friction / m0);
        let moved = side * share * self.plasticity * unloaded;
        place.rest += moved;
        place.curvature -= moved;
        place.left *= (1.0 - self.fatigue * share).sqrt();
        let m0 = self.frictional_moment(place);
        place.friction = (place.friction + b2 * moved).clamp(-m0, m0);
        let moved = if m0 > 0.0 { place.friction / m0 - relative } else { -u };
        place.window = place.curvature - (u + moved).clamp(-1.0, 1.0) * place.left * self.k0;
    }
}

impl BendingLaw for Hysteresis {
    const NAME: &'static str = "hysteresis";
    const CONSERVATIVE: bool = false;
    type Memory = Loop;

    #[inline]
    fn moment(&self, place: &Loop, curvature: f64, rate: f64) -> Moment {
        let (curvature, b2) = (curvature - place.rest, self.curve.b2());
        let moved = curvature - place.curvature;
        let sigma = 1f64.copysign(if moved == 0.0 { rate } else { moved });
        let branch = self.branch(place, sigma);
        let q = branch.remaining(curvature);
        let friction = branch.friction(q);
        let (window, slope) = if q > 0.0 {
            (place.window, b2 + 2.0 * branch.lacking * q / branch.span)
        } else {
            (curvature - sigma * place.left * self.k0, b2)
        };
        let energy = self.stored(place, curvature, window, friction);
        Moment { moment: b2 * curvature + friction, slope, energy }
    }

    fn advance(&self, place: &mut Loop, curvature: f64) -> f64 {
        let moved = curvature - place.rest - place.curvature;
        if moved == 0.0 || moved.is_nan() {
            return 0.0;
        }
        let (sigma, b2) = (moved.signum(), self.curve.b2());
        let mut work = 0.0;
        if sigma * self.moment_at(place) < 0.0 {
            let m0 = self.frictional_moment(place);
            let overcome =
                m0 > 0.0 && place.friction == -sigma * m0 && -sigma * place.curvature > place.left * self.k0;
            if place.peak == 0.0 && overcome {
                place.peak = self.moment_at(place);
            }
            let unloaded = if place.peak == 0.0 { f64::NAN } else { self.unloaded(place, sigma) };
            if sigma * (curvature - place.rest - unloaded) >= 0.0 {
                work += self.follow(place, sigma, unloaded);
                place.friction = -b2 * unloaded;
                self.end_cycle(place);
            }
        } else if place.peak != 0.0 {
            self.end_cycle(place);
        }
        work + self.follow(place, sigma, curvature - place.rest)
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

    fn last(place: &Loop) -> Option<f64> {
        Some(place.rest + place.curvature)
    }
}
