//! The mechanical energy of cloth in contact: what it may be, and whether a step made more.
//!
//! Implicit dynamics lose energy, and so do friction and impact. But impulses move single vertices, which stiff cloth
//! answers in the next solve only: a large step can make elastic energy out of nothing. The ledger holds the least energy \[J\]
//! that the cloth has had since contact began, plus the most that moving colliders can have done since; a step that exceeds it by more
//! than half of the energy that has been in the motion fails like any other, and is tried with half the size. After
//! [`MAX_HALVINGS`] halvings it is accepted, and the report says how much was made.
//!
//! Nothing is looked at in scenes without contact, in steps in which nothing touches, while pins move, in wind, and under explicit integrators.

use crate::step::{Failure, State, touches};
use crate::{Simulation, StepReport, Vec3};

/// Halvings of a step for its energy: the energy that a contact makes falls with the square of the step or faster.
pub(crate) const MAX_HALVINGS: u32 = 4;
/// Part of the energy that has been in the motion which a step may make: what ordinary steps of contact make stays below.
const ALLOWED: f64 = 0.5;
/// Repulsion moves overlapping surfaces apart by this part of the thickness in a step.
const REPULSION: f64 = 0.1;

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
    /// The ledger after the step of `dt` to `end`, part of a step of `whole` [s].
    ///
    /// With `accept` a step that made energy passes, and the ledger starts anew from there.
    pub(crate) fn audit(
        &self,
        end: &State,
        whole: f64,
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
        let level = ledger.level + work;

        let (energy, moving) = sums(&end.x, &end.v);
        let mass: f64 = system.masses().iter().sum();
        let thickness = self.scene.contact.as_ref().map_or(0.0, |c| c.thickness);
        let gravity = Vec3::from(self.scene.gravity()).norm();
        let opening = mass * (gravity * thickness + 0.5 * (REPULSION * thickness / whole).powi(2));
        let made = energy - level;
        if made > ALLOWED * ledger.scale + opening {
            if !accept {
                return Err(Failure::Energy { made, level });
            }
            report.energy_made += made;
            return Ok(Ledger { open: true, level: energy, scale: ledger.scale.max(moving) });
        }
        let scale = if made <= 0.0 { ledger.scale.max(moving) } else { ledger.scale };
        Ok(Ledger { open: true, level: level.min(energy), scale })
    }
}
