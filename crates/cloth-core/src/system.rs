//! All force models of all cloth of a scene.

use std::borrow::Cow;

use rayon::prelude::*;

use crate::{
    ClothPart, CoreError, EffectInfo, Energy, Environment,
    assembly::{
        Corners, ELEMENTS_PER_CHUNK, ElementBuffers, ForceClock, ROWS_PER_CHUNK, part, parts_mut, surveyed,
        timed,
    },
    bending::HingeState,
    forces::{
        ForceModel, Linear, Survey,
        air::Air,
        stitch::{Stitch, Stitches},
    },
    mesh::Vec3,
};

/// The force models of all parts over one global vertex array.
pub struct ClothSystem {
    masses: Vec<f64>,
    gravity: Vec3,
    wind: Vec3,
    air_damping: f64,
    models: Vec<Box<dyn ForceModel>>,
    /// What the elements of each model remember.
    memory: Vec<Vec<f64>>,
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
            self.memory.push(Vec::new());
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
    fn all_models(&self) -> impl Iterator<Item = (&dyn ForceModel, &[f64])> {
        self.groups().flat_map(|g| g.models.iter().zip(&g.memory).map(|(m, memory)| (&**m, &memory[..])))
    }

    /// Whether any law remembers the path that led to a state.
    pub fn remembers(&self) -> bool {
        self.all_models().any(|(_, memory)| !memory.is_empty())
    }

    /// What laws with memory remember of the path that ends at the accepted positions `x` [m]: with positions and
    /// velocities, the whole state. Empty where no material asks for memory.
    pub fn memory(&self, x: &[Vec3]) -> Vec<f64> {
        self.memory_by_model(x).into_iter().flat_map(Cow::into_owned).collect()
    }

    /// The memory of each model, moved on to `x` if an accepted motion waits for it.
    fn memory_by_model(&self, x: &[Vec3]) -> Vec<Cow<'_, [f64]>> {
        let mut list = Vec::new();
        for group in self.groups() {
            for (model, memory) in group.models.iter().zip(&group.memory) {
                let mut memory = Cow::Borrowed(&memory[..]);
                if group.moved && !memory.is_empty() {
                    model.accept(0..model.count(), x, memory.to_mut());
                }
                list.push(memory);
            }
        }
        list
    }

    /// How many numbers of [`Self::memory`] belong to each part whose law remembers, in the order of the parts.
    pub fn memory_sizes(&self) -> Vec<usize> {
        self.all_models().map(|(_, memory)| memory.len()).filter(|n| *n > 0).collect()
    }

    /// Each hinge of a law with memory as it stands at the accepted positions `x` [m].
    pub fn hinge_states(&self, x: &[Vec3]) -> Vec<HingeState> {
        let memory = self.memory_by_model(x);
        self.all_models().zip(&memory).flat_map(|((model, _), memory)| model.hinge_states(memory)).collect()
    }

    /// Puts back what [`Self::memory`] gave.
    ///
    /// # Errors
    /// [`CoreError::Length`], [`CoreError::NotFinite`].
    pub fn set_memory(&mut self, memory: &[f64]) -> Result<(), CoreError> {
        let expected = self.all_models().map(|(_, memory)| memory.len()).sum();
        if memory.len() != expected {
            return Err(CoreError::Length { name: "memory", expected, got: memory.len() });
        }
        if let Some(index) = memory.iter().position(|m| !m.is_finite()) {
            return Err(CoreError::NotFinite { name: "memory", index, got: memory[index] });
        }
        let Self { memory: own, apart, moved, .. } = self;
        *moved = false;
        let others = apart.iter_mut().flat_map(|apart| {
            apart.moved = false;
            &mut apart.memory
        });
        let mut rest = memory;
        for to in own.iter_mut().chain(others) {
            let mine;
            (mine, rest) = rest.split_at(to.len());
            to.copy_from_slice(mine);
        }
        Ok(())
    }

    /// Marks the motion to the positions of the next step's start as done. Laws with memory move on when that step first
    /// looks at them: by [`Self::settle`], or as they are linearised.
    pub(crate) fn accept(&mut self) {
        self.moved = true;
        if let Some(apart) = &mut self.apart {
            apart.moved = true;
        }
    }

    /// Lets laws with memory move on to `x` if an accepted motion waits for it. Call on the pool.
    pub(crate) fn settle(&mut self, x: &[Vec3]) {
        if std::mem::take(&mut self.moved) {
            for (model, memory) in self.models.iter().zip(&mut self.memory).filter(|(_, m)| !m.is_empty()) {
                parts_mut(memory, model.count()).into_par_iter().enumerate().for_each(|(chunk, memory)| {
                    let start = chunk * ELEMENTS_PER_CHUNK;
                    model.accept(start..(start + ELEMENTS_PER_CHUNK).min(model.count()), x, memory);
                });
            }
        }
        if let Some(apart) = &mut self.apart {
            apart.settle(x);
        }
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
                model.survey(all.clone(), x, &memory, Survey { elastic, work });
            }
            model.add_energy(all.clone(), x, &memory, surveyed(&survey, all), &mut energy);
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
    pub(crate) fn settled_memory(&self) -> &[Vec<f64>] {
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
                        let memory = part(memory, count, range.clone());
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
