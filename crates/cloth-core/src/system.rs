//! All force models of all cloth of a scene.

use std::borrow::Cow;

use rayon::prelude::*;

use crate::{
    Bending, CoreError, EffectInfo, Energy, Environment, InPlane, Material,
    assembly::{
        Corners, ELEMENTS_PER_CHUNK, ElementBuffers, ForceClock, ROWS_PER_CHUNK, part, parts_mut, timed,
    },
    bending::{self, BendingLaw, HingeState},
    forces::{
        ForceModel, Linear,
        air::Air,
        hinge::{Hinges, Rest, dihedral_angle},
        spring::{Role, Springs},
        stretch_shear::{Stiffness, StretchShear},
    },
    mesh::{RestShape, Topology, TriMesh, Vec3},
};

/// One piece of cloth and where its vertices lie in the global arrays.
#[derive(Debug, Clone, Copy)]
pub struct ClothPart<'a> {
    /// Its mesh; rest angles of hinges are read from these positions.
    pub mesh: &'a TriMesh,
    /// Connectivity of the mesh.
    pub topology: &'a Topology,
    /// Undeformed geometry of its triangles.
    pub rest: &'a RestShape,
    /// What it is made of.
    pub material: &'a Material,
    /// Global index of its vertex 0.
    pub first_vertex: usize,
}

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
            for (triangle, area) in global.iter().zip(&part.rest.area) {
                for &v in triangle {
                    masses[v as usize] += part.material.areal_density * area / 3.0;
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
            model.add_energy(0..model.count(), x, &memory, &mut energy);
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
        let Corners { forces, clock } = corners;
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
    /// the gradient of where no model dissipates. Summed by chunks in order. Call on the pool.
    pub(crate) fn potential(&self, x: &[Vec3], v: &[Vec3], dt: f64, clock: &mut ForceClock) -> f64 {
        let mut sum = 0.0;
        for ((model, memory), seconds) in self.models.iter().zip(&self.memory).zip(&mut clock.models) {
            let count = model.count();
            let parts: Vec<f64> = timed(seconds, || {
                (0..count.div_ceil(ELEMENTS_PER_CHUNK))
                    .into_par_iter()
                    .map(|chunk| {
                        let start = chunk * ELEMENTS_PER_CHUNK;
                        let mut energy = Energy::default();
                        let range = start..(start + ELEMENTS_PER_CHUNK).min(count);
                        model.add_energy(range.clone(), x, part(memory, count, range), &mut energy);
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

impl ClothPart<'_> {
    fn check(&self, cloth_vertex_count: usize) -> Result<(), CoreError> {
        self.material.check()?;
        let (vertices, triangles) = (self.mesh.vertices.len(), self.mesh.triangles.len());
        for (name, expected, got) in [
            ("topology.vertex_count", vertices, self.topology.vertex_count),
            ("topology.triangle_edges", triangles, self.topology.triangle_edges.len()),
            ("rest.area", triangles, self.rest.area.len()),
            ("rest.inverse", triangles, self.rest.inverse.len()),
            ("rest.side_lengths", triangles, self.rest.side_lengths.len()),
        ] {
            if expected != got {
                return Err(CoreError::Length { name, expected, got });
            }
        }
        let got = self.first_vertex + vertices;
        if got > cloth_vertex_count {
            return Err(CoreError::Length { name: "cloth vertices", expected: cloth_vertex_count, got });
        }
        Ok(())
    }

    fn global<const N: usize>(&self, local: [u32; N]) -> [u32; N] {
        local.map(|v| v + self.first_vertex as u32)
    }

    fn global_triangles(&self) -> Vec<[u32; 3]> {
        self.mesh.triangles.iter().map(|&t| self.global(t)).collect()
    }

    fn build_in_plane(
        &self,
        triangles: &[[u32; 3]],
        models: &mut Vec<Box<dyn ForceModel>>,
    ) -> Result<(), CoreError> {
        match self.material.in_plane {
            InPlane::Spring { stiffness, damping } if stiffness > 0.0 || damping > 0.0 => {
                let vertices = self.topology.edges.iter().map(|&e| self.global(e)).collect();
                let lengths = self.edge_lengths();
                models.push(Box::new(Springs::new(Role::InPlane, stiffness, damping, vertices, lengths)?));
            }
            InPlane::BaraffWitkin { warp, weft, shear, damping } if warp.max(weft).max(shear) > 0.0 => {
                let stiffness = Stiffness { warp, weft, shear, damping };
                models.push(Box::new(StretchShear::new(
                    stiffness,
                    triangles.to_vec(),
                    &self.rest.inverse,
                    &self.rest.area,
                )?));
            }
            _ => {}
        }
        Ok(())
    }

    fn build_bending(&self, models: &mut Vec<Box<dyn ForceModel>>) -> Result<(), CoreError> {
        let bends = match self.material.bending {
            Bending::None => false,
            Bending::Spring { stiffness, damping } => stiffness > 0.0 || damping > 0.0,
            Bending::Hinge { rigidity, .. } => rigidity > 0.0,
            Bending::Nonlinear(_) | Bending::Plastic(_) | Bending::Hysteresis(_) => true,
        };
        if !bends {
            return Ok(());
        }
        self.topology.require_manifold()?;
        let hinges = &self.topology.hinges;
        if hinges.is_empty() {
            return Ok(());
        }
        let lengths = self.edge_lengths();
        let rest: Vec<Rest> = hinges
            .iter()
            .map(|hinge| {
                let x = [hinge.edge[0], hinge.edge[1], hinge.opposite[0], hinge.opposite[1]]
                    .map(|v| self.mesh.vertices[v as usize]);
                let areas = hinge.triangles.map(|t| self.rest.area[t as usize]);
                Rest::new(lengths[self.edge_of(hinge)], areas, dihedral_angle(&x))
            })
            .collect();
        match self.material.bending {
            Bending::None => {}
            Bending::Spring { stiffness, damping } => {
                let vertices = hinges.iter().map(|h| self.global(h.opposite)).collect();
                let lengths = hinges.iter().zip(&rest).map(|(h, r)| self.opposite_distance(h, r)).collect();
                models.push(Box::new(Springs::new(Role::Bending, stiffness, damping, vertices, lengths)?));
            }
            Bending::Hinge { rigidity, damping } => {
                models.push(self.hinges(bending::Linear::new(rigidity)?, damping * rigidity, rest)?);
            }
            Bending::Nonlinear(given) => {
                let law = given.curve()?;
                models.push(self.hinges(law, given.damping * law.b2(), rest)?);
            }
            Bending::Plastic(given) => {
                models.push(self.hinges(given.law()?, given.damping * given.rigidity, rest)?);
            }
            Bending::Hysteresis(given) => {
                let law = given.law()?;
                models.push(self.hinges(law, given.damping * law.curve().b2(), rest)?);
            }
        }
        Ok(())
    }

    /// The hinges of the part under a law with the damping D [N m s].
    fn hinges<L: BendingLaw + 'static>(
        &self,
        law: L,
        damping: f64,
        rest: Vec<Rest>,
    ) -> Result<Box<dyn ForceModel>, CoreError> {
        let corners = |h: &crate::mesh::Hinge| [h.edge[0], h.edge[1], h.opposite[0], h.opposite[1]];
        let vertices = self.topology.hinges.iter().map(|h| self.global(corners(h))).collect();
        Ok(Box::new(Hinges::new(law, damping, vertices, rest)?))
    }

    /// Rest length of each edge: the mean over the triangles that have it, whose panels may differ at a seam [m].
    fn edge_lengths(&self) -> Vec<f64> {
        let mut sums = vec![(0.0, 0u32); self.topology.edges.len()];
        for (edges, lengths) in self.topology.triangle_edges.iter().zip(&self.rest.side_lengths) {
            for (&edge, length) in edges.iter().zip(lengths) {
                let sum = &mut sums[edge as usize];
                sum.0 += length;
                sum.1 += 1;
            }
        }
        sums.iter().map(|&(sum, count)| sum / f64::from(count)).collect()
    }

    /// Edge of a hinge.
    fn edge_of(&self, hinge: &crate::mesh::Hinge) -> usize {
        let [a, b] = hinge.edge;
        let key = [a.min(b), a.max(b)];
        let edges = self.topology.triangle_edges[hinge.triangles[0] as usize];
        edges.into_iter().find(|&e| self.topology.edges[e as usize] == key).unwrap_or(edges[0]) as usize
    }

    /// Rest distance of a hinge's opposite vertices: its two rest triangles at its rest angle [m].
    fn opposite_distance(&self, hinge: &crate::mesh::Hinge, rest: &Rest) -> f64 {
        // Height over the edge and foot along it, from the side that starts at edge[0].
        let flap = |which: usize| {
            let t = hinge.triangles[which] as usize;
            let triangle = self.mesh.triangles[t];
            let lengths = self.rest.side_lengths[t];
            let height = 2.0 * self.rest.area[t] / rest.edge;
            let side = |from: u32| {
                let pair = [from, hinge.opposite[which]];
                (0..3)
                    .find(|&s| {
                        let ends = [triangle[s], triangle[(s + 1) % 3]];
                        ends == pair || ends == [pair[1], pair[0]]
                    })
                    .map_or(rest.edge, |s| lengths[s])
            };
            let (near, far) = (side(hinge.edge[0]), side(hinge.edge[1]));
            let foot = (near * near - far * far + rest.edge * rest.edge) / (2.0 * rest.edge);
            (foot, height)
        };
        let ((s0, h0), (s1, h1)) = (flap(0), flap(1));
        ((s0 - s1).powi(2) + h0 * h0 + h1 * h1 + 2.0 * h0 * h1 * rest.angle.cos()).sqrt()
    }
}
