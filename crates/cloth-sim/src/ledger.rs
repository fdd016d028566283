//! The mechanical energy of cloth in contact: what it may be, and whether a step made more.
//!
//! Implicit dynamics lose energy, and so do friction and impact. But impulses move single vertices, which stiff cloth
//! answers in the next solve only: a large step can make elastic energy out of nothing. The ledger holds the least energy \[J\]
//! that the cloth has had since contact began, plus what has been done to it since: the work of pins and of air
//! ([`cloth_core::Work`]; what they take away is not counted), the most that moving colliders and pins can have done through
//! contact, and what repulsion did against gravity as it moved apart what is nearer than the thickness, −g·Σ m Δx over its pushes.
//! What these bend on the way is made by contact like any other energy: it goes as the square of a push, and smaller steps make less
//! of it. A step that exceeds it by more than half of the energy that has been in the motion fails like any other, and is tried
//! with half the size. What has been lost since is no more in it: it is at most what there is above the least potential of
//! gravity that the cloth has had, so that a cloth that was thrown about and lies still may make no more than one that was laid
//! down. At the floor, `time.max_halvings` halvings, it is accepted, and the report says how much was made. But where all that
//! was made since contact began and is not lost again is more than all the energy that may be in the motion, and nothing drives
//! it, the cloth stays where it is and loses its velocity: a board of a millimetre that hits something with one corner would else
//! be bent by more than it weighs, in many steps.
//!
//! Nothing is looked at in scenes without contact, in steps in which nothing touches, and under explicit integrators. With
//! `effects.energy_account` energy and work are reported of all steps, whatever touches, and under any integrator.

use crate::constraints::Holds;
use crate::step::{Failure, State, touches};
use crate::{EnergyReport, Simulation, StepReport, Vec3};
use cloth_core::{Motion, Work};

/// Part of the energy that has been in the motion which a step may make: what ordinary steps of contact make stays below.
const ALLOWED: f64 = 0.5;

/// Energies that a step is judged by: a part of the state.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Ledger {
    /// Whether the numbers hold.
    pub(crate) open: bool,
    /// What the energy may be: after a step that made energy, what it is [J].
    pub(crate) level: f64,
    /// What the energy might be if no step had made any [J].
    pub(crate) base: f64,
    /// Most kinetic and elastic energy of steps before which none was made, or what was is lost again; while pins, colliders or wind
    /// drive the cloth, that of the last step [J].
    pub(crate) scale: f64,
    /// Least potential energy of gravity: what there is above it may be in the motion, no more [J].
    pub(crate) lowest: f64,
}

impl Simulation {
    /// Whether a step to this end is judged by its energy.
    fn judges(&self, end: &State) -> bool {
        self.audited && touches(end)
    }

    /// Whether pins that move or wind do work on the cloth in a step to this end.
    fn is_driven(&self, end: &State) -> bool {
        let air = &self.scene.air;
        let wind = air.wind != [0.0; 3] && (air.damping > 0.0 || air.density * (air.drag + air.lift) > 0.0);
        let moves = |&v: &u32| end.x[v as usize] != self.state.x[v as usize];
        wind || self.pins.vertices.iter().any(moves)
    }

    /// Ends a step at `t1` \[s\] where it started, all cloth at rest.
    pub(crate) fn stand_still(&mut self, t1: f64) {
        let state = &mut self.state;
        state.time = t1;
        state.v.fill(Vec3::zeros());
        state.contact_force.fill(Vec3::zeros());
        state.holds = Holds::default();
    }

    /// Work of pins and air on the cloth over the step from the state as it is to `end`; none where no account is kept.
    fn work_to(&self, end: &State, dt: f64) -> Option<Work> {
        if !(self.scene.effects.energy_account || self.judges(end)) {
            return None;
        }
        let (from, to) = (Motion { x: &self.state.x, v: &self.state.v }, Motion { x: &end.x, v: &end.v });
        Some(match self.sleeper.as_ref().and_then(|s| s.awake.as_ref()) {
            None => self.integrator.work(from, to, dt, &self.pins.vertices),
            Some(awake) => awake.work(from, to, dt),
        })
    }

    /// The ledger after the step of `dt` \[s\] to `end`, in which repulsion pushed by `pushed` \[kg m\]
    /// ([`cloth_response::ResponseInfo::pushed`]).
    ///
    /// With `accept` a step that made energy passes, and the ledger starts anew from there; but for one that made too much.
    pub(crate) fn audit(
        &self,
        end: &State,
        dt: f64,
        pushed: Vec3,
        accept: bool,
        report: &mut StepReport,
    ) -> Result<Ledger, Failure> {
        let ledger = self.state.pace.ledger;
        // What is done to the cloth while nothing touches is not followed: the next contact begins anew.
        let untouched = || if self.is_driven(end) { Ledger::default() } else { ledger };
        let Some(work) = self.work_to(end, dt) else { return Ok(untouched()) };
        let sums = |x: &[Vec3], v: &[Vec3]| {
            let energy = self.energy_at(x, v);
            (energy.total(), energy.gravity)
        };
        let (energy, gravity) = sums(&end.x, &end.v);
        let moving = energy - gravity;
        let entry = EnergyReport { total: energy, pins: work.pins, air: work.air };
        if !self.judges(end) {
            note(report, entry);
            return Ok(untouched());
        }
        let ledger = if ledger.open {
            ledger
        } else {
            let (level, lowest) = sums(&self.state.x, &self.state.v);
            Ledger { open: true, level, base: level, scale: level - lowest, lowest }
        };
        let through_contact = self.most_through_contact(end);
        let driven = through_contact > 0.0 || self.is_driven(end);
        // What starts nearer than its thickness is moved apart, against gravity where it has to be.
        let lifted = (-Vec3::from(self.scene.gravity()).dot(&pushed)).max(0.0);
        let done = work.pins.max(0.0) + work.air.max(0.0) + through_contact + lifted;
        let (level, base) = (ledger.level + done, ledger.base + done);
        let (made, opening) = (energy - level, self.opening());
        let lowest = ledger.lowest.min(gravity);
        let in_motion = ledger.scale.min((level - lowest).max(0.0));
        if made > ALLOWED * in_motion + opening {
            let runs_away = energy - base > in_motion + opening && !driven;
            if !accept || runs_away {
                return Err(Failure::Energy { made, level });
            }
            report.energy_made += made;
            note(report, entry);
            return Ok(Ledger { open: true, level: energy, base, scale: ledger.scale, lowest });
        }
        note(report, entry);
        // What was made is none of the motion's. What drives the cloth brings energy that is lost again: once it stands still,
        // only what there is then is left.
        let scale = if driven {
            moving
        } else if energy <= base {
            ledger.scale.max(moving)
        } else {
            ledger.scale
        };
        Ok(Ledger { open: true, level: level.min(energy), base: base.min(energy), scale, lowest })
    }

    /// The most that contact can have done to the cloth in a step: pushing along the way of the fastest collider or pin [J].
    fn most_through_contact(&self, end: &State) -> f64 {
        let cloth = self.bodies.cloth_vertices;
        let pins = self.pins.vertices.iter().map(|&v| v as usize);
        let way = (cloth..end.x.len())
            .chain(pins)
            .map(|i| (end.x[i] - self.state.x[i]).norm_squared())
            .fold(0.0, f64::max)
            .sqrt();
        let pushes = end.contact_force.iter().take(cloth).chain(&end.holds.force);
        if way > 0.0 { way * pushes.map(Vec3::norm).sum::<f64>() } else { 0.0 }
    }

    /// What opening surfaces that overlap by their thickness may lift the cloth [J].
    fn opening(&self) -> f64 {
        let mass: f64 = self.masses().iter().sum();
        let thickness = self.scene.contact.as_ref().map_or(0.0, |c| c.thickness);
        mass * Vec3::from(self.scene.gravity()).norm() * thickness
    }
}

/// Adds the work of a part of a step, and its energy at the end.
fn note(report: &mut StepReport, entry: EnergyReport) {
    let sum = report.energy.get_or_insert_default();
    *sum = EnergyReport { total: entry.total, pins: sum.pins + entry.pins, air: sum.air + entry.air };
}
