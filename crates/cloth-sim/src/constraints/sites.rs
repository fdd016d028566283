//! The cloth vertices near colliders, and the search for which of them stick, slide or are free.
//!
//! Each solve is judged vertex by vertex:
//!
//! - a contact that would have to pull lets go; one that a free vertex would pass takes hold;
//! - a vertex that needs more than μ_s N to stick slides, pushed by the kinetic force against the way it would go;
//! - one that would slide back sticks; else its push is renewed for the sliding and the normal force that came out.
//!
//! The search ends when the impulses that are wrong are less than [`TOLERANCE`] of all, or after [`MAX_SOLVES`]; what is left
//! counts for the start of the next step's search, which begins with how the contacts were: a steady state takes one
//! solve.

use super::ConstraintStage;
use super::contact::{Contact, Motion};
use super::friction::{Load, Push, kinetic, sticking};
use crate::Vec3;
use cloth_core::{ActiveSet, Constraint};
use cloth_response::Sides;
use nalgebra::Matrix3;
use std::time::{Duration, Instant};

/// Most solves of one step.
const MAX_SOLVES: usize = 20;
/// Solves after which nothing takes hold or starts to slide any more, so that the search comes to an end in which nothing pulls.
const SETTLING: usize = 12;
/// Solves after which pushes follow the mean of the last two normal forces: where friction turns on the force that presses
/// it, the two would answer each other without end.
const DAMPED: usize = 4;
/// Part of the impulses of all vertices by which they may be wrong (root of the sum of squares).
const TOLERANCE: f64 = 2e-3;
/// Part of a vertex's weight, or of the mean impulse where that is more, that is taken for none: more than what the linear
/// solver leaves, less than what is seen.
const SLACK: f64 = 1e-3;
/// Slower sliding is none [m/s].
const REST: f64 = 1e-6;
/// A vertex that has changed between sticking and sliding this often sticks.
const MAX_FLIPS: u8 = 3;
/// Least sine between the normals of two contacts that are held at a time.
const LEAST_SINE: f64 = 1e-2;
/// Contacts of one vertex.
const MOST: usize = 3;

/// What holds for all vertices.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Settings {
    /// Step [s].
    pub(crate) dt: f64,
    /// Acceleration of gravity [m/s²].
    pub(crate) gravity: Vec3,
}

/// What constraints did to the cloth in a step.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Holds {
    /// Force of the constraints on each cloth vertex [N]; empty without constraints.
    pub(crate) force: Vec<Vec3>,
    /// Whether it slid.
    pub(crate) sliding: Vec<bool>,
}

enum Mode {
    Stick,
    Slide(Push),
}

/// Orthonormal directions of the contacts that hold a vertex.
#[derive(Default)]
struct Basis {
    count: usize,
    q: [Vec3; MOST],
    /// Contact of each direction.
    contact: [usize; MOST],
    /// r\[j\]\[k\] = q_j · n_k.
    r: [[f64; MOST]; MOST],
}

/// A cloth vertex near a collider.
struct Site {
    vertex: u32,
    mass: f64,
    area: f64,
    contacts: Vec<Contact>,
    mode: Mode,
    flips: u8,
    /// Sliding speed at the start [m/s].
    speed_t0: f64,
    basis: Basis,
    /// What the last solve's constraint gave [N s], and the normal impulses of which pushes are made.
    impulse: Vec3,
    normals: [f64; MOST],
}

/// The search of one step.
pub(crate) struct Sites<'a> {
    motion: Motion<'a>,
    settings: Settings,
    near: Vec<Site>,
    list: Vec<Constraint>,
    solves: usize,
    clock: Duration,
}

impl<'a> Sites<'a> {
    /// `near`: [`ConstraintStage::near`] at the start. `x_t0` [m], `v_t0` [m/s]: all vertices at the start; `colliders_t1`
    /// [m]: those of colliders at the end. `before`: what the last step's constraints did. `sides`: what is remembered of near pairs.
    pub(crate) fn new(
        stage: &'a ConstraintStage,
        mesh: &'a cloth_collision::CollisionMesh,
        near: &[[u32; 2]],
        x_t0: &'a [Vec3],
        v_t0: &[Vec3],
        colliders_t1: &'a [Vec3],
        masses: &[f64],
        before: &Holds,
        sides: &'a Sides,
        settings: Settings,
    ) -> Self {
        let (cloth, start) = x_t0.split_at(masses.len());
        let motion = Motion { stage, mesh, cloth, colliders: [start, colliders_t1], sides, dt: settings.dt };
        let mut sites = Vec::new();
        for of_vertex in near.chunk_by(|a, b| a[0] == b[0]) {
            let vertex = of_vertex[0][0];
            let mut contacts: Vec<Contact> = Vec::with_capacity(1);
            for &[_, triangle] in of_vertex {
                if let Some(new) = Contact::new(&motion, vertex, triangle)
                    && new.may_touch(&motion, &(v_t0[vertex as usize] + settings.gravity * settings.dt))
                    && !contacts.iter().any(|c| c.same(&new, stage))
                {
                    contacts.push(new);
                }
            }
            contacts.sort_by(|a, b| a.distance().total_cmp(&b.distance()));
            contacts.truncate(MOST);
            if contacts.is_empty() {
                continue;
            }
            let i = vertex as usize;
            let mut site = Site {
                vertex,
                mass: masses[i],
                area: stage.areas[i],
                contacts,
                mode: Mode::Stick,
                flips: 0,
                speed_t0: 0.0,
                basis: Basis::default(),
                impulse: Vec3::zeros(),
                normals: [0.0; MOST],
            };
            let held = before.force.get(i).map(|f| (*f * settings.dt, before.sliding[i]));
            site.start(&motion, &v_t0[i], held.filter(|h| h.0 != Vec3::zeros()), &settings);
            sites.push(site);
        }
        Self { motion, settings, near: sites, list: Vec::new(), solves: 0, clock: Duration::ZERO }
    }

    /// Solves so far.
    pub(crate) fn solves(&self) -> usize {
        self.solves
    }

    /// Seconds that the search has taken beside the solves.
    pub(crate) fn seconds(&self) -> f64 {
        self.clock.as_secs_f64()
    }

    /// Vertices held from the start, with the normal that pushes them off.
    pub(crate) fn held(&self) -> impl Iterator<Item = (u32, Vec3)> {
        self.near.iter().filter_map(|s| s.contacts.iter().find(|c| c.held).map(|c| (s.vertex, c.normal)))
    }

    /// What the last solve's constraints did to the `cloth` vertices.
    pub(crate) fn finish(&self, cloth: usize) -> Holds {
        let mut holds = Holds { force: vec![Vec3::zeros(); cloth], sliding: vec![false; cloth] };
        for site in &self.near {
            let i = site.vertex as usize;
            holds.force[i] = site.impulse / self.settings.dt;
            holds.sliding[i] = matches!(site.mode, Mode::Slide(_)) && site.impulse != Vec3::zeros();
        }
        holds
    }
}

impl ActiveSet for Sites<'_> {
    fn constraints(&mut self) -> &[Constraint] {
        self.list.clear();
        self.list.extend(self.near.iter_mut().filter_map(Site::constraint));
        &self.list
    }

    fn judge(&mut self, motion: &[Vec3], impulses: &[Vec3]) -> bool {
        let clock = Instant::now();
        self.solves += 1;
        let all: f64 = impulses.iter().map(Vec3::norm_squared).sum();
        let mean = (all / impulses.len().max(1) as f64).sqrt();
        let mut impulses = impulses.iter();
        let mut wrong = 0.0;
        for site in &mut self.near {
            let own = if site.basis.count > 0 { impulses.next() } else { None };
            site.impulse = own.copied().unwrap_or_default();
            let own =
                site.judge(&self.motion, &motion[site.vertex as usize], &self.settings, mean, self.solves);
            wrong += own * own;
        }
        self.clock += clock.elapsed();
        wrong > TOLERANCE * TOLERANCE * all && self.solves < MAX_SOLVES
    }
}

impl Site {
    /// How the search starts; `before`: what held the vertex in the last step [N s], and whether it slid.
    fn start(&mut self, motion: &Motion<'_>, v: &Vec3, before: Option<(Vec3, bool)>, settings: &Settings) {
        let dt = settings.dt;
        let ahead = v + settings.gravity * dt;
        let weight = settings.gravity.norm() * dt;
        for contact in &mut self.contacts {
            let away = contact.normal.dot(&ahead) - contact.least;
            contact.held = match before {
                // What pressed in the last step may do so again where gravity alone would not bring it (a belt's tension
                // does), but not if the surface leaves faster than that could follow.
                Some((impulse, _)) => {
                    let pressed = contact.normal.dot(&impulse);
                    pressed > 0.0 && away < weight.max(pressed / self.mass)
                }
                None => away < 0.0,
            };
        }
        let held = self.contacts.iter().position(|c| c.held);
        let first = held.unwrap_or(0);
        let Contact { ride, normal, .. } = self.contacts[first];
        let slip = v - ride;
        let slip = slip - normal * normal.dot(&slip);
        let speed = slip.norm();
        self.speed_t0 = speed;
        if held.is_none() || speed.is_nan() || speed <= REST || before.is_some_and(|(_, slid)| !slid) {
            return;
        }
        // Where it slides to, for the plane there.
        if before.is_some() {
            self.contacts[first].follow(motion, self.vertex, &(ride + slip));
        }
        self.basis();
        let mut loads = [0.0; MOST];
        match before {
            Some((impulse, _)) => loads = self.normal_impulses(&impulse),
            None => {
                for (j, load) in loads.iter_mut().enumerate().take(self.basis.count) {
                    let contact = &self.contacts[self.basis.contact[j]];
                    *load = self.mass * (contact.least - contact.normal.dot(&ahead));
                }
            }
        }
        let loads = self.loads(&loads);
        let stops = kinetic(&loads, speed, dt) >= self.mass * speed;
        if before.is_some() || !stops {
            let tangential = self.tangential();
            if let Some(direction) = (tangential * slip).try_normalize(0.0) {
                let push = Push::new(&loads, direction, speed, speed, &ride, &tangential, settings);
                self.mode = Mode::Slide(push);
            }
        }
    }

    /// Orthonormal directions of the held contacts; what depends on those before it lets go.
    fn basis(&mut self) {
        let mut basis = Basis::default();
        for (k, contact) in self.contacts.iter_mut().enumerate() {
            if !contact.held {
                continue;
            }
            let j = basis.count;
            let mut rest = contact.normal;
            for i in 0..j {
                basis.r[i][j] = basis.q[i].dot(&contact.normal);
                rest -= basis.q[i] * basis.r[i][j];
            }
            let size = rest.norm();
            if size < LEAST_SINE {
                contact.held = false;
                continue;
            }
            basis.q[j] = rest / size;
            basis.r[j][j] = size;
            basis.contact[j] = k;
            basis.count += 1;
        }
        self.basis = basis;
    }

    /// Projector onto the directions in which the vertex may slide.
    fn tangential(&self) -> Matrix3<f64> {
        let basis = &self.basis;
        basis.q[..basis.count].iter().fold(Matrix3::identity(), |p, q| p - q * q.transpose())
    }

    /// The mean velocity that fulfils the held planes and else is that of the surface [m/s].
    fn velocity(&self) -> Vec3 {
        let basis = &self.basis;
        let mut u = self.contacts[basis.contact[0]].ride;
        for j in 0..basis.count {
            let before: f64 = (0..j).map(|i| basis.r[i][j] * basis.q[i].dot(&u)).sum();
            let along = (self.contacts[basis.contact[j]].least - before) / basis.r[j][j];
            u += basis.q[j] * (along - basis.q[j].dot(&u));
        }
        u
    }

    /// Normal impulse of each held contact [N s]: what of `impulse` lies along the normals.
    fn normal_impulses(&self, impulse: &Vec3) -> [f64; MOST] {
        let basis = &self.basis;
        let mut loads = [0.0; MOST];
        for k in (0..basis.count).rev() {
            let others: f64 = (k + 1..basis.count).map(|m| basis.r[k][m] * loads[m]).sum();
            loads[k] = (basis.q[k].dot(impulse) - others) / basis.r[k][k];
        }
        loads
    }

    fn loads(&self, impulses: &[f64; MOST]) -> Vec<Load> {
        let count = self.basis.count;
        (0..count)
            .map(|j| Load {
                law: self.contacts[self.basis.contact[j]].law,
                normal: impulses[j].max(0.0),
                area: self.area / count as f64,
            })
            .collect()
    }

    fn constraint(&mut self) -> Option<Constraint> {
        self.basis();
        let basis = &self.basis;
        if basis.count == 0 {
            return None;
        }
        let fixed = Constraint::fixed(self.vertex, self.velocity());
        Some(match &self.mode {
            Mode::Slide(push) if basis.count < 3 => Constraint {
                count: basis.count,
                directions: basis.q,
                impulse: push.impulse,
                drag: push.drag,
                ..fixed
            },
            _ => fixed,
        })
    }

    /// Judges a solve in which the vertex got the mean velocity `u` [m/s] and all had the `mean` impulse [N s]: the impulse that
    /// was wrong [N s].
    fn judge(&mut self, motion: &Motion<'_>, u: &Vec3, settings: &Settings, mean: f64, solves: usize) -> f64 {
        let impulses = self.normal_impulses(&self.impulse);
        let slack = SLACK * mean.max(self.mass * settings.gravity.norm() * settings.dt);
        let mut wrong = 0.0_f64;
        for j in 0..self.basis.count {
            if impulses[j] < -slack {
                self.contacts[self.basis.contact[j]].release();
                wrong -= impulses[j];
            }
        }
        if wrong > 0.0 {
            return wrong;
        }
        let (free, settling) = (self.basis.count == 0, solves > SETTLING);
        for (mean, new) in self.normals.iter_mut().zip(impulses) {
            *mean = if solves > DAMPED && *mean > 0.0 { 0.5 * (*mean + new) } else { new };
        }
        let loads = self.loads(&self.normals);
        // A vertex that goes with the only surface near it ends where it should.
        if !settling && (free || self.contacts.len() > 1 || matches!(self.mode, Mode::Slide(_))) {
            for contact in &mut self.contacts {
                if contact.catch(motion, self.vertex, u) {
                    // How much cloth hangs on the vertex is not known: never too little.
                    wrong = f64::INFINITY;
                }
            }
        }
        if free {
            if wrong > 0.0 {
                self.mode = Mode::Stick;
            }
            return wrong;
        }
        let pull = self.tangential() * self.impulse;
        if wrong > 0.0 {
            // Planes have turned: what follows lies in the new ones.
            self.basis();
        }
        let tangential = self.tangential();
        let ride = self.contacts[self.basis.contact[0]].ride;
        match &self.mode {
            Mode::Stick => {
                let size = pull.norm();
                let excess = size - sticking(&loads);
                let direction = (tangential * -pull).try_normalize(0.0);
                if excess > slack
                    && self.flips < MAX_FLIPS
                    && !settling
                    && let Some(direction) = direction
                {
                    let push = Push::new(&loads, direction, 0.0, self.speed_t0, &ride, &tangential, settings);
                    self.mode = Mode::Slide(push);
                    self.flips += 1;
                    wrong += excess;
                }
                wrong
            }
            Mode::Slide(push) => {
                let slip = tangential * (u - ride);
                let speed = slip.norm();
                let given = tangential * push.at(u);
                if speed.is_nan() || push.direction.dot(&slip) <= 0.0 {
                    self.mode = Mode::Stick;
                    self.flips += 1;
                    return wrong + kinetic(&loads, 0.5 * self.speed_t0, settings.dt).min(given.norm());
                }
                let direction = slip / speed;
                let size = kinetic(&loads, 0.5 * (self.speed_t0 + speed), settings.dt);
                let push = Push::new(&loads, direction, speed, self.speed_t0, &ride, &tangential, settings);
                self.mode = Mode::Slide(push);
                if settling { wrong } else { wrong + (given + direction * size).norm() }
            }
        }
    }
}
