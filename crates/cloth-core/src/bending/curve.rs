//! The curve of first loading, and the size of the loop that it spans.

use crate::CoreError;

/// Moment per width [N] over curvature [1/m] of a fabric bent for the first time (4.2):
///
/// M = b_1 K + c_1 K |K| for |K| ≤ K_0, then M = b_2 K ± M_0.
///
/// K_0 = (b_1 − b_2)/(2 |c_1|) is where friction between the yarns is fully overcome and M_0 = (b_1 − b_2) K_0/2 its
/// moment; the slope is continuous there. Checked on construction: b_1 ≥ b_2 > 0, and c_1 < 0 unless b_1 = b_2, which is
/// the linear law without a loop (K_0 = M_0 = 0).
///
/// Source: thesis 4.3.1 with b_1 ≥ b_2 (the printed sign is reversed: K_0 would be negative).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Curve {
    b1: f64,
    b2: f64,
    c1: f64,
}

impl Curve {
    /// From the initial rigidity b_1 [N m], the rigidity b_2 past the friction [N m] and the quadratic coefficient c_1
    /// of positive curvatures [N m²].
    ///
    /// # Errors
    /// [`CoreError::Parameter`] naming the coefficient that leaves no loop, and why.
    pub fn new(b1: f64, b2: f64, c1: f64) -> Result<Self, CoreError> {
        let refuse = |name, expected, got| Err(CoreError::Parameter { name, expected, got });
        if !(b2.is_finite() && b2 > 0.0) {
            return refuse("bending.b2", "a value > 0 in N m: the slope once friction is overcome", b2);
        }
        if !(b1.is_finite() && b1 >= b2) {
            return refuse("bending.b1", "a value ≥ b2 in N m: friction stiffens the start of the curve", b1);
        }
        if b1 > b2 && !(c1.is_finite() && c1 < 0.0) {
            return refuse("bending.c1", "a value < 0 in N m²: the slope falls from b1 to b2", c1);
        }
        if b1 == b2 && !(c1.is_finite() && c1 <= 0.0) {
            return refuse("bending.c1", "a value ≤ 0 in N m²", c1);
        }
        let curve = Self { b1, b2, c1 };
        if b1 > b2 && !(curve.k0().is_normal() && curve.m0().is_normal()) {
            return refuse(
                "bending.c1",
                "a value that puts K0 = (b1 − b2)/(2 |c1|) in the range of numbers",
                c1,
            );
        }
        Ok(curve)
    }

    /// From what a textile laboratory measures: rigidity B = b_2 [N m], coercive couple 2HB = 2 M_0 [N] (the gap between
    /// the straight parts of the loop), and the transition curvature K_0 [1/m] at which the first loading becomes
    /// straight: b_1 = B + 2 M_0/K_0, c_1 = −M_0/K_0². A couple of zero is the linear law.
    ///
    /// # Errors
    /// [`CoreError::Parameter`] naming the value out of range.
    pub fn measured(
        rigidity: f64,
        coercive_couple: f64,
        transition_curvature: f64,
    ) -> Result<Self, CoreError> {
        let positive = |name, expected, got: f64, least: bool| {
            if got.is_finite() && (got > 0.0 || (least && got == 0.0)) {
                Ok(())
            } else {
                Err(CoreError::Parameter { name, expected, got })
            }
        };
        positive("bending.rigidity", "a value > 0 in N m", rigidity, false)?;
        positive("bending.coercive_couple", "a value ≥ 0 in N m/m", coercive_couple, true)?;
        positive("bending.transition_curvature", "a value > 0 in 1/m", transition_curvature, false)?;
        let m0 = 0.5 * coercive_couple;
        let b1 = rigidity + 2.0 * m0 / transition_curvature;
        Self::new(b1, rigidity, -m0 / (transition_curvature * transition_curvature))
    }

    /// Initial rigidity b_1 [N m].
    pub fn b1(&self) -> f64 {
        self.b1
    }

    /// Rigidity b_2 once friction is overcome [N m].
    pub fn b2(&self) -> f64 {
        self.b2
    }

    /// Quadratic coefficient c_1 of positive curvatures [N m²], ≤ 0.
    pub fn c1(&self) -> f64 {
        self.c1
    }

    /// Transition curvature K_0 [1/m]; 0 without a loop.
    pub fn k0(&self) -> f64 {
        if self.b1 > self.b2 { 0.5 * (self.b1 - self.b2) / -self.c1 } else { 0.0 }
    }

    /// Frictional moment per width M_0 [N]; 0 without a loop.
    pub fn m0(&self) -> f64 {
        0.5 * (self.b1 - self.b2) * self.k0()
    }

    /// Moment of first loading (4.2) [N].
    pub fn moment(&self, curvature: f64) -> f64 {
        let k = curvature.abs();
        let friction = if k < self.k0() { (self.b1 - self.b2 + self.c1 * k) * k } else { self.m0() };
        self.b2 * curvature + friction.copysign(curvature)
    }

    /// Stiffness of first loading dM/dK (4.3) [N m].
    pub fn slope(&self, curvature: f64) -> f64 {
        let k = curvature.abs();
        if k < self.k0() { self.b1 + 2.0 * self.c1 * k } else { self.b2 }
    }

    /// Work of first loading, the integral of M from 0 to K, per area [J/m²].
    pub fn work(&self, curvature: f64) -> f64 {
        let (k, k0) = (curvature.abs(), self.k0());
        let inside = k.min(k0);
        let friction = inside * inside * (0.5 * (self.b1 - self.b2) + self.c1 * inside / 3.0);
        0.5 * self.b2 * k * k + friction + self.m0() * (k - inside)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A few roundings of numbers of order one.
    const ROUNDING: f64 = 1e-14;

    #[test]
    fn derived_and_settable_coefficients_agree() {
        let curve = Curve::measured(2.0, 0.6, 0.5).unwrap();
        assert!((curve.k0() - 0.5).abs() < ROUNDING && (curve.m0() - 0.3).abs() < ROUNDING);
        assert_eq!(Curve::new(curve.b1(), curve.b2(), curve.c1()).unwrap(), curve);
        // The thesis's figure 4.14 starts at M_0 = 0.41.
        assert!((Curve::new(5.20, 2.51, -4.45).unwrap().m0() - 0.4065).abs() < 1e-4);
        assert_eq!(Curve::measured(2.0, 0.0, 0.5).unwrap().moment(0.3), 0.6);
    }

    #[test]
    fn slope_and_work_belong_to_the_moment() {
        let curve = Curve::new(5.0, 2.0, -3.0).unwrap();
        let h = 1e-5;
        for k in [-3.0, -0.5001, -0.3, -1e-3, 0.0, 0.2, 0.4999, 0.7] {
            let slope = (curve.moment(k + h) - curve.moment(k - h)) / (2.0 * h);
            // Differences of a quadratic are exact; across its kinks and at K_0 they are off by |c_1| h.
            assert!((slope - curve.slope(k)).abs() < 2.0 * 3.0 * h, "{k}");
            let moment = (curve.work(k + h) - curve.work(k - h)) / (2.0 * h);
            assert!((moment - curve.moment(k)).abs() < 1e-9, "{k}");
        }
        assert_eq!(curve.moment(-0.2), -curve.moment(0.2));
    }

    #[test]
    fn coefficients_without_a_loop_are_named() {
        let name = |b1, b2, c1| match Curve::new(b1, b2, c1) {
            Err(CoreError::Parameter { name, .. }) => name,
            other => panic!("{other:?}"),
        };
        assert_eq!(name(1.0, 2.0, -1.0), "bending.b1");
        assert_eq!(name(f64::NAN, 2.0, -1.0), "bending.b1");
        assert_eq!(name(2.0, 0.0, -1.0), "bending.b2");
        assert_eq!(name(2.0, 1.0, 1.0), "bending.c1");
        assert_eq!(name(2.0, 1.0, 0.0), "bending.c1");
        assert_eq!(name(2.0, 1.0, f64::NEG_INFINITY), "bending.c1");
        assert_eq!(name(2.0, 1.0, -1e-320), "bending.c1");
        assert_eq!(name(1.0, 1.0, 0.5), "bending.c1");
        assert!(Curve::new(1.0, 1.0, 0.0).is_ok());
    }
}
