//! What the sweeps ask of friction, and the kernel of a scene whose laws are all Coulomb.
//!
//! The kernel is chosen once per step, outside of the loops: a scene that asks for Coulomb runs code that knows nothing else.

use super::into_cone;
use crate::impulse::Contact;
use crate::motion::Motion;
use crate::{FrictionLaw, FrictionRule, Vec3};
use cloth_collision::CollisionMesh;

/// The friction of all contacts.
pub(crate) trait Kernel {
    /// What a contact knows about its friction.
    type State: Copy + std::fmt::Debug;

    /// A new contact between two bodies, given one vertex of either.
    fn state(&self, rule: &FrictionRule, mesh: &CollisionMesh, first: u32, second: u32) -> Self::State;

    /// A contact without friction.
    fn frictionless(&self) -> Self::State;

    /// Whether the contact has friction.
    fn acts(&self, state: &Self::State) -> bool;

    /// Coefficient of a contact that does not slide.
    fn at_rest(&self, state: &Self::State) -> f64;

    /// The tangential impulse where `stop` is the one that ends all sliding \[N s\], under the normal impulse λ \[N s\].
    ///
    /// `mass`: the contact's effective mass \[kg\].
    fn bound(&self, state: &mut Self::State, stop: Vec3, lambda: f64, mass: f64) -> Vec3;

    /// Before the sweeps, with all contacts.
    fn begin(&mut self, contacts: &mut [Contact<Self::State>], vertex_count: usize);

    /// Before sweep number `sweep`.
    fn before_sweep(&mut self, sweep: usize);

    /// Whether [`Kernel::review`] may change a contact's law.
    const REVIEWS: bool;

    /// Whether one look settles the contact, since no other acts on its vertices. Only asked where there are reviews.
    fn alone(&self, state: &Self::State) -> bool;

    /// What sweeps that have settled, or can do no more, change in the contacts' laws. Calls `again` for each contact that has
    /// changed.
    fn review(
        &mut self,
        contacts: &mut [Contact<Self::State>],
        motion: &Motion<'_>,
        tolerance: f64,
        again: impl FnMut(usize),
    );

    /// Whether the kernel stands for other laws only where [`Kernel::holds`] says so.
    const TENTATIVE: bool = false;

    /// Whether a contact that the sweeps have settled within `tolerance` \[m/s\] is as its own law wants it.
    fn holds(&self, _contact: &Contact<Self::State>, _velocity: &[Vec3], _tolerance: f64) -> bool {
        true
    }

    /// Memory \[B\].
    fn bytes(&self) -> usize;
}

/// Coulomb: one coefficient per contact.
#[derive(Debug, Default)]
pub(crate) struct Coulomb {
    /// Coefficient of each law of the rule.
    coefficients: Vec<f64>,
}

impl Coulomb {
    pub(crate) fn new(laws: &[FrictionLaw]) -> Self {
        Self { coefficients: laws.iter().map(FrictionLaw::kinetic_coefficient).collect() }
    }
}

impl Kernel for Coulomb {
    type State = f64;

    #[inline]
    fn state(&self, rule: &FrictionRule, mesh: &CollisionMesh, first: u32, second: u32) -> f64 {
        self.coefficients[rule.index_of(mesh, first, second)]
    }

    fn frictionless(&self) -> f64 {
        0.0
    }

    #[inline]
    fn acts(&self, state: &f64) -> bool {
        *state > 0.0
    }

    #[inline]
    fn at_rest(&self, state: &f64) -> f64 {
        *state
    }

    #[inline]
    fn bound(&self, state: &mut f64, stop: Vec3, lambda: f64, _mass: f64) -> Vec3 {
        into_cone(stop, *state * lambda)
    }

    #[inline]
    fn begin(&mut self, _contacts: &mut [Contact<f64>], _vertex_count: usize) {}

    #[inline]
    fn before_sweep(&mut self, _sweep: usize) {}

    const REVIEWS: bool = false;

    #[inline]
    fn alone(&self, _state: &f64) -> bool {
        false
    }

    #[inline]
    fn review(
        &mut self,
        _contacts: &mut [Contact<f64>],
        _motion: &Motion<'_>,
        _tolerance: f64,
        _again: impl FnMut(usize),
    ) {
    }

    fn bytes(&self) -> usize {
        crate::motion::bytes_of(&self.coefficients)
    }
}
