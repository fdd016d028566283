//! Bending across hinges: two triangles that share an edge.
//!
//! E = Σ |e| h̄ Ψ(K)   [J],   K = (θ − θ_0)/h̄   [1/m],   Ψ' = M
//!
//! Corners 0, 1 are the shared edge, 2 and 3 the opposite vertices; e = x_1 − x_0, l_0 = x_2 − x_0, l_1 = x_3 − x_0,
//! n_0 = e × l_0, n_1 = l_1 × e. θ = atan2((n_0 × n_1)·ê, n_0·n_1) ∈ [−π, π] is zero when flat and ±π when folded flat;
//! θ_0 its value in the mesh as it came; |e| the rest length of the edge [m]; h̄ the mean of the two rest heights over it
//! [m]; M(K) the moment per width [N] of a [`BendingLaw`]. The linear law M = B K with the rigidity B [N m] has
//! E = |e| B (θ − θ_0)²/(2 h̄) and makes B the rigidity that a textile laboratory measures.
//!
//! Angles of laws with memory go on past ±π: of the angles that differ by 2π, the one next to what is remembered counts.
//!
//! Torque |e| M, force −|e| M dθ/dx with the exact gradient (t_i = l_i·e/|e|²):
//! dθ/dx_2 = −|e| n_0/|n_0|², dθ/dx_3 = −|e| n_1/|n_1|², dθ/dx_0 = −(1 − t_0) dθ/dx_2 − (1 − t_1) dθ/dx_3,
//! dθ/dx_1 = −t_0 dθ/dx_2 − t_1 dθ/dx_3: forces and moments sum to zero.
//!
//! Damping (3.8): torque |e| D θ̇/h̄ with the law's damping D [N m s].
//!
//! Coupled hinges add E_c = Σ C_ij e_i e_j over the pairs of hinges of each triangle ([`Coupled`]), and its torque, with the
//! elastic angles e = h̄ K_e, K_e what the law's elastic part B K_e sees (K less what a path has made of the rest angle).
//! Friction and flow stay with each hinge: E_c is the energy of its torque but where the plastic law flows within a step, and a
//! rest angle that moves takes its part of E_c along. An evaluation takes two passes: the angles of all hinges, then the forces. The
//! tangent takes E_c by its bound.
//!
//! A triangle flatter than 10⁻⁴ of its rest area has its gradient scaled down to zero with its normal, so forces stay
//! finite; there the force is no longer the exact gradient of E.
//!
//! Sources: thesis (3.9), (3.28), (3.29) with atan2 and mesh-independent weights; Pabst et al. 2008 for K.

#![allow(clippy::inline_always, reason = "measured: a call per hinge costs a third of the kernel")]

use std::{f64::consts::PI, ops::Range};

use super::{
    CouplingKind, Couplings, ForceModel, Psd, Survey, corner_pairs,
    coupled::{Coupled, Plate},
};
use crate::{
    CoreError, EffectInfo, Energy,
    bending::{BendingLaw, HingeState, words},
    forces::Outer,
    mesh::Vec3,
};

/// Area relative to rest under which a triangle's normal no longer gives a full gradient.
const COLLAPSED: f64 = 1e-4;

/// Hinges whose angles are computed before their laws.
const BLOCK: usize = 32;

/// Hinges with one law.
pub(crate) struct Hinges<L: BendingLaw> {
    law: L,
    /// D: damping moment per width and rate of curvature [N m s].
    damping: f64,
    vertices: Vec<[u32; 4]>,
    rest: Vec<Rest>,
    coupled: Option<Coupled>,
}

/// Rest data of one hinge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rest {
    /// Length of the shared edge [m].
    pub(crate) edge: f64,
    /// Mean height of the two triangles over it [m].
    pub(crate) height: f64,
    /// Angle in the undeformed state [rad].
    pub(crate) angle: f64,
    /// Least |n|² that gives a full gradient, per triangle [m⁴].
    floor: [f64; 2],
}

impl Rest {
    /// From the edge's rest length [m], the two rest areas [m²] and the rest angle [rad].
    pub(crate) fn new(edge: f64, areas: [f64; 2], angle: f64) -> Self {
        let floor = areas.map(|a| (2.0 * COLLAPSED * a).powi(2));
        Self { edge, height: (areas[0] + areas[1]) / edge, angle, floor }
    }
}

/// Angle and its gradient at one state.
#[derive(Clone, Copy)]
struct Angle {
    value: f64,
    gradient: [Vec3; 4],
}

/// What the elements of a range remember; empty for laws without memory.
fn places<L: BendingLaw>(memory: &[f64]) -> &[L::Memory] {
    if words::<L>() == 0 { &[] } else { bytemuck::cast_slice(memory) }
}

/// As [`places`], to be moved on.
fn places_mut<L: BendingLaw>(memory: &mut [f64]) -> &mut [L::Memory] {
    if words::<L>() == 0 { &mut [] } else { bytemuck::cast_slice_mut(memory) }
}

/// What the element `k` of a range remembers.
#[inline(always)]
fn place<L: BendingLaw>(places: &[L::Memory], k: usize) -> L::Memory {
    if words::<L>() == 0 { L::Memory::default() } else { places[k] }
}

/// Signed dihedral angle [rad] of corners (e0, e1, opposite, opposite).
pub(crate) fn dihedral_angle(x: &[Vec3; 4]) -> f64 {
    let (e, l0, l1) = (x[1] - x[0], x[2] - x[0], x[3] - x[0]);
    let (n0, n1) = (e.cross(&l0), l1.cross(&e));
    // (n_0 × n_1)·ê = −|e| n_0·l_1, exact in sign even when folded flat.
    (-e.norm() * n0.dot(&l1)).atan2(n0.dot(&n1))
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
        Ok(Self { law, damping, vertices, rest, coupled: None })
    }

    /// The same hinges, coupled over these triangles.
    pub(crate) fn coupled(mut self, plates: &[Plate]) -> Self {
        self.coupled = Coupled::new(self.law.elastic_rigidity(), &self.rest, plates);
        self
    }

    /// Change of curvature of a hinge whose angle is `angle` ∈ [−π, π].
    #[inline(always)]
    fn curvature(rest: &Rest, memory: &L::Memory, angle: f64) -> f64 {
        let curvature = (angle - rest.angle) / rest.height;
        match L::last(memory) {
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

    /// dθ/dx of the corners.
    #[inline(always)]
    fn gradient(rest: &Rest, x: &[Vec3; 4]) -> [Vec3; 4] {
        let (e, l0, l1) = (x[1] - x[0], x[2] - x[0], x[3] - x[0]);
        let (n0, n1) = (e.cross(&l0), l1.cross(&e));
        let e2 = e.norm_squared();
        Self::gradient_of(rest, [e, l0, l1, n0, n1], e2, e2.sqrt())
    }

    #[inline(always)]
    fn gradient_of(rest: &Rest, [e, l0, l1, n0, n1]: [Vec3; 5], e2: f64, length: f64) -> [Vec3; 4] {
        let g2 = n0 * (-length / n0.norm_squared().max(rest.floor[0]));
        let g3 = n1 * (-length / n1.norm_squared().max(rest.floor[1]));
        let inverse = 1.0 / e2.max(rest.edge * rest.edge * COLLAPSED * COLLAPSED);
        let (t0, t1) = (l0.dot(&e) * inverse, l1.dot(&e) * inverse);
        let g1 = -(g2 * t0 + g3 * t1);
        let g0 = -(g1 + g2 + g3);
        [g0, g1, g2, g3]
    }

    #[inline(always)]
    fn angle(rest: &Rest, x: &[Vec3; 4]) -> Angle {
        let (e, l0, l1) = (x[1] - x[0], x[2] - x[0], x[3] - x[0]);
        let (n0, n1) = (e.cross(&l0), l1.cross(&e));
        let e2 = e.norm_squared();
        let length = e2.sqrt();
        let value = (-length * n0.dot(&l1)).atan2(n0.dot(&n1));
        Angle { value, gradient: Self::gradient_of(rest, [e, l0, l1, n0, n1], e2, length) }
    }

    /// Place and curvature at the angle `value` of the element `k` of a range; `accept` moves its memory on to there.
    #[inline(always)]
    fn arrive(
        &self,
        rest: &Rest,
        places: &mut [L::Memory],
        k: usize,
        value: f64,
        accept: bool,
    ) -> (L::Memory, f64) {
        let mut place = place::<L>(places, k);
        let curvature = Self::curvature(rest, &place, value);
        if accept {
            self.law.advance(&mut place, curvature);
            if words::<L>() > 0 {
                places[k] = place;
            }
        }
        (place, curvature)
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

    /// Corner forces and exact blocks of an element at a curvature; `neighbours`: their torque [N m].
    #[inline]
    fn exact_blocks(
        &self,
        element: usize,
        x: &[Vec3],
        v: &[Vec3],
        linear: &super::Linear,
        (place, curvature, neighbours): (L::Memory, f64, f64),
        f: &mut [Vec3],
        blocks: &mut [super::Block],
    ) {
        let rest = &self.rest[element];
        let (corners, velocity) = (self.corners_of(element, x), self.corners_of(element, v));
        let gradient = Self::gradient(rest, &corners);
        let rate: f64 = (0..4).map(|c| gradient[c].dot(&velocity[c])).sum();
        let answer = self.law.moment(&place, curvature, rate);
        let per_angle = rest.edge / rest.height;
        let stiffness = per_angle * answer.slope + self.bound(element, linear.iterates);
        let damping = per_angle * self.damping;
        let moment = rest.edge * answer.moment + neighbours;
        let torque = moment + (damping + linear.ahead * stiffness) * rate;
        let change = Self::gradient_change(rest, &corners, &velocity);
        for c in 0..4 {
            f[c] = gradient[c] * -torque - change[c] * (linear.ahead * moment);
        }
        let scale = linear.stiffness * stiffness + linear.damping * damping;
        for b in 0..4 {
            for axis in 0..3 {
                let mut direction = [Vec3::zeros(); 4];
                direction[b][axis] = 1.0;
                let change = Self::gradient_change(rest, &corners, &direction);
                for (p, &(row, column)) in corner_pairs(4).iter().enumerate() {
                    if column == b {
                        let entry = gradient[row] * (scale * gradient[b][axis])
                            + change[row] * (linear.stiffness * moment);
                        blocks[p][3 * axis..3 * axis + 3].copy_from_slice(entry.as_slice());
                    }
                }
            }
        }
    }

    /// dθ/dx's change along corner motions `d`: the exact second derivative of θ applied to `d`.
    fn gradient_change(rest: &Rest, x: &[Vec3; 4], d: &[Vec3; 4]) -> [Vec3; 4] {
        let (e, l0, l1) = (x[1] - x[0], x[2] - x[0], x[3] - x[0]);
        let (de, dl0, dl1) = (d[1] - d[0], d[2] - d[0], d[3] - d[0]);
        let (n0, n1) = (e.cross(&l0), l1.cross(&e));
        let (dn0, dn1) = (de.cross(&l0) + e.cross(&dl0), dl1.cross(&e) + l1.cross(&de));
        let e2 = e.norm_squared().max(rest.edge * rest.edge * COLLAPSED * COLLAPSED);
        let length = e2.sqrt();
        let dlength = e.dot(&de) / length;
        let flap = |n: &Vec3, dn: &Vec3, floor: f64| {
            let n2 = n.norm_squared().max(floor);
            let g = n * (-length / n2);
            let dg = -(n * dlength + dn * length) / n2 + n * (2.0 * length * n.dot(dn) / (n2 * n2));
            (g, dg)
        };
        let ((g2, dg2), (g3, dg3)) = (flap(&n0, &dn0, rest.floor[0]), flap(&n1, &dn1, rest.floor[1]));
        let ratio = |l: &Vec3, dl: &Vec3| {
            let t = l.dot(&e) / e2;
            (t, (dl.dot(&e) + l.dot(&de) - 2.0 * t * e.dot(&de)) / e2)
        };
        let ((t0, dt0), (t1, dt1)) = (ratio(&l0, &dl0), ratio(&l1, &dl1));
        let dg1 = -(g2 * dt0 + dg2 * t0 + g3 * dt1 + dg3 * t1);
        [-(dg1 + dg2 + dg3), dg1, dg2, dg3]
    }
}

impl<L: BendingLaw> ForceModel for Hinges<L> {
    fn info(&self) -> EffectInfo {
        EffectInfo {
            name: L::NAME,
            elements: self.vertices.len(),
            bytes: size_of_val(self.vertices.as_slice())
                + size_of_val(self.rest.as_slice())
                + size_of::<L::Memory>() * self.vertices.len(),
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

    fn unused(&self) -> Vec<f64> {
        if words::<L>() == 0 {
            return Vec::new();
        }
        bytemuck::cast_slice(&vec![L::Memory::default(); self.vertices.len()]).to_vec()
    }

    fn accept(&self, range: Range<usize>, x: &[Vec3], memory: &mut [f64]) {
        for (element, place) in range.zip(places_mut::<L>(memory)) {
            let angle = dihedral_angle(&self.corners_of(element, x));
            self.law.advance(place, Self::curvature(&self.rest[element], place, angle));
        }
    }

    fn hinge_states(&self, memory: &[f64]) -> Vec<HingeState> {
        let state = |(vertices, place): (&[u32; 4], &L::Memory)| {
            let curvature = L::last(place)?;
            let moment = self.law.moment(place, curvature, 0.0).moment;
            Some(HingeState { vertices: *vertices, curvature, moment, place: self.law.place(place) })
        };
        self.vertices.iter().zip(places::<L>(memory)).filter_map(state).collect()
    }

    fn coupled(&self) -> Option<EffectInfo> {
        let bytes = self.coupled.as_ref()?.bytes();
        Some(EffectInfo { name: "hinge coupling", elements: self.vertices.len(), bytes })
    }

    fn survey(&self, range: Range<usize>, x: &[Vec3], memory: &[f64], survey: Survey<&mut [f64]>) {
        let places = places::<L>(memory);
        let out = survey.elastic.iter_mut().zip(survey.work);
        for ((k, element), (elastic, work)) in range.enumerate().zip(out) {
            let (rest, place) = (&self.rest[element], place::<L>(places, k));
            *work = Self::curvature(rest, &place, dihedral_angle(&self.corners_of(element, x)));
            *elastic = rest.height * self.law.elastic(&place, *work);
        }
    }

    fn add_energy(
        &self,
        range: Range<usize>,
        x: &[Vec3],
        memory: &[f64],
        survey: Survey<&[f64]>,
        energy: &mut Energy,
    ) {
        let places = places::<L>(memory);
        for (k, element) in range.enumerate() {
            let (rest, place) = (&self.rest[element], place::<L>(places, k));
            let curvature = if self.coupled.is_some() {
                // Half of each product: its other hinge has the other half.
                let torque = self.neighbour_torque(element, survey.elastic);
                energy.bending += 0.5 * survey.elastic[element] * torque;
                survey.work[k]
            } else {
                Self::curvature(rest, &place, dihedral_angle(&self.corners_of(element, x)))
            };
            energy.bending += rest.edge * rest.height * self.law.moment(&place, curvature, 0.0).energy;
        }
    }

    fn forces(
        &self,
        range: Range<usize>,
        x: &[Vec3],
        v: &[Vec3],
        memory: &[f64],
        survey: Survey<&[f64]>,
        out: &mut [Vec3],
    ) {
        let places = places::<L>(memory);
        for ((k, element), f) in range.enumerate().zip(out.chunks_exact_mut(4)) {
            let (rest, place) = (&self.rest[element], place::<L>(places, k));
            let corners = self.corners_of(element, x);
            let (curvature, gradient, neighbours) = if self.coupled.is_some() {
                let neighbours = self.neighbour_torque(element, survey.elastic);
                (survey.work[k], Self::gradient(rest, &corners), neighbours)
            } else {
                let Angle { value, gradient } = Self::angle(rest, &corners);
                (Self::curvature(rest, &place, value), gradient, 0.0)
            };
            let mut torque = rest.edge * self.law.moment(&place, curvature, 0.0).moment + neighbours;
            if self.damping > 0.0 {
                let rate: f64 = (0..4).map(|c| gradient[c].dot(&v[self.vertices[element][c] as usize])).sum();
                torque += rest.edge * self.damping / rest.height * rate;
            }
            for c in 0..4 {
                f[c] = gradient[c] * -torque;
            }
        }
    }

    fn linearise(
        &self,
        range: Range<usize>,
        x: &[Vec3],
        v: &[Vec3],
        linear: &super::Linear,
        memory: &mut [f64],
        survey: Survey<&mut [f64]>,
        forces: &mut [Vec3],
        couplings: Couplings<'_>,
    ) {
        let places = places_mut::<L>(memory);
        let first = range.start;
        match couplings {
            Couplings::Outer(outer) if self.coupled.is_some() => {
                self.outer::<true>(first, x, v, linear, places, survey, forces, outer);
            }
            Couplings::Outer(outer) => {
                self.outer::<false>(first, x, v, linear, places, survey, forces, outer);
            }
            Couplings::Blocks(blocks) => {
                for ((k, element), (f, blocks)) in
                    range.enumerate().zip(forces.chunks_exact_mut(4).zip(blocks.chunks_exact_mut(6)))
                {
                    let rest = &self.rest[element];
                    let value = dihedral_angle(&self.corners_of(element, x));
                    let (place, curvature) = self.arrive(rest, places, k, value, linear.accept);
                    if self.coupled.is_some() {
                        survey.elastic[k] = rest.height * self.law.elastic(&place, curvature);
                        survey.work[k] = curvature;
                    } else {
                        self.exact_blocks(element, x, v, linear, (place, curvature, 0.0), f, blocks);
                    }
                }
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
        memory: &[f64],
        survey: Survey<&[f64]>,
        forces: &mut [Vec3],
        couplings: Couplings<'_>,
    ) {
        let first = range.start;
        let elements = range.zip(survey.work).zip(forces.chunks_exact_mut(4));
        match couplings {
            Couplings::Outer(outer) => {
                for (((element, own), f), outer) in elements.zip(outer) {
                    let torque = own + self.neighbour_torque(element, survey.elastic);
                    for (f, gradient) in f.iter_mut().zip(&outer.gradient) {
                        *f = Vec3::from(*gradient) * -torque;
                    }
                }
            }
            Couplings::Blocks(blocks) => {
                let places = places::<L>(memory);
                for (k, (((element, curvature), f), blocks)) in
                    elements.zip(blocks.chunks_exact_mut(6)).enumerate()
                {
                    let at =
                        (place::<L>(places, k), *curvature, self.neighbour_torque(element, survey.elastic));
                    self.exact_blocks(element, x, v, linear, at, f, blocks);
                }
            }
            Couplings::Diagonal(_) => unreachable!("hinges couple by blocks, element {first}"),
        }
    }
}

impl<L: BendingLaw> Hinges<L> {
    /// Couplings and corner forces of the elements from `first` on; of coupled ones elastic angles and torques instead of
    /// forces.
    #[inline]
    fn outer<const COUPLED: bool>(
        &self,
        first: usize,
        x: &[Vec3],
        v: &[Vec3],
        linear: &super::Linear,
        places: &mut [L::Memory],
        Survey { elastic, work }: Survey<&mut [f64]>,
        forces: &mut [Vec3],
        outer: &mut [Outer],
    ) {
        let blocks = forces.chunks_mut(4 * BLOCK).zip(outer.chunks_mut(BLOCK));
        for (block, (forces, outer)) in blocks.enumerate() {
            // Angles first, laws after: the laws of several hinges then run side by side.
            let (mut angles, mut rates) = ([0.0; BLOCK], [0.0; BLOCK]);
            for (k, outer) in outer.iter_mut().enumerate() {
                let element = first + block * BLOCK + k;
                let Angle { value, gradient } =
                    Self::angle(&self.rest[element], &self.corners_of(element, x));
                let [v0, v1, v2, v3] = self.corners_of(element, v);
                // Σ g_a = 0, so the rate needs differences only.
                rates[k] =
                    gradient[1].dot(&(v1 - v0)) + gradient[2].dot(&(v2 - v0)) + gradient[3].dot(&(v3 - v0));
                angles[k] = value;
                outer.gradient = gradient.map(Into::into);
            }
            for (k, (f, outer)) in forces.chunks_exact_mut(4).zip(outer).enumerate() {
                let at = block * BLOCK + k;
                let rest = &self.rest[first + at];
                let (place, curvature) = self.arrive(rest, places, at, angles[k], linear.accept);
                let answer = self.law.moment(&place, curvature, rates[k]);
                let per_angle = rest.edge / rest.height;
                // A negative slope has no place in a positive semi-definite block.
                let mut stiffness = per_angle * answer.slope.max(0.0);
                if COUPLED {
                    stiffness += self.bound(first + at, linear.iterates);
                }
                let damping = per_angle * self.damping;
                let torque = rest.edge * answer.moment + (damping + linear.ahead * stiffness) * rates[k];
                if COUPLED {
                    elastic[at] = rest.height * self.law.elastic(&place, curvature);
                    work[at] = torque;
                } else {
                    for (f, gradient) in f.iter_mut().zip(&outer.gradient) {
                        *f = Vec3::from(*gradient) * -torque;
                    }
                }
                outer.scale = linear.stiffness * stiffness + linear.damping * damping;
            }
        }
    }
}

#[cfg(test)]
mod tests;
