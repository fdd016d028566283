//! Moment per width M [N] of a fabric over its curvature K [1/m], by law, and what a bent place remembers.
//!
//! | law | moment | remembers |
//! |---|---|---|
//! | [`Linear`] | B K | nothing |
//! | [`Curve`] (nonlinear) | softening from b_1 to b_2 (4.2) | nothing |
//! | [`Plastic`] | B (K − K_p) up to an elastic limit, then flow | K_p |
//! | [`Hysteresis`] | the loop of (4.4)–(4.8), residual curvature, fatigue | its place in the loop |
//!
//! K is the change of curvature against the mesh at rest, (θ − θ_0)/h̄ of a hinge. [`trace`] follows a law alone along
//! any path; hinges of a simulation follow the same code.

#![allow(clippy::inline_always, reason = "measured: a call per hinge costs a third of the kernel")]

mod curve;
mod hysteresis;
mod plastic;
mod trace;

use crate::CoreError;
pub use curve::Curve;
pub use hysteresis::{Hysteresis, Loop};
pub use plastic::{Flow, Plastic};
pub use trace::{Law, Trace, trace};

/// What a law answers at one curvature.
#[allow(clippy::struct_field_names, reason = "the moment of a moment–curvature law is its moment")]
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Moment {
    /// M: moment per width [N].
    pub(crate) moment: f64,
    /// dM/dK in the direction of motion [N m].
    pub(crate) slope: f64,
    /// Ψ: stored energy per area [J/m²].
    pub(crate) energy: f64,
}

/// A hinge of a law with memory as it stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HingeState {
    /// Its corners in the global arrays: the shared edge, then the opposite vertices.
    pub vertices: [u32; 4],
    /// Change of curvature (θ − θ_0)/h̄ [1/m].
    pub curvature: f64,
    /// Moment per width [N].
    pub moment: f64,
    /// What its path has made of it.
    pub place: Place,
}

/// What a path has made of a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Curvature (θ_r − θ_0)/h̄ about which it rests [1/m].
    pub rest_curvature: f64,
    /// Initial rigidity b_1 that fatigue has left [N m].
    pub b1: f64,
    /// Frictional moment M_0 that fatigue has left; of the plastic law the moment at its limit [N].
    pub frictional_moment: f64,
}

/// A moment–curvature law of one material. Kernels are compiled once per law.
pub(crate) trait BendingLaw: Send + Sync {
    /// Name of the effect.
    const NAME: &'static str;
    /// Whether Ψ' = M: the moment is a function of the curvature alone.
    const CONSERVATIVE: bool;
    /// What one hinge remembers between steps; `()` for laws without memory. As many `f64` as [`words`] gives.
    type Memory: Copy + Default + Send + Sync + bytemuck::Pod;

    /// Moment, slope and energy after a monotone motion from what is remembered to `curvature` [1/m]. Where the
    /// curvature has not moved, `rate` [1/(m s)] tells the direction of the slope.
    fn moment(&self, memory: &Self::Memory, curvature: f64, rate: f64) -> Moment;

    /// Takes a monotone motion to `curvature` [1/m] as done. Returns the work done on the place per area [J/m²].
    fn advance(&self, memory: &mut Self::Memory, curvature: f64) -> f64;

    /// Whether an unused place has left the elastic range after a monotone motion to `curvature` [1/m]: beyond, what the path does
    /// to the moment is more than the share `neglected` of the frictional moment. Never for laws without memory.
    fn leaves(&self, _curvature: f64, _neglected: f64) -> bool {
        false
    }

    /// As [`BendingLaw::moment`] of a place that has not left the elastic range, whatever its path there: Ψ' = M within.
    #[inline(always)]
    fn fresh(&self, curvature: f64, rate: f64) -> Moment {
        self.moment(&Self::Memory::default(), curvature, rate)
    }

    /// What the path has made of a place.
    fn place(&self, memory: &Self::Memory) -> Place;

    /// Largest slope on any path over the slope at rest.
    fn stiffening(&self) -> f64 {
        1.0
    }

    /// B of the elastic part B K_e of the moment [N m].
    fn elastic_rigidity(&self) -> f64;

    /// K_e: the curvature that the elastic part sees after a monotone motion to `curvature` [1/m].
    fn elastic(&self, _memory: &Self::Memory, curvature: f64) -> f64 {
        curvature
    }

    /// The curvature at which `memory` was last advanced [1/m]; none for laws without memory.
    fn last(memory: &Self::Memory) -> Option<f64>;
}

/// Number of `f64` in a law's memory.
pub(crate) const fn words<L: BendingLaw>() -> usize {
    size_of::<L::Memory>() / size_of::<f64>()
}

/// M = B K.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Linear {
    rigidity: f64,
}

impl Linear {
    /// From the bending rigidity B per width [N m].
    ///
    /// # Errors
    /// [`CoreError::Parameter`] for a rigidity that is negative or not finite.
    pub fn new(rigidity: f64) -> Result<Self, CoreError> {
        if !(rigidity.is_finite() && rigidity >= 0.0) {
            let expected = "a value ≥ 0 in N m";
            return Err(CoreError::Parameter { name: "bending.rigidity", expected, got: rigidity });
        }
        Ok(Self { rigidity })
    }

    /// B [N m].
    pub fn rigidity(&self) -> f64 {
        self.rigidity
    }
}

impl BendingLaw for Linear {
    const NAME: &'static str = "hinge";
    const CONSERVATIVE: bool = true;
    type Memory = ();

    #[inline]
    fn moment(&self, (): &(), curvature: f64, _rate: f64) -> Moment {
        let moment = self.rigidity * curvature;
        Moment { moment, slope: self.rigidity, energy: 0.5 * moment * curvature }
    }

    fn advance(&self, (): &mut (), _curvature: f64) -> f64 {
        0.0
    }

    fn place(&self, (): &()) -> Place {
        Place { rest_curvature: 0.0, b1: self.rigidity, frictional_moment: 0.0 }
    }

    fn elastic_rigidity(&self) -> f64 {
        self.rigidity
    }

    fn last((): &()) -> Option<f64> {
        None
    }
}

impl BendingLaw for Curve {
    const NAME: &'static str = "nonlinear";
    const CONSERVATIVE: bool = true;
    type Memory = ();

    #[inline]
    fn moment(&self, (): &(), curvature: f64, _rate: f64) -> Moment {
        Moment {
            moment: Curve::moment(self, curvature),
            slope: self.slope(curvature),
            energy: self.work(curvature),
        }
    }

    fn advance(&self, (): &mut (), _curvature: f64) -> f64 {
        0.0
    }

    fn place(&self, (): &()) -> Place {
        Place { rest_curvature: 0.0, b1: self.b1(), frictional_moment: self.m0() }
    }

    fn elastic_rigidity(&self) -> f64 {
        self.b2()
    }

    fn last((): &()) -> Option<f64> {
        None
    }
}
