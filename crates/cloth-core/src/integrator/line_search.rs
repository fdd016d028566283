//! Step halving on the incremental potential, or on the residual where there is no potential.

/// What a trial is judged by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Merit {
    /// Incremental potential [J].
    pub(super) potential: f64,
    /// Norm of the residual over the free vertices [N s].
    pub(super) residual: f64,
}

/// Fraction of the predicted decrease that a step must reach.
const SUFFICIENT: f64 = 1e-4;
/// Relative size of a change of the potential that rounding may cause.
const ROUNDING: f64 = 1e-12;

/// Whether a trial at step `alpha` is accepted, coming from `start` with the potential's `slope` along the step [J].
///
/// With a potential (`conservative`): sufficient decrease, or a change within rounding and a smaller residual. Without:
/// a smaller residual, or a sufficient decrease of the potential that leaves dissipation out.
pub(super) fn accepted(start: &Merit, trial: &Merit, alpha: f64, slope: f64, conservative: bool) -> bool {
    let change = trial.potential - start.potential;
    let decreases = slope < 0.0 && change <= SUFFICIENT * alpha * slope;
    let smaller = trial.residual <= (1.0 - SUFFICIENT * alpha) * start.residual;
    if conservative {
        decreases || (smaller && change.abs() <= ROUNDING * start.potential.abs().max(trial.potential.abs()))
    } else {
        smaller || decreases
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn judges_potential_and_residual() {
        let start = Merit { potential: 1.0, residual: 1.0 };
        let lower = Merit { potential: 0.5, residual: 2.0 };
        let higher = Merit { potential: 1.5, residual: 0.5 };
        assert!(accepted(&start, &lower, 1.0, -1.0, true));
        assert!(!accepted(&start, &higher, 1.0, -1.0, true), "a saddle has a small residual too");
        assert!(accepted(&start, &higher, 1.0, -1.0, false));
        let equal = Merit { potential: 1.0, residual: 0.5 };
        assert!(accepted(&start, &equal, 1.0, -1e-20, true), "within rounding the residual decides");
        let worse = Merit { potential: 1.5, residual: 1.5 };
        assert!(!accepted(&start, &worse, 1.0, -1.0, false));
        let nan = Merit { potential: f64::NAN, residual: f64::NAN };
        assert!(!accepted(&start, &nan, 1.0, -1.0, false));
    }
}
