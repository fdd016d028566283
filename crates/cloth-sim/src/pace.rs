//! How a stretch of time is cut into steps, and what becomes of a step that fails.
//!
//! An attempt that fails leaves no trace and is made again with half the size, down to the floor: `time.max_halvings`
//! halvings of the step, none to less than `time.dt_min`. What succeeded is kept. The size stays reduced, over the steps
//! that follow too, and doubles after [`GROW_AFTER`] sub-steps in a row that succeeded: what made one step fail
//! is rarely over with it, and an attempt that fails costs as much as one that succeeds. At the floor the run stops
//! with an error; the step can be taken up again from its last accepted sub-step.
//!
//! Steps of `time.dt = "auto"` are cut by their error: see [`crate::auto_step`].

use crate::auto_step::Control;
use crate::guard::Alarm;
use crate::ledger::Ledger;
use crate::plan::ELASTIC_HINGES;
use crate::report::{Refused, add_seconds};
use crate::scene::Choice;
use crate::step::Failure;
use crate::{SimError, Simulation, StepReport};
use std::ops::ControlFlow;
use std::time::Instant;

/// Sub-steps in a row that succeed before the size is doubled.
///
/// If the doubled size fails each time, one attempt in nine is lost.
const GROW_AFTER: u32 = 8;

/// How far the size of attempts is reduced: a part of the state.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Pace {
    /// Halvings of the step.
    pub(crate) halvings: u32,
    /// Sub-steps in a row that have succeeded since; zero at full size.
    pub(crate) good: u32,
    /// Under `time.dt = "auto"`.
    pub(crate) control: Control,
    pub(crate) ledger: Ledger,
}

impl Pace {
    fn grown(self) -> Self {
        Self { halvings: self.halvings - 1, good: 0, ..self }
    }

    fn halved(self) -> Self {
        Self { halvings: self.halvings + 1, good: 0, ..self }
    }

    fn succeeded(self) -> Self {
        let good = if self.halvings == 0 { 0 } else { (self.good + 1).min(GROW_AFTER) };
        Self { good, ..self }
    }
}

/// What [`Simulation::advance`] did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Advance {
    /// Steps that came to their end.
    pub steps: usize,
    /// Whether the caller's check stopped it; [`Simulation::finish_advance`] then does the rest.
    pub interrupted: bool,
}

/// What an interrupted advance has left.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Pending {
    pub(crate) steps: u64,
    pub(crate) dt: f64,
    /// Time after the last of them [s].
    pub(crate) end: f64,
}

/// A step of `dt` from `start` to `end` [s] that is taken part by part.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct UnderWay {
    pub(crate) start: f64,
    pub(crate) end: f64,
    pub(crate) dt: f64,
    /// Parts of dt/2^`max_halvings` done: counted, so that the last one ends exactly at `end`.
    pub(crate) done: u64,
    pub(crate) report: StepReport,
    pub(crate) wall_seconds: f64,
}

impl UnderWay {
    fn new(start: f64, end: f64, dt: f64) -> Self {
        let report = StepReport { dt, smallest_dt: dt, converged: true, ..StepReport::default() };
        Self { start, end, dt, done: 0, report, wall_seconds: 0.0 }
    }
}

impl Simulation {
    /// Takes one step of the scene's `time.dt` (of the size that the controller chooses, where that is "auto"), or finishes the one that an error or an interruption has left in the middle.
    ///
    /// # Errors
    /// [`SimError::Diverged`], [`SimError::Stuck`]: the step failed at every size tried; [`SimError::Device`]: the GPU that was asked
    /// for gave no answer. The state is the last good one.
    pub fn step(&mut self) -> Result<(), SimError> {
        match self.scene.time.fixed() {
            Some(dt) => self.step_to(self.state.time + dt, dt),
            None => self.controlled_step(f64::INFINITY),
        }
    }

    /// Advances by `seconds` in ⌈`seconds`/dt⌉ equal steps, or with `time.dt = "auto"` in such that the last one ends there. `check` is asked before each attempt; [`ControlFlow::Break`]
    /// stops, and [`Simulation::finish_advance`] (also after a checkpoint) does the rest with the same steps.
    ///
    /// A step that was left in the middle ends where it is.
    ///
    /// # Errors
    /// [`SimError::InvalidArgument`] for `seconds` that are negative or not finite; else as [`Simulation::step`].
    pub fn advance(
        &mut self,
        seconds: f64,
        check: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Advance, SimError> {
        /// `seconds` that is a whole number of steps but for rounding makes no extra step.
        const ROUNDING: f64 = 1e-9;
        if !(seconds.is_finite() && seconds >= 0.0) {
            return Err(SimError::InvalidArgument {
                name: "seconds",
                expected: "a finite number ≥ 0 [s]",
                got: seconds.to_string(),
            });
        }
        if let Some(mut left) = self.under_way.take() {
            left.report.dt = self.state.time - left.start;
            self.finish_step(left.report, left.wall_seconds)?;
        }
        // Of steps that their error cuts the number is not known.
        let dt = self.scene.time.fixed().unwrap_or(seconds);
        let steps = if seconds > 0.0 { (seconds / dt - ROUNDING).ceil().max(0.0) } else { 0.0 };
        let end = self.state.time + seconds;
        self.pending = (steps > 0.0).then(|| Pending { steps: steps as u64, dt: seconds / steps, end });
        self.finish_advance(check)
    }

    /// Does what an interrupted [`Simulation::advance`] has left; nothing if there is none.
    ///
    /// # Errors
    /// As [`Simulation::step`].
    pub fn finish_advance(
        &mut self,
        check: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Advance, SimError> {
        let mut steps = 0;
        while let Some(pending) = self.pending {
            if check().is_break() {
                return Ok(Advance { steps, interrupted: true });
            }
            if self.scene.time.fixed().is_none() {
                self.controlled_step(pending.end)?;
                steps += 1;
                self.pending = (self.state.time < pending.end).then_some(pending);
                continue;
            }
            let end = if pending.steps == 1 { pending.end } else { self.state.time + pending.dt };
            if self.part_of_step(end, pending.dt)? {
                steps += 1;
                self.pending = (pending.steps > 1).then(|| Pending { steps: pending.steps - 1, ..pending });
            }
        }
        Ok(Advance { steps, interrupted: false })
    }

    /// One step of `dt` [s] that ends at `end` [s], or what is left of the one under way.
    pub(crate) fn step_to(&mut self, end: f64, dt: f64) -> Result<(), SimError> {
        while !self.part_of_step(end, dt)? {}
        Ok(())
    }

    /// One accepted sub-step of the step under way, or else of a step of `dt` [s] to `end` [s]; whether that ended it.
    ///
    /// After an error the step is under way if a part of it was accepted, and the pace is as it was.
    fn part_of_step(&mut self, end: f64, dt: f64) -> Result<bool, SimError> {
        let begin = UnderWay::new(self.state.time, end, dt);
        let mut way = self.under_way.take().unwrap_or(begin);
        let before = self.state.pace;
        let result = self.sub_step(&mut way);
        if result.is_err() {
            self.state.pace = before;
        }
        let whole = 1_u64 << self.scene.time.max_halvings;
        if way.done == whole {
            self.finish_step(way.report, way.wall_seconds)?;
            return Ok(true);
        }
        self.under_way = (way.done > 0).then_some(way);
        result.map(|()| false)
    }

    /// The next sub-step of a step, as large as succeeds.
    fn sub_step(&mut self, way: &mut UnderWay) -> Result<(), SimError> {
        let started = Instant::now();
        let whole = 1_u64 << self.scene.time.max_halvings;
        if way.done == 0 && self.all_rests(way.end) {
            self.sleep_through(way.end, &mut way.report);
            way.done = whole;
            return Ok(());
        }
        let fraction = |units: u64| units as f64 / whole as f64;
        let pace = self.state.pace;
        // The parts of a doubled size end where whole ones do.
        if pace.good >= GROW_AFTER && way.done.is_multiple_of(2 * (whole >> pace.halvings)) {
            self.state.pace = pace.grown();
        }
        loop {
            let size = whole >> self.state.pace.halvings;
            let last = way.done + size == whole;
            let t1 = if last { way.end } else { way.start + way.dt * fraction(way.done + size) };
            let dt = way.dt * fraction(size);
            let failure = match self.attempt(t1, dt, size == 1, &mut way.report) {
                Ok(()) => {
                    #[cfg(test)]
                    self.accepted.push([t1, dt]);
                    self.state.pace = self.state.pace.succeeded();
                    way.done += size;
                    way.report.substeps += 1;
                    way.report.smallest_dt = way.report.smallest_dt.min(dt);
                    way.wall_seconds += started.elapsed().as_secs_f64();
                    return Ok(());
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
            if size == 1 || 0.5 * dt < self.scene.time.dt_min {
                return Err(self.given_up(failure));
            }
            self.state.pace = self.state.pace.halved();
            way.report.retries += 1;
        }
    }

    /// Counts a step as done.
    pub(crate) fn finish_step(
        &mut self,
        mut report: StepReport,
        mut wall_seconds: f64,
    ) -> Result<(), SimError> {
        let clock = Instant::now();
        self.fall_asleep(report.dt)?;
        report.asleep = self.state.rest.sleepers();
        report.remembering = self.note_history();
        self.state.step += 1;
        report.step = self.state.step;
        report.time = self.state.time;
        if self.contact.as_ref().is_some_and(|c| c.allow) {
            report.intersections = Some(self.intersections()?.len());
            add_seconds(&mut report.seconds, "intersection count", clock.elapsed().as_secs_f64());
        }
        wall_seconds += clock.elapsed().as_secs_f64();
        self.report.push(report, wall_seconds);
        if let Some(contact) = &self.contact {
            self.report.grow("contact", contact.bytes());
            self.report.grow_on_device(contact.continuous.device_bytes());
        }
        if let Some(sleeper) = &self.sleeper {
            self.report.grow("sleep", sleeper.bytes());
        }
        Ok(())
    }

    /// How many hinges remember, with `effects.history = "auto"`; notes the memory that this takes.
    fn note_history(&mut self) -> Option<usize> {
        if self.scene.effects.history == Choice::On {
            return None;
        }
        let histories = self.histories();
        self.report.grow(ELASTIC_HINGES, histories.iter().map(|h| h.bytes).sum());
        Some(histories.iter().map(|h| h.kept).sum())
    }

    /// Notes that an attempt of `dt` [s] from here was given up.
    pub(crate) fn refuse(&mut self, dt: f64, failure: &Failure) {
        let (step, time) = (self.state.step + 1, self.state.time);
        self.report.refuse(|| Refused { step, time, dt, reason: failure.to_string() });
    }

    /// The error of a failure at the floor.
    pub(crate) fn given_up(&self, failure: Failure) -> SimError {
        let time = self.state.time;
        match failure {
            Failure::Alarm(Alarm { reason, vertices }) => SimError::Diverged { time, reason, vertices },
            Failure::Unresolved { pairs, vertices } => SimError::Stuck { time, pairs, vertices },
            Failure::Strained { .. } | Failure::Energy { .. } | Failure::Wake(_) => {
                let reason = failure.to_string();
                let mut vertices = match failure {
                    Failure::Strained { edges, .. } => edges.concat(),
                    _ => Vec::new(),
                };
                vertices.sort_unstable();
                vertices.dedup();
                SimError::Diverged { time, reason, vertices }
            }
            Failure::Device(reason) => SimError::Stage { stage: "detection", message: reason },
            Failure::Stop(error) => error,
        }
    }

    /// Goes on without the GPU that gave no answer, or stops; the state is as before the attempt, which may then be made again.
    pub(crate) fn lose_device(&mut self, reason: &str) -> Result<(), SimError> {
        let Some(contact) = &mut self.contact else { return Ok(()) };
        let fallback = contact.continuous.fall_back(self.state.step + 1, self.state.time, reason)?;
        self.report.detection = Some(contact.continuous.detection.clone());
        self.report.fallbacks.push(fallback);
        Ok(())
    }
}
