//! Bending across hinges: two triangles that share an edge.
//!
//! E = Σ |e| h̄ Ψ(K)   [J],   K = (θ − θ_0)/h̄   [1/m],   Ψ' = M
//!
//! θ is the angle of [`super::dihedral`], θ_0 its value in the mesh as it came; |e| the rest length of the shared edge [m];
//! h̄ the mean of the two rest heights over it [m]; M(K) the moment per width [N] of a [`BendingLaw`]. The linear law M = B K with the rigidity B [N m] has
//! E = |e| B (θ − θ_0)²/(2 h̄) and makes B the rigidity that a textile laboratory measures.
//!
//! Angles of laws with memory go on past ±π: of the angles that differ by 2π, the one next to what is remembered counts.
//! Where hinges remember only once they have left the elastic range ([`ForceModel::remember_beyond`]), the others answer as unused
//! places do, and the angle next to the one at rest counts: the same but for a hinge that turns from less than [`OPEN`] to past ±π
//! within one step.
//!
//! Torque |e| M, force −|e| M dθ/dx with the exact gradient: forces and moments sum to zero.
//!
//! Damping (3.8): torque |e| D θ̇/h̄ with the law's damping D [N m s].
//!
//! Coupled hinges add E_c = Σ C_ij e_i e_j over the pairs of hinges of each triangle ([`Coupled`]), and its torque, with the
//! elastic angles e = h̄ K_e, K_e what the law's elastic part B K_e sees (K less what a path has made of the rest angle).
//! Friction and flow stay with each hinge: E_c is the energy of its torque but where the plastic law flows within a step, and a
//! rest angle that moves takes its part of E_c along. An evaluation takes two passes: the angles of all hinges, then the forces. The
//! tangent takes E_c by its bound.
//!
//! Sources: thesis (3.9), (3.28), (3.29) with atan2 and mesh-independent weights; Pabst et al. 2008 for K.

#![allow(clippy::inline_always, reason = "measured: a call per hinge costs a third of the kernel")]

use std::{f64::consts::PI, ops::Range};

mod exact;
mod kernels;
mod places;

use super::{
    CouplingKind, Couplings, ForceModel, Psd, Survey,
    coupled::{Coupled, Plate},
    dihedral::{Rest, dihedral_angle},
    memory::{Memory, Past, PastMut},
};
use crate::{
    CoreError, EffectInfo, Energy,
    bending::{BendingLaw, HingeState, Moment, words},
    forces::Outer,
    mesh::Vec3,
};
use places::{All, Few, Growing, Places, PlacesMut};

/// Hinges whose angles are computed before their laws.
const BLOCK: usize = 32;

/// Largest change of its angle at which a hinge without history stays without [rad]: far from ±π, past which history tells turns
/// apart.
const OPEN: f64 = PI / 4.0;

/// Hinges with one law.
pub(crate) struct Hinges<L: BendingLaw> {
    law: L,
    /// D: damping moment per width and rate of curvature [N m s].
    damping: f64,
    vertices: Vec<[u32; 4]>,
    rest: Vec<Rest>,
    coupled: Option<Coupled>,
    /// Of hinges that remember only beyond the elastic range: what may be neglected there, see [`BendingLaw::leaves`].
    lean: Option<f64>,
}

/// Numbers as places; none for laws without memory.
fn places<L: BendingLaw>(memory: &[f64]) -> &[L::Memory] {
    if words::<L>() == 0 { &[] } else { bytemuck::cast_slice(memory) }
}

/// As [`places`], to be moved on.
fn places_mut<L: BendingLaw>(memory: &mut [f64]) -> &mut [L::Memory] {
    if words::<L>() == 0 { &mut [] } else { bytemuck::cast_slice_mut(memory) }
}

/// Runs a kernel with the places of a range of hinges that begins at `first`, in the way in which they are kept.
macro_rules! with_places {
    ($memory:expr, $first:expr, |$places:ident| $kernel:expr) => {
        match $memory {
            Past::Dense(memory) => {
                let $places = &mut All(places::<L>(memory));
                $kernel
            }
            Past::Sparse(elements, memory) => {
                let $places = &mut Few::new($first, elements, places::<L>(memory));
                $kernel
            }
        }
    };
}

/// As [`with_places`], with places that can be moved on.
macro_rules! with_places_mut {
    ($memory:expr, $first:expr, |$places:ident| $kernel:expr) => {
        match $memory {
            PastMut::Dense(memory) => {
                let $places = &mut All(places_mut::<L>(memory));
                $kernel
            }
            PastMut::Sparse { elements, numbers, found } => {
                let few = Few::new($first, elements, places_mut::<L>(numbers));
                let $places = &mut Growing { few, found };
                $kernel
            }
        }
    };
}

impl<L: BendingLaw> Hinges<L> {
    /// Hinges over global `vertices` (e0, e1, opposite, opposite) with their rest data; `damping` D [N m s].
    ///
    /// # Errors
    /// [`CoreError::Degenerate`] for a hinge whose edge or height is not positive.
    pub(crate) fn new(
        law: L,
        damping: f64,
        vertices: Vec<[u32; 4]>,
        rest: Vec<Rest>,
    ) -> Result<Self, CoreError> {
        for (element, r) in rest.iter().enumerate() {
            for (measure, got) in [("rest edge in m", r.edge), ("rest height in m", r.height)] {
                if !(got.is_finite() && got > 0.0) {
                    let vertices = vertices[element].to_vec();
                    return Err(CoreError::Degenerate { model: L::NAME, element, vertices, measure, got });
                }
            }
        }
        Ok(Self { law, damping, vertices, rest, coupled: None, lean: None })
    }

    /// The same hinges, coupled over these triangles.
    pub(crate) fn coupled(mut self, plates: &[Plate]) -> Self {
        self.coupled = Coupled::new(self.law.elastic_rigidity(), &self.rest, plates);
        self
    }

    /// Change of curvature of a hinge whose angle is `angle` ∈ [−π, π].
    #[inline(always)]
    fn curvature(rest: &Rest, place: Option<&L::Memory>, angle: f64) -> f64 {
        let curvature = (angle - rest.angle) / rest.height;
        match place.map_or_else(|| L::last(&L::Memory::default()), L::last) {
            Some(last) if (last - curvature).abs() * rest.height > PI => {
                let turn = 2.0 * PI / rest.height;
                curvature + turn * ((last - curvature) / turn).round()
            }
            _ => curvature,
        }
    }

    #[inline]
    fn corners_of(&self, element: usize, x: &[Vec3]) -> [Vec3; 4] {
        self.vertices[element].map(|i| x[i as usize])
    }

    /// What the law answers at a curvature; `None`: at a place without history.
    #[inline(always)]
    fn answer(&self, place: Option<&L::Memory>, curvature: f64, rate: f64) -> Moment {
        match place {
            Some(place) => self.law.moment(place, curvature, rate),
            None => self.law.fresh(curvature, rate),
        }
    }

    /// K_e at a curvature [1/m].
    #[inline(always)]
    fn elastic(&self, place: Option<&L::Memory>, curvature: f64) -> f64 {
        match place {
            Some(place) => self.law.elastic(place, curvature),
            None => self.law.elastic(&L::Memory::default(), curvature),
        }
    }

    /// Place and curvature at the angle `value` of the element `k` of a range; `accept` moves its memory on to there.
    #[inline(always)]
    fn arrive(
        &self,
        rest: &Rest,
        places: &mut impl PlacesMut<L>,
        k: usize,
        value: f64,
        accept: bool,
    ) -> (Option<L::Memory>, f64) {
        let place = places.get(k);
        let curvature = Self::curvature(rest, place.as_ref(), value);
        if !accept || (place.is_none() && self.stays(rest, curvature)) {
            return (place, curvature);
        }
        let mut place = place.unwrap_or_default();
        self.law.advance(&mut place, curvature);
        places.put(k, place);
        (Some(place), curvature)
    }

    /// Whether a hinge without history needs none at a curvature either.
    #[inline(always)]
    fn stays(&self, rest: &Rest, curvature: f64) -> bool {
        let neglected = self.lean.unwrap_or(0.0);
        curvature.abs() * rest.height <= OPEN && !self.law.leaves(curvature, neglected)
    }

    /// Torque of its neighbours on an element [N m].
    #[inline(always)]
    fn neighbour_torque(&self, element: usize, elastic: &[f64]) -> f64 {
        self.coupled.as_ref().map_or(0.0, |coupled| coupled.torque(element, elastic))
    }

    /// What the matrix takes for its products with its neighbours [N m].
    #[inline(always)]
    fn bound(&self, element: usize, iterates: bool) -> f64 {
        self.coupled.as_ref().map_or(0.0, |coupled| coupled.bounds(iterates)[element])
    }
}

impl<L: BendingLaw> ForceModel for Hinges<L> {
    fn info(&self) -> EffectInfo {
        EffectInfo {
            name: L::NAME,
            elements: self.vertices.len(),
            bytes: size_of_val(self.vertices.as_slice())
                + size_of_val(self.rest.as_slice())
                + if self.lean.is_some() { 0 } else { size_of::<L::Memory>() * self.vertices.len() },
        }
    }

    fn corners(&self) -> usize {
        4
    }

    fn vertices(&self) -> &[u32] {
        self.vertices.as_flattened()
    }

    fn coupling(&self, psd: Psd) -> CouplingKind {
        match psd {
            Psd::Raw => CouplingKind::Blocks,
            Psd::Projected => CouplingKind::Outer,
        }
    }

    fn bends(&self) -> bool {
        true
    }

    fn dissipates(&self) -> bool {
        self.damping > 0.0 || !L::CONSERVATIVE
    }

    fn stiffening(&self) -> f64 {
        self.law.stiffening()
    }

    fn remember_beyond(&mut self, neglected: f64) {
        if words::<L>() > 0 {
            self.lean = Some(neglected);
        }
    }

    fn unused(&self) -> Memory {
        if words::<L>() == 0 {
            return Memory::default();
        }
        if self.lean.is_some() {
            return Memory::sparse(words::<L>());
        }
        Memory::Dense(bytemuck::cast_slice(&vec![L::Memory::default(); self.vertices.len()]).to_vec())
    }

    fn accept(&self, range: Range<usize>, x: &[Vec3], memory: PastMut<'_>) {
        with_places_mut!(memory, range.start, |places| self.advance(range, x, places));
    }

    fn hinge_states(&self, x: &[Vec3], memory: &Memory) -> Vec<HingeState> {
        if words::<L>() == 0 {
            return Vec::new();
        }
        let state = |(element, place): (usize, Option<L::Memory>)| {
            let angle = || dihedral_angle(&self.corners_of(element, x));
            let curvature = place.as_ref().and_then(L::last);
            let curvature = curvature.unwrap_or_else(|| Self::curvature(&self.rest[element], None, angle()));
            let moment = self.answer(place.as_ref(), curvature, 0.0).moment;
            let place = self.law.place(&place.unwrap_or_default());
            HingeState { vertices: self.vertices[element], curvature, moment, place }
        };
        let all = 0..self.vertices.len();
        with_places!(memory.part(all.len(), all.clone()), 0, |places| {
            all.map(|k| state((k, Places::<L>::get(places, k)))).collect()
        })
    }

    fn coupled(&self) -> Option<EffectInfo> {
        let bytes = self.coupled.as_ref()?.bytes();
        Some(EffectInfo { name: "hinge coupling", elements: self.vertices.len(), bytes })
    }

    fn survey(&self, range: Range<usize>, x: &[Vec3], memory: Past<'_>, survey: Survey<&mut [f64]>) {
        with_places!(memory, range.start, |places| self.look(range, x, places, survey));
    }

    fn add_energy(
        &self,
        range: Range<usize>,
        x: &[Vec3],
        memory: Past<'_>,
        survey: Survey<&[f64]>,
        energy: &mut Energy,
    ) {
        with_places!(memory, range.start, |places| {
            self.add_bending(range, x, places, survey, &mut energy.bending);
        });
    }

    fn forces(
        &self,
        range: Range<usize>,
        x: &[Vec3],
        v: &[Vec3],
        memory: Past<'_>,
        survey: Survey<&[f64]>,
        out: &mut [Vec3],
    ) {
        with_places!(memory, range.start, |places| self.push(range, x, v, places, survey, out));
    }

    fn linearise(
        &self,
        range: Range<usize>,
        x: &[Vec3],
        v: &[Vec3],
        linear: &super::Linear,
        memory: PastMut<'_>,
        survey: Survey<&mut [f64]>,
        forces: &mut [Vec3],
        couplings: Couplings<'_>,
    ) {
        let first = range.start;
        match couplings {
            Couplings::Outer(outer) if self.coupled.is_some() => {
                with_places_mut!(memory, first, |places| {
                    self.outer::<true>(first, x, v, linear, places, survey, forces, outer);
                });
            }
            Couplings::Outer(outer) => {
                with_places_mut!(memory, first, |places| {
                    self.outer::<false>(first, x, v, linear, places, survey, forces, outer);
                });
            }
            Couplings::Blocks(blocks) => {
                with_places_mut!(memory, first, |places| {
                    self.blocks(range, x, v, linear, places, survey, forces, blocks);
                });
            }
            Couplings::Diagonal(_) => unreachable!("hinges couple by blocks, element {first}"),
        }
    }

    fn add_beyond(&self, couplings: &[Outer], d: &[Vec3], out: &mut [Vec3]) {
        let Some(coupled) = &self.coupled else { return };
        let elements = || couplings.iter().zip(&self.vertices);
        let turn = |(outer, vertices): (&Outer, &[u32; 4])| -> f64 {
            outer.gradient.iter().zip(vertices).map(|(g, &v)| Vec3::from(*g).dot(&d[v as usize])).sum()
        };
        let turns: Vec<f64> = elements().map(turn).collect();
        for (element, (outer, vertices)) in elements().enumerate() {
            let torque = coupled.torque(element, &turns) - coupled.bounds(false)[element] * turns[element];
            for (g, &v) in outer.gradient.iter().zip(vertices) {
                out[v as usize] += Vec3::from(*g) * torque;
            }
        }
    }

    fn couple(
        &self,
        range: Range<usize>,
        x: &[Vec3],
        v: &[Vec3],
        linear: &super::Linear,
        memory: Past<'_>,
        survey: Survey<&[f64]>,
        forces: &mut [Vec3],
        couplings: Couplings<'_>,
    ) {
        let first = range.start;
        match couplings {
            Couplings::Outer(outer) => {
                let elements = range.zip(survey.work).zip(forces.chunks_exact_mut(4));
                for (((element, own), f), outer) in elements.zip(outer) {
                    let torque = own + self.neighbour_torque(element, survey.elastic);
                    for (f, gradient) in f.iter_mut().zip(&outer.gradient) {
                        *f = Vec3::from(*gradient) * -torque;
                    }
                }
            }
            Couplings::Blocks(blocks) => {
                with_places!(memory, first, |places| {
                    self.couple_blocks(range, x, v, linear, places, survey, forces, blocks);
                });
            }
            Couplings::Diagonal(_) => unreachable!("hinges couple by blocks, element {first}"),
        }
    }
}

#[cfg(test)]
mod tests;
