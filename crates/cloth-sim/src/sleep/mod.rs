//! Cloth that has come to rest: put to sleep, left out of the step, and woken.
//!
//! A piece of cloth sleeps once it and all cloth that it touches, directly or through others, have been slower than a threshold for
//! some time, and nothing that moves by itself touches them. Asleep it has no velocity, infinite mass and no place in the dynamics,
//! which are those of the awake cloth alone. What moves and comes within the band of contact, or a pin of its own that moves, wakes
//! it before the step is accepted: the step is done again with it awake. What it touches then wakes the same way.

mod awake;

use crate::step::{Failure, State};
use crate::{SimError, Simulation, StepReport, Vec3};
use awake::Awake;
use std::ops::Range;

/// A pin or collider whose step is shorter than this fraction of the threshold's way stands still.
const STILL: f64 = 1e-3;

/// What of the state concerns sleep; empty where nothing may sleep.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Rest {
    /// Per cloth.
    pub(crate) asleep: Vec<bool>,
    /// How long each cloth has been slow [s].
    pub(crate) calm: Vec<f64>,
}

impl Rest {
    /// All awake.
    pub(crate) fn awake(cloths: usize) -> Self {
        Self { asleep: vec![false; cloths], calm: vec![0.0; cloths] }
    }

    pub(crate) fn sleepers(&self) -> usize {
        self.asleep.iter().filter(|a| **a).count()
    }
}

/// What sleeping takes beside the state.
pub(crate) struct Sleeper {
    speed: f64,
    time: f64,
    /// Vertices of each cloth.
    cloths: Vec<Range<usize>>,
    /// Per vertex of all bodies: of sleeping cloth; may move in the step under way.
    pub(crate) asleep: Vec<bool>,
    pub(crate) moving: Vec<bool>,
    /// Bodies that were near each other in the last attempt.
    pub(crate) meetings: Vec<[u32; 2]>,
    /// Dynamics of the awake cloth while some sleeps.
    pub(crate) awake: Option<Awake>,
}

impl Sleeper {
    /// For a scene that lets cloth sleep.
    pub(crate) fn new(sim: &Simulation) -> Option<Self> {
        let sleep = sim.scene.effects.sleep?;
        let range = |b: &crate::bodies::ClothBody| b.first_vertex..b.first_vertex + b.x.len();
        Some(Self {
            speed: sleep.speed,
            time: sleep.time,
            cloths: sim.bodies.cloth.iter().map(range).collect(),
            asleep: vec![false; sim.bodies.vertices],
            moving: vec![true; sim.bodies.vertices],
            meetings: Vec::new(),
            awake: None,
        })
    }

    /// Memory [B].
    pub(crate) fn bytes(&self) -> usize {
        self.asleep.len() + self.moving.len() + self.awake.as_ref().map_or(0, Awake::bytes)
    }
}

impl Simulation {
    /// Names of the cloths that sleep.
    pub fn asleep(&self) -> Vec<&str> {
        let list = self.scene.cloth.iter().zip(&self.state.rest.asleep);
        list.filter(|(_, asleep)| **asleep).map(|(cloth, _)| cloth.name.as_str()).collect()
    }

    /// Whether nothing moves until `end` [s]: all cloth sleeps, and pins and colliders stand still.
    pub(crate) fn all_rests(&self, end: f64) -> bool {
        let Some(sleeper) = &self.sleeper else { return false };
        let cloths = self.state.rest.asleep.len();
        if cloths == 0 || self.state.rest.sleepers() < cloths {
            return false;
        }
        let way = STILL * sleeper.speed * (end - self.state.time);
        let mut x: Option<Vec<Vec3>> = None;
        for body in self.bodies.colliders.iter().filter(|body| body.motion.moves()) {
            let range = body.first_vertex..body.first_vertex + body.motion.vertex_count();
            let x = x.get_or_insert_with(|| self.state.x.clone());
            body.motion.write(end, &mut x[range.clone()]);
            if range.into_iter().any(|i| x[i] != self.state.x[i]) {
                return false;
            }
        }
        if self.pins.vertices.is_empty() {
            return true;
        }
        let mut targets = vec![Vec3::zeros(); self.pins.vertices.len()];
        self.pins.write(&self.bodies, end, x.as_deref().unwrap_or(&self.state.x), &mut targets);
        let still = |(v, target): (&u32, &Vec3)| (target - self.state.x[*v as usize]).norm() <= way;
        self.pins.vertices.iter().zip(&targets).all(still)
    }

    /// A step in which nothing moves.
    pub(crate) fn sleep_through(&mut self, end: f64, report: &mut StepReport) {
        self.state.time = end;
        report.substeps = 1;
    }

    /// Marks what moves in an attempt, from where pins and colliders go; pins that move wake their cloth.
    pub(crate) fn mark_moving(&mut self, dt: f64, x: &[Vec3], pin_x: &[Vec3]) -> Result<(), Failure> {
        let Some(sleeper) = &mut self.sleeper else { return Ok(()) };
        if sleeper.awake.is_none() {
            return Ok(());
        }
        let way = STILL * sleeper.speed * dt;
        let moved = |v: usize, to: &Vec3| (to - self.state.x[v]).norm() > way;
        let woken: Vec<u32> = (self.pins.vertices.iter().zip(pin_x))
            .filter(|(v, to)| sleeper.asleep[**v as usize] && moved(**v as usize, to))
            .map(|(v, _)| *v)
            .collect();
        if !woken.is_empty() {
            return Err(Failure::Wake(woken));
        }
        for (moving, asleep) in sleeper.moving.iter_mut().zip(&sleeper.asleep) {
            *moving = !asleep;
        }
        for body in &self.bodies.colliders {
            let range = body.first_vertex..body.first_vertex + body.motion.vertex_count();
            let moves = body.motion.moves() && range.clone().any(|i| x[i] != self.state.x[i]);
            sleeper.moving[range].fill(moves);
        }
        Ok(())
    }

    /// Wakes the cloths of these vertices.
    pub(crate) fn wake(&mut self, vertices: &[u32]) -> Result<(), SimError> {
        let Some(sleeper) = &self.sleeper else { return Ok(()) };
        for &v in vertices {
            if let Some(cloth) = sleeper.cloths.iter().position(|range| range.contains(&(v as usize))) {
                self.state.rest.asleep[cloth] = false;
                self.state.rest.calm[cloth] = 0.0;
            }
        }
        self.rebuild_awake()
    }

    /// After a step of `dt` \[s\]: counts how long each cloth has been slow, and puts to sleep what may.
    pub(crate) fn fall_asleep(&mut self, dt: f64) -> Result<(), SimError> {
        let Self { sleeper: Some(sleeper), state, pins, bodies, .. } = self else { return Ok(()) };
        let collider_moves = |k: usize| {
            let body = &bodies.colliders[k];
            let range = body.first_vertex..body.first_vertex + body.motion.vertex_count();
            body.motion.moves() && state.v[range].iter().any(|v| v.norm() > STILL * sleeper.speed)
        };
        let colliders: Vec<bool> = (0..bodies.colliders.len()).map(collider_moves).collect();
        let cloths = sleeper.cloths.len();
        for (c, range) in sleeper.cloths.iter().enumerate().filter(|(c, _)| !state.rest.asleep[*c]) {
            let fastest = state.v[range.clone()].iter().map(Vec3::norm_squared).fold(0.0, f64::max).sqrt();
            let still = |v: &u32| state.v[*v as usize].norm() <= STILL * sleeper.speed;
            let held = pins.vertices.iter().filter(|v| range.contains(&(**v as usize))).all(still);
            let calm = &mut state.rest.calm[c];
            *calm = if fastest < sleeper.speed && held { *calm + dt } else { 0.0 };
        }
        // Groups of awake cloth that touch; what touches a moving collider or restless cloth stays awake.
        let ready = |state: &State, c: usize| state.rest.calm[c] >= sleeper.time;
        let mut restless: Vec<bool> = (0..cloths).map(|c| !ready(state, c)).collect();
        loop {
            let before = restless.clone();
            for &[a, b] in &sleeper.meetings {
                let (a, b) = (a as usize, b as usize);
                let moves = |body: usize, restless: &[bool]| {
                    if body < cloths { restless[body] } else { colliders[body - cloths] }
                };
                let either = moves(a, &restless) || moves(b, &restless);
                for body in [a, b].into_iter().filter(|&body| body < cloths) {
                    restless[body] |= either;
                }
            }
            if restless == before {
                break;
            }
        }
        let mut changed = false;
        for (c, restless) in restless.into_iter().enumerate() {
            if restless || state.rest.asleep[c] {
                continue;
            }
            state.rest.asleep[c] = true;
            state.v[sleeper.cloths[c].clone()].fill(Vec3::zeros());
            changed = true;
        }
        if changed { self.rebuild_awake() } else { Ok(()) }
    }

    /// Force of contact of a vertex without response in a step: what it was, of sleeping cloth, which will need it awake.
    pub(crate) fn resting_force(&self, vertex: usize) -> Vec3 {
        let asleep = self.sleeper.as_ref().is_some_and(|s| s.asleep[vertex]);
        if asleep { self.state.contact_force.get(vertex).copied().unwrap_or_default() } else { Vec3::zeros() }
    }
}
