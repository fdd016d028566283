//! From triangle pairs to candidates: feature assignment and the boxes of features.

use crate::buffers::Array;
use crate::context::Gpu;
use crate::error::GpuError;
use crate::kernel::{Kernel, Source};
use crate::limits::WORKGROUP;
use crate::recorder::Recorder;
use crate::stages::bounds::Scene;
use std::sync::Arc;

/// Candidates of the triangle pairs.
#[derive(Debug)]
pub struct Features {
    kernel: Arc<Kernel>,
    /// Candidates (vertex, triangle), unordered.
    pub vertex_triangle: Array<[u32; 2]>,
    /// Candidates (edge, edge), unordered.
    pub edge_edge: Array<[u32; 2]>,
}

/// The kernel's text, without and with 18-DOPs.
pub fn source(dops: bool) -> Source {
    Source::new("feature_pairs", include_str!("../../shaders/feature_pairs.wgsl"))
        .include(include_str!("../../shaders/boxes.wgsl"))
        .include(include_str!("../../shaders/dops.wgsl"))
        .switch("DOPS", dops)
}

impl Features {
    /// Builds the pipeline; room for `capacity` candidates of each kind. `dops`: 18-DOPs are compared too.
    ///
    /// # Errors
    /// [`GpuError::Shader`], [`GpuError::TooLarge`], [`GpuError::OutOfMemory`].
    pub fn new(gpu: &Gpu, capacity: usize, dops: bool) -> Result<Self, GpuError> {
        Ok(Self {
            kernel: source(dops).kernel(gpu)?,
            vertex_triangle: Array::new(gpu, "vertex-triangle candidates", capacity)?,
            edge_edge: Array::new(gpu, "edge-edge candidates", capacity)?,
        })
    }

    /// Records the candidates of the pairs that the status counts, as far as `pairs` holds them; of at least `most` where there
    /// are so many.
    pub fn record(&self, recorder: &mut Recorder<'_>, scene: &Scene, pairs: &Array<[u32; 2]>, most: u32) {
        recorder.stage("feature pairs");
        let arrays = [
            &scene.triangles.raw,
            &scene.features.raw,
            &scene.positions.raw,
            &scene.active.raw,
            &pairs.raw,
            &self.vertex_triangle.raw,
            &self.edge_edge.raw,
            &scene.status.raw,
        ];
        recorder.dispatch(&self.kernel, &scene.params, &arrays, most.div_ceil(WORKGROUP));
    }

    /// Memory [B].
    pub fn bytes(&self) -> u64 {
        self.vertex_triangle.bytes() + self.edge_edge.bytes()
    }
}
