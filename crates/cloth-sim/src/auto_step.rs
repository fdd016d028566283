//! `time.dt = "auto"`: the step is as large as its estimated error allows.
//!
//! Each step is taken once whole, giving A, and once in two halves, giving B, contact included; both start from the same
//! state. For a scheme of order p the largest |x_B − x_A|/(2^p − 1) over the cloth vertices estimates the error of B
//! \[m\]; it is held below a tenth of `time.dt_tolerance`. Where nothing touches, the step ends at B + (B − A)/(2^p − 1), which is of
//! order p + 1 (local extrapolation), after the same checks as any motion; else at B. The size of the next step comes from
//! a PI controller. Laws with memory see one motion from the start of the step to its end.
//!
//! A step whose error stays above the tolerance although it was made smaller [`MAX_REJECTED`] times, as an impact may, is
//! accepted and counted. A step that fails is halved down to `time.dt_min`; one that makes energy ([`crate::ledger`]) a few times. Where
//! the cloth then stands still, it does so for as long as the step was tried first, and starts anew from rest.
//!
//! Source: E. Hairer, S. P. Nørsett and G. Wanner, "Solving Ordinary Differential Equations I", 1993, II.4 (step doubling,
//! local extrapolation); K. Gustafsson, "Control-theoretic techniques for stepsize selection", 1994.

use crate::constraints::Holds;
use crate::step::{Failure, State, Trial, touches};
use crate::{SimError, Simulation, StepReport, Vec3};
use cloth_core::Method;
use cloth_response::Sides;
use std::time::Instant;

/// Size of the first attempt [s], where `time.dt_max` allows it: most cloth scenes start from rest.
pub(crate) const FIRST: f64 = 1e-3;
/// Part of the tolerance that the error of one step may be: over a run they add up to about the whole.
const SHARE: f64 = 0.1;
/// Part of the size at which the error would meet the tolerance.
const SAFETY: f64 = 0.9;
/// Most that the size grows from step to step.
const GROWTH: f64 = 2.0;
/// Most that it shrinks.
const SHRINK: f64 = 0.2;
/// Exponents of the controller times p + 1 (Gustafsson): of this step's error and of the one before.
const PROPORTIONAL: f64 = 0.7;
const INTEGRAL: f64 = 0.4;
/// Errors far below the tolerance count as this part of it.
const LEAST: f64 = 1e-4;
/// Attempts of one step that its error refuses; the next one is accepted.
const MAX_REJECTED: u32 = 4;
/// Attempts of one step that may fail.
const MAX_FAILED: u32 = 24;
/// A step that ends this part of itself before the end of the stretch ends there.
const ROUNDING: f64 = 1e-9;

/// What the controller remembers: a part of the state.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Control {
    /// Size of the next attempt [s]; zero before the first.
    pub(crate) size: f64,
    /// Error of the last step over the tolerance; zero before the first.
    pub(crate) error: f64,
}

impl Control {
    /// After an accepted step of `dt` with this error over the tolerance.
    fn accepted(self, dt: f64, error: f64, order: i32, refused: bool) -> Self {
        let error = error.max(LEAST);
        let before = if self.error > 0.0 { self.error } else { error };
        let k = f64::from(order + 1);
        let factor = SAFETY * error.powf(-PROPORTIONAL / k) * before.powf(INTEGRAL / k);
        let factor = factor.clamp(SHRINK, if refused { 1.0 } else { GROWTH });
        // A step cut to land on the end of a stretch does not reduce the next one, unless its error does.
        let size = if !refused && dt < self.size && factor >= 1.0 {
            self.size.max(dt * factor)
        } else {
            dt * factor
        };
        Self { size, error }
    }

    /// After an attempt whose error over the tolerance was too large.
    fn rejected(self, dt: f64, error: f64, order: i32) -> Self {
        let factor = SAFETY * error.powf(-1.0 / f64::from(order + 1));
        Self { size: dt * factor.clamp(SHRINK, SAFETY), ..self }
    }
}

/// Order of a scheme.
fn order(method: Method) -> i32 {
    match method {
        Method::ExplicitEuler | Method::ImplicitEuler | Method::ImplicitNewton | Method::SemiImplicit => 1,
        Method::Midpoint => 2,
        Method::Rk4 => 4,
    }
}

/// The end of a step taken whole and in halves.
struct Doubled {
    state: State,
    /// Σ m times the way of repulsion's pushes [kg m].
    pushed: Vec3,
    /// Estimated error of the two halves [m].
    error: f64,
    /// Sides of near pairs at the start, for an attempt that is refused; those of the middle stand.
    sides: Option<Sides>,
    /// Of continuous detection, and of all [s].
    seconds: [f64; 2],
}

impl Simulation {
    /// One accepted step that ends at `end` [s] or before.
    pub(crate) fn controlled_step(&mut self, end: f64) -> Result<(), SimError> {
        let started = Instant::now();
        let (start, time) = (self.state.time, self.scene.time);
        let order = order(time.integrator);
        let mut report = StepReport { converged: true, ..StepReport::default() };
        if end.is_finite() && self.all_rests(end) {
            self.sleep_through(end, &mut report);
            (report.dt, report.smallest_dt) = (end - start, end - start);
            return self.finish_step(report, started.elapsed().as_secs_f64());
        }
        let mut control = self.state.pace.control;
        if control.size == 0.0 {
            control.size = FIRST;
        }
        let first_size = control.size.clamp(time.dt_min, time.dt_max);
        loop {
            control.size = control.size.clamp(time.dt_min, time.dt_max);
            let (dt, t1) = cut(start, end, control.size);
            let failure = match self.doubled(t1, dt, order, &mut report) {
                Ok(Doubled { mut state, pushed, error, sides, seconds }) => {
                    let ratio = error / (SHARE * time.dt_tolerance);
                    let last = report.rejected == MAX_REJECTED || dt <= time.dt_min;
                    if ratio > 1.0 && !last {
                        self.remember_sides(sides);
                        report.rejected += 1;
                        control = control.rejected(dt, ratio, order);
                        continue;
                    }
                    let floor = report.retries >= time.max_halvings || 0.5 * dt < time.dt_min;
                    match self.audit(&state, dt, pushed, floor, &mut report) {
                        Ok(ledger) => state.pace.ledger = ledger,
                        Err(failure) => {
                            self.remember_sides(sides);
                            self.refuse(dt, &failure);
                            report.retries += 1;
                            control.size = 0.5 * dt;
                            if !floor {
                                continue;
                            }
                            // At the smallest size it would stand where it is from one failure to the next, ever shorter.
                            let (tried, t1) = cut(start, end, first_size);
                            (report.dt, report.smallest_dt, report.substeps) = (tried, dt, 2);
                            self.stand_still(t1);
                            self.state.pace.control = Control::default();
                            return self.finish_step(report, started.elapsed().as_secs_f64());
                        }
                    }
                    let refused = report.rejected + report.retries > 0;
                    report.above_tolerance = ratio > 1.0;
                    (report.dt, report.smallest_dt, report.substeps) = (dt, dt, 2);
                    report.error = Some(error);
                    self.commit(state, seconds);
                    self.state.pace.control = control.accepted(dt, ratio, order, refused);
                    #[cfg(test)]
                    self.accepted.push([t1, dt]);
                    return self.finish_step(report, started.elapsed().as_secs_f64());
                }
                Err(Failure::Stop(error)) => return Err(error),
                Err(Failure::Device(reason)) => {
                    self.lose_device(&reason)?;
                    continue;
                }
                Err(Failure::Wake(vertices)) => {
                    self.wake(&vertices)?;
                    continue;
                }
                Err(failure) => failure,
            };
            self.refuse(dt, &failure);
            if 0.5 * dt < time.dt_min || report.retries == MAX_FAILED {
                return Err(self.given_up(failure));
            }
            report.retries += 1;
            control.size = 0.5 * dt;
        }
    }

    /// The step of `dt` to `t1` from the state as it is, which stays: whole, in halves, and what follows from both.
    fn doubled(&mut self, t1: f64, dt: f64, order: i32, report: &mut StepReport) -> Result<Doubled, Failure> {
        let whole = self.trial(t1, dt, report)?;
        let first = self.trial(self.state.time + 0.5 * dt, 0.5 * dt, report)?;
        let touched = [&self.state, &whole.state, &first.state].into_iter().any(touches);
        let sides = self.contact.as_ref().map(|contact| contact.responder.sides().clone());
        if let Some(contact) = &mut self.contact {
            contact.responder.accept();
        }
        let start = std::mem::replace(&mut self.state, first.state.clone());
        let result = self.second_half(t1, dt, order, touched, &whole, report);
        self.state = start;
        let (second, end, error) = match result {
            Ok(done) => done,
            Err(failure) => {
                self.remember_sides(sides);
                return Err(failure);
            }
        };
        whole.note_work(report);
        first.note(report);
        second.note(report);
        let [a, b, c] = [&whole, &first, &second].map(Trial::seconds);
        let pushed = first.pushed() + second.pushed();
        let seconds = [0, 1].map(|k| a[k] + b[k] + c[k]);
        Ok(Doubled { state: end, pushed, error, sides, seconds })
    }

    /// From the middle of a step, where the state is: the second half, the step's end, and its estimated error [m].
    fn second_half(
        &mut self,
        t1: f64,
        dt: f64,
        order: i32,
        touched: bool,
        whole: &Trial,
        report: &mut StepReport,
    ) -> Result<(Trial, State, f64), Failure> {
        let second = self.trial(t1, 0.5 * dt, report)?;
        let share = 1.0 / (f64::from(order).exp2() - 1.0);
        let (a, b) = (&whole.state, &second.state);
        let cloth = self.bodies.cloth_vertices;
        let gap = a.x[..cloth].iter().zip(&b.x).map(|(a, b)| (b - a).norm()).fold(0.0, f64::max);
        let error = gap * share;
        if touched || touches(b) {
            let end = b.clone();
            return Ok((second, end, error));
        }
        let beyond = |a: &[Vec3], b: &[Vec3]| -> Vec<Vec3> {
            let free = |i: usize| self.inv_mass[i] > 0.0;
            (0..b.len()).map(|i| if free(i) { b[i] + (b[i] - a[i]) * share } else { b[i] }).collect()
        };
        let (x, v) = (beyond(&a.x, &b.x), beyond(&a.v, &b.v));
        self.check(&x, &v, report)?;
        let (end, _) = self.meet(t1, 0.5 * dt, x, v, Holds::default(), report)?;
        Ok((second, end, error))
    }

    /// Goes back to what contact remembered of sides.
    fn remember_sides(&mut self, sides: Option<Sides>) {
        if let (Some(contact), Some(sides)) = (&mut self.contact, sides) {
            contact.responder.set_sides(sides);
        }
    }
}

/// Size and end of a step of about `size` from `start`, so that no tiny one is left before `end` [s].
fn cut(start: f64, end: f64, size: f64) -> (f64, f64) {
    let left = end - start;
    if size >= left * (1.0 - ROUNDING) {
        (left, end)
    } else if 2.0 * size > left {
        (0.5 * left, start + 0.5 * left)
    } else {
        (size, start + size)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_land_on_the_end_without_a_tiny_one() {
        assert_eq!(cut(0.0, 1.0, 2.0), (1.0, 1.0));
        assert_eq!(cut(0.0, 1.0, 1.0 - 1e-12), (1.0, 1.0));
        assert_eq!(cut(0.0, 1.0, 0.9), (0.5, 0.5));
        assert_eq!(cut(0.0, 1.0, 0.25), (0.25, 0.25));
        assert_eq!(cut(0.0, f64::INFINITY, 0.25), (0.25, 0.25));
    }

    #[test]
    fn the_controller_settles_where_the_error_meets_the_tolerance() {
        // error = c dt^(p + 1): the fixed point is near c dt^(p + 1) = 1, a little below.
        for order in [1, 2, 4] {
            let error = |dt: f64| 37.0 * dt.powi(order + 1);
            let mut control = Control { size: 1e-3, error: 0.0 };
            for _ in 0..100 {
                let dt = control.size;
                control = if error(dt) <= 1.0 {
                    control.accepted(dt, error(dt), order, false)
                } else {
                    control.rejected(dt, error(dt), order)
                };
            }
            assert!((0.1..1.0).contains(&error(control.size)), "{order}: {}", error(control.size));
        }
    }

    #[test]
    fn a_step_cut_to_land_does_not_reduce_the_next() {
        let control = Control { size: 0.01, error: 0.5 };
        assert_eq!(control.accepted(1e-4, 1e-6, 1, false).size, 0.01);
        assert!(control.accepted(1e-4, 1e-6, 1, true).size <= 1e-4, "after a refusal it does not grow");
        assert!(control.accepted(0.01, 0.99, 1, false).size < 0.01);
    }
}
