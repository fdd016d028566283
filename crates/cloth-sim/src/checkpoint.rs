//! The whole simulation as bytes, and back to the same bits.
//!
//! Layout, little-endian: magic, version (u32), length of the payload (u64), payload, FNV-1a checksum of the payload (u64).
//! Payload: scene (JSON), options, state, what sleeps, what bending laws remember, sides of near pairs, pending steps, the
//! step under way, assets, report (JSON).

use crate::auto_step::Control;
use crate::constraints::Holds;
use crate::ledger::Ledger;
use crate::pace::{Pace, Pending, UnderWay};
use crate::sleep::Rest;
use crate::step::State;
use crate::{Assets, Report, Scene, Sequence, SimError, Simulation, SimulationOptions, Vec3};
use cloth_collision::StencilKind;
use cloth_core::mesh::TriMesh;
use cloth_response::{Side, Sides};
use std::collections::BTreeMap;

const MAGIC: [u8; 8] = *b"CLOTHSIM";
const VERSION: u32 = 7;
/// Largest number of a state: beyond, not even its energy need be a number.
const HUGE: f64 = 1e100;
const HEADER: usize = MAGIC.len() + 4 + 8;

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
        payload.f64(self.state.time);
        payload.u64(self.state.step);
        payload.points(&self.state.x);
        payload.points(&self.state.v);
        payload.points(&self.state.contact_force);
        payload.points(&self.state.holds.force);
        payload
            .numbers(&self.state.holds.sliding.iter().map(|s| f64::from(u8::from(*s))).collect::<Vec<_>>());
        payload.u64(u64::from(self.state.pace.halvings));
        payload.u64(u64::from(self.state.pace.good));
        payload.f64(self.state.pace.control.size);
        payload.f64(self.state.pace.control.error);
        let ledger = self.state.pace.ledger;
        payload.u64(u64::from(ledger.open));
        payload.f64(ledger.level);
        payload.f64(ledger.base);
        payload.f64(ledger.scale);
        payload.numbers(&self.state.rest.asleep.iter().map(|a| f64::from(u8::from(*a))).collect::<Vec<_>>());
        payload.numbers(&self.state.rest.calm);
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

        let payload = payload.0;
        let mut bytes = Vec::with_capacity(HEADER + payload.len() + 8);
        bytes.extend(MAGIC);
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend((payload.len() as u64).to_le_bytes());
        bytes.extend(&payload);
        bytes.extend(checksum(&payload).to_le_bytes());
        bytes
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
        let mut payload = Reader(open(bytes)?);
        let scene = Scene::from_json(&payload.text()?)?;
        let saved = payload.u64()? as usize;
        let options = SimulationOptions {
            threads: options.threads.or((saved > 0).then_some(saved)),
            allow_intersections: payload.u64()? != 0 || options.allow_intersections,
            ..options
        };
        let (time, step) = (payload.f64()?, payload.u64()?);
        if time < 0.0 {
            return Err(invalid("a time ≥ 0", time.to_string()));
        }
        let (x, v, contact_force) = (payload.points()?, payload.points()?, payload.points()?);
        if !contact_force.is_empty() && contact_force.len() != x.len() {
            let got = format!("{} and {}", contact_force.len(), x.len());
            return Err(invalid("as many contact forces as positions", got));
        }
        // Before the scene's meshes are made.
        let least = scene.generated_cloth();
        if x.len() < least {
            return Err(invalid(format!("positions of at least {least} vertices"), x.len().to_string()));
        }
        if x.len() != v.len() {
            return Err(invalid("as many velocities as positions", format!("{} and {}", v.len(), x.len())));
        }
        let (force, sliding) = (payload.points()?, payload.numbers()?);
        if !(force.is_empty() || force.len() <= x.len()) || sliding.len() != force.len() {
            let got = format!("{} and {}", force.len(), sliding.len());
            return Err(invalid("as many forces of constraints as cloth vertices, each with its state", got));
        }
        let sliding = sliding.into_iter().map(|s| s != 0.0).collect();
        let holds = Holds { force, sliding };
        let (halvings, good) = (payload.u64()?, payload.u64()?);
        let most = u64::from(scene.time.max_halvings);
        if halvings > most || good > u64::from(u32::MAX) {
            return Err(invalid(format!("at most {most} halvings"), halvings.to_string()));
        }
        let control = Control { size: payload.f64()?, error: payload.f64()? };
        let ledger = Ledger {
            open: payload.u64()? != 0,
            level: payload.f64()?,
            base: payload.f64()?,
            scale: payload.f64()?,
        };
        let pace = Pace { halvings: halvings as u32, good: good as u32, control, ledger };
        let rest = Rest {
            asleep: payload.numbers()?.into_iter().map(|a| a != 0.0).collect(),
            calm: payload.numbers()?,
        };
        let sleepers = if scene.effects.sleep.is_some() { scene.cloth.len() } else { 0 };
        if [rest.asleep.len(), rest.calm.len()] != [sleepers; 2] {
            let got = format!("{} and {}", rest.asleep.len(), rest.calm.len());
            return Err(invalid(format!("{sleepers} states of sleep, and times"), got));
        }
        let memory = payload.numbers()?;
        let sides = payload.sides()?;
        let pending = Pending { steps: payload.u64()?, dt: payload.f64()?, end: payload.f64()? };
        let under_way = if payload.u64()? == 0 { None } else { Some(payload.under_way(1 << most)?) };
        let assets = payload.assets()?;
        let report = payload.text()?;
        if !payload.0.is_empty() {
            return Err(invalid("the end of the payload", format!("{} more bytes", payload.0.len())));
        }
        let state = State { time, step, x, v, contact_force, holds, pace, rest };
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

fn invalid(expected: impl Into<String>, got: impl Into<String>) -> SimError {
    SimError::InvalidCheckpoint { expected: expected.into(), got: got.into() }
}

/// The payload of a checkpoint whose header and checksum are right.
fn open(bytes: &[u8]) -> Result<&[u8], SimError> {
    if bytes.len() < HEADER || bytes[..MAGIC.len()] != MAGIC {
        return Err(invalid("a file that starts with \"CLOTHSIM\"", "another file"));
    }
    let mut header = Reader(&bytes[MAGIC.len()..]);
    let version = u32::from_le_bytes(header.array()?);
    if version != VERSION {
        return Err(invalid(format!("version {VERSION}"), format!("version {version}")));
    }
    let length = header.u64()?;
    let rest = header.0;
    if rest.len() as u64 != length.saturating_add(8) {
        let expected = format!("{} bytes after the header", length.saturating_add(8));
        return Err(invalid(expected, format!("{} (the file is cut off or has a tail)", rest.len())));
    }
    let (payload, mut sum) = (&rest[..length as usize], Reader(&rest[length as usize..]));
    let expected = sum.u64()?;
    let got = checksum(payload);
    if got != expected {
        return Err(invalid(format!("the checksum {expected:016x}"), format!("{got:016x} (damaged)")));
    }
    Ok(payload)
}

/// FNV-1a over 64-bit words, the last one filled up with zeros.
fn checksum(bytes: &[u8]) -> u64 {
    const OFFSET: u64 = 0xcbf2_9ce4_8422_2325;
    const PRIME: u64 = 0x0100_0000_01b3;
    let fold = |hash: u64, word: u64| (hash ^ word).wrapping_mul(PRIME);
    let (words, tail) = bytes.as_chunks::<8>();
    let hash = words.iter().fold(OFFSET, |hash, word| fold(hash, u64::from_le_bytes(*word)));
    let mut last = [0; 8];
    last[..tail.len()].copy_from_slice(tail);
    fold(fold(hash, u64::from_le_bytes(last)), bytes.len() as u64)
}

#[derive(Default)]
struct Writer(Vec<u8>);

impl Writer {
    fn u64(&mut self, value: u64) {
        self.0.extend(value.to_le_bytes());
    }

    fn f64(&mut self, value: f64) {
        self.0.extend(value.to_le_bytes());
    }

    fn text(&mut self, text: &str) {
        self.u64(text.len() as u64);
        self.0.extend(text.as_bytes());
    }

    fn numbers(&mut self, numbers: &[f64]) {
        self.u64(numbers.len() as u64);
        for n in numbers {
            self.f64(*n);
        }
    }

    fn points(&mut self, points: &[Vec3]) {
        self.u64(points.len() as u64);
        for p in points {
            for c in p.iter() {
                self.f64(*c);
            }
        }
    }

    fn triangles(&mut self, triangles: &[[u32; 3]]) {
        self.u64(triangles.len() as u64);
        for v in triangles.iter().flatten() {
            self.0.extend(v.to_le_bytes());
        }
    }

    fn sides(&mut self, sides: &[Side]) {
        self.u64(sides.len() as u64);
        for Side { vertices, kind, positive, certain } in sides {
            let flags = [*kind == StencilKind::EdgeEdge, *positive, *certain];
            self.0.extend(vertices.iter().flat_map(|v| v.to_le_bytes()));
            self.0.extend(flags.map(u8::from));
        }
    }

    fn assets(&mut self, assets: &Assets) {
        self.u64(assets.meshes.len() as u64);
        for (name, mesh) in &assets.meshes {
            self.text(name);
            self.points(&mesh.vertices);
            self.triangles(&mesh.triangles);
            self.u64(mesh.uv.as_ref().map_or(0, |uv| 1 + uv.len() as u64));
            for c in mesh.uv.iter().flatten().flatten().flatten() {
                self.f64(*c);
            }
        }
        self.u64(assets.sequences.len() as u64);
        for (name, sequence) in &assets.sequences {
            self.text(name);
            self.triangles(&sequence.triangles);
            self.f64(sequence.fps.unwrap_or(0.0));
            self.u64(sequence.frames.len() as u64);
            for frame in &sequence.frames {
                self.points(frame);
            }
        }
        self.u64(assets.groups.len() as u64);
        for (name, groups) in &assets.groups {
            self.text(name);
            self.u64(groups.len() as u64);
            for (group, triangles) in groups {
                self.text(group);
                self.u64(triangles.len() as u64);
                for t in triangles {
                    self.0.extend(t.to_le_bytes());
                }
            }
        }
        self.u64(assets.velocities.len() as u64);
        for (name, velocities) in &assets.velocities {
            self.text(name);
            self.points(velocities);
        }
    }
}

struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn array<const N: usize>(&mut self) -> Result<[u8; N], SimError> {
        let (head, rest) = self.0.split_first_chunk().ok_or_else(|| invalid("more bytes", "the end"))?;
        self.0 = rest;
        Ok(*head)
    }

    fn u64(&mut self) -> Result<u64, SimError> {
        Ok(u64::from_le_bytes(self.array()?))
    }

    /// A number as a step can have left it.
    fn f64(&mut self) -> Result<f64, SimError> {
        let number = f64::from_le_bytes(self.array()?);
        if number.abs() <= HUGE {
            Ok(number)
        } else {
            Err(invalid(format!("finite numbers of at most {HUGE:e} in size"), number.to_string()))
        }
    }

    /// A count of elements of `size` bytes, which must still be there.
    fn count(&mut self, size: usize) -> Result<usize, SimError> {
        let count = self.u64()?;
        if count > (self.0.len() / size) as u64 {
            return Err(invalid(
                format!("{count} elements of {size} bytes"),
                format!("{} bytes", self.0.len()),
            ));
        }
        Ok(count as usize)
    }

    fn text(&mut self) -> Result<String, SimError> {
        let count = self.count(1)?;
        let (head, rest) = self.0.split_at(count);
        self.0 = rest;
        String::from_utf8(head.to_vec()).map_err(|e| invalid("text in UTF-8", e.to_string()))
    }

    fn numbers(&mut self) -> Result<Vec<f64>, SimError> {
        let count = self.count(8)?;
        (0..count).map(|_| self.f64()).collect()
    }

    fn points(&mut self) -> Result<Vec<Vec3>, SimError> {
        let count = self.count(24)?;
        (0..count).map(|_| Ok(Vec3::new(self.f64()?, self.f64()?, self.f64()?))).collect()
    }

    fn triangles(&mut self) -> Result<Vec<[u32; 3]>, SimError> {
        let count = self.count(12)?;
        let mut index = || Ok::<u32, SimError>(u32::from_le_bytes(self.array()?));
        (0..count).map(|_| Ok([index()?, index()?, index()?])).collect()
    }

    fn sides(&mut self) -> Result<Vec<Side>, SimError> {
        let count = self.count(19)?;
        let mut side = || {
            let mut index = || Ok::<u32, SimError>(u32::from_le_bytes(self.array()?));
            let vertices = [index()?, index()?, index()?, index()?];
            let [is_edges, positive, certain] = self.array()?.map(|flag: u8| flag != 0);
            let kind = if is_edges { StencilKind::EdgeEdge } else { StencilKind::VertexTriangle };
            Ok(Side { vertices, kind, positive, certain })
        };
        (0..count).map(|_| side()).collect()
    }

    fn map<T>(
        &mut self,
        read: impl Fn(&mut Self) -> Result<T, SimError>,
    ) -> Result<BTreeMap<String, T>, SimError> {
        let count = self.count(1)?;
        (0..count).map(|_| Ok((self.text()?, read(self)?))).collect()
    }

    /// A step of which some of `whole` parts are done.
    fn under_way(&mut self, whole: u64) -> Result<UnderWay, SimError> {
        let (start, end, dt, done) = (self.f64()?, self.f64()?, self.f64()?, self.u64()?);
        if !(1..whole).contains(&done) {
            return Err(invalid(format!("1 to {} parts of a step", whole - 1), done.to_string()));
        }
        let report = serde_json::from_str(&self.text()?)
            .map_err(|e| invalid("the report of a step", e.to_string()))?;
        Ok(UnderWay { start, end, dt, done, report, wall_seconds: self.f64()? })
    }

    fn assets(&mut self) -> Result<Assets, SimError> {
        let meshes = self.map(|r| {
            let (vertices, triangles) = (r.points()?, r.triangles()?);
            let uv = match r.count(1)? {
                0 => None,
                n => {
                    let mut pair = || Ok::<_, SimError>([r.f64()?, r.f64()?]);
                    Some((1..n).map(|_| Ok([pair()?, pair()?, pair()?])).collect::<Result<_, SimError>>()?)
                }
            };
            Ok(TriMesh { vertices, triangles, uv })
        })?;
        let sequences = self.map(|r| {
            let triangles = r.triangles()?;
            let fps = Some(r.f64()?).filter(|fps| *fps > 0.0);
            let count = r.count(8)?;
            let frames = (0..count).map(|_| r.points()).collect::<Result<_, _>>()?;
            Ok(Sequence { triangles, frames, fps })
        })?;
        let groups = self.map(|r| {
            r.map(|r| {
                let count = r.count(4)?;
                (0..count).map(|_| Ok(u32::from_le_bytes(r.array()?))).collect()
            })
        })?;
        let velocities = self.map(Reader::points)?;
        Ok(Assets { meshes, sequences, groups, velocities })
    }
}
