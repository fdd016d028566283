//! A topology on the device: whole while that goes, else in chunks.

use crate::chunks;
use crate::collision::{CollisionMesh, Contacts, DetectError, Query};
use crate::context::Gpu;
use crate::error::GpuError;
use crate::layout::Entry;
use std::sync::Arc;

/// Registrations per triangle that a chunk has room for.
const PER_TRIANGLE: usize = 4;

/// What a method holds on the device for one topology, and how a query goes through it.
pub(crate) trait OnDevice: Sized {
    /// Of the method.
    type Options;

    fn new(gpu: Arc<Gpu>, mesh: &CollisionMesh, options: &Self::Options) -> Result<Self, GpuError>;

    /// Memory on the device \[B\].
    fn bytes(&self) -> u64;

    /// What the last run counted, by name; zeros before the first.
    fn counts(&self) -> Vec<(&'static str, u64)>;

    fn run(
        &mut self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        pool: &rayon::ThreadPool,
    ) -> Result<Contacts, GpuError>;
}

/// The topology of a detector.
#[derive(Debug)]
pub(crate) struct Topology<M: OnDevice> {
    gpu: Arc<Gpu>,
    options: M::Options,
    vertex_count: usize,
    triangle_count: usize,
    max_triangles: usize,
    /// None: in chunks.
    whole: Option<M>,
}

impl<M: OnDevice> Topology<M> {
    /// `max_triangles`: most at a time; None: as many as the bindings hold with four registrations each.
    pub(crate) fn new(
        gpu: Arc<Gpu>,
        mesh: &CollisionMesh,
        options: M::Options,
        max_triangles: Option<u32>,
    ) -> Result<Self, GpuError> {
        let bound = gpu.max_binding as usize / (PER_TRIANGLE * size_of::<Entry>());
        let max_triangles = max_triangles.map_or(bound, |m| m as usize).max(1);
        let whole = if mesh.triangles.len() > max_triangles {
            None
        } else {
            match M::new(gpu.clone(), mesh, &options) {
                Err(error) if chunks::would_help(&error) => None,
                method => Some(method?),
            }
        };
        let (vertex_count, triangle_count) = (mesh.vertex_count, mesh.triangles.len());
        Ok(Self { gpu, options, vertex_count, triangle_count, max_triangles, whole })
    }

    pub(crate) fn options(&self) -> &M::Options {
        &self.options
    }

    /// What is on the device; None where the scene goes in chunks, which keep nothing.
    pub(crate) fn whole(&self) -> Option<&M> {
        self.whole.as_ref()
    }

    /// Memory on the device [B].
    pub(crate) fn bytes(&self) -> u64 {
        self.whole.as_ref().map_or(0, M::bytes)
    }

    /// The contacts, by the method called `detector`.
    pub(crate) fn detect(
        &mut self,
        detector: &'static str,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        pool: &rayon::ThreadPool,
    ) -> Result<Contacts, DetectError> {
        query.check(mesh)?;
        if mesh.triangles.len() != self.triangle_count || mesh.vertex_count != self.vertex_count {
            return Err(DetectError::OtherMesh { expected: self.triangle_count, got: mesh.triangles.len() });
        }
        if mesh.triangles.is_empty() {
            let mut nothing = Contacts::default();
            nothing.stats.counts = self.whole.as_ref().map_or(vec![], M::counts);
            return Ok(nothing);
        }
        self.run(mesh, query, pool).map_err(|error| match error {
            GpuError::Query(error) => error,
            error => DetectError::Device { detector, reason: error.to_string() },
        })
    }

    fn run(
        &mut self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        pool: &rayon::ThreadPool,
    ) -> Result<Contacts, GpuError> {
        if let Some(whole) = &mut self.whole {
            match whole.run(mesh, query, pool) {
                Err(error) if chunks::would_help(&error) => self.whole = None,
                answer => return answer,
            }
        }
        let (gpu, options) = (&self.gpu, &self.options);
        chunks::detect(mesh, query, self.max_triangles, |mesh, query| {
            M::new(gpu.clone(), mesh, options)?.run(mesh, query, pool)
        })
    }
}
