//! The step's motion while the stages work on it.

use crate::Vec3;

/// Straight motion `x_t0` → `end` of every vertex, with its average velocity.
///
/// Stages change velocities (impulses) or ends (zones, hold) and list what moved; the lists say which pairs a
/// detection has to look at again.
pub(crate) struct Motion<'a> {
    /// 1/m [1/kg]; 0 for prescribed vertices.
    pub(crate) inv_mass: &'a [f64],
    pub(crate) x_t0: &'a [Vec3],
    pub(crate) dt: f64,
    pub(crate) buffers: &'a mut MotionBuffers,
}

/// The arrays of a [`Motion`], reused from step to step.
#[derive(Default)]
pub(crate) struct MotionBuffers {
    /// Positions at the end of the step [m].
    pub(crate) end: Vec<Vec3>,
    /// Average velocity over the step [m/s].
    pub(crate) velocity: Vec<Vec3>,
    /// The part of it that the vertices keep: all but what pushes overlapping pairs apart; empty while that is nothing.
    kept: Vec<Vec3>,
    /// Average velocity before any response [m/s].
    pub(crate) velocity_start: Vec<Vec3>,
    /// Tick of each vertex's last change by an impulse.
    pub(crate) touched: Vec<u32>,
    /// Ends changed since the last detection.
    pub(crate) changed: Vec<bool>,
    tick: u32,
    written: u32,
}

impl MotionBuffers {
    /// Room for so many vertices.
    pub(crate) fn with_capacity(vertices: usize) -> Self {
        Self {
            end: Vec::with_capacity(vertices),
            velocity: Vec::with_capacity(vertices),
            kept: Vec::new(),
            velocity_start: Vec::with_capacity(vertices),
            touched: Vec::with_capacity(vertices),
            changed: Vec::with_capacity(vertices),
            tick: 0,
            written: 0,
        }
    }

    /// Average velocity without pushes [m/s]: what the step's end velocity changes by.
    pub(crate) fn kept(&self) -> &[Vec3] {
        if self.kept.is_empty() { &self.velocity } else { &self.kept }
    }

    /// Memory [B].
    pub(crate) fn bytes(&self) -> usize {
        bytes_of(&self.end)
            + bytes_of(&self.velocity)
            + bytes_of(&self.kept)
            + bytes_of(&self.velocity_start)
            + bytes_of(&self.touched)
            + bytes_of(&self.changed)
    }
}

/// Memory that a list holds on to [B].
pub(crate) fn bytes_of<T>(list: &Vec<T>) -> usize {
    list.capacity() * size_of::<T>()
}

impl<'a> Motion<'a> {
    pub(crate) fn new(
        buffers: &'a mut MotionBuffers,
        inv_mass: &'a [f64],
        x_t0: &'a [Vec3],
        x_t1: &[Vec3],
        dt: f64,
    ) -> Self {
        let MotionBuffers { end, velocity, kept, velocity_start, touched, changed, tick, written } = buffers;
        kept.clear();
        end.clear();
        end.extend_from_slice(x_t1);
        velocity.clear();
        velocity.extend(x_t0.iter().zip(x_t1).map(|(a, b)| (b - a) / dt));
        velocity_start.clone_from(velocity);
        touched.clear();
        touched.resize(x_t0.len(), 0);
        changed.clear();
        changed.resize(x_t0.len(), false);
        (*tick, *written) = (0, 0);
        Self { inv_mass, x_t0, dt, buffers }
    }

    /// The next tick: later than all changes so far.
    pub(crate) fn tick(&mut self) -> u32 {
        self.buffers.tick += 1;
        self.buffers.tick
    }

    /// Moves the ends of the vertices that impulses changed since the last call, and marks them.
    pub(crate) fn write_ends(&mut self) -> usize {
        let buffers = &mut *self.buffers;
        let mut count = 0;
        for i in 0..buffers.end.len() {
            if buffers.touched[i] > buffers.written {
                buffers.end[i] = self.x_t0[i] + buffers.velocity[i] * self.dt;
                buffers.changed[i] = true;
                count += 1;
            }
        }
        buffers.written = buffers.tick;
        count
    }

    /// Moves one end and marks it, and all of that is kept; no change is no mark.
    pub(crate) fn set_end(&mut self, vertex: u32, end: Vec3) -> bool {
        let i = vertex as usize;
        if self.buffers.end[i] == end {
            if let Some(kept) = self.buffers.kept.get_mut(i) {
                *kept = self.buffers.velocity[i];
            }
            return false;
        }
        self.buffers.end[i] = end;
        self.buffers.velocity[i] = (end - self.x_t0[i]) / self.dt;
        if let Some(kept) = self.buffers.kept.get_mut(i) {
            *kept = self.buffers.velocity[i];
        }
        self.buffers.changed[i] = true;
        true
    }

    /// Leaves this fraction of a vertex' way, and of what is kept of it.
    pub(crate) fn shorten(&mut self, vertex: u32, fraction: f64) {
        let i = vertex as usize;
        let (start, end) = (self.x_t0[i], self.buffers.end[i]);
        let kept = self.buffers.kept()[i];
        if self.set_end(vertex, start + (end - start) * fraction)
            && let Some(own) = self.buffers.kept.get_mut(i)
        {
            *own = kept * fraction;
        }
    }

    /// Whether there may be pushes.
    pub(crate) fn is_parted(&self) -> bool {
        !self.buffers.kept.is_empty()
    }

    /// From here on pushes change the motion and not what is kept of it.
    pub(crate) fn part(&mut self) {
        if self.buffers.kept.is_empty() {
            self.buffers.kept.clone_from(&self.buffers.velocity);
        }
    }

    /// Changes a vertex' velocity by an impulse: that of the motion, and what is kept of it unless the impulse is a push.
    pub(crate) fn change(&mut self, vertex: usize, by: Vec3, tick: u32, push: bool) {
        self.buffers.velocity[vertex] += by;
        self.buffers.touched[vertex] = tick;
        if !push && let Some(kept) = self.buffers.kept.get_mut(vertex) {
            *kept += by;
        }
    }

    /// Forgets the marks.
    pub(crate) fn clear_changed(&mut self) {
        self.buffers.changed.fill(false);
    }

    /// Whether the vertex's motion is prescribed.
    pub(crate) fn prescribed(&self, vertex: u32) -> bool {
        self.inv_mass[vertex as usize] == 0.0
    }
}
