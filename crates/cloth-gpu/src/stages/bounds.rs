//! Boxes and spheres of the triangles, and the scene that they come from.

use crate::buffers::{Array, Length};
use crate::collision::{CollisionMesh, Query};
use crate::context::Gpu;
use crate::error::GpuError;
use crate::frame::Frame;
use crate::kernel::{Kernel, Source};
use crate::layout::{Bounds, SceneParams};
use crate::limits::{WORKGROUP, status};
use crate::recorder::Recorder;
use crate::stages::cells::Registered;
use std::sync::Arc;

/// A scene on the device: its topology, written once, and what each query brings.
#[derive(Debug)]
pub struct Scene {
    /// What the kernels of the scene are told.
    pub params: SceneParams,
    /// See [`triangle_words`].
    pub triangles: Array<[u32; 4]>,
    /// See [`feature_words`].
    pub features: Array<[u32; 4]>,
    /// Ends of each edge.
    pub edges: Array<[u32; 2]>,
    /// See [`Frame::positions`].
    pub positions: Array<[f32; 4]>,
    /// See [`active_words`].
    pub active: Array<u32>,
    /// Boxes of the triangles.
    pub bounds: Array<Bounds>,
    /// Spheres of the triangles: centre, radius.
    pub spheres: Array<[f32; 4]>,
    /// Words of [`status`].
    pub status: Array<u32>,
    kernel: Arc<Kernel>,
}

/// The kernel's text.
pub fn source() -> Source {
    Source::new("triangle_bounds", include_str!("../../shaders/triangle_bounds.wgsl"))
        .include(include_str!("../../shaders/boxes.wgsl"))
}

/// Corners of each triangle, and its body's rules: body << 2 | dynamic << 1 | self-colliding.
pub fn triangle_words(mesh: &CollisionMesh) -> Vec<[u32; 4]> {
    let rules = |v: u32| {
        let b = mesh.vertex_body[v as usize];
        let body = mesh.bodies[b as usize];
        b << 2 | u32::from(body.dynamic) << 1 | u32::from(body.self_collision)
    };
    mesh.triangles.iter().map(|&[a, b, c]| [a, b, c, rules(a)]).collect()
}

/// Edges of each triangle, and which features it owns: bits 0..2 its corners, 3..5 its edges.
pub fn feature_words(mesh: &CollisionMesh) -> Vec<[u32; 4]> {
    let owned = |t: usize| {
        (0..3)
            .map(|k| {
                let vertex = mesh.vertex_owner[mesh.triangles[t][k] as usize] == t as u32;
                let edge = mesh.edge_owner[mesh.triangle_edges[t][k] as usize] == t as u32;
                u32::from(vertex) << k | u32::from(edge) << (3 + k)
            })
            .sum()
    };
    mesh.triangle_edges.iter().enumerate().map(|(t, &[a, b, c])| [a, b, c, owned(t)]).collect()
}

/// Bit per vertex.
pub fn active_words(mask: &[bool]) -> Vec<u32> {
    mask.chunks(32).map(|bits| bits.iter().enumerate().map(|(k, &b)| u32::from(b) << k).sum()).collect()
}

impl Scene {
    /// Writes the topology.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`], [`GpuError::OutOfMemory`], [`GpuError::Shader`].
    pub fn new(gpu: &Gpu, mesh: &CollisionMesh) -> Result<Self, GpuError> {
        let triangles = mesh.triangles.len();
        Ok(Self {
            params: SceneParams { triangles: triangles as u32, ..Default::default() },
            triangles: Array::with(gpu, "triangles", &triangle_words(mesh))?,
            features: Array::with(gpu, "features", &feature_words(mesh))?,
            edges: Array::with(gpu, "edges", &mesh.edges)?,
            positions: Array::new(gpu, "positions", 2 * mesh.vertex_count)?,
            active: Array::new(gpu, "active vertices", mesh.vertex_count.div_ceil(32))?,
            bounds: Array::new(gpu, "triangle boxes", triangles)?,
            spheres: Array::new(gpu, "triangle spheres", triangles)?,
            status: Array::new(gpu, "status", status::LENGTH as usize)?,
            kernel: source().kernel(gpu)?,
        })
    }

    /// Writes the positions of a query.
    pub fn upload(&mut self, gpu: &Gpu, query: &Query<'_>, frame: &Frame) {
        self.positions.write(gpu, &frame.positions);
        if let Some(mask) = query.active {
            self.active.write(gpu, &active_words(mask));
        }
        self.params.second = frame.second;
        self.params.all_active = query.active.is_none().into();
        self.params.thickness = frame.thickness;
        self.params.is_thin = (query.thickness == 0.0).into();
        self.params.low = frame.half.map(|h| -h);
        self.params.high = frame.half;
    }

    /// Records the boxes and spheres; sets the status to zero first.
    pub fn record(&self, recorder: &mut Recorder<'_>) {
        recorder.clear(&self.status, 0..u64::from(status::LENGTH));
        recorder.stage("bounds");
        let arrays = [
            &self.triangles.raw,
            &self.positions.raw,
            &self.active.raw,
            &self.bounds.raw,
            &self.spheres.raw,
            &self.status.raw,
        ];
        recorder.dispatch(&self.kernel, &self.params, &arrays, self.params.triangles.div_ceil(WORKGROUP));
    }

    /// The triangles as what is registered in cells.
    pub fn registered(&self) -> Registered<'_> {
        Registered { spheres: &self.spheres, length: Length::host(self.params.triangles), roots: None }
    }

    /// Memory [B].
    pub fn bytes(&self) -> u64 {
        self.triangles.bytes()
            + self.features.bytes()
            + self.edges.bytes()
            + self.positions.bytes()
            + self.active.bytes()
            + self.bounds.bytes()
            + self.spheres.bytes()
    }
}
