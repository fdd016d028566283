//! All contacts of a step, relaxed one after the other until none is off.
//!
//! Gauss–Seidel on accumulated impulses, in the order in which the contacts came (sorted pairs), every other sweep
//! backwards: deterministic, momentum is conserved pair by pair, and a contact can take back what another made
//! superfluous. Averaging over a vertex's contacts instead (end of §3.3.3) would weaken every impulse by their
//! number. A contact is looked at again only if one of its vertices changed since, so late sweeps touch only what
//! is not settled. The set grows over the passes of a step: later collisions do not undo the earlier contacts.
//!
//! Layers upon layers settle slowly that way. So the change of a sweep is taken as a gradient, and the impulses are moved on
//! along the conjugate direction (Fletcher–Reeves) before the next sweep, which brings them back into their bounds;
//! where the changes grow the direction is dropped. Source: Silcowitz, Niebe, Erleben 2010, "A nonsmooth nonlinear
//! conjugate gradient method for interactive contact force problems".

use crate::friction::kernel::Kernel;
use crate::impulse::Contact;
use crate::motion::{Motion, bytes_of};
use crate::{ResponseInfo, Vec3};

/// Cap on sweeps as a multiple of `max_sweeps`: sweeps that look at few contacts cost little.
const CHEAP_SWEEPS: usize = 10;
/// Looks that a pass may always take (about 1 ms): small scenes settle as far as their tolerance.
const FREE_LOOKS: usize = 20_000;

/// One in this number of looks and of sweeps is kept for what the review after the settled sweeps changes.
const KEPT: usize = 3;

/// Cap on the times that settled sweeps go on with other laws of friction (see [`Kernel::review`]).
const MAX_ROUNDS: usize = 8;

/// The contacts of one step.
pub(crate) struct ContactSet<K: Kernel> {
    pub(crate) kernel: K,
    contacts: Vec<Contact<K::State>>,
    /// Vertices and tick of the last look, apart from the rest: this is all that a settled contact costs.
    looks: Vec<([u32; 4], u32)>,
    /// Change of each impulse in this sweep [N s].
    change: Vec<Vec3>,
    /// Conjugate direction [N s].
    direction: Vec<Vec3>,
    /// Contacts that one look does not settle; all that sweeps look at after the first, where the kernel has reviews.
    coupled: Vec<u32>,
}

/// What the sweeps of one pass did.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct SweepInfo {
    pub(crate) sweeps: usize,
    /// Largest correction of the last sweep [m/s].
    pub(crate) residual: f64,
}

impl<K: Kernel> ContactSet<K> {
    pub(crate) fn new(kernel: K) -> Self {
        Self {
            kernel,
            contacts: Vec::new(),
            looks: Vec::new(),
            change: Vec::new(),
            direction: Vec::new(),
            coupled: Vec::new(),
        }
    }

    pub(crate) fn clear(&mut self) {
        self.contacts.clear();
        self.looks.clear();
    }

    /// Adds a contact; its index.
    pub(crate) fn push(&mut self, contact: Contact<K::State>) -> u32 {
        self.looks.push((contact.vertices, 0));
        self.contacts.push(contact);
        (self.contacts.len() - 1) as u32
    }

    pub(crate) fn contact(&self, index: u32) -> &Contact<K::State> {
        &self.contacts[index as usize]
    }

    /// Changes a contact's least normal velocity [m/s].
    pub(crate) fn set_least(&mut self, index: u32, least: f64) {
        self.contacts[index as usize].law.least = least;
        self.looks[index as usize].1 = 0;
    }

    /// Memory [B].
    pub(crate) fn bytes(&self) -> usize {
        bytes_of(&self.contacts)
            + bytes_of(&self.looks)
            + bytes_of(&self.change)
            + bytes_of(&self.direction)
            + bytes_of(&self.coupled)
            + self.kernel.bytes()
    }

    #[cfg(test)]
    pub(crate) fn contacts(&self) -> &[Contact<K::State>] {
        &self.contacts
    }

    /// Whether the kernel stands for the laws of all contacts ([`Kernel::holds`]).
    pub(crate) fn hold(&self, motion: &Motion<'_>, tolerance: f64) -> bool {
        let velocity = motion.buffers.kept();
        !K::TENTATIVE || self.contacts.iter().all(|c| self.kernel.holds(c, velocity, tolerance))
    }

    /// Counts the contacts that carry an impulse, and those of them that slide, by more than `tolerance` [m/s], and that
    /// stick.
    pub(crate) fn count(&self, motion: &Motion<'_>, tolerance: f64, info: &mut ResponseInfo) {
        (info.impulses, info.sticking, info.sliding) = (0, 0, 0);
        for contact in self.contacts.iter().filter(|c| c.impulse.norm_squared() > 0.0) {
            info.impulses += 1;
            if self.kernel.acts(&contact.friction) {
                let u = contact.relative(motion.buffers.kept());
                let v_n = contact.normal.dot(&u);
                if u.norm_squared() - v_n * v_n > tolerance * tolerance {
                    info.sliding += 1;
                } else {
                    info.sticking += 1;
                }
            }
        }
    }

    /// Relaxes the contacts until no relative velocity is off by more than `tolerance` [m/s].
    ///
    /// Ends without that when contacts were looked at `max_sweeps` times their number (or [`FREE_LOOKS`] times where
    /// that is more), or after [`CHEAP_SWEEPS`] · `max_sweeps` sweeps.
    ///
    /// First what is kept of the motion, with friction and without the elastic part of the normal laws; then, where these ask for
    /// more or pushes are there already, the motion itself.
    pub(crate) fn relax(&mut self, motion: &mut Motion<'_>, tolerance: f64, max_sweeps: usize) -> SweepInfo {
        let mut info = self.sweep(motion, tolerance, max_sweeps, false);
        let velocity = &motion.buffers.velocity;
        if motion.is_parted() || self.contacts.iter().any(|c| c.wants_push(velocity, tolerance)) {
            motion.part();
            self.look_anew();
            let pushes = self.sweep(motion, tolerance, max_sweeps, true);
            self.look_anew();
            info.sweeps += pushes.sweeps;
            info.residual = info.residual.max(pushes.residual);
        }
        info
    }

    /// Forgets what was looked at.
    fn look_anew(&mut self) {
        self.looks.iter_mut().for_each(|look| look.1 = 0);
    }

    /// The sweeps over what is kept of the motion, or with `push` over the motion itself.
    fn sweep(&mut self, motion: &mut Motion<'_>, tolerance: f64, max_sweeps: usize, push: bool) -> SweepInfo {
        let count = self.contacts.len();
        let reviews = K::REVIEWS && !push;
        let mut info = SweepInfo::default();
        for list in [&mut self.change, &mut self.direction] {
            list.clear();
            list.resize(count, Vec3::zeros());
        }
        let (all, most) = ((max_sweeps * count).max(FREE_LOOKS), CHEAP_SWEEPS * max_sweeps);
        let mut budget = all;
        let mut last_norm = 0.0;
        if count == 0 {
            return info;
        }
        if !push {
            self.kernel.begin(&mut self.contacts, motion.x_t0.len());
        }
        if reviews {
            let Self { kernel, contacts, coupled, .. } = self;
            coupled.clear();
            coupled.extend((0..count as u32).filter(|&i| !kernel.alone(&contacts[i as usize].friction)));
        }
        let mut rounds = 0;
        loop {
            if !push {
                self.kernel.before_sweep(info.sweeps);
            }
            let mut sweep = Sweep { looks: 0, residual: 0.0, norm: 0.0 };
            if reviews && info.sweeps > 0 {
                let coupled = std::mem::take(&mut self.coupled);
                let one = |i: &u32| self.relax_one(*i as usize, motion, tolerance, push, &mut sweep);
                if info.sweeps % 2 == 0 {
                    coupled.iter().for_each(one);
                } else {
                    coupled.iter().rev().for_each(one);
                }
                self.coupled = coupled;
            } else if info.sweeps % 2 == 0 {
                (0..count).for_each(|i| self.relax_one(i, motion, tolerance, push, &mut sweep));
            } else {
                (0..count).rev().for_each(|i| self.relax_one(i, motion, tolerance, push, &mut sweep));
            }
            info.sweeps += 1;
            info.residual = sweep.residual;
            budget = budget.saturating_sub(sweep.looks);
            let kept = if reviews && rounds == 0 { KEPT } else { usize::MAX };
            let spent = budget <= all / kept || info.sweeps >= most - most / kept;
            if sweep.residual <= tolerance || spent {
                rounds += 1;
                let over = (spent && rounds > 1) || rounds > MAX_ROUNDS;
                if !reviews || over {
                    break;
                }
                if self.review(motion, tolerance) {
                    self.follow(None, motion, tolerance, push);
                    last_norm = 0.0;
                    continue;
                }
                if sweep.residual <= tolerance {
                    break;
                }
            }
            // A restart forgets the direction, and the change that ended it with it.
            let beta = if last_norm > 0.0 { sweep.norm / last_norm } else { 0.0 };
            self.follow(if beta > 1.0 { None } else { Some(beta) }, motion, tolerance, push);
            last_norm = sweep.norm;
        }
        info
    }

    /// Lets friction see how far the sweeps have come; whether a contact has to be looked at again.
    #[inline(never)]
    fn review(&mut self, motion: &Motion<'_>, tolerance: f64) -> bool {
        let Self { kernel, contacts, looks, .. } = self;
        let mut changed = false;
        kernel.review(contacts, motion, tolerance, |i| {
            looks[i].1 = 0;
            changed = true;
        });
        changed
    }

    /// Moves the impulses by `beta` times the direction and renews it.
    fn follow(&mut self, beta: Option<f64>, motion: &mut Motion<'_>, tolerance: f64, push: bool) {
        let reviews = K::REVIEWS && !push;
        let Some(beta) = beta else {
            for (direction, change) in self.direction.iter_mut().zip(&mut self.change) {
                (*direction, *change) = (Vec3::zeros(), Vec3::zeros());
            }
            return;
        };
        let moving = if reviews { self.coupled.len() } else { self.contacts.len() };
        for k in 0..moving {
            let i = if reviews { self.coupled[k] as usize } else { k };
            let step = self.direction[i] * beta;
            self.direction[i] = step + std::mem::take(&mut self.change[i]);
            let contact = &mut self.contacts[i];
            if step.norm() > tolerance * contact.mass {
                move_impulse(contact, step, motion, push);
                // Its own law is off now.
                self.looks[i].1 = 0;
            }
        }
    }

    #[inline]
    fn relax_one(
        &mut self,
        i: usize,
        motion: &mut Motion<'_>,
        tolerance: f64,
        push: bool,
        sweep: &mut Sweep,
    ) {
        let (vertices, seen) = self.looks[i];
        let latest = vertices.map(|v| motion.buffers.touched[v as usize]).into_iter().max();
        if seen > 0 && latest <= Some(seen) {
            return;
        }
        let contact = &mut self.contacts[i];
        let (change, error) = if push {
            contact.push_correction(&self.kernel, &motion.buffers.velocity, motion.buffers.kept())
        } else {
            contact.correction(&self.kernel, motion.buffers.kept())
        };
        sweep.looks += 1;
        sweep.residual = sweep.residual.max(error);
        if error > tolerance {
            if push || !K::REVIEWS || !self.kernel.alone(&contact.friction) {
                sweep.norm += error * error * contact.mass;
            }
            self.change[i] = change;
            move_impulse(contact, change, motion, push);
        }
        self.looks[i].1 = motion.tick();
    }
}

#[inline]
fn move_impulse<S: Copy>(contact: &mut Contact<S>, by: Vec3, motion: &mut Motion<'_>, push: bool) {
    let tick = motion.tick();
    contact.apply(by, push, |v, change| motion.change(v, change, tick, push));
}

/// What one sweep met.
struct Sweep {
    /// Contacts looked at.
    looks: usize,
    /// Largest correction [m/s].
    residual: f64,
    /// Σ m |Δu|² over the corrections.
    norm: f64,
}
