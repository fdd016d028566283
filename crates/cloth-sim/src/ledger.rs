//! The mechanical energy of cloth in contact: what it may be, and whether a step made more.
//!
//! Implicit dynamics lose energy, and so do friction and impact. But impulses move single vertices, which stiff cloth
//! answers in the next solve only: a large step can make elastic energy out of nothing. The ledger holds the least energy \[J\]
//! that the cloth has had since contact began, plus the most that moving colliders can have done since; a step that exceeds it by more
//! than half of the energy that has been in the motion fails like any other, and is tried with half the size. At
//! the floor, `time.max_halvings` halvings, it is accepted, and the report says how much was made. But where that is more than all the
//! energy that has been in the motion and colliders stand, the cloth stays where it is and loses its velocity: a board of a millimetre
//! that hits something with one corner would else be bent by more than it weighs, in every step.
//!
//! Nothing is looked at in scenes without contact, in steps in which nothing touches, while pins move, in wind, and under explicit integrators.

use crate::constraints::Holds;
use crate::step::{Failure, State, touches};
use crate::{Simulation, StepReport, Vec3};

/// Part of the energy that has been in the motion which a step may make: what ordinary steps of contact make stays below.
const ALLOWED: f64 = 0.5;

/// What repulsion may do in a step, as a multiple of what it does against gravity: layers that part are pushed unevenly.
const PUSHED: f64 = 4.0;

/// Energies that a step is judged by: a part of the state.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Ledger {
    /// Whether the numbers hold.
    pub(crate) open: bool,
    /// What the energy may be [J].
    pub(crate) level: f64,
    /// Most kinetic and elastic energy of good steps [J].
    pub(crate) scale: f64,
}

impl Simulation {
    /// Ends a step at `t1` \[s\] where it started, all cloth at rest.
    pub(crate) fn stand_still(&mut self, t1: f64) {
        let state = &mut self.state;
        state.time = t1;
        state.v.fill(Vec3::zeros());
        state.contact_force.fill(Vec3::zeros());
        state.holds = Holds::default();
    }

    /// The ledger after the step to `end`, in which repulsion pushed by `pushed` \[kg m\] ([`cloth_response::ResponseInfo::pushed`]).
    ///
    /// With `accept` a step that made energy passes, and the ledger starts anew from there; but for one that made too much.
    pub(crate) fn audit(
        &self,
        end: &State,
        pushed: Vec3,
        accept: bool,
        report: &mut StepReport,
    ) -> Result<Ledger, Failure> {
        let ledger = self.state.pace.ledger;
        if !self.audited || !touches(end) {
            return Ok(ledger);
        }
        // What sleeps has its own system.
        if self.sleeper.as_ref().is_some_and(|s| s.awake.is_some()) {
            return Ok(Ledger::default());
        }
        let start = &self.state.x;
        if self.pins.vertices.iter().any(|&v| end.x[v as usize] != start[v as usize]) {
            return Ok(Ledger::default());
        }
        let system = self.integrator.system();
        let sums = |x: &[Vec3], v: &[Vec3]| {
            let energy = system.energy(x, v);
            (energy.total(), energy.total() - energy.gravity)
        };
        let ledger = if ledger.open {
            ledger
        } else {
            let (level, scale) = sums(start, &self.state.v);
            Ledger { open: true, level, scale }
        };
        // Contact cannot do more than push along the fastest collider.
        let cloth = self.bodies.cloth_vertices;
        let way =
            (cloth..start.len()).map(|i| (end.x[i] - start[i]).norm_squared()).fold(0.0, f64::max).sqrt();
        let pushes = end.contact_force.iter().take(cloth).chain(&end.holds.force);
        let work = if way > 0.0 { way * pushes.map(Vec3::norm).sum::<f64>() } else { 0.0 };
        // What starts nearer than its thickness is moved apart, against gravity where it has to be, and bent on the way.
        let gravity = Vec3::from(self.scene.gravity());
        let level = ledger.level + work + PUSHED * (-gravity.dot(&pushed)).max(0.0);

        let (energy, moving) = sums(&end.x, &end.v);
        let mass: f64 = system.masses().iter().sum();
        let thickness = self.scene.contact.as_ref().map_or(0.0, |c| c.thickness);
        let opening = mass * gravity.norm() * thickness;
        let made = energy - level;
        if made > ALLOWED * ledger.scale + opening {
            let runs_away = made > ledger.scale + opening && way == 0.0;
            if !accept || runs_away {
                return Err(Failure::Energy { made, level });
            }
            report.energy_made += made;
            // What was made is none of the motion's.
            return Ok(Ledger { open: true, level: energy, scale: ledger.scale });
        }
        let scale = if made <= 0.0 { ledger.scale.max(moving) } else { ledger.scale };
        Ok(Ledger { open: true, level: level.min(energy), scale })
    }
}
