//! Fields as bytes, little-endian, and back: what is read is checked, and takes no more memory than there are bytes.
//!
//! A file is a magic, its version (u32), the length of the payload (u64), the payload, and the payload's checksum (u64).

use crate::auto_step::Control;
use crate::constraints::Holds;
use crate::ledger::Ledger;
use crate::pace::{Pace, UnderWay};
use crate::sleep::Rest;
use crate::step::State;
use crate::{Assets, Sequence, SimError, Vec3};
use cloth_collision::StencilKind;
use cloth_core::mesh::TriMesh;
use cloth_response::Side;
use std::collections::BTreeMap;

/// Largest number of a state: beyond, not even its energy need be a number.
const HUGE: f64 = 1e100;
const HEADER: usize = 8 + 4 + 8;

/// What a file is.
pub(super) struct Kind {
    pub(super) magic: [u8; 8],
    pub(super) version: u32,
    /// In words, with its article.
    pub(super) name: &'static str,
}

/// What a state may be.
pub(super) struct Room {
    /// Vertices at least.
    pub(super) least: usize,
    /// Most halvings of its step.
    pub(super) max_halvings: u32,
    /// Cloths that may sleep.
    pub(super) sleepers: usize,
}

pub(super) fn invalid(expected: impl Into<String>, got: impl Into<String>) -> SimError {
    SimError::InvalidCheckpoint { expected: expected.into(), got: got.into() }
}

/// A file with this payload.
pub(super) fn seal(kind: &Kind, payload: &Writer) -> Vec<u8> {
    let payload = &payload.0;
    let mut bytes = Vec::with_capacity(HEADER + payload.len() + 8);
    bytes.extend(kind.magic);
    bytes.extend(kind.version.to_le_bytes());
    bytes.extend((payload.len() as u64).to_le_bytes());
    bytes.extend(payload);
    bytes.extend(checksum(payload).to_le_bytes());
    bytes
}

/// The payload of a file whose header and checksum are right.
pub(super) fn open<'a>(bytes: &'a [u8], kind: &Kind) -> Result<&'a [u8], SimError> {
    if bytes.len() < HEADER || bytes[..kind.magic.len()] != kind.magic {
        let magic = String::from_utf8_lossy(&kind.magic);
        return Err(invalid(format!("{}, which starts with \"{magic}\"", kind.name), "another file"));
    }
    let mut header = Reader(&bytes[kind.magic.len()..]);
    let version = u32::from_le_bytes(header.array()?);
    if version != kind.version {
        return Err(invalid(
            format!("version {} of {}", kind.version, kind.name),
            format!("version {version}"),
        ));
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
pub(super) fn checksum(bytes: &[u8]) -> u64 {
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
pub(super) struct Writer(pub(super) Vec<u8>);

impl Writer {
    pub(super) fn u64(&mut self, value: u64) {
        self.0.extend(value.to_le_bytes());
    }

    pub(super) fn f64(&mut self, value: f64) {
        self.0.extend(value.to_le_bytes());
    }

    pub(super) fn text(&mut self, text: &str) {
        self.u64(text.len() as u64);
        self.0.extend(text.as_bytes());
    }

    pub(super) fn numbers(&mut self, numbers: &[f64]) {
        self.u64(numbers.len() as u64);
        for n in numbers {
            self.f64(*n);
        }
    }

    pub(super) fn points(&mut self, points: &[Vec3]) {
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

    fn flags(&mut self, flags: &[bool]) {
        self.numbers(&flags.iter().map(|flag| f64::from(u8::from(*flag))).collect::<Vec<_>>());
    }

    pub(super) fn state(&mut self, state: &State) {
        self.f64(state.time);
        self.u64(state.step);
        self.points(&state.x);
        self.points(&state.v);
        self.points(&state.contact_force);
        self.points(&state.holds.force);
        self.flags(&state.holds.sliding);
        self.u64(u64::from(state.pace.halvings));
        self.u64(u64::from(state.pace.good));
        self.f64(state.pace.control.size);
        self.f64(state.pace.control.error);
        let ledger = state.pace.ledger;
        self.u64(u64::from(ledger.open));
        self.f64(ledger.level);
        self.f64(ledger.base);
        self.f64(ledger.scale);
        self.f64(ledger.lowest);
        self.flags(&state.rest.asleep);
        self.numbers(&state.rest.calm);
    }

    pub(super) fn sides(&mut self, sides: &[Side]) {
        self.u64(sides.len() as u64);
        for Side { vertices, kind, positive, certain } in sides {
            let flags = [*kind == StencilKind::EdgeEdge, *positive, *certain];
            self.0.extend(vertices.iter().flat_map(|v| v.to_le_bytes()));
            self.0.extend(flags.map(u8::from));
        }
    }

    pub(super) fn assets(&mut self, assets: &Assets) {
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

pub(super) struct Reader<'a>(pub(super) &'a [u8]);

impl Reader<'_> {
    fn array<const N: usize>(&mut self) -> Result<[u8; N], SimError> {
        let (head, rest) = self.0.split_first_chunk().ok_or_else(|| invalid("more bytes", "the end"))?;
        self.0 = rest;
        Ok(*head)
    }

    pub(super) fn u64(&mut self) -> Result<u64, SimError> {
        Ok(u64::from_le_bytes(self.array()?))
    }

    /// A number as a step can have left it.
    pub(super) fn f64(&mut self) -> Result<f64, SimError> {
        let number = f64::from_le_bytes(self.array()?);
        if number.abs() <= HUGE {
            Ok(number)
        } else {
            Err(invalid(format!("finite numbers of at most {HUGE:e} in size"), number.to_string()))
        }
    }

    /// A count of elements of `size` bytes, which must still be there.
    pub(super) fn count(&mut self, size: usize) -> Result<usize, SimError> {
        let count = self.u64()?;
        if count > (self.0.len() / size) as u64 {
            return Err(invalid(
                format!("{count} elements of {size} bytes"),
                format!("{} bytes", self.0.len()),
            ));
        }
        Ok(count as usize)
    }

    pub(super) fn text(&mut self) -> Result<String, SimError> {
        let count = self.count(1)?;
        let (head, rest) = self.0.split_at(count);
        self.0 = rest;
        String::from_utf8(head.to_vec()).map_err(|e| invalid("text in UTF-8", e.to_string()))
    }

    pub(super) fn numbers(&mut self) -> Result<Vec<f64>, SimError> {
        let count = self.count(8)?;
        (0..count).map(|_| self.f64()).collect()
    }

    pub(super) fn points(&mut self) -> Result<Vec<Vec3>, SimError> {
        let count = self.count(24)?;
        (0..count).map(|_| Ok(Vec3::new(self.f64()?, self.f64()?, self.f64()?))).collect()
    }

    fn triangles(&mut self) -> Result<Vec<[u32; 3]>, SimError> {
        let count = self.count(12)?;
        let mut index = || Ok::<u32, SimError>(u32::from_le_bytes(self.array()?));
        (0..count).map(|_| Ok([index()?, index()?, index()?])).collect()
    }

    pub(super) fn sides(&mut self) -> Result<Vec<Side>, SimError> {
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

    /// What [`Writer::state`] wrote.
    pub(super) fn state(&mut self, room: &Room) -> Result<State, SimError> {
        let (time, step) = (self.f64()?, self.u64()?);
        if time < 0.0 {
            return Err(invalid("a time ≥ 0", time.to_string()));
        }
        let (x, v, contact_force) = (self.points()?, self.points()?, self.points()?);
        if !contact_force.is_empty() && contact_force.len() != x.len() {
            let got = format!("{} and {}", contact_force.len(), x.len());
            return Err(invalid("as many contact forces as positions", got));
        }
        let least = room.least;
        if x.len() < least {
            return Err(invalid(format!("positions of at least {least} vertices"), x.len().to_string()));
        }
        if x.len() != v.len() {
            return Err(invalid("as many velocities as positions", format!("{} and {}", v.len(), x.len())));
        }
        let (force, sliding) = (self.points()?, self.numbers()?);
        if !(force.is_empty() || force.len() <= x.len()) || sliding.len() != force.len() {
            let got = format!("{} and {}", force.len(), sliding.len());
            return Err(invalid("as many forces of constraints as cloth vertices, each with its state", got));
        }
        let sliding = sliding.into_iter().map(|s| s != 0.0).collect();
        let holds = Holds { force, sliding };
        let (halvings, good) = (self.u64()?, self.u64()?);
        let most = u64::from(room.max_halvings);
        if halvings > most || good > u64::from(u32::MAX) {
            return Err(invalid(format!("at most {most} halvings"), halvings.to_string()));
        }
        let control = Control { size: self.f64()?, error: self.f64()? };
        let ledger = Ledger {
            open: self.u64()? != 0,
            level: self.f64()?,
            base: self.f64()?,
            scale: self.f64()?,
            lowest: self.f64()?,
        };
        let pace = Pace { halvings: halvings as u32, good: good as u32, control, ledger };
        let rest =
            Rest { asleep: self.numbers()?.into_iter().map(|a| a != 0.0).collect(), calm: self.numbers()? };
        let sleepers = room.sleepers;
        if [rest.asleep.len(), rest.calm.len()] != [sleepers; 2] {
            let got = format!("{} and {}", rest.asleep.len(), rest.calm.len());
            return Err(invalid(format!("{sleepers} states of sleep, and times"), got));
        }
        Ok(State { time, step, x, v, contact_force, holds, pace, rest })
    }

    /// A step of which some of `whole` parts are done.
    pub(super) fn under_way(&mut self, whole: u64) -> Result<UnderWay, SimError> {
        let (start, end, dt, done) = (self.f64()?, self.f64()?, self.f64()?, self.u64()?);
        if !(1..whole).contains(&done) {
            return Err(invalid(format!("1 to {} parts of a step", whole - 1), done.to_string()));
        }
        let report = serde_json::from_str(&self.text()?)
            .map_err(|e| invalid("the report of a step", e.to_string()))?;
        Ok(UnderWay { start, end, dt, done, report, wall_seconds: self.f64()? })
    }

    pub(super) fn assets(&mut self) -> Result<Assets, SimError> {
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
