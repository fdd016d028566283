//! The state of a frame as bytes, and a simulation that goes on from it with the same scene or an edited one.
//!
//! A state has no meshes and no report: who goes on has the scene. Payload: scene (JSON), bodies, state, what bending laws remember
//! part by part, sides of near pairs. With the scene it was written under, the simulation goes on to the same bits. What an edit
//! leaves as it was goes on; what it touches begins anew, and [`Continued`] says so:
//!
//! - memory of bending, of each cloth whose law or parts are others;
//! - sides and forces of contact with each collider that is new, or stands elsewhere than in the state;
//! - the energy account, the controller of `time.dt = "auto"`, and sleep: all cloth wakes.
//!
//! Cloths keep their names, order and triangles.

use super::bytes::{Kind, Reader, Room, Writer, checksum, invalid, open, seal};
use super::named::{Named, covers, differences, named};
use crate::bodies::{Bodies, ClothBody};
use crate::ledger::Ledger;
use crate::pins::PinSet;
use crate::regions::Part;
use crate::scene::ContactMethod;
use crate::step::State;
use crate::{Assets, Scene, SimError, Simulation, SimulationOptions, Vec3};
use cloth_response::{Side, Sides};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ops::Range;

const STATE: Kind = Kind { magic: *b"CLOTHSTA", version: 3, name: "the state of a frame" };
/// Differences that are listed.
const LISTED: usize = 32;
/// A pin stands where the state has its vertex but for rounding up to this distance [m].
const ROUNDING: f64 = 1e-9;

/// How a simulation went on from a state.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Continued {
    /// Time of the state [s].
    pub time: f64,
    /// Keys of the scene that have another value than when the state was written (at most 32).
    pub edited: Vec<String>,
    /// What began anew, in words, beside the account of energy; with nothing edited, nothing.
    pub anew: Vec<String>,
}

struct Saved {
    scene: Scene,
    cloth: Vec<Named>,
    colliders: Vec<Named>,
    state: State,
    memories: Vec<(u64, Vec<f64>)>,
    sides: Vec<Side>,
}

impl Simulation {
    /// The full state without the scene's meshes and without the report, for [`Simulation::continue_from`]. A step that has been left
    /// in the middle counts as ended where it is.
    pub fn frame_state(&self) -> Vec<u8> {
        let mut payload = Writer::default();
        payload.text(&serde_json::to_string(&self.scene).unwrap_or_default());
        for list in named(&self.scene, &self.assets, &self.bodies) {
            payload.u64(list.len() as u64);
            for body in list {
                payload.text(&body.name);
                payload.u64(body.vertices as u64);
                payload.u64(body.topology);
                payload.u64(body.shape);
            }
        }
        payload.state(&self.state);
        let memories = self.memories();
        payload.u64(memories.len() as u64);
        for (key, numbers) in self.memory_keys().into_iter().zip(&memories) {
            payload.u64(key);
            payload.numbers(numbers);
        }
        payload.sides(self.contact.as_ref().map_or(&[], |contact| contact.responder.sides().pairs()));
        seal(&STATE, &payload)
    }

    /// `scene` from a state on that [`Simulation::frame_state`] wrote, under it or another scene with the same cloths.
    ///
    /// Colliders are where `scene` has them at that time, and pinned vertices too: where the state has them elsewhere, they are placed
    /// there, at rest. `report().continued` says what was edited and what began anew.
    ///
    /// # Errors
    /// [`SimError::InvalidCheckpoint`] for bytes that are no state, of another version, cut off or damaged;
    /// [`SimError::InvalidScene`] naming the cloth that is another one; [`SimError::StartIntersections`] where an edit puts triangles
    /// through each other; else as [`Simulation::new`].
    pub fn continue_from(
        bytes: &[u8],
        scene: &Scene,
        assets: Assets,
        options: SimulationOptions,
    ) -> Result<Self, SimError> {
        let saved = Saved::read(bytes)?;
        scene.check()?;
        let bodies = Bodies::new(scene, &assets)?;
        let now = named(scene, &assets, &bodies);
        saved.check_cloth(scene, &now[0])?;
        let mut continued =
            Continued { time: saved.state.time, edited: saved.edits(scene, &now), anew: Vec::new() };
        let kept = saved.kept_colliders(&bodies, &now[1]);
        for (body, kept) in now[1].iter().zip(&kept) {
            if kept.is_none() {
                continued.anew.push(format!("contact with \"{}\"", body.name));
            }
        }
        let same =
            continued.edited.is_empty() && kept.len() == saved.colliders.len() && continued.anew.is_empty();
        let mut state = saved.state_in(scene, &bodies, &kept, same);
        if !same {
            place_pins(scene, &bodies, &mut state, &mut continued)?;
            if saved.state.rest.asleep.contains(&true) {
                continued.anew.push("sleep: all cloth is awake".into());
            }
        }
        let mut sim = Self::build(scene, assets, options, Some(state))?;
        sim.take_memories(&saved, &mut continued)?;
        if let Some(contact) = &mut sim.contact {
            let sides = Sides::new(saved.sides_in(&bodies, &kept), &contact.mesh)
                .map_err(|e| invalid("sides of pairs", e.to_string()))?;
            contact.responder.set_sides(sides);
        }
        sim.rebuild_awake()?;
        sim.report.continued = Some(continued);
        if !same {
            sim.check_start()?;
        }
        Ok(sim)
    }

    /// Start positions of the cloth as the scene places it \[m\], before pins.
    pub fn start_positions(&self) -> Vec<Vec3> {
        self.bodies.cloth.iter().flat_map(|body| body.x.iter().copied()).collect()
    }

    /// Puts back what bending laws remember, of each part that is as it was.
    fn take_memories(&mut self, saved: &Saved, continued: &mut Continued) -> Result<(), SimError> {
        let mut memories = self.memories();
        let mut left: BTreeMap<u64, &Vec<f64>> =
            saved.memories.iter().map(|(key, list)| (*key, list)).collect();
        for (key, memory) in self.memory_keys().into_iter().zip(&mut memories) {
            if let Some(list) = left.remove(&key) {
                memory.clone_from(list);
            }
        }
        if !left.is_empty() {
            continued.anew.push("what bending remembers, of cloth with another bending law".into());
        }
        self.integrator
            .set_memory(&memories.concat())
            .map_err(|e| invalid("what this scene's laws remember", e.to_string()))
    }

    /// Of each part whose law remembers: a checksum of its hinges and of the laws of its cloth.
    fn memory_keys(&self) -> Vec<u64> {
        let of = |(vertices, sparse): (&[u32], bool)| {
            let mut bytes: Vec<u8> = vertices.iter().flat_map(|v| v.to_le_bytes()).collect();
            bytes.push(u8::from(sparse));
            let cloth = vertices
                .first()
                .and_then(|v| self.bodies.cloth.iter().find(|body| range_of(body).contains(&(*v as usize))));
            if let Some(body) = cloth {
                bytes.extend(format!("{:?}", body.material.bending).bytes());
                for Part { material, triangles, .. } in &body.parts {
                    bytes.extend(format!("{:?} {triangles:?}", material.bending).bytes());
                }
            }
            checksum(&bytes)
        };
        self.integrator.system().rememberers().into_iter().map(of).collect()
    }
}

impl Saved {
    fn read(bytes: &[u8]) -> Result<Self, SimError> {
        let mut payload = Reader(open(bytes, &STATE)?);
        let scene =
            Scene::from_json(&payload.text()?).map_err(|e| invalid("the scene of a state", e.to_string()))?;
        let mut bodies = || {
            let count = payload.count(32)?;
            let mut body = || {
                let (name, vertices) = (payload.text()?, payload.u64()? as usize);
                Ok(Named { name, vertices, topology: payload.u64()?, shape: payload.u64()?, source: "" })
            };
            (0..count).map(|_| body()).collect::<Result<Vec<_>, SimError>>()
        };
        let (cloth, colliders) = (bodies()?, bodies()?);
        let room = Room {
            least: 0,
            max_halvings: scene.time.max_halvings,
            sleepers: if scene.effects.sleep.is_some() { cloth.len() } else { 0 },
        };
        let state = payload.state(&room)?;
        let vertices = (cloth.iter().chain(&colliders))
            .try_fold(0_usize, |sum, body| sum.checked_add(body.vertices))
            .unwrap_or(usize::MAX);
        if vertices != state.x.len() {
            return Err(invalid(format!("positions of {vertices} vertices"), state.x.len().to_string()));
        }
        let count = payload.count(16)?;
        let memories =
            (0..count).map(|_| Ok((payload.u64()?, payload.numbers()?))).collect::<Result<_, SimError>>()?;
        let sides = payload.sides()?;
        if !payload.0.is_empty() {
            return Err(invalid("the end of the payload", format!("{} more bytes", payload.0.len())));
        }
        if let Some(side) = sides.iter().find(|s| s.vertices.iter().any(|v| *v as usize >= vertices)) {
            return Err(invalid(format!("vertices below {vertices}"), format!("{:?}", side.vertices)));
        }
        Ok(Self { scene, cloth, colliders, state, memories, sides })
    }

    /// Refuses a scene whose cloths are not those of the state.
    fn check_cloth(&self, scene: &Scene, now: &[Named]) -> Result<(), SimError> {
        let error = |key: String, expected: String, got: String| {
            Err(SimError::InvalidScene(scene.error(&key, expected, got)))
        };
        if now.len() != self.cloth.len() {
            let names: Vec<_> = self.cloth.iter().map(|body| format!("\"{}\"", body.name)).collect();
            let expected = format!("the cloths of the state: {}", names.join(", "));
            return error("cloth".into(), expected, format!("{} cloths", now.len()));
        }
        for (i, (was, is)) in self.cloth.iter().zip(now).enumerate() {
            if was.name != is.name {
                let expected = format!("\"{}\", cloth number {i} of the state", was.name);
                return error(format!("cloth[{i}].name"), expected, format!("\"{}\"", is.name));
            }
            if was.vertices != is.vertices {
                let expected = format!("the {} vertices that \"{}\" has in the state", was.vertices, is.name);
                return error(format!("cloth[{i}].mesh"), expected, is.vertices.to_string());
            }
            if was.topology != is.topology {
                let expected = format!("the triangles that \"{}\" has in the state", is.name);
                return error(format!("cloth[{i}].mesh"), expected, "other triangles".into());
            }
        }
        Ok(())
    }

    /// Keys of what is other in `scene`, and of meshes and animations that have other vertices under the same name.
    fn edits(&self, scene: &Scene, now: &[Vec<Named>; 2]) -> Vec<String> {
        let mut edited = Vec::new();
        let [was, is] = [&self.scene, scene].map(|s| serde_json::to_value(s).unwrap_or_default());
        differences("", &was, &is, &mut edited);
        for (table, was, is) in [("cloth", &self.cloth, &now[0]), ("collider", &self.colliders, &now[1])] {
            for (i, is) in is.iter().enumerate() {
                let other = |was: &Named| was.name == is.name && was.shape != is.shape;
                let key = format!("{table}[{i}].{}", is.source);
                if was.iter().any(other) && !edited.iter().any(|listed| covers(listed, &key)) {
                    edited.push(key);
                }
            }
        }
        edited.truncate(LISTED);
        edited
    }

    /// Of each collider: its vertices in the state, if it is the same and stands where the state has it.
    fn kept_colliders(&self, bodies: &Bodies, now: &[Named]) -> Vec<Option<Range<usize>>> {
        let mut first = self.cloth.iter().map(|body| body.vertices).sum::<usize>();
        let mut known = BTreeMap::new();
        for body in &self.colliders {
            known.insert(body.name.as_str(), (body, first..first + body.vertices));
            first += body.vertices;
        }
        let place = State::start_at(bodies, self.state.time).x;
        (bodies.colliders.iter().zip(now))
            .map(|(body, is)| {
                let (was, range) = known.get(is.name.as_str())?;
                let here = body.first_vertex..body.first_vertex + is.vertices;
                let same = was.vertices == is.vertices && was.topology == is.topology;
                (same && self.state.x[range.clone()] == place[here]).then(|| range.clone())
            })
            .collect()
    }

    /// The state over the vertices of a scene; `same`: it is the scene of the state.
    fn state_in(&self, scene: &Scene, bodies: &Bodies, kept: &[Option<Range<usize>>], same: bool) -> State {
        let saved = &self.state;
        let mut state = State::start_at(bodies, saved.time);
        state.step = saved.step;
        let cloth = 0..bodies.cloth_vertices;
        let places = std::iter::once((cloth.clone(), cloth)).chain(
            (bodies.colliders.iter().zip(kept))
                .filter_map(|(body, kept)| kept.clone().map(|from| (from, body.first_vertex)))
                .map(|(from, to)| (from.clone(), to..to + from.len())),
        );
        let touched = scene.contact.is_some() || scene.cloth.iter().any(|c| c.strain_limit.is_some());
        if touched && !saved.contact_force.is_empty() {
            state.contact_force = vec![Vec3::zeros(); bodies.vertices];
        }
        for (from, to) in places {
            state.x[to.clone()].copy_from_slice(&saved.x[from.clone()]);
            state.v[to.clone()].copy_from_slice(&saved.v[from.clone()]);
            if !state.contact_force.is_empty() {
                state.contact_force[to].copy_from_slice(&saved.contact_force[from]);
            }
        }
        let constrained = scene.contact.as_ref().is_some_and(|c| c.method == ContactMethod::Constraints);
        if constrained && (same || saved.holds.force.len() == bodies.cloth_vertices) {
            state.holds = saved.holds.clone();
        }
        state.pace = saved.pace;
        state.pace.halvings = state.pace.halvings.min(scene.time.max_halvings);
        if same {
            state.rest = saved.rest.clone();
            return state;
        }
        state.pace.ledger = Ledger::default();
        if scene.time.fixed() != self.scene.time.fixed() {
            state.pace.control = crate::auto_step::Control::default();
        }
        state
    }

    /// Sides of pairs of cloth, and of cloth with the colliders that are kept, over the vertices of a scene.
    fn sides_in(&self, bodies: &Bodies, kept: &[Option<Range<usize>>]) -> Vec<Side> {
        let cloth = bodies.cloth_vertices as u32;
        let moved = |v: u32| -> Option<u32> {
            if v < cloth {
                return Some(v);
            }
            let mut colliders = bodies.colliders.iter().zip(kept).filter_map(|(b, k)| Some((b, k.as_ref()?)));
            let (body, from) = colliders.find(|(_, from)| from.contains(&(v as usize)))?;
            Some((v as usize - from.start + body.first_vertex) as u32)
        };
        let mut list: Vec<Side> = (self.sides.iter())
            .filter_map(|side| {
                let [a, b, c, d] = side.vertices;
                Some(Side { vertices: [moved(a)?, moved(b)?, moved(c)?, moved(d)?], ..*side })
            })
            .collect();
        list.sort_by_key(|side| (side.kind, side.vertices));
        list
    }
}

/// Puts pinned vertices where the scene has them, where the state has them elsewhere.
fn place_pins(
    scene: &Scene,
    bodies: &Bodies,
    state: &mut State,
    continued: &mut Continued,
) -> Result<(), SimError> {
    let pins = PinSet::new(scene, bodies, &State::start(bodies).x)?;
    let mut targets = vec![Vec3::zeros(); pins.vertices.len()];
    pins.write(bodies, state.time, &state.x, &mut targets);
    let (mut farthest, mut count) = (0.0_f64, 0);
    for (&v, target) in pins.vertices.iter().zip(targets) {
        let way = (target - state.x[v as usize]).norm();
        if way > ROUNDING {
            (state.x[v as usize], state.v[v as usize]) = (target, Vec3::zeros());
            (farthest, count) = (farthest.max(way), count + 1);
        }
    }
    if count > 0 {
        let text = format!("{count} pinned vertices, placed up to {farthest:.3e} m from where they were");
        continued.anew.push(text);
    }
    Ok(())
}

fn range_of(body: &ClothBody) -> Range<usize> {
    body.first_vertex..body.first_vertex + body.x.len()
}
