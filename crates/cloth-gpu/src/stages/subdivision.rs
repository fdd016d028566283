//! Virtual subdivision (thesis 5.3): triangles too large for the cells, or too fast, are registered in parts.
//!
//! **Closed form.** The Loop scheme cuts a triangle into congruent parts, so how often it has to be cut follows from its size and
//! its motion (`subdivision_plan.wgsl`), without a pass per level. Part k of all is found by binary search in the sums of the counts.
//!
//! **Time.** Where the motion is what makes a part too large, its time is halved instead (thesis 5.3.2), for this triangle alone. All
//! parts lie in one grid: a contact at time t lies in two parts whose times hold t, so their spheres overlap and the pair comes up; parts of
//! different times may meet in vain, which costs a test and no contact.
//!
//! **Nothing is lost when registrations are removed.** In each cell a triangle keeps one part, one at home if it has any there. Let parts of
//! A and B overlap. Then (`cells.rs`) one of them is registered in the other's home cell, where B, say, keeps a part at home: the
//! pair (A, B) is tested there, with the spheres and boxes of the whole triangles. The control bits of the kept parts may leave
//! the pair to another cell, but only to one in which both are registered and one is at home, and of a lower type: so some cell
//! keeps it. Pairs that come up in several cells all the same are one contact at the end.

use crate::buffers::{Array, Length};
use crate::context::Gpu;
use crate::error::GpuError;
use crate::frame::Frame;
use crate::kernel::{Kernel, Source};
use crate::layout::SubdivisionParams;
use crate::limits::{PART_SLACK, WORKGROUP};
use crate::recorder::Recorder;
use crate::stages::bounds::Scene;
use crate::stages::cells::{Cells, Registered};
use crate::stages::scan::Scan;
use std::sync::Arc;

/// The parts of a scene's triangles.
#[derive(Debug)]
pub struct Subdivision {
    words: Arc<Kernel>,
    setup: Arc<Kernel>,
    plan: Arc<Kernel>,
    part: Arc<Kernel>,
    scan: Scan<[u32; 2]>,
    /// Radii as words, then parts of each triangle.
    pub counts: Array<u32>,
    /// Sums of the radii, then parts before each triangle; the last element is the total.
    pub sums: Array<[u32; 2]>,
    /// How far each triangle is subdivided: l | m << 8.
    pub plans: Array<u32>,
    /// Triangle of each part.
    pub roots: Array<u32>,
    /// Sphere of each part.
    pub parts: Array<[f32; 4]>,
}

/// The texts of the kernels: radii, setup, plan, parts.
pub fn sources() -> [Source; 4] {
    [
        Source::new("radius_words", include_str!("../../shaders/radius_words.wgsl")),
        Source::new("subdivision_setup", include_str!("../../shaders/subdivision_setup.wgsl")),
        Source::new("subdivision_plan", include_str!("../../shaders/subdivision_plan.wgsl")),
        Source::new("subdivision_parts", include_str!("../../shaders/subdivision_parts.wgsl")),
    ]
}

/// What the kernels are told: room for so many parts, cells `coarseness` times three average radii.
pub fn params(scene: &Scene, frame: &Frame, room: u32, coarseness: f32) -> SubdivisionParams {
    let reach = frame.positions.iter().fold(0.0f32, |r, p| r.max(p[3]));
    SubdivisionParams {
        triangles: scene.params.triangles,
        second: scene.params.second,
        room,
        coarseness,
        low: scene.params.low,
        least: 1.7322 * reach + 2.0 * PART_SLACK,
        high: scene.params.high,
        pad: 0,
    }
}

impl Subdivision {
    /// Builds the pipelines; room for `capacity` parts.
    ///
    /// # Errors
    /// [`GpuError::Shader`], [`GpuError::TooLarge`], [`GpuError::OutOfMemory`].
    pub fn new(gpu: &Gpu, triangles: u32, capacity: usize) -> Result<Self, GpuError> {
        let [words, setup, plan, part] = sources();
        let n = triangles as usize;
        Ok(Self {
            words: words.kernel(gpu)?,
            setup: setup.kernel(gpu)?,
            plan: plan.kernel(gpu)?,
            part: part.kernel(gpu)?,
            scan: Scan::new(gpu)?,
            counts: Array::new(gpu, "parts per triangle", n)?,
            sums: Array::new(gpu, "first parts", n + 1)?,
            plans: Array::new(gpu, "subdivision plans", n)?,
            roots: Array::new(gpu, "roots", capacity)?,
            parts: Array::new(gpu, "parts", capacity)?,
        })
    }

    /// Makes room for `needed` parts.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`], [`GpuError::OutOfMemory`].
    pub fn grow(&mut self, gpu: &Gpu, needed: usize) -> Result<(), GpuError> {
        self.roots.grow(gpu, needed)?;
        self.parts.grow(gpu, needed)
    }

    /// Records the cells' size and the parts.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`], [`GpuError::OutOfMemory`] for scratch memory.
    pub fn record(
        &mut self,
        recorder: &mut Recorder<'_>,
        scene: &Scene,
        cells: &Cells,
        params: &SubdivisionParams,
    ) -> Result<(), GpuError> {
        let n = params.triangles;
        let groups = n.div_ceil(WORKGROUP);
        recorder.stage("subdivision");
        recorder.dispatch(&self.words, &scene.params, &[&scene.spheres.raw, &self.counts.raw], groups);
        self.scan.record(recorder, &self.counts, Length::host(n), &self.sums)?;
        let arrays = [&self.sums.raw, &scene.status.raw, &cells.grid.raw];
        recorder.dispatch(&self.setup, params, &arrays, 1);
        let (triangles, positions) = (&scene.triangles.raw, &scene.positions.raw);
        let arrays = [
            triangles,
            positions,
            &scene.spheres.raw,
            &cells.grid.raw,
            &self.plans.raw,
            &self.counts.raw,
            &scene.status.raw,
        ];
        recorder.dispatch(&self.plan, params, &arrays, groups);
        self.scan.record(recorder, &self.counts, Length::host(n), &self.sums)?;
        let arrays = [
            triangles,
            positions,
            &scene.spheres.raw,
            &self.sums.raw,
            &self.plans.raw,
            &self.roots.raw,
            &self.parts.raw,
        ];
        recorder.dispatch(&self.part, params, &arrays, params.room.div_ceil(WORKGROUP));
        Ok(())
    }

    /// What there is to register.
    pub fn registered(&self, triangles: u32) -> Registered<'_> {
        let most = self.roots.capacity() as u32;
        Registered {
            spheres: &self.parts,
            length: Length::device_wide(most, &self.sums, triangles),
            roots: Some(&self.roots),
        }
    }

    /// Memory [B].
    pub fn bytes(&self) -> u64 {
        self.counts.bytes() + self.sums.bytes() + self.plans.bytes() + self.roots.bytes() + self.parts.bytes()
    }
}
