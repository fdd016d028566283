//! From candidates to those that may be contacts: the narrow phase in single precision, with error bounds.

use crate::buffers::Array;
use crate::context::Gpu;
use crate::error::GpuError;
use crate::kernel::{Kernel, Source};
use crate::limits::WORKGROUP;
use crate::recorder::Recorder;
use crate::stages::bounds::Scene;
use std::sync::Arc;

/// Candidates that do not certainly stay apart.
#[derive(Debug)]
pub struct NarrowFilter {
    kernels: [Arc<Kernel>; 2],
    /// Left of the candidates (vertex, triangle) and (edge, edge), unordered.
    pub left: [Array<[u32; 2]>; 2],
}

/// The kernel's text for vertices and triangles, and for edges.
pub fn sources() -> [Source; 2] {
    [false, true].map(|edges| {
        Source::new("narrow_filter", include_str!("../../shaders/narrow_filter.wgsl")).switch("EDGES", edges)
    })
}

impl NarrowFilter {
    /// Builds the pipelines; room for `capacity` of each kind.
    ///
    /// # Errors
    /// [`GpuError::Shader`], [`GpuError::TooLarge`], [`GpuError::OutOfMemory`].
    pub fn new(gpu: &Gpu, capacity: usize) -> Result<Self, GpuError> {
        let [vertex_triangle, edge_edge] = sources();
        Ok(Self {
            kernels: [vertex_triangle.kernel(gpu)?, edge_edge.kernel(gpu)?],
            left: [
                Array::new(gpu, "vertex-triangle pairs left", capacity)?,
                Array::new(gpu, "edge-edge pairs left", capacity)?,
            ],
        })
    }

    /// Records the filter of the candidates that the status counts, as far as the lists hold them; of at least `most` of
    /// each kind where there are so many.
    pub fn record(
        &self,
        recorder: &mut Recorder<'_>,
        scene: &Scene,
        candidates: [&Array<[u32; 2]>; 2],
        most: [u32; 2],
    ) {
        recorder.stage("narrow filter");
        for k in 0..2 {
            let corners = if k == 0 { &scene.triangles.raw } else { &scene.edges.raw };
            let arrays =
                [&candidates[k].raw, corners, &scene.positions.raw, &self.left[k].raw, &scene.status.raw];
            recorder.dispatch(&self.kernels[k], &scene.params, &arrays, most[k].div_ceil(WORKGROUP));
        }
    }

    /// Memory [B].
    pub fn bytes(&self) -> u64 {
        self.left[0].bytes() + self.left[1].bytes()
    }
}
