//! The cloth vertices near colliders, and the search for which of them stick, slide or are free.
//!
//! Each solve is judged vertex by vertex:
//!
//! - a contact that would have to pull lets go; one that a free vertex would pass takes hold;
//! - a vertex that needs more than μ_s N to stick slides, pushed by the kinetic force against the way it would go;
//! - one that would slide back sticks; else its push is renewed for the sliding and the normal force that came out.
//!
//! The search ends when nothing changes and the pushes are right to [`FRICTION_TOLERANCE`], or after [`MAX_SOLVES`]. It starts
//! from how the contacts were in the last step, so that a steady state takes one solve.

use super::ConstraintStage;
use super::contact::{Contact, Motion};
use super::friction::{Load, Push, kinetic, sticking};
use crate::Vec3;
use cloth_core::{ActiveSet, Constraint};
use nalgebra::Matrix3;
use std::time::{Duration, Instant};

/// Most solves of one step.
const MAX_SOLVES: usize = 10;
/// Part of the pushes of all vertices by which they may be off.
const FRICTION_TOLERANCE: f64 = 1e-3;
/// Impulses of less than this times the mass are taken for none [m/s].
const SLACK: f64 = 1e-6;
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
    /// What the last solve's constraint gave [N s].
    impulse: Vec3,
}

/// The search of one step.
pub(crate) struct Sites<'a> {
    motion: Motion<'a>,
    settings: Settings,
    sites: Vec<Site>,
    list: Vec<Constraint>,
    solves: usize,
    clock: Duration,
}

impl<'a> Sites<'a> {
    /// `near`: [`ConstraintStage::near`] at the start. `x_t0` [m], `v_t0` [m/s]: all vertices at the start; `colliders_t1`
    /// [m]: those of colliders at the end. `before`: what the last step's constraints did.
    pub(crate) fn new(
        stage: &'a ConstraintStage,
        mesh: &'a cloth_collision::CollisionMesh,
        near: &[[u32; 2]],
        x_t0: &'a [Vec3],
        v_t0: &[Vec3],
        colliders_t1: &'a [Vec3],
        masses: &[f64],
        before: &Holds,
        settings: Settings,
    ) -> Self {
        let (cloth, start) = x_t0.split_at(masses.len());
        let motion = Motion { stage, mesh, cloth, colliders: [start, colliders_t1], dt: settings.dt };
        let mut sites = Vec::new();
        for of_vertex in near.chunk_by(|a, b| a[0] == b[0]) {
            let vertex = of_vertex[0][0];
            let mut contacts: Vec<Contact> = Vec::with_capacity(1);
            for &[_, triangle] in of_vertex {
                if let Some(new) = Contact::new(&motion, vertex, triangle)
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
            };
            let held = before.force.get(i).map(|f| (*f * settings.dt, before.sliding[i]));
            site.start(&motion, &v_t0[i], held.filter(|h| h.0 != Vec3::zeros()), &settings);
            sites.push(site);
        }
        Self { motion, settings, sites, list: Vec::new(), solves: 0, clock: Duration::ZERO }
    }

    /// Seconds that the search has taken beside the solves.
    pub(crate) fn seconds(&self) -> f64 {
        self.clock.as_secs_f64()
    }

    /// Vertices held from the start, with the normal that pushes them off.
    pub(crate) fn held(&self) -> impl Iterator<Item = (u32, Vec3)> {
        self.sites.iter().filter_map(|s| s.contacts.iter().find(|c| c.held).map(|c| (s.vertex, c.normal)))
    }

    /// What the last solve's constraints did to the `cloth` vertices.
    pub(crate) fn finish(&self, cloth: usize) -> Holds {
        let mut holds = Holds { force: vec![Vec3::zeros(); cloth], sliding: vec![false; cloth] };
        for site in &self.sites {
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
        self.list.extend(self.sites.iter_mut().filter_map(Site::constraint));
        &self.list
    }

    fn judge(&mut self, motion: &[Vec3], impulses: &[Vec3]) -> bool {
        let clock = Instant::now();
        self.solves += 1;
        let mut impulses = impulses.iter();
        let (mut changed, mut off, mut pushes) = (false, 0.0, 0.0);
        for site in &mut self.sites {
            let own = if site.basis.count > 0 { impulses.next() } else { None };
            site.impulse = own.copied().unwrap_or_default();
            let verdict = site.judge(&self.motion, &motion[site.vertex as usize], &self.settings);
            changed |= verdict.changed;
            off += verdict.off;
            pushes += verdict.push;
        }
        self.clock += clock.elapsed();
        let again = changed || off > FRICTION_TOLERANCE * FRICTION_TOLERANCE * pushes;
        again && self.solves < MAX_SOLVES
    }
}

/// What a solve came to at a vertex.
#[derive(Default)]
struct Verdict {
    changed: bool,
    /// Squares of the push's error and of the push [N² s²].
    off: f64,
    push: f64,
}

impl Site {
    /// How the search starts; `before`: what held the vertex in the last step [N s], and whether it slid.
    fn start(&mut self, motion: &Motion<'_>, v: &Vec3, before: Option<(Vec3, bool)>, settings: &Settings) {
        let dt = settings.dt;
        let ahead = v + settings.gravity * dt;
        for contact in &mut self.contacts {
            contact.held = match before {
                Some((impulse, _)) => contact.normal.dot(&impulse) > 0.0,
                None => contact.normal.dot(&ahead) < contact.least,
            };
        }
        let Some(first) = self.contacts.iter().position(|c| c.held) else { return };
        let Contact { ride, normal, .. } = self.contacts[first];
        let slip = v - ride;
        let slip = slip - normal * normal.dot(&slip);
        let speed = slip.norm();
        self.speed_t0 = speed;
        if speed <= SLACK || before.is_some_and(|(_, slid)| !slid) {
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
            let push = Push::new(&loads, slip / speed, speed, speed, &ride, &tangential, settings);
            self.mode = Mode::Slide(push);
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

    fn judge(&mut self, motion: &Motion<'_>, u: &Vec3, settings: &Settings) -> Verdict {
        let impulses = self.normal_impulses(&self.impulse);
        let mut changed = false;
        for j in 0..self.basis.count {
            if impulses[j] < -SLACK * self.mass {
                self.contacts[self.basis.contact[j]].release();
                changed = true;
            }
        }
        if changed {
            return Verdict { changed, ..Verdict::default() };
        }
        let free = self.basis.count == 0;
        // A vertex that goes with the only surface near it ends where it should.
        if free || self.contacts.len() > 1 || matches!(self.mode, Mode::Slide(_)) {
            for contact in &mut self.contacts {
                changed |= contact.catch(motion, self.vertex, u);
            }
        }
        if free {
            if changed {
                self.mode = Mode::Stick;
            }
            return Verdict { changed, ..Verdict::default() };
        }
        let loads = self.loads(&impulses);
        let tangential = self.tangential();
        let ride = self.contacts[self.basis.contact[0]].ride;
        match &self.mode {
            Mode::Stick => {
                let pull = tangential * self.impulse;
                let size = pull.norm();
                if size > sticking(&loads) + SLACK * self.mass && self.flips < MAX_FLIPS {
                    let push =
                        Push::new(&loads, -pull / size, 0.0, self.speed_t0, &ride, &tangential, settings);
                    self.mode = Mode::Slide(push);
                    self.flips += 1;
                    changed = true;
                }
                Verdict { changed, ..Verdict::default() }
            }
            Mode::Slide(push) => {
                let slip = tangential * (u - ride);
                let speed = slip.norm();
                if !(push.direction.dot(&slip) > 0.0) {
                    self.mode = Mode::Stick;
                    self.flips += 1;
                    return Verdict { changed: true, ..Verdict::default() };
                }
                let direction = slip / speed;
                let size = kinetic(&loads, 0.5 * (self.speed_t0 + speed), settings.dt);
                let off = (tangential * push.at(u) + direction * size).norm_squared();
                let push = Push::new(&loads, direction, speed, self.speed_t0, &ride, &tangential, settings);
                self.mode = Mode::Slide(push);
                Verdict { changed, off, push: size * size }
            }
        }
    }
}
