//! Elastic limit and plastic flow, the model that hysteresis is compared with.
//!
//! M = B (K − K_p) while |B (K − K_p) − H K_p| ≤ B K_y; beyond that limit K_p follows so that equality holds: the slope
//! falls to B H/(B + H). It depends on the path alone, not on how finely it is stepped. Ψ = ½ B (K − K_p)² + ½ H K_p²;
//! B K_y |K̇_p| is dissipated, and nothing below the limit.
//!
//! Source: linear kinematic hardening (Simo and Hughes 1998, 1.3), which with H = 0 is the flow of O'Brien et al. 2002
//! that the thesis compares with (4.5.3).

use bytemuck::{Pod, Zeroable};

use super::{BendingLaw, Moment, Place};
use crate::CoreError;

/// Elastic limit and plastic flow of one material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plastic {
    rigidity: f64,
    elastic_limit: f64,
    hardening: f64,
}

/// What a place remembers of its flow.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Flow {
    /// K_p [1/m].
    plastic: f64,
    /// K [1/m].
    curvature: f64,
}

impl Plastic {
    /// From the rigidity B [N m], the elastic limit K_y [1/m] and the hardening H [N m].
    ///
    /// # Errors
    /// [`CoreError::Parameter`] naming the value out of range.
    pub fn new(rigidity: f64, elastic_limit: f64, hardening: f64) -> Result<Self, CoreError> {
        for (name, expected, got, zero) in [
            ("bending.rigidity", "a value > 0 in N m", rigidity, false),
            ("bending.elastic_limit", "a curvature > 0 in 1/m", elastic_limit, false),
            ("bending.hardening", "a value ≥ 0 in N m", hardening, true),
        ] {
            if !(got.is_finite() && (got > 0.0 || (zero && got == 0.0))) {
                return Err(CoreError::Parameter { name, expected, got });
            }
        }
        Ok(Self { rigidity, elastic_limit, hardening })
    }

    /// Moment at the elastic limit B K_y [N].
    fn limit_moment(&self) -> f64 {
        self.rigidity * self.elastic_limit
    }

    /// How K_p changes on the way to a curvature.
    #[inline]
    fn flow(&self, place: &Flow, curvature: f64) -> f64 {
        let drive = self.rigidity * (curvature - place.plastic) - self.hardening * place.plastic;
        let excess = (drive.abs() - self.limit_moment()).max(0.0);
        (excess / (self.rigidity + self.hardening)).copysign(drive)
    }

    /// Ψ [J/m²].
    #[inline]
    fn stored(&self, elastic: f64, plastic: f64) -> f64 {
        0.5 * (self.rigidity * elastic * elastic + self.hardening * plastic * plastic)
    }
}

impl BendingLaw for Plastic {
    const NAME: &'static str = "plastic";
    const CONSERVATIVE: bool = false;
    type Memory = Flow;

    #[inline]
    fn moment(&self, place: &Flow, curvature: f64, _rate: f64) -> Moment {
        let flow = self.flow(place, curvature);
        let plastic = place.plastic + flow;
        let slope = if flow == 0.0 {
            self.rigidity
        } else {
            self.rigidity * self.hardening / (self.rigidity + self.hardening)
        };
        let elastic = curvature - plastic;
        Moment { moment: self.rigidity * elastic, slope, energy: self.stored(elastic, plastic) }
    }

    #[inline]
    fn advance(&self, place: &mut Flow, curvature: f64) -> f64 {
        let flow = self.flow(place, curvature);
        let before = self.stored(place.curvature - place.plastic, place.plastic);
        *place = Flow { plastic: place.plastic + flow, curvature };
        let after = self.stored(curvature - place.plastic, place.plastic);
        after - before + self.limit_moment() * flow.abs()
    }

    /// Below the limit the path does nothing, whatever may be neglected.
    #[inline]
    fn leaves(&self, curvature: f64, _neglected: f64) -> bool {
        self.flow(&Flow::default(), curvature) != 0.0
    }

    fn place(&self, place: &Flow) -> Place {
        Place { rest_curvature: place.plastic, b1: self.rigidity, frictional_moment: self.limit_moment() }
    }

    fn elastic_rigidity(&self) -> f64 {
        self.rigidity
    }

    #[inline]
    fn elastic(&self, place: &Flow, curvature: f64) -> f64 {
        curvature - (place.plastic + self.flow(place, curvature))
    }

    fn last(place: &Flow) -> Option<f64> {
        Some(place.curvature)
    }
}
