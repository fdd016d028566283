//! The whole simulation as bytes, and back to the same bits.
//!
//! Layout, little-endian: magic, version (u32), length of the payload (u64), payload, FNV-1a checksum of the payload (u64).
//! Payload: scene (JSON), options, state, what sleeps, what bending laws remember, sides of near pairs, pending steps, the
//! step under way, assets, report (JSON).

mod bytes;
mod continued;
mod named;

use crate::pace::Pending;
use crate::{Report, Scene, SimError, Simulation, SimulationOptions};
use bytes::{Kind, Reader, Room, Writer, invalid, open, seal};
use cloth_response::Sides;

pub use continued::Continued;

const CHECKPOINT: Kind = Kind { magic: *b"CLOTHSIM", version: 8, name: "a checkpoint" };

impl Simulation {
    /// Scene, assets, options, the full state and the report as bytes: [`Simulation::resume`] goes on to the same bits.
    ///
    /// The report of each step is in it, so it grows with the run: see [`Simulation::checkpoint_from`].
    pub fn checkpoint(&self) -> Vec<u8> {
        self.checkpoint_from(0)
    }

    /// [`Simulation::checkpoint`] without the reports of the steps before number `first` (from 0). Totals and effects have
    /// them all the same; a caller that has kept those reports has the whole.
    pub fn checkpoint_from(&self, first: usize) -> Vec<u8> {
        let mut payload = Writer::default();
        payload.text(&serde_json::to_string(&self.scene).unwrap_or_default());
        payload.u64(self.options.threads.map_or(0, |n| n as u64));
        payload.u64(u64::from(self.options.allow_intersections));
        payload.state(&self.state);
        payload.numbers(&self.memory());
        payload.sides(self.contact.as_ref().map_or(&[], |contact| contact.responder.sides().pairs()));
        let pending = self.pending.unwrap_or(Pending { steps: 0, dt: 0.0, end: 0.0 });
        payload.u64(pending.steps);
        payload.f64(pending.dt);
        payload.f64(pending.end);
        payload.u64(u64::from(self.under_way.is_some()));
        if let Some(way) = &self.under_way {
            payload.f64(way.start);
            payload.f64(way.end);
            payload.f64(way.dt);
            payload.u64(way.done);
            payload.text(&serde_json::to_string(&way.report).unwrap_or_default());
            payload.f64(way.wall_seconds);
        }
        payload.assets(&self.assets);
        payload.text(&serde_json::to_string(&self.report.without_steps_before(first)).unwrap_or_default());

        seal(&CHECKPOINT, &payload)
    }

    /// The simulation that a checkpoint holds. `threads` replaces the number of threads (results do not depend on it).
    ///
    /// # Errors
    /// [`SimError::InvalidCheckpoint`] for bytes that are no checkpoint, of another version, cut off or damaged.
    pub fn resume(bytes: &[u8], threads: Option<usize>) -> Result<Self, SimError> {
        Self::resume_on(bytes, SimulationOptions { threads, ..SimulationOptions::default() })
    }

    /// [`Simulation::resume`] on a device, which may be another one than before: results do not depend on it. Of the other options
    /// the checkpoint has its own, which hold where these say nothing.
    ///
    /// # Errors
    /// As [`Simulation::resume`], and as [`Simulation::new`] for the device.
    pub fn resume_on(bytes: &[u8], options: SimulationOptions) -> Result<Self, SimError> {
        let mut payload = Reader(open(bytes, &CHECKPOINT)?);
        let scene = Scene::from_json(&payload.text()?)?;
        let saved = payload.u64()? as usize;
        let options = SimulationOptions {
            threads: options.threads.or((saved > 0).then_some(saved)),
            allow_intersections: payload.u64()? != 0 || options.allow_intersections,
            ..options
        };
        let room = Room {
            // Before the scene's meshes are made.
            least: scene.generated_cloth(),
            max_halvings: scene.time.max_halvings,
            sleepers: if scene.effects.sleep.is_some() { scene.cloth.len() } else { 0 },
        };
        let state = payload.state(&room)?;
        let memory = payload.numbers()?;
        let sides = payload.sides()?;
        let pending = Pending { steps: payload.u64()?, dt: payload.f64()?, end: payload.f64()? };
        let under_way =
            if payload.u64()? == 0 { None } else { Some(payload.under_way(1 << room.max_halvings)?) };
        let assets = payload.assets()?;
        let report = payload.text()?;
        if !payload.0.is_empty() {
            return Err(invalid("the end of the payload", format!("{} more bytes", payload.0.len())));
        }
        let mut sim = Self::build(&scene, assets, options, Some(state))?;
        sim.under_way = under_way;
        sim.integrator
            .set_memory(&memory)
            .map_err(|e| invalid("what this scene's laws remember", e.to_string()))?;
        if let Some(contact) = &mut sim.contact {
            let sides =
                Sides::new(sides, &contact.mesh).map_err(|e| invalid("sides of pairs", e.to_string()))?;
            contact.responder.set_sides(sides);
        } else if !sides.is_empty() {
            return Err(invalid("no sides of pairs without contact", sides.len().to_string()));
        }
        sim.rebuild_awake()?;
        sim.pending = (pending.steps > 0).then_some(pending);
        let past: Report = serde_json::from_str(&report).map_err(|e| invalid("a report", e.to_string()))?;
        if Some(past.totals.steps) != past.left_out.checked_add(past.steps.len()).map(|n| n as u64) {
            let got = format!("{} left out and {} listed", past.left_out, past.steps.len());
            return Err(invalid(format!("a report of {} steps", past.totals.steps), got));
        }
        let here = std::mem::replace(&mut sim.report, past);
        (sim.report.threads, sim.report.detection) = (here.threads, here.detection);
        sim.report.fallbacks.extend(here.fallbacks);
        Ok(sim)
    }
}
