//! A law alone along a path of curvatures.

use super::{BendingLaw, Curve, Hysteresis, Linear, Plastic};
use crate::CoreError;

/// One of the laws.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Law {
    /// M = B K.
    Linear(Linear),
    /// The curve of first loading, there and back (4.2).
    Nonlinear(Curve),
    /// Elastic limit and plastic flow.
    Plastic(Plastic),
    /// Hysteresis, residual curvature, fatigue.
    Hysteresis(Hysteresis),
}

/// What a law answers along a path, one entry per sample.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Trace {
    /// M: moment per width [N].
    pub moment: Vec<f64>,
    /// Curvature (θ_r − θ_0)/h̄ about which the place rests [1/m].
    pub rest_curvature: Vec<f64>,
    /// Initial rigidity b_1 that fatigue has left [N m].
    pub b1: Vec<f64>,
    /// Frictional moment M_0 that fatigue has left; of the plastic law the moment at its limit [N].
    pub frictional_moment: Vec<f64>,
    /// Work per area that came in and is no longer stored [J/m²]: never falls.
    pub dissipated: Vec<f64>,
}

/// Follows `law` from a flat, unused place along `curvature` [1/m] = (θ − θ_0)/h̄. Between samples the curvature is
/// monotone and what happens there (the end of a recovery, the start of flow) is solved exactly. A cycle that a reversal
/// ends leaves its trace in the samples after the reversal.
///
/// # Errors
/// [`CoreError::NotFinite`] naming the first sample that is not a finite number.
pub fn trace(law: &Law, curvature: &[f64]) -> Result<Trace, CoreError> {
    if let Some(index) = curvature.iter().position(|k| !k.is_finite()) {
        return Err(CoreError::NotFinite { name: "curvature", index, got: curvature[index] });
    }
    Ok(match law {
        Law::Linear(law) => follow(law, curvature),
        Law::Nonlinear(law) => follow(law, curvature),
        Law::Plastic(law) => follow(law, curvature),
        Law::Hysteresis(law) => follow(law, curvature),
    })
}

fn follow<L: BendingLaw>(law: &L, curvature: &[f64]) -> Trace {
    let mut trace = Trace::default();
    let mut memory = L::Memory::default();
    let mut work = 0.0;
    for &k in curvature {
        work += law.advance(&mut memory, k);
        let (now, place) = (law.moment(&memory, k, 0.0), law.place(&memory));
        trace.moment.push(now.moment);
        trace.rest_curvature.push(place.rest_curvature);
        trace.b1.push(place.b1);
        trace.frictional_moment.push(place.frictional_moment);
        trace.dissipated.push(if L::CONSERVATIVE { 0.0 } else { work - now.energy });
    }
    trace
}
