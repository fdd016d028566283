//! All force models of all cloth of a scene.

mod memory;

use rayon::prelude::*;

use crate::{
    ClothPart, CoreError, EffectInfo, Energy, Environment,
    assembly::{Corners, ELEMENTS_PER_CHUNK, ElementBuffers, ForceClock, ROWS_PER_CHUNK, surveyed, timed},
    forces::{
        ForceModel, Linear, Survey,
        air::Air,
        memory::{Memory, Past},
        stitch::{Stitch, Stitches},
    },
    mesh::Vec3,
};

pub use memory::History;
#[cfg(test)]
pub(crate) use memory::accept;

/// The force models of all parts over one global vertex array.
pub struct ClothSystem {
    masses: Vec<f64>,
    gravity: Vec3,
    wind: Vec3,
    air_damping: f64,
    models: Vec<Box<dyn ForceModel>>,
    /// What the elements of each model remember.
    memory: Vec<Memory>,
    /// Whether a motion has been accepted that memory has not moved on to yet.
    moved: bool,
    /// First entry of `corner_refs` of each vertex.
    corner_offsets: Vec<u32>,
    /// Corners of each vertex, over all models in order.
    corner_refs: Vec<u32>,
    /// Bending that the scheme steps by itself: the same vertices, without gravity and air.
    apart: Option<Box<ClothSystem>>,
}

impl ClothSystem {
    /// Builds what the parts' materials and the environment call for, over the global vertices
    /// `0..cloth_vertex_count`.
    ///
    /// A stiffness, drag, lift or damping of zero builds nothing.
    ///
    /// # Errors
    /// [`CoreError::Parameter`] for a value out of range, [`CoreError::Degenerate`] naming an element without extent,
    /// [`CoreError::Mesh`] for bending across an edge of more than two triangles, [`CoreError::Length`] for arrays
    /// that do not belong together, [`CoreError::Massless`] for a vertex in no triangle.
    pub fn new(
        parts: &[ClothPart<'_>],
        env: &Environment,
        cloth_vertex_count: usize,
    ) -> Result<Self, CoreError> {
        env.check()?;
        let mut masses = vec![0.0; cloth_vertex_count];
        let mut models: Vec<Box<dyn ForceModel>> = Vec::new();
        let mut triangles = Vec::new();
        for part in parts {
            part.check(cloth_vertex_count)?;
            let global = part.global_triangles();
            for (triangle, t) in global.iter().zip(part.own_triangles()) {
                for &v in triangle {
                    masses[v as usize] += part.material.areal_density * part.rest.area[t] / 3.0;
                }
            }
            part.build_in_plane(&global, &mut models)?;
            part.build_bending(&mut models)?;
            triangles.extend(global);
        }
        if let Some(vertex) = masses.iter().position(|m| !(m.is_finite() && *m > 0.0)) {
            return Err(CoreError::Massless { vertex });
        }
        if env.air_density > 0.0 && (env.drag > 0.0 || env.lift > 0.0) {
            models.push(Box::new(Air {
                wind: env.wind,
                drag: 0.5 * env.air_density * env.drag,
                lift: 0.5 * env.air_density * env.lift,
                vertices: triangles,
            }));
        }

        let (corner_offsets, corner_refs) = corners_by_vertex(&models, cloth_vertex_count);
        Ok(Self {
            masses,
            gravity: env.gravity,
            wind: env.wind,
            air_damping: env.air_damping,
            memory: models.iter().map(|m| m.unused()).collect(),
            models,
            moved: false,
            corner_offsets,
            corner_refs,
            apart: None,
        })
    }

    /// Adds stitches between vertices; none: nothing is built.
    ///
    /// # Errors
    /// [`CoreError::Parameter`] for a gap, stiffness or duration that is negative or not finite; [`CoreError::Length`] for a vertex
    /// that is not there.
    pub fn sew(&mut self, stitches: Vec<Stitch>) -> Result<(), CoreError> {
        for stitch in &stitches {
            for (name, got) in [
                ("gap", stitch.gap),
                ("stiffness", stitch.stiffness),
                ("duration", stitch.duration),
                ("start", stitch.start.abs()),
            ] {
                if !(got.is_finite() && got >= 0.0) {
                    return Err(CoreError::Parameter { name, expected: "a finite number ≥ 0", got });
                }
            }
            let last = stitch.vertices[0].max(stitch.vertices[1]) as usize;
            if last >= self.vertex_count() {
                let expected = self.vertex_count();
                return Err(CoreError::Length { name: "vertices of a stitch", expected, got: last + 1 });
            }
        }
        if !stitches.is_empty() {
            self.models.push(Box::new(Stitches::new(stitches)));
            self.memory.push(Memory::default());
            (self.corner_offsets, self.corner_refs) = corners_by_vertex(&self.models, self.masses.len());
        }
        Ok(())
    }

    /// Says at which time \[s\] forces and energy are asked for: seams close over time.
    pub(crate) fn set_time(&mut self, time: f64) {
        for model in &mut self.models {
            model.set_time(time);
        }
    }

    /// Moves all models that resist bending into a system of their own, [`Self::apart`].
    pub(crate) fn split_bending(&mut self) {
        let (models, rest): (Vec<_>, Vec<_>) =
            std::mem::take(&mut self.models).into_iter().partition(|m| m.bends());
        self.models = rest;
        self.memory = self.models.iter().map(|m| m.unused()).collect();
        (self.corner_offsets, self.corner_refs) = corners_by_vertex(&self.models, self.masses.len());
        let (corner_offsets, corner_refs) = corners_by_vertex(&models, self.masses.len());
        self.apart = Some(Box::new(Self {
            masses: self.masses.clone(),
            gravity: Vec3::zeros(),
            wind: Vec3::zeros(),
            air_damping: 0.0,
            memory: models.iter().map(|m| m.unused()).collect(),
            models,
            moved: false,
            corner_offsets,
            corner_refs,
            apart: None,
        }));
    }

    /// What [`Self::split_bending`] took out.
    pub(crate) fn apart(&self) -> Option<&Self> {
        self.apart.as_deref()
    }

    /// The system itself and what steps apart.
    fn groups(&self) -> impl Iterator<Item = &Self> {
        std::iter::once(self).chain(self.apart())
    }

    /// All models with their memory: those stepped together, then those apart.
    fn all_models(&self) -> impl Iterator<Item = (&dyn ForceModel, &Memory)> {
        self.groups().flat_map(|g| g.models.iter().zip(&g.memory).map(|(m, memory)| (&**m, memory)))
    }

    /// Corner forces and couplings of all models at (x, v). If an accepted motion waits, it is the one to `x`, and laws with
    /// memory move on in the same pass. Call on the pool.
    pub(crate) fn linearise(
        &mut self,
        elements: &mut ElementBuffers,
        corners: &mut Corners,
        x: &[Vec3],
        v: &[Vec3],
        linear: Linear,
    ) {
        let linear = Linear { accept: std::mem::take(&mut self.moved), ..linear };
        elements.linearise(&self.models, &mut self.memory, corners, x, v, &linear);
    }

    /// Number of cloth vertices.
    pub fn vertex_count(&self) -> usize {
        self.masses.len()
    }

    /// Mass of each vertex, a third of each of its triangles' [kg].
    pub fn masses(&self) -> &[f64] {
        &self.masses
    }

    /// Energies of an accepted state (positions [m], velocities [m/s]).
    pub fn energy(&self, x: &[Vec3], v: &[Vec3]) -> Energy {
        let mut energy = Energy::default();
        for ((model, _), memory) in self.all_models().zip(self.memory_by_model(x)) {
            let all = 0..model.count();
            let mut survey = Survey::new(model);
            if !survey.work.is_empty() {
                let Survey { elastic, work } = &mut survey;
                model.survey(all.clone(), x, memory.part(all.len(), all.clone()), Survey { elastic, work });
            }
            let memory = memory.part(all.len(), all.clone());
            model.add_energy(all.clone(), x, memory, surveyed(&survey, all), &mut energy);
        }
        for ((m, x), v) in self.masses.iter().zip(x).zip(v) {
            energy.kinetic += 0.5 * m * v.norm_squared();
            energy.gravity -= m * self.gravity.dot(x);
        }
        energy
    }

    /// Forces on the cloth vertices [N] in a state, written over `out[..vertex_count]`.
    pub fn forces(&self, x: &[Vec3], v: &[Vec3], out: &mut [Vec3], pool: &rayon::ThreadPool) {
        let mut corners = Corners::new(&self.models);
        pool.install(|| self.evaluate(&mut corners, x, v, out));
        if let Some(apart) = &self.apart {
            let mut bending = vec![Vec3::zeros(); self.vertex_count()];
            apart.forces(x, v, &mut bending, pool);
            for (out, f) in out.iter_mut().zip(bending) {
                *out += f;
            }
        }
    }

    /// What is built, in the order in which it is evaluated.
    pub fn effects(&self) -> Vec<EffectInfo> {
        let mut effects: Vec<_> = self.all_models().map(|(model, _)| model.info()).collect();
        let elements = self.vertex_count();
        if self.gravity != Vec3::zeros() {
            effects.push(EffectInfo { name: "gravity", elements, bytes: 0 });
        }
        if self.air_damping > 0.0 {
            effects.push(EffectInfo { name: "air-damping", elements, bytes: 0 });
        }
        effects
    }

    /// What coupling the hinges takes: hinges coupled and memory; 0 where no material asks for it.
    pub fn hinge_coupling(&self) -> EffectInfo {
        let none = EffectInfo { name: "hinge coupling", elements: 0, bytes: 0 };
        self.all_models().filter_map(|(model, _)| model.coupled()).fold(none, |sum, own| EffectInfo {
            elements: sum.elements + own.elements,
            bytes: sum.bytes + own.bytes,
            ..sum
        })
    }

    /// Seconds of each effect by name, in the order of [`Self::effects`]; models of one name are summed.
    pub(crate) fn seconds(&self, clock: &ForceClock) -> Vec<(&'static str, f64)> {
        let mut list: Vec<(&'static str, f64)> = Vec::new();
        let own = [("gravity", clock.gravity), ("air-damping", clock.air_damping)];
        let own = own.into_iter().filter(|(name, _)| match *name {
            "gravity" => self.gravity != Vec3::zeros(),
            _ => self.air_damping > 0.0,
        });
        let models = self.models.iter().zip(&clock.models).map(|(m, s)| (m.info().name, *s));
        for (name, seconds) in models.chain(own) {
            match list.iter_mut().find(|(known, _)| *known == name) {
                Some((_, sum)) => *sum += seconds,
                None => list.push((name, seconds)),
            }
        }
        list
    }

    pub(crate) fn models(&self) -> &[Box<dyn ForceModel>] {
        &self.models
    }

    /// What the elements of each model remember.
    pub(crate) fn settled_memory(&self) -> &[Memory] {
        &self.memory
    }

    /// Rate c of the damping −c m (v − wind) [1/s].
    pub(crate) fn air_damping(&self) -> f64 {
        self.air_damping
    }

    /// Whether any force is not the gradient of [`Self::potential`].
    pub(crate) fn dissipates(&self) -> bool {
        self.models.iter().any(|m| m.dissipates())
    }

    /// How much stiffer than at rest the stiffest law may become on a path.
    pub(crate) fn stiffening(&self) -> f64 {
        self.models.iter().map(|m| m.stiffening()).fold(1.0, f64::max)
    }

    /// Forces with work space of the caller's. Call on the pool.
    pub(crate) fn evaluate(&self, corners: &mut Corners, x: &[Vec3], v: &[Vec3], out: &mut [Vec3]) {
        corners.evaluate(&self.models, &self.memory, x, v);
        self.gather(corners, v, 1.0, &mut out[..self.vertex_count()]);
    }

    /// `scale` times the sum of corner forces, gravity and air damping at each vertex. Call on the pool.
    ///
    /// Gravity and air damping go before, as accelerations in passes of their own, and are timed. The corner forces of
    /// all models are taken in one pass over the vertices, which has no part per model.
    pub(crate) fn gather(&self, corners: &mut Corners, v: &[Vec3], scale: f64, out: &mut [Vec3]) {
        let Corners { forces, clock, .. } = corners;
        if self.gravity == Vec3::zeros() {
            out.fill(Vec3::zeros());
        } else {
            timed(&mut clock.gravity, || out.fill(self.gravity));
        }
        if self.air_damping > 0.0 {
            timed(&mut clock.air_damping, || {
                for (out, v) in out.iter_mut().zip(v) {
                    *out -= (v - self.wind) * self.air_damping;
                }
            });
        }
        out.par_chunks_mut(ROWS_PER_CHUNK).enumerate().for_each(|(chunk, out)| {
            for (vertex, out) in (chunk * ROWS_PER_CHUNK..).zip(out) {
                let mut sum = *out * self.masses[vertex];
                let refs = self.corner_offsets[vertex] as usize..self.corner_offsets[vertex + 1] as usize;
                for &corner in &self.corner_refs[refs] {
                    sum += forces[corner as usize];
                }
                *out = sum * scale;
            }
        });
    }

    /// Whether air acts on the cloth.
    pub(crate) fn has_air(&self) -> bool {
        self.air_damping > 0.0 || self.models.iter().any(|m| m.is_air())
    }

    /// Work of the air at (x, v) along the ways `d` of all vertices [J]: of drag and lift on triangles, and of damping. Summed by
    /// chunks in order. Call on the pool.
    pub(crate) fn air_work(&self, x: &[Vec3], v: &[Vec3], d: &[Vec3]) -> f64 {
        let mut sum = 0.0;
        for model in self.models.iter().filter(|m| m.is_air()) {
            let (count, corners) = (model.count(), model.corners());
            let chunk = |chunk: usize| {
                let range = chunk * ELEMENTS_PER_CHUNK..((chunk + 1) * ELEMENTS_PER_CHUNK).min(count);
                let mut forces = vec![Vec3::zeros(); corners * range.len()];
                let own = &model.vertices()[corners * range.start..corners * range.end];
                model.forces(range, x, v, Past::Dense(&[]), Survey::default(), &mut forces);
                forces.iter().zip(own).map(|(f, &i)| f.dot(&d[i as usize])).sum::<f64>()
            };
            let parts: Vec<f64> =
                (0..count.div_ceil(ELEMENTS_PER_CHUNK)).into_par_iter().map(chunk).collect();
            sum += parts.iter().sum::<f64>();
        }
        if self.air_damping > 0.0 {
            for ((m, v), d) in self.masses.iter().zip(v).zip(d) {
                sum -= self.air_damping * m * (v - self.wind).dot(d);
            }
        }
        sum
    }

    /// Elastic and gravity energy, and the potential of air damping over a step: what the forces on a step's end are
    /// the gradient of where no model dissipates. Summed by chunks in order. Call on the pool, with the corners that forces at
    /// `x` were evaluated in last.
    pub(crate) fn potential(&self, x: &[Vec3], v: &[Vec3], dt: f64, corners: &mut Corners) -> f64 {
        let mut sum = 0.0;
        let clocks = corners.surveys.iter().zip(&mut corners.clock.models);
        for ((model, memory), (survey, seconds)) in self.models.iter().zip(&self.memory).zip(clocks) {
            let count = model.count();
            let parts: Vec<f64> = timed(seconds, || {
                (0..count.div_ceil(ELEMENTS_PER_CHUNK))
                    .into_par_iter()
                    .map(|chunk| {
                        let start = chunk * ELEMENTS_PER_CHUNK;
                        let mut energy = Energy::default();
                        let range = start..(start + ELEMENTS_PER_CHUNK).min(count);
                        let memory = memory.part(count, range.clone());
                        model.add_energy(range.clone(), x, memory, surveyed(survey, range), &mut energy);
                        energy.elastic()
                    })
                    .collect()
            });
            sum += parts.iter().sum::<f64>();
        }
        for ((m, x), v) in self.masses.iter().zip(x).zip(v) {
            let damping = 0.5 * dt * self.air_damping * (v - self.wind).norm_squared();
            sum += m * (damping - self.gravity.dot(x));
        }
        sum
    }
}

/// For each vertex where its corners start, and the corners of all models, vertex by vertex.
fn corners_by_vertex(models: &[Box<dyn ForceModel>], vertex_count: usize) -> (Vec<u32>, Vec<u32>) {
    let mut offsets = vec![0u32; vertex_count + 1];
    for &v in models.iter().flat_map(|m| m.vertices()) {
        offsets[v as usize + 1] += 1;
    }
    for v in 0..vertex_count {
        offsets[v + 1] += offsets[v];
    }
    let mut next = offsets.clone();
    let mut refs = vec![0u32; offsets[vertex_count] as usize];
    for (corner, &v) in models.iter().flat_map(|m| m.vertices()).enumerate() {
        refs[next[v as usize] as usize] = corner as u32;
        next[v as usize] += 1;
    }
    (offsets, refs)
}
