//! One grid on the device: what it holds, and how triangles are registered in it.

use super::{Distribution, Duplicates, GridOptions, LAMBDA};
use crate::buffers::Array;
use crate::collision::{CollisionMesh, Contacts, Query};
use crate::context::Gpu;
use crate::error::GpuError;
use crate::frame::Frame;
use crate::layout::Entry;
use crate::limits::status;
use crate::portions::{PortionOptions, Portions, Registrar};
use crate::recorder::{Answer, Recorder};
use crate::stages::bounds::Scene;
use crate::stages::cells::{Cells, key_bits};
use crate::stages::pairs::Entries;
use crate::stages::subdivision::{Subdivision, params};
use crate::topology::OnDevice;
use std::sync::Arc;

/// Most parts: then the cells are made larger.
const MAX_PARTS: usize = 1 << 24;

/// A scene's grid with its room.
#[derive(Debug)]
pub(super) struct Core {
    portions: Portions,
    grid: Grid,
}

#[derive(Debug)]
struct Grid {
    triangle_count: usize,
    subdivision: Option<Subdivision>,
    /// λ, times two for each time that there were too many parts.
    coarseness: f32,
    cells: Cells,
    /// Bits by which the keys are sorted, as the last call had them.
    key_bits: u32,
    registrations: usize,
    parts: u64,
}

impl OnDevice for Core {
    type Options = GridOptions;

    fn new(gpu: Arc<Gpu>, mesh: &CollisionMesh, options: &GridOptions) -> Result<Self, GpuError> {
        let n = mesh.triangles.len();
        let (mut parts, mut subdivision) = (n, None);
        if options.subdivision.is_some() {
            let most = Array::<[f32; 4]>::most(&gpu);
            parts = options.first_capacity.map_or((2 * n).min(most), |c| c as usize).max(n).max(1);
            subdivision = Some(Subdivision::new(&gpu, n as u32, parts)?);
        }
        let registrations = options.first_capacity.map_or(4 * n, |c| c as usize);
        let mut cells = Cells::new(&gpu, parts as u32, registrations.min(Array::<Entry>::most(&gpu)))?;
        cells.sorts_roots = options.duplicates == Duplicates::All;
        let portions = PortionOptions {
            first_capacity: options.first_capacity,
            max_capacity: options.max_capacity,
            max_tests: options.max_tests,
            by_scan: options.distribution == Distribution::SegmentedScan,
            dops: options.dops,
            device_filter: options.device_filter,
        };
        Ok(Self {
            grid: Grid {
                triangle_count: n,
                subdivision,
                coarseness: options.subdivision.unwrap_or(LAMBDA),
                cells,
                key_bits: 24,
                registrations: 0,
                parts: 0,
            },
            portions: Portions::new(gpu, mesh, &portions)?,
        })
    }

    fn bytes(&self) -> u64 {
        let subdivision = self.grid.subdivision.as_ref().map_or(0, Subdivision::bytes);
        self.portions.bytes() + subdivision + self.grid.cells.bytes()
    }

    fn counts(&self) -> Vec<(&'static str, u64)> {
        self.grid.counts()
    }

    fn run(
        &mut self,
        mesh: &CollisionMesh,
        query: &Query<'_>,
        pool: &rayon::ThreadPool,
    ) -> Result<Contacts, GpuError> {
        self.portions.run(&mut self.grid, mesh, query, pool)
    }
}

impl Registrar for Grid {
    fn record(&mut self, recorder: &mut Recorder<'_>, scene: &Scene, frame: &Frame) -> Result<(), GpuError> {
        let cells = &mut self.cells;
        if let Some(subdivision) = &mut self.subdivision {
            let params = params(scene, frame, cells.room(), self.coarseness);
            subdivision.record(recorder, scene, cells, &params)?;
            let parts = subdivision.registered(self.triangle_count as u32);
            cells.record(recorder, parts, &scene.spheres, self.key_bits)
        } else {
            cells.record_setup(recorder, scene);
            cells.record(recorder, scene.registered(), &scene.spheres, self.key_bits)
        }
    }

    fn entries(&self) -> Entries<'_> {
        (&self.cells).into()
    }

    fn download(&self, recorder: &mut Recorder<'_>) -> Vec<usize> {
        let room = self.cells.room() as usize;
        let n = self.triangle_count;
        let mut copies = vec![recorder.download(&self.cells.offsets, room..room + 1)];
        copies.extend(self.subdivision.as_ref().map(|s| recorder.download(&s.sums, n..n + 1)));
        copies
    }

    fn settle(
        &mut self,
        gpu: &Gpu,
        words: &[u32],
        answer: &Answer,
        copies: &[usize],
    ) -> Result<bool, GpuError> {
        self.registrations = answer.read::<u32>(copies[0])[0] as usize;
        self.parts = copies.get(1).map_or(self.triangle_count as u64, |&copy| {
            let [low, high] = answer.read::<[u32; 2]>(copy)[0];
            u64::from(low) | u64::from(high) << 32
        });
        let room = self.cells.room() as usize;
        let fits = self.parts <= room as u64
            && self.registrations <= self.cells.keys.capacity()
            && key_bits(words) <= self.key_bits;
        if let Some(subdivision) = &mut self.subdivision {
            let most = Array::<[f32; 4]>::most(gpu).min(MAX_PARTS) as u64;
            if words[status::TOO_FINE as usize] != 0 || self.parts > most {
                self.coarseness *= 2.0;
                return Ok(true);
            }
            if self.parts > room as u64 {
                let wanted = (self.parts + self.parts / 4).min(most) as usize;
                subdivision.grow(gpu, wanted)?;
                self.cells.grow(gpu, wanted as u32, 0)?;
                // What was registered was a part of it.
                return Ok(true);
            }
        }
        self.cells.grow(gpu, room as u32, self.registrations)?;
        // A bit more, as scenes move; no fewer passes than that needs.
        let bits = key_bits(words);
        self.key_bits = if bits > self.key_bits { bits + 1 } else { self.key_bits.min(bits + 1) };
        Ok(!fits)
    }

    fn counts(&self) -> Vec<(&'static str, u64)> {
        vec![("registrations", self.registrations as u64), ("parts", self.parts)]
    }
}
