//! All contacts of a step, relaxed one after the other until none is off.
//!
//! Gauss–Seidel on accumulated impulses, in the order in which the contacts came (sorted pairs), every other sweep
//! backwards: deterministic, momentum is conserved pair by pair, and a contact can take back what another made
//! superfluous. Averaging over a vertex's contacts instead (end of §3.3.3) would weaken every impulse by their
//! number. A contact is looked at again only if one of its vertices changed since, so late sweeps touch only what
//! is not settled. The set grows over the passes of a step: later collisions do not undo the earlier contacts.

use crate::impulse::Contact;
use crate::motion::Motion;

/// The contacts of one step.
#[derive(Default)]
pub(crate) struct ContactSet {
    contacts: Vec<Contact>,
    /// Vertices and tick of the last look, apart from the rest: this is all that a settled contact costs.
    looks: Vec<([u32; 4], u32)>,
}

/// What the sweeps of one pass did.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct SweepInfo {
    pub(crate) sweeps: usize,
    /// Largest correction of the last sweep [m/s].
    pub(crate) residual: f64,
}

impl ContactSet {
    pub(crate) fn clear(&mut self) {
        self.contacts.clear();
        self.looks.clear();
    }

    pub(crate) fn push(&mut self, contact: Contact) {
        self.looks.push((contact.vertices, 0));
        self.contacts.push(contact);
    }

    pub(crate) fn len(&self) -> usize {
        self.contacts.len()
    }

    /// Contacts that carry an impulse.
    pub(crate) fn loaded(&self) -> usize {
        self.contacts.iter().filter(|c| c.impulse.norm_squared() > 0.0).count()
    }

    /// Relaxes the contacts until no relative velocity is off by more than `tolerance` [m/s], at most `max_sweeps`
    /// times.
    pub(crate) fn relax(&mut self, motion: &mut Motion<'_>, tolerance: f64, max_sweeps: usize) -> SweepInfo {
        let mut info = SweepInfo::default();
        if self.contacts.is_empty() {
            return info;
        }
        for sweep in 0..max_sweeps {
            info.sweeps += 1;
            info.residual = 0.0;
            for i in 0..self.contacts.len() {
                let i = if sweep % 2 == 0 { i } else { self.contacts.len() - 1 - i };
                let error = self.relax_one(i, motion, tolerance);
                info.residual = info.residual.max(error);
            }
            if info.residual <= tolerance {
                break;
            }
        }
        info
    }

    fn relax_one(&mut self, i: usize, motion: &mut Motion<'_>, tolerance: f64) -> f64 {
        let (vertices, seen) = self.looks[i];
        let latest = vertices.map(|v| motion.buffers.touched[v as usize]).into_iter().max();
        if seen > 0 && latest <= Some(seen) {
            return 0.0;
        }
        let tick = motion.tick();
        self.looks[i].1 = tick;
        let contact = &mut self.contacts[i];
        let (change, error) = contact.correction(&motion.buffers.velocity);
        if error <= tolerance {
            return error;
        }
        contact.apply(change, &mut motion.buffers.velocity);
        for (k, v) in vertices.into_iter().enumerate() {
            if contact.moves(k) {
                motion.buffers.touched[v as usize] = tick;
            }
        }
        error
    }
}
